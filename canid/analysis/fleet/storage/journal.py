"""Journal of outcomes: appended to a new file, a block of lines for each; a block that a kill left cut is dropped.

No run appends to the journal of another one. A journal is locked as long as it is open: where somebody has removed the
lock of the folder, a second run still sees that the first one works.

A block is the rows of the tables, a line each, and a last line, which states how many bytes precede it and their
CRC-32: only with it the block counts.
"""

from __future__ import annotations

import json
import os
import stat
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from canid.analysis.fleet.storage import lock, typed_rows
from canid.analysis.fleet.storage.columns import TABLES
from canid.io.files import opening
from canid.values.errors import system_errors

# s; what a power cut may cost. A disk syncs in 1 to 20 ms, logs of a second on many cores come every few
SYNC_S = 1.0
# outcomes after which it is synced in any case
SYNC_OUTCOMES = 64
LAST = "outcomes"
_BEGINNINGS = tuple(f'["{name}",{{'.encode() for name in (LAST, *TABLES))
# on Windows the byte that is locked cannot be read: one beyond any journal
_LOCKED_BYTE = 1 << 40


class Block(NamedTuple):
    """One outcome in a journal."""

    row: Mapping[str, Any]  # of the last line
    start: int  # bytes
    end: int


class Journal:
    """A journal that is appended to, or one that an interrupted run has left, which is read."""

    def __init__(self, path: Path, fd: int) -> None:
        """Of an open file; `create` and `left` open one."""
        self.path = path
        self.size = 0  # bytes of whole blocks
        self.outcomes = 0  # appended
        self._fd = fd
        self._unsynced = 0
        self._synced = time.monotonic()

    def append(self, rows: Sequence[bytes], last: Mapping[str, Any]) -> None:
        """Append one outcome; it is in the file when this returns, so a kill loses nothing.

        Raises:
            OutputError: it cannot be written; what was written of it is cut off.
        """
        body = b"".join(rows)
        data = body + typed_rows.line(
            LAST, {**last, "block_bytes": len(body), "block_crc32": zlib.crc32(body)}
        )
        with system_errors(self.path):
            try:
                self._append(memoryview(data))
            except OSError:
                with suppress(OSError):
                    os.ftruncate(self._fd, self.size)
                    os.lseek(self._fd, self.size, os.SEEK_SET)
                raise
        self.size += len(data)
        self.outcomes += 1

    def _append(self, data: memoryview) -> None:
        while len(data):
            data = data[os.write(self._fd, data) :]
        self._unsynced += 1
        if self._unsynced >= SYNC_OUTCOMES or time.monotonic() - self._synced >= SYNC_S:
            self.sync()

    def blocks(self) -> Iterator[Block]:
        """The whole blocks, up to the first that is not whole; `size` is their bytes then. Raises OutputError."""
        with system_errors(self.path, "read"):
            for block in _blocks(self._read()):
                self.size = block.end
                yield block

    def rows(self) -> Iterator[tuple[str, bytes]]:
        """The rows of all tables in the whole blocks, each with its table's name; `LAST` is one of them. Raises OSError."""
        at = 0
        for line in self._read():
            at += len(line)
            if at > self.size:
                return
            yield typed_rows.of_line(line)

    def _read(self) -> Iterator[bytes]:
        """The lines: through the own descriptor, since closing another one would end the lock."""
        with os.fdopen(self._fd, "rb", closefd=False) as file:
            file.seek(0)
            yield from file
        os.lseek(self._fd, 0, os.SEEK_END)

    def sync(self) -> None:
        """Write to the disk itself what is in the system's memory. Raises OSError."""
        getattr(os, "fdatasync", os.fsync)(self._fd)
        self._unsynced = 0
        self._synced = time.monotonic()

    def remove(self) -> None:
        """Close it and delete its file, unless another one has its name by now. Raises OSError."""
        if self._fd < 0:
            return
        is_ours = opening.has_name(self._fd, self.path)
        self.end()
        if is_ours:
            self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Sync and close; an empty one is deleted. Raises OutputError."""
        if self._fd < 0:
            return
        try:
            with system_errors(self.path):
                os.fsync(self._fd)
                if os.fstat(self._fd).st_size == 0:
                    self.remove()
        finally:
            self.end()

    def end(self) -> None:
        """Close it as it is."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            os.close(fd)


def create(path: Path) -> Journal:
    """A new journal. Raises OutputError."""
    with system_errors(path):
        fd = opening.create(path)
    with suppress(OSError):  # the folder's lock has shown that the file system has locks
        lock.is_free(fd, at=_LOCKED_BYTE)
    return Journal(path, fd)


def left(path: Path) -> Journal | None:
    """The journal of a run that has ended; None: the file is no journal.

    Raises:
        LockError: its run works still.
        OSError: it cannot be read.
    """
    if not stat.S_ISREG(os.lstat(path).st_mode):
        return None
    fd = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0))
    try:
        if not lock.is_free(fd, shared=True, at=_LOCKED_BYTE):
            raise lock.LockError(
                f"{path.parents[1]}: another run works in this folder, whose {lock.NAME} was removed; wait for it, or end it"
            )
        beginning = os.read(fd, max(map(len, _BEGINNINGS)))
    except BaseException:
        os.close(fd)
        raise
    if any(known.startswith(beginning[: len(known)]) for known in _BEGINNINGS):
        return Journal(path, fd)
    os.close(fd)
    return None


def _blocks(lines: Iterable[bytes]) -> Iterator[Block]:
    start = at = crc = 0
    for line in lines:
        if line.startswith(b'["outcomes",'):
            row = _row(line)
            if row is None or row.pop("block_bytes", -1) != at - start or row.pop("block_crc32", -1) != crc:
                return
            at += len(line)
            yield Block(row, start, at)
            start, crc = at, 0
        else:
            at += len(line)
            crc = zlib.crc32(line, crc)


def _row(line: bytes) -> dict[str, Any] | None:
    try:
        row = json.loads(typed_rows.of_line(line)[1]) if line.endswith(b"]\n") else None
    except ValueError:
        return None
    return row if isinstance(row, dict) else None
