"""Delay of a rate against the quantity that it is the rate of, by least squares.

With block means g of the quantity and r of its rate, g2 - g1 is the integral of the rate under a triangle. Of a rate that
comes δ late that integral is δ (r2 - r1) too small, of a quantity that comes late so much too large:

    (g2 - g1) - ∫ rate = δ (r2 - r1) + noise

The noise of the rate's own reports is in both with opposite weights, which cancel, so δ is unbiased where it is 0. Its
variance is that of clusters of five seconds (Liang & Zeger 1986): real gaps depart from their range rate for seconds.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.signals.signal_checks.blocks import ACCEL, BLOCK_S, GAP, RANGE_RATE, SPEED, Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME
from canid.values.text.names import readable
from canid.values.types import NAN

# pairs of seconds in a cluster: a radar's point moves on the car ahead within seconds
CLUSTER_PAIRS = 5
# clusters over which the sums forget, ten minutes, and clusters that are needed, two minutes: a delay is the sensor's
MEMORY_CLUSTERS, NEEDED_CLUSTERS = 120, 24
# standard deviations of the interval, as of the other checks: outside which 2 of 10,000 are
SIGMAS = 3.7
# s; what the interval must exceed: dead times are quoted to 0.05 s (mathematics/identification/identifiability.py)
MAX_DELAY_S = 0.05
# s; a quantity or a rate that is later than this moves gains as well. Of a gap K of range rate came out 5 % too large with
# 0.4 s, 1 % with 0.2 s; of a range rate 14 of 14 gains held with 0.4 s, K of headway error was 18 % too large with 0.8 s
MAX_QUANTITY_DELAY_S, MAX_RATE_DELAY_S = 0.25, 0.5
# s; a delay of more is a disagreement that other checks name
LONGEST_S = 1.5


class Pair(NamedTuple):
    """A quantity and its rate, as columns of a block."""

    quantity: int
    rate: int
    names: tuple[str, str]
    roles: tuple[str, ...]  # that a finding concerns: the speed is compared with more than an acceleration


class Mean(NamedTuple):
    """Of the block before."""

    quantity: float = NAN
    rate: float = NAN
    rise: float = 0.0  # integral of the rate under the rising side of a triangle


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
    values = block.values[:, pair.rate]
    n = len(values)
    rise = float(values @ (np.arange(n) + 0.5)) / n * block.dt
    before = state.last
    state = state._replace(last=Mean(quantity, rate, rise))
    if not (block.joined and before.quantity == before.quantity):
        return state, state.found
    fall = rate * n * block.dt - rise
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


def _judged(pair: Pair, state: State) -> Found | None:
    value, sd = delay(state)
    size = abs(value)
    if not (size - SIGMAS * sd > MAX_DELAY_S and size < LONGEST_S):
        return None
    late, other = (pair.names[1], pair.names[0]) if value > 0.0 else pair.names
    wide = NORMAL_QUANTILE * sd
    gains_hold = size <= (MAX_RATE_DELAY_S if value > 0.0 else MAX_QUANTITY_DELAY_S)
    numbers = f"{size:.2f} s [{size - wide:.2f}, {size + wide:.2f}]"
    says = f"{readable(late)} is {numbers} behind {readable(other)}"
    remedy = "delays are wrong by up to as much: map an unfiltered signal"
    return Found(f"{late}_late", pair.roles, state.begin, says, remedy, delays_only=gains_hold)


CHECKS = (
    Check(
        "delayed_range_rate",
        init,
        partial(step, Pair(GAP, RANGE_RATE, ("gap", "range_rate"), ("gap", "range_rate"))),
    ),
    Check("delayed_acceleration", init, partial(step, Pair(SPEED, ACCEL, ("speed", "accel"), ("accel",)))),
)
