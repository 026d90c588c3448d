"""What the noise of the inputs does to the delays of live estimates: errors in variables (Söderström 2018).

It passes the lag in the model as the input does. Least squares takes a longer lag for the better one, as it leaves less of
that noise, and a shorter dead time goes with it: a bias that no length of drive mends. And its slopes add to Fisher's
information what the likelihood does not have (vehicle_band.py). Both follow from the inner products that are there: a slow
answer is a sum of answers of other dead times.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification import identifiability
from canid.mathematics.identification.fopdt import information_bounds, reduced_basis, vehicle_band
from canid.mathematics.identification.fopdt.fopdt_posterior import Moments
from canid.mathematics.identification.fopdt.information_bounds import Deviations
from canid.mathematics.identification.fopdt.regression_rows import Layout
from canid.values.types import Array, Channel, Identifiable, Interval

# standard deviations; such a bias takes an interval of 95 % to 92 %
MAX_BIAS_SD = 0.5
# standard deviations; of a bias below, first order says enough
SMALL_BIAS_SD = 0.1


class Fitted(NamedTuple):
    """A point that was found, and what is known about it."""

    K: Array  # (m,)
    tau: Array  # (m,) s
    dead_time: Array  # (m,) s
    variance: float  # of the whitened residual
    inflation: float  # of the variances that the bounds do not hold yet


def slopes(gains: Array, by: Array) -> list[Array]:
    """Per channel (3, m b): weights of the derivatives of the output by K, tau and dead time.

    Args:
        gains: (m,).
        by: (3, m, b) of unit answers and of their slopes.
    """
    m = len(gains)
    apart: Array = (np.eye(m)[:, None, :, None] * by.transpose(1, 0, 2)[:, :, None]).reshape(m, 3, -1)
    return list(apart * np.stack([np.ones(m), gains, gains], axis=1)[:, :, None])


def bands(basis: reduced_basis.Basis, tau: Array, dead_time: Array, step: float) -> tuple[Array, Array]:
    """Weights (3, m, b) of unit answers and their slopes: as vehicles move the inputs, and what is faster.

    All are as much later as keeps them in the box, which moves no inner product.

    Args:
        basis: of the box.
        tau: (m,) s.
        dead_time: (m,) s.
        step: s, between rows.

    >>> basis = reduced_basis.basis(reduced_basis.Box(reduced_basis.TAU_MIN, 3.0, 1.5))
    >>> slow, fast = bands(basis, np.array([0.4]), np.array([0.6]), 0.1)
    >>> whole = reduced_basis.with_slopes(basis, np.array([0.4]), np.array([0.6]))
    >>> slow.shape == whole.shape, bool(np.allclose(slow + fast, whole))
    (True, True)
    """
    by, most = vehicle_band.parabola(step), basis.box.dead_time_max
    shift = max(by.before * step - float(dead_time.min()), 0.0)
    shift -= max(float(dead_time.max()) + shift + by.after * step - most, 0.0)
    at = np.clip(dead_time + shift + step * np.arange(-by.before, by.after + 1)[:, None], 0.0, most)
    every = reduced_basis.with_slopes(basis, np.tile(tau, len(at)), at.ravel()).reshape(3, *at.shape, -1)
    slow = np.einsum("k,skmb->smb", by.weights, every)
    return slow, every[:, by.before] - slow


def believed(
    channels: Sequence[Channel],
    every: Sequence[Deviations],
    known: Moments,
    layout: Layout,
    at: Fitted,
) -> tuple[Channel, ...]:
    """Channels whose intervals hold what the noise of the inputs does; delays that it decides may not be quoted.

    Args:
        channels: by the posterior.
        every: bounds by the inputs as they were measured.
        known: inner products.
        layout: of the rows.
        at: the point.
    """
    if all(channel.status is Identifiable.NOT for channel in channels):
        return tuple(channels)
    by_slow, moves = _bias(known, layout, at)
    box, back = layout.basis.box, np.array(moves).T
    if (np.abs(back) > SMALL_BIAS_SD * np.array(by_slow).T).any():
        # a longer lag leaves less noise to be moved by: once more from where the point would be without it
        before = at._replace(
            tau=np.clip(at.tau - back[1], box.tau_min, box.tau_max),
            dead_time=np.clip(at.dead_time - back[2], 0.0, box.dead_time_max),
        )
        _, moves = _bias(known, layout, before)
    return tuple(
        _held(information_bounds.robust(channel, s, e, layout.basis.box, at.inflation), s, move)
        for channel, s, e, move in zip(channels, by_slow, every, moves, strict=True)
    )


def _bias(known: Moments, layout: Layout, at: Fitted) -> tuple[tuple[Deviations, ...], list[Deviations]]:
    """Bounds by the slow inputs; and what the fast ones move each parameter by, to first order, named as the bounds are."""
    box = layout.basis.box
    slow, fast = (slopes(at.K, w) for w in bands(layout.basis, at.tau, at.dead_time, layout.step))
    noise = sum(K * J[0] for K, J in zip(at.K.tolist(), fast, strict=True))
    # what passes the lag stays in the residual: fast motion beyond that is none of noise
    share = min(at.variance * known.freedom / max(float(noise @ known.xx @ noise), 1e-300), 1.0)
    score = share * (np.concatenate(fast) @ known.xx @ noise) / at.variance
    moves = -information_bounds.covariance(known, slow, at.variance, box) @ score
    named = [Deviations(K, tau, late, tau + late) for K, tau, late in moves.reshape(-1, 3).tolist()]
    return information_bounds.bounds(known, slow, at.variance, box), named


def _held(channel: Channel, sd: Deviations, move: Deviations) -> Channel:
    """Let the intervals reach as far as the bias; delays that it moves too far are not quoted.

    >>> known = Channel(Interval(5.0, 4.9, 5.1), *(Interval(0.5, 0.3, 0.7),) * 3, status=Identifiable.OK)
    >>> sd = Deviations(0.05, 0.1, 0.1, 0.05)
    >>> _held(known, sd, Deviations(0.1, 0.05, -0.04, 0.01)).tau
    Interval(value=0.5, low=0.25, high=0.7)
    >>> _held(known, sd, Deviations(0.1, 0.2, -0.18, 0.02)).status.value
    'sum_only'
    """
    reach = []
    for name, by in zip(identifiability.PARAMETERS, move, strict=True):
        value, low, high = getattr(channel, name)
        low = low - max(by, 0.0) if name == "K" else min(low, max(low - by, 0.0))
        reach.append(Interval(value, low, high - min(by, 0.0)))
    out = channel._replace(K=reach[0], tau=reach[1], dead_time=reach[2], tau_plus_dead_time=reach[3])
    too_large = [abs(by) > MAX_BIAS_SD * each for by, each in zip(move, sd, strict=True)]
    out = identifiability.sum_only(out) if too_large[1] or too_large[2] else out
    return identifiability.gain_only(out) if too_large[3] else out
