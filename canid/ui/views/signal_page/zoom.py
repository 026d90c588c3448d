"""What the page draws of a line: the extremes of each piece of what is on the screen, and the value at the cursor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.contents.signal_lines import Line
from canid.ui.views.drawing.decimation import min_max_indices
from canid.values.types import Array

# digits that are shown: more than a signal of 24 bits has; and of times, whole µs
DIGITS, TIME_DECIMALS = 8, 6


class Piece(NamedTuple):
    """Points of a line, as the page draws them; None: a gap."""

    t: list[float]  # s
    value: list[float | None]
    whole: bool  # every reading is there


def piece(line: Line, begin: float, end: float, points: int) -> Piece:
    """A part of a line, with a reading on each side of it, so that the line reaches the edges.

    Args:
        line: the whole of it.
        begin: s.
        end: s.
        points: about how many there may be; of more readings the extremes of each bucket.

    Example:
        >>> line = Line(np.arange(10.0), np.arange(10.0))
        >>> piece(line, 2.5, 4.5, 100)
        Piece(t=[2.0, 3.0, 4.0, 5.0], value=[2.0, 3.0, 4.0, 5.0], whole=True)
        >>> piece(line, 0.0, 9.0, 4).value
        [0.0, 4.0, 5.0, 9.0]
    """
    first = max(int(np.searchsorted(line.t, begin)) - 1, 0)
    last = min(int(np.searchsorted(line.t, end, side="right")) + 1, len(line.t))
    t, value = line.t[first:last], line.value[first:last]
    at = min_max_indices(value, np.zeros(len(value), dtype=bool), max(points, 2))
    whole = len(at) == len(value)
    at = at[_bends(value[at])]
    return Piece(np.round(t[at], TIME_DECIMALS).tolist(), _numbers(value[at]), whole)


def reading(line: Line, t: float) -> tuple[float, float] | None:
    """The last reading at or before a time, and its time; None: there is none, or a gap.

    Example:
        >>> line = Line(np.array([0.0, 1.0]), np.array([5.0, 6.0]))
        >>> reading(line, 0.9), reading(line, -1.0)
        ((5.0, 0.0), None)
    """
    at = int(np.searchsorted(line.t, t, side="right")) - 1
    if at < 0 or not np.isfinite(line.value[at]):
        return None
    return float(line.value[at]), float(line.t[at])


def _bends(value: Array) -> npt.NDArray[np.int64]:
    """Points without which the line would be another one: not those between two equal ones."""
    if len(value) < 3:
        return np.arange(len(value), dtype=np.int64)
    same = (value[1:-1] == value[:-2]) & (value[1:-1] == value[2:])
    return np.flatnonzero(np.concatenate([[True], ~same, [True]])).astype(np.int64)


def _numbers(value: Array) -> list[float | None]:
    return [float(f"{x:.{DIGITS}g}") if np.isfinite(x) else None for x in value.tolist()]
