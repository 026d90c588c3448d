"""Layout of delimited text: encoding, delimiter, decimal sign, and the line of the header, judged from the first lines."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from canid.analysis.tables import time_column
from canid.analysis.tables.headings import TIME, heading, role_of
from canid.analysis.tables.source import MAX_COLUMNS
from canid.analysis.tables.sources.cell_units import number_and_unit
from canid.analysis.tables.sources.grouped_numbers import by_points
from canid.analysis.tables.times.dates import is_date
from canid.signals.vehicle.units import unit_of
from canid.values.errors import LogError

DELIMITERS = (",", ";", "\t", "|")
# a header stands among so many first lines; OpenACC has five lines of description before it
MAX_PREAMBLE_LINES = 60
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(e[+-]?\d+)?", re.IGNORECASE)
_DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d+(e[+-]?\d+)?", re.IGNORECASE)
# may be a number of thousands; 0,100 and 12,5 cannot
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
# a heading of RaceCapture: "Speed"|"MPH"|0.0|150.0|10: name, unit, least and largest value, rate
_RACECAPTURE = re.compile(r'"?(?P<name>[^"|]+)"?\|"?(?P<unit>[^"|]*)"?(\|-?[\d.]+){3}')
# lines of text between the names and the first row: RaceChrono has units and sources, and names may be repeated
MAX_TEXT_LINES = 3
_OF_UNITS = re.compile(r"\W{0,4}(\w{1,20}[ _])?units?(?![a-z])", re.IGNORECASE)
# besides UTF-8; of several that fit equally well the first
_ENCODINGS = ("cp1252", "shift_jis", "gb18030", "euc_kr", "cp1251", "cp1250", "cp1253", "cp1254")


class Layout(NamedTuple):
    """How the text is divided."""

    headings: tuple[str, ...]  # with the units of a line of units, in brackets
    delimiter: str  # "": white space
    decimal_comma: bool
    skip: int  # lines before the first row
    header: int  # the first of them that is of the header, from 0
    encoding: str


class _Header(NamedTuple):
    """A line of names and what belongs to it."""

    score: tuple[int, int, int, int]  # of several candidates the largest is it
    names: list[str]
    lines: list[int]  # of text below the names
    first: int  # the line of the first row


def encoding_of(lines: Sequence[bytes]) -> str:
    """The encoding of a file whose first lines these are: UTF-8, or the one in which most headings are known."""
    try:
        b"\n".join(lines).decode("utf-8")
    except UnicodeDecodeError:
        in_it = [line for line in lines if not line.isascii()]
        return max(_ENCODINGS, key=lambda each: sum(_names_in(line, each) for line in in_it))
    return "utf-8-sig" if lines[0].startswith(b"\xef\xbb\xbf") else "utf-8"


def _names_in(line: bytes, encoding: str) -> int:
    """How many headings with a role a line has."""
    try:
        text = line.decode(encoding)
    except UnicodeDecodeError:
        return 0
    return max(sum(role_of(heading(cell)) is not None for cell in text.split(mark)) for mark in DELIMITERS)


def split(line: str, delimiter: str) -> list[str]:
    """The cells of one line.

    Example:
        >>> split('a,"b,c"', ","), split('"1"  2', "")
        (['a', 'b,c'], ['1', '2'])
    """
    if not delimiter:
        return [cell.strip('"') for cell in line.split()]
    try:
        return [
            cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
        ]
    except csv.Error:
        return line.split(delimiter)


def layout(lines: Sequence[str], encoding: str, name: str, names: Sequence[str] = ()) -> Layout:
    """Judge the layout.

    Args:
        lines: the first ones, without their ends.
        encoding: of the file.
        name: for messages.
        names: of the columns, for a table without a header.

    Raises:
        LogError: it is no table with named columns.

    Example:
        >>> layout(["time;gap [m]", "0,0;12,5", "0,1;12,6"], "utf-8", "x.csv")[:4]
        (('time', 'gap [m]'), ';', True, 1)
    """
    lines = [line.removeprefix("\ufeff") for line in lines]
    best: tuple[_Header, int, str] | None = None
    delimiters = DELIMITERS if any(d in line for line in lines for d in DELIMITERS) else ("",)
    for delimiter in delimiters:
        rows = [split(line, delimiter) for line in lines]
        for k in range(min(len(rows), MAX_PREAMBLE_LINES)):
            candidate = _header(rows, k)
            if candidate is not None and (best is None or candidate.score > best[0].score):
                best = candidate, k, delimiter
    numeric = next((k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")), None)
    if names and numeric is not None and best is None:
        candidates = [(len(split(lines[numeric], d)), d) for d in (*DELIMITERS, "")]
        cells, delimiter = max(candidates, key=lambda candidate: candidate[0])
        if cells < len(names):
            raise LogError(f"{name}: its rows have {cells} cells; the mapping names {len(names)} columns")
        return _layout(tuple(names), delimiter, lines[numeric:], numeric, numeric, encoding)
    if best is None:
        raise LogError(f"{name}: {_missing(lines)}")
    header, k, delimiter = best
    if lines[k].startswith(("#", "%")):
        header = header._replace(
            names=[_plain(cell) for cell in split(lines[k].lstrip("#%").lstrip(), delimiter)]
        )
    if len(header.names) > MAX_COLUMNS:
        raise LogError(f"{name}: has {len(header.names):,} columns; at most {MAX_COLUMNS:,} are read")
    # units stand above the names in some exports, LabVIEW writes them some lines above
    over = [split(line, delimiter) for line in lines[max(k - 1, 0) : k]]
    above = [cells for cells in over if len(cells) == len(header.names) and _units(cells) and any(cells)]
    above += [split(line, delimiter) for line in lines[:k] if _OF_UNITS.match(line)][-1:]
    texts = [split(lines[j], delimiter) for j in header.lines]
    texts += [cells[len(cells) > len(header.names) :] for cells in above]  # without a label of its own
    return _layout(
        _headings(header.names, texts), delimiter, lines[header.first :], header.first, k, encoding
    )


def _plain(cell: str) -> str:
    """A heading as others are written.

    >>> _plain('"Speed"|"MPH"|0.0|150.0|10'), _plain("gap [m]")
    ('Speed [MPH]', 'gap [m]')
    """
    match = _RACECAPTURE.fullmatch(cell)
    if match is None:
        return cell
    return f"{match['name']} [{match['unit']}]" if match["unit"] else match["name"]


def _header(rows: list[list[str]], k: int) -> _Header | None:
    """Line k as a header, scored: a time, names that are known, filled cells, the earlier line; None: it is none."""
    names = [_plain(cell) for cell in rows[k]]
    filled = [cell for cell in names if cell]
    if len(filled) < 2 or len({*filled}) < len(filled) / 2:
        return None
    if sum(_is_number(cell) for cell in filled) > 0.2 * len(filled):
        return None
    time = next((j for j, cell in enumerate(names[:MAX_COLUMNS]) if role_of(heading(cell)) == TIME), -1)
    first, texts = k + 1, list[int]()
    while first < len(rows) and len(texts) <= MAX_TEXT_LINES:
        if any(rows[first]):
            if _is_row(rows[first], time):
                break
            texts.append(first)
        first += 1
    if first >= len(rows) or len(rows[first]) < 2 or not any(map(_is_number, rows[first])):
        return None
    # a last delimiter without a cell is no cell
    if abs(len(rows[first]) - len(names)) > 1:
        return None
    if _row_names(rows[first:], len(names)):
        names = ["", *names]
    known = sum(role_of(heading(cell)) is not None for cell in filled[:MAX_COLUMNS])
    return _Header((int(time >= 0), known, len(filled), -k), names, texts, first)


def _row_names(rows: list[list[str]], width: int) -> bool:
    """Whether rows have a first cell without a heading that counts them, as R writes tables.

    >>> _row_names([["1", "0.0"], ["2", "0.1"]], 1), _row_names([["0.0", "a"], ["0.1", "b"]], 1)
    (True, False)
    """
    cells = [row[0] for row in rows if len(row) == width + 1 and row[-1]]
    numbers = [int(cell) for cell in cells if cell.isdecimal()]
    return 1 < len(cells) == len(numbers) and all(b - a == 1 for a, b in pairwise(numbers))


def _is_row(cells: list[str], time: int) -> bool:
    """Whether a line is a row: it holds a number, or a time where the time is."""
    stamp = cells[time] if 0 <= time < len(cells) else ""
    return any(map(_is_number, cells)) or stamp[:1].isdigit() or is_date(stamp)


def _headings(names: list[str], texts: list[list[str]]) -> tuple[str, ...]:
    """The names with the units of a line of units; equal names with what another line says of them.

    >>> _headings(["time", "speed", "speed"], [["s", "m/s", "m/s"], ["", "100: gps", "calc"]])
    ('time [s]', 'speed gps [m/s]', 'speed calc [m/s]')
    """
    units = next((cells for cells in texts if _units(cells)), [])
    sources = next((cells for cells in texts if cells != units and cells != names), [])
    out = []
    for k, name in enumerate(names):
        unit = units[k].strip("[]()- ") if k < len(units) else ""
        source = sources[k].rpartition(":")[2].strip() if k < len(sources) else ""
        if name and source and names.count(name) > 1:
            name = f"{name} {source}"
        stated = heading(name)
        # what a line of units says of a time may be no unit, as "unix time"
        known = role_of(stated) != TIME or time_column.unit_name(unit) is not None
        out.append(f"{name} [{unit}]" if unit and known and stated.unit is None else name)
    return tuple(out)


def _missing(lines: Sequence[str]) -> str:
    """What the first lines are not a table for."""
    filled = [line for line in lines if line.strip()]
    wanted = "a table has a first line with names such as time,speed,gap, and rows of numbers"
    names = (
        [cell for d in DELIMITERS for cell in split(filled[0], d) if role_of(heading(cell))] if filled else []
    )
    if filled and "\r" in filled[0]:
        return "its lines end with a carriage return alone: save it with the ends of lines of Windows or Unix"
    if len(filled) == 1 and names:
        return "has a header, but no rows"
    if names and not any(d in filled[0] for d in DELIMITERS):
        return f"has one column alone, {names[0]}; {wanted}"
    return f"no header was found; {wanted}"


def _is_number(cell: str) -> bool:
    number = number_and_unit(cell.strip("\"'"))[0]
    return bool(_NUMBER.fullmatch(number) or _DECIMAL_COMMA.fullmatch(number))


def _units(cells: list[str]) -> bool:
    """Whether a line holds the columns' units: most of its cells are some, and none is a number."""
    filled = [cell.strip("[]() ") for cell in cells if cell.strip("[]()- ")]
    known = sum(unit_of(cell) is not None for cell in filled)
    return known * 2 >= max(len(filled), 1) and not any(map(_is_number, filled))


def _layout(
    headings: tuple[str, ...], delimiter: str, rows: Sequence[str], skip: int, header: int, encoding: str
) -> Layout:
    cells = [number_and_unit(cell)[0] for line in rows for cell in split(line, delimiter)]
    commas = [cell for cell in cells if _DECIMAL_COMMA.fullmatch(cell)]
    if delimiter == ",":  # in quotes, where a comma may separate thousands as well
        commas = [cell for cell in commas if not _THOUSANDS.fullmatch(cell)]
    points = [cell for cell in cells if _DECIMAL_POINT.fullmatch(cell)]
    # next to decimal commas a point groups thousands: 1.234
    comma = bool(commas) and all(map(by_points, points))
    return Layout(headings, delimiter, comma, skip, header, encoding)
