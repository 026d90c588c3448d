"""ARMAX sample by sample: recursive prediction errors (Ljung & Söderström 1983, ch. 3.7) at several memories.

Every array holds all memories at once, because a call of numpy costs as much for five as for one. Arrays are
float64, or float32 where `begin` is asked for it.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import innovation_law
from canid.mathematics.identification.armax import forgetting_mixture, polynomial, square_root_covariance
from canid.mathematics.identification.armax.armax_batch import ArmaxFit, Orders
from canid.mathematics.identification.armax.rates import STATED_S, rates
from canid.values.state_constraints import FINITE, NOT_NEGATIVE, POSITIVE
from canid.values.types import Array

# Per tenth of a second, ascending: memories of 5, 10, 20 and 50 s, and one that keeps everything.
FORGETTING = (0.98, 0.99, 0.995, 0.998, 1.0)

# Blocks over which the autocorrelation of the innovations is judged: 100 s.
WHITENESS_BLOCKS = 50

# Blocks after which the law of the innovations is fitted anew: 40 s; and those whose innovations it is fitted to: 60 s.
LAW_BLOCKS = 20
LAW_FITTED_BLOCKS = 30

# An innovation of more than three standard deviations (squared: 9) counts as three in the noise's variance: a
# jerk is no noise.
MAX_SQUARED_INNOVATION = 9.0

# A refuted memory begins anew with this many times the standard deviations of the memory it begins from: a
# quarter of that one's information, most of which is from after the change, but some from before.
RESTART_WIDENING = 2.0


class Noise(NamedTuple):
    """Variance of the innovations, each weighted by the information of its sample on the parameters.

    So weighted, twenty quiet minutes of cruise do not reduce the variance of the noise under which the rest was learnt.
    """

    power: Annotated[float, POSITIVE]  # sum of leverage times squared innovation
    leverage: Annotated[float, POSITIVE]  # sum of psi' P psi with the covariance P at the start
    recent: Annotated[float, NOT_NEGATIVE]  # variance over the last RECENT_S seconds

    @property
    def variance(self) -> float:
        """Of the innovations."""
        return self.power / self.leverage


class BlockSample(NamedTuple):
    """One sample of the present block."""

    psi: Array  # (k, 1, n), times the root of the sample's weight
    e: tuple[float, ...]  # (k,) innovations, likewise
    square: float  # of the innovation, weighted, in the mean the squared scale of the noise
    innovation: float  # as it is, of the mean of the memories


class State(NamedTuple):
    """What the next sample needs; k memories, the longest last, n parameters in the order of ArmaxFit."""

    forgetting: Array  # (k,) per sample
    theta: Array  # (k, 1, n)
    root: Array  # (k, n, n), S S' times the variance of the noise is the covariance
    y: tuple[float, ...]  # newest first
    u: tuple[tuple[float, ...], ...]  # per input, newest first
    e: Array  # (k, 1, nc) innovations, newest first
    psi: tuple[Array, ...]  # the last nc gradients (k, 1, n), newest first
    trust: forgetting_mixture.Trust
    noise: Noise
    block: tuple[BlockSample, ...]
    weights: Annotated[Array, POSITIVE]  # (2, k) sums of the samples' weights and of their squares
    score: Array  # (2, n) forgotten sums of squared block scores; of what white innovations would give
    anchor: Array  # (n, n) root of the longest memory when it began
    anchored: float  # samples that it knew then
    restarts: int  # times that the longest memory was refuted
    law: innovation_law.Law  # of the innovations
    innovations: Annotated[Array, FINITE]  # (n,) the last ones
    blocks: Annotated[int, NOT_NEGATIVE]


def begin(
    fit: ArmaxFit,
    forgetting: Sequence[float] = FORGETTING,
    dtype: npt.DTypeLike = np.float64,
    dt: float = STATED_S,
) -> State:
    """Go on from a batch fit, with the lags that it ended with.

    Args:
        fit: of the samples up to now.
        forgetting: per sample, one or more in (0, 1]; the largest must be the last.
        dtype: float64 or float32, of the recursion.
        dt: s, the grid's step.

    Raises:
        ValueError: the fit's covariance is not positive definite: not every parameter was excited.

    >>> rng = np.random.default_rng(0)
    >>> u, e, y = rng.normal(size=500), 0.1 * rng.normal(size=500), np.zeros(500)
    >>> for t in range(1, 500): y[t] = 0.8 * y[t-1] + 0.5 * u[t-1] + e[t] + 0.3 * e[t-1]
    >>> from canid.mathematics.identification.armax.armax_batch import fit_armax
    >>> o = Orders(1, 1, 1, 1)
    >>> state = begin(fit_armax(y[:150], u[:150, None], np.full(150, True), o))
    >>> for t in range(150, 500): state, _ = step(state, o, y[t], (u[t],))
    >>> [round(x, 1) + 0.0 for x in leading(state)]
    [-0.8, 0.5, 0.0, 0.3]
    """
    k, n, variance = len(forgetting), len(fit.theta), max(fit.law.sd**2, 1e-12)
    root = square_root_covariance.factor(fit.inverse_information).astype(dtype)
    information = np.diag(np.linalg.inv(fit.inverse_information)) * (variance / fit.law.inflation)
    innovations = fit.residual[np.isfinite(fit.residual)][-LAW_FITTED_BLOCKS * rates(dt).block :]
    lags = fit.lags
    return State(
        np.array(forgetting, dtype),
        np.tile(fit.theta, (k, 1, 1)).astype(dtype),
        np.tile(root, (k, 1, 1)),
        lags.y,
        lags.u,
        np.tile(np.array(lags.e, dtype), (k, 1, 1)),
        tuple([np.tile(np.array(psi, dtype), (k, 1, 1)) for psi in lags.psi]),
        forgetting_mixture.begin(forgetting, rates(dt).stated),
        Noise(n * variance, float(n), variance),
        (),
        np.full((2, k), float(fit.used)),
        np.array([fit.variance_inflation * information, information]),
        root,
        float(fit.used),
        0,
        fit.law,
        innovations,
        0,
    )


def rest(state: State) -> State:
    """Forget the lags, keep the knowledge: after a gap."""
    return state._replace(y=(), u=())


def step(
    state: State,
    o: Orders,
    output: float,
    inputs: Sequence[float],
    learn: bool = True,
    dt: float = STATED_S,
) -> tuple[State, float]:
    """Take in one usable sample.

    Args:
        state: as left by the sample before.
        o: orders.
        output: finite.
        inputs: (m,) finite.
        learn: False: only the lags move on.
        dt: s, the grid's step.

    Returns:
        The new state and the innovation; NaN while the lags fill.
    """
    u_now = tuple([(x, *past) for x, past in zip(inputs, state.u or ((),) * len(inputs), strict=True)])
    keep = o.nb + o.nk - 1
    u_next = tuple([past[:keep] for past in u_now])
    y_next = (output, *state.y)[: max(o.na, 1)]
    theta = state.theta
    n = theta.shape[2]
    if len(state.y) < o.na or len(u_now[0]) <= keep:
        zero = np.zeros_like(theta)
        return state._replace(y=y_next, u=u_next, e=zero[:, :, : o.nc], psi=(zero,) * o.nc), math.nan

    known = [-x for x in state.y[: o.na]]
    for past in u_now:
        known += past[o.nk :]
    known.append(1.0)
    phi = np.empty_like(theta)
    phi[:, 0, : n - o.nc] = known
    phi[:, :, n - o.nc :] = state.e
    psi = phi
    for i, old in enumerate(state.psi, n - o.nc):
        # a product of (1, 1) by (1, n): matmul makes it in half the time of a broadcast
        psi = psi - theta[:, :, i : i + 1] @ old
    column = phi.swapaxes(1, 2)
    e = output - theta @ column
    errors = e.ravel().tolist()
    if not math.isfinite(sum(errors)):  # a model that has run away begins again with real lags
        return rest(state), math.nan
    innovation = sum(map(operator.mul, state.trust.weights, errors))
    psi_next = (psi, *state.psi)[: o.nc]
    if not learn:
        return state._replace(y=y_next, u=u_next, e=_newest(e, state.e, o.nc), psi=psi_next), innovation

    settings, law = rates(dt), state.law
    weight = innovation_law.mixture(law, innovation)
    counted = errors
    if weight != 1.0:
        root = weight**0.5
        psi, e, counted = root * psi, root * e, [root * x for x in errors]
    done = square_root_covariance.update(state.root, psi)
    new = theta + e @ done.gain
    if o.nc:
        _keep_stable(new, theta, o.nc, settings.zero_radius)
    # the residual with the new parameters is the better guess of the innovation
    after = output - new @ column
    noise = state.noise
    worst = max(noise.variance, noise.recent)
    # the shortest memory follows every change, so that its errors are noise alone; their product has the noise's
    # variance in the mean; after an outlier the second may have the other sign
    square = min(max(weight * errors[0] * after.item(0), 0.0), MAX_SQUARED_INNOVATION * worst)
    moved = State(
        state.forgetting,
        new,
        done.root,
        y_next,
        u_next,
        _newest(after, state.e, o.nc),
        psi_next,
        forgetting_mixture.step(state.trust, errors, done.spread.ravel().tolist(), worst, law.freedom),
        Noise(noise.power, noise.leverage, noise.recent + (square - noise.recent) / settings.recent),
        (*state.block, BlockSample(psi, tuple(counted), square, innovation)),
        state.weights,
        state.score,
        state.anchor,
        state.anchored,
        state.restarts,
        law,
        state.innovations,
        state.blocks,
    )
    if len(moved.block) == settings.block:
        moved = _closed(moved)
    best = forgetting_mixture.refuted(moved.trust)
    return (moved if best is None else _renewed(moved, best)), innovation


def _newest(e: Array, before: Array, nc: int) -> Array:
    return e if nc == 1 else np.concatenate([e, before], axis=2)[:, :, :nc]


def _keep_stable(new: Array, old: Array, nc: int, radius: float) -> None:
    """Shorten a step that would make 1/C unstable until it does not (Ljung & Söderström 1983, sec. 6.6)."""
    every, sufficient = new[:, 0, -nc:].tolist(), radius**nc
    for i, c in enumerate(every):
        # the first is sufficient and, for one zero, all that is to be asked
        if sum(map(abs, c)) < sufficient or polynomial.is_stable(c, radius):
            continue
        for _ in range(6):
            new[i] = 0.5 * (new[i] + old[i])
            if polynomial.is_stable(new[i, 0, -nc:].tolist(), radius):
                break
        else:
            new[i] = old[i]


def _closed(state: State) -> State:
    """End a block: forget, and compare its score with that of white innovations."""
    psi = np.concatenate([sample.psi for sample in state.block], axis=1)
    lead = _lead(state)
    e = np.array([sample.e[lead] for sample in state.block])
    lead_psi = psi[lead].astype(np.float64)
    noise, count = state.noise, len(state.block)
    leverage = ((psi[-1] @ state.anchor) ** 2).sum(axis=1, dtype=np.float64)
    noise = noise._replace(
        power=noise.power + float(leverage @ [sample.square for sample in state.block]),
        leverage=noise.leverage + float(leverage.sum()),
    )
    # Fisher's information of one innovation
    variance = noise.variance / state.law.inflation
    score = np.array([(e @ lead_psi) ** 2, (lead_psi * lead_psi).sum(axis=0) * variance])
    fade = state.forgetting.astype(np.float64) ** count
    last = np.array([sample.innovation for sample in state.block])
    innovations = np.concatenate([state.innovations, last])[-LAW_FITTED_BLOCKS * count :]
    blocks = state.blocks + 1
    return state._replace(
        law=_law(state.law, innovations) if blocks % LAW_BLOCKS == 0 else state.law,
        innovations=innovations,
        blocks=blocks,
        root=square_root_covariance.forget(state.root, psi, state.forgetting),
        noise=noise,
        block=(),
        weights=state.weights * [fade, fade * fade] + count,
        score=state.score * (1.0 - 1.0 / WHITENESS_BLOCKS) + score,
    )


def _law(before: innovation_law.Law, e: Array) -> innovation_law.Law:
    """Fit the law to the last innovations."""
    if len(e) < innovation_law.MIN_ROWS:
        return before
    return innovation_law.fit(e, np.full(len(e), True), np.zeros((0, len(e))), before=before).law


def _renewed(state: State, best: int) -> State:
    """Let the longest memory, which was refuted, and the shortest begin anew from `best`."""
    k = len(state.trust.weights)
    kept = [best, *range(1, k - 1), best]
    widening = np.ones((k, 1, 1), state.root.dtype)
    widening[[0, -1]] = RESTART_WIDENING
    root = widening * state.root[kept]
    weights = state.weights[:, kept]
    weights[:, [0, -1]] /= RESTART_WIDENING**2
    return state._replace(
        theta=state.theta[kept],
        root=root,
        e=state.e[kept],
        psi=tuple([psi[kept] for psi in state.psi]),
        trust=forgetting_mixture.renew(state.trust),
        block=tuple([sample._replace(psi=sample.psi[kept]) for sample in state.block]),
        weights=weights,
        anchor=root[-1],
        anchored=float(weights[0, -1]),
        restarts=state.restarts + 1,
    )


def leading(state: State) -> list[float]:
    """Return theta (n,) of the memory that is believed most."""
    theta: list[float] = state.theta[_lead(state), 0].tolist()
    return theta


def _lead(state: State) -> int:
    return max(range(len(state.trust.weights)), key=state.trust.weights.__getitem__)
