"""Reads lists of CAN frames in columns, as SavvyCAN, cabana, Kvaser, CSS, ZLG, IXXAT and many others write them as .csv.

The header says which column is which (`table_layout`); what a program means beyond that is in its `Program`.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from canid.io.logs.content import first_lines
from canid.io.logs.frame_lines import Row, bus_of, checked_id, read
from canid.io.logs.list_columns import decoded
from canid.io.logs.local_time import epoch_ns
from canid.io.logs.others import bare_lists
from canid.io.logs.others.list_clock import Clock
from canid.io.logs.others.table_layout import (
    BASE64,
    COUNTER,
    EXTENDED_BIT,
    ID,
    NO,
    NUMBER,
    YES,
    Layout,
    Program,
    cells_of_row,
    judged,
    octets_of,
    of_base64,
)
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Bad, Line, LineCount, lines, remote_length
from canid.values import timestamps
from canid.values.bus_names import MAX_BUSES, bus_numbers
from canid.values.frame_columns import DLC_BYTES, WantedIds
from canid.values.types import Columns, Flag

# Kvaser's flags (canlib: canMSG_*, canFDMSG_*)
_STD, _EXT = 0x2, 0x4
_KVASER = (
    (0x1, Flag.REMOTE), (_EXT, Flag.EXTENDED), (0x20, Flag.ERROR), (0x40, Flag.TX), (0x1_0000, Flag.FD),
    (0x2_0000, Flag.BRS), (0x4_0000, Flag.ESI),
)  # fmt: skip
# panda: buses from here on are frames that it has sent, and those that it refused to send
_PANDA_SENT, _PANDA_REFUSED = 128, 192
# types of a CSS CL1000, CL2000: received and sent, of 11 and 29 bits
_LOGGER_TYPES = {"0": (0, False), "1": (0, True), "8": (int(Flag.TX), False), "9": (int(Flag.TX), True)}
_SENT, _RECEIVED = (
    ["1", "t", "tx", "transmit", "transmitted", "send", "sent", "out", "发送", "gesendet", "送信"],
    ["0", "r", "rx", "receive", "received", "in", "接收", "empfangen", "受信"],
)
_MARKS = (
    (Flag.REMOTE, re.compile(r"remote|rtr|远程")), (Flag.ERROR, re.compile(r"err|错误")), (Flag.FD, re.compile("fd|edl")),
    (Flag.BRS, re.compile("brs")), (Flag.ESI, re.compile("esi")),
)  # fmt: skip
_ROLES = (
    (Flag.REMOTE, "remote"),
    (Flag.ERROR, "error"),
    (Flag.FD, "fd"),
    (Flag.BRS, "brs"),
    (Flag.ESI, "esi"),
    (Flag.TX, "sent"),
)
_OTHER_BUS = re.compile(r"\b(lin|flexray|ethernet|eth|most)\b")
_WIDTHS = {
    "ext": True,
    "xtd": True,
    "29": True,
    "扩展": True,
    "std": False,
    "standard": False,
    "11": False,
    "标准": False,
}
_MAX_MARKS = 4096
# of a time that is written with an exponent: ns since 1970 are less
_MAX_STAMP = 1e20
# the cells of a row in the columns of a role
InRole = Callable[[str], list[str]]
_STARTED = re.compile(
    r".*Logging started at:?\s*(\d{4})-(\d\d)-(\d\d)[ T](\d\d):(\d\d):(\d\d).*", re.IGNORECASE
)


def _read(
    program: Program, path: Path, state: ReadState, wanted: WantedIds | None = None
) -> Iterator[Columns]:
    begin = first_lines(path)
    layout = judged(path, begin, state.zone, program)
    for remark in layout.remarks:
        state.remark(remark)
    reading = _Reading(program, layout, state, begin)
    if layout.columns.get("bus") and (not program.header or program.named):
        reading.number_buses(path)
    return read(path, state, reading.take, wanted, dated=lambda: reading.dated)


# SavvyCAN: times in µs, hexadecimal ids and bytes
read_gvret = partial(_read, Program(("timestamp", "id", "extended"), 16, 16, 1_000))
# cabana, and the can_logger.py of panda with its column of times: s, ids with 0x or decimal
read_cabana = partial(_read, Program(("time", "bus", "data"), 10, 16, 10**9, panda=True))
read_panda = partial(_read, Program(("bus", "messageid", "message"), 10, 16, 10**9, panda=True))
# the CSV of CanKing and of the Memorator's converter: flags of canlib
read_kvaser = partial(_read, Program(("time", "channel", "id", "flags"), -1, -1, 10**9, kvaser=True))
# a header of some 60 lines, networks by name, hexadecimal ids and bytes
read_vehicle_spy = partial(_read, Program(("line", "abstime(sec)", "arbid"), 16, 16, 10**9, named=True))
# of a program that is not named here
read_list = partial(_read, Program())


class _Reading:
    """One pass over a list."""

    def __init__(self, program: Program, layout: Layout, state: ReadState, begin: Sequence[str]) -> None:
        self._program, self._layout, self._state = program, layout, state
        self._clock = layout.logger or Clock(state.zone, layout.month_first)
        self._below = False  # the header has come
        self._first_bus = 0  # what the number of bus 0 is
        # the columns that say of what kind a frame is, and what the cells in them say
        self._marked = [
            k
            for role in ("extended", "way", "type", *(name for _, name in _ROLES))
            for k in layout.columns.get(role, ())
        ]
        self._known: dict[tuple[str, ...], tuple[int, bool | None]] = {}
        starts = [at for line in begin if (at := _started(line, state.zone)) is not None]
        self._start_ns = starts[0] if starts else 0  # that times count from
        self._stamped = bool(starts)

    @property
    def dated(self) -> bool:
        """Whether times count from 1970."""
        return self._stamped or self._clock.dated

    def number_buses(self, path: Path) -> None:
        """Number the buses that the whole list names; where they are numbers, from 1 unless there is a 0."""
        layout = self._layout
        (at, *_), (id_at, *_) = layout.columns["bus"], layout.columns["id"]
        names: set[str] = set()
        for line in lines(path, ReadState(self._state.size), LineCount()):
            cells = cells_of_row(decoded(line.text), layout.delimiter)
            if max(at, id_at) < len(cells) and len(names) < MAX_BUSES and ID.fullmatch(cells[id_at]):
                names.add(cells[at][:255])
        if self._program.named or not all(name.isdecimal() and len(name) < 6 for name in names):
            self._state.buses.update(bus_numbers(names))
        elif names:
            self._first_bus = min(1, *map(int, names))

    def take(self, text: str, line: Line) -> Row | str:
        """The frame of a line. Raises Bad."""
        layout, program, text = self._layout, self._program, decoded(text)
        cells = cells_of_row(text, layout.delimiter)
        if layout.bare and not self._below:
            self._below = bare_lists.is_row(text, layout.delimiter)
        if not self._below or (text == layout.header and not layout.bare):
            self._below = self._below or text == layout.header
            return "header lines"
        if text.startswith(("#", "//")):
            return "comments"
        if cells[:1] == [layout.first] != [""]:
            return "header lines"

        def cells_in(role: str) -> list[str]:
            return [cells[k] if k < len(cells) else "" for k in layout.columns.get(role, ())]

        (word, *_) = cells_in("id")
        if program.named and not word:
            return "lines of other networks"
        cells_of_marks = tuple([cells[k] if k < len(cells) else "" for k in self._marked])
        if cells_of_marks not in self._known and len(self._known) > _MAX_MARKS:
            self._known.clear()
        flags, wide = self._known.get(cells_of_marks) or self._known.setdefault(
            cells_of_marks, self._marks(cells_in)
        )
        if flags < 0:
            return "lines of other networks"
        match = ID.fullmatch(word)
        if match is None:
            raise Bad(f"{word[:32]!r} is no id")
        try:
            number = int(match[2], 16 if match[1] or match[3].lower() == "h" else layout.id_base)
        except ValueError:
            raise Bad(f"{word[:32]!r} is no id") from None
        wide = True if match[3] in ("x", "X") else wide
        if layout.by_width and len(match[2]) == 8:
            wide = True
        if layout.flagged and number & EXTENDED_BIT:
            number, wide = number ^ EXTENDED_BIT, True
        id_, width = (number & 0x1FFFFFFF, 0) if flags & Flag.ERROR else checked_id(number, extended=wide)
        flags |= int(width)
        bus = self._bus(cells_in("bus")[0]) if layout.columns.get("bus") else 0
        if program.panda and bus >= _PANDA_SENT:
            if bus >= _PANDA_REFUSED:
                return "frames that panda did not send"
            bus, flags = bus - _PANDA_SENT, flags | int(Flag.TX)
        announced = [_length(each) for each in cells_in("length")]
        at = (layout.date, layout.time) if layout.date >= 0 else (layout.time,)
        ns = self._ns(" ".join(cells[k] if k < len(cells) else "" for k in at))
        if layout.rest >= 0:
            rest = cells[layout.rest] if layout.rest < len(cells) else ""
            if not re.fullmatch(r"\d{1,9}", rest):
                raise Bad("its time is damaged")
            ns += int(rest) * layout.rest_ns
        if flags & Flag.REMOTE:
            return Row(ns, bus, id_, b"", flags, remote_length(min(announced, default=0)))
        data = self._data(cells, announced)
        if not line.whole and not announced:
            raise Bad("the file ends in it")
        flags |= int(Flag.FD) if len(data) > 8 else 0
        return Row(ns, bus, id_, data, flags)

    def _marks(self, cells_in: InRole) -> tuple[int, bool | None]:
        """The flags of a row but for its id's width, and that; -1: it is of no CAN bus."""
        program, wide = self._program, None
        flags = 0
        for word in map(str.lower, cells_in("extended")):
            if word not in (*NO, *YES, ""):
                word_flags, wide = _of_words(word, wide)
                flags |= word_flags
            else:
                wide = word in YES
        for flag, role in _ROLES:
            for word in map(str.lower, cells_in(role)):
                if word in YES or (role == "remote" and word in ("r", "remote")):
                    flags |= int(flag)
                elif word not in NO:
                    flags |= _of_words(word, None)[0]
        for word in map(str.lower, cells_in("way")):
            if word not in (*_SENT, *_RECEIVED, ""):
                raise Bad(f"{word[:32]!r} is no direction")
            flags |= int(Flag.TX) if word in _SENT else 0
        for word in cells_in("type"):
            if program.kvaser:
                bits = _kvaser_bits(word)
                flags |= sum(int(flag) for bit, flag in _KVASER if bits & bit)
                wide = {_EXT: True, _STD: False}.get(bits & (_EXT | _STD))
            elif self._layout.logger is not None:
                if word not in _LOGGER_TYPES:
                    raise Bad(f"{word[:32]!r} is no type")
                flags, wide = _LOGGER_TYPES[word]
            elif _OTHER_BUS.search(word.lower()):
                return -1, None
            else:
                word_flags, wide = _of_words(word.lower(), wide)
                flags |= word_flags | (int(Flag.TX) if word.lower() == "tx" else 0)
        return flags, wide

    def _ns(self, text: str) -> int:
        unit = self._layout.unit_ns
        if not unit:
            return self._clock.ns(text)
        if COUNTER.fullmatch(text):
            return int(text, 16) * unit
        if not NUMBER.fullmatch(text):
            raise Bad("its time is damaged")
        if "e" in text.lower():
            stamp = float(text.replace(",", "."))
            if abs(stamp) > _MAX_STAMP:
                raise Bad("its time is damaged")
            ns = timestamps.from_float(stamp) * unit // timestamps.NS_PER_S
        else:
            ns = timestamps.from_text(text.removeprefix("+")) * unit // timestamps.NS_PER_S
        self._stamped |= ns >= timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S
        return ns + self._start_ns

    def _bus(self, text: str) -> int:
        if self._program.named or self._state.buses:
            return bus_of(text, self._state.buses)
        if not re.fullmatch(r"\d{1,5}", text) or int(text) > 0xFFFE:
            raise Bad("its bus is damaged")
        return int(text) - self._first_bus

    def _data(self, cells: Sequence[str], announced: Sequence[int]) -> bytes:
        layout = self._layout
        if layout.octets:
            words = [cells[k] if k < len(cells) else "" for k in layout.octets]
            least = min(announced, default=-1)
            if least >= 0:
                least = DLC_BYTES[least] if least > 8 and any(words[least:]) and least < 16 else least
                if any(word.strip("0x-") for word in words[least:]):
                    raise Bad(f"it announces {least} data bytes and has more")
                words, announced = words[:least], [least]
            while words and not words[-1] and not announced:
                words.pop()
        else:
            (at, *_) = layout.columns["data"]
            if layout.bare:
                cells = [*cells[:at], *bare_lists.octets(cells[at:], min(announced, default=0))]
            words = octets_of(cells[at]) if at < len(cells) else []
            words += (
                [word for cell in cells[at + 1 :] for word in octets_of(cell)]
                if layout.tail or layout.bare
                else []
            )
        try:
            if layout.data_base == BASE64:
                data = of_base64("".join(cells[at : at + 1]))
            else:
                data = bytes(int(word, layout.data_base) for word in words)
        except ValueError:
            raise Bad("its data are not bytes") from None
        if layout.padded and announced and not any(data[min(announced) :]):
            data = data[: min(announced)]
        n = len(data)
        for length in announced:
            if (
                length != n
                and not (length < 16 and DLC_BYTES[length] == n)
                and not (8 < length < 16 and n == 8)
            ):
                raise Bad(f"it announces {length} data bytes and has {n}")
        if n > 64:
            raise Bad("more than 64 data bytes")
        return data


def _length(text: str) -> int:
    if not re.fullmatch(r"\d{1,5}|0x[0-9a-f]{1,4}|[a-f]", text, re.IGNORECASE):
        raise Bad("its length is damaged")
    return int(text, 10 if text.isdecimal() else 16)


def _of_words(word: str, wide: bool | None) -> tuple[int, bool | None]:
    """What a type in words says."""
    flags = sum(int(flag) for flag, pattern in _MARKS if pattern.search(word))
    return flags, next((yes for mark, yes in _WIDTHS.items() if mark in word), wide)


def _kvaser_bits(word: str) -> int:
    if not re.fullmatch(r"(0x)?[0-9A-Fa-f]{1,8}", word):
        raise Bad("its flags are damaged")
    bits = int(word, 16) if word.lower().startswith("0x") or not word.isdecimal() else int(word)
    if bits & _STD and bits & _EXT:
        raise Bad("its id has 11 and 29 bits")
    return bits


def _started(line: str, zone: datetime.tzinfo | None) -> int | None:
    match = _STARTED.fullmatch(line)
    if match is None:
        return None
    try:
        at = datetime.datetime(*map(int, match.groups()))  # type: ignore[arg-type]  # six of them
    except ValueError:
        return None
    return epoch_ns(at, zone)
