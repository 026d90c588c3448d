"""Reads lists of CAN frames in columns, as SavvyCAN, cabana, panda, Kvaser and Vehicle Spy write them as .csv.

The header says which column is which; what each program means by its numbers is in `PROGRAMS`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from canid.io.logs.content import cells_of, first_lines
from canid.io.logs.frame_lines import Row, bus_of, checked_id, read
from canid.io.logs.others import list_header
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Bad, Line, remote_length
from canid.values import timestamps
from canid.values.bus_names import bus_numbers
from canid.values.frame_columns import WantedIds
from canid.values.types import Columns, Flag

_TIME = re.compile(r"-?\d{1,20}([.,]\d{1,20})?(e[+-]?\d{1,3})?", re.IGNORECASE)
_WHOLE = re.compile(r"\d{1,5}")
_TRUE, _FALSE = ("true", "t", "1", "x"), ("false", "f", "0", "", "s")
# Kvaser's flags (canlib: canMSG_*, canFDMSG_*)
_RTR, _STD, _EXT, _ERROR, _SENT = 0x1, 0x2, 0x4, 0x20, 0x40
_FDF, _BRS, _ESI = 0x1_0000, 0x2_0000, 0x4_0000
# panda: buses from here on are frames that it has sent, and those that it refused to send
_PANDA_SENT, _PANDA_REFUSED = 128, 192


class Program(NamedTuple):
    """What a program means by its columns."""

    header: tuple[str, ...]  # cells that its header has, see `cells_of`
    time: str  # column of the time
    id: str  # column of the id
    data: tuple[
        str, ...
    ]  # the column of all bytes, or the beginnings of the names of the columns of one each
    bus: str = ""
    length: str = ""
    extended: str = ""
    way: str = ""
    micro: bool = False  # times are in µs, unless one of the first has a decimal sign
    base: int = (
        16  # of ids without 0x; 10: unless the first lines show another; 0: as they show, of data as well
    )
    unstated: bool = False  # the header may not say the unit of its times
    panda: bool = False  # bus numbers as panda has them
    named: bool = False  # buses have names
    more: Callable[[_Cells], int] | None = None  # further flags; Raises Bad
    # whether an id has 29 bits, where no column says it; None: its number does
    wide: Callable[[_Cells], bool | None] | None = None


class _Cells(NamedTuple):
    """One line, by column."""

    columns: dict[str, int]
    cells: Sequence[str]

    def get(self, name: str) -> str:
        """The cell of a column, "" where there is none; a header's cell without a name is no column."""
        at = self.columns.get(name, -1) if name else -1
        return self.cells[at].strip(' "') if 0 <= at < len(self.cells) else ""


def _kvaser_bits(cells: _Cells) -> int:
    word = cells.get("flags")
    if not re.fullmatch(r"(0x)?[0-9A-Fa-f]{1,8}", word):
        raise Bad("its flags are damaged")
    return int(word, 16) if word.lower().startswith("0x") or not word.isdecimal() else int(word)


def _kvaser_flags(cells: _Cells) -> int:
    bits = _kvaser_bits(cells)
    if bits & _STD and bits & _EXT:
        raise Bad("its id has 11 and 29 bits")
    pairs = (
        (_RTR, Flag.REMOTE), (_EXT, Flag.EXTENDED), (_ERROR, Flag.ERROR), (_SENT, Flag.TX), (_FDF, Flag.FD),
        (_BRS, Flag.BRS), (_ESI, Flag.ESI),
    )  # fmt: skip
    return sum(int(flag) for bit, flag in pairs if bits & bit)


def _kvaser_wide(cells: _Cells) -> bool | None:
    return {_EXT: True, _STD: False}.get(_kvaser_bits(cells) & (_EXT | _STD))


def _spy_flags(cells: _Cells) -> int:
    how = (cells.get("remote") or cells.get("remote/edl-brs-esi")).upper()
    flags = int(Flag.ERROR) if cells.get("er").upper() == "T" else 0
    flags |= int(Flag.TX) if cells.get("tx").upper() == "T" else 0
    if how in ("T", "R", "REMOTE"):
        return flags | int(Flag.REMOTE)
    for word, flag in (("EDL", Flag.FD), ("FDF", Flag.FD), ("BRS", Flag.BRS), ("ESI", Flag.ESI)):
        flags |= int(flag) if word in how else 0
    return flags


_B = ("b",)
GVRET = Program(
    ("timestamp", "id", "extended"), "timestamp", "id", ("d",), "bus", "len", "extended", "dir", micro=True
)
CABANA = Program(("time", "bus", "data"), "time", "addr", ("data",), "bus", base=10, panda=True)
PANDA = Program(
    ("bus", "messageid", "message"),
    "time",
    "messageid",
    ("message",),
    "bus",
    "messagelength",
    base=10,
    panda=True,
)
KVASER = Program(
    ("time", "channel", "id", "flags"), "time", "id", ("data",), "channel", "dlc", base=0, more=_kvaser_flags,
    wide=_kvaser_wide,
)  # fmt: skip
SPY = Program(
    ("line", "abstime(sec)", "arbid"),
    "abstime(sec)",
    "arbid",
    _B,
    "network",
    "",
    "xtd",
    named=True,
    more=_spy_flags,
)
PLAIN = Program(("id",), "time", "id", ("data",), "", "dlc", base=0, unstated=True)


def _read(
    program: Program, path: Path, state: ReadState, wanted: WantedIds | None = None
) -> Iterator[Columns]:
    head = list_header.judged(path, program, first_lines(path), state.zone)
    for remark in head.remarks:
        state.remark(remark)
    reading = _Reading(program, head, state)
    if program.named and not state.buses:
        names = list_header.names(path, state.size, head.columns[program.bus], head.columns[program.time])
        state.buses.update(bus_numbers(names))
    return read(path, state, reading.take, wanted, dated=lambda: reading.dated)


# times in µs, hexadecimal ids and bytes
read_gvret = partial(_read, GVRET)
# times in s, ids with 0x or decimal, data in one cell
read_cabana = partial(_read, CABANA)
# the can_logger.py of panda, with its column of times
read_panda = partial(_read, PANDA)
# the CSV of CanKing and of the Memorator's converter: flags of canlib
read_kvaser = partial(_read, KVASER)
# a header of some 60 lines, networks by name, hexadecimal ids and bytes
read_vehicle_spy = partial(_read, SPY)
# time, id, length and data alone
read_plain = partial(_read, PLAIN)


class _Reading:
    """One pass over a list."""

    def __init__(self, program: Program, head: list_header.Head, state: ReadState) -> None:
        self._program, self._head, self._state = program, head, state
        self._below = False  # the header has come
        self.dated = head.start_ns is not None

    def take(self, text: str, line: Line) -> Row | str:
        """The frame of a line. Raises Bad."""
        head, program = self._head, self._program
        names = cells_of(text)
        if names[0] == head.first or not self._below:
            self._below = self._below or set(program.header) <= {*names}
            return "header lines"
        cells = _Cells(head.columns, text.split(head.delimiter))
        if program.named and not cells.get(program.id):
            return "lines of other networks"
        number = self._number(cells.get(program.id), head.base)
        flags = program.more(cells) if program.more is not None else 0
        extended = cells.get(program.extended).lower()
        if extended not in (*_TRUE, *_FALSE):
            raise Bad(f"{extended[:32]!r} is neither true nor false")
        wide = None if not program.extended else extended in _TRUE
        if program.wide is not None:
            wide = program.wide(cells)
        id_, width = (number & 0x1FFFFFFF, 0) if flags & Flag.ERROR else checked_id(number, extended=wide)
        flags |= int(width) | (int(Flag.TX) if cells.get(program.way).lower() == "tx" else 0)
        bus = self._bus(cells.get(program.bus)) if program.bus else 0
        if program.panda and bus >= _PANDA_SENT:
            if bus >= _PANDA_REFUSED:
                return "frames that panda did not send"
            bus, flags = bus - _PANDA_SENT, flags | int(Flag.TX)
        length = cells.get(program.length)
        if program.length and not _WHOLE.fullmatch(length):
            raise Bad("its length is damaged")
        ns = self._ns(cells.get(program.time))
        if flags & Flag.REMOTE:
            return Row(ns, bus, id_, b"", flags, remote_length(int(length or "0")))
        data = self._data(cells, int(length) if length else -1)
        if not line.whole and not (length and len(data) == int(length)):
            raise Bad("the file ends in it")
        flags |= int(Flag.FD) if len(data) > 8 else 0
        return Row(ns, bus, id_, data, flags)

    def _ns(self, text: str) -> int:
        if not _TIME.fullmatch(text):
            raise Bad("its time is damaged")
        if self._head.in_ms:
            ns = timestamps.from_text(text) // 1000
        elif not self._head.in_seconds and text.isdecimal():
            ns = int(text) * 1000
        elif "e" in text.lower():
            ns = timestamps.from_float(float(text.replace(",", ".")))
        else:
            ns = timestamps.from_text(text)
        if (
            self._program.micro or self._program.unstated
        ) and ns >= timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S:
            self.dated = True
        return ns + (self._head.start_ns or 0)

    def _bus(self, text: str) -> int:
        if self._program.named:
            return bus_of(text, self._state.buses)
        if not _WHOLE.fullmatch(text) or int(text) > 0xFFFE:
            raise Bad("its bus is damaged")
        return int(text)

    @staticmethod
    def _number(text: str, base: int) -> int:
        try:
            return int(text, 16 if text.lower().startswith("0x") else base)
        except ValueError:
            raise Bad(f"{text[:32]!r} is no id") from None

    def _data(self, cells: _Cells, announced: int) -> bytes:
        head = self._head
        try:
            if head.data_at is not None:
                words = cells.cells[head.data_at] if head.data_at < len(cells.cells) else ""
                digits = words.strip(' "').removeprefix("0x").replace(" ", "")
                data = bytes.fromhex(digits)
            else:
                octets = [cells.cells[k].strip(' "') if k < len(cells.cells) else "" for k in head.octets]
                if announced >= 0:
                    if any(octets[announced:]):
                        raise Bad(f"it announces {announced} data bytes and has more")
                    octets = octets[:announced]
                while octets and not octets[-1] and announced < 0:
                    octets.pop()
                data = bytes(int(word, head.data_base) for word in octets)
        except Bad:
            raise
        except ValueError:
            raise Bad("its data are not bytes") from None
        if announced >= 0 and len(data) != announced:
            raise Bad(f"it announces {announced} data bytes and has {len(data)}")
        if len(data) > 64:
            raise Bad("more than 64 data bytes")
        return data
