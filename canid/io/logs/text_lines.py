"""The lines of a text log, plain or gzipped, in bounded memory, and the count of each class of lines."""

from __future__ import annotations

import codecs
import gzip
import re
import sys
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.content import encoding, is_gzip
from canid.io.logs.damage import DamagedSpans
from canid.io.logs.reader_state import ReadState
from canid.values.errors import LogError
from canid.values.types import Damage

# A CAN FD line has some 350 characters; a longer line than this is damage or a zip bomb.
MAX_LINE_BYTES = 8192
# what is kept of such a line: of what kind it is stands in its first words
HEAD_BYTES = 512
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
# lines of so few bytes, of which a usual log has hardly any, are tested for blanks together
_SHORT_LINE, _MANY_SHORT = 16, 64
_VISIBLE = np.array([not chr(k).isspace() for k in range(256)])
# UTF-8's byte order mark, each of its bytes one character
_MARK = "\xef\xbb\xbf"
# a word first, a number and words, the same mark several times, or the end of a file of CP/M
_FOOTER = re.compile(
    r"[^\w\x00-\x1f]{0,8}(?!(?i:nan|null)\b)[^\W\d_]{3,40}(?![\w#])[^\x00-\x08]*$"
    r"|[^\w\x00-\x1f]{0,8}\d[\d.,]{0,15}(?: [^\W\d_]{3,40}){1,8}\W{0,8}$|([*=#~_-])\1{2,}\s*$|\x1a$|\^C$"
)
FOOTER_LINES, MAX_FOOTER_LINES = "footer lines", 60
_BOMB = f"it unpacks to more than {MAX_UNPACKED_RATIO} times its size; unpack it with gunzip, and read that, if it should"


class Line(NamedTuple):
    """One line of the file."""

    text: str  # latin-1, so that decoding cannot fail; without the line's end
    number: int
    whole: bool  # False: the file ends, or the line is cut, before the line's end
    begin: int = 0  # its first byte in the file
    end: int = 0  # one past its last byte


def is_footer(text: str) -> bool:
    """Whether a line is in words, as programs write them behind the last frame or row: no piece of one begins so.

    >>> is_footer("End of file"), is_footer("(600 rows affected)"), is_footer("Mean,20.5,31"), is_footer("-----")
    (True, True, True, True)
    >>> is_footer("can0 123#11"), is_footer("20.5,31"), is_footer("Rx d 8 01"), is_footer("0.5 1 123 Rx d 8 ABBA")
    (False, False, False, False)
    """
    return _FOOTER.match(text) is not None


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
    last: int = 0  # number of the last line that is a frame
    rows_in_words: dict[int, str] = field(
        default_factory=dict
    )  # line of a table's row that begins with a word -> it
    worded: list[tuple[Line, str]] = field(
        default_factory=list
    )  # lines in words behind it, and why they are no frames

    def took(self, first: int, rows: npt.NDArray[np.int64]) -> None:
        """Count frames: their rows among lines of which the first has this number."""
        self.read += len(rows)
        self.last = first + int(rows[-1]) if len(rows) else self.last
        self._miss_worded(self.last)

    def miss(self, line: Line, why: str) -> None:
        """Count a damaged line; one in words is none where no frame follows."""
        if len(self.worded) < MAX_FOOTER_LINES and is_footer(line.text):
            self.worded.append((line, why))
            return
        self._miss_worded()
        self._miss(line, why)

    def miss_all(self, misses: Iterable[tuple[Line, str]], state: ReadState) -> None:
        """As `miss`, of lines that were read before; progress is reported as where they were read."""
        for n, (item, why) in enumerate(misses):
            if n % PROGRESS_LINES == 0:
                state.unpacked = item.begin
            self.miss(item, why)

    def settle(self) -> None:
        """Take lines in words at the end for the footer: all lines were counted."""
        if not self.read:
            self._miss_worded()
        self.others[FOOTER_LINES] += len(self.worded)
        self.others += Counter()  # without what is 0
        self.worded.clear()

    def _miss_worded(self, before: int = sys.maxsize) -> None:
        """Lines in words before the line of this number are damaged."""
        while self.worded and self.worded[0][0].number < before:
            self._miss(*self.worded.pop(0))

    def _miss(self, line: Line, why: str) -> None:
        self.bad += 1
        self.damaged.add(line.begin, line.end, f"line {line.number}: {why}")

    def miss_long(self, line: LongLine, line_bytes: int = MAX_LINE_BYTES) -> None:
        """Count a damaged line that is too long."""
        self.miss(Line("", line.number, True, line.begin, line.end), f"it has more than {line_bytes:,} bytes")

    def close(self, path: Path, state: ReadState) -> None:
        """Sum up. Raises LogError if there was damage and not one frame."""
        self.settle()
        state.frames, state.events, state.damaged = self.read, self.events, self.bad + self.cut
        state.other_kinds = Counter(self.others)
        state.damage = self.damage("frame lines")
        if state.damage is not None and not self.read:
            raise LogError(f"{path} holds no frame that can be read ({state.damage.says})")

    def damage(self, what: str) -> Damage | None:
        """What could not be read of these lines; `what` they are, in the plural."""
        if not self.damaged:
            return None
        total = -1 if self.cut else self.read + self.bad
        says = self.damaged.sentence(what, self.read, total)
        return Damage(says, self.read, total, self.damaged.spans)


class LongLine(NamedTuple):
    """A line that is too long to be kept, passed over but for how it begins."""

    head: str  # its first HEAD_BYTES, latin-1
    number: int
    begin: int  # its first byte in the file
    end: int  # one past its last byte


class Block(NamedTuple):
    """Consecutive lines of the file, none of them too long."""

    data: bytes
    ends: npt.NDArray[np.int64]  # (n,) where each line ends in `data`, after its line feed
    number: int  # of the first of them, counted from 1
    at: int = 0  # where `data` begins in the file


def blocks(
    path: Path, state: ReadState, count: LineCount, line_bytes: int = MAX_LINE_BYTES
) -> Iterator[Block]:
    """All lines of at most `line_bytes`, some thousands at a time.

    A longer line is damaged, and passed over without being kept. A gzip stream that breaks off ends them and is noted
    in `count`.
    """
    for item in blocks_and_long_lines(path, state, count, line_bytes):
        if isinstance(item, Block):
            yield item
        else:
            count.miss_long(item, line_bytes)


def blocks_and_long_lines(
    path: Path, state: ReadState, count: LineCount, line_bytes: int = MAX_LINE_BYTES
) -> Iterator[Block | LongLine]:
    """As `blocks`; but a longer line comes where it stands, and the caller counts it."""
    with open(path, "rb") as raw:
        zipped = is_gzip(path)
        file = opened_text(gzip.GzipFile(fileobj=raw) if zipped else raw)
        zipped = zipped or isinstance(file, _Transcoded)
        number, rest, size, at = 1, b"", FIRST_BLOCK_BYTES, 0
        long_from, head = -1, ""  # where a line begins that is too long and goes on, and how
        more = True
        while more:
            piece, why = _fill(file, size)
            size = BLOCK_BYTES
            more = bool(piece) and not why
            data = rest + piece
            if long_from >= 0:
                feed = data.find(b"\n") + 1
                at += feed or len(data)
                data = data[feed:] if feed else b""
                if feed or not more:
                    yield LongLine(head, number, long_from, at)
                    number, long_from = number + 1, -1
            # the last line needs no line feed, unless it is not the last
            end = len(data) if not more and not why else data.rfind(b"\n") + 1
            rest = data[end:]
            if end:
                block = Block(data[:end] if rest else data, _ends(data, end), number, at)
                number += len(block.ends)
                yield from _parts(block, line_bytes)
            at += end
            # of a gzipped file only the position in the compressed bytes is known
            state.done, state.unpacked = (raw.tell() if zipped else at), at
            if len(rest) > line_bytes:
                long_from, head, rest, at = at, _head(rest), b"", at + len(rest)
            if zipped and not why and at > max(MIN_BOMB_BYTES, MAX_UNPACKED_RATIO * raw.tell()):
                why, more = _BOMB, False
            if why:
                count.cut = True
                count.damaged.add(at, 0, f"reading ends after line {number - 1}: {why}")
    state.done = state.size


def _head(data: bytes) -> str:
    return data[:HEAD_BYTES].decode("latin-1")


def _parts(block: Block, line_bytes: int) -> Iterator[Block | LongLine]:
    """The block without lines that are too long, in parts where it has too many lines for memory."""
    data, ends, number, at = block
    cuts = np.arange(0, len(ends), MAX_BLOCK_LINES)
    long = np.flatnonzero(np.diff(ends, prepend=0) > line_bytes)
    if not long.size and len(cuts) == 1:
        yield block
        return
    borders = np.unique(np.concatenate([cuts, long, long + 1, [len(ends)]])).tolist()
    too_long = set(long.tolist())
    for first, last in pairwise(borders):
        begin, end = int(ends[first - 1]) if first else 0, int(ends[last - 1])
        if first in too_long:
            yield LongLine(_head(data[begin : begin + HEAD_BYTES]), number + first, at + begin, at + end)
        else:
            yield Block(data[begin:end], ends[first:last] - begin, number + first, at + begin)


class _Transcoded:
    """A text in UTF-16 as bytes of UTF-8, some at a time."""

    def __init__(self, file: BinaryIO | gzip.GzipFile, encoding: str) -> None:
        self._file = file
        # what is no character stays visible as damage of its line
        self._decoder = codecs.getincrementaldecoder(encoding)(errors="replace")

    def read(self, size: int) -> bytes:
        """At most some `size` bytes; none at the end."""
        while True:
            packed = isinstance(self._file, gzip.GzipFile)
            part = self._file.read1(size) if packed else self._file.read(size)  # type: ignore[union-attr]
            text = self._decoder.decode(part, final=not part)
            if text or not part:
                return text.encode("utf-8", "replace")


def opened_text(file: BinaryIO | gzip.GzipFile) -> BinaryIO | gzip.GzipFile | _Transcoded:
    """The file, decoded where its first bytes say that it is UTF-16."""
    try:
        name, mark = encoding(file.read(3))
    except (EOFError, zlib.error, gzip.BadGzipFile):
        name, mark = "", 0  # it is found again where lines are read
    file.seek(mark if name.startswith("utf-16") else 0)
    return _Transcoded(file, name) if name.startswith("utf-16") else file


def _fill(file: BinaryIO | gzip.GzipFile | _Transcoded, size: int) -> tuple[bytes, str]:
    """Read `size` bytes, fewer at the end; and why it broke off, where it did."""
    parts: list[bytes] = []
    while size > 0:
        try:
            # in steps: what precedes the damage is not lost with it
            part = file.read1(size) if isinstance(file, gzip.GzipFile) else file.read(size)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            return b"".join(parts), f"the gzip stream is damaged ({error})"
        if not part:
            break
        parts.append(part)
        size -= len(part)
    return b"".join(parts), ""


def _ends(data: bytes, end: int) -> npt.NDArray[np.int64]:
    ends = np.flatnonzero(np.frombuffer(data, np.uint8, end) == _LINE_FEED) + 1
    return ends if ends.size and ends[-1] == end else np.append(ends, end)


def filled(block: Block) -> npt.NDArray[np.bool_]:
    r"""Which lines may hold something: where many are short, as in a hostile file of blanks, exactly those that do.

    >>> filled(Block(b"a\n\n", np.array([2, 3]), 1)).tolist()
    [True, False]
    """
    sizes = np.diff(block.ends, prepend=0)
    some: npt.NDArray[np.bool_] = sizes > 1
    some[-1] |= not block.data.endswith(b"\n")
    if int((some & (sizes <= _SHORT_LINE)).sum()) > _MANY_SHORT:
        visible = _VISIBLE[np.frombuffer(block.data, np.uint8, int(block.ends[-1]))]
        some = np.logical_or.reduceat(visible, block.ends - sizes)
    return some


def lines(path: Path, state: ReadState, count: LineCount) -> Iterator[Line]:
    """All lines that are not blank, one by one; see `blocks`."""
    for block in blocks(path, state, count):
        for n, k in enumerate(np.flatnonzero(filled(block)).tolist()):
            begin = int(block.ends[k - 1]) if k else 0
            if n % PROGRESS_LINES == 0:
                state.unpacked = block.at + begin
            yield line(block, k, begin, int(block.ends[k]))


def line(block: Block, k: int, begin: int, end: int) -> Line:
    """The block's line `k`, from byte `begin` to `end`, without a byte order mark: joined files have one within."""
    data = block.data[begin:end]
    text = data.decode("latin-1").rstrip("\r\n").removeprefix(_MARK)
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
