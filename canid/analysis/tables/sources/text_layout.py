"""Layout of delimited text: encoding, delimiter, decimal sign, and the line of the header, judged from the first lines."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from typing import NamedTuple

from canid.analysis.tables.headings import TIME, heading, role_of
from canid.analysis.tables.source import MAX_COLUMNS
from canid.signals.vehicle.units import unit_of
from canid.values.errors import LogError

DELIMITERS = (",", ";", "\t", "|")
# a header stands among so many first lines; OpenACC has five lines of description before it
MAX_PREAMBLE_LINES = 60
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(e[+-]?\d+)?", re.IGNORECASE)
_DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d+(e[+-]?\d+)?", re.IGNORECASE)


class Layout(NamedTuple):
    """How the text is divided."""

    headings: tuple[str, ...]  # with the units of a line of units, in brackets
    delimiter: str  # "": white space
    decimal_comma: bool
    skip: int  # lines before the first row
    encoding: str


def encoding_of(lines: Sequence[bytes]) -> str:
    """The encoding of a file whose first lines these are."""
    try:
        b"\n".join(lines).decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig" if lines[0].startswith(b"\xef\xbb\xbf") else "utf-8"


def split(line: str, delimiter: str) -> list[str]:
    """The cells of one line.

    Example:
        >>> split('a,"b,c"', ","), split("1  2", "")
        (['a', 'b,c'], ['1', '2'])
    """
    if not delimiter:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
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
    best: tuple[tuple[int, int, int], int, str] | None = None
    delimiters = DELIMITERS if any(d in line for line in lines for d in DELIMITERS) else ("",)
    for delimiter in delimiters:
        rows = [split(line, delimiter) for line in lines]
        for k in range(min(len(rows), MAX_PREAMBLE_LINES)):
            score = _score(rows, k)
            if score is not None and (best is None or score > best[0]):
                best = score, k, delimiter
    numeric = next((k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")), None)
    if names and numeric is not None and best is None:
        candidates = [(len(split(lines[numeric], d)), d) for d in (*DELIMITERS, "")]
        cells, delimiter = max(candidates, key=lambda candidate: candidate[0])
        if cells < len(names):
            raise LogError(f"{name}: its rows have {cells} cells; the mapping names {len(names)} columns")
        return _layout(tuple(names), delimiter, lines[numeric:], numeric, encoding)
    if best is None:
        raise LogError(f"{name}: {_missing(lines)}")
    _, k, delimiter = best
    header = split(lines[k].lstrip("#").lstrip() if lines[k].startswith("#") else lines[k], delimiter)
    if len(header) > MAX_COLUMNS:
        raise LogError(f"{name}: has {len(header):,} columns; at most {MAX_COLUMNS:,} are read")
    units = split(lines[k + 1], delimiter)
    if _units(units):
        header = [f"{cell} [{unit}]" if unit else cell for cell, unit in zip(header, units, strict=False)]
        k += 1
    return _layout(tuple(header), delimiter, lines[k + 1 :], k + 1, encoding)


def _score(rows: list[list[str]], k: int) -> tuple[int, int, int] | None:
    """How well line k is a header: it names a time, cells that are filled, the earlier line; None: it is none."""
    row = rows[k]
    filled = [cell for cell in row if cell]
    if len(filled) < 2 or len({*filled}) < len(filled) / 2:
        return None
    if sum(_is_number(cell) for cell in filled) > 0.2 * len(filled):
        return None
    follow = rows[k + 1 : k + 2]
    if follow and _units(follow[0]):
        follow = rows[k + 2 : k + 3]
    if not follow or len(follow[0]) < 2 or not any(_is_number(cell) for cell in follow[0]):
        return None
    # a last delimiter without a cell is no cell
    if abs(len(follow[0]) - len(row)) > 1:
        return None
    timed = any(role_of(heading(cell)) == TIME for cell in filled[:MAX_COLUMNS])
    return int(timed), len(filled), -k


def _missing(lines: Sequence[str]) -> str:
    """What the first lines are not a table for."""
    filled = [line for line in lines if line.strip()]
    wanted = "a table has a first line with names such as time,speed,gap, and rows of numbers"
    names = (
        [cell for d in DELIMITERS for cell in split(filled[0], d) if role_of(heading(cell))] if filled else []
    )
    if len(filled) == 1 and names:
        return "has a header, but no rows"
    if names and not any(d in filled[0] for d in DELIMITERS):
        return f"has one column alone, {names[0]}; {wanted}"
    return f"no header was found; {wanted}"


def _is_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell.strip("\"'")) or _DECIMAL_COMMA.fullmatch(cell))


def _units(cells: list[str]) -> bool:
    """Whether a line holds the columns' units."""
    filled = [cell.strip("[]() ") for cell in cells if cell.strip("[]()- ")]
    return bool(filled) and all(unit_of(cell) is not None and not _is_number(cell) for cell in filled)


def _layout(
    headings: tuple[str, ...], delimiter: str, rows: Sequence[str], skip: int, encoding: str
) -> Layout:
    comma = False
    if delimiter != ",":
        cells = [cell for line in rows for cell in split(line, delimiter)]
        comma = any(map(_DECIMAL_COMMA.fullmatch, cells)) and not any(map(_DECIMAL_POINT.fullmatch, cells))
    return Layout(headings, delimiter, comma, skip, encoding)
