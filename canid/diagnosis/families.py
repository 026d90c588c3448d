"""Families of functions of what the driver saw and did, none of them a cause of the catalogue: what the gate looks with.

A cause that nobody has thought of is still a function of something: of one input, freely bent; of two; of what was
seen long ago; of the driver's own motion; of where the output is and how fast it moves. Each family spans one of these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import K1, K2, TAU2, THETA2, delayed, lagged, parts, seen_late
from canid.diagnosis.solved import Solved
from canid.effects.cause import Seen
from canid.findings import Flags
from canid.types import Array

# standard deviations; beyond, a power of an input is a few samples
OUTLYING = 4.0
# knots of a free curve of one input, of the output, and of time: a bend between two of them is seen by both
KNOTS, OUTPUT_KNOTS, TIME_KNOTS = 8, 14, 8
# s per knot of a level that wanders along the drive, and how many at least and at most
LEVEL, LEVEL_KNOTS = 45.0, (5, 24)
# quantiles between which the knots of a free curve lie
ENDS = (0.02, 0.98)
# s; what is remembered of an input: longer than any lag of the model, up to what drivers forget within
MEMORIES = (3.0, 10.0, 30.0)
# s over which the own speed's change is felt, and of which it becomes a habit
FELT, HABITS = (0.6, 1.5, 4.0), (8.0, 25.0, 70.0)
# s in which turmoil calms down
CALM = (5.0, 25.0)
# standard deviations at which an answer may switch over
SWITCHES = (0.3, 0.7, 1.2)
# quantiles of the looming and of the output's rate at which a bend or a limit may lie
LOOMINGS, RATES = (0.35, 0.6, 0.8), (0.6, 0.8, 0.93)
# s; a foot that is slower one way than the other
UNEVEN = 0.5
# m/s²; how hard a lead brakes at least that frightens, and s in which that fades
BRAKING, FADES = (0.3, 0.8), 1.5
# m/s; a speed in a denominator is not below that
SLOWEST = 3.0
# the family that follows anything slow
LEVEL_FAMILY = "level"


OWN_MOTION = ("felt", "habit")


class Shapes(NamedTuple):
    """One family."""

    name: str
    says: str  # what the residual would hold
    columns: Array  # (n, k)
    in_time: bool = False  # functions of time itself among them


def shapes(data: DriverData, solved: Solved) -> list[Shapes]:
    """Lay out every family along a drive.

    Args:
        data: what is explained.
        solved: the model whose residual is looked at; its dead times and lags are used, its causes are not.
    """
    dt, q = data.output.dt, solved.q
    fine = solved.rows & ~data.output.hidden
    acted = parts(solved.model._replace(effects=(), where=()), data, q)
    late = seen_late(data, float(q[THETA2]))
    gap = np.maximum(late.gap, 1.0)

    def standard(x: Array) -> Array:
        return _standard(x, fine)

    def through(*columns: Array) -> Array:
        return _through(float(q[TAU2]), dt, *columns)

    e, w = standard(acted.e), standard(acted.w)
    v, a, g, t = (standard(x) for x in (late.speed, late.lead_accel, np.log(gap), data.seen.t))
    both = standard(float(q[K1]) * acted.e + float(q[K2]) * acted.w)
    bends = [np.maximum(np.abs(w) - k, 0.0) * np.sign(w) for k in (0.5, 1.2, 2.0)]
    turmoil = [standard(lagged(np.abs(acted.w), s, dt)) for s in CALM]
    along = hats(data.seen.t, fine, TIME_KNOTS)
    knots = int(np.clip(data.seen.drive / LEVEL, *LEVEL_KNOTS))
    # fmt: off
    told = [
        Shapes("range_rate curve", "a bend in the answer to relative speed",
               through(w * w, np.abs(w), w**3, w * np.abs(w), *bends)),
        Shapes("range_rate freely", "an answer to relative speed of another form", through(hats(w, fine, KNOTS))),
        Shapes("headway curve", "a bend in the answer to headway",
               through(e * e, np.abs(e), e**3, e * np.abs(e), np.sign(e))),
        Shapes("headway freely", "an answer to headway of another form", through(hats(e, fine, KNOTS))),
        Shapes("range_rate by gap", "an answer to relative speed that depends on the gap or the speed",
               through(w * g, w * g * g, w * v, w * v * v, np.abs(w) * g, w * np.abs(w) * g)),
        Shapes("looming", "a bend in the answer to how fast the lead grows", through(*_looming(acted.w, gap, fine))),
        Shapes("headway by speed", "an answer to headway that depends on the speed or the gap",
               through(e * v, e * v * v, e * g, v, v * v, v**3, g, g * g, acted.w / np.maximum(late.speed, SLOWEST))),
        Shapes("speed", "an answer to the own speed", through(hats(late.speed, fine, KNOTS))),
        Shapes("both", "an answer to headway that depends on relative speed",
               through(e * w, e * np.abs(w), e * e * w, e * w * w)),
        Shapes("delays", "answers that come later than one dead time",
               through(*(delayed(x, s, dt) for x, s in ((e, 1.0), (w, 1.0), (e, 3.0), (w, 2.5))))),
        Shapes("headway long ago", "an answer to the headway of long ago",
               np.stack([lagged(e, s, dt) for s in MEMORIES], axis=1)),
        Shapes("range_rate long ago", "an answer to the relative speed of long ago",
               np.stack([lagged(w, s, dt) for s in MEMORIES], axis=1)),
        Shapes("felt", "an answer to the own acceleration",
               through(*(standard(late.speed - delayed(late.speed, s, dt)) for s in FELT))),
        Shapes("habit", "an answer to the speed that was driven before",
               through(*(standard(late.speed - lagged(late.speed, s, dt)) for s in HABITS))),
        Shapes("turmoil", "answers that depend on how restless the traffic was",
               through(*(x * u for x in (w, e, both) for u in turmoil))),
        Shapes("switched", "an answer that switches over and stays",
               through(*(_switched(w, k) for k in SWITCHES), _switched(e, 0.5))),
        Shapes("lead", "an answer to the lead's acceleration",
               through(a, np.abs(a), a**3, *(standard(x) for x in _fright(late, dt)))),
        Shapes("time", "answers that change along the drive",
               np.c_[through(t * w, t * e, t * t * w, t * t * e), t, t * t, t**3], in_time=True),
        Shapes("both answers", "two answers that change together, along the drive, with the gap or the speed",
               through(both * t, both * t * t, both * t**3, both * np.sign(t), both * g, both * v), in_time=True),
        Shapes("both answers in time", "two answers that change together at some time", through(both[:, None] * along),
               in_time=True),
        Shapes("range_rate in time", "an answer to relative speed that changes at some time",
               through(w[:, None] * along), in_time=True),
        Shapes("headway in time", "an answer to headway that changes at some time", through(e[:, None] * along),
               in_time=True),
        Shapes(LEVEL_FAMILY, "a level that wanders along the drive", hats(data.seen.t, fine, knots), in_time=True),
        *_of_output(solved.fitted.model, fine, dt),
    ]
    # fmt: on
    # where the output is the car's own acceleration, that is no input to it
    return told if data.pedal else [one for one in told if one.name not in OWN_MOTION]


def answers(data: DriverData, solved: Solved) -> dict[str, Array]:
    """What the driver answers, through his lag, and how fast the output should move: name -> (n,)."""
    fine = solved.rows & ~data.output.hidden
    acted = parts(solved.model._replace(effects=(), where=()), data, solved.q)
    late = _through(float(solved.q[TAU2]), data.output.dt, _standard(acted.w, fine), _standard(acted.e, fine))
    slope = _standard(np.gradient(solved.fitted.model, data.output.dt), fine)
    return {"relative speed": late[:, 0], "headway": late[:, 1], "slope": slope}


def _of_output(model: Array, fine: Flags, dt: float) -> list[Shapes]:
    """What becomes of an output on its way: curves of it, of its rate, and what a limited rate leaves behind."""
    y, r = _standard(model, fine), _standard(np.gradient(model, dt), fine)
    r5 = delayed(r, 0.5, dt)
    fast = np.quantile(np.abs(np.gradient(model, dt))[fine], RATES) * dt
    behind = [_limited(model, float(most)) for most in fast] + [
        _uneven(model, side, dt) for side in (1.0, -1.0)
    ]
    return [
        Shapes("output", "an output that bends at its ends",
               np.stack([y * y, y**3, np.maximum(y - 1, 0), np.minimum(y + 1, 0)], axis=1)),
        Shapes("output freely", "an output with steps or bends", hats(model, fine, OUTPUT_KNOTS)),
        Shapes("output rate", "an output that follows unevenly: later one way than the other, or no faster than so much",
               np.stack([np.abs(r), r * np.abs(r), r**3, np.abs(r5), r5 * np.abs(r5)], axis=1)),
        Shapes("output behind", "an output that moves no faster than so much, or later one way than the other",
               np.stack([_standard(x - model, fine) for x in behind], axis=1)),
    ]  # fmt: skip


def hats(x: Array, fine: Flags, knots: int) -> Array:
    """Span the free curves of x: straight lines between knots at its quantiles, (n, knots); too few values: (n, 0).

    Example:
        >>> hats(np.array([0.0, 0.5, 2.0]), np.ones(3, dtype=bool), 3).sum(axis=1)
        array([1., 1., 1.])
    """
    at = np.unique(np.quantile(x[fine], np.linspace(*ENDS, knots)))
    if at.size < 3:
        return np.zeros((x.size, 0))
    return np.stack([np.interp(x, at, row) for row in np.eye(at.size)], axis=1)


def _standard(x: Array, fine: Flags) -> Array:
    scaled = (x - np.mean(x[fine])) / max(float(np.std(x[fine])), 1e-9)
    return np.asarray(np.clip(scaled, -OUTLYING, OUTLYING))


def _through(tau: float, dt: float, *columns: Array) -> Array:
    """Columns (n,) and (n, k), side by side, each through the lag."""
    beside = np.column_stack(columns)
    return np.column_stack([lagged(c, tau, dt) for c in beside.T]) if beside.shape[1] else beside


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
    """Follow x by no more than so much a sample.

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
    """Follow x through a lag of UNEVEN on its way up (side 1) or down (−1), and at once the other way.

    Example:
        >>> _uneven(np.array([0.0, 1.0, 0.0]), 1.0, UNEVEN)
        array([0. , 0.5, 0. ])
    """
    y, out, part = float(x[0]), [], dt / (UNEVEN + dt)
    for wanted in x.tolist():
        y += (wanted - y) * (part if side * (wanted - y) > 0.0 else 1.0)
        out.append(y)
    return np.array(out)


def _looming(rate: Array, gap: Array, fine: Flags) -> list[Array]:
    """Relative speed beyond a threshold of looming, which grows with the gap's square; (n,) each."""
    looming = rate / gap**2
    at = np.quantile(np.abs(looming[fine]), LOOMINGS)
    return [_standard(np.maximum(np.abs(looming) - k, 0.0) * np.sign(looming) * gap**2, fine) for k in at]


def _fright(late: Seen, dt: float) -> list[Array]:
    """A lead that brakes harder than so much, fading; (n,) each."""
    return [lagged(np.maximum(-late.lead_accel - k, 0.0), FADES, dt) for k in BRAKING]
