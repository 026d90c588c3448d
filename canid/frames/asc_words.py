"""Reads the usual lines of an .asc with decimal numbers by the thousand: word by word of all lines at once.

Decimal numbers have as many digits as they need, so lines have too many shapes for `asc_shapes`. What is not certain
here is left to `asc_line`, which is the definition: this file only ever gives what that would.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.frames.asc_line import FD_TAIL
from canid.frames.asc_usual import Usual, fd_flags, nothing, wide_enough
from canid.frames.blf_layout import FD64_EDL, FD64_REMOTE
from canid.frames.columns import CLASSIC_BYTES, FD_BYTES
from canid.frames.digits import (
    HEX_DIGITS,
    NO_DIGIT,
    NO_NUMBER,
    ROOM,
    Bools,
    Bytes,
    Rows,
    decimals,
    hexadecimals,
    small_decimals,
)
from canid.frames.lines import Block
from canid.types import Flag

_TX, _EXTENDED = int(Flag.TX), int(Flag.EXTENDED)
# "A" | this is "a", and "a" stays: no other character becomes a letter by it
_SMALL = 0x20
# lines looked at together: an eighth of a block, so that what is known of their words fits a processor's caches
_AT_ONCE = 8192
# digits of a time's fraction: what python-can, Vector's tools and canid write comes first
_FRACTIONS = (6, 4, 9, 5, 7, 8, 3, 2, 1)


class _Words(NamedTuple):
    """All words of some lines."""

    text: Bytes  # the lines, with blanks around them
    end: Rows  # (n,) where each ends
    size: Rows  # (n,)


class _Lines(NamedTuple):
    """Some lines of a block."""

    row: Rows  # (n,) which
    first: Rows  # (n,) the first word of each
    words: Rows  # (n,) how many each has
    ns: npt.NDArray[np.int64]  # (n,) the time


def read(block: Block) -> Usual:
    r"""All frames of usual lines in a block whose numbers are decimal.

    >>> usual = read(Block(b"0.5 1 291 Rx d 2 7 255\n" * 9, np.arange(1, 10) * 23, 1))
    >>> bool(usual.found.all()), int(usual.ns[0]), int(usual.id[8]), usual.data[8, :2].tolist()
    (True, 500000000, 291, [7, 255])
    """
    out = nothing(len(block.ends))
    begin = 0
    for row in range(0, len(block.ends), _AT_ONCE):
        ends = block.ends[row : row + _AT_ONCE]
        end = int(ends[-1])
        text = np.frombuffer(b"".join([b" " * ROOM, block.data[begin:end], b" "]), np.uint8)
        out = _read(text, ends + (ROOM - begin), row, out)
        begin = end
    return out


def _read(text: Bytes, ends: Rows, row: int, out: Usual) -> Usual:
    """Read some lines, the first of them the block's line `row`."""
    blank = text <= ord(" ")
    edges = np.flatnonzero(blank[1:] != blank[:-1]) + 1
    end = edges[1::2].copy()
    size = end - edges[::2]
    words = _Words(text, end, size)
    lines = _timed(words, _certain(words, ends, row))
    fd = _is(words, lines.first + 1, b"canfd")
    if fd.any():
        out = _fd(words, _keep(lines, fd), out)
        lines = _keep(lines, ~fd)
    return _classic(words, lines, out)


def _certain(words: _Words, ends: Rows, row: int) -> _Lines:
    """The lines with six words or more of which it is certain that words are what stands between blanks."""
    text = words.text
    first = np.searchsorted(words.end, np.concatenate([[ROOM], ends[:-1]]), side="right")
    count = np.diff(first, append=len(words.end))
    # no line is cut, nor the one before it
    good = text[ends - 1] == ord("\n")
    good[1:] &= good[:-1]
    good &= count >= 6
    # other control characters separate words or do not; what is no ASCII may be a blank or a digit
    strange = (text - np.uint8(ord(" "))) >= 0x80 - ord(" ")
    if np.count_nonzero(strange) > len(ends):  # not the lines' ends alone
        at = np.flatnonzero(strange)
        at = at[~np.isin(text[at], list(b"\n\r\t"))]
        good[np.searchsorted(ends, at, side="right")] = False
    rows = np.flatnonzero(good)
    return _Lines(rows + row, first[rows], count[rows], rows)


def _keep(lines: _Lines, good: Bools) -> _Lines:
    return lines if good.all() else _Lines(*(column[good] for column in lines))


def _timed(words: _Words, lines: _Lines) -> _Lines:
    """Keep the lines that begin with a time."""
    text, end, size = words.text, words.end[lines.first], words.size[lines.first]
    digits = np.zeros(len(end), np.int64)
    for n in _FRACTIONS:
        character = text[end - 1 - n]
        digits[(character == ord(".")) | (character == ord(","))] = n
        if digits.all():
            break
    seconds, good = decimals(text, end - 1 - digits, size - 1 - digits)
    fraction, right = decimals(text, end, digits)
    # a comma or point found in an earlier word leaves no digits before it
    return _keep(lines._replace(ns=seconds * 10**9 + fraction * 10 ** (9 - digits)), good & right)


def _classic(words: _Words, lines: _Lines, out: Usual) -> Usual:
    """`t channel id Rx d dlc data...`."""
    dlc = _dlc(words, lines.first + 5)
    length = np.minimum(dlc, CLASSIC_BYTES)
    good = _is(words, lines.first + 4, b"d") & (dlc != NO_DIGIT) & (lines.words - 6 >= length)
    lines, length = _keep(lines, good), length[good]
    ids, flags, good = _ids(words, lines.first + 2, lines.first + 3)
    good &= _tail(words, lines.first + 6 + length, lines.words - 6 - length)
    return _frames(words, lines, lines.first + 1, ids, flags, good, lines.first + 6, length, out)


def _fd(words: _Words, lines: _Lines, out: Usual) -> Usual:
    """`t CANFD channel Rx id [name] brs esi dlc length data... duration length flags ...`."""
    # without or with a symbolic name
    at = lines.first + np.where(_bit(words, lines.first + 5), 5, 6)
    behind = lines.first + lines.words
    good = at + 4 <= behind
    lines, at, behind = _keep(lines, good), at[good], behind[good]
    brs, esi, dlc, length = (
        _number(words, at),
        _number(words, at + 1),
        _dlc(words, at + 2),
        _number(words, at + 3),
    )
    good = _bit(words, at) & _bit(words, at + 1) & (dlc != NO_DIGIT)
    good &= (length <= FD_BYTES) & ((length > 0) | (dlc == 0)) & (at + 4 + length <= behind)
    lines, at, behind, brs, esi = _keep(lines, good), at[good], behind[good], brs[good], esi[good]
    length = length[good].astype(np.uint8)
    # behind the data: duration, length in bits, flags
    last = at + 6 + length
    there = last < behind
    last = np.where(there, last, at)
    bits, good = hexadecimals(words.text, words.end[last], words.size[last])
    bits = np.where(there, bits, FD64_EDL)
    ids, flags, right = _ids(words, lines.first + 4, lines.first + 3)
    flags |= fd_flags(bits, brs, esi)
    good = (good | ~there) & right & ((bits & FD64_REMOTE) == 0)
    good &= _numbers(words, at + 4 + length, behind)
    return _frames(words, lines, lines.first + 2, ids, flags, good, at + 4, length, out)


def _tail(words: _Words, at: Rows, count: Rows) -> Bools:
    """Which lines have nothing behind their data, or "Length = 240015 BitCount = 124 ID = 1785"."""
    good: Bools = count == 0
    full = np.flatnonzero(count == 9)
    if full.size:
        first = at[full]
        fits = np.ones(full.size, bool)
        for k, key in enumerate((b"length", b"bitcount", b"id")):
            fits &= _is(words, first + 3 * k, key) & _is(words, first + 3 * k + 1, b"=")
            end, size = words.end[first + 3 * k + 2], words.size[first + 3 * k + 2]
            extended = words.text[end - 1] == ord("x")
            fits &= decimals(words.text, end - extended, size - extended)[1]
        good[full] = fits
    return good


def _numbers(words: _Words, at: Rows, behind: Rows) -> Bools:
    """Which lines have as many numbers behind their data as a CAN FD line can have, and nothing else."""
    good = np.isin(behind - at, FD_TAIL)
    for k in range(max(FD_TAIL)):
        some = np.flatnonzero(good & (at + k < behind))
        if not some.size:
            break
        word = at[some] + k
        good[some] = hexadecimals(words.text, words.end[word], words.size[word])[1]
    return good


def _is(words: _Words, at: Rows, letters: bytes) -> Bools:
    """Which of these words are this one, in small letters or capitals."""
    found: Bools = words.size[at] == len(letters)
    if found.any():
        end = words.end[at]
        for k, letter in enumerate(reversed(letters), 1):
            found &= words.text[end - k] | _SMALL == letter
    return found


def _bit(words: _Words, at: Rows) -> Bools:
    """Which of these words are 0 or 1, with one digit."""
    found: Bools = (words.size[at] == 1) & (_number(words, at) <= 1)
    return found


def _number(words: _Words, at: Rows) -> npt.NDArray[np.uint16]:
    """What these words are as decimal numbers up to 999, or NO_NUMBER."""
    return small_decimals(words.text, words.end[at], words.size[at])


def _dlc(words: _Words, at: Rows) -> Bytes:
    """One hexadecimal digit, or 10 to 15."""
    dlc = HEX_DIGITS[words.text[words.end[at] - 1]]
    long = np.flatnonzero(words.size[at] != 1)
    if long.size:
        number = _number(words, at[long])
        dlc[long] = np.where(number <= 15, number, NO_DIGIT)
    return dlc


def _ids(words: _Words, at: Rows, way: Rows) -> tuple[Rows, Bytes, Bools]:
    """Ids, the flags that say their kind and direction, and where both are such."""
    end, size = words.end[at], words.size[at]
    extended = words.text[end - 1] == ord("x")
    if extended.any():
        end, size = end - extended, size - extended
    value, good = decimals(words.text, end, size)
    good &= value <= np.array([0x7FF, 0x1FFFFFFF])[extended.view(np.uint8)]
    sent = _is(words, way, b"tx")
    good &= sent | _is(words, way, b"rx")
    return value, extended * np.uint8(_EXTENDED) | sent * np.uint8(_TX), good


def _frames(
    words: _Words, lines: _Lines, channel: Rows, ids: Rows, flags: Bytes, good: Bools, data: Rows, length: Bytes,
    out: Usual,
) -> Usual:  # fmt: skip
    """Write down the frames of good lines whose data, from the word `data` on, are bytes."""
    bus = _number(words, channel)
    good = good & (bus != NO_NUMBER)
    out = wide_enough(out, int(length.max(initial=0)))
    for n in np.flatnonzero(np.bincount(length)).tolist():
        some = np.flatnonzero(length == n)
        value = _number(words, data[some, np.newaxis] + np.arange(n))
        if value.max(initial=0) > 0xFF:
            good[some] &= (value <= 0xFF).all(axis=1)
        out.data[_place(lines.row[some]), :n] = value
    if not good.all():
        out.data[lines.row[~good]] = 0
        lines, ids, flags, bus, length = _keep(lines, good), ids[good], flags[good], bus[good], length[good]
    rows = _place(lines.row)
    out.found[rows] = True
    out.ns[rows] = lines.ns
    out.bus[rows] = np.maximum(bus, 1) - 1
    out.id[rows] = ids
    out.flags[rows] = flags
    out.length[rows] = length
    return out


def _place(rows: Rows) -> Rows | slice:
    """Rows as a slice where they follow each other, which is usual and copied at once."""
    if rows.size and rows[-1] - rows[0] == rows.size - 1:
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows
