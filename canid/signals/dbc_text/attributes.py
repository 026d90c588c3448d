"""Attributes of a DBC that change what its messages are: cycle time, protocol, long names, SPN."""

from __future__ import annotations

import math
from typing import NamedTuple

from canid.signals.dbc_text.message_lines import integer
from canid.signals.dbc_text.numbers import number
from canid.signals.dbc_text.tables import Key

# numbers of VFrameFormat where the file does not list its texts (Vector)
_J1939_FORMAT = 3
J1939 = "j1939"


class Attributes(NamedTuple):
    """Values of attributes, by name and owner."""

    values: dict[tuple[str, Key | None, str], str]  # (name, message, signal); (name, None, ""): of the file
    defaults: dict[str, str]
    choices: dict[str, list[str]]  # texts of enumerations


def text_of(attributes: Attributes, name: str, key: Key | None, signal: str = "") -> str:
    """The value, else the default; of an enumeration its text; empty where there is none."""
    value = attributes.values.get((name, key, signal), attributes.defaults.get(name, ""))
    texts, place = attributes.choices.get(name), integer(value)
    return texts[place] if texts and place is not None and 0 <= place < len(texts) else value


def period(attributes: Attributes, key: Key) -> float:
    """Cycle time in s; NaN where the file says none."""
    value = number(text_of(attributes, "GenMsgCycleTime", key))
    return value / 1000 if value else math.nan


def protocol(attributes: Attributes, key: Key) -> str:
    """The protocol of a message, as `declared` decides it.

    Example:
        >>> protocol(Attributes({("ProtocolType", None, ""): "J1939"}, {}, {}), (0x18F004FE, True))
        'j1939'
    """
    by_message = ("VFrameFormat", key, "") in attributes.values
    file_wide = text_of(attributes, "ProtocolType", None)
    return declared(text_of(attributes, "VFrameFormat", key), by_message, file_wide, key[1])


def declared(frame_format: str, by_message: bool, file_wide: str, extended: bool) -> str:
    """The protocol that the attributes of a DBC declare.

    Args:
        frame_format: text or number of VFrameFormat of the message.
        by_message: whether the message itself has it (else it is the default of the file).
        file_wide: ProtocolType of the file.
        extended: whether the message has a 29-bit id; no other is J1939.

    Example:
        >>> declared("J1939PG", True, "", True), declared("ExtendedCAN", True, "J1939", True)
        ('j1939', '')
    """
    if not extended:
        return ""
    if frame_format in ("J1939PG", str(_J1939_FORMAT)):
        return J1939
    return J1939 if file_wide.strip().lower() == J1939 and not by_message else ""


def spn(attributes: Attributes, key: Key, signal: str) -> int:
    """Suspect parameter number of a signal; 0 where there is none."""
    return integer(text_of(attributes, "SPN", key, signal)) or 0
