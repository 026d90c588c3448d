"""Delay of a rate against the quantity that it is the rate of, by least squares.

With block means g of the quantity and r of its rate, g2 - g1 is a weighted integral of the rate (mean_difference.py). Of a
rate that comes δ late that integral is δ (r2 - r1) too small, of a quantity that comes late so much too large:

    (g2 - g1) - ∫ rate = δ (r2 - r1) + noise

The noise of the rate's own reports is in both with opposite weights, which cancel, so δ is unbiased where it is 0. Its
variance is that of clusters of five seconds (Liang & Zeger 1986): real gaps depart from their range rate for seconds. Few
clusters hold most of the movement, so intervals are those of Student's t; a lag of first order counts with its mean delay,
which is dt a / (1 - a), a = exp(-dt / lag), of a filter that runs at the samples: 0.058 s of a lag of 0.1 s at 10 Hz.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Annotated, NamedTuple

from canid.mathematics.identification.confidence import NORMAL_QUANTILE, student_half_width
from canid.signals.signal_checks.blocks import ACCEL, BLOCK_S, GAP, RANGE_RATE, SPEED, Block
from canid.signals.signal_checks.check import Check, Found
from canid.signals.signal_checks.mean_difference import integrals
from canid.values.state_constraints import TIME
from canid.values.text.names import readable
from canid.values.types import NAN

# pairs of seconds in a cluster: a radar's point moves on the car ahead within seconds
CLUSTER_PAIRS = 5
# clusters over which the sums forget, ten minutes, and clusters that are needed, two minutes: a delay is the sensor's
MEMORY_CLUSTERS, NEEDED_CLUSTERS = 120, 24
# standard deviations of a normal interval, as of the other checks: outside which 2 of 10,000 are
SIGMAS = 3.7
# s; what the interval must exceed. A standard deviation of 0.05 s is the largest with which a dead time is quoted
# (mathematics/identification/identifiability.py). On drives of two simulators a gap that is δ = 0.05 s late moved dead
# times by 0.8 δ (6 drives); a range rate, to which the own speed is then added at the wrong time before the lead's is
# smoothed, by 1.6 δ on average (18 drives, 0.2 to 6 δ). A bias of half a standard deviation costs 95 % intervals 3 %
MAX_DELAY_S, MAX_RANGE_RATE_DELAY_S = 0.02, 0.01
# s; a quantity or a rate that is later than this moves gains as well. Of a gap K of range rate came out 5 % too large with
# 0.4 s, 1 % with 0.2 s; of a range rate 14 of 14 gains held with 0.4 s, K of headway error was 18 % too large with 0.8 s
MAX_QUANTITY_DELAY_S, MAX_RATE_DELAY_S = 0.25, 0.5
# s; a delay of more is a disagreement that other checks name
LONGEST_S = 1.5
# s; with a smaller standard deviation the quantity is computed of the rate, not measured. Of a simulation by Euler's rule
# (gap + step x rate, of either end) it is half a step late or early, which its driver knows nothing of; its signals come
# every 0.2 s at most, or they are slow. Steps of 1 cm and 1 cm/s give 0.0003 s, noise of 1 cm and 1 cm/s 0.0006 to 0.0009 s
COMPUTED_SD_S, HALF_STEP_S = 4e-4, 0.1


class Pair(NamedTuple):
    """A quantity and its rate, as columns of a block."""

    quantity: int
    rate: int
    names: tuple[str, str]
    roles: tuple[str, ...]  # that a finding concerns: the speed is compared with more than an acceleration
    max_rate_delay: float = MAX_DELAY_S  # s, what the interval of a rate that is late must exceed


class Mean(NamedTuple):
    """Of the block before."""

    quantity: float = NAN
    rate: float = NAN
    rise: float = 0.0  # integral of the rate with the weight that rises


class State(NamedTuple):
    """Sums of x = r2 - r1 and e, the left side, over a cluster, and over clusters."""

    last: Mean = Mean()
    pairs: int = 0  # in the cluster that is being filled
    a: float = 0.0  # its sum of x e
    b: float = 0.0  # its sum of x²
    clusters: float = 0.0
    sums: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)  # of a, b, a², a b, b²
    begin: Annotated[float, TIME] = NAN  # s, of the first pair
    found: Found | None = None


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(pair: Pair, state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    quantity, rate = block.mean[pair.quantity], block.mean[pair.rate]
    if not (block.follows and quantity == quantity and rate == rate):
        return state._replace(last=Mean()) if state.last != Mean() else state, state.found
    rise, fall = integrals(block.values[:, pair.rate], block.dt)
    before = state.last
    state = state._replace(last=Mean(quantity, rate, rise))
    if not (block.joined and before.quantity == before.quantity):
        return state, state.found
    x, e = rate - before.rate, quantity - before.quantity - (before.rise + fall)
    state = state._replace(
        pairs=state.pairs + 1,
        a=state.a + x * e,
        b=state.b + x * x,
        begin=state.begin if state.begin == state.begin else max(block.t - 2.0 * BLOCK_S, 0.0),
    )
    if state.pairs == CLUSTER_PAIRS:
        a, b, keep = state.a, state.b, 1.0 - 1.0 / MEMORY_CLUSTERS
        of_a, of_b, aa, ab, bb = (keep * old for old in state.sums)
        sums = of_a + a, of_b + b, aa + a * a, ab + a * b, bb + b * b
        state = State(state.last, 0, 0.0, 0.0, keep * state.clusters + 1.0, sums, state.begin, state.found)
        if state.clusters >= NEEDED_CLUSTERS:
            state = state._replace(found=_judged(pair, state))
    return state, state.found


def delay(state: State) -> tuple[float, float]:
    """Return the delay of the rate and its standard deviation, s; NaN: nothing has moved."""
    a, b, aa, ab, bb = state.sums
    if not b > 0.0:
        return NAN, NAN
    value = a / b
    return value, math.sqrt(max(aa - 2.0 * value * ab + value * value * bb, 0.0)) / b


def interval_sigmas(state: State, normal: float) -> float:
    """Half width of an interval in standard deviations, by Student's t.

    Its degrees of freedom are those of a weighted mean (Satterthwaite 1946): where all clusters move alike, their number
    less 1. On 7 kinds of 2,500 drives of 8 min without a delay, with most movement in 4 clusters or in all, 0 to 0.12 % had
    an interval that left 0 out at some time, with 3.7 standard deviations of a normal distribution 0.2 to 5 %.

    Args:
        state: of the check.
        normal: the same half width for a normal distribution.

    Returns:
        Infinite where too few clusters hold the movement.

    Example:
        >>> alike = init()._replace(sums=(0.0, 120.0, 0.0, 0.0, 120.0))
        >>> round(interval_sigmas(alike, 2.0), 2), round(interval_sigmas(alike, 3.7), 2)
        (2.02, 3.82)
    """
    _, b, _, _, bb = state.sums
    freedom = b * b / bb - 1.0 if bb > 0.0 else 0.0
    return student_half_width(freedom, normal)


def _judged(pair: Pair, state: State) -> Found | None:
    value, sd = delay(state)
    size = abs(value)
    limit = pair.max_rate_delay if value > 0.0 else MAX_DELAY_S
    if not (size - interval_sigmas(state, SIGMAS) * sd > limit and size < LONGEST_S):
        return None
    if sd < COMPUTED_SD_S and size < 1.01 * HALF_STEP_S:
        return None
    late, other = (pair.names[1], pair.names[0]) if value > 0.0 else pair.names
    wide = interval_sigmas(state, NORMAL_QUANTILE) * sd
    gains_hold = size <= (MAX_RATE_DELAY_S if value > 0.0 else MAX_QUANTITY_DELAY_S)
    numbers = f"{size:.2f} s [{size - wide:.2f}, {size + wide:.2f}]"
    says = f"{readable(late)} is {numbers} behind {readable(other)}"
    remedy = "delays are wrong by as much or more: map an unfiltered signal"
    return Found(f"{late}_late", pair.roles, state.begin, says, remedy, delays_only=gains_hold)


CHECKS = (
    Check(
        "delayed_range_rate",
        init,
        partial(
            step,
            Pair(GAP, RANGE_RATE, ("gap", "range_rate"), ("gap", "range_rate"), MAX_RANGE_RATE_DELAY_S),
        ),
    ),
    Check("delayed_acceleration", init, partial(step, Pair(SPEED, ACCEL, ("speed", "accel"), ("accel",)))),
)
