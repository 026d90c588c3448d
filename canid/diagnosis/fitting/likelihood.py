"""Likelihood of an output under a model with autoregressive noise, censored at a floor and a ceiling (Tobin 1958).

The noise n = y − model is autoregressive, A(q) n = e, and e's scale may depend on the state: `Noise`. A sample counts
when itself and the p samples before it are known and free; what it is then conditioned on is exactly what e depends
on, and which samples count is known before they are seen (a partial likelihood, Cox 1975): no selection on the output.
A counted sample that has run into the floor shows only that the demand was below it: log Φ instead of a density (Tobin
1958). So the samples at the floor neither bias the fit, as they do when they are masked, nor are lost altogether.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve

from canid.diagnosis.fitting.fir_filter import filtered
from canid.findings import Flags
from canid.identification import censoring
from canid.identification.autoregression import preceded
from canid.types import Array

# orders that are compared, in samples; above them the recovery after each masked stretch costs more than it brings
ORDERS = (2, 4, 6, 9, 13, 18, 25)
# the most that log sd may differ from its mean through the state: a factor of 5 either way
MAX_LOG_SCALE = 1.6
# s; a noise that remembers longer is not distinguishable from an offset that drifts, and at a root on the unit circle no
# offset is identifiable at all
MAX_NOISE_MEMORY_S = 60.0
# squared innovations beyond this many variances count as so many: one outlier is no state
MAX_SQUARE = 9.0


class Output(NamedTuple):
    """What is to be explained."""

    y: Array  # (n,) measured
    usable: Flags  # (n,) measured, and with inputs
    below: Flags  # (n,) at the floor: the demand was at or below it
    floor: float
    above: Flags  # (n,) at a ceiling: the demand was at or above it
    ceiling: float
    dt: float  # s

    @property
    def hidden(self) -> Flags:
        """Samples of which only the side of floor or ceiling is known on which the demand was."""
        return self.below | self.above


class Noise(NamedTuple):
    """A(q) n(t) = sd · size(t) · e(t), e white with variance 1."""

    A: Array  # (p + 1,), A[0] = 1
    sd: float
    size: Array  # (n,) relative, mean of its square about 1
    state: Array  # coefficients of log size² over the state's features; empty: the same everywhere


class Scored(NamedTuple):
    """Whitened residuals."""

    e: Array  # (n,) / (sd·size); where it does not count: 0
    slope: Array  # (n,) d e / d whitened model, sign included (−1 where free)
    cost: float  # Σ e²: −2 log likelihood up to what does not depend on the model
    free: int  # samples that count with a density


def counted(output: Output, p: int) -> Flags:
    """Samples that count: usable, with p usable and free samples before them."""
    return output.usable & preceded(output.usable & ~output.hidden, p)


def whitened(noise: Noise, x: Array) -> Array:
    """Filter a column (n,) or columns (n, k) by A and divide by the noise's size.

    Example:
        >>> noise = Noise(np.array([1.0, -0.5]), 2.0, np.ones(3), np.empty(0))
        >>> whitened(noise, np.array([2.0, 2.0, 2.0]))
        array([1. , 0.5, 0.5])
    """
    out: Array = filtered(noise.A, np.atleast_2d(x.T)) / (noise.sd * noise.size)
    return out[0] if x.ndim == 1 else out.T


def score(output: Output, rows: Flags, noise: Noise, model: Array) -> Scored:
    """Whiten the residual, floor and ceiling included.

    Args:
        output: what is explained.
        rows: (n,) samples that count, from `counted`.
        noise: its spectrum and scale.
        model: (n,) output unit.

    Example:
        >>> flags = np.array([False, False, False])
        >>> out = Output(np.array([1.0, 2.0, 2.5]), ~flags, flags, 0.0, flags, 100.0, 0.1)
        >>> noise = Noise(np.array([1.0]), 0.5, np.ones(3), np.empty(0))
        >>> score(out, ~flags, noise, np.array([1.0, 1.5, 3.0])).cost
        2.0
    """
    # who stands at a ceiling is known to want more than that, not how far he pushes into a soft one
    e = whitened(noise, np.where(output.above, output.ceiling, output.y) - model)
    slope = np.full(e.size, -1.0)
    hidden = rows & output.hidden
    if hidden.any():
        # e is y − E[y | before] in sd; at the floor y = floor, so −e is how far the expected demand lies above it
        sign = np.where(output.above[hidden], -1.0, 1.0)
        of_bound = censoring.surprise(sign * e[hidden])
        e[hidden] = of_bound.value
        slope[hidden] = -sign * of_bound.slope
    e = np.where(rows, e, 0.0)
    free = int(np.count_nonzero(rows & ~hidden))
    return Scored(e, np.where(rows, slope, 0.0), float(e @ e), free)


def fit_noise(output: Output, residual: Array, p: int, size: Array) -> Noise:
    """Fit A of order p to a residual (n,), by least squares over the samples that count, each weighted by its size.

    The residual has a mean of its own while the offset is not at its best. Without an intercept the noise model takes that
    mean for a root near the unit circle, which leaves the offset unidentified: the next fit of it may end anywhere. For
    the same reason the noise is stationary, its longest memory `MAX_NOISE_MEMORY_S`.
    """
    rows = counted(output, p) & ~output.hidden
    index = np.flatnonzero(rows)
    if index.size < 4 * (p + 1):
        return Noise(
            np.r_[1.0, np.zeros(p)], max(float(np.std(residual[output.usable])), 1e-9), size, np.empty(0)
        )
    weight = 1.0 / size[index]
    lags = np.stack([*(residual[index - k] * weight for k in range(1, p + 1)), weight], axis=1)
    now = residual[index] * weight
    gram = lags.T @ lags
    # a residual that is nothing but 0 has no spectrum, and none is singular
    own = np.arange(p)
    gram[own, own] += 1e-9 * max(float(np.trace(gram[:p, :p])) / max(p, 1), 1e-12)
    a = solve(gram, lags.T @ now, assume_a="pos")
    A = stationary(np.r_[1.0, -a[:p]], output.dt)
    e = now + lags[:, :p] @ A[1:]
    e = e - weight * float(weight @ e) / float(weight @ weight)
    return Noise(A, max(float(np.sqrt(np.mean(e * e))), 1e-9), size, np.empty(0))


def stationary(A: Array, dt: float) -> Array:
    """Move the roots of A (p + 1,) into the circle of `MAX_NOISE_MEMORY_S`, all by the same factor (bandwidth expansion).

    Example:
        >>> stationary(np.array([1.0, -1.2]), 0.1).round(3)
        array([ 1.   , -0.998])
        >>> stationary(np.array([1.0, -0.5]), 0.1)
        array([ 1. , -0.5])
    """
    radius = float(np.max(np.abs(np.roots(A)), initial=0.0))
    limit = float(np.exp(-dt / MAX_NOISE_MEMORY_S))
    if radius <= limit:
        return A
    out: Array = A * (limit / radius) ** np.arange(A.size)
    return out


def order(output: Output, residual: Array) -> int:
    """Choose the noise's order by AIC over the samples that count for the longest.

    A noise with a resonance, as pedal spectra have one at 0.25 Hz, needs two seconds of memory at 10 Hz; one that is
    chosen too short is whitened into something that resembles an answer.
    """
    ones = np.ones(residual.size)
    rows = counted(output, ORDERS[-1]) & ~output.hidden
    n = int(rows.sum())
    best, chosen = np.inf, ORDERS[0]
    for p in ORDERS:
        if n < 20 * p:
            break
        noise = fit_noise(output, residual, p, ones)
        e = filtered(noise.A, residual[None, :])[0, rows]
        aic = n * np.log(np.var(e)) + 2 * p
        if aic < best:
            best, chosen = aic, p
    return chosen


def state_scale(e: Array, rows: Flags, features: Array) -> tuple[Array, Array]:
    """Fit log size² = γ·features to whitened residuals by quasi-likelihood (Harvey 1976).

    Args:
        e: (n,) whitened residuals with variance about 1.
        rows: (n,) samples that count.
        features: (n, k) of the state, each with mean 0 and variance about 1.

    Returns:
        size (n,), mean of its square about 1 over the rows, and γ (k,).
    """
    _n, k = features.shape
    square = np.minimum(e[rows] ** 2, MAX_SQUARE)
    x = np.c_[np.ones(int(rows.sum())), features[rows]]
    gamma = np.r_[np.log(max(square.mean(), 1e-9)), np.zeros(k)]
    for _ in range(12):
        eta = np.clip(x @ gamma, -6, 6)
        ratio = square / np.exp(eta)
        step = solve(x.T @ x + 1e-6 * len(x) * np.eye(k + 1), x.T @ (ratio - 1), assume_a="pos")
        # the mean's step is unbounded, a state's is not: an exponential overshoots
        gamma = gamma + np.clip(step, -0.5, 0.5)
        if np.abs(step).max() < 1e-4:
            break
    log = np.clip(features @ gamma[1:], -2 * MAX_LOG_SCALE, 2 * MAX_LOG_SCALE)
    log -= np.log(np.mean(np.exp(log[rows])))
    return np.exp(0.5 * log), gamma[1:]
