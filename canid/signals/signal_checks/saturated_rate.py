"""A range rate that is no straight line of the gap's change: it saturates without a limit that shows, or bends near 0.

Second by second the change of the gap less the integral of the range rate (mean_difference.py) is noise, or a line over the
range rate where a scale is wrong. At the outermost range rates of a side it leaves that line outwards only where the range
rate says too little: what noise, a lag or rounding do to an extreme makes it too large. Their mean must be outside what the
middle scatters by, without the stay that shows most as well.

Nor may it bend near 0, where a dead zone, a sign that is lost or rounding towards 0 change what is small: a term of the
regression that levels off beyond small range rates, odd or even (linearity test; Ramsey 1969). Of a noisy range rate the
odd one is negative, as the noise is larger against what is small (errors in variables).
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
SATURATED, NONLINEAR = f"{RATE}_saturated", f"{RATE}_nonlinear"
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
# terms of a bend near 0: quantiles of the size of the range rate, up to which they go, and whether they are odd; the last
# shows a sign that is lost up to 0.5 m/s where range rates are small
BEND_TERMS = ((0.25, True), (0.25, False), (0.5, True), (0.5, False), (0.75, False))
# what a bend has of the standard deviation of the range rate at least: without one 0.7 % at most (6 drives, noise up to
# three times the usual), and where numbers no longer held from 1.1 % on: dead zones of 0.1 and 0.25 m/s, rounding towards
# 0, lost signs. Five terms are judged again and again, and what was found stays: where numbers did not hold they were 9
# standard deviations or more; without a bend the last one is 2.6 at most (72 drives)
MIN_BEND, BEND_SIGMAS = 0.01, 5.0
# of the size up to which a term goes, the rest that a line must leave of it
MIN_TERM = 0.05
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
            return Found(SATURATED, (RATE,), state.begin, says, remedy)
    bent = bend(rate, more)
    if bent is None:
        return None
    says = (
        f"range rate bends near 0: below {bent.below:.2g} m/s it departs from the change of the gap, by {bent.size:.2g} m/s "
        f"rms more than a line ({100 * bent.share:.0f} % of its movement)"
    )
    remedy = "it has a dead zone, loses its sign or is rounded towards 0: map the signal as it was measured"
    return Found(NONLINEAR, (RATE,), state.begin, says, remedy)


class Bend(NamedTuple):
    """What the range rate lacks near 0, beyond a line."""

    below: float  # m/s
    size: float  # m/s, rms
    share: float  # of the standard deviation of the range rate


def bend(rate: Array, more: Array) -> Bend | None:
    """How the range rate bends near 0 against the change of the gap; None: not for certain.

    Args:
        rate: (n,) m/s.
        more: (n,) m/s, by which the gap changes more than `rate` says.

    Example:
        >>> t, rng = np.arange(600.0), np.random.default_rng(1)
        >>> rate, noise = np.sin(0.3 * t) + 0.3 * np.sin(0.07 * t), 0.05 * rng.standard_normal(600)
        >>> zone = rate - np.clip(rate, -0.1, 0.1)
        >>> bend(rate, noise), bend(zone, rate - zone + noise).size > 0.02
        (None, True)
    """
    n, moved = len(rate) - len(rate) % CLUSTER, float(np.std(rate))
    line = np.stack([np.ones(n), rate[:n]], axis=1)
    if n < CLUSTER * MIN_CLUSTERS or not moved > 0.0:
        return None
    for quantile, odd in BEND_TERMS:
        below = float(np.quantile(np.abs(rate), quantile))
        term = np.clip(rate[:n], -below, below) if odd else np.minimum(np.abs(rate[:n]), below)
        given = np.stack([term, more[:n]], axis=1)
        x, y = (given - line @ np.linalg.lstsq(line, given)[0]).T
        square = float(x @ x)
        if not square > (MIN_TERM * below) ** 2 * n:
            continue
        slope = float(x @ y) / square
        of_cluster = (x * (y - slope * x)).reshape(-1, CLUSTER).sum(axis=1)
        sd = math.sqrt(float(of_cluster @ of_cluster)) / square
        size = (slope if odd else abs(slope)) * math.sqrt(square / n)
        if (
            size > MIN_BEND * moved
            and abs(slope) > student_half_width(len(of_cluster) - 3.0, BEND_SIGMAS) * sd
        ):
            return Bend(below, size, size / moved)
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
