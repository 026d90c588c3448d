"""Parses lines of an .asc with decimal numbers as arrays: by the words of a line, whose columns vary with the numbers.

Every word of a block has a first and a last byte; what the words of a classic data frame have to be is tested for all
lines at once. What is not certain here is left to `asc_line`, which is the definition: the results are the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.line_columns import LineColumns, none_found
from canid.io.logs.text_lines import Block
from canid.values.frame_columns import CLASSIC_BYTES, MAX_EXTENDED_ID, MAX_STANDARD_ID
from canid.values.types import Flag

Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

_TX, _EXTENDED = int(Flag.TX), int(Flag.EXTENDED)
# classes of bytes: what separates words, digits, and bytes that only the definition takes
_BLANK, _DIGIT, _PRINTED, _ALIEN = range(4)
_CLASSES = np.full(256, _ALIEN, np.uint8)
_CLASSES[0x21:0x7F] = _PRINTED
_CLASSES[[*b" \t\r\n"]] = _BLANK
_CLASSES[ord("0") : ord("9") + 1] = _DIGIT
# words before the data: time, channel, id, direction, "d", DLC
_HEAD_WORDS = 6
# words behind the data: none, or "Length = 240015 BitCount = 124 ID = 1785"
_TAIL = ((0, b"Length"), (1, b"="), (3, b"BitCount"), (4, b"="), (6, b"ID"), (7, b"="))
_TAIL_WORDS = 9
# digits of a number that still fits, of either side of a time's point, and of an id
_MAX_DIGITS = 9
_WORD_BYTES = 8  # compared at once


class _Words(NamedTuple):
    """The words of a block."""

    octets: npt.NDArray[np.uint8]  # of the block, and as many zeros behind it as a word is compared by
    begin: Ints  # (w,) first byte of each word
    end: Ints  # (w,) one past its last byte
    others: Ints  # (bytes + 1,) how many bytes before each are no digits


def read(block: Block) -> LineColumns:
    r"""All classic data frames of usual form in a block whose numbers are decimal.

    >>> found = read(Block(b"0.5 1 290 Rx d 2  10 255\n", np.array([25]), 1))
    >>> bool(found.found[0]), int(found.ns[0]), int(found.id[0]), found.data[0, :2].tolist()
    (True, 500000000, 290, [10, 255])
    """
    n = len(block.ends)
    out = none_found(n)
    octets = np.frombuffer(block.data, np.uint8)
    classes = _CLASSES[octets]
    inside = classes != _BLANK
    edges = np.flatnonzero(np.diff(inside.view(np.int8), prepend=0, append=0))
    begin, end = edges[::2], edges[1::2]
    if not begin.size:
        return out
    padded = np.concatenate([octets, np.zeros(_WORD_BYTES, np.uint8)])
    others = np.concatenate([[0], np.cumsum(classes != _DIGIT, dtype=np.int64)])
    words = _Words(padded, begin, end, others)
    first = begin.searchsorted(np.concatenate([[0], block.ends[:-1]]))
    count = np.diff(first, append=len(begin))
    usual = count >= _HEAD_WORDS
    if not block.data.endswith(b"\n"):
        usual[-1] = False  # not whole
    aliens = np.flatnonzero(classes == _ALIEN)
    if aliens.size:
        usual[np.minimum(block.ends.searchsorted(aliens, "right"), n - 1)] = False
    rows = np.flatnonzero(usual)
    at = first[rows]
    good, sent = _is(words, at + 3, b"Rx"), _is(words, at + 3, b"Tx")
    good |= sent
    good &= _is(words, at + 4, b"d") & _digits(words, at + 1, 4) & _digits(words, at + 5, 2)
    rows, at, sent = rows[good], at[good], sent[good]
    if not rows.size:
        return out
    dlc = _number(words, words.begin[at + 5], words.end[at + 5], 2)
    length = np.minimum(dlc, CLASSIC_BYTES)
    good = (dlc <= 15) & _ends_well(words, at, count[rows], length)
    rows, at, sent, length = rows[good], at[good], sent[good], length[good]
    return _frames(words, rows, at, sent, length, out)


def _frames(words: _Words, rows: Ints, at: Ints, sent: Bools, length: Ints, out: LineColumns) -> LineColumns:
    """Set the frames of lines whose words are as they should be; numbers too large are left out."""
    ns, timed = _times(words, at)
    id_end = words.end[at + 2].copy()
    extended = words.octets[id_end - 1] == ord("x")
    id_end -= extended
    id_begin = words.begin[at + 2]
    good = timed & (words.others[id_end] == words.others[id_begin])
    good &= (id_end > id_begin) & (id_end - id_begin <= _MAX_DIGITS)
    id_ = _number(words, id_begin, id_end, _MAX_DIGITS)
    good &= id_ <= np.where(extended, MAX_EXTENDED_ID, MAX_STANDARD_ID)
    data = np.zeros((len(rows), CLASSIC_BYTES), np.int64)
    for k in range(int(length.max(initial=0))):
        there = np.flatnonzero(length > k)
        word = at[there] + _HEAD_WORDS + k
        fits = _digits(words, word, 3)
        data[there, k] = np.where(fits, _number(words, words.begin[word], words.end[word], 3), 256)
    good &= (data <= 0xFF).all(axis=1)
    kept = rows[good]
    bus = _number(words, words.begin[at + 1], words.end[at + 1], 4)
    out.found[kept] = True
    out.ns[kept] = ns[good]
    out.bus[kept] = np.maximum(bus[good], 1) - 1
    out.id[kept] = id_[good]
    out.flags[kept] = (_TX * sent[good] + _EXTENDED * extended[good]).astype(np.uint8)
    out.length[kept] = length[good]
    out.data[kept] = data[good]
    return out


def _is(words: _Words, which: Ints, text: bytes) -> Bools:
    """Which of these words are `text`, of at most eight bytes."""
    begin = words.begin[which]
    same: Bools = words.end[which] - begin == len(text)
    for k, octet in enumerate(text):
        same &= words.octets[begin + k] == octet
    return same


def _digits(words: _Words, which: Ints, most: int) -> Bools:
    """Which of these words are numbers of at most so many digits."""
    begin, end = words.begin[which], words.end[which]
    some: Bools = (words.others[end] == words.others[begin]) & (end - begin <= most)
    return some


def _number(words: _Words, begin: Ints, end: Ints, most: int) -> Ints:
    """The last `most` digits at most between two bytes as a number; what is no digit gives any number."""
    value = np.zeros(len(begin), np.int64)
    for k in range(min(most, int((end - begin).max(initial=0)))):
        octet = words.octets[np.maximum(end - 1 - k, begin)].astype(np.int64) - ord("0")
        value += np.where(end - 1 - k >= begin, octet, 0) * 10**k
    return value


def _times(words: _Words, at: Ints) -> tuple[Ints, Bools]:
    """Ns of the lines' times, and which of them are."""
    begin, end = words.begin[at], words.end[at]
    point = np.full(len(at), -1)
    for k in range(1, _MAX_DIGITS + 1):
        octet = words.octets[np.maximum(end - 1 - k, 0)]
        point = np.where((point < 0) & ((octet == ord(".")) | (octet == ord(","))), end - 1 - k, point)
    good = (point > begin) & (words.others[end] - words.others[begin] == 1) & (point - begin <= _MAX_DIGITS)
    point = np.where(good, point, begin)
    whole = _number(words, begin, point, _MAX_DIGITS)
    fraction = _number(words, point + 1, end, _MAX_DIGITS)
    scale = 10 ** np.maximum(_MAX_DIGITS - (end - point - 1), 0)
    return np.where(good, whole * 10**9 + fraction * scale, 0), good


def _ends_well(words: _Words, at: Ints, count: Ints, length: Ints) -> Bools:
    """Which lines end with their data, or with what may follow them."""
    more = count - _HEAD_WORDS - length
    ends: Bools = more == 0
    tailed = np.flatnonzero(more == _TAIL_WORDS)
    if tailed.size:
        first = (at + _HEAD_WORDS + length)[tailed]
        good = np.ones(len(tailed), bool)
        for k, text in _TAIL:
            good &= _is(words, first + k, text)
        for k in (2, 5):
            good &= _digits(words, first + k, 10)
        last = words.end[first + 8] - (words.octets[words.end[first + 8] - 1] == ord("x"))
        begin = words.begin[first + 8]
        good &= (words.others[last] == words.others[begin]) & (last > begin) & (last - begin <= 10)
        ends[tailed] = good
    return ends
