"""AUTOSAR container PDUs with long headers, which cantools reads as empty: read as if their headers were short."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

from canid.signals.dbc_text.content import Container

_CONTAINER = re.compile(r"<CONTAINER-I-PDU[\s>].{0,20000}?</CONTAINER-I-PDU>", re.DOTALL)
_NAME = re.compile(r"<SHORT-NAME>\s*([^<\s]+)\s*</SHORT-NAME>")
_LONG = re.compile(r"(<HEADER-TYPE>\s*)LONG-HEADER(\s*</HEADER-TYPE>)")
_SHORT_ID = re.compile(r"\s*<HEADER-ID-SHORT-HEADER>[^<]*</HEADER-ID-SHORT-HEADER>")
_LONG_ID = re.compile(r"<HEADER-ID-LONG-HEADER>\s*(0[xX][0-9a-fA-F]{1,8}|\d{1,10})\s*<")
# characters between a PDU's name and its properties
_MAX_BEFORE = 4_000
_PROPERTIES = re.compile(r"<CONTAINED-I-PDU-PROPS>.{0,4000}?</CONTAINED-I-PDU-PROPS>", re.DOTALL)


def long_headers(text: str) -> frozenset[str]:
    """Names of the container PDUs of an ARXML whose headers are long.

    Example:
        >>> pdu = "<SHORT-NAME>A</SHORT-NAME><HEADER-TYPE>LONG-HEADER</HEADER-TYPE>"
        >>> long_headers(f"<CONTAINER-I-PDU>{pdu}</CONTAINER-I-PDU>")
        frozenset({'A'})
    """
    containers = set()
    for match in _CONTAINER.finditer(text):
        name = _NAME.search(match[0])
        if name and _LONG.search(match[0]):
            containers.add(name[1])
    return frozenset(containers)


def with_short_headers(text: str) -> str:
    """The same ARXML with every long header written as a short one, whose id may be as large."""
    return _PROPERTIES.sub(_short_id, _LONG.sub(r"\1SHORT-HEADER\2", text))


def _short_id(match: re.Match[str]) -> str:
    text = match[0]
    if _SHORT_ID.search(text):
        return text
    return text.replace("HEADER-ID-LONG-HEADER>", "HEADER-ID-SHORT-HEADER>")


def long_ids(text: str) -> dict[str, int]:
    """The ids in long headers of the PDUs of an ARXML, by name."""
    ids = {}
    for match in _PROPERTIES.finditer(text):
        number = _LONG_ID.search(match[0])
        before = text[max(0, match.start() - _MAX_BEFORE) : match.start()]
        names = _NAME.findall(before)
        if number and names:
            ids[names[-1]] = int(number[1], 0)
    return ids


def container_of(message: Any, part: Any, long: Collection[str], ids: Mapping[str, int]) -> Container:
    """The header of a PDU of cantools in its container message."""
    paths = message.autosar.pdu_paths if message.autosar is not None else ()
    is_long = any(path.rsplit("/", 1)[-1] in long for path in paths)
    header_id = ids.get(part.name, part.header_id) if is_long else part.header_id
    return Container(message.name, header_id or 0, is_long, message.header_byte_order == "little_endian")
