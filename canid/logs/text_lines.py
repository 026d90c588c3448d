"""The lines of a text log, plain or gzipped, in bounded memory, and the count of each class of lines."""

from __future__ import annotations

import gzip
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.errors import LogError
from canid.logs.damage import DamagedSpans
from canid.logs.reader_state import ReadState
from canid.types import Damage

# A CAN FD line has some 350 characters; a longer line than this is damage or a zip bomb.
MAX_LINE_BYTES = 8192
# Lines are read in blocks of this size: numpy's overhead per block is spread over some 60,000 lines of an .asc.
# The first is small, because opening a log waits for its first frame; and in it an .asc may state that its numbers
# are decimal.
BLOCK_BYTES, FIRST_BLOCK_BYTES = 2 * 1024 * 1024, 8 * 1024
# A gzipped log has a tenth to a thirtieth of its unpacked size, since each line has another time. A file that unpacks to
# more than this many times its size, and to more than so many bytes, is a zip bomb.
MAX_UNPACKED_RATIO, MIN_BOMB_BYTES = 200, 64 * 1024 * 1024
# Lines of a block; usual logs have half as many. Each line that cannot be read needs some 400 bytes of memory.
MAX_BLOCK_LINES = 1 << 17
# lines that are read one by one before progress is reported
PROGRESS_LINES = 1024
_LINE_FEED = 10


class Line(NamedTuple):
    """One line of the file."""

    text: str  # latin-1, so that decoding cannot fail; without the line's end
    number: int
    whole: bool  # False: the file ends, or the line is cut, before the line's end
    begin: int = 0  # its first byte in the file
    end: int = 0  # one past its last byte


class Bad(ValueError):  # noqa: N818  (internal: counted as damage)
    """A line that should be a frame and is not; the text is the reason."""


@dataclass
class LineCount:
    """The class of every line that is not blank: a frame, known to be none, or damaged."""

    read: int = 0  # frames
    events: int = 0  # events of canid's recorder
    others: Counter[str] = field(default_factory=Counter)  # known to hold no frame: how many of each kind
    bad: int = 0  # damaged
    damaged: DamagedSpans = field(default_factory=DamagedSpans)
    cut: bool = False  # reading ended early: the number of lines is unknown

    def miss(self, line: Line, why: str) -> None:
        """Count a damaged line."""
        self.bad += 1
        self.damaged.add(line.begin, line.end, f"line {line.number}: {why}")

    def close(self, path: Path, state: ReadState) -> None:
        """Sum up. Raises LogError if there was damage and not one frame."""
        state.frames, state.events, state.damaged = self.read, self.events, self.bad + self.cut
        state.other_kinds = Counter(self.others)
        if not self.damaged:
            return
        total = -1 if self.cut else self.read + self.bad
        says = self.damaged.sentence("frame lines", self.read, total)
        if not self.read:
            raise LogError(f"{path} holds no frame that can be read ({says})")
        state.damage = Damage(says, self.read, total, self.damaged.spans)


class Block(NamedTuple):
    """Consecutive lines of the file."""

    data: bytes
    ends: npt.NDArray[np.int64]  # (n,) where each line ends in `data`, after its line feed
    number: int  # of the first of them, counted from 1
    at: int = 0  # where `data` begins in the file


def blocks(path: Path, state: ReadState, count: LineCount) -> Iterator[Block]:
    """All lines, some thousands at a time; a gzip stream that breaks off ends them and is noted in `count`."""
    with open(path, "rb") as raw:
        zipped = path.suffix.lower() == ".gz"
        file = gzip.GzipFile(fileobj=raw) if zipped else raw
        number, rest, size, done = 1, b"", FIRST_BLOCK_BYTES, 0
        more = True
        while more:
            piece, why = _fill(file, size)
            size = BLOCK_BYTES
            if zipped and not why and done > max(MIN_BOMB_BYTES, MAX_UNPACKED_RATIO * raw.tell()):
                why = f"it unpacks to more than {MAX_UNPACKED_RATIO} times its size"
            more = bool(piece) and not why
            data = rest + piece
            end = data.rfind(b"\n") + 1
            # a line that is too long is cut; the last one needs no line feed, unless it is not the last
            end = (
                len(data)
                if not more and not why
                else end + (len(data) - end) // MAX_LINE_BYTES * MAX_LINE_BYTES
            )
            done += end
            # of a gzipped file only the position in the compressed bytes is known
            state.done = raw.tell() if zipped else done
            rest = data[end:]
            if end:
                block = Block(data[:end] if rest else data, _ends(data, end), number, done - end)
                number += len(block.ends)
                yield from _parts(block)
            if why:
                count.cut = True
                count.damaged.add(done, 0, f"the gzip stream is damaged after line {number - 1} ({why})")
        state.done = state.size


def _parts(block: Block) -> Iterator[Block]:
    """The block, in parts where it has too many lines for memory."""
    data, ends, number, at = block
    if len(ends) <= MAX_BLOCK_LINES:
        yield block
        return
    for k in range(0, len(ends), MAX_BLOCK_LINES):
        begin, end = int(ends[k - 1]) if k else 0, int(ends[min(k + MAX_BLOCK_LINES, len(ends)) - 1])
        yield Block(data[begin:end], ends[k : k + MAX_BLOCK_LINES] - begin, number + k, at + begin)


def _fill(file: BinaryIO | gzip.GzipFile, size: int) -> tuple[bytes, str]:
    """Read `size` bytes, fewer at the end; and why it broke off, where it did."""
    parts: list[bytes] = []
    while size > 0:
        try:
            # in steps: what precedes the damage is not lost with it
            part = file.read1(size) if isinstance(file, gzip.GzipFile) else file.read(size)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            return b"".join(parts), str(error)
        if not part:
            break
        parts.append(part)
        size -= len(part)
    return b"".join(parts), ""


def _ends(data: bytes, end: int) -> npt.NDArray[np.int64]:
    ends = np.flatnonzero(np.frombuffer(data, np.uint8, end) == _LINE_FEED) + 1
    if not ends.size or ends[-1] < end:
        ends = np.append(ends, end)
    long = np.flatnonzero(np.diff(ends, prepend=0) > MAX_LINE_BYTES)
    if long.size:
        cuts = [np.arange(ends[k - 1] if k else 0, ends[k], MAX_LINE_BYTES)[1:] for k in long.tolist()]
        ends = np.sort(np.concatenate([ends, *cuts]))
    return ends


def lines(path: Path, state: ReadState, count: LineCount) -> Iterator[Line]:
    """All lines, one by one; see `blocks`."""
    for block in blocks(path, state, count):
        begin = 0
        for k, end in enumerate(block.ends.tolist()):
            if k % PROGRESS_LINES == 0:
                state.unpacked = block.at + begin
            if end - begin > 1 or block.data[begin] != _LINE_FEED:
                yield line(block, k, begin, end)
            begin = end


def line(block: Block, k: int, begin: int, end: int) -> Line:
    """The block's line `k`, from byte `begin` to `end`."""
    data = block.data[begin:end]
    text = data.decode("latin-1").rstrip("\r\n")
    return Line(text, block.number + k, data.endswith(b"\n"), block.at + begin, block.at + end)


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


MAX_EXTENDED_ID = 0x1FFFFFFF
# ns; 146 years, since 1970 or since the log's start: a longer time is damage, and sums of two still fit 64 bits
MAX_TIME_NS = 1 << 62


def remote_length(asked: int) -> int:
    """Check how many bytes a remote frame asks for. Raises Bad.

    >>> remote_length(8)
    8
    """
    if not 0 <= asked <= 64:
        raise Bad(f"it asks for {asked} data bytes")
    return asked
