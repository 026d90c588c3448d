"""A table that people and tests read, and how the runs behind it are made."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np


class Settings(NamedTuple):
    """What the user asked for."""

    runs: int = 200
    first_seed: int = 50_000
    peers: bool = True
    workers: int = 1

    def few(self, share: int) -> Settings:
        """Return settings with a `share`-th of the runs, for what is slow; at least two."""
        return self._replace(runs=max(self.runs // share, 2))


class Table(NamedTuple):
    """One printed table; a cell is text or a number."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]]
    notes: tuple[str, ...] = ()


def each(settings: Settings, function: Callable[..., Any], *args: Any) -> list[Any]:
    """Return `function(seed, *args)` for every seed, in order."""
    seeds = range(settings.first_seed, settings.first_seed + settings.runs)
    if settings.workers <= 1:
        return [function(seed, *args) for seed in seeds]
    with ProcessPoolExecutor(settings.workers) as pool:
        return list(pool.map(partial(_swapped, function, args), seeds))


def _swapped(function: Callable[..., Any], args: tuple[Any, ...], seed: int) -> Any:
    return function(seed, *args)


def markdown(table: Table) -> str:
    """Write a table as aligned markdown.

    >>> print(markdown(Table("T", ("method", "error"), [("a", 0.12345), ("bb", "none")])))
    **T**
    <BLANKLINE>
    | method | error |
    |--------|-------|
    | a      | 0.123 |
    | bb     | none  |
    >>> print(markdown(Table("T", ("method", "error", "ms"), [("a", "not installed")])).splitlines()[-1])
    a: not installed.
    """
    # a row that ends early says why in its last cell, which is no number and would widen a column of them
    short = [row for row in table.rows if len(row) < len(table.columns)]
    why = dict.fromkeys(f"{row[0]}: {row[-1]}." for row in short)
    rows = [(*row[:-1], "cannot run") if len(row) < len(table.columns) else row for row in table.rows]
    cells = [table.columns, *(tuple(map(text, row)) for row in rows)]
    width = [max(len(row[i]) for row in cells if i < len(row)) for i in range(len(table.columns))]

    def line(row: Sequence[str]) -> str:
        filled = [*row, *[""] * (len(width) - len(row))]
        return "| " + " | ".join(cell.ljust(w) for cell, w in zip(filled, width, strict=True)) + " |"

    rule = "|" + "|".join("-" * (w + 2) for w in width) + "|"
    out = [f"**{table.title}**", "", line(cells[0]), rule, *map(line, cells[1:])]
    notes = " ".join((*table.notes, *why))
    return "\n".join([*out, *([f"\n{notes}"] if notes else [])])


def text(cell: Any) -> str:
    """Write a cell: a Monte Carlo run of 200 resolves three digits."""
    if isinstance(cell, float | np.floating):
        if math.isnan(cell):
            return "–"
        return f"{cell:.3g}" if abs(cell) < 1000 else f"{cell:.0f}"
    return str(cell)


def held(share: float, known: int, runs: int) -> float | str:
    """Return the cell of a share of intervals that hold the truth; of how many, where not every run has one.

    >>> held(0.95, 40, 40), held(0.9, 10, 40), held(math.nan, 0, 40)
    (0.95, '0.9 of 10', nan)
    """
    return math.nan if not known else share if known == runs else f"{text(share)} of {known}"


def rmse(errors: Any, axis: int = 0) -> Any:
    """Root mean square over runs; NaN counts as no answer and is left out."""
    with np.errstate(invalid="ignore"):
        square = np.square(np.asarray(errors, float))
    known = np.isfinite(square)
    total = np.where(known, square, 0.0).sum(axis=axis)
    count = known.sum(axis=axis)
    return np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def timed(function: Callable[[], Any]) -> tuple[Any, float]:
    """Return a call's value and its CPU time in s: other processes on the machine do not count."""
    before = time.process_time()
    value = function()
    return value, time.process_time() - before
