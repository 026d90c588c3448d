"""ARMAX sample by sample: the recursive prediction-error method (Ljung & Söderström 1983, ch. 3.7).

Plain floats and tuples: at ten parameters numpy's call overhead would be most of the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.identification import polynomial, ud
from canid.identification.armax_batch import ArmaxFit, Orders
from canid.types import Array

# Zeros of C stay within: at 10 Hz a zero at 0.995 remembers for 20 s, longer than any movement lasts.
RADIUS = 0.995

# Samples of a block whose summed score is compared with that of white innovations: 2 s at 10 Hz.
BLOCK = 20

# The variance of a parameter may grow to this many times that of the batch start before forgetting pauses:
# enough to follow any driver, and never a covariance that means nothing.
GROWTH = 1e4


class State(NamedTuple):
    """What the next sample needs."""

    theta: tuple[float, ...]  # as ArmaxFit.theta
    factors: ud.UD  # of the covariance
    variance: float  # of the innovations
    y: tuple[float, ...]  # newest first
    u: tuple[tuple[float, ...], ...]  # per input, newest first
    e: tuple[float, ...]  # newest first
    psi: tuple[tuple[float, ...], ...]  # the last nc gradients, newest first
    most: float  # largest factor d allowed
    weights: tuple[float, float]  # sums of the weights and of their squares, in samples
    block: tuple[int, tuple[float, ...], tuple[float, ...]]  # samples, summed score, summed square gradient
    score: tuple[
        tuple[float, ...], tuple[float, ...]
    ]  # forgotten sums of block score squared; of square gradients


def begin(fit: ArmaxFit) -> State:
    """Go on from a batch fit; the lags fill again with the next samples."""
    n = len(fit.theta)
    factors = ud.factor(fit.covariance / fit.temper)
    information = np.diag(np.linalg.inv(fit.covariance / fit.temper))
    plain = tuple(float(x) for x in information)
    return rest(
        State(
            tuple(float(x) for x in fit.theta),
            factors,
            max(fit.sigma**2, 1e-12),
            (),
            (),
            (),
            (),
            GROWTH * max(factors.d),
            (float(fit.used), float(fit.used)),
            (0, (0.0,) * n, (0.0,) * n),
            (tuple(fit.temper * x for x in plain), plain),
        )
    )


def rest(state: State) -> State:
    """Forget the lags, keep the knowledge: after a gap."""
    return state._replace(y=(), u=(), e=(), psi=())


def step(
    state: State, o: Orders, output: float, inputs: Sequence[float], forgetting: float, learn: bool = True
) -> tuple[State, float]:
    """Take in one usable sample.

    Args:
        state: as left by the sample before.
        o: orders.
        output: finite.
        inputs: (m,) finite.
        forgetting: per sample, in (0, 1].
        learn: False: only the lags move on.

    Returns:
        The new state and the innovation; NaN while the lags fill.
    """
    keep = o.nb + o.nk - 1
    u_now = tuple([(x, *past) for x, past in zip(inputs, state.u or ((),) * len(inputs), strict=True)])
    u_next = tuple([past[:keep] if keep else () for past in u_now])
    y_next = (output, *state.y)[: max(o.na, 1)]
    if len(state.y) < o.na or len(u_now[0]) < o.nk + o.nb:
        zero = (0.0,) * len(state.theta)
        return state._replace(y=y_next, u=u_next, e=(0.0,) * o.nc, psi=(zero,) * o.nc), float("nan")

    theta = state.theta
    phi = [-x for x in state.y[: o.na]]
    for past in u_now:
        phi.extend(past[o.nk : o.nk + o.nb])
    phi.append(1.0)
    phi.extend(state.e)
    c = theta[len(theta) - o.nc :]
    psi = phi
    for ck, old in zip(c, state.psi, strict=True):
        psi = [x - ck * z for x, z in zip(psi, old, strict=True)]
    e = output
    for x, z in zip(theta, phi, strict=True):
        e -= x * z
    if not learn:
        moved = state._replace(
            y=y_next, u=u_next, e=(e, *state.e)[: o.nc], psi=(tuple(psi), *state.psi)[: o.nc]
        )
        return moved, e

    sd = state.variance**0.5
    scaled = [x / sd for x in psi]
    factors, gain = ud.update(state.factors, scaled, forgetting, state.most)
    size = e / sd
    new = [x + g * size for x, g in zip(theta, gain, strict=True)]
    # a step that would make 1/C unstable is shortened until it does not (Ljung & Söderström 1983, 6.6)
    for _ in range(6):
        if polynomial.is_stable(new[len(new) - o.nc :], RADIUS):
            break
        new = [0.5 * (x + z) for x, z in zip(new, theta, strict=True)]
    else:
        new = list(theta)
    after = output  # the residual with the new parameters is the better guess of the innovation
    for x, z in zip(new, phi, strict=True):
        after -= x * z
    w1, w2 = state.weights
    return (
        State(
            tuple(new),
            factors,
            max(forgetting * state.variance + (1.0 - forgetting) * e * after, 1e-12)
            if forgetting < 1.0
            else state.variance + (e * after - state.variance) / (w1 + 1.0),
            y_next,
            u_next,
            (after, *state.e)[: o.nc],
            (tuple(psi), *state.psi)[: o.nc],
            state.most,
            (forgetting * w1 + 1.0, forgetting * forgetting * w2 + 1.0),
            *_widening(state, scaled, size, forgetting),
        ),
        e,
    )


def _widening(
    state: State, psi: list[float], e: float, forgetting: float
) -> tuple[tuple[int, tuple[float, ...], tuple[float, ...]], tuple[tuple[float, ...], tuple[float, ...]]]:
    count, scores, squares = state.block
    total = [s + x * e for s, x in zip(scores, psi, strict=True)]
    power = [s + x * x for s, x in zip(squares, psi, strict=True)]
    if count + 1 < BLOCK:
        return (count + 1, tuple(total), tuple(power)), state.score
    fade = forgetting**BLOCK
    long_run = tuple([fade * s + x * x for s, x in zip(state.score[0], total, strict=True)])
    plain = tuple([fade * s + x for s, x in zip(state.score[1], power, strict=True)])
    zero = (0.0,) * len(psi)
    return (0, zero, zero), (long_run, plain)


def covariance(state: State) -> Array:
    """Return the (n, n) covariance of theta.

    P holds the information with exponential weights w; the estimate's variance is that with w squared (half
    of P in the long run), widened by how much colour the innovations kept, as residuals.left_over does for a
    batch.
    """
    w1, w2 = state.weights
    ratios = [a / b for a, b in zip(*state.score, strict=True) if b > 0.0]
    temper = max(1.0, sum(ratios) / len(ratios)) if ratios else 1.0
    out: Array = ud.matrix(state.factors) * (temper * w2 / w1)
    return out
