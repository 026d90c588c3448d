"""A signal's raw numbers out of many frames at once: what `bits.raw_of` takes out of one."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.vehicle.bits import Bits, raw_of

_WORD = 8  # bytes
# numpy's names of IEEE 754 half, single and double
_FLOATS = {16: ("<u2", "<f2"), 32: ("<u4", "<f4"), 64: ("<u8", "<f8")}


class Payloads(NamedTuple):
    """The data of one message's frames."""

    data: npt.NDArray[np.uint8]  # (n, 8) or (n, 64)
    length: npt.NDArray[np.uint8]  # (n,) bytes that each frame has
    shortest: int  # the smallest of them
    little: npt.NDArray[np.uint64]  # (n,) the first eight bytes as one number
    big: npt.NDArray[np.uint64]


def payloads(data: npt.NDArray[np.uint8], length: npt.NDArray[np.uint8]) -> Payloads:
    """Prepare frames of one message.

    >>> payloads(np.zeros((3, 8), np.uint8), np.array([8, 8, 2], np.uint8)).shortest
    2
    """
    little = np.ascontiguousarray(data[:, :_WORD]).view("<u8")[:, 0]
    return Payloads(data, length, int(length.min(initial=255)), little, little.byteswap())


def raws_of(bits: Bits, frames: Payloads) -> tuple[npt.NDArray[Any], npt.NDArray[np.bool_] | None]:
    """Take the raw numbers out.

    Returns:
        the numbers, integers or floats as the signal's are, and which frames are long enough (None: all are); in
        the others the number means nothing.

    Example:
        >>> frames = payloads(np.array([[0x34, 0xF2, 0, 0, 0, 0, 0, 0]], np.uint8), np.array([2], np.uint8))
        >>> raws_of(Bits(0, 12), frames)[0].tolist(), raws_of(Bits(7, 12, motorola=True), frames)[0].tolist()
        ([564], [847])
    """
    n, width = frames.data.shape
    needed = -(-bits.end // 8)
    there = None if needed <= frames.shortest else frames.length >= needed
    if needed > width:
        return np.zeros(n), np.zeros(n, bool)
    if bits.length > 8 * _WORD:
        return _one_by_one(bits, frames), there
    if needed <= _WORD:
        word, shift = (frames.big, 8 * _WORD - bits.end) if bits.motorola else (frames.little, bits.start)
        raw = word >> np.uint64(shift) if shift else word
    else:
        raw = _far(bits, frames.data)
    if bits.length < 8 * _WORD:
        raw = raw & np.uint64((1 << bits.length) - 1)
    if bits.floating:
        pattern, number = _FLOATS[bits.length]
        # a signalling NaN is a NaN
        with np.errstate(invalid="ignore"):
            return raw.astype(pattern).view(number).astype(np.float64), there
    if bits.signed:
        half = np.uint64(1 << (bits.length - 1))
        return ((raw ^ half) - half).view(np.int64), there  # two's complement, modulo 2^64
    return raw, there


def _far(bits: Bits, data: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint64]:
    """Signals behind the eighth byte: their bytes in ascending order, then shifted."""
    first, last = bits.start // 8, (bits.end - 1) // 8
    if bits.motorola:
        columns, shift = data[:, first : last + 1][:, ::-1], 8 * (last + 1) - bits.end
    else:
        columns, shift = data[:, first : last + 1], bits.start % 8
    low = np.zeros((len(data), _WORD), np.uint8)
    low[:, : min(columns.shape[1], _WORD)] = columns[:, :_WORD]
    raw: npt.NDArray[np.uint64] = low.view("<u8")[:, 0] >> np.uint64(shift)
    if columns.shape[1] > _WORD:
        raw |= columns[:, _WORD].astype(np.uint64) << np.uint64(8 * _WORD - shift)
    return raw


def _one_by_one(bits: Bits, frames: Payloads) -> npt.NDArray[Any]:
    """Numbers of more than 64 bits."""
    rows = zip(frames.data, frames.length.tolist(), strict=True)
    return np.array([raw_of(bits, row[:length].tobytes()) or 0 for row, length in rows], dtype=object)
