"""Bit layout of a signal's raw number in a frame: decoding (of many frames at once) and encoding, Intel and Motorola."""

from __future__ import annotations

import struct
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Rows = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

# IEEE 754 half, single and double; a DBC knows the last two (SIG_VALTYPE_), AUTOSAR files all three.
_FLOAT_CODES = {16: "e", 32: "f", 64: "d"}
# the same in numpy, behind the unsigned integer of that size
_FLOAT_TYPES = {16: ("<u2", "<f2"), 32: ("<u4", "<f4"), 64: ("<u8", "<f8")}
_WORD_BYTES = 8
# whole numbers of so many bits are exact in a double
EXACT_BITS = 53


class Bits(NamedTuple):
    """Where a signal's raw number lies.

    `start` counts as a DBC counts: Intel from the least significant bit, Motorola from the most significant.
    """

    start: int
    length: int
    motorola: bool = False
    signed: bool = False
    floating: bool = False

    @property
    def end(self) -> int:
        """First bit after the signal, counted along its own byte order; the frame needs ceil(end/8) bytes."""
        return (8 * (self.start // 8) + 7 - self.start % 8 if self.motorola else self.start) + self.length

    @property
    def reach(self) -> tuple[float, float]:
        """Smallest and largest raw number that fits."""
        if self.floating:
            return -float("inf"), float("inf")
        if self.signed:
            return -float(1 << (self.length - 1)), float((1 << (self.length - 1)) - 1)
        return 0.0, float((1 << self.length) - 1)


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
    little = np.ascontiguousarray(data[:, :_WORD_BYTES]).view("<u8")[:, 0]
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
    if bits.length > 8 * _WORD_BYTES:
        return _one_by_one(bits, frames), there
    if needed <= _WORD_BYTES:
        word, shift = (
            (frames.big, 8 * _WORD_BYTES - bits.end) if bits.motorola else (frames.little, bits.start)
        )
        raw = word >> np.uint64(shift) if shift else word
    else:
        raw = _far(bits, frames.data)
    if bits.length < 8 * _WORD_BYTES:
        raw = raw & np.uint64((1 << bits.length) - 1)
    if bits.floating:
        pattern, number = _FLOAT_TYPES[bits.length]
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
    low = np.zeros((len(data), _WORD_BYTES), np.uint8)
    low[:, : min(columns.shape[1], _WORD_BYTES)] = columns[:, :_WORD_BYTES]
    raw: npt.NDArray[np.uint64] = low.view("<u8")[:, 0] >> np.uint64(shift)
    if columns.shape[1] > _WORD_BYTES:
        raw |= columns[:, _WORD_BYTES].astype(np.uint64) << np.uint64(8 * _WORD_BYTES - shift)
    return raw


def _one_by_one(bits: Bits, frames: Payloads) -> npt.NDArray[Any]:
    """Numbers of more than 64 bits."""
    rows = zip(frames.data, frames.length.tolist(), strict=True)
    return np.array([raw_of(bits, row[:length].tobytes()) or 0 for row, length in rows], dtype=object)


def scaled(bits: Bits, raw: npt.NDArray[Any], factor: float, offset: float) -> npt.NDArray[np.float64]:
    """Raw · factor + offset as doubles; of raw numbers that no double holds exactly, the double next to the true value.

    Args:
        bits: where the raw numbers lie.
        raw: (n,) of `raws_of`.
        factor: of the signal.
        offset: of the signal.

    Example:
        >>> scaled(Bits(0, 64), np.array([2**60 + 1], np.uint64), 1.0, -(2.0**60)).tolist()
        [1.0]
    """
    with np.errstate(all="ignore"):
        value = (raw * factor).astype(np.float64, copy=False)
        value += offset
    if bits.floating or bits.length <= EXACT_BITS or not (np.isfinite(factor) and np.isfinite(offset)):
        return value
    rows = np.flatnonzero((raw > 1 << EXACT_BITS) | (raw < -(1 << EXACT_BITS)))
    # whole numbers stay whole until they are scaled; else in fractions
    number: Callable[[float], Any] = int if factor.is_integer() and offset.is_integer() else Fraction
    times, more = number(factor), number(offset)
    for row, exact in zip(rows.tolist(), raw[rows].tolist(), strict=True):
        try:
            value[row] = float(exact * times + more)
        except OverflowError:
            value[row] = np.inf if exact * times + more > 0 else -np.inf
    return value


def raw_of(bits: Bits, data: bytes) -> float | None:
    """Take the raw number out; None where the frame ends before the signal does.

    Example:
        >>> raw_of(Bits(0, 12), bytes([0x34, 0xF2]))
        564
        >>> raw_of(Bits(7, 12, motorola=True), bytes([0x12, 0x3F]))
        291
        >>> raw_of(Bits(0, 12), bytes([0x34])) is None
        True
    """
    end = bits.end
    if end > 8 * len(data):
        return None
    if bits.motorola:
        raw = int.from_bytes(data, "big") >> (8 * len(data) - end)
    else:
        raw = int.from_bytes(data, "little") >> bits.start
    return _number(raw & ((1 << bits.length) - 1), bits)


def _number(raw: int, bits: Bits) -> float:
    """Read the raw bit pattern as the number that it stands for (two's complement or IEEE 754)."""
    if bits.floating:
        value: float = struct.unpack(
            "<" + _FLOAT_CODES[bits.length], raw.to_bytes(bits.length // 8, "little")
        )[0]
        return value
    if bits.signed and raw >> (bits.length - 1):
        return raw - (1 << bits.length)
    return raw


def put(bits: Bits, raw: float, length: int) -> int:
    """Put the raw number in its place, as one little-endian integer of a frame of `length` bytes.

    Numbers of several signals are combined with `|`, then written by `.to_bytes(length, "little")`.

    Example:
        >>> put(Bits(7, 12, motorola=True), 0x123, 2).to_bytes(2, "little").hex()
        '1230'
    """
    if bits.floating:
        pattern = int.from_bytes(struct.pack("<" + _FLOAT_CODES[bits.length], raw), "little")
    else:
        pattern = int(raw) & ((1 << bits.length) - 1)
    if not bits.motorola:
        return pattern << bits.start
    return int.from_bytes((pattern << (8 * length - bits.end)).to_bytes(length, "big"), "little")
