"""Likelihood of an output under a model with autoregressive noise, censored at a floor and a ceiling (Tobin 1958).

The noise n = y − model is autoregressive, A(q) n = e, and e's scale may depend on the state: `Noise`. A sample counts
when itself and the p samples before it are known and free; what it is then conditioned on is exactly what e depends
on, and which samples count is known before they are seen (a partial likelihood, Cox 1975): no selection on the output.
A counted sample that has run into the floor shows only that the demand was below it: log Φ instead of a density (Tobin
1958). So the samples at the floor neither bias the fit, as they do when they are masked, nor are lost altogether.

e is Gaussian, or Student's t (Lange, Little & Taylor 1989): then the score of each sample is bounded, and one outlier of a
person decides nothing. It is written as a residual with variance 1 and slope −1 in expectation (Fisher scoring), so that
whatever is made of whitened residuals is made of scores.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve
from scipy.signal import lfilter

from canid.mathematics.identification import censoring
from canid.mathematics.identification.autoregression import preceded
from canid.values.findings import Flags
from canid.values.types import Array

# coefficients up to which numpy's convolution is the faster one
SHORT = 12
# samples per block; a longer filter than this is applied sample by sample
BLOCK = 32
# coefficient of the sample of a column in that of a row, in the same block
LAG = np.arange(BLOCK)[:, None] - np.arange(BLOCK)


def past(x: Array, p: int) -> Array:
    """Columns of the p samples before each one, (n, p); before the first it was 0.

    Example:
        >>> past(np.array([1.0, 2.0, 3.0]), 2).tolist()
        [[0.0, 0.0], [1.0, 0.0], [2.0, 1.0]]
    """
    out = np.zeros((x.size, p))
    for k in range(1, min(p, x.size - 1) + 1):
        out[k:, k - 1] = x[:-k]
    return out


def filtered(A: Array, rows: Array) -> Array:
    """Filter each row (k, n) by A (p + 1,); before its first sample it was 0.

    Example:
        >>> filtered(np.array([1.0, -0.5]), np.array([[2.0, 2.0, 4.0]]))
        array([[2., 1., 3.]])
    """
    (k, n), p = rows.shape, A.size - 1
    # of many short rows a call for each costs more than its sum
    if p < SHORT and k <= n:
        short = np.empty((k, n))
        for row, column in zip(short, rows, strict=True):
            row[:] = np.convolve(column, A)[:n]
        return short
    if p > BLOCK:
        return np.asarray(lfilter(A, [1.0], rows, axis=1))
    blocks = -(-n // BLOCK)
    padded = np.zeros((k, blocks * BLOCK))
    padded[:, :n] = rows
    by_lag = np.r_[A, np.zeros(2 * BLOCK - A.size)]
    # a lag below 0 takes one of the zeros
    whole = padded.reshape(-1, BLOCK) @ by_lag[LAG].T
    before = padded.reshape(k, blocks, BLOCK)[:, :-1, BLOCK - p :]
    of_before = by_lag[np.minimum(LAG[:, BLOCK - p :] + BLOCK, 2 * BLOCK - 1)]
    whole.reshape(k, blocks, BLOCK)[:, 1:] += before @ of_before.T
    out: Array = whole.reshape(k, -1)[:, :n]
    return out


# orders that are compared, in samples; above them the recovery after each masked stretch costs more than it brings
ORDERS = (2, 4, 6, 9, 13, 18, 25)
# the most that log sd may differ from its mean through the state: a factor of 5 either way
MAX_LOG_SCALE = 1.6
# s; a noise that remembers longer is not distinguishable from an offset that drifts, and at a root on the unit circle no
# offset is identifiable at all
MAX_NOISE_MEMORY_S = 60.0
# squared innovations beyond this many variances count as so many: one outlier is no state
MAX_SQUARE = 9.0
# where innovations are Student's t: of weights and coefficients in turn, and of the fixed point of a scale
WEIGHINGS, SCALINGS = 3, 8


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

    @property
    def limited(self) -> Array:
        """(n,) the output; beyond a limit the limit, whatever was recorded there: no more is known of the demand."""
        return np.where(self.above, self.ceiling, np.where(self.below, self.floor, self.y))


class Noise(NamedTuple):
    """A(q) n(t) = sd · size(t) · e(t), e white; Gaussian with variance 1, or Student's t with Fisher's information 1."""

    A: Array  # (p + 1,), A[0] = 1
    sd: float
    size: Array  # (n,) relative, mean of its square about 1
    state: Array  # coefficients of log size² over the state's features; empty: the same everywhere
    freedom: float = math.inf  # of Student's t; inf: Gaussian

    @property
    def stretch(self) -> float:
        """Scale of Student's t, over the standard deviation of the Gaussian that shows its mean as well."""
        return math.sqrt((self.freedom + 1.0) / (self.freedom + 3.0)) if math.isfinite(self.freedom) else 1.0

    @property
    def deviation(self) -> float:
        """Standard deviation of an innovation, over `sd`."""
        if not math.isfinite(self.freedom):
            return 1.0
        return self.stretch * math.sqrt(self.freedom / (self.freedom - 2.0))


class Scored(NamedTuple):
    """Whitened residuals."""

    e: Array  # (n,) / (sd·size), of Student's t the score in its place; where it does not count: 0
    slope: Array  # (n,) d e / d whitened model, sign included (−1 where free, of Student's t in expectation)
    loss: Array  # (n,) −2 log density up to what does not depend on the model; of a Gaussian e²
    cost: float  # its sum
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
    out: Array = filtered(noise.A, np.atleast_2d(x.T))
    # in place: a second array of all columns costs as much as the filter
    out /= noise.sd * noise.size
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
    e = whitened(noise, output.limited - model)
    slope = np.full(e.size, -1.0)
    hidden = rows & output.hidden
    if hidden.any():
        # e is y − E[y | before] in sd, at the floor −e is how far the expected demand lies above it
        sign = np.where(output.above[hidden], -1.0, 1.0)
        of_bound = censoring.surprise(sign * e[hidden])
        e[hidden] = of_bound.value
        slope[hidden] = -sign * of_bound.slope
    free = rows & ~hidden
    return laid_out(e, slope, rows, free, noise.freedom)


def laid_out(white: Array, slope: Array, rows: Flags, free: Flags, freedom: float) -> Scored:
    """Scores of whitened residuals.

    Args:
        white: (n,) whitened residuals; of hidden samples the surprise.
        slope: (n,) as in `Scored`.
        rows: (n,) samples that count.
        free: (n,) those of them that have a density.
        freedom: of Student's t; inf: Gaussian.

    Example:
        >>> all_ = np.ones(2, dtype=bool)
        >>> laid_out(np.array([0.5, 50.0]), -np.ones(2), all_, all_, 4.0).e.round(2)
        array([0.8, 0.1])
    """
    e = np.where(rows, white, 0.0)
    loss = e * e
    if math.isfinite(freedom):
        information = (freedom + 1.0) / (freedom + 3.0)
        square = e[free] ** 2 / information
        loss[free] = (freedom + 1.0) * np.log1p(square / freedom)
        e[free] *= (freedom + 1.0) / ((freedom + square) * information)
    return Scored(e, np.where(rows, slope, 0.0), loss, float(loss.sum()), int(np.count_nonzero(free)))


def fit_noise(
    output: Output, residual: Array, p: int, size: Array, freedom: float = math.inf, rows: Flags | None = None
) -> Noise:
    """Fit A of order p to a residual (n,), by least squares over the samples that count, each weighted by its size.

    `rows` (n,) are these samples; None: all of them.

    The residual has a mean of its own while the offset is not at its best. Without an intercept the noise model takes that
    mean for a root near the unit circle, which leaves the offset unidentified: the next fit of it may end anywhere. For
    the same reason the noise is stationary, its longest memory `MAX_NOISE_MEMORY_S`.
    """
    index = np.flatnonzero((counted(output, p) if rows is None else rows) & ~output.hidden)
    none: Array = np.empty(0)
    if index.size < 4 * (p + 1):
        sd = max(float(np.std(residual[output.usable])), 1e-9)
        return Noise(np.r_[1.0, np.zeros(p)], sd, size, none, freedom)
    past = np.ones((index.size, p + 2))
    for k in range(p + 1):
        past[:, k] = residual[index - k]
    A, e = _coefficients(past, 1.0 / size[index], output.dt)
    if not math.isfinite(freedom):
        return Noise(A, max(float(np.sqrt(np.mean(e * e))), 1e-9), size, none)
    for _ in range(WEIGHINGS):
        # of Student's t, the weights at its likeliest scale
        scale = scaled(e, freedom)
        weight = np.sqrt((freedom + 1.0) / (freedom + (e / scale) ** 2)) / size[index]
        A, left = _coefficients(past, weight, output.dt)
        e = left / (weight * size[index])
    plain = Noise(A, 1.0, size, none, freedom)
    return plain._replace(sd=max(scaled(e, freedom) / plain.stretch, 1e-9))


def scaled(e: Array, freedom: float) -> float:
    """Likeliest scale of Student's t.

    Example:
        >>> round(scaled(np.random.default_rng(0).standard_t(5, 20000), 5.0), 1)
        1.0
    """
    square = e * e
    scale = float(np.mean(square)) * max(1.0 - 2.0 / freedom, 0.3)
    for _ in range(SCALINGS):
        scale = max(
            float(np.mean(square * (freedom + 1.0) / (freedom + square / max(scale, 1e-300)))), 1e-300
        )
    return math.sqrt(scale)


def _coefficients(past: Array, weight: Array, dt: float) -> tuple[Array, Array]:
    """A (p + 1,) by least squares, each sample with its weight; and what it leaves, weighed.

    Args:
        past: (n, p + 2) residuals: the sample's own, those before it, and 1.
        weight: (n,).
        dt: s.
    """
    weighed, p = past * weight[:, None], past.shape[1] - 2
    now, lags = weighed[:, 0], weighed[:, 1:]
    gram = lags.T @ lags
    # a residual that is nothing but 0 has no spectrum, and none is singular
    diagonal = np.arange(p)
    gram[diagonal, diagonal] += 1e-9 * max(float(np.trace(gram[:p, :p])) / max(p, 1), 1e-12)
    a = solve(gram, lags.T @ now, assume_a="pos")
    A = stationary(np.r_[1.0, -a[:p]], dt)
    e = now + lags[:, :p] @ A[1:]
    return A, e - weight * float(weight @ e) / float(weight @ weight)


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
