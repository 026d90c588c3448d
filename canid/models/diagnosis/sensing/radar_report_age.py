"""Age of the radar's reports: the own motion shows in the range rate at once, or late (prediction errors; Ljung 1999).

    range_rate(t) = lead speed(t − δ) − own speed(t − δ) + noise

With the right δ, range_rate(t) + own speed(t − δ) is the lead's speed, in which nothing of the own motion is left. The
lead does not answer the own car, but the own car answers the lead, some tenths of a second later; so the *innovations* of
the lead's speed do not depend on the own motion, and regressing the one on the other is unbiased only causally: an
autoregression whitens the lead's speed, and δ is where its innovations hold nothing of the own acceleration (prediction
errors, Ljung 1999, ch. 13.4).

Radar noise biases this: the driver sees the lead better than the radar does, so the own motion depends on the lead in
ways that the radar's reports do not show, and δ comes out too large. The second estimate errs to the other side: it
removes from the own motion what answers the lead, by a regression in which the radar's noise is compensated, and uses
only what remains, the driver's own unrest, as an instrument. The reported interval contains both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter, savgol_filter

from canid.mathematics.identification.autoregression import whole
from canid.models.diagnosis.causal_smoothing import roughness
from canid.models.diagnosis.sensing.kinematics import slope
from canid.values.findings import Flags
from canid.values.types import Array

Rows = npt.NDArray[np.int64]

# samples; an autoregression over four seconds describes a lead's pedal and a radar's noise
ORDER = 40
# s; duration of the own motion's answer to the lead, and how many smooth functions describe it
RESPONSE_S, BASIS_SIZE = 15.0, 9
# s into the past over which the driver's unrest predicts the own motion
UNREST_S = 1.5
# s; of one block of the score's covariance
BLOCK_S = 20.0
# s around each sample, of a parabola that smooths the own speed. Without it the wheel sensor's noise decides: between two
# samples noise is averaged, so ages that fall there would leave less of it, whatever the truth
SMOOTHING_S = 0.9
# s; ages on the grid (the youngest below 0), and how many samples around the best one the line is fitted to
YOUNGEST_S, OLDEST_S = 0.4, 0.8
LINE_SAMPLES = 2
ITERATIONS = 20
CONVERGED_S = 2e-3  # far below any drive's standard error
# s; largest step of an iteration
MAX_STEP_S = 0.2


class Estimated(NamedTuple):
    """An estimate with its standard error; of an age s."""

    value: float
    sd: float


class AgeEstimates(NamedTuple):
    """Both estimates."""

    plain: Estimated  # by prediction errors: errs towards old ages
    instrument: Estimated  # by the driver's unrest: errs towards young ages
    drift: Estimated  # of the age over the drive
    blocks: int


def estimate_age(rate: Array, speed: Array, accel: Array, usable: Flags, dt: float) -> AgeEstimates | None:
    """Estimate the age of the reports; None: too little in a row, or no age stands out.

    Args:
        rate: (n,) m/s, as reported.
        speed: (n,) m/s, own.
        accel: (n,) m/s², own, measured apart from the speed: a regression on the speed's own slope would take the
            speed's noise for motion (instrumental variables).
        usable: (n,) both are there; a new stretch of True starts after each False.
        dt: s.
    """
    memory = round(RESPONSE_S / dt)
    rows = np.flatnonzero(whole(usable, memory + ORDER)).astype(np.int64)
    if rows.size < 100 * ORDER / 4 or float(np.std(speed[rows])) < 1e-6:
        return None
    speed = savgol_filter(speed, 2 * round(SMOOTHING_S / dt / 2) + 1, 2)
    plain, drift, blocks = _plain(rate, speed, accel, rows, dt)
    noise = roughness(rate, 2) ** 2

    def at(age: float) -> Filtered:
        return _at_age(rate, speed, rows, np.full(speed.size, age), dt)

    instrument = by_unrest(at, accel, rows, noise, dt, 0.0, MAX_STEP_S, CONVERGED_S)
    if plain is None or instrument is None or drift is None:
        return None
    return AgeEstimates(plain, instrument, drift, blocks)


class Filtered(NamedTuple):
    """What depends on the parameter of an estimate, an age or a scale, whitened."""

    innovation: Array  # (n,) of the lead's speed
    motion: Array  # (n,) own motion through the same filter: d innovation / d parameter
    filter: Array  # (ORDER + 1,)
    lead: Array  # (n,) m/s, mean 0


def _at_age(rate: Array, speed: Array, rows: Rows, age: Array, dt: float) -> Filtered:
    t = np.arange(speed.size) * dt
    then = np.interp(t - age, t, speed)
    lead = rate + then
    return filtered(np.where(np.isfinite(lead), lead, 0.0), -slope(then, dt), rows)


def filtered(lead: Array, motion: Array, rows: Rows) -> Filtered:
    """Whiten both by an autoregression of the lead's speed.

    Args:
        lead: (n,) m/s.
        motion: (n,) own motion.
        rows: samples that count, `ORDER` behind the first.
    """
    lead = lead - lead[rows].mean()
    past = np.stack([lead[rows - k] for k in range(1, ORDER + 1)], axis=1)
    A = np.concatenate([[1.0], -np.linalg.lstsq(past, lead[rows], rcond=None)[0]])
    return Filtered(lfilter(A, [1.0], lead), lfilter(A, [1.0], motion), A, lead)


def sandwich(scores: Array, rows: Rows, dt: float) -> tuple[Array, int]:
    """Covariance of a sum of scores (n, k), from its blocks."""
    _, block = np.unique(rows * dt // BLOCK_S, return_inverse=True)
    sums = np.stack([np.bincount(block, weights=column) for column in scores.T], axis=1).astype(np.float64)
    meat: Array = sums.T @ sums
    return meat, len(sums)


def _plain(
    rate: Array, speed: Array, accel: Array, rows: Rows, dt: float
) -> tuple[Estimated | None, Estimated | None, int]:
    """Age in the middle of the drive, and its change over the drive.

    The score is computed at whole samples only, and a line fitted to it around the best of them: between two samples it
    has corners, at which a search for its zero does not converge.
    """
    n = speed.size
    t, u = np.arange(n) * dt, np.arange(n) / n - 0.5
    blocks, block = np.unique(rows * dt // BLOCK_S, return_inverse=True)
    middle = np.bincount(block, weights=u[rows]) / np.bincount(block)
    ages = np.arange(-round(YOUNGEST_S / dt), round(OLDEST_S / dt) + 1) * dt
    scores, left = np.empty((ages.size, blocks.size)), np.empty(ages.size)
    for k, age in enumerate(ages):
        at = _at_age(rate, speed, rows, np.full(n, age), dt)
        own_accel = lfilter(at.filter, [1.0], -np.interp(t - age, t, accel))
        scores[k] = np.bincount(block, weights=(own_accel * at.innovation)[rows])
        left[k] = float(np.var(at.innovation[rows]))
    best = int(np.argmin(left))
    near = slice(max(best - LINE_SAMPLES, 0), best + LINE_SAMPLES + 1)
    away = ages[near] - ages[near].mean()
    slopes = away @ scores[near] / float(away @ away)
    at_zero = scores[near].mean(axis=0) - slopes * ages[near].mean()
    # Σ (score at 0 + slope · (age + drift · u)) · (1, u) = 0
    X = np.stack([np.ones(blocks.size), middle], axis=1)
    bread = (X * slopes[:, None]).T @ X
    if slopes.sum() <= 0 or np.linalg.det(bread) <= 0 or np.linalg.cond(bread) > 1e6:
        return None, None, 0
    inverse = np.linalg.inv(bread)
    q = -inverse @ (X.T @ at_zero)
    g = X * (at_zero + slopes * (X @ q))[:, None]
    sd = np.sqrt(np.diag(inverse @ (g.T @ g) @ inverse.T))
    if not ages[near][0] - dt <= q[0] <= ages[near][-1] + dt:
        return None, None, 0  # no age stands out
    return Estimated(float(q[0]), float(sd[0])), Estimated(float(q[1]), float(sd[1])), blocks.size


def response_basis(dt: float) -> Array:
    """Basis of responses from 0 to `RESPONSE_S` s: raised cosines over logarithmic time (BASIS_SIZE, m)."""
    u = np.log(np.arange(round(RESPONSE_S / dt)) * dt + 0.5)
    centre = np.linspace(np.log(0.7), np.log(0.6 * RESPONSE_S + 0.5), BASIS_SIZE)
    wide = 2 * (centre[1] - centre[0])
    bumps = 0.5 * (1 + np.cos(np.clip((u - centre[:, None]) / wide * np.pi, -np.pi, np.pi)))
    out: Array = bumps / bumps.sum(axis=1, keepdims=True)
    return out


# the parameter of an estimate -> what depends on it
Score = Callable[[float], Filtered]


def by_unrest(
    at: Score,
    accel: Array,
    rows: Rows,
    noise: float,
    dt: float,
    begin: float,
    max_step: float,
    converged: float,
) -> Estimated | None:
    """Estimate a parameter by what of the own motion does not answer the lead; None: it does not converge.

    Args:
        at: what depends on the parameter.
        accel: (n,) m/s², own.
        rows: samples that count.
        noise: m²/s², variance of the reports' own noise.
        dt: s.
        begin: where the search begins.
        max_step: of one iteration.
        converged: step at which it ends.
    """
    shapes = response_basis(dt)
    own_accel = accel - accel[rows].mean()
    lags = round(UNREST_S / dt)
    value = begin
    for _ in range(ITERATIONS):
        here = at(value)
        answers = np.stack([lfilter(b, [1.0], here.lead) for b in shapes], axis=1)
        centred = answers[rows] - answers[rows].mean(axis=0)
        # E[noisy' noisy] = E[true' true] + n σ² B B': the noise's part is known
        gram = centred.T @ centred - rows.size * noise * (shapes @ shapes.T)
        if np.linalg.eigvalsh(gram).min() <= 0:
            return None
        answer = np.linalg.solve(gram, centred.T @ own_accel[rows]) @ shapes
        unrest = own_accel - lfilter(answer, [1.0], here.lead)
        unrest = unrest - unrest[rows].mean()
        past = np.stack([unrest[rows - k] for k in range(1, lags + 1)], axis=1)
        weights = np.linalg.lstsq(past, here.motion[rows], rcond=None)[0]
        z = past @ weights
        # the radar's noise is in both: it entered the unrest through the answer that was taken out
        shared = np.convolve(np.concatenate([[0.0], weights]), answer)[: ORDER + 1]
        overlap = -noise * rows.size * float(shared @ here.filter[: shared.size])
        strength = float(z @ here.motion[rows])
        if abs(strength) < 1e-12:
            return None
        move = -(float(z @ here.innovation[rows]) - overlap) / strength
        value += float(np.clip(move, -max_step, max_step))
        if abs(move) < converged:
            break
    else:
        return None
    meat, _ = sandwich((z * here.innovation[rows])[:, None], rows, dt)
    return Estimated(value, float(np.sqrt(meat[0, 0])) / abs(strength))
