"""Evidence that innovations have become larger than ever: a CUSUM of bets on their squares.

1 + λ (x/r − 1) with x = e²/variance is a bet that nobody wins on average while the mean of x is r or less (Waudby-Smith
& Ramdas 2024, "Estimating means of bounded random variables by betting", sec. 3: only x ≥ 0 is needed for this side).
r is wide: a driver's noise that grows with his answers is no misfit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.screening.evidence import BEYOND
from canid.types import NAN, Array

# times the learnt variance; a standard deviation of up to three times that of the last minutes still fits
GROWN = 9.0
# no square counts for more, in times GROWN: 3 s of the largest are needed, one jolt is no new scatter
_JOLT = 4.0
STAKES = np.array([0.1, 0.5])


class State(NamedTuple):
    """Evidence per stake, both (stakes,)."""

    level: Array  # log of the CUSUM
    since: Array  # s, when it last began anew


def init() -> State:
    """Start without evidence."""
    return State(np.zeros(len(STAKES)), np.full(len(STAKES), NAN))


def step(state: State, t: float, e: Array, variance: Array | float, threshold: float) -> State:
    """Take one look's innovations e (n,), which begin at t [s], and the variance that is expected of each.

    Example:
        >>> state = init()
        >>> for k in range(20):
        ...     state = step(state, float(k), np.full(5, 7.0 if k >= 10 else 1.0), 1.0, 14.0)
        >>> bool(state.level.max() > 14), float(state.since[state.level.argmax()])
        (True, 10.0)
    """
    bounded = np.minimum(e * e / (GROWN * variance), _JOLT)
    gained = np.log1p(STAKES * (bounded - 1.0)[:, None]).sum(axis=0)
    anew = state.level <= 0.0
    return State(
        np.minimum(np.where(anew, 0.0, state.level) + gained, threshold + BEYOND),
        np.where(anew, t, state.since),
    )
