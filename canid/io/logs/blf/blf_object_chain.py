"""The chain of objects in a payload: the size of each object leads to the signature of the next one.

It is followed for all objects at once. In most logs all headers are alike, at equal distances. Else, where every
signature on a multiple of four bytes from the first object is at the end of the object before, that is the chain.
Signatures within data and objects of odd sizes break it: then all signatures are candidates, and the sizes choose
among them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_dtypes import HEADER_FIELDS
from canid.io.logs.blf.blf_layout import MAX_INFLATED_BYTES, MAX_PADDING_BYTES, Data

_WORD = 4
_SIGNATURE = int.from_bytes(blf.SIGNATURE, "little")
_SIZE_AT, _KIND_AT = 8, 12  # in an object's header
# bytes between the end of an object and the next signature, at most
_MAX_SLACK_BYTES = MAX_PADDING_BYTES - len(blf.SIGNATURE)
# Objects of a payload that contain signatures: a text or two may. With more, following the chain in Python would take
# seconds.
_MAX_JUMPS = 20_000

Ints = npt.NDArray[np.int64]


class Broken(Exception):  # noqa: N818  (internal: never shown to the user)
    """The payload is not a row of objects."""


class Chain(NamedTuple):
    """The whole objects of a payload."""

    begin: Ints  # (n,) bytes
    size: Ints  # (n,) bytes, header included
    kind: Ints  # (n,)
    rest: int  # where the unfinished last object begins
    step: int = 0  # bytes from one object to the next, where that and their headers are all alike; else 0


def chain(data: Data, position: int) -> Chain:
    """Find all whole objects of `data` from byte `position`. Raises Broken.

    >>> item = blf.OBJECT.pack(blf.SIGNATURE, 16, 1, 18, 65) + b"ab" + bytes(2)
    >>> objects = chain(item * 3 + item[:10], 0)
    >>> objects.begin.tolist(), objects.size.tolist(), objects.rest
    ([0, 20, 40], [18, 18, 18], 60)
    """
    total = len(data)
    begin = data.find(blf.SIGNATURE, position, position + MAX_PADDING_BYTES)
    if begin < 0 or begin + blf.OBJECT.size > total:
        return Chain(*_NONE, _rest(data, position))
    regular = _regular(data, begin)
    if regular is not None:
        return regular
    linked = _aligned(data, begin)
    if linked is None:
        linked = _unaligned(data, begin)
    begins, size, kind = linked
    if size.size and (size.min() < blf.OBJECT.size or size.max() > MAX_INFLATED_BYTES):
        bad = size[(size < blf.OBJECT.size) | (size > MAX_INFLATED_BYTES)][0]
        raise Broken(f"an object claims a size of {bad} bytes")
    if begins[-1] + size[-1] > total:
        rest = int(begins[-1])
        begins, size, kind = begins[:-1], size[:-1], kind[:-1]
    else:
        rest = _rest(data, int(begins[-1] + size[-1]))
    return Chain(begins, size, kind, rest)


_NONE = (np.zeros(0, np.int64),) * 3
_Linked = tuple[Ints, Ints, Ints]


def _rest(data: Data, position: int) -> int:
    """Where an unfinished object begins, at `position` or after padding; `position` where none does."""
    begin = data.find(blf.SIGNATURE, position, position + MAX_PADDING_BYTES)
    if begin >= 0:
        return begin
    # too little is left to distinguish padding from the beginning of an object
    if position + MAX_PADDING_BYTES > len(data):
        return position
    raise Broken("no object begins where one should")


def _regular(data: Data, first: int) -> Chain | None:
    """The chain from `first` if it ends the data with objects that are all alike, else None."""
    _, _, _, size, kind = blf.OBJECT.unpack_from(data, first)
    follower = data.find(blf.SIGNATURE, first + size, first + size + MAX_PADDING_BYTES)
    step = follower - first
    if not blf.OBJECT.size <= size <= step:
        return None
    n = (len(data) - first - size) // step + 1
    heads = np.ndarray((n,), _ALIKE, data, first, (step,))
    if not ((heads["one"] == heads["one"][0]).all() and (heads["two"] == heads["two"][0]).all()):
        return None
    rest = _rest(data, first + (n - 1) * step + size)
    if rest + blf.OBJECT.size <= len(data) and data.startswith(blf.SIGNATURE, rest):
        last = blf.OBJECT.unpack_from(data, rest)[3]
        if rest + last <= len(data) or last > MAX_INFLATED_BYTES:
            return None  # not unfinished, but another kind of object
    begin = np.arange(first, first + n * step, step)
    alike = np.broadcast_to(np.int64(size), n), np.broadcast_to(np.int64(kind), n)
    # the signature comes first in `one`: no other can stand between two objects less than eight bytes apart
    return Chain(begin, *alike, rest, step)


def _aligned(data: Data, first: int) -> _Linked | None:
    """The chain from `first` if it is all there is on multiples of four bytes, else None.

    The last object may be unfinished; nothing else but it may follow the last signature found.
    """
    words = np.frombuffer(data, "<u4", (len(data) - first) // _WORD, first)
    at = np.flatnonzero(words[: len(words) - 3] == _SIGNATURE)
    size, kind = words[at + _SIZE_AT // _WORD].astype(np.int64), words[at + _KIND_AT // _WORD]
    begin = at * _WORD + first
    end = begin + size
    gap = begin[1:] - end[:-1]
    # with less than four bytes between an object and the next, no other signature fits in between
    if gap.size and (gap.min() < 0 or gap.max() >= _WORD):
        return None
    last = int(end[-1])
    if last + blf.OBJECT.size <= len(data) and data.find(blf.SIGNATURE, last, last + MAX_PADDING_BYTES) >= 0:
        return None  # it goes on, off the multiples of four
    return begin, size, kind.astype(np.int64)


def signatures(data: Data, first: int) -> tuple[Ints, npt.NDArray[Any]]:
    """Positions of signatures from byte `first` on that leave space for a header, and these headers."""
    positions = []
    for phase in range(_WORD):
        words = np.frombuffer(data, "<u4", max(len(data) - first - phase, 0) // _WORD, first + phase)
        positions.append(np.flatnonzero(words == _SIGNATURE) * _WORD + (first + phase))
    candidate = np.sort(np.concatenate(positions))
    body = max(len(data) - blf.OBJECT.size + 1, 0)
    candidate = candidate[candidate < body]
    # a view of overlapping headers: one for every byte
    return candidate, np.ndarray((body,), _OBJECT_HEADER, data, 0, (1,))[candidate]


def _unaligned(data: Data, first: int) -> _Linked:
    """The chain from `first` among all signatures."""
    candidate, headers = signatures(data, first)
    size = headers["size"].astype(np.int64)
    end = candidate + size
    follower = np.searchsorted(candidate, end)
    there = candidate[np.minimum(follower, len(candidate) - 1)]
    linked = (follower < len(candidate)) & (there <= end + _MAX_SLACK_BYTES) & (size >= blf.OBJECT.size)
    # runs of candidates that follow each other, and jumps over those within an object's data
    jumps = np.flatnonzero(~linked | (follower != np.arange(1, len(candidate) + 1)))
    runs: list[Ints] = []
    index = 0
    while True:
        if len(runs) > _MAX_JUMPS:
            raise Broken("signatures stand within too many objects")
        jump = jumps[np.searchsorted(jumps, index)]
        runs.append(np.arange(index, jump + 1))
        if not linked[jump]:
            break
        index = int(follower[jump])
    chosen = np.concatenate(runs)
    return candidate[chosen], size[chosen], headers["kind"][chosen].astype(np.int64)


_ALIKE = np.dtype([("one", "<u8"), ("two", "<u8")])
_OBJECT_HEADER = np.dtype(HEADER_FIELDS[:5])  # up to the type, as `blf.OBJECT`
