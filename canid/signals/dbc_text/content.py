"""What a DBC describes, as plain values; and what was repaired in its text."""

from __future__ import annotations

from typing import NamedTuple


class Signal(NamedTuple):
    """A signal as its file describes it."""

    name: str
    start: int
    length: int
    motorola: bool
    signed: bool
    floating: bool
    scale: float
    offset: float
    minimum: float | None
    maximum: float | None
    unit: str
    choices: dict[int, str]
    is_multiplexer: bool
    multiplexer: str | None  # name of the selector
    pages: tuple[int, ...]  # raw numbers of the selector with which it comes
    spn: int = 0  # J1939: suspect parameter number; 0: not in the file
    elsewhere: tuple[Signal, ...] = ()  # the same on other pages, where it lies or is scaled differently

    @property
    def meanings(self) -> dict[float, str]:
        """The value table, by physical values."""
        return {raw * self.scale + self.offset: text for raw, text in self.choices.items()}


class Container(NamedTuple):
    """The container frame in which a message comes (AUTOSAR container PDU)."""

    name: str
    header_id: int  # by which the message is found in it
    long_header: bool  # 4 bytes of id and 4 of length; else 3 and 1
    little_endian: bool  # byte order of id and length


class Message(NamedTuple):
    """A message as its file describes it."""

    name: str
    id: int
    extended: bool
    length: int  # bytes
    period: float  # s; NaN: not in the file
    signals: tuple[Signal, ...]
    protocol: str = ""  # "j1939": its frames are those of the same parameter group, from any source
    container: Container | None = None  # in which it comes; its id is then the container's


class Repair(NamedTuple):
    """What a file says in a way that the format does not know."""

    line: int  # from 1
    kind: str  # of REPAIRS; "" where it was left out
    was: str  # the text, shortened
    now: str  # what was made of it, or why it was left out


class Content(NamedTuple):
    """A DBC file, parsed."""

    messages: tuple[Message, ...]
    warnings: tuple[str, ...]  # by cantools
    overlapping: tuple[str, ...]  # messages whose signals overlap or do not fit their frame
    repairs: tuple[Repair, ...] = ()
    left_out: tuple[Repair, ...] = ()  # what has no one meaning


# kind -> what was done, as a summary says it, and whether that is worth a line of its own. The others change no value
REPAIRS = {
    "flag": ("ids above 0x7FF without the flag of 29-bit ids, read as such", True),
    "comma": ("decimal commas, read as points", True),
    "unit": ("signals without a unit, read with none", True),
    "hex": ("hexadecimal numbers", True),
    "table": ("value tables given by their name", True),
    "other": ("defects that change no signal", True),
    "unused": ("entries for signals that the file does not have, left out", False),
    "comment": ("malformed comments, left out", False),
    "semicolon": ("missing semicolons", False),
    "name": ("names that begin with a digit or are no identifiers", False),
    "number": ("numbers such as .5", False),
    "range": ("signals without a range", False),
    "receiver": ("receivers or senders that are missing or malformed", False),
    "attribute": ("malformed or undefined attributes", False),
    "section": ("lines without a meaning for signals, left out", False),
}
