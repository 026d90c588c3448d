"""How one number lies in a frame's bytes: taking it out and putting it in, Intel and Motorola order."""

from __future__ import annotations

import struct
from typing import NamedTuple

# IEEE 754 half, single and double; a DBC knows the last two (SIG_VALTYPE_), AUTOSAR files all three.
_FLOAT_CODES = {16: "e", 32: "f", 64: "d"}


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
    return number(raw & ((1 << bits.length) - 1), bits)


def number(raw: int, bits: Bits) -> float:
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
