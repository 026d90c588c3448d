"""The lines of a text log, plain or gzipped, in bounded memory, and the count of the unreadable."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from canid.errors import LogError
from canid.frames.read_state import ReadState
from canid.types import Damage

# A CAN FD line has some 350 characters; what is longer than this is no line but damage or a zip bomb.
LONGEST = 8192


class Line(NamedTuple):
    """One line of the file."""

    text: str  # each byte one character: no encoding can fail; without the line's end
    number: int
    whole: bool  # False: the file ends, or the line is cut, before the line's end


class Bad(ValueError):  # noqa: N818  (a finding inside this package)
    """A line that should be a frame and is not; says why."""


@dataclass
class Tally:
    """Frames read and lines that could not be."""

    read: int = 0
    bad: int = 0
    first: str = ""  # about the first bad line
    cut: str = ""  # why reading ended early

    def miss(self, line: Line, why: str) -> None:
        """Count a bad line."""
        self.bad += 1
        if not self.first:
            self.first = f"line {line.number}: {why}"

    def damage(self, path: Path) -> Damage | None:
        """Sum up. Raises LogError if there was trouble and not one frame."""
        says = "; ".join(part for part in (self.first, self.cut) if part)
        if not says:
            return None
        if not self.read:
            raise LogError(f"{path} holds no frame that can be read ({says})")
        more = f", and {self.bad - 1} more" if self.bad > 1 else ""
        total = self.read + self.bad
        return Damage(
            f"read {self.read} of {total} frame lines: {says}{more}", self.read, -1 if self.cut else total
        )


def lines(path: Path, state: ReadState, tally: Tally) -> Iterator[Line]:
    """All lines; a gzip stream that breaks off ends them and is noted in `tally.cut`."""
    with open(path, "rb") as raw:
        zipped = path.suffix.lower() == ".gz"
        file = gzip.GzipFile(fileobj=raw) if zipped else raw
        number = 0
        done = 0
        while True:
            try:
                data = file.readline(LONGEST)
            except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                tally.cut = f"the gzip stream is damaged after line {number} ({error})"
                break
            if not data:
                break
            number += 1
            done += len(data)
            # of a gzipped file only the position in the compressed bytes tells how far we are
            state.done = raw.tell() if zipped else done
            yield Line(data.decode("latin-1").rstrip("\r\n"), number, data.endswith(b"\n"))
        state.done = state.size


def hex_bytes(text: str, length: int) -> bytes:
    """Parse exactly `length` bytes in hex. Raises Bad.

    >>> hex_bytes("4142", 2)
    b'AB'
    """
    try:
        data = bytes.fromhex(text)
    except ValueError:
        raise Bad("its data are not hexadecimal") from None
    if len(data) != length:
        raise Bad(f"it announces {length} data bytes and has {len(data)}")
    return data
