"""The layout of a list of CAN frames of any program, as its header and its first rows show it.

The names of the columns say which is which. The base of ids and bytes and the unit of times are those that the header
states, else those that the rows prove; a list that may be read in two ways is refused with what was found.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import csv
import datetime
import re
from collections.abc import Sequence
from itertools import chain, pairwise
from pathlib import Path
from typing import NamedTuple

from canid.io.logs.formats import UNKNOWN_LIST
from canid.io.logs.list_columns import base_of, byte_of, decoded, rest_of, role_of, unit_of
from canid.io.logs.others import bare_lists
from canid.io.logs.others.list_clock import LoggerClock, is_clock, month_is_first
from canid.values.errors import ConfigError
from canid.values.frame_columns import MAX_EXTENDED_ID, MAX_STANDARD_ID
from canid.values.timestamps import EPOCH_FLOOR_S

# the base of bytes as python-can writes them
BASE64 = 64
COUNTER = re.compile(r"0x[0-9a-f]{1,16}", re.IGNORECASE)
NUMBER = re.compile(r"[+-]?\d{1,20}([.,]\d{1,20})?(e[+-]?\d{1,3})?", re.IGNORECASE)
ID = re.compile(r"(0x)?([0-9a-f]{1,10})([hx]?)", re.IGNORECASE)
# of an id of 29 bits in Linux's struct can_frame
EXTENDED_BIT = 0x8000_0000
NO, YES = (
    ["0", "false", "f", "no", "n", "s", "std", "standard", "11", "11bit", "标准帧", "标准"],
    ["1", "true", "t", "yes", "y", "x", "e", "ext", "extended", "xtd", "29", "29bit", "扩展帧", "扩展"],
)
# periods of the id that comes most often, in the unit of its times: an id of a car comes every ms at most, and a bus has
# one that comes every 3 s; the unit is sure where no other fits
_PERIODS = ((3.0, 1_000_000_000), (1e3, 1_000_000), (3e3, 0), (1e6, 1_000), (3e6, 0))
_UNITS = {1_000_000_000: "s", 1_000_000: "ms", 1_000: "µs", 1: "ns", 100_000: "0.1 ms"}
_WORDS = {10: "decimal", 16: "hexadecimal", BASE64: "base64"}
# where a clock stands next to a counter: how near their ratio has to be to a unit, and the ns of the clock that it takes
_SAME, _CLOCK_NS = 0.02, 500_000_000
# share of the first times that may be earlier than the one before: times since the frame before are half of them
_MAX_BACK = 0.25
# frames that have one time, on average, from which on it is said that times are whole seconds
_MAX_IN_A_SECOND = 4
# different cells of a column that may say of which bus, direction or kind a frame is
_MAX_STATES = 16
# columns of a clock's numbers; what stands behind them begins anew with each second
_OF_CLOCK = ("hour", "hours", "minute", "minutes", "min", "second", "seconds", "sec")
_LITERAL = re.compile(r"""(?:bytearray\()?(b(['"]).{0,512}\2)\)?""")
_LOGGER_HEAD = re.compile(r"#\s*(Logger type|Time format)\s*:", re.IGNORECASE)


class Program(NamedTuple):
    """What is known of the lists of a program; nothing of those of any other."""

    header: tuple[str, ...] = ()  # cells of its header
    id_base: int = 0  # 16; 10: unless the first rows show another; -1: as they show, 10 where they do not; 0: as they prove
    data_base: int = 0
    unit_ns: int = 0  # of times that are whole numbers; those with a decimal sign are s; 0: as the rows show
    panda: bool = False  # bus numbers as panda has them
    named: bool = False  # buses have names
    kvaser: bool = False  # flags of canlib


ANY = Program()


class Layout(NamedTuple):
    """How the rows of a list are read."""

    header: str  # its line; "": it has none
    first: str  # its first cell
    delimiter: str
    columns: dict[str, tuple[int, ...]]  # role -> columns
    time: int  # the column of the times
    date: int  # that of their dates; -1: none
    rest: int  # that of the rest of their whole seconds; -1: none
    rest_ns: int  # the unit of the rest
    octets: tuple[int, ...]  # the columns of one byte each; none: all are in that of the data
    tail: bool  # the bytes go on in the cells behind the last column
    bare: bool  # it has no header, and as many bytes as it announces; what follows them is not read
    id_base: int
    data_base: int
    unit_ns: int  # of times; 0: a clock
    by_width: bool  # an id of eight digits has 29 bits, one of three has 11
    flagged: bool  # an id of 29 bits has `EXTENDED_BIT` as well
    month_first: bool  # in dates such as 8/5/2026
    padded: bool  # zeros stand behind the bytes, up to eight
    logger: LoggerClock | None  # the clock of a CSS CL1000, CL2000, CL3000
    remarks: tuple[str, ...]


def cells_of_row(text: str, delimiter: str) -> list[str]:
    """The cells of a row that is decoded, without quotation marks and blanks, and `="..."` of spreadsheets.

    >>> cells_of_row('1;"01;02" ;="12:04:59"', ";")
    ['1', '01;02', '12:04:59']
    """
    cells = text.split(delimiter)
    if '"' in text:
        with contextlib.suppress(csv.Error):
            cells = next(csv.reader([text], delimiter=delimiter), [])
    return [cell.strip(' "=') for cell in cells]


def judged(path: Path, lines: Sequence[str], zone: datetime.tzinfo | None, program: Program = ANY) -> Layout:
    """Read it off the first lines of a file. Raises ConfigError: it may be read in two ways, or a column is missing."""

    def refused(why: str) -> ConfigError:
        return ConfigError(f"{path}: {UNKNOWN_LIST.says}: {why}; {UNKNOWN_LIST.remedy}")

    at, delimiter, names = _header(lines)
    bare = bare_lists.form_of(lines) if at < 0 else None
    if bare is not None:
        delimiter, names = bare.delimiter, [*bare.names]
    elif at < 0:
        raise refused(
            "no line names the columns; write one above the frames, as Time (s),ID (hex),DLC,Data (hex)"
        )
    roles: dict[str, tuple[int, ...]] = {}
    octets = {n: k for k, name in enumerate(names) if (n := byte_of(name)) is not None}
    for k, name in enumerate(names):
        if k not in octets.values() and (role := role_of(name)):
            roles[role] = (*roles.get(role, ()), k)
    if "time" not in roles and "rest" in roles:
        roles["time"] = roles.pop("rest")
        if parts := [name for name in names if name.strip().lower() in _OF_CLOCK]:
            of_clock = f"{parts[0]!r} to {names[roles['time'][0]]!r}"
            raise refused(f"its times are in several columns, {of_clock}: write them as one, Time (s)")
    if "time" not in roles and "date" in roles:
        roles["time"] = roles.pop("date")
    of_rows = [cells_of_row(decoded(line), delimiter) for line in lines[at + 1 :]]
    used = [k for k in roles["id"] if any(len(row) > k and ID.fullmatch(row[k]) for row in of_rows)]
    (id_at, *more) = roles["id"] = tuple(used or roles["id"])
    if more:
        raise refused(f"{names[id_at]!r} and {names[more[0]]!r} may be its ids: leave one of them out")
    rows = [row for row in of_rows if len(row) > id_at and ID.fullmatch(row[id_at])]
    if not rows:
        raise refused("no id stands below its header")
    logger = (
        LoggerClock(lines[:at], zone)
        if "type" in roles and any(map(_LOGGER_HEAD.match, lines[:at]))
        else None
    )
    cell = _Cells(rows)
    ids = cell.column(id_at)
    extended = [cell.column(k) for k in roles.get("extended", ())]
    base = base_of(names[id_at]) or _known(16 if logger else program.id_base, ids) or _id_base(ids, extended)
    if not base:
        raise refused(
            f"its ids, such as {ids[0]}, may be hexadecimal or decimal: write {names[id_at]} (hex) or {names[id_at]} (dec) "
            "in its header"
        )
    data_at = next((k for k in roles.get("data", ()) if _octets(cell.column(k)) is not None), -1)
    named_bytes = len(octets) > 1 or (octets and program.header)
    each = tuple(octets[n] for n in sorted(octets)) if named_bytes and min(octets) < 2 else ()
    lengths = [cell.column(k) for k in roles.get("length", ())]
    packed = [k for k in roles.get("data", ()) if lengths and _is_base64(cell.column(k), lengths[0])]
    if data_at < 0 and not each and not packed:
        raise refused("no column of it has bytes of data")
    data_at = packed[0] if packed else data_at
    tail = data_at == len(names) - 1 and any(len(row) > len(names) and row[len(names)] for row in rows)
    words = (
        [word for k in each for word in cell.column(k)]
        if data_at < 0
        else _octets(cell.column(data_at)) or []
    )
    words += [word for row in rows for word in row[len(names) :]] if tail else []
    if bare is not None:
        at_length = len(names) - 2
        announced = [row for row in rows if len(row) > at_length and row[at_length].isdecimal()]
        words = [w for row in announced for w in bare_lists.octets(row[at_length + 1 :], int(row[at_length]))]
    words = [word for word in words if word]
    named = names[data_at if data_at >= 0 else each[0]]
    data_base = (
        BASE64
        if packed
        else base_of(named) or _known(16 if logger else program.data_base, words) or _data_base(words)
    )
    if not data_base:
        raise refused("its bytes may be hexadecimal or decimal: write Data (hex) or Data (dec) in its header")
    for k in () if logger or program.kvaser else roles.get("type", ()):
        if any(word.isdecimal() and int(word) for word in cell.column(k)):
            raise refused(f"what the numbers in its column {names[k]!r} mean is not known: leave it out")
    time_at, unit, why = (*roles.get("time", (-1,))[:1], program.unit_ns, logger.refused if logger else "")
    if logger is None and not program.header:
        time_at, unit, why = _times(cell, names, roles.get("time", ()), id_at, "rest" in roles)
    elif any(re.search(r"\d[.,]\d", word) for word in cell.column(time_at)):
        unit = 0 if logger else 10**9
    if why or time_at < 0:
        raise refused(why or "no column of it is named as one of times; write Time (s)")
    date_at = _of_day(cell, roles.get("date", ()), time_at)
    stamps = cell.column(time_at)
    if date_at >= 0:
        stamps = [
            f"{day} {time}" for day, time in zip(cell.column(date_at), cell.column(time_at), strict=True)
        ]
    month_first = month_is_first(stamps) if not unit else False
    if month_first is None:
        raise refused(
            f"day or month may be first in its times, such as {stamps[0]!r}: write them as 2026-08-05"
        )
    says = []
    if bare is not None:
        behind = f"; what stands behind the data, as {bare.behind!r}, is not read" if bare.behind else ""
        says.append(f"it has no header: its columns are read as {', '.join(names)}{behind}")
    if program.id_base == 10 and base == 16:
        says.append("ids without 0x are read as hexadecimal numbers")
    elif program.id_base < 0 or not (
        program.id_base or base_of(names[id_at]) or all(word[:2] in ("0x", "0X") for word in ids)
    ):
        says.append(f"ids are read as {_WORDS[base]}, data as {_WORDS[data_base]} numbers")
    if unit and not program.header and not unit_of(names[time_at]) and unit != 10**9:
        says.append(
            f"times are read as {_UNITS[unit]}; write Time (s), (ms) or (us) in its header where it is not so"
        )
    widths = {len(octets_of(text)) for text in cell.column(data_at)} if data_at >= 0 else set[int]()
    # as arrays of a fixed size in messages of ROS
    padded = bare is None and not tail and widths == {8} and len({*chain(*lengths)}) > 1
    by_width = not extended and base == 16 and {len(word) for word in ids if word.isalnum()} == {3, 8}
    numbers = list[int]()
    with contextlib.suppress(ValueError):
        numbers = [int(m[2], 16 if m[1] else base) for word in ids if (m := ID.fullmatch(word))]
    wide = [n for n in numbers if n > MAX_STANDARD_ID]
    flagged = bool(wide) and all(n & EXTENDED_BIT for n in wide)
    known = {k for places in roles.values() for k in places} | {*octets.values()}
    unread = [k for k in range(len(names)) if k not in known and 1 < len({*cell.column(k)}) <= _MAX_STATES]
    if unread and bare is None and not program.header:
        says.append(f"its columns {', '.join(repr(names[k]) for k in unread)} are not read")
    whole = unit == 10**9 and all(map(str.isdecimal, cell.column(time_at)))
    rest, rest_ns = -1, 0
    for k in roles.get("rest", ()) if whole else ():
        parts, size = cell.column(k), 10**9 // rest_of(names[k])
        if rest < 0 and all(word.isdecimal() and int(word) < size for word in parts) and len({*parts}) > 1:
            rest, rest_ns = k, rest_of(names[k])
    if whole and rest < 0 and len({*cell.column(time_at)}) < len(rows) / _MAX_IN_A_SECOND:
        says.append("times are whole seconds: frames within one have the same time")
    header = "" if bare else decoded(lines[at]).strip().rpartition("\n")[2]
    return Layout(
        header, "" if bare else names[0], delimiter, roles | {"data": (data_at,)}, time_at,
        date_at, rest, rest_ns, each if data_at < 0 else (), tail,
        bare is not None, base, data_base, unit, by_width, flagged, bool(month_first), padded, logger, tuple(says),
    )  # fmt: skip


def _known(base: int, words: list[str]) -> int:
    """The base that a program writes, see `Program`; 0: none is known."""
    bare = [word for word in words if word and not word.lower().startswith("0x")]
    padded = (base < 0 and words and not bare) or any(
        not word.isdecimal() or (word[0] == "0" and len(word) > 1) for word in bare
    )
    return base if base in (0, 16) else 16 if padded else 10


class _Cells:
    """The first rows."""

    def __init__(self, rows: Sequence[Sequence[str]]) -> None:
        self.rows = rows

    def column(self, k: int) -> list[str]:
        """The cells of a column; "" where a row has none."""
        return [row[k] if 0 <= k < len(row) else "" for row in self.rows]


def _header(lines: Sequence[str]) -> tuple[int, str, list[str]]:
    """The first line that names ids and data: which, what separates its cells, and these; -1: none does."""
    for k, line in enumerate(lines):
        text = decoded(line).strip().lstrip("#% ")
        delimiter = max(",;\t|", key=text.count)
        names = [name.strip(" \"'") for name in text.split(delimiter)]
        roles = {role_of(name) for name in names} | {"data" for name in names if byte_of(name) is not None}
        if {"id", "data"} <= roles:
            return k, delimiter, names
    return -1, "", []


def _id_base(words: list[str], extended: list[list[str]]) -> int:
    """The base of ids, where their digits prove it; 0: they do not.

    >>> _id_base(["7DF", "100"], []), _id_base(["067", "100"], []), _id_base(["100"], []), _id_base(["1000"], [["0"]])
    (16, 16, 0, 10)
    """
    bare = [word for word in words if word and not word.lower().startswith("0x")]
    if not bare or any(not word.isdecimal() or (word[0] == "0" and len(word) in (3, 4, 8)) for word in bare):
        return 16
    short = [
        word
        for column in extended
        for word, is_ in zip(words, column, strict=True)
        if is_.lower() in NO and word in bare
    ]
    fits = [
        base
        for base in (10, 16)
        if all(int(word, base) <= MAX_EXTENDED_ID for word in bare)
        and all(int(word, base) <= MAX_STANDARD_ID for word in short)
    ]
    return fits[0] if len(fits) == 1 else 0


def proven_base(words: list[str], *, ids: bool) -> int:
    """The base of ids or of bytes, where they prove it; 0: they do not.

    >>> proven_base(["0000014B"], ids=True), proven_base(["123"], ids=True), proven_base(["0", "200"], ids=False)
    (16, 0, 10)
    """
    return _id_base(words, []) if ids else _data_base(words)


def octets_of(cell: str) -> list[str]:
    r"""The bytes of a cell as they are written; pairs of digits where nothing separates them.

    >>> octets_of("x| 05 C3"), octets_of("0x05c3"), octets_of("[1 20 255]"), octets_of("0x05-0xC3"), octets_of("")
    (['05', 'C3'], ['05', 'c3'], ['1', '20', '255'], ['05', 'C3'], [])
    >>> octets_of(r"bytearray(b'\x05A')")  # as Python prints bytes
    ['05', '41']
    """
    text = cell.strip()
    # its last quotation mark may be taken for the cell's
    if literal := _LITERAL.fullmatch(text.rstrip('"') + '"' if text.startswith('b"') else text):
        with contextlib.suppress(ValueError, SyntaxError):
            return [f"{octet:02x}" for octet in ast.literal_eval(literal[1])]
    words = re.split(r"[\s,;_:|-]+", re.sub(r"^x\|", "", cell.strip()).strip(" []()'\""))
    words = [bare for word in words if (bare := word.removeprefix("0x").removeprefix("0X"))]
    if len(words) == 1 and len(words[0]) > 3 and len(words[0]) % 2 == 0:
        return [words[0][k : k + 2] for k in range(0, len(words[0]), 2)]
    return words


def _octets(cells: list[str]) -> list[str] | None:
    """The bytes of a column; None where most of its cells have other words."""
    each = [octets_of(cell) for cell in cells]
    good = [words for words in each if all(re.fullmatch(r"[0-9a-fA-F]{1,3}", word) for word in words)]
    return [word for words in good for word in words] if 2 * len(good) > len(each) else None


def of_base64(cell: str) -> bytes:
    r"""The bytes of a cell in base64, whose = may have been taken for a spreadsheet's. Raises ValueError.

    >>> of_base64("AQID/w")
    b'\x01\x02\x03\xff'
    """
    return base64.b64decode(cell + "=" * (-len(cell) % 4), validate=True)


def _is_base64(cells: list[str], lengths: list[str]) -> bool:
    """Whether most cells are the announced bytes in base64, and not in hexadecimal digits."""
    good = 0
    for cell, length in zip(cells, lengths, strict=True):
        with contextlib.suppress(ValueError):
            good += str(len(of_base64(cell))) == length and len(cell) != 2 * int(length)
    return 2 * good > len(cells)


def _data_base(words: list[str]) -> int:
    """The base of bytes, where they prove it: hexadecimal ones have letters or are padded, decimal ones are above 99."""
    if words and all(word[:2] in ("0x", "0X") for word in words):
        return 16
    is_hex = any(not word.isdecimal() for word in words) or (
        any(w[0] == "0" for w in words) and {*map(len, words)} == {2}
    )
    is_decimal = any(len(word) == 3 for word in words)
    if is_hex or is_decimal:
        return 0 if is_hex and is_decimal else 16 if is_hex else 10
    return 16 if {*map(len, words)} <= {2} else 0


def _times(
    cells: _Cells, names: Sequence[str], candidates: Sequence[int], id_at: int, rest: bool
) -> tuple[int, int, str]:
    """The column of times, the ns of its unit (0: a clock), and why there is none. `rest`: seconds may be whole ones."""
    clocks = [k for k in candidates if all(map(is_clock, cells.column(k)))]
    why = ""
    for k in candidates:
        words = cells.column(k)
        counter = all(map(COUNTER.fullmatch, words))
        if k in clocks or not (counter or all(map(NUMBER.fullmatch, words))):
            continue
        values = [float(int(w, 16)) if counter else float(w.replace(",", ".")) for w in words]
        back = sum(b < a for a, b in pairwise(values))
        if back > _MAX_BACK * len(values) or (len(values) > 9 and min(values) == max(values) and not rest):
            why = f"the times in its column {names[k]!r} do not go on"
            continue
        decimal = any(re.search(r"\d[.,]\d", word) for word in words)
        unit = unit_of(names[k]) or (
            0 if counter or (not decimal and clocks) else _unit(values, cells.column(id_at), decimal)
        )
        if not unit and clocks:
            unit = _unit_by_clock(values, cells.column(clocks[0]))
        if unit:
            return k, unit, ""
        why = (
            why
            or f"the unit of the times in its column {names[k]!r} is not known: write Time (s), (ms) or (us)"
        )
    if clocks:
        return clocks[0], 0, ""
    return (
        -1,
        0,
        why
        or (f"its times, such as {cells.column(candidates[0])[0]!r}, are not known" if candidates else ""),
    )


def _of_day(cells: _Cells, candidates: Sequence[int], time_at: int) -> int:
    """The column of the dates of times of day; -1: none is known."""
    times = cells.column(time_at)
    return next(
        (
            k
            for k in candidates
            if all(is_clock(f"{day} {time}") for day, time in zip(cells.column(k), times, strict=True))
        ),
        -1,
    )


def _unit(values: list[float], ids: list[str], decimal: bool) -> int:
    """The ns of the unit of times, by their size where they count from 1970, else by how often an id comes; 0: not sure."""
    size = sorted(values)[len(values) // 2]
    if size >= EPOCH_FLOOR_S:
        return next((unit for most, unit in ((1e11, 10**9), (1e14, 10**6), (1e17, 10**3)) if size < most), 1)
    by_id: dict[str, list[float]] = {}
    for value, id_ in zip(values, ids, strict=True):
        by_id.setdefault(id_, []).append(value)
    steps = [sorted(b - a for a, b in pairwise(t)) for t in by_id.values() if len(t) > 2]
    period = min((each[len(each) // 2] for each in steps), default=0.0)
    if period < _PERIODS[0][0] and not decimal:
        return 0
    return next((unit for most, unit in _PERIODS if period < most), 1)


def _unit_by_clock(values: list[float], clock: list[str]) -> int:
    """The ns of the unit of a counter, by the clock next to it; 0: no unit fits."""
    seconds = [_seconds(text) for text in (clock[0], clock[-1])]
    spanned, counted = (seconds[1] - seconds[0]) % 86_400 * 1e9, values[-1] - values[0]
    if spanned < _CLOCK_NS or counted <= 0:
        return 0
    return next((unit for unit in _UNITS if abs(counted * unit / spanned - 1) < _SAME), 0)


def _seconds(text: str) -> float:
    """The time of day of a clock."""
    hour, minute, second = re.findall(
        r"\d+(?:\.\d+)?", re.sub(r"^.*[ T_](?=\d+:)", "", text).replace(",", ".")
    )[:3]
    return (int(hour) * 60 + int(minute)) * 60 + float(second)
