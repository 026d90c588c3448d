"""The order of a table's rows: by time, stable; and rows that no order makes one drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from canid.analysis.tables.rows import Rows
from canid.analysis.tables.source import clean
from canid.values.errors import ConfigError
from canid.values.types import Array

_Order = npt.NDArray[np.int64]
# share of the rows, and rows, that contradict another of the same time before they are taken for those of several drives:
# an export may repeat a row with a digit rounded
_CONTRADICTING_SHARE, _CONTRADICTING_ROWS = 0.01, 3
# share of the rows from which on times that are repeated are said: two rows for each time
_REPEATED_SHARE = 0.4
# of the median step to the next row, up to which that to the row of the next time shows rows of several: n rows of one
# clock of whole seconds go n times as far there
_ALTERNATES = 0.5
# rows of a stretch in order, and its share that another one covers, from which two stretches with the same columns are two
# drives whose times begin anew: loggers write buffers of some rows, which overlap a little
_STRETCH_ROWS, _COVERED_SHARE = 50, 0.5
# usual steps by which a wrong time is off at least
_STRAY_STEPS = 50
# stretches that are compared with each other; a table with more is in no order at all
_MAX_STRETCHES = 64


def by_time(t: Array) -> tuple[_Order | None, int]:
    """The stable order of times, those without one last, and how many rows stand behind a later one.

    Args:
        t: (n,); NaN: no time.

    Returns:
        The order; None where the rows are in order already.

    Example:
        >>> by_time(np.array([0.0, 2.0, 1.0, 2.0]))
        (array([0, 2, 1, 3]), 1)
    """
    known = t[np.isfinite(t)]
    late = int((known < np.maximum.accumulate(known)).sum()) if len(known) else 0
    return (np.argsort(t, kind="stable"), late) if late else (None, 0)


def strays(t: Array) -> npt.NDArray[np.bool_]:
    """Rows whose time alone is wrong: earlier or later than all others, between two that follow each other.

    Args:
        t: (n,) in the order of the file; NaN: no time.

    Example:
        >>> t = np.arange(100.0, 200.0)
        >>> t[[20, 80]] = 0.0, np.inf
        >>> strays(t).nonzero()[0]
        array([20, 80])
    """
    out = np.zeros(len(t), bool)
    known = np.flatnonzero(~np.isnan(t))
    with np.errstate(invalid="ignore"):
        steps, across = np.diff(t[known]), t[known[2:]] - t[known[:-2]]
    if not (steps > 0.0).any():
        return out
    far = _STRAY_STEPS * float(np.median(steps[steps > 0.0]))
    alone = (np.abs(steps[1:]) > far) & (np.abs(steps[:-1]) > far) & (across >= 0.0) & (across < far)
    at = known[1:-1][alone]
    others = np.delete(t[known], np.flatnonzero(alone) + 1)
    out[at] = (t[at] < others.min()) | (t[at] > others.max())
    return out


def taken(rows: Rows, order: _Order) -> Rows:
    """Rows in an order."""
    at = order.tolist()
    return Rows(
        {place: column[order] for place, column in rows.numbers.items()},
        {place: [column[k] for k in at] for place, column in rows.texts.items()},
        rows.n,
        rows.lines[order],
    )


def repeated(t: Array, columns: Sequence[Array], name: str, remedy: str, choose: str = "") -> str:
    """A sentence where most rows have the time of the row before and another value of the same columns.

    Of a clock of whole seconds a row goes on in the next. Where it goes on in the row of the next time instead, rows of
    several drives or vehicles alternate.

    Args:
        t: (n,) s, in order.
        columns: (n,) each, measured values.
        name: of the column of times.
        remedy: what to do.
        choose: what to do with rows of several; "": they are separated later.

    Raises:
        ConfigError: the rows are of several.

    Example:
        >>> t, value = np.repeat([0.0, 1.0], 5), np.arange(10.0)
        >>> repeated(t, [value], "time", "")
        'time: 8 of 10 rows have the time of the row before, and are not used: write fractions of a second'
    """
    again = np.diff(t) == 0.0
    # rows of several messages that came at one time fill different columns
    twice = np.zeros(len(again), bool)
    for column in columns:
        twice |= again & (column[1:] != column[:-1]) & np.isfinite(column[1:]) & np.isfinite(column[:-1])
    n = int(twice.sum())
    if n <= _REPEATED_SHARE * len(t):
        return ""
    each = round(len(t) / (len(t) - int(again.sum())))
    if choose and any(_alternates(column, again, each) for column in columns):
        raise ConfigError(f"{name}: several drives or vehicles: {each} rows have each time; {choose}")
    return (
        f"{name}: {n:,} of {len(t):,} rows have the time of the row before, and are not used: write fractions of a "
        f"second{remedy}"
    )


def _alternates(x: Array, again: npt.NDArray[np.bool_], each: int) -> bool:
    """Whether a value goes on in the row of the next time, and not in the next row of its own time."""
    within, across = np.abs(np.diff(x))[again], np.abs(x[each:] - x[:-each])
    known = np.isfinite(within).any() and np.isfinite(across).any()
    return bool(known and np.nanmedian(across) < _ALTERNATES * np.nanmedian(within))


def check(t: Array, rows: Rows, places: Sequence[int], order: _Order, name: str, choose: str) -> None:
    """Refuse rows that cannot be of one drive.

    Args:
        t: (n,) times in the order of the file.
        rows: in the order of the file.
        places: columns of numbers that are measured values.
        order: of `by_time`.
        name: of the table.
        choose: what to do.

    Raises:
        ConfigError: the times begin anew within the table, or rows of one time contradict each other.
    """
    columns = {place: clean(rows.numbers[place]) for place in places if place in rows.numbers}
    twice = _begins_anew(t, columns)
    if twice is not None:
        first, second = twice
        raise ConfigError(
            f"{name}: holds several drives: the times of line {rows.lines[first]:,} begin anew at line "
            f"{rows.lines[second]:,}, with the same columns; {choose}"
        )
    n = _contradicting(t, columns, order)
    if n > max(_CONTRADICTING_SHARE * len(t), _CONTRADICTING_ROWS):
        raise ConfigError(
            f"{name}: holds several drives or vehicles: {n:,} rows have the time of another row and other values; {choose}"
        )


def _contradicting(t: Array, columns: Mapping[int, Array], order: _Order) -> int:
    """Rows that have another value than one of the same time that stands elsewhere in the file."""
    same = (np.diff(t[order]) == 0.0) & (np.abs(np.diff(order)) > 1)
    wrong = np.zeros(len(same), bool)
    for column in columns.values():
        a, b = column[order][:-1], column[order][1:]
        wrong |= np.isfinite(a) & np.isfinite(b) & (a != b)
    return int((same & wrong).sum())


def _begins_anew(t: Array, columns: Mapping[int, Array]) -> tuple[int, int] | None:
    """Begins of two stretches in order, of the same time and with different values of the same columns."""
    known = np.flatnonzero(np.isfinite(t))
    cuts = np.flatnonzero(np.diff(t[known]) < 0.0) + 1
    if not 1 <= len(cuts) < _MAX_STRETCHES:
        return None
    stretches = [part for part in np.split(known, cuts) if len(part) >= _STRETCH_ROWS]
    for k, stretch in enumerate(stretches):
        for other in stretches[k + 1 :]:
            low, high = max(t[stretch[0]], t[other[0]]), min(t[stretch[-1]], t[other[-1]])
            shorter = min(t[stretch[-1]] - t[stretch[0]], t[other[-1]] - t[other[0]])
            if high - low <= _COVERED_SHARE * shorter:
                continue
            a, b = (part[(t[part] >= low) & (t[part] <= high)] for part in (stretch, other))
            for column in columns.values():
                x, y = (part[np.isfinite(column[part])] for part in (a, b))
                if min(len(x), len(y)) < _STRETCH_ROWS:
                    continue
                if (
                    len(x) != len(y)
                    or not np.array_equal(t[x], t[y])
                    or not np.array_equal(column[x], column[y])
                ):
                    return int(stretch[0]), int(other[0])
    return None
