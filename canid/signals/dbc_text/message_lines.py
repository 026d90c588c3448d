"""The lines of messages (BO_) and signals (SG_)."""

from __future__ import annotations

import re
from typing import NamedTuple

from canid.signals.dbc_text.numbers import is_plain, number, pair, with_comma
from canid.signals.dbc_text.statements import MAX_LINE

EXTENDED_FLAG = 0x80000000
MAX_STANDARD_ID, MAX_EXTENDED_ID = 0x7FF, 0x1FFFFFFF

_MESSAGE = re.compile(
    r"BO_\s*(0[xX][0-9a-fA-F]{1,9}|\d{1,12})(?:\s+|(?=\D))([^:]+?)\s*:\s*([^\s:]*)\s*([^\n]*)"
)
_SIGNAL = re.compile(
    r"SG_\s*(?P<head>[^|]{1,600}?)\s*:\s*(?P<start>\d{1,12})\s*\|\s*(?P<length>\d{1,12})\s*@\s*(?P<order>[01])\s*"
    r"(?P<sign>[+-])\s*\((?P<pair>[^()]*)\)\s*(?P<range>\[[^\[\]]*\])?\s*(?P<unit>\"(?:\\\"|[^\"\n])*\")?(?P<rest>[^\n]*)"
)
_HEAD = re.compile(r"SG_\s*(?P<head>[^|]{1,600}?)\s*:\s*\d")
_MARKER = re.compile(r"M|m\d{0,9}M?")
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_RECEIVERS = re.compile(r"\s*[A-Za-z_]\w*(?:\s*,\s*[A-Za-z_]\w*|\s)*(?://.*)?")


class MessageLine(NamedTuple):
    """A BO_ line."""

    id: int
    extended: bool
    name: str
    length: int
    fixes: tuple[tuple[str, str], ...]  # kind, what was made of it


class SignalLine(NamedTuple):
    """A SG_ line."""

    name: str
    marker: str  # "", "M", "m3", "m3M"
    start: int
    length: int
    motorola: bool
    signed: bool
    scale: float
    offset: float
    minimum: float | None
    maximum: float | None
    unit: str
    fixes: tuple[tuple[str, str], ...]


def message_line(text: str) -> MessageLine | str:
    """Parse a BO_ line, or say why it has no one meaning.

    Example:
        >>> message_line("BO_ 2364540158 EEC1: 8 Engine")[:4]
        (217056510, True, 'EEC1', 8)
        >>> message_line("BO_ 1075054137 X: 8 Y")
        'its id 0x40140639 has more than 29 bits, and no flag of an extended id'
    """
    match = _MESSAGE.match(text) if len(text) <= MAX_LINE else None
    if match is None:
        return "no message: BO_ id name: length sender"
    number_text, raw_name, length_text, sender = match.groups()
    fixes = []
    id_ = int(number_text, 0 if number_text[:2] in ("0x", "0X") else 10)
    if number_text[:2] in ("0x", "0X"):
        fixes.append(("hex", f"id {id_}"))
    frame = frame_id(id_)
    if isinstance(frame, str):
        return frame
    if not length_text.isascii() or not length_text.isdigit() or len(length_text) > 9:
        return f"its length {length_text[:20]!r} is no number of bytes"
    if frame[1] and not id_ & EXTENDED_FLAG:
        fixes.append(("flag", f"29-bit id 0x{frame[0]:X}"))
    name, fix = name_of(raw_name)
    fixes += fix
    if not sender or not re.match(r"[A-Za-z_]\w*", sender):
        fixes.append(("receiver", "a message without a sender"))
    return MessageLine(*frame, name, int(length_text), tuple(fixes))


def frame_id(number_in_file: int) -> tuple[int, bool] | str:
    """The id, and whether it has 29 bits; or why it is none."""
    id_ = number_in_file & ~EXTENDED_FLAG
    if id_ > MAX_EXTENDED_ID or number_in_file > 0xFFFFFFFF:
        flag = "the" if number_in_file & EXTENDED_FLAG else "no"
        return f"its id 0x{number_in_file:X} has more than 29 bits, and {flag} flag of an extended id"
    return id_, bool(number_in_file & EXTENDED_FLAG) or id_ > MAX_STANDARD_ID


def name_of(text: str) -> tuple[str, list[tuple[str, str]]]:
    """The name by which a vehicle file can name it: without blanks, dots and control characters.

    Example:
        >>> name_of("2017_5")[0], name_of("Wheel speed.FL")[0], name_of("Größe")[0]
        ('2017_5', 'Wheel_speed_FL', 'Größe')
    """
    if _IDENTIFIER.fullmatch(text):
        return text, []
    name = "".join(
        "_" if c.isspace() or c == "." or not c.isprintable() else c for c in " ".join(text.split())
    )
    return name, [("name", f"the name {name[:60]}")]


def signal_line(text: str) -> SignalLine | str:
    """Parse a SG_ line, or say why it has no one meaning.

    Example:
        >>> signal_line('SG_ Torque:4|13@0+(.25,-500)[-500|1547.5]"NM"XXX')[:9]
        ('Torque', '', 4, 13, True, False, 0.25, -500.0, -500.0)
        >>> signal_line('SG_ S : 0|8@1+ (1,5,0) [0|0] "" X')
        'its factor and offset (1,5,0) have several meanings, or none'
    """
    match = _SIGNAL.match(text) if len(text) <= MAX_LINE else None
    if match is None:
        return 'no signal: SG_ name : start|length@order sign (factor,offset) [low|high] "unit" receivers'
    fixes: list[tuple[str, str]] = []
    name, marker, fix = _head(match["head"])
    fixes += fix
    linear = pair(match["pair"])
    if linear is None:
        return f"its factor and offset ({match['pair'].strip()[:40]}) have several meanings, or none"
    fixes += _number_fixes(match["pair"], f"({linear[0]:g},{linear[1]:g})")
    low, high, fix = _range(match["range"])
    fixes += fix
    unit = match["unit"]
    if unit is None:
        fixes.append(("unit", "no unit"))
    if not _RECEIVERS.fullmatch(match["rest"]):
        fixes.append(("receiver", "a signal without a known receiver"))
    return SignalLine(
        name,
        marker,
        int(match["start"]),
        int(match["length"]),
        match["order"] == "0",
        match["sign"] == "-",
        *linear,
        low,
        high,
        "" if unit is None else unit[1:-1].replace('\\"', '"'),
        tuple(fixes),
    )


def name_in(text: str) -> str:
    """The name of a signal whose line cannot be read; empty where it has none."""
    match = _HEAD.match(text)
    return _head(match["head"])[0] if match else ""


def _head(head: str) -> tuple[str, str, list[tuple[str, str]]]:
    words = head.split()
    marker = words.pop() if len(words) > 1 and _MARKER.fullmatch(words[-1]) else ""
    name, fixes = name_of(" ".join(words))
    return name, marker, fixes


def _number_fixes(text: str, now: str) -> list[tuple[str, str]]:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 2:
        return [("comma", now)]
    return [] if all(map(is_plain, parts)) else [("number", now)]


def _range(text: str | None) -> tuple[float | None, float | None, list[tuple[str, str]]]:
    """Lower and upper limit; [0|0] stands for none."""
    parts = [part.strip() for part in (text or "[]")[1:-1].split("|")]
    if parts == ["0", "0"]:
        return None, None, []
    numbers = [with_comma(part) for part in parts]
    if len(numbers) != 2 or None in numbers:
        return None, None, [("range", "no range")]
    now = f"[{numbers[0]:g}|{numbers[1]:g}]"
    if any("," in part for part in parts):
        return numbers[0], numbers[1], [("comma", now)]
    return numbers[0], numbers[1], [] if all(map(is_plain, parts)) else [("number", now)]


def integer(text: str) -> int | None:
    """A whole number, also as 1.0 or 0x1F.

    Example:
        >>> integer("-3"), integer("2.0"), integer("0x1F"), integer("2.5")
        (-3, 2, 31, None)
    """
    if re.fullmatch(r"[-+]?\d{1,30}", text):
        return int(text)
    if re.fullmatch(r"0[xX][0-9a-fA-F]{1,16}", text):
        return int(text, 16)
    value = number(text)
    return int(value) if value is not None and value == value // 1 and abs(value) < 1e18 else None
