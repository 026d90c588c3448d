"""How much older than the own speed the radar's reports are: the own motion shows in the range rate at once, or late.

    range_rate(t) = lead speed(t − δ) − own speed(t − δ) + noise

With the right δ, range_rate(t) + own speed(t − δ) is the lead's speed, in which nothing of the own motion is left. The
lead does not answer the own car, but the own car answers the lead, some tenths of a second later; so what is *new* in
the lead's speed tells nothing of the own motion, and regressing the one on the other is unbiased only causally: an
autoregression whitens the lead's speed, and δ is where its innovations hold nothing of the own acceleration (prediction
errors, Ljung 1999, ch. 13.4).

Radar noise spoils this: the driver has seen the lead better than the radar did, his motion therefore tells something
of the lead that the radar's reports do not, and δ comes out too large. The second estimate errs to the other side: it
takes out of the own motion what answers the lead, by a regression in which the radar's noise is compensated, and uses
only what remains, the driver's own unrest, as an instrument. What both agree on is told.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter, savgol_filter

from canid.diagnosis.causal_inputs import roughness
from canid.diagnosis.kinematics import slope
from canid.findings import Flags
from canid.identification.autoregression import whole
from canid.types import Array

Rows = npt.NDArray[np.int64]

# samples; four seconds hold what a lead's foot and a radar's noise make of an autoregression
ORDER = 40
# s; how long own motion goes on answering what the lead did, and how many smooth curves describe it
ANSWERS, CURVES = 15.0, 9
# s into the past over which the driver's unrest tells of the own motion
UNREST = 1.5
# s; of one block of the score's spread
BLOCK = 20.0
# s around each sample, of a parabola that smooths the own speed. Without it a wheel's noise decides: between two
# samples noise is averaged, so ages that fall there would leave less of it, whatever the truth
SMOOTHED = 0.9
# s; ages that are tried, and how many samples around the best one lie on the line
YOUNGEST, OLDEST = 0.4, 0.8
NODES = 2
ROUNDS = 20
ENDED = 2e-3  # s; far below what any drive tells
# s; no step further, and no age further from 0
FURTHEST = 0.2


class Age(NamedTuple):
    """An age with its doubt, s."""

    value: float
    sd: float


class Looked(NamedTuple):
    """What the two estimates say."""

    plain: Age  # of prediction errors: errs to the old side
    instrument: Age  # of the driver's unrest: errs to the young side
    drift: Age  # of the age over the drive
    blocks: int


def look(rate: Array, speed: Array, accel: Array, usable: Flags, dt: float) -> Looked | None:
    """Estimate the age of the reports; None: too little in a row, or no age stands out.

    Args:
        rate: (n,) m/s, as reported.
        speed: (n,) m/s, own.
        accel: (n,) m/s², own, measured apart from the speed: what is regressed on holds noise, and a regression on the
            speed's own slope would take the speed's noise for motion (instrumental variables).
        usable: (n,) both are there; a new stretch of True begins behind each False.
        dt: s.
    """
    reach = round(ANSWERS / dt)
    rows = np.flatnonzero(whole(usable, reach + ORDER)).astype(np.int64)
    if rows.size < 100 * ORDER / 4 or float(np.std(speed[rows])) < 1e-6:
        return None
    speed = savgol_filter(speed, 2 * round(SMOOTHED / dt / 2) + 1, 2)
    plain, drift, blocks = _plain(rate, speed, accel, rows, dt)
    instrument = _instrument(rate, speed, accel, rows, dt)
    if plain is None or instrument is None or drift is None:
        return None
    return Looked(plain, instrument, drift, blocks)


class _At(NamedTuple):
    """All that depends on the age, whitened."""

    innovation: Array  # (n,) of the lead's speed
    motion: Array  # (n,) own acceleration through the same filter: d innovation / d age
    filter: Array  # (ORDER + 1,)
    lead: Array  # (n,) m/s, mean 0


def _at(rate: Array, speed: Array, rows: Rows, age: Array, dt: float) -> _At:
    t = np.arange(speed.size) * dt
    then = np.interp(t - age, t, speed)
    lead = rate + then
    lead = np.where(np.isfinite(lead), lead, 0.0)
    lead = lead - lead[rows].mean()
    past = np.stack([lead[rows - k] for k in range(1, ORDER + 1)], axis=1)
    phi = np.linalg.lstsq(past, lead[rows], rcond=None)[0]
    A = np.concatenate([[1.0], -phi])
    motion = -slope(then, dt)
    return _At(lfilter(A, [1.0], lead), lfilter(A, [1.0], motion), A, lead)


def _sandwich(scores: Array, rows: Rows, dt: float) -> tuple[Array, int]:
    """Covariance of a sum of scores (n, k), from its blocks."""
    _, block = np.unique(rows * dt // BLOCK, return_inverse=True)
    sums = np.stack([np.bincount(block, weights=column) for column in scores.T], axis=1).astype(np.float64)
    meat: Array = sums.T @ sums
    return meat, len(sums)


def _plain(
    rate: Array, speed: Array, accel: Array, rows: Rows, dt: float
) -> tuple[Age | None, Age | None, int]:
    """Age in the middle of the drive, and its change over the drive.

    The score is taken at whole samples only, and a line laid through it around the best of them: between two samples
    it has corners, at which a search for its zero goes back and forth.
    """
    n = speed.size
    t, u = np.arange(n) * dt, np.arange(n) / n - 0.5
    blocks, block = np.unique(rows * dt // BLOCK, return_inverse=True)
    middle = np.bincount(block, weights=u[rows]) / np.bincount(block)
    ages = np.arange(-round(YOUNGEST / dt), round(OLDEST / dt) + 1) * dt
    scores, left = np.empty((ages.size, blocks.size)), np.empty(ages.size)
    for k, age in enumerate(ages):
        at = _at(rate, speed, rows, np.full(n, age), dt)
        own = lfilter(at.filter, [1.0], -np.interp(t - age, t, accel))
        scores[k] = np.bincount(block, weights=(own * at.innovation)[rows])
        left[k] = float(np.var(at.innovation[rows]))
    best = int(np.argmin(left))
    near = slice(max(best - NODES, 0), best + NODES + 1)
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
    return Age(float(q[0]), float(sd[0])), Age(float(q[1]), float(sd[1])), blocks.size


def curves(dt: float) -> Array:
    """Smooth answers from 0 to `ANSWERS` s, finer near 0: raised cosines over logarithmic time (CURVES, m)."""
    u = np.log(np.arange(round(ANSWERS / dt)) * dt + 0.5)
    centre = np.linspace(np.log(0.7), np.log(0.6 * ANSWERS + 0.5), CURVES)
    wide = 2 * (centre[1] - centre[0])
    bumps = 0.5 * (1 + np.cos(np.clip((u - centre[:, None]) / wide * np.pi, -np.pi, np.pi)))
    out: Array = bumps / bumps.sum(axis=1, keepdims=True)
    return out


def _instrument(rate: Array, speed: Array, accel: Array, rows: Rows, dt: float) -> Age | None:
    shapes = curves(dt)
    noise = roughness(rate, 2) ** 2
    own = accel - accel[rows].mean()
    lags = round(UNREST / dt)
    age = 0.0
    for _ in range(ROUNDS):
        at = _at(rate, speed, rows, np.full(speed.size, age), dt)
        answers = np.stack([lfilter(b, [1.0], at.lead) for b in shapes], axis=1)
        here = answers[rows] - answers[rows].mean(axis=0)
        # E[noisy' noisy] = E[true' true] + n σ² B B': the noise's part is known
        gram = here.T @ here - rows.size * noise * (shapes @ shapes.T)
        if np.linalg.eigvalsh(gram).min() <= 0:
            return None
        answer = np.linalg.solve(gram, here.T @ own[rows]) @ shapes
        unrest = own - lfilter(answer, [1.0], at.lead)
        unrest = unrest - unrest[rows].mean()
        past = np.stack([unrest[rows - k] for k in range(1, lags + 1)], axis=1)
        weights = np.linalg.lstsq(past, at.motion[rows], rcond=None)[0]
        z = past @ weights
        # the radar's noise is in both: it entered the unrest through the answer that was taken out
        shared = np.convolve(np.concatenate([[0.0], weights]), answer)[: ORDER + 1]
        overlap = -noise * rows.size * float(shared @ at.filter[: shared.size])
        grip = float(z @ at.motion[rows])
        if abs(grip) < 1e-12:
            return None
        move = -(float(z @ at.innovation[rows]) - overlap) / grip
        age += float(np.clip(move, -FURTHEST, FURTHEST))
        if abs(move) < ENDED:
            break
    else:
        return None
    meat, _ = _sandwich((z * at.innovation[rows])[:, None], rows, dt)
    return Age(age, float(np.sqrt(meat[0, 0])) / abs(grip))
