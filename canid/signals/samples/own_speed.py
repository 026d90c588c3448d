"""The own speed at a radar's report: what turns range rate into the lead's own speed, and back.

The range rate holds the own motion, and with it the driver's own noise. A smoother takes some of that away, and what it
takes is not independent of the output: the driver then seems to answer sooner, and with a longer lag. The own speed is
known from better sensors, so that only the lead's motion has to be smoothed; where it is too coarse for that, the
relative motion is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np

from canid.signals.samples import local_polynomial
from canid.values.state_constraints import NOT_NEGATIVE
from canid.values.types import NAN, Array

# s of readings that make a line; one as long as that misses an acceleration's change of 1 m/s³ by 0.007 m/s
WINDOW_S = 0.3
# s; more readings cost time and say little: 15 of them make a line of 0.03 m/s of noise good to 0.016 m/s
SPACING_S = 0.015
# m/s, standard deviation of the own speed from which on it is too coarse, and below which it is fine again: a radar's
# range rate is smoothed to 0.04 m/s
COARSE_SD, FINE_SD = 0.04, 0.03
# changes of the value after which the smallest of them is the resolution, and reports over which scatter is averaged
MIN_CHANGES, MEMORY = 20, 200.0
# m/s; a smaller change is rounding
LEAST_CHANGE = 1e-6


class State(NamedTuple):
    """The latest readings, and how fine they are."""

    recent: tuple[tuple[float, float], ...] = ()  # s, m/s
    resolution: Annotated[float, NOT_NEGATIVE] = np.inf  # m/s, smallest change so far
    changes: int = 0
    scatter: Annotated[float, NOT_NEGATIVE] = 0.0  # (m/s)², variance of the lines' values
    reports: Annotated[float, NOT_NEGATIVE] = 0.0  # behind it
    coarse: bool = False


def put(state: State, t: float, speed: float) -> State:
    """Take a reading: t in s, speed in m/s; NaN and what comes less than `SPACING_S` after the last one are ignored."""
    if speed != speed:
        return state
    recent = state.recent
    if not recent:
        return state._replace(recent=((t, speed),))
    before, last = recent[-1]
    if t - before < SPACING_S:
        return state
    first, since = 0, t - WINDOW_S
    while first < len(recent) and recent[first][0] < since:
        first += 1
    recent = (*recent[first:], (t, speed))
    _, resolution, changes, scatter, reports, coarse = state
    change = abs(speed - last)
    if change > LEAST_CHANGE:
        resolution, changes = min(resolution, change), min(changes + 1, MIN_CHANGES)
    return State(recent, resolution, changes, scatter, reports, coarse)


def latest(state: State, t: float, stale: float) -> float:
    """Return the last reading in m/s; NaN: older than `stale` s at t, or there is none."""
    return state.recent[-1][1] if state.recent and t - state.recent[-1][0] <= stale else NAN


def at(state: State, t: float, stale: float) -> tuple[State, float]:
    """Estimate the own speed at a report.

    Args:
        state: with the readings that have come.
        t: s, of the report.
        stale: s; an older reading says nothing.

    Returns:
        the next state, and the speed in m/s; NaN: not known, or too coarse.

    Example:
        >>> state = State()
        >>> for k in range(10):
        ...     state = put(state, 0.02 * k, 20.0 + 0.04 * k)
        >>> round(at(state, 0.2, 0.5)[1], 9), at(state, 9.0, 0.5)[1]
        (20.4, nan)
    """
    if not (state.recent and t - state.recent[-1][0] <= stale):
        return state, NAN
    times, speeds = zip(*state.recent, strict=True)
    value, variance = local_polynomial.line([time - t for time in times], speeds)
    if variance == variance:
        reports = min(state.reports + 1.0, MEMORY)
        scatter = state.scatter + (variance - state.scatter) / reports
        rounding = state.resolution**2 / 12.0 if state.changes >= MIN_CHANGES else 0.0
        limit = FINE_SD if state.coarse else COARSE_SD
        coarse = scatter + rounding > limit * limit
        state = State(state.recent, state.resolution, state.changes, scatter, reports, coarse)
    return state, NAN if state.coarse else value


def range_rates(values: Mapping[str, Array]) -> dict[str, Array]:
    """Take the own speed from the lead's at grid points, and leave out what only that needs.

    Args:
        values: role -> (m,); `lead_speed` and `own_speed` in m/s where they are known.

    Example:
        >>> sample = {"range_rate": 0.9, "lead_speed": 21.0, "own_speed": 20.0}
        >>> range_rates({role: np.array([x]) for role, x in sample.items()})
        {'range_rate': array([1.])}
    """
    out = {role: x for role, x in values.items() if role not in ("lead_speed", "own_speed")}
    if "lead_speed" in values and "own_speed" in values:
        rate = values["lead_speed"] - values["own_speed"]
        out["range_rate"] = np.where(np.isfinite(rate), rate, out["range_rate"])
    return out
