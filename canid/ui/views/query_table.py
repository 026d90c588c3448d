"""Rows of a query as text: a value and its interval in one column, and blocks of columns where the screen is narrow."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any, NamedTuple

from canid.ui.terminal.spans import cells
from canid.values.interval_text import DASH, interval_text
from canid.values.terminal_text import terminal_text
from canid.values.text.numbers import number

# significant digits: an estimate has no more that mean something; --format csv gives all
DIGITS = 4
# characters of a cell: the JSON of a drive would fill screens
MAX_CELL = 400
# characters below which a column is not narrowed
MIN_TEXT = 8
GAP = "  "


class _Column(NamedTuple):
    name: str
    cells: tuple[str, ...]
    numeric: bool


def text(names: Sequence[str], rows: Sequence[Sequence[Any]], width: int) -> list[str]:
    """Lines of a table that no line of `width` characters cuts off.

    Columns x, x_low and x_high become x with its interval. Where the columns do not fit, long texts are wrapped; where that
    is not enough, the columns come in blocks, the first column in each of them.

    Args:
        names: of the columns.
        rows: values of any type; None: not known.
        width: characters of a line.

    Example:
        >>> text(("driver", "K", "K_low", "K_high", "drives"), [("anna", 0.412, 0.38, 0.45, 12)], 80)
        ['driver  K                     drives', 'anna    0.412 [0.380, 0.450]      12']
    """
    columns = _folded(names, rows)
    if not columns:
        return []
    if _width(columns) <= width:
        return _block(columns, width)
    lines: list[str] = []
    for block in _blocks(columns, width):
        lines += [*([""] if lines else []), *_block(block, width)]
    return lines


def _folded(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[_Column]:
    at = {name: k for k, name in enumerate(names)}
    ends = {f"{name}{end}" for name in names for end in ("_low", "_high")}
    out = []
    for k, name in enumerate(names):
        low, high = at.get(f"{name}_low"), at.get(f"{name}_high")
        if low is not None and high is not None:
            column = tuple(_interval(row[k], row[low], row[high]) for row in rows)
            out.append(_Column(terminal_text(name), column, False))
        elif not (name in ends and {f"{_stem(name)}{end}" for end in ("", "_low", "_high")} <= set(at)):
            values = [row[k] for row in rows]
            numeric = all(v is None or (isinstance(v, int | float) and v is not True) for v in values)
            out.append(_Column(terminal_text(name), tuple(map(_cell, values)), numeric))
    return out


def _stem(name: str) -> str:
    return name.removesuffix("_low").removesuffix("_high")


def _interval(value: Any, low: Any, high: Any) -> str:
    if not isinstance(value, int | float):
        return _cell(value)
    ends = [x if isinstance(x, int | float) else float("nan") for x in (low, high)]
    return interval_text(value, ends[0], ends[1])


def _cell(value: Any) -> str:
    if value is None:
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return number(value, digits=DIGITS)
    if isinstance(value, list | tuple):
        return ", ".join(map(_cell, value)) or DASH
    shown = str(value)
    if len(shown) > MAX_CELL:
        shown = f"{shown[:MAX_CELL]}… ({len(shown)} characters)"
    return terminal_text(shown)


def _width(columns: Sequence[_Column]) -> int:
    return sum(map(_of_column, columns)) + len(GAP) * (len(columns) - 1)


def _of_column(column: _Column) -> int:
    return max(cells(cell) for cell in (column.name, *column.cells))


def _blocks(columns: Sequence[_Column], width: int) -> list[list[_Column]]:
    """Columns that fit together, the first one in each block."""
    narrow = [_wrapped(column, width, first=k == 0) for k, column in enumerate(columns)]
    # whole in the first block; in the others it says which row it is
    again = _wrapped(columns[0], width, first=True)._replace(
        cells=tuple(_cut(cell, max(width // 3, MIN_TEXT)) for cell in columns[0].cells)
    )
    first, blocks = again, [[narrow[0]]]
    for column in narrow[1:]:
        if len(blocks[-1]) > 1 and _width([*blocks[-1], column]) > width:
            blocks.append([first])
        blocks[-1].append(column)
    return blocks


def _cut(cell: str, width: int) -> str:
    """As much of a text as fits, with a mark where it is cut."""
    while cells(cell) > width:
        cell = cell[: min(len(cell) - 2, width - 1)] + "…"
    return cell


def _wrapped(column: _Column, width: int, *, first: bool) -> _Column:
    """The same column with line feeds in its cells: the first column and any other fit in one line."""
    fit = max(width // 3 if first else width // 2, MIN_TEXT)
    name, *rest = ("\n".join(_lines(cell, fit)) for cell in (column.name, *column.cells))
    return column._replace(name=name, cells=tuple(rest))


def _lines(cell: str, width: int) -> list[str]:
    if cells(cell) <= width:
        return [cell]
    # a character may take two cells: then the half of them fits
    fit = width if cells(cell) == len(cell) else width // 2
    return textwrap.wrap(cell, fit) or [cell]


def _block(columns: Sequence[_Column], width: int) -> list[str]:
    split = [[cell.split("\n") for cell in (column.name, *column.cells)] for column in columns]
    widths = [max(cells(part) for cell in column for part in cell) for column in split]
    lines = []
    for row in zip(*split, strict=True):
        for k in range(max(map(len, row))):
            parts = []
            for column, wide, cell in zip(columns, widths, row, strict=True):
                part = cell[k] if k < len(cell) else ""
                space = " " * (wide - cells(part))
                parts.append(space + part if column.numeric else part + space)
            lines.append(GAP.join(parts).rstrip())
    return lines
