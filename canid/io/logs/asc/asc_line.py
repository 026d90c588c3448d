"""Parses one line of an .asc as a frame.

This is the definition; `asc_fixed_columns` parses usual lines by the thousand, with the same results.

A line is a frame from its time to its last word, or it is damaged; other kinds of lines are in `asc_events`. So two
lines that have become one, because the line feed between them is damaged, are no frame. A frame needs as many data
bytes as it announces.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from canid.io.logs.blf.blf_layout import FD64_BRS, FD64_EDL, FD64_ESI, FD64_REMOTE
from canid.io.logs.text_lines import Bad, Line
from canid.values.frame_columns import DLC_BYTES, MAX_EXTENDED_ID, MAX_STANDARD_ID
from canid.values.types import Flag

_ID_WORD = re.compile(r"([0-9a-fA-F]{1,9})(x?)")
# a message's name
_NAME = re.compile(r"[A-Za-z_][\w:.]*", re.ASCII)
# letters of a name that no id has; a damaged id has one
_NO_DIGIT = re.compile(r"[g-zG-Z_]")
_HEX = re.compile(r"[0-9a-fA-F]{1,8}")
_DIRECTIONS = {"rx": 0, "tx": int(Flag.TX)}
# Channels have numbers of one or two digits; a larger one than this, which no .blf can hold either, is damage.
_MAX_CHANNEL = 0xFFFF - 1
# What may follow a classic frame's data: "Length = 240015 BitCount = 124 ID = 1785", and flags of single frames.
_TAIL_KEYS = ("length", "bitcount", "id")
_MESSAGE_FLAGS = ("te", "wu", "xx")
_VALUE = re.compile(r"[0-9a-fA-F]{1,10}x?")
# the same in two words fewer, as some tools write it
_PAIR = re.compile(r"(?:length|bitcount|id)=[0-9a-f]{1,10}x?", re.IGNORECASE)
# What may follow ErrorFrame: "ECC: 10100010", or "Flags = 0xe CodeExt = 0x20a2 ... Data = 7d 0f", in any order
_ERROR_TAIL = re.compile(
    r"(?:ECC: ?[01]{1,16})?(?: ?(?:(?:Flags|CodeExt|Code|ID|DLC|Position|Length) ?= ?(?:0x)?[0-9a-f]{1,10}x?(?!\w)"
    r"|Data ?=(?: ?[0-9a-f]{1,3}(?!\w)(?! ?=)){0,64}))*",
    re.IGNORECASE,
)
_ERROR_ID = re.compile(r"\bID ?= ?(?:0x)?([0-9a-f]{1,10})(x?)(?!\w)", re.IGNORECASE)
_ERROR_DATA = re.compile(r"\bData ?=((?: ?[0-9a-f]{1,3}(?!\w)(?! ?=))*)", re.IGNORECASE)
_HEX_PREFIX = re.compile(r"\b0x", re.IGNORECASE)
# how canid writes the codes that it does not know; then the id is decimal
_OWN_ERROR_CODES = "Flags = 0x0 CodeExt = 0x0 Code = 0x0 ID ="
# Numbers after the data of a CAN FD line: duration, length, flags, CRC, and up to four of bit timing; or none.
FD_TAIL_WORDS = (0, 3, 4, 5, 6, 7, 8)
# bits that Vector's flags have: NERR, wake-up, remote, acknowledged, request, SRR, R0, R1, EDL, BRS, ESI, and two of bursts
_FLAG_BITS = 0x307EDC
# a time, which shows that another line begins within this one
_LINE_TIME = re.compile(r"\d+[.,]\d{3,}")
# words of a CAN FD error frame: text, 64 bytes of data, and numbers
_MAX_ERROR_FRAME_WORDS = 100


class NamedMessage(Bad):
    """A line that has a message's name for its id, as Vector's tools log with a database."""

    def __init__(self, name: str):
        super().__init__(f"{name[:32]!r} is a message's name, and no id")


class Parsed(NamedTuple):
    """A frame without its time."""

    bus: int
    id: int
    data: bytes
    flags: int
    length: int = -1


def parse(words: list[str], base: int, line: Line, fd_base: int = 16) -> Parsed | None:
    r"""Parse a frame from a line's words; None where it has not the form of one. Raises ValueError where it is damaged.

    `base`: of numbers; `fd_base`: of those in CAN FD lines.

    >>> parse("0.5 2 1F0x Tx d 2 0A ff".split(), 16, Line("", 1, True))
    Parsed(bus=1, id=496, data=b'\n\xff', flags=65, length=-1)
    """
    if len(words) < 3:
        return None
    if words[1].upper() == "CANFD":
        return _fd(words, fd_base, line)
    if not words[1].isdecimal():
        return None
    bus = _bus(words[1])
    if words[2].lower() == "errorframe":
        return _error(bus, words[3:], base, line)
    direction = words[3].lower() if len(words) > 3 else ""
    if direction not in _DIRECTIONS:
        return None
    id_, flags = _id(words[2], base)
    flags |= _DIRECTIONS[direction]
    kind = words[4].lower() if len(words) > 4 else ""
    if kind == "r":
        if not line.whole:
            raise Bad("the file ends in it")
        there = len(words) > 5 and (_HEX.fullmatch(words[5]) is not None)
        asked = min(8, _dlc(words[5], base)) if there else 0
        _classic_tail(words, 6 if there else 5, line)
        return Parsed(bus, id_, b"", flags | int(Flag.REMOTE), asked)
    if kind != "d" or len(words) < 6:
        raise Bad("it is cut short or damaged")
    # a DLC of 9 to 15 is allowed in classic CAN and means 8 bytes
    length = min(8, _dlc(words[5], base))
    data = _data(words, 6, length, base, line)
    _classic_tail(words, 6 + length, line)
    return Parsed(bus, id_, data, flags)


def _error(bus: int, tail: list[str], base: int, line: Line) -> Parsed:
    """`t channel ErrorFrame Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 3be DLC = 4 Position = 5 Length = 9 Data = 7d`."""
    rest = " ".join(tail)
    if not _ERROR_TAIL.fullmatch(rest) and (line.whole or _foreign(tail)):
        raise Bad("something else follows its error frame")
    named, there = _ERROR_ID.search(rest), _ERROR_DATA.search(rest)
    cells = there[1].split() if there else []
    if cells and not line.whole:
        raise Bad("the file ends in it")
    base = _error_base(rest, named[1] if named else "", cells, base)
    digits = named[1] if named else "0"
    if base == 10 and not digits.isdecimal():
        raise Bad(f"{digits!r} is no number")
    id_ = int(digits, base)
    if id_ > MAX_EXTENDED_ID:
        raise Bad(f"{digits!r} is too large for an id")
    extended = int(Flag.EXTENDED) if named and named[2] else 0
    return Parsed(bus, id_, _data(cells, 0, len(cells), base, line), int(Flag.ERROR) | extended)


def _error_base(rest: str, id_: str, cells: list[str], base: int) -> int:
    """The base of an error frame's fields: some programs write them in hexadecimal whatever the header says."""
    if rest.startswith(_OWN_ERROR_CODES):
        return 10
    if _HEX_PREFIX.search(rest) or any(not cell.isdecimal() for cell in (id_ or "0", *cells)):
        return 16
    if any(len(cell) != 2 for cell in cells):
        return 10
    return 16 if any(cell[0] == "0" for cell in cells) else base


def _fd(words: list[str], base: int, line: Line) -> Parsed | None:
    """`t CANFD channel Rx id [name] brs esi dlc length data... duration length flags ...`."""
    if len(words) < 5:
        return None
    direction = words[3].lower()
    if direction not in _DIRECTIONS:
        return _old_fd(words, base, line) if words[4].lower() in _DIRECTIONS else None
    bus = _bus(words[2])
    flags = _DIRECTIONS[direction]
    if words[4].lower() == "errorframe":
        if _foreign(words[5:]) or len(words) > _MAX_ERROR_FRAME_WORDS:
            raise Bad("something else follows its error frame")
        return Parsed(bus, 0, b"", flags | int(Flag.ERROR))
    id_, extended = _id(words[4], base)
    flags |= extended
    at = 5 if len(words) > 5 and words[5] in ("0", "1") else 6  # without or with a symbolic name
    if len(words) < at + 4:
        raise Bad("it is cut short")
    brs, esi, dlc_word, length_word = words[at : at + 4]
    if brs not in ("0", "1") or esi not in ("0", "1"):
        raise Bad("its BRS or ESI is neither 0 nor 1")
    dlc, length = _dlc(dlc_word, base), _decimal(length_word)
    if length > 64:
        raise Bad(f"it announces {length} data bytes")
    data = _data(words, at + 4, length, base, line)
    if not line.whole and len(words) <= at + 7 + length:
        raise Bad("the file ends in it")  # perhaps within the flags
    tail = words[at + 4 + length :]  # duration, length in bits, flags, ...
    if len(tail) not in FD_TAIL_WORDS or not all(_HEX.fullmatch(word) for word in tail):
        raise Bad("something else follows its data")
    bits = _flags(tail[2], base) if tail else FD64_EDL
    if bits & FD64_REMOTE or (length == 0 and dlc > 0):
        return Parsed(bus, id_, b"", flags | int(Flag.REMOTE), DLC_BYTES[dlc])
    # flags without EDL: a classic frame on a CAN FD channel; all zero: the writer left them out
    if bits & FD64_EDL or not bits:
        flags |= int(Flag.FD)
        flags |= int(Flag.BRS) if brs == "1" or bits & FD64_BRS else 0
        flags |= int(Flag.ESI) if esi == "1" or bits & FD64_ESI else 0
    return Parsed(bus, id_, data, flags)


def _flags(word: str, base: int) -> int:
    """The flags of a CAN FD line: hexadecimal, but in a decimal line decimal where only that can be."""
    bits = int(word, 16)
    if base == 10 and word.isdecimal() and not _can_be_flags(bits) and _can_be_flags(int(word)):
        return int(word)
    return bits


def _can_be_flags(bits: int) -> bool:
    return not bits & ~_FLAG_BITS and (bool(bits & FD64_EDL) or not bits & (FD64_BRS | FD64_ESI))


def _old_fd(words: list[str], base: int, line: Line) -> Parsed:
    """`t CANFD channel id Rx brs esi d dlc length data... Length = ...`: up to version 8.0 of Vector's tools."""
    if len(words) < 9:
        raise Bad("it is cut short" if line.whole else "the file ends in it")
    bus, (id_, flags) = _bus(words[2]), _id(words[3], base)
    flags |= _DIRECTIONS[words[4].lower()]
    brs, esi, kind = words[5], words[6], words[7].lower()
    if brs not in ("0", "1") or esi not in ("0", "1") or kind not in ("d", "r"):
        raise Bad("its flags are damaged")
    dlc = _dlc(words[8], base)
    if kind == "r":
        if not line.whole:
            raise Bad("the file ends in it")
        _classic_tail(words, 9, line)
        return Parsed(bus, id_, b"", flags | int(Flag.REMOTE), min(8, dlc))
    if len(words) < 10:
        raise Bad("it is cut short" if line.whole else "the file ends in it")
    length = _decimal(words[9])
    if length != DLC_BYTES[dlc]:
        raise Bad(f"its DLC is {dlc}, and it announces {length} data bytes")
    data = _data(words, 10, length, base, line)
    _classic_tail(words, 10 + length, line)
    flags |= int(Flag.FD) | (int(Flag.BRS) if brs == "1" else 0) | (int(Flag.ESI) if esi == "1" else 0)
    return Parsed(bus, id_, data, flags)


def _classic_tail(words: list[str], at: int, line: Line) -> None:
    """Check what follows the data, from word `at` on. Raises Bad."""
    end = (
        len(words) if line.whole else len(words) - 1
    )  # of a line that is cut the last word may be half of one
    while at < end:
        word = words[at].lower()
        if word in _MESSAGE_FLAGS or _PAIR.fullmatch(word):
            at += 1
            continue
        if word not in _TAIL_KEYS:
            raise Bad("something else follows its data")
        if line.whole and at + 3 > end:
            raise Bad("it is cut short")
        if (at + 1 < end and words[at + 1] != "=") or (at + 2 < end and not _VALUE.fullmatch(words[at + 2])):
            raise Bad("something else follows its data")
        at += 3


def _foreign(words: list[str]) -> bool:
    """Whether another line seems to begin in these words."""
    return any(_LINE_TIME.fullmatch(word) or word.lower() in ("rx", "tx", "errorframe") for word in words)


def _bus(word: str) -> int:
    bus = max(_decimal(word) - 1, 0)
    if bus > _MAX_CHANNEL:
        raise Bad(f"{word[:32]!r} is no channel")
    return bus


def _named(word: str) -> bool:
    """Whether a word is a message's name, as a DBC may have it; a damaged id mostly begins with a digit.

    >>> _named("EngineData"), _named("100egi45x"), _named("12y")
    (True, False, False)
    """
    return _NAME.fullmatch(word) is not None and len(_NO_DIGIT.findall(word)) > 1


def _id(word: str, base: int) -> tuple[int, int]:
    match = _ID_WORD.fullmatch(word)
    if not match:
        raise NamedMessage(word) if _named(word) else Bad(f"{word[:32]!r} is no id")
    flags = int(Flag.EXTENDED) if match[2] else 0
    id_ = int(match[1], base)
    if id_ > (MAX_EXTENDED_ID if flags else MAX_STANDARD_ID):
        raise Bad(f"{word[:32]!r} is too large for an id")
    return id_, flags


def _decimal(word: str) -> int:
    # int() takes signs and underscores too
    if not word.isdecimal() or len(word) > 9:
        raise Bad(f"{word[:32]!r} is no number")
    return int(word)


def _dlc(word: str, base: int) -> int:
    # one hex digit whatever the base; with base dec some tools write 10..15
    dlc = int(word, 16 if len(word) == 1 else base) if _HEX.fullmatch(word) else -1
    if not 0 <= dlc <= 15:
        raise Bad(f"{word[:32]!r} is no DLC")
    return dlc


def _data(words: list[str], at: int, length: int, base: int, line: Line) -> bytes:
    octets = words[at : at + length]
    if len(octets) < length:
        raise Bad(f"it announces {length} data bytes and has {len(octets)}")
    last = length > 0 and at + length == len(words)
    if base == 16:
        # always two digits: one alone is what is left of two
        if any(len(word) != 2 for word in octets):
            raise Bad("its data are not hexadecimal bytes")
        return bytes.fromhex("".join(octets))
    if last and not line.whole:
        raise Bad("the file ends in it")
    values = [_decimal(word) for word in octets]
    if max(values, default=0) > 255:
        raise Bad("a data byte is larger than 255")
    return bytes(values)
