"""A range rate that saturates without a limit that its readings show, coarse or filtered behind it: the gap passes it.

Second by second the change of the gap less the integral of the range rate (mean_difference.py) is noise, or a line over the
range rate where a scale is wrong. At the outermost range rates of a side it leaves that line outwards only where the range
rate says too little: what noise, a lag or rounding do to an extreme makes it too large. Their mean must be outside what the
middle scatters by, without the stay that shows most as well.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE, student_half_width
from canid.signals.signal_checks.blocks import BLOCK_S, GAP, RANGE_RATE, Block
from canid.signals.signal_checks.check import Check, Found
from canid.signals.signal_checks.mean_difference import integrals
from canid.values.state_constraints import TIME
from canid.values.types import NAN, Array, Interval

RATE = "range_rate"
# seconds that are kept, ten minutes; after so many more they are judged again, from two minutes on
KEPT, JUDGED_EVERY, MIN_SECONDS = 600, 10, 120
# share of the seconds that are the outermost of a side, and of those on either side that are not of the middle, which the
# line is fitted to
OUTERMOST_SHARE, MIDDLE_FROM = 0.05, 0.2
# seconds in a cluster, as of the check of delays, and clusters that a variance needs
CLUSTER, MIN_CLUSTERS = 5, 12
# stays that the outermost must be in: one of them decides nothing
MIN_STAYS = 4
# standard deviations of a normal interval, as of the other checks: outside which 2 of 10,000 are
SIGMAS = 3.7
# of the outermost range rate from the mean, what is missing of it at least: scales of radars are good to a few per cent
MIN_EXCESS = 0.05
# of a step, the standard deviation of what rounding to it does
ROUNDING_SD = 12.0**-0.5


class State(NamedTuple):
    """Seconds of following."""

    gap: float = NAN  # m, mean of the block before; NaN: nothing to go on from
    rise: float = 0.0  # m, integral of its range rate with the weight that rises
    begin: Annotated[float, TIME] = NAN  # s, of the first second of the drive
    seconds: tuple[
        tuple[float, float, float], ...
    ] = ()  # s, range rate in m/s, what the gap changes more in m/s
    fresh: int = 0  # of them, since they were judged
    step: float = 0.0  # m/s, of the latest readings; 0: on no lattice
    found: Found | None = None


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    if block.limited:
        # what stood there was a limit, and is left out from now on
        state = State(begin=state.begin, step=state.step)
    for span in block.spans:
        if span.role == RATE and span.kind == "points":
            state = state._replace(step=span.step)
    mean = block.mean[GAP]
    # a coarse range rate at its limit has no slope that would show it (limited_values.py): the gap does
    if not ((block.follows or block.at_end) and mean == mean):
        return (state._replace(gap=NAN) if state.gap == state.gap else state), state.found
    rise, fall = integrals(block.values[:, RANGE_RATE], block.dt)
    if block.joined and state.gap == state.gap:
        rate = state.rise + fall
        begin = state.begin if state.begin == state.begin else max(block.t - 2.0 * BLOCK_S, 0.0)
        now = (block.t, rate / BLOCK_S, (mean - state.gap - rate) / BLOCK_S)
        state = state._replace(begin=begin, seconds=(*state.seconds, now)[-KEPT:], fresh=state.fresh + 1)
        if state.fresh >= JUDGED_EVERY and len(state.seconds) >= MIN_SECONDS:
            # it stays that of the sensor where the window does not show it any more
            state = state._replace(fresh=0, found=_judged(state) or state.found)
    return state._replace(gap=mean, rise=rise), state.found


def _judged(state: State) -> Found | None:
    """Judge both sides: what saturates does so in all of the drive."""
    t, rate, more = np.array(state.seconds).T
    for sign, side in ((1.0, "above"), (-1.0, "below")):
        excess = missing(t, sign * rate, sign * more)
        if excess is not None and excess.value > state.step * ROUNDING_SD:
            outermost = float(np.quantile(sign * rate, 1.0 - OUTERMOST_SHARE))
            says = (
                f"range rate saturates {side} {sign * outermost:.2g} m/s: there the gap changes by {excess.value:.2g} m/s "
                f"[{excess.low:.2g}, {excess.high:.2g}] more"
            )
            remedy = "it is limited, and coarse or filtered behind that: log it with a wider range"
            return Found("range_rate_saturated", (RATE,), state.begin, says, remedy)
    return None


def missing(t: Array, rate: Array, more: Array) -> Interval | None:
    """What the outermost range rates, the largest ones, miss of the gap's change on average; None: nothing for certain.

    Args:
        t: (n,) s, in order.
        rate: (n,) m/s.
        more: (n,) m/s, by which the gap changes more than `rate` says.

    Example:
        >>> t, rng = np.arange(600.0), np.random.default_rng(1)
        >>> rate = np.sin(0.3 * t) + 0.3 * np.sin(0.07 * t)
        >>> noise = 0.05 * rng.standard_normal(600)
        >>> print(missing(t, np.minimum(rate, 0.8), rate - np.minimum(rate, 0.8) + noise), missing(t, rate, noise))
        0.226 [0.212, 0.239] None
    """
    low, high, outermost = np.quantile(rate, (MIDDLE_FROM, 1.0 - MIDDLE_FROM, 1.0 - OUTERMOST_SHARE))
    inside, top = (rate > low) & (rate < high), rate >= outermost
    mean, clusters = float(rate[inside].mean()) if inside.any() else 0.0, int(inside.sum()) // CLUSTER
    x, y = rate[inside] - mean, more[inside]
    spread = float(x @ x)
    if clusters < MIN_CLUSTERS or not spread > 0.0:
        return None
    level, slope = float(y.mean()), float(x @ y) / spread
    left = more - level - slope * (rate - mean)
    # a real gap departs from its range rate for seconds
    of_cluster = left[inside][: clusters * CLUSTER].reshape(clusters, CLUSTER).mean(axis=1)
    variance = CLUSTER * float(of_cluster @ of_cluster) / clusters
    out = float(rate[top].mean()) - mean
    # a gap that is wrong itself, as a frozen one, bends the line, and changes less
    rows = np.flatnonzero(top)
    each = np.minimum(left, more)[rows]
    stay = np.concatenate([[0], np.cumsum(np.diff(t[rows]) > 1.5 * BLOCK_S)])
    total, length = np.bincount(stay, each), np.bincount(stay)
    most = int(np.argmax(total))
    if len(total) < MIN_STAYS:
        return None
    value, rest = float(each.mean()), (total.sum() - total[most]) / (len(rows) - length[most])
    sd = math.sqrt(variance * (1.0 / (len(rows) - length[most]) + 1.0 / inside.sum() + out * out / spread))
    if not rest > max(student_half_width(clusters - 2.0, SIGMAS) * sd, MIN_EXCESS * out):
        return None
    wide = student_half_width(clusters - 2.0, NORMAL_QUANTILE) * sd
    return Interval(value, value - wide, value + wide)


CHECK = Check("saturated_rate", init, step)
