"""Journal of outcomes: appended to a file, a block of lines for each; a block that a kill left cut is dropped.

A block is the rows of the tables, a line each, and a last line, which states how many bytes precede it and their
CRC-32: only with it the block counts.
"""

from __future__ import annotations

import json
import os
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from canid.errors import OutputError
from canid.fleet import typed_rows

# s; what a power cut may cost. A disk syncs in 1 to 20 ms, logs of a second on many cores come every few
SYNC_S = 1.0
# outcomes after which it is synced in any case
SYNC_OUTCOMES = 64
LAST = "outcomes"


class Block(NamedTuple):
    """One outcome in a journal."""

    row: Mapping[str, Any]  # of the last line
    start: int  # bytes
    end: int


class Journal:
    """A journal that is appended to."""

    def __init__(self, path: Path, size: int) -> None:
        """Open or create it; what follows `size` bytes is cut off. Raises OutputError."""
        self.path = path
        self.size = size
        self.outcomes = 0  # appended
        self._unsynced = 0
        self._synced = time.monotonic()
        try:
            self._fd = os.open(
                path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0), 0o666
            )
            os.ftruncate(self._fd, size)
            os.lseek(self._fd, size, os.SEEK_SET)
        except OSError as error:
            raise _unwritable(path, error) from None

    def append(self, rows: Sequence[bytes], last: Mapping[str, Any]) -> None:
        """Append one outcome; it is in the file when this returns, so a kill loses nothing.

        Raises:
            OutputError: it cannot be written; what was written of it is cut off.
        """
        body = b"".join(rows)
        data = body + typed_rows.line(
            LAST, {**last, "block_bytes": len(body), "block_crc32": zlib.crc32(body)}
        )
        try:
            done = 0
            view = memoryview(data)
            while done < len(view):
                done += os.write(self._fd, view[done:])
            self._unsynced += 1
            now = time.monotonic()
            if self._unsynced >= SYNC_OUTCOMES or now - self._synced >= SYNC_S:
                self.sync()
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._fd, self.size)
                os.lseek(self._fd, self.size, os.SEEK_SET)
            raise _unwritable(self.path, error) from None
        self.size += len(data)
        self.outcomes += 1

    def sync(self) -> None:
        """Write to the disk itself what is in the system's memory. Raises OSError."""
        getattr(os, "fdatasync", os.fsync)(self._fd)
        self._unsynced = 0
        self._synced = time.monotonic()

    def close(self) -> None:
        """Sync and close. Raises OutputError."""
        fd, self._fd = self._fd, -1
        if fd < 0:
            return
        try:
            os.fsync(fd)
        except OSError as error:
            raise _unwritable(self.path, error) from None
        finally:
            os.close(fd)


def blocks(path: Path) -> Iterator[Block]:
    """The whole blocks of a journal, up to the first that is not whole.

    Raises:
        OutputError: it cannot be read.
    """
    start = at = crc = 0
    try:
        with path.open("rb") as file:
            for line in file:
                if line.startswith(b'["outcomes",'):
                    row = _row(line)
                    if (
                        row is None
                        or row.pop("block_bytes", -1) != at - start
                        or row.pop("block_crc32", -1) != crc
                    ):
                        return
                    at += len(line)
                    yield Block(row, start, at)
                    start, crc = at, 0
                else:
                    at += len(line)
                    crc = zlib.crc32(line, crc)
    except OSError as error:
        raise OutputError(f"{path}: cannot be read ({error.strerror})") from None


def _row(line: bytes) -> dict[str, Any] | None:
    try:
        row = json.loads(typed_rows.of_line(line)[1]) if line.endswith(b"]\n") else None
    except ValueError:
        return None
    return row if isinstance(row, dict) else None


def rows(path: Path, end: int) -> Iterator[tuple[str, bytes]]:
    """The rows of all tables up to a byte, each with its table's name; `LAST` is one of them. Raises OSError."""
    at = 0
    with path.open("rb") as file:
        for line in file:
            at += len(line)
            if at > end:
                return
            yield typed_rows.of_line(line)


def _unwritable(path: Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: cannot be written ({error.strerror})")
