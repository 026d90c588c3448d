"""One line of an .asc: what frame it is, if it is one.

This is the definition; `asc_shapes` and `asc_words` read usual lines by the thousand, and give what this would.

Lines that hold no frame (statistics, status, J1939 and LIN events) are passed over; a line that should be a frame
and is not is bad. A frame needs as many data bytes as it announces.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from canid.frames.blf_layout import DLC_BYTES, FD64_BRS, FD64_EDL, FD64_ESI, FD64_REMOTE
from canid.frames.lines import Bad, Line
from canid.types import Flag

_ID = re.compile(r"([0-9a-fA-F]+)(x?)$")
_DIRECTIONS = {"rx": 0, "tx": int(Flag.TX)}
# channels have numbers of one or two digits; more than this, which no .blf can hold either, is damage
_CHANNELS = 0xFFFF - 1


class Parsed(NamedTuple):
    """A frame without its time."""

    bus: int
    id: int
    data: bytes
    flags: int
    length: int = -1


def parse(words: list[str], base: int, line: Line) -> Parsed | None:
    r"""Parse a frame from a line's words; None where the line is about something else. Raises ValueError.

    >>> parse("0.5 2 1F0x Tx d 2 0A ff".split(), 16, Line("", 1, True))
    Parsed(bus=1, id=496, data=b'\n\xff', flags=65, length=-1)
    """
    if len(words) < 3:
        if not line.whole:
            raise Bad("the file ends in it")
        return None
    if words[1].upper() == "CANFD":
        return _fd(words, base, line)
    if not words[1].isdecimal():
        return None
    bus = _bus(words[1])
    if words[2].lower() == "errorframe":
        return Parsed(bus, 0, b"", int(Flag.ERROR))
    direction = words[3].lower() if len(words) > 3 else ""
    if direction not in _DIRECTIONS:
        # statistics, J1939, "TxRq" (a wish to send, not a frame); or a line that was cut
        if not line.whole:
            raise Bad("the file ends in it")
        return None
    id_, flags = _id(words[2], base)
    flags |= _DIRECTIONS[direction]
    kind = words[4].lower() if len(words) > 4 else ""
    if kind == "r":
        if not line.whole:
            raise Bad("the file ends in it")
        asked = int(words[5], 16) if len(words) > 5 and len(words[5]) == 1 else 0
        return Parsed(bus, id_, b"", flags | int(Flag.REMOTE), asked)
    if kind != "d" or len(words) < 6:
        raise Bad("it is cut short or damaged")
    # a DLC of 9 to 15 is allowed in classic CAN and means 8 bytes
    length = min(8, _dlc(words[5], base))
    return Parsed(bus, id_, _data(words, 6, length, base, line), flags)


def _fd(words: list[str], base: int, line: Line) -> Parsed | None:
    """`t CANFD channel Rx id [name] brs esi dlc length data... duration length flags ...`."""
    if len(words) < 5:
        raise Bad("it is cut short")
    bus = _bus(words[2])
    direction = words[3].lower()
    if direction not in _DIRECTIONS:
        return None
    flags = _DIRECTIONS[direction]
    if words[4].lower() == "errorframe":
        return Parsed(bus, 0, b"", flags | int(Flag.ERROR))
    id_, extended = _id(words[4], base)
    flags |= extended
    at = 5 if len(words) > 5 and words[5] in ("0", "1") else 6  # without or with a symbolic name
    if len(words) < at + 4:
        raise Bad("it is cut short")
    brs, esi, dlc_word, length_word = words[at : at + 4]
    dlc, length = _dlc(dlc_word, base), int(length_word)
    if length > 64:
        raise Bad(f"it announces {length} data bytes")
    data = _data(words, at + 4, length, base, line)
    if not line.whole and len(words) <= at + 7 + length:
        raise Bad("the file ends in it")  # perhaps within the flags
    behind = words[at + 4 + length : at + 7 + length]  # duration, length in bits, flags
    bits = int(behind[2], 16) if len(behind) == 3 else FD64_EDL
    if bits & FD64_REMOTE or (length == 0 and dlc > 0):
        return Parsed(bus, id_, b"", flags | int(Flag.REMOTE), DLC_BYTES[dlc])
    # flags without EDL: a classic frame on a CAN FD channel; all zero: the writer left them out
    if bits & FD64_EDL or not bits:
        flags |= int(Flag.FD)
        flags |= int(Flag.BRS) if brs == "1" or bits & FD64_BRS else 0
        flags |= int(Flag.ESI) if esi == "1" or bits & FD64_ESI else 0
    return Parsed(bus, id_, data, flags)


def _bus(word: str) -> int:
    bus = max(int(word) - 1, 0)
    if bus > _CHANNELS:
        raise Bad(f"{word[:32]!r} is no channel")
    return bus


def _id(word: str, base: int) -> tuple[int, int]:
    found = _ID.match(word)
    if not found:
        raise Bad(f"{word[:32]!r} is no id (symbolic names are not supported)")
    flags = int(Flag.EXTENDED) if found[2] else 0
    id_ = int(found[1], base)
    if id_ > (0x1FFFFFFF if flags else 0x7FF):
        raise Bad(f"{word[:32]!r} is too large for an id")
    return id_, flags


def _dlc(word: str, base: int) -> int:
    # one hex digit whatever the base; with base dec some tools write 10..15
    dlc = int(word, 16 if len(word) == 1 else base)
    if not 0 <= dlc <= 15:
        raise Bad(f"{word!r} is no DLC")
    return dlc


def _data(words: list[str], at: int, length: int, base: int, line: Line) -> bytes:
    found = words[at : at + length]
    if len(found) < length:
        raise Bad(f"it announces {length} data bytes and has {len(found)}")
    last = length > 0 and at + length == len(words)
    if base == 16:
        # always two digits: one alone is what is left of two
        if any(len(word) != 2 for word in found):
            raise Bad("its data are not hexadecimal bytes")
        return bytes.fromhex("".join(found))
    if last and not line.whole:
        raise Bad("the file ends in it")
    if any(int(word) > 255 for word in found):
        raise Bad("a data byte is larger than 255")
    return bytes(int(word) for word in found)
