"""Counters and checksums in the frames of a message, recognised without a description.

A counter is a run of bits that adds the same number from each frame to the next. A checksum is a byte (or the low half of
one) whose difference to a function of the other bytes is the same in every frame: id, length and initial value, which
many checksums contain, are constants then, and need not be known.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.log_contents import Field

Bytes = npt.NDArray[np.uint8]

# frames of a message from which on it is judged, and how many at most: 64 are 4 rounds of a counter of 4 bits
MIN_FRAMES, MAX_FRAMES = 48, 256
# different values that a checksum must have taken: 8 of 256 agree by chance once in 2^64
MIN_VALUES = 8
# share of the steps that must be the same: frames that were lost break a counter, and do not unmake it
MIN_STEADY = 0.9
# generators of the 8-bit checks of vehicles: SAE J1850, AUTOSAR's 0x2F, and the one of the ITU
POLYNOMIALS = (0x1D, 0x2F, 0x07)
# lengths of counters, bits; the longest first: the low half of a byte that counts is no counter of its own
COUNTER_BITS = (16, 8, 6, 4, 3, 2)


class Law(NamedTuple):
    """A checksum: what of the other bytes is its constant part taken from."""

    says: str
    # (n, k) other bytes, (n,) checksum -> (n,) what is constant
    residual: Callable[[Bytes, Bytes], npt.NDArray[np.uint8]]


def fields(data: Bytes) -> tuple[Field, ...]:
    """Find the counters and the checksum of a message.

    Args:
        data: (n, bytes) consecutive frames of the same length.

    Returns:
        counters first; () where there are too few frames, or none is found.

    Example:
        >>> k = np.arange(100)
        >>> data = np.stack([k * k // 7 % 256, k % 16, np.zeros(100)], axis=1).astype(np.uint8)
        >>> data[:, 2] = data[:, 0] + data[:, 1] + 42
        >>> [(field.kind, field.start, field.length, field.says) for field in fields(data)]
        [('counter', 8, 4, 'counts up by 1'), ('checksum', 16, 8, 'sum of the other bytes')]
    """
    if len(data) < MIN_FRAMES or not data.shape[1]:
        return ()
    data = data[:MAX_FRAMES]
    checksum = _checksum(data)
    taken = np.zeros(8 * data.shape[1], bool)
    if checksum is not None:
        taken[checksum.start : checksum.start + checksum.length] = True
    counters = _counters(data, taken)
    if checksum is None and len(counters) > 1 and counters[-1].start == 8 * (data.shape[1] - 1):
        # only the counter moves, and the last byte with it
        residual = laws()[0].residual(data[:, :-1], data[:, -1])
        if np.unique(residual).size == 1:
            checksum = Field("checksum", counters.pop().start, 8, laws()[0].says)
    return (*counters, *((checksum,) if checksum is not None else ()))


def _counters(data: Bytes, taken: npt.NDArray[np.bool_]) -> list[Field]:
    counters: list[Field] = []
    n, width = data.shape
    moving = int.from_bytes(np.bitwise_or.reduce(data ^ data[0], axis=0).tobytes(), "little")
    for bits in COUNTER_BITS:
        for start in _starts(bits, width):
            first, last = start // 8, (start + bits - 1) // 8
            # a short counter goes through all its numbers; of a long one the upper bits may wait
            must = (1 << bits) - 1 if bits < 8 else 1
            here = moving >> start
            moves = bool(here & 0xFF and here & 0xFF00) if bits == 16 else here & must == must
            if not moves or taken[start : start + bits].any():
                continue
            word = np.zeros(n, np.uint32)
            for k in range(first, last + 1):
                word |= data[:, k].astype(np.uint32) << np.uint32(8 * (k - first))
            if bits == 16:
                # Motorola's order
                swapped = (word >> np.uint32(8)) | ((word & np.uint32(0xFF)) << np.uint32(8))
                word = swapped if _steps(swapped, bits) else word
            else:
                word = (word >> np.uint32(start % 8)) & np.uint32((1 << bits) - 1)
            step = _steps(word, bits)
            if not step:
                continue
            taken[start : start + bits] = True
            counters.append(Field("counter", start, bits, f"counts up by {step}"))
    return sorted(counters, key=lambda counter: counter.start)


def _starts(bits: int, width: int) -> range | list[int]:
    """Where a counter of this length may begin: whole bytes, or anywhere in a byte where it is shorter."""
    if bits >= 8:
        return range(0, 8 * width - bits + 1, 8)
    return [8 * byte + at for byte in range(width) for at in range(9 - bits)]


def _steps(word: npt.NDArray[np.uint32], bits: int) -> int:
    """By how much a counter of this length counts up; 0: it is none."""
    size = 1 << bits
    differences = np.diff(word.astype(np.int64))
    step = np.remainder(differences, size)
    usual = int(np.bincount(step, minlength=1).argmax()) if step.size else 0
    if usual == 0 or usual > size // 2 or float((step == usual).mean()) < MIN_STEADY:
        return 0
    # Half a byte that counts is no counter of the whole byte: that would begin anew more often than its size allows. A
    # quantity that grows evenly for a while is none either: a counter has been around, or a long one counts by 1.
    around = int((differences < 0).sum())
    if around > 1 + 1.5 * usual * step.size / size:
        return 0
    if bits < 8:
        return usual if around and usual == 1 and np.unique(word).size == size else 0
    return usual if usual == 1 else 0


def _checksum(data: Bytes) -> Field | None:
    width = data.shape[1]
    if width < 2:
        return None
    # an XOR makes each byte one of all others: the last one is taken, unless it has few values as a counter has
    few = 2 * np.unique(data[:, -1]).size < np.unique(data[:, 0]).size
    for at in (0, width - 1) if few else (width - 1, 0):
        check = data[:, at]
        others = np.delete(data, at, axis=1)
        if np.unique(others, axis=0).shape[0] < MIN_VALUES or np.unique(check).size < MIN_VALUES:
            continue
        for law in laws():
            if np.unique(law.residual(others, check)).size == 1:
                # a byte that repeats another one is its sum, its XOR and no checksum
                if (np.bitwise_or.reduce(others ^ others[0], axis=0) != 0).sum() < 2:
                    break
                return Field("checksum", 8 * at, 8, law.says)
        # Honda: half a byte, sum of all halves
        halves = (others & 15).astype(np.uint16) + (others >> 4)
        low = halves.sum(axis=1) + (check >> 4) + (check & 15)
        moves = (np.bitwise_or.reduce(others ^ others[0], axis=0) != 0).sum()
        if moves > 1 and np.unique(check & 15).size >= MIN_VALUES and np.unique(low % 16).size == 1:
            return Field("checksum", 8 * at, 4, "sum of the half bytes")
    return None


@cache
def laws() -> tuple[Law, ...]:
    """The checksums that are tried."""
    sums = (
        Law("sum of the other bytes", lambda others, check: check - others.sum(axis=1, dtype=np.uint8)),
        Law(
            "negative sum of the other bytes",
            lambda others, check: check + others.sum(axis=1, dtype=np.uint8),
        ),
        Law("XOR of the other bytes", lambda others, check: check ^ np.bitwise_xor.reduce(others, axis=1)),
    )
    return sums + tuple(
        Law(f"CRC-8, polynomial 0x{polynomial:02X}", _crc_residual(polynomial)) for polynomial in POLYNOMIALS
    )


def _crc_residual(polynomial: int) -> Callable[[Bytes, Bytes], npt.NDArray[np.uint8]]:
    """A CRC is affine: initial value, final XOR, id and length in front are one constant for frames of one length."""
    table = crc_table(polynomial)

    def residual(others: Bytes, check: Bytes) -> npt.NDArray[np.uint8]:
        crc = np.zeros(len(others), np.uint8)
        for column in others.T:
            crc = table[crc ^ column]
        return crc ^ check

    return residual


@cache
def crc_table(polynomial: int) -> npt.NDArray[np.uint8]:
    """CRC-8 of each byte, most significant bit first.

    Example:
        >>> hex(int(crc_table(0x1D)[1])), len(crc_table(0x07))
        ('0x1d', 256)
    """
    crc = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        crc = (np.where(crc & 0x80, (crc << 1) ^ polynomial, crc << 1) & 0xFF).astype(np.uint16)
    return crc.astype(np.uint8)
