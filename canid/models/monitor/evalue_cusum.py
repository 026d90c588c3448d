"""CUSUM of e-values: evidence that a directed misfit has begun, without a model of the noise.

An innovation e that is not predictable from the past, and whose sign is as likely + as −, makes

    exp(λ d − λ² d²/2),   d = w ψ(e),   ψ odd and rising,

an e-value (expectation at most 1), however the scale of e changes with time or state (de la Peña 1999, lemma 6.1); the
weight w is known before e. A product of e-values that restarts whenever it falls below 1 is an e-detector (Shin, Ramdas
& Rinaldo 2024, "E-detectors", def. 2.2, prop. 2.3): the mean time between its false alarms is at least the threshold,
in batches. K of them in parallel need K times the threshold.

A margin widens the null hypothesis: a model that is off by no more than is allowed still fits. With m ≥ 0 the rest of
the margin, the e-value is formed of ψ(e − m). It stays one: for e = ±a, f(x) = exp(x − x²/2), p = ψ(a − m) and
−q = ψ(−a − m) we have q ≥ |p|, and f(p) + f(−q) ≤ 2: f rises up to 1, so for p ≤ 1 it is at most
f(|p|) + f(−|p|) = 2 exp(−p²/2) cosh p ≤ 2, and for p > 1 at most f(1) + f(−1) < 2.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from canid.values.state_constraints import FINITE
from canid.values.types import NAN, Array

# λ; each is best where ρ z is that many standard deviations beyond the margin, w included
STAKES = np.array([0.1, 0.3, 1.0])
_SIGNS = np.array([-1.0, 1.0])

# log; how far above the threshold evidence may rise: e^3 more than needed, so that it ends soon after its cause
MAX_EXCESS = 3.0
# standard deviations; ψ is straight up to here and flat beyond: of normal innovations 1 in 370 is larger
MAX_INNOVATION_SD = 3.0


class State(NamedTuple):
    """Evidence per direction, sign and stake; all (d, 2, stakes)."""

    level: Annotated[Array, FINITE]  # log of the CUSUM
    since: Array  # s, when it last restarted


class Evidence(NamedTuple):
    """The strongest evidence."""

    level: float  # log
    direction: int
    since: float  # s
    more: bool  # e = ρ z with ρ > 0


def init(directions: int) -> State:
    """Start without evidence."""
    shape = (directions, len(_SIGNS), len(STAKES))
    return State(np.zeros(shape), np.full(shape, NAN))


def step(
    state: State,
    t: float,
    e: Array,
    z: Array,
    variance: float,
    allowed: Array,
    threshold: float,
) -> State:
    """Add the innovations of one batch.

    Args:
        state: from `init` or the step before.
        t: s, when the data of this batch begin.
        e: (n,) innovations.
        z: (n, d) what a misfit of ρ = 1 in each direction would add to them; known before them.
        variance: of e, approximately: it only sets what the stakes are best at.
        allowed: (n, d) standard deviations by which the model may be off towards z and still fit.
        threshold: log.

    Example:
        >>> rng = np.random.default_rng(1)
        >>> state = init(1)
        >>> for k in range(60):
        ...     z = rng.standard_normal((5, 1))
        ...     noise = rng.standard_normal(5)
        ...     e = noise - (0.8 * z[:, 0] if k >= 30 else 0.0)
        ...     state = step(state, float(k), e, z, 1.0, 0.2 * np.abs(z), 14.0)
        >>> evidence = strongest(state)
        >>> evidence.level > 14, 25 < evidence.since < 35, evidence.more
        (True, True, False)
    """
    sd = variance**0.5
    size = np.abs(z) / sd
    standardised = e / sd
    towards = _SIGNS[:, None] * (np.sign(z) * standardised[:, None])[:, :, None, None]  # (n, d, 2, 1)
    beyond = np.clip(towards - allowed[:, :, None, None], -MAX_INNOVATION_SD, MAX_INNOVATION_SD)
    # w = |z|/sd is best where the misfit is small; where it is large, a stake of more than everything loses
    d = STAKES * np.minimum(size, 1.0)[:, :, None, None] * beyond
    gained: Array = (d - 0.5 * d * d).sum(axis=0)
    restart = state.level <= 0.0
    return State(
        np.minimum(np.where(restart, 0.0, state.level) + gained, threshold + MAX_EXCESS),
        np.where(restart, t, state.since),
    )


def strongest(state: State) -> Evidence:
    """Return the strongest evidence."""
    at = np.unravel_index(int(np.argmax(state.level)), state.level.shape)
    return Evidence(float(state.level[at]), int(at[0]), float(state.since[at]), bool(_SIGNS[at[1]] > 0.0))
