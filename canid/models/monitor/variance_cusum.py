"""CUSUM of e-values on squared innovations: evidence that their variance has grown.

1 + λ (x/r − 1) with x = e²/variance is an e-value while the mean of x is r or less: its expectation is at most 1
(Waudby-Smith & Ramdas 2024, "Estimating means of bounded random variables by betting", sec. 3: only x ≥ 0 is needed
for this side). r is wide: noise that grows with the driver's response is no misfit.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from canid.models.monitor.evalue_cusum import MAX_EXCESS
from canid.values.state_constraints import FINITE
from canid.values.types import NAN, Array

# times the learnt variance; a standard deviation of up to three times that of the last minutes still fits
ALLOWED_VARIANCE_RATIO = 9.0
# no square counts for more, in units of the allowed variance: 3 s of the largest are needed, one jolt is no change
MAX_SQUARE = 4.0
STAKES = np.array([0.1, 0.5])


class State(NamedTuple):
    """Evidence per stake, both (stakes,)."""

    level: Annotated[Array, FINITE]  # log of the CUSUM
    since: Array  # s, when it last restarted


def init() -> State:
    """Start without evidence."""
    return State(np.zeros(len(STAKES)), np.full(len(STAKES), NAN))


def step(state: State, t: float, e: Array, variance: Array | float, threshold: float) -> State:
    """Add the innovations e (n,) of one batch that begins at t [s], given the expected variance of each.

    Example:
        >>> state = init()
        >>> for k in range(20):
        ...     state = step(state, float(k), np.full(5, 7.0 if k >= 10 else 1.0), 1.0, 14.0)
        >>> bool(state.level.max() > 14), float(state.since[state.level.argmax()])
        (True, 10.0)
    """
    bounded = np.minimum(e * e / (ALLOWED_VARIANCE_RATIO * variance), MAX_SQUARE)
    gained = np.log1p(STAKES * (bounded - 1.0)[:, None]).sum(axis=0)
    restart = state.level <= 0.0
    return State(
        np.minimum(np.where(restart, 0.0, state.level) + gained, threshold + MAX_EXCESS),
        np.where(restart, t, state.since),
    )
