"""Statements that describe messages and signals further: value tables, types, pages, attributes."""

from __future__ import annotations

import re
from typing import NamedTuple

from canid.signals.dbc_text.message_lines import frame_id, integer
from canid.signals.dbc_text.strings import STRING

Key = tuple[int, bool]  # frame id, and whether it has 29 bits

# pages of one signal; a selector of 16 bits has as many
_MAX_PAGES = 65_536
_ID = r"(?P<id>0[xX][0-9a-fA-F]{1,9}|\d{1,12})"
_PAIR = re.compile(rf"\s*([-+]?[\d.xXa-fA-FeE+-]{{1,40}})\s*{STRING}")
_VALUES = re.compile(rf"VAL_\s*{_ID}\s+(?P<name>[^\s\"]+)(?P<rest>.*)", re.DOTALL)
_TABLE = re.compile(r"VAL_TABLE_\s*(?P<name>[^\s\"]+)(?P<rest>.*)", re.DOTALL)
_VALUE_OF_VARIABLE = re.compile(r"VAL_\s*[A-Za-z_]\w*\s")
_TYPE = re.compile(rf"SIG_VALTYPE_\s*{_ID}\s+(?P<name>[^\s:]+)\s*:?\s*(?P<type>[0-3])\s*;?\s*$")
_PAGES = re.compile(
    rf"SG_MUL_VAL_\s*{_ID}\s+(?P<name>[^\s;]+)\s+(?P<selector>[^\s;]+)\s+(?P<ranges>[\d\s,-]+?)\s*;?\s*$"
)
_RANGE = re.compile(r"(\d{1,12})\s*-\s*(\d{1,12})")
_LOOSE = re.compile(rf"[A-Z_]+\s*{_ID}(?:\s+(?P<name>[^\s:;]+))?")
_VALUE = rf'(?:{STRING}|([^\s";]+))\s*;?\s*$'
_ATTRIBUTE = re.compile(
    rf'BA_\s*"(?P<name>[^"]*)"\s*(?:(?P<kind>BO_|SG_)\s*{_ID}(?:\s+(?P<signal>[^\s"]+)(?=\s))?)?\s*{_VALUE}'
)
_DEFAULT = re.compile(rf'BA_DEF_DEF_\s*"(?P<name>[^"]*)"\s*{_VALUE}')
_DEFINITION = re.compile(
    r'BA_DEF_\s*(?:SG_|BO_|EV_|BU_)?\s*"(?P<name>[^"]*)"\s*ENUM\s*(?P<choices>.*)', re.DOTALL
)


class Values(NamedTuple):
    """Texts of raw numbers."""

    key: Key
    signal: str
    texts: dict[int, str]
    table: str = ""  # name of the value table that has the texts


class Pages(NamedTuple):
    """Raw numbers of a selector with which a signal comes."""

    key: Key
    signal: str
    selector: str
    numbers: list[int]


class Attribute(NamedTuple):
    """The value of an attribute."""

    name: str
    key: Key | None  # None: of the whole file
    signal: str  # "": of the message
    value: str


def key_of(text: str) -> Key | None:
    """The key of an id as a file writes it."""
    key = frame_id(int(text, 16) if text[:2] in ("0x", "0X") else int(text))
    return None if isinstance(key, str) else key


def values(text: str) -> Values | None:
    """Parse VAL_; None where it is none.

    Example:
        >>> values('VAL_ 501 GEAR 0"P"1 "R";').texts
        {0: 'P', 1: 'R'}
    """
    match = _VALUES.match(text)
    key = key_of(match["id"]) if match else None
    if match is None or key is None:
        return None
    by_name = re.fullmatch(r"\s*([A-Za-z_]\w*)\s*;?\s*", match["rest"])
    if by_name:
        return Values(key, match["name"], {}, by_name[1])
    value_texts = texts(match["rest"])
    return None if value_texts is None else Values(key, match["name"], value_texts)


def is_of_variable(text: str) -> bool:
    """Whether a VAL_ describes an environment variable."""
    return _VALUE_OF_VARIABLE.match(text) is not None


def value_table(text: str) -> tuple[str, dict[int, str]] | None:
    """Parse VAL_TABLE_."""
    match = _TABLE.match(text)
    value_texts = texts(match["rest"]) if match else None
    return None if match is None or value_texts is None else (match["name"], value_texts)


def texts(text: str) -> dict[int, str] | None:
    """Parse pairs of a number and a text, up to the semicolon."""
    by_number: dict[int, str] = {}
    position = 0
    while match := _PAIR.match(text, position):
        number = integer(match[1])
        if number is None:
            return None
        by_number[number] = match[2].replace('\\"', '"')
        position = match.end()
    return by_number if text[position:].strip() in ("", ";") else None


def value_type(text: str) -> tuple[Key, str, bool] | None:
    """Parse SIG_VALTYPE_: whether a signal is a float."""
    match = _TYPE.match(text)
    key = key_of(match["id"]) if match else None
    return None if match is None or key is None else (key, match["name"], match["type"] in "12")


def pages(text: str) -> Pages | None:
    """Parse SG_MUL_VAL_.

    Example:
        >>> pages("SG_MUL_VAL_ 100 S Mux 1-2, 7-7;")
        Pages(key=(100, False), signal='S', selector='Mux', numbers=[1, 2, 7])
    """
    match = _PAGES.match(text)
    key = key_of(match["id"]) if match else None
    if match is None or key is None:
        return None
    numbers: list[int] = []
    for part in match["ranges"].split(","):
        ends = _RANGE.fullmatch(part.strip())
        if ends is None:
            return None
        low, high = int(ends[1]), int(ends[2])
        if high - low + len(numbers) >= _MAX_PAGES:
            return None
        numbers += range(low, high + 1)
    return Pages(key, match["name"], match["selector"], numbers)


def subject(text: str) -> tuple[Key, str] | None:
    """Which message and signal a malformed statement is about."""
    match = _LOOSE.match(text)
    key = key_of(match["id"]) if match else None
    return None if match is None or key is None else (key, match["name"] or "")


def attribute(text: str) -> Attribute | None:
    """Parse BA_ of a message, a signal or the file.

    Example:
        >>> attribute('BA_ "GenMsgCycleTime" BO_ 501 20;')
        Attribute(name='GenMsgCycleTime', key=(501, False), signal='', value='20')
    """
    match = _ATTRIBUTE.match(text)
    if match is None:
        return None
    key = key_of(match["id"]) if match["kind"] else None
    if match["kind"] and key is None:
        return None
    return Attribute(
        match["name"], key, match["signal"] or "", match[5] if match[5] is not None else match[6]
    )


def default(text: str) -> tuple[str, str] | None:
    """Parse BA_DEF_DEF_."""
    match = _DEFAULT.match(text)
    return None if match is None else (match["name"], match[2] if match[2] is not None else match[3])


def choices(text: str) -> tuple[str, list[str]] | None:
    """Parse BA_DEF_ of an enumeration."""
    match = _DEFINITION.match(text)
    return None if match is None else (match["name"], re.findall(STRING, match["choices"]))
