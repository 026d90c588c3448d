"""The header of a list of CAN frames: which column is which, the base of its numbers, and when it begins."""

from __future__ import annotations

import datetime
import re
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from canid.io.logs.content import cells_of, refuse
from canid.io.logs.formats import UNKNOWN_LIST
from canid.io.logs.local_time import epoch_ns
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import LineCount, lines
from canid.values.bus_names import MAX_BUSES

if TYPE_CHECKING:
    from canid.io.logs.others.frame_list import Program

_STARTED = re.compile(
    r".*Logging started at:?\s*(\d{4})-(\d\d)-(\d\d)[ T](\d\d):(\d\d):(\d\d).*", re.IGNORECASE
)
# other names of columns
_ALIASES = {
    "time": ("timestamp", "time(s)", "time[s]"),
    "dlc": ("len", "length"),
    "addr": ("address",),
    "id": ("canid",),
}
# periods from which on times count in ms: no id of a car comes every 3 ms, and a bus has one that comes every 3 s
_SLOW = 3.0


class Head(NamedTuple):
    """What the header of a list says."""

    columns: dict[str, int]
    delimiter: str
    first: str  # the first cell of the header
    base: int  # of ids
    data_base: int
    data_at: int | None  # the column with all bytes; None: one each
    octets: tuple[int, ...]  # the columns of one byte each
    in_seconds: bool  # times, or in ms; False: in µs
    in_ms: bool  # as the frames show
    start_ns: int | None  # epoch ns that times count from; None: not stated
    remarks: list[str]


def judged(path: Path, program: Program, begin: list[str], zone: datetime.tzinfo | None) -> Head:
    """Read it.

    Raises:
        ConfigError: the numbers may be read in two ways, or a column that is needed is not there.
    """
    at, names = next(
        ((k, cells) for k, line in enumerate(begin) if set(program.header) <= {*(cells := cells_of(line))}),
        (0, []),
    )
    header = begin[at] if begin else ""
    delimiter = max(",;\t", key=header.count)
    columns = {name: k for k, name in reversed(list(enumerate(names)))}
    for name, aliases in _ALIASES.items():
        if name != "time" or program.time == "time":
            columns.setdefault(name, next((columns[alias] for alias in aliases if alias in columns), -1))
    if any(columns.get(name, -1) < 0 for name in (program.time, program.id, *[program.bus] * program.named)):
        raise refuse(path, UNKNOWN_LIST)
    data_name = program.data[0]
    data_at = columns.get(data_name)
    octets = tuple(k for k, name in enumerate(names) if re.fullmatch(rf"{data_name}\d{{1,2}}", name))
    rows = [line.split(delimiter) for line in begin[at + 1 :]]
    base, data_base, remarks = program.base, 16, []

    def column(name: str) -> list[str]:
        return [row[columns[name]].strip(' "') for row in rows if 0 <= columns[name] < len(row)]

    ids = column(program.id)
    if base == 10 and _base([word for word in ids if not word.lower().startswith("0x")]) == 16:
        # one that has a letter, or is padded, shows it for all
        base = 16
        remarks.append("ids without 0x are read as hexadecimal numbers")
    in_ms = program.unstated and not set("([") & set(header) and _fastest(column(program.time), ids) >= _SLOW
    if in_ms:
        remarks.append(
            "times are read as ms: in s no id would come more often than every 3 s; write Time (s) where it is so"
        )
    in_seconds = not program.micro or any(re.search(r"\d[.,]\d", word) for word in column(program.time))
    if not base:
        base = _base(ids)
        data = [row[k].strip(' "') for row in rows for k in octets if k < len(row)]
        data_base = _base(data) if octets else 16
        if octets:
            words = {10: "decimal", 16: "hexadecimal"}
            remarks.append(f"ids are read as {words[base]}, data as {words[data_base]} numbers")
        elif not all(word.lower().startswith("0x") for word in ids if word):
            raise refuse(path, UNKNOWN_LIST)
    starts = [local for line in begin[:at] if (local := _started(line, zone)) is not None]
    return Head(
        columns, delimiter, names[0] if names else "", base, data_base, data_at, octets, in_seconds, in_ms,
        starts[0] if starts else None, remarks,
    )  # fmt: skip


def names(path: Path, size: int, at: int, time_at: int) -> set[str]:
    """The names in a column of all lines with a time."""
    seen: set[str] = set()
    for line in lines(path, ReadState(size), LineCount()):
        cells = line.text.split(",")
        if max(at, time_at) < len(cells) and len(seen) < MAX_BUSES and re.match(r"\s*-?\d", cells[time_at]):
            seen.add(cells[at].strip(' "')[:255])
    return seen


def _fastest(times: list[str], ids: list[str]) -> float:
    """The median period of the id that comes most often, in the unit of the times; 0: none comes three times.

    >>> _fastest(["0", "1", "10", "21", "20"], ["A", "B", "A", "B", "A"])
    10.0
    """
    by_id: dict[str, list[float]] = {}
    for text, id_ in zip(times, ids, strict=False):
        if re.fullmatch(r"\d{1,20}([.,]\d{1,20})?", text):
            by_id.setdefault(id_, []).append(float(text.replace(",", ".")))
    steps = [sorted(b - a for a, b in pairwise(t)) for t in by_id.values() if len(t) > 2]
    return min((each[len(each) // 2] for each in steps), default=0.0)


def _base(words: list[str]) -> int:
    """A hexadecimal byte is padded to two digits, a decimal one never."""
    shown = [word.lower() for word in words if word]
    return 16 if any(not word.isdecimal() or (word[0] == "0" and len(word) > 1) for word in shown) else 10


def _started(line: str, zone: datetime.tzinfo | None) -> int | None:
    match = _STARTED.fullmatch(line)
    if match is None:
        return None
    try:
        at = datetime.datetime(*map(int, match.groups()))  # type: ignore[arg-type]  # six of them
    except ValueError:
        return None
    return epoch_ns(at, zone)
