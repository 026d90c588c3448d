"""Numbers out of text, for thousands of words at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]
Rows = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

# bytes that must stand before the first word: a word's last nine characters are looked at, however short it is
ROOM = 9
# what `small_decimals` says of other words
NO_NUMBER = 0xFFFF
# a byte in every place of eight: "0", what lifts all but digits to the highest bit, and that
_ZEROS, _LIFT, _HIGH = (np.uint64(int.from_bytes(bytes([byte] * 8))) for byte in (ord("0"), 0x80 - 10, 0x80))
# what keeps the last n of eight characters, little-endian: a word's last character is the highest byte
_KEEP = np.array([(1 << 64) - (1 << 8 * (8 - n)) for n in range(9)], np.uint64)
# what each character is as a hexadecimal digit, NO_DIGIT for all others
NO_DIGIT = 0xFF
HEX_DIGITS = np.full(256, NO_DIGIT, np.uint8)
for _digit in range(16):
    HEX_DIGITS[ord(f"{_digit:x}")] = HEX_DIGITS[ord(f"{_digit:X}")] = _digit


def small_decimals(text: Bytes, end: Rows, size: Rows) -> npt.NDArray[np.uint16]:
    """Words' decimal numbers of one to three digits; NO_NUMBER where a word is something else.

    >>> text = np.frombuffer(b" " * ROOM + b"1 255 1e3 1000", np.uint8)
    >>> small_decimals(text, np.array([10, 14, 18, 23]), np.array([1, 3, 3, 4])).tolist()
    [1, 255, 65535, 65535]
    """
    long, at = np.minimum(size, 4).astype(np.uint8), end - 3
    hundreds, tens, value = (text[k:][at] - np.uint8(ord("0")) for k in range(3))
    tens *= long > 1
    hundreds *= long > 2
    good = (value <= 9) & (tens <= 9) & (hundreds <= 9) & (long <= 3)
    number: npt.NDArray[np.uint16] = value + np.uint8(10) * tens + np.uint16(100) * hundreds
    number |= good - np.uint16(1)  # all bits are set where it is none
    return number


def decimals(text: Bytes, end: Rows, size: Rows) -> tuple[npt.NDArray[np.int64], Bools]:
    """Decimal numbers of one to nine digits, and which words are such numbers; the others' mean nothing.

    Eight digits at once by three multiplications, as Daniel Lemire describes ("Quickly parsing eight digits", 2018).

    >>> text = np.frombuffer(b" " * ROOM + b"12 345678901 1x", np.uint8)
    >>> value, good = decimals(text, np.array([11, 21, 21, 24]), np.array([2, 9, 8, 2]))
    >>> value[:3].tolist(), good.tolist()
    ([12, 345678901, 45678901], [True, True, True, False])
    """
    # a word's last eight characters as one integer, out of a view of overlapping ones: one for every byte
    eights: npt.NDArray[np.uint64] = np.ndarray((len(text) - 7,), "<u8", text.data, 0, (1,))
    digits = (eights[end - 8] ^ _ZEROS) & _KEEP[np.clip(size, 0, 8)]
    good = ((digits | (digits + _LIFT)) & _HIGH) == 0
    good &= (size > 0) & (size <= 9)
    # two digits in every second byte, then four in every fourth, then all
    for tens, bits, keep in (
        (10, 8, 0x00FF00FF00FF00FF),
        (100, 16, 0x0000FFFF0000FFFF),
        (10_000, 32, 0xFFFFFFFF),
    ):
        digits = (digits * np.uint64(tens) + (digits >> np.uint64(bits))) & np.uint64(keep)
    value = digits.view(np.int64)
    if size.max(initial=0) > 8:
        ninth = text[end - 9] - np.uint8(ord("0"))
        nine = size >= 9
        good &= ~nine | (ninth <= 9)
        value = np.where(nine, value + ninth.astype(np.int64) * 10**8, value)
    return value, good


def hexadecimals(text: Bytes, end: Rows, size: Rows) -> tuple[npt.NDArray[np.int64], Bools]:
    """Hexadecimal numbers of one to eight digits, and which words are such numbers.

    >>> text = np.frombuffer(b" " * ROOM + b"1F0 fg", np.uint8)
    >>> value, good = hexadecimals(text, np.array([12, 15]), np.array([3, 2]))
    >>> int(value[0]), good.tolist()
    (496, [True, False])
    """
    value = np.zeros(size.shape, np.int64)
    good = (size > 0) & (size <= 8)
    for k in range(min(int(size.max(initial=0)), 8)):
        within = size > k
        digit = HEX_DIGITS[text[end - 1 - k]]
        good &= ~within | (digit < 16)
        value += np.where(within, digit, 0).astype(np.int64) << 4 * k
    return value, good
