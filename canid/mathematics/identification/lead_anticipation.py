"""Likelihood of a response to the lead's acceleration in a window of rows (Kesting & Treiber 2008; brake lights).

A driver who answers K2·(range rate + T·lead's acceleration) is ahead of the range rate by T. The acceleration of the lead is
the range rate's derivative, which is a dead time shorter by T, and the own acceleration, which is an output of the loop: a
fit without it has short delays and a K2 that is too large by a quarter to a half. Lags and dead times of the two drivers
differ by too much for a score test, so that the likelihood is integrated over a grid of them, for each T with its own
noise model: in a loop, a noise model that has taken up a part of the response bends what is left of it.
"""

from __future__ import annotations

import numpy as np

from canid.mathematics.identification import autoregression, first_order
from canid.mathematics.identification.fopdt import answer_columns, reduced_basis, row_noise
from canid.mathematics.identification.fopdt.answer_columns import Columns, Reference
from canid.mathematics.identification.fopdt.regression_rows import Layout
from canid.values.types import Array, OutputFilter

# s; T of the drivers that are compared, the first without a response to the lead's acceleration
AHEAD_S = np.array([0.0, 0.3, 0.6, 1.0, 1.5])
# of T before the drive: half of a normal distribution with a standard deviation of 1 s
_density = np.exp(-0.5 * AHEAD_S[1:] ** 2)
PRIOR = _density / _density.sum()
# s; lags and dead times of the response, every lag with every dead time
LAGS, DEAD_TIMES = np.array([0.05, 0.15, 0.3, 0.55, 1.0]), np.array([0.0, 0.15, 0.3, 0.5, 0.75, 1.0])
TAU, DEAD_TIME = (x.ravel() for x in np.meshgrid(LAGS, DEAD_TIMES))
# s, and of its logarithm: lag and dead time together before the drive, as times to react to a lead that brakes: median
# 0.9 s where it is not expected, nine in ten within a factor of two (Johansson & Rumar 1971)
DELAY_S, DELAY_LOG_SD = 0.9, 0.4
# s; half of the stretch over which the lead's speed is differentiated
HALF_STRETCH_S = 0.5
# m/s²; what changes faster is another lead
MAX_ACCEL = 15.0
# s before the window from which on the lead's acceleration is needed: the slowest response has forgotten what was before
BEFORE_S = 5.0


def acceleration_ahead(speed: Array, step: float) -> Array:
    """Smoothed derivative (n,) m/s² of the lead's speed, quadratic over a second (Savitzky & Golay 1964).

    Args:
        speed: (n,) m/s; NaN = not measured, which counts as no change.
        step: s.

    >>> bool(np.allclose(acceleration_ahead(0.2 * np.arange(50.0), 0.1)[10:-10], 2.0))
    True
    """
    change = np.diff(speed, prepend=speed[:1]) / step
    change[~(np.abs(change) <= MAX_ACCEL)] = 0.0
    half = max(round(HALF_STRETCH_S / step), 1)
    weight = 1.0 - ((np.arange(-half, half) + 0.5) / (half + 0.5)) ** 2
    # each change lies half a step before its sample
    return np.convolve(np.r_[change, np.zeros(half)], weight / weight.sum())[half:][: len(speed)]


def compare(
    layout: Layout,
    rows: Array,
    at: Reference,
    made: Columns,
    accel: Array,
    output_filter: OutputFilter | None,
) -> Array:
    """Compare drivers with each T of `AHEAD_S` but the first to the one without a response to the lead's acceleration.

    Args:
        layout: of the rows.
        rows: (n, width) of a window, of headway error and range rate.
        at: its fit.
        made: columns of the fit, whitened.
        accel: (k + n,) m/s² of the lead at the rows, and before.
        output_filter: that the output has passed.

    Returns:
        (t, 4) log likelihood, integrated over lags and dead times; what the delays of people add to it; K2, over that of
        the driver without the response; and by how much its standard deviation is larger, over the same.
    """
    raw, usable = answer_columns.raw(layout, rows, at)
    every, _ = answer_columns.basis_columns(layout, rows)
    b, c = layout.basis.size, len(TAU)
    y = raw[-1] - float(raw[-1, usable].mean())
    of_rate = reduced_basis.weights(layout.basis, TAU, DEAD_TIME) @ every[b : 2 * b]
    of_lead = answers(accel, LAGS, DEAD_TIMES, layout.step)[:, -len(rows) :]
    # headway, offset, slopes of headway by lag and dead time; then range rate; then the lead's acceleration; then the output
    columns = np.vstack([raw[[0, 2, 3, 5]], of_rate, of_lead, y])
    precision = np.r_[0.0, made.precision[[2, 3, 5]]]
    count = float(made.usable.sum()) / (at.variance_inflation * at.stride)

    def products(noise: Array) -> Array:
        white, _ = answer_columns.white(columns, usable, at._replace(noise=noise), output_filter, layout.step)
        return np.asarray((white * made.weight) @ white.T, float)

    G = products(at.noise)
    likelihood, K, variance = np.empty((3, len(AHEAD_S), c))
    for k, ahead in enumerate(AHEAD_S):
        turned, solved, explained = _solved(G, ahead, precision)
        best = int(np.argmax(explained))
        fitted = solved[best] @ np.vstack([columns[4 + best] + ahead * columns[4 + c + best], columns[:4]])
        residual, known = row_noise.strided(np.vstack([(y - fitted) * usable, usable]), at.stride)
        refitted = products(autoregression.fit(residual, known > 0.0, row_noise.NOISE_ORDER))
        turned, solved, explained = _solved(refitted, ahead, precision)
        left = np.maximum(refitted[-1, -1] - explained, 1e-9 * refitted[-1, -1])
        likelihood[k], K[k] = -0.5 * count * np.log(left), solved[:, 0]
        variance[k] = np.linalg.inv(turned)[:, 0, 0] * left / count
    likely = -0.5 * ((np.log(TAU + DEAD_TIME) - np.log(DELAY_S)) / DELAY_LOG_SD) ** 2
    plain = _integrated(likelihood)
    weighed = _integrated(likelihood + likely) - plain
    weight = np.exp(likelihood + likely - (likelihood + likely).max(axis=1)[:, None])
    weight /= weight.sum(axis=1)[:, None]
    mean = (weight * K).sum(axis=1)
    spread = (weight * (variance + (K - mean[:, None]) ** 2)).sum(axis=1)
    more = np.sqrt(np.maximum(spread - spread[0], 0.0)) / abs(mean[0])
    out = np.column_stack([plain - plain[0], weighed - weighed[0], mean / mean[0], more])
    return out[1:]


def answers(u: Array, tau: Array, dead_time: Array, step: float) -> Array:
    """Answers (d t, n) of unit gain to an input (n,), which begins at rest: every dead time (d,) s with every lag (t,) s."""
    alpha = np.exp(-step / tau)[:, None]
    middle = 0.5 * (u + np.r_[u[:1], u[:-1]]) - u[0]
    lagged = u[0] + first_order.scan((1.0 - alpha) * middle, alpha)
    at = np.arange(len(u), dtype=float)
    return np.array([np.interp(at - delay / step, at, x) for delay in dead_time for x in lagged])


def _solved(G: Array, ahead: float, precision: Array) -> tuple[Array, Array, Array]:
    """Normal equations (c, 5, 5) of each cell, their solution (c, 5), and what it explains (c,)."""
    c = len(TAU)
    rate, lead = 4 + np.arange(c), 4 + c + np.arange(c)
    turned, right = np.empty((c, 5, 5)), np.empty((c, 5))
    turned[:, 1:, 1:] = G[:4, :4] + np.diag(precision)
    turned[:, 0, 0] = G[rate, rate] + ahead * (2.0 * G[rate, lead] + ahead * G[lead, lead])
    turned[:, 0, 1:] = turned[:, 1:, 0] = G[rate, :4] + ahead * G[lead, :4]
    right[:, 0], right[:, 1:] = G[rate, -1] + ahead * G[lead, -1], G[:4, -1]
    turned[:, range(5), range(5)] *= 1.0 + 1e-9  # keeps the matrix regular
    solved = np.asarray(np.linalg.solve(turned, right[:, :, None])[:, :, 0], float)
    return turned, solved, np.asarray((right * solved).sum(axis=1), float)


def _integrated(likelihood: Array) -> Array:
    most = likelihood.max()
    return np.asarray(np.log(np.exp(likelihood - most).mean(axis=1) + 1e-300) + most, float)
