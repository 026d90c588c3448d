"""Families of alternatives for the adequacy tests: functions of the driver's inputs and outputs outside the catalogue.

A cause that is not in the catalogue is still a function of something: a free curve of one input; a function of two; of
inputs long ago; of the driver's own motion; of the output's level and rate. Each family spans one of these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import K1, K2, TAU2, THETA2, delayed, lagged, parts, seen_late
from canid.models.effects.effect import Seen
from canid.values.findings import Flags
from canid.values.types import Array

# standard deviations; beyond, a power of an input is a few samples
OUTLIER_SIGMAS = 4.0
# knots of a free curve of one input, of the output, and of time: a bend between two of them is seen by both
INPUT_KNOTS, OUTPUT_KNOTS, TIME_KNOTS = 8, 14, 8
# s per knot of a level that drifts along the drive, and least and largest number of knots
LEVEL_KNOT_SPACING_S, LEVEL_KNOTS_RANGE = 45.0, (5, 24)
# quantiles between which the knots of a free curve lie
KNOT_QUANTILES = (0.02, 0.98)
# s; what is remembered of an input: longer than any lag of the model, up to what drivers forget within
MEMORIES_S = (3.0, 10.0, 30.0)
# s over which a change of the own speed is felt, and over which a speed becomes a habit
FELT_S, HABITS_S = (0.6, 1.5, 4.0), (8.0, 25.0, 70.0)
# s in which turmoil calms down
CALM_S = (5.0, 25.0)
# standard deviations at which an answer may switch over
SWITCH_SIGMAS = (0.3, 0.7, 1.2)
# quantiles of the looming and of the output's rate at which a bend or a limit may lie
LOOMING_QUANTILES, RATE_QUANTILES = (0.35, 0.6, 0.8), (0.6, 0.8, 0.93)
# s, lag of a pedal that is slower one way than the other
UNEVEN_LAG_S = 0.5
# m/s², thresholds of a lead's braking that frightens, and s in which that fades
LEAD_BRAKING, FRIGHT_FADE_S = (0.3, 0.8), 1.5
# s by which a bend is answered before the car is in it, and behind it
BEND_AHEAD_S = (-2.0, 0.0, 2.0, 4.0)
# m/s; least speed in a denominator
MIN_DIVISOR_SPEED = 3.0


OWN_MOTION_FAMILIES = ("felt", "habit")


class Shapes(NamedTuple):
    """One family."""

    name: str
    says: str  # what the residual would hold
    columns: Array  # (n, k)


def shapes(data: DriverData, solved: FittedDriver) -> list[Shapes]:
    """All families along a drive.

    Args:
        data: what is explained.
        solved: the model whose residual is tested; its dead times and lags are used, its causes are not.
    """
    fine = solved.rows & ~data.output.hidden
    inputs = _inputs(data, solved, fine)
    families = [
        *_of_inputs(inputs),
        *_in_time(inputs, data.seen.t, data.seen.duration),
        *_of_output(solved.fitted.model, fine, data.output.dt),
        *_of_bends(inputs, data),
    ]
    # where the output is the car's own acceleration, that is no input to it
    return (
        families if data.pedal else [family for family in families if family.name not in OWN_MOTION_FAMILIES]
    )


class Inputs(NamedTuple):
    """Inputs of the driver after the dead time, standardised, (n,) each."""

    e: Array  # headway error
    w: Array  # relative speed
    v: Array  # own speed
    a: Array  # acceleration of the lead
    g: Array  # logarithm of the gap
    both: Array  # both answers together
    rate: Array  # m/s, relative speed
    late: Seen  # in their units
    gap: Array  # m, at least 1
    fine: Flags  # samples that count
    tau: float  # s, lag of the answer to relative speed
    dt: float  # s

    def standard(self, x: Array) -> Array:
        """Standardise over the samples that count."""
        return _standard(x, self.fine)

    def through(self, *columns: Array) -> Array:
        """Columns (n,) and (n, k) through the lag of the answer to relative speed."""
        return _through(self.tau, self.dt, *columns)


def _inputs(data: DriverData, solved: FittedDriver, fine: Flags) -> Inputs:
    q = solved.q
    acted = parts(solved.model._replace(effects=(), where=()), data, q)
    late = seen_late(data, float(q[THETA2]))
    gap = np.maximum(late.gap, 1.0)
    e, w, v, a, g, both = (
        _standard(x, fine)
        for x in (
            acted.e,
            acted.w,
            late.speed,
            late.lead_accel,
            np.log(gap),
            float(q[K1]) * acted.e + float(q[K2]) * acted.w,
        )
    )
    return Inputs(e, w, v, a, g, both, acted.w, late, gap, fine, float(q[TAU2]), data.output.dt)


def _of_inputs(i: Inputs) -> list[Shapes]:
    """Families of one input, of two, of the past, and of the own motion."""
    e, w, v, a, g, dt = i.e, i.w, i.v, i.a, i.g, i.dt
    standard, through, late, fine = i.standard, i.through, i.late, i.fine
    bends = [np.maximum(np.abs(w) - k, 0.0) * np.sign(w) for k in (0.5, 1.2, 2.0)]
    turmoil = [standard(lagged(np.abs(i.rate), s, dt)) for s in CALM_S]
    per_speed = i.rate / np.maximum(late.speed, MIN_DIVISOR_SPEED)
    # fmt: off
    return [
        Shapes("range_rate curve", "a bend in the answer to relative speed",
               through(w * w, np.abs(w), w**3, w * np.abs(w), *bends)),
        Shapes("range_rate freely", "an answer to relative speed of another form", through(hats(w, fine, INPUT_KNOTS))),
        Shapes("headway curve", "a bend in the answer to headway",
               through(e * e, np.abs(e), e**3, e * np.abs(e), np.sign(e))),
        Shapes("headway freely", "an answer to headway of another form", through(hats(e, fine, INPUT_KNOTS))),
        Shapes("range_rate by gap", "an answer to relative speed that depends on the gap or the speed",
               through(w * g, w * g * g, w * v, w * v * v, np.abs(w) * g, w * np.abs(w) * g)),
        Shapes("looming", "a bend in the answer to how fast the lead grows", through(*_looming(i.rate, i.gap, fine))),
        Shapes("headway by speed", "an answer to headway that depends on the speed or the gap",
               through(e * v, e * v * v, e * g, v, v * v, v**3, g, g * g, per_speed)),
        Shapes("speed", "an answer to the own speed", through(hats(late.speed, fine, INPUT_KNOTS))),
        Shapes("both", "an answer to headway that depends on relative speed",
               through(e * w, e * np.abs(w), e * e * w, e * w * w)),
        Shapes("delays", "answers that come later than one dead time",
               through(*(delayed(x, s, dt) for x, s in ((e, 1.0), (w, 1.0), (e, 3.0), (w, 2.5))))),
        Shapes("headway long ago", "an answer to the headway of long ago",
               np.stack([lagged(e, s, dt) for s in MEMORIES_S], axis=1)),
        Shapes("range_rate long ago", "an answer to the relative speed of long ago",
               np.stack([lagged(w, s, dt) for s in MEMORIES_S], axis=1)),
        Shapes("felt", "an answer to the own acceleration",
               through(*(standard(late.speed - delayed(late.speed, s, dt)) for s in FELT_S))),
        Shapes("habit", "an answer to the speed that was driven before",
               through(*(standard(late.speed - lagged(late.speed, s, dt)) for s in HABITS_S))),
        Shapes("turmoil", "answers that depend on how restless the traffic was",
               through(*(x * u for x in (w, e, i.both) for u in turmoil))),
        Shapes("switched", "an answer that switches over and stays",
               through(*(_switched(w, k) for k in SWITCH_SIGMAS), _switched(e, 0.5))),
        Shapes("lead", "an answer to the lead's acceleration",
               through(a, np.abs(a), a**3, *(standard(x) for x in _fright(late, dt)))),
    ]
    # fmt: on


def _in_time(i: Inputs, time: Array, duration: float) -> list[Shapes]:
    """Families of answers and of a level that change along the drive."""
    e, w, v, g, both, through = i.e, i.w, i.v, i.g, i.both, i.through
    t = i.standard(time)
    along = hats(time, i.fine, TIME_KNOTS)
    knots = int(np.clip(duration / LEVEL_KNOT_SPACING_S, *LEVEL_KNOTS_RANGE))
    # fmt: off
    return [
        Shapes("time", "answers that change along the drive",
               np.c_[through(t * w, t * e, t * t * w, t * t * e), t, t * t, t**3]),
        Shapes("both answers", "two answers that change together, along the drive, with the gap or the speed",
               through(both * t, both * t * t, both * t**3, both * np.sign(t), both * g, both * v)),
        Shapes("both answers in time", "two answers that change together at some time", through(both[:, None] * along)),
        Shapes("range_rate in time", "an answer to relative speed that changes at some time",
               through(w[:, None] * along)),
        Shapes("headway in time", "an answer to headway that changes at some time", through(e[:, None] * along)),
        Shapes("level", "a level that drifts along the drive", hats(time, i.fine, knots)),
    ]
    # fmt: on


def answers(data: DriverData, solved: FittedDriver) -> dict[str, Array]:
    """Inputs behind the driver's lag, and the slope of the simulated output: name -> (n,)."""
    fine = solved.rows & ~data.output.hidden
    acted = parts(solved.model._replace(effects=(), where=()), data, solved.q)
    late = _through(float(solved.q[TAU2]), data.output.dt, _standard(acted.w, fine), _standard(acted.e, fine))
    slope = _standard(np.gradient(solved.fitted.model, data.output.dt), fine)
    return {"relative speed": late[:, 0], "headway": late[:, 1], "slope": slope}


def _of_output(model: Array, fine: Flags, dt: float) -> list[Shapes]:
    """Changes of the output itself: curves of it, of its rate, and the remainder of a limited rate."""
    y, r = _standard(model, fine), _standard(np.gradient(model, dt), fine)
    r5 = delayed(r, 0.5, dt)
    fast = np.quantile(np.abs(np.gradient(model, dt))[fine], RATE_QUANTILES) * dt
    behind = [_limited(model, float(most)) for most in fast] + [
        _uneven(model, side, dt) for side in (1.0, -1.0)
    ]
    return [
        Shapes("output", "an output that bends at its ends",
               np.stack([y * y, y**3, np.maximum(y - 1, 0), np.minimum(y + 1, 0)], axis=1)),
        Shapes("output freely", "an output with steps or bends", hats(model, fine, OUTPUT_KNOTS)),
        Shapes("output rate", "an output that follows unevenly: later one way than the other, or with a limited rate",
               np.stack([np.abs(r), r * np.abs(r), r**3, np.abs(r5), r5 * np.abs(r5)], axis=1)),
        Shapes("output behind", "an output with a limited rate, or later one way than the other",
               np.stack([_standard(x - model, fine) for x in behind], axis=1)),
    ]  # fmt: skip


def _of_bends(i: Inputs, data: DriverData) -> list[Shapes]:
    """Family of the road's bends, where they are measured: a driver sees one before the car is in it."""
    if data.sideways is None:
        return []
    t, at = data.seen.t, data.sideways
    columns = [i.standard(np.interp(t + s, t, at)) for s in BEND_AHEAD_S]
    return [Shapes("bends", "an answer to the road's bends", np.stack(columns, axis=1))]


def hats(x: Array, fine: Flags, knots: int) -> Array:
    """Span the free curves of x: straight lines between knots at its quantiles, (n, knots); too few values: (n, 0).

    Example:
        >>> hats(np.array([0.0, 0.5, 2.0]), np.ones(3, dtype=bool), 3).sum(axis=1)
        array([1., 1., 1.])
    """
    at = np.unique(np.quantile(x[fine], np.linspace(*KNOT_QUANTILES, knots)))
    if at.size < 3:
        return np.zeros((x.size, 0))
    return np.stack([np.interp(x, at, row) for row in np.eye(at.size)], axis=1)


def _standard(x: Array, fine: Flags) -> Array:
    scaled = (x - np.mean(x[fine])) / max(float(np.std(x[fine])), 1e-9)
    return np.asarray(np.clip(scaled, -OUTLIER_SIGMAS, OUTLIER_SIGMAS))


def _through(tau: float, dt: float, *columns: Array) -> Array:
    """Columns (n,) and (n, k), side by side, each through the lag."""
    side_by_side = np.column_stack(columns)
    if not side_by_side.shape[1]:
        return side_by_side
    return np.column_stack([lagged(c, tau, dt) for c in side_by_side.T])


def _switched(x: Array, threshold: float) -> Array:
    """Sign of x when it last left ±threshold; before that 0.

    Example:
        >>> _switched(np.array([0.0, 2.0, 0.5, -0.5, -2.0, 0.0]), 1.0)
        array([ 0.,  1.,  1.,  1., -1., -1.])
    """
    outside = np.abs(x) > threshold
    last = np.maximum.accumulate(np.where(outside, np.arange(x.size), 0))
    state: Array = np.where(outside, np.sign(x), 0.0)[last]
    return state


def _limited(x: Array, most: float) -> Array:
    """Follow x with a limited change per sample.

    Example:
        >>> _limited(np.array([0.0, 2.0, 2.0, 1.5]), 1.0)
        array([0. , 1. , 2. , 1.5])
    """
    y, out = float(x[0]), []
    for wanted in x.tolist():
        y += min(max(wanted - y, -most), most)
        out.append(y)
    return np.array(out)


def _uneven(x: Array, side: float, dt: float) -> Array:
    """Follow x through a lag of UNEVEN_LAG_S on its way up (side 1) or down (−1), and at once the other way.

    Example:
        >>> _uneven(np.array([0.0, 1.0, 0.0]), 1.0, UNEVEN_LAG_S)
        array([0. , 0.5, 0. ])
    """
    y, out, part = float(x[0]), [], dt / (UNEVEN_LAG_S + dt)
    for wanted in x.tolist():
        y += (wanted - y) * (part if side * (wanted - y) > 0.0 else 1.0)
        out.append(y)
    return np.array(out)


def _looming(rate: Array, gap: Array, fine: Flags) -> list[Array]:
    """Relative speed beyond a threshold of looming, which grows with the gap's square; (n,) each."""
    looming = rate / gap**2
    at = np.quantile(np.abs(looming[fine]), LOOMING_QUANTILES)
    return [_standard(np.maximum(np.abs(looming) - k, 0.0) * np.sign(looming) * gap**2, fine) for k in at]


def _fright(late: Seen, dt: float) -> list[Array]:
    """Braking of the lead above a threshold, fading; (n,) each."""
    return [lagged(np.maximum(-late.lead_accel - k, 0.0), FRIGHT_FADE_S, dt) for k in LEAD_BRAKING]
