"""Consistency checks of .blf objects that no checksum protects: in stored containers, or without a container.

There a flipped bit can turn a frame's object into one of another type, or extend an object over those that follow it.
Each inconsistency is reported as damage, and what can be read is read.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf import blf_object_kinds
from canid.io.logs.blf.blf_dtypes import HEADER_FIELDS, HEADER_SIZE
from canid.io.logs.blf.blf_layout import Data
from canid.io.logs.blf.blf_object_chain import Chain, signatures

# sizes of objects with a CAN frame, by the version of their header: classic, classic extended, error, FD
_FRAME_BODIES = (blf.CLASSIC.size, blf.CLASSIC.size + 8, blf.ERROR_EXT.size, blf.FD.size, blf.FD.size + 4)
# types whose objects have such a size themselves: triggers, LIN messages, checksum errors, the clock
_OWN_SIZE = {5: 24, 11: 24, 12: 24, 51: 16}
_CLASSIC_FLAGS = 0xE1  # of a classic frame: sent, NERR, wake-up, remote
_MOST_CHANNELS = 256
_OBJECT_HEAD = np.dtype(HEADER_FIELDS[:6])  # up to the unit


def contradiction(data: Data, position: int, links: Chain) -> str:
    """Describe the first inconsistency in a row of objects from byte `position` on; "" where there is none.

    >>> from canid.io.logs.blf.blf_object_chain import chain
    >>> item = blf.OBJECT.pack(blf.SIGNATURE, 16, 1, 18, 65) + b"ab"
    >>> contradiction(item + bytes(2) + item, 0, chain(item + bytes(2) + item, 0))
    ''
    >>> contradiction(item + b"xy" + item, 0, chain(item + b"xy" + item, 0))
    'what stands between two objects is no padding'
    """
    if not links.begin.size:
        return (
            "what stands before an object is no padding" if data[position : links.rest].strip(b"\0") else ""
        )
    if not _padded(data, position, links):
        return "what stands between two objects is no padding"
    heads = _heads(data, links)
    frames = np.isin(links.kind, list(blf.MAX_OBJECT_BYTES))
    expected = np.where(heads["version"] == 1, blf.OBJECT_V1_SIZE, blf.OBJECT_V2_SIZE)
    if (frames & (heads["header_size"] != expected)).any():
        return "the size of an object's header is damaged"
    if (frames & (heads["unit"] != blf.TEN_MICROSECONDS) & (heads["unit"] != blf.ONE_NANOSECOND)).any():
        return "the unit of an object's time is damaged"
    for k in np.flatnonzero(~frames).tolist():
        kind, begin, size = int(links.kind[k]), int(links.begin[k]), int(links.size[k])
        if blf_object_kinds.kind_of(kind) == blf_object_kinds.UNKNOWN:
            return f"an object has the type {kind}, which no list has"
        if _like_a_frame(data, begin, size, kind, int(heads["header_size"][k]), int(heads["version"][k])):
            return f"an object of type {kind} is a CAN frame but for its type"
    return "an object claims to be so long that others would stand in it" if _overlaps(data, links) else ""


def _heads(data: Data, links: Chain) -> npt.NDArray[Any]:
    count = max(len(data) - _OBJECT_HEAD.itemsize + 1, 0)
    overlapping: npt.NDArray[Any] = np.ndarray((count,), f"V{_OBJECT_HEAD.itemsize}", data, 0, (1,))
    return overlapping[np.minimum(links.begin, count - 1)].view(_OBJECT_HEAD)


def _padded(data: Data, position: int, links: Chain) -> bool:
    """Whether nothing but zeros stands between objects."""
    text = np.frombuffer(data, np.uint8)
    ends = np.concatenate([[position], links.begin + links.size])
    gaps = np.append(links.begin, links.rest) - ends
    return not any(text[ends[gaps > k] + k].any() for k in range(int(gaps.max(initial=0))))


def _like_a_frame(data: Data, begin: int, size: int, kind: int, header_size: int, version: int) -> bool:
    """Whether an object of another type has all that a CAN frame has: size, channel, flags, DLC and id."""
    body = size - HEADER_SIZE.get(version, 0)
    if header_size != HEADER_SIZE.get(version) or body not in _FRAME_BODIES or _OWN_SIZE.get(kind) == body:
        return False
    if body == blf.ERROR_EXT.size:
        channel, _, _, _, _, dlc, _, word, *_ = blf.ERROR_EXT.unpack_from(data, begin + header_size)
        flags = 0
    else:
        channel, flags, dlc, word, _ = blf.CLASSIC.unpack_from(data, begin + header_size)
    known = 0 < channel <= _MOST_CHANNELS and not flags & ~_CLASSIC_FLAGS and dlc <= 15
    return known and (word <= 0x7FF or (word & ~blf.ID_MASK) == blf.ID_EXTENDED)


def _overlaps(data: Data, links: Chain) -> bool:
    """Whether one of these objects contains another whole object."""
    if data.count(blf.SIGNATURE, int(links.begin[0]), links.rest) <= len(links.begin):
        return False  # the usual case, and much faster
    begin, heads = signatures(data, int(links.begin[0]))
    inside = ~np.isin(begin, links.begin) & (begin < links.rest)
    begin, heads = begin[inside], heads[inside]
    plausible = np.isin(heads["version"], list(HEADER_SIZE)) & np.isin(
        heads["kind"], list(blf.MAX_OBJECT_BYTES)
    )
    plausible &= heads["header_size"] == np.where(
        heads["version"] == 1, blf.OBJECT_V1_SIZE, blf.OBJECT_V2_SIZE
    )
    end = begin + heads["size"].astype(np.int64)
    owner = np.clip(np.searchsorted(links.begin, begin, side="right") - 1, 0, None)
    return bool((plausible & (end <= (links.begin + links.size)[owner])).any())
