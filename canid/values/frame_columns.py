"""Frames as columns and back; readers yield chunks of columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from canid.values.types import Columns, Flag, Frame

# frames of one chunk, where a format is read frame by frame: numpy's overhead is spread over them, and 64 bytes
# of data each are 1 MB
CHUNK_FRAMES = 16_384
CLASSIC_BYTES, FD_BYTES = 8, 64
MAX_STANDARD_ID, MAX_EXTENDED_ID = 0x7FF, 0x1FFFFFFF
# bytes that each DLC code announces (ISO 11898-1)
DLC_BYTES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
Octets = npt.NDArray[np.uint8]
_REMOTE = int(Flag.REMOTE)
# mask of an 11-bit id; more ids than eight are matched by these bits alone, which costs as much as eight comparisons
_LOW_BITS, _MAX_COMPARISONS = (1 << 11) - 1, 8


def octets_of(payloads: Sequence[bytes]) -> Octets:
    """Data of frames as rows of 8 bytes, or of 64 where one of them is longer.

    >>> octets_of([b"a", bytes(12)]).shape
    (2, 64)
    """
    width = FD_BYTES if any(len(data) > CLASSIC_BYTES for data in payloads) else CLASSIC_BYTES
    octets = b"".join([data.ljust(width, b"\0") for data in payloads])
    return np.frombuffer(octets, np.uint8).reshape(len(payloads), width)


def join_octets(parts: Sequence[Octets]) -> Octets:
    """Put rows of bytes together, as wide as the widest.

    >>> join_octets([octets_of([b"a"]), octets_of([bytes(12)])]).shape
    (2, 64)
    """
    width = max(part.shape[1] for part in parts)
    octets = np.zeros((sum(map(len, parts)), width), np.uint8)
    row = 0
    for part in parts:
        octets[row : row + len(part), : part.shape[1]] = part
        row += len(part)
    return octets


def columns_of(frames: Sequence[Frame]) -> Columns:
    """Make columns of frames.

    >>> chunk = columns_of([Frame(0.0, 0, 0x123, b"abc"), Frame(0.5, 1, 7, b"", Flag.REMOTE, 4)])
    >>> chunk.length.tolist(), chunk.data.shape, bytes(chunk.data[0, :3])
    ([3, 4], (2, 8), b'abc')
    """
    length = [max(f.length, 0) if f.flags & _REMOTE else len(f.data) for f in frames]
    return Columns(
        t=np.array([f.t for f in frames], dtype=np.float64),
        bus=np.array([f.bus for f in frames], dtype=np.uint16),
        id=np.array([f.id for f in frames], dtype=np.uint32),
        flags=np.array([int(f.flags) for f in frames], dtype=np.uint8),
        length=np.array(length, dtype=np.uint8),
        data=octets_of([b"" if f.flags & _REMOTE else f.data for f in frames]),
    )


def frames_of(chunk: Columns) -> Iterator[Frame]:
    """Make frames of columns.

    >>> frames = [Frame(0.0, 0, 0x123, b"abc"), Frame(0.5, 1, 7, b"", int(Flag.REMOTE), 4)]
    >>> list(frames_of(columns_of(frames))) == frames
    True
    """
    new = tuple.__new__  # a NamedTuple's own __new__ costs twice as much, and there are millions
    width = chunk.data.shape[1]
    data = chunk.data.tobytes()
    lists = (column.tolist() for column in (chunk.t, chunk.bus, chunk.id, chunk.flags, chunk.length))
    begin = 0
    for t, bus, id_, flags, length in zip(*lists, strict=True):
        if flags & _REMOTE:
            yield new(Frame, (t, bus, id_, b"", flags, length))
        else:
            yield new(Frame, (t, bus, id_, data[begin : begin + length], flags, -1))
        begin += width


def chunks(frames: Iterable[Frame], size: int = CHUNK_FRAMES) -> Iterator[Columns]:
    """Columns of `size` frames each; the last chunk has the rest."""
    source = iter(frames)
    while batch := list(islice(source, size)):
        yield columns_of(batch)


class WantedIds:
    """A set of ids, and a fast test which frames have them."""

    def __init__(self, ids: Iterable[int]):
        self._ids = sorted(set(ids))
        self._low = np.zeros(_LOW_BITS + 1, bool)
        self._low[[id_ & _LOW_BITS for id_ in self._ids]] = True

    def rows(self, ids: npt.NDArray[np.uint32]) -> npt.NDArray[np.int64]:
        """Which of these ids are wanted; a few others may be among them.

        >>> WantedIds([0x123]).rows(np.array([0x7, 0x123, 0x18124], dtype=np.uint32)).tolist()
        [1]
        """
        if len(self._ids) > _MAX_COMPARISONS:
            return np.flatnonzero(self._low[ids & _LOW_BITS])
        plain = ids & np.uint32(MAX_EXTENDED_ID)
        wanted = np.zeros(len(plain), bool)
        for id_ in self._ids:
            wanted |= plain == id_
        return np.flatnonzero(wanted)


def select(chunk: Columns, rows: npt.NDArray[Any]) -> Columns:
    """Keep some rows."""
    t, bus, id_, flags, length, data = chunk
    return Columns(t[rows], bus[rows], id_[rows], flags[rows], length[rows], data[rows])


def rows(chunk: Columns, start: int, stop: int) -> Columns:
    """Rows [start, stop), without copying.

    >>> rows(columns_of([Frame(0.0, 0, k, b"") for k in range(9)]), 3, 5).id.tolist()
    [3, 4]
    """
    t, bus, id_, flags, length, data = chunk
    part = slice(start, stop)
    return Columns(t[part], bus[part], id_[part], flags[part], length[part], data[part])


def join(parts: Sequence[Columns]) -> Columns:
    """Put chunks together, as wide as the widest.

    >>> join([columns_of([Frame(0.0, 0, 1, b"a")]), columns_of([Frame(0.5, 0, 2, bytes(12))])]).data.shape
    (2, 64)
    """
    if len(parts) == 1:
        return parts[0]
    *others, data = zip(*parts, strict=True)
    t, bus, id_, flags, length = map(np.concatenate, others)
    return Columns(t, bus, id_, flags, length, join_octets(data))


def gather(parts: Iterable[Columns], size: int) -> Iterator[Columns]:
    """Put chunks together until they have `size` rows at least; the last one has the rest."""
    waiting: list[Columns] = []
    n = 0
    for part in parts:
        waiting.append(part)
        n += len(part.t)
        if n >= size:
            yield join(waiting)
            waiting, n = [], 0
    if waiting:
        yield join(waiting)


@cache
def keep_memory() -> None:
    """Have the C library keep the memory of freed columns, for the next ones.

    glibc hands large blocks back to the system at once and gets them again page by page, which took 40 % of the time
    of reading an .asc. Its limit for "large" grows to the largest block that was freed, up to 32 MiB: mallopt(3),
    M_MMAP_THRESHOLD. Memory that is never touched costs nothing; other C libraries are not affected.
    """
    np.empty(31 << 20, np.uint8)
