"""Noise of a simulated driver: the fitted autoregression, its innovations resampled, their scale by the fitted law.

The innovations are divided by the scale that the law gives them (all effects on the remnant in it) and drawn again in
blocks: their distribution is the drive's own, whatever its tails (Künsch 1989; Efron & Tibshirani 1993, ch. 8).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from canid.mathematics.identification.innovation_law import MEMORY_S, Law
from canid.models.diagnosis.fitting.likelihood import Noise
from canid.models.diagnosis.remnant import law_search
from canid.models.diagnosis.remnant.innovations import MAX_FEATURE, Innovations
from canid.models.diagnosis.remnant.law_search import MAX_LOG_SCALE
from canid.models.effects.effect import Effect, ScaleFeature
from canid.values.findings import Flags
from canid.values.types import Array

# s; a movement of the pedal is over by then, and the scale's own memory is in the law
BLOCK_S = 2.0


class Standard(NamedTuple):
    """Mean and standard deviation by which a feature is standardised."""

    mean: float
    sd: float

    def __call__(self, x: Array) -> Array:
        """Standardise as the features of the fitted law are."""
        return np.clip((x - self.mean) / self.sd, -MAX_FEATURE, MAX_FEATURE)


class Source(NamedTuple):
    """What noise is drawn from."""

    noise: Noise
    law: Law
    slopes: dict[ScaleFeature, float]
    fixed: Array  # (n,) log scale that does not depend on the simulated driver
    own: Standard | None  # of own |acceleration|; None: it is not measured
    recent: Standard  # of the log of recent innovations
    middle: float  # mean of their squares
    dt: float  # s
    scale: Array  # (n,) of the drive's innovations, relative, by the law
    pool: Array  # (k,) standardised innovations, in the order of the drive
    residual: Array  # (n,) output unit, of the drive: the noise begins with it
    size: Array  # (n,) of the innovations that the recent ones are divided by


def source(
    innovations: Innovations, noise: Noise, residual: Array, effects: Sequence[Effect], accel: Array | None
) -> Source:
    """Standardise the innovations of a fitted driver.

    Args:
        innovations: the innovations.
        noise: the fitted noise model.
        residual: (n,) measured less modelled.
        effects: on the remnant.
        accel: (n,) m/s², own; None: not measured.
    """
    law = law_search.fitted(innovations, effects, innovations.rows).law
    F = law_search.features_of(innovations, effects, np.ones(innovations.rows.size, dtype=bool))
    scale = np.exp(np.clip(law.slopes @ F, -MAX_LOG_SCALE, MAX_LOG_SCALE))
    z = (innovations.x / (law.sd * scale))[innovations.rows]
    own_features = [feature for effect in effects if effect.remnant for feature in effect.remnant.scale]
    slopes = dict(zip(own_features, law.slopes.tolist(), strict=False))
    fixed = law.slopes[len(own_features) :] @ innovations.present
    kept = [ScaleFeature.LEAD_ACCELERATION, *([ScaleFeature.OWN_ACCELERATION] if accel is None else [])]
    for feature in kept:
        fixed = fixed + slopes.get(feature, 0.0) * innovations.features[feature]
    own_scale = None if accel is None else _standard(np.abs(np.r_[accel[:1], accel[:-1]]), innovations.rows)
    # as `innovation_law.features` has it
    e = innovations.x / innovations.size
    middle = float(np.mean(e[innovations.rows] ** 2))
    keep = math.exp(-innovations.dt / MEMORY_S)
    square = np.where(innovations.rows, e * e, middle)
    known = lfilter([1.0 - keep], [1.0, -keep], square, zi=[keep * middle])[0]
    recent = _standard(_log(np.r_[middle, known[:-1]], middle), innovations.rows)
    return Source(
        noise,
        law,
        slopes,
        fixed,
        own_scale,
        recent,
        middle,
        innovations.dt,
        scale,
        z - z.mean(),
        residual,
        innovations.size,
    )


def _standard(x: Array, rows: Flags) -> Standard:
    return Standard(float(np.mean(x[rows])), max(float(np.std(x[rows])), 1e-9))


def _log(square: Array, middle: float) -> Array:
    out: Array = 0.5 * np.log(square + 1e-3 * middle + 1e-300)
    return out


def resampled(pool: Array, shape: tuple[int, int], block: int, rng: np.random.Generator) -> Array:
    """Draw columns of innovations, block by block: moving-blocks bootstrap (Künsch 1989).

    Example:
        >>> resampled(np.arange(9.0), (3, 2), 3, np.random.default_rng(0)).shape
        (3, 2)
    """
    length, columns = shape
    block = min(block, pool.size)
    starts = rng.integers(0, pool.size - block + 1, (-(-length // block), columns))
    index = (starts[:, None, :] + np.arange(block)[None, :, None]).reshape(-1, columns)[:length]
    out: Array = pool[index]
    return out


def sampler(
    drawn_from: Source, rows: npt.NDArray[np.int64], past: int, rng: np.random.Generator
) -> Callable[[int, Array], Array]:
    """Return the noise of each simulated sample: (row, own acceleration (m,) of the row before) -> (m,).

    Args:
        drawn_from: what is drawn from.
        rows: (k, m) samples of the drive, one column per simulated stretch.
        past: rows of history.
        rng: of the draws.
    """
    length, m = rows.shape
    noise, p = drawn_from.noise, drawn_from.noise.A.size - 1
    z = resampled(drawn_from.pool, (length, m), max(round(BLOCK_S / drawn_from.dt), 1), rng)
    own_slope = drawn_from.slopes.get(ScaleFeature.OWN_ACCELERATION, 0.0)
    recent_slope = drawn_from.slopes.get(ScaleFeature.PAST_INNOVATIONS, 0.0)
    keep = math.exp(-drawn_from.dt / MEMORY_S)
    # latest first
    history = np.stack([drawn_from.residual[rows[past - k]] for k in range(1, p + 1)])
    square = np.full(m, drawn_from.middle)

    def drawn(k: int, accel: Array) -> Array:
        nonlocal square, history
        log = drawn_from.fixed[rows[k]] + recent_slope * drawn_from.recent(_log(square, drawn_from.middle))
        if drawn_from.own is not None:
            log = log + own_slope * drawn_from.own(np.abs(accel))
        x = drawn_from.law.sd * np.exp(np.clip(log, -MAX_LOG_SCALE, MAX_LOG_SCALE)) * z[k]
        square = square + (1.0 - keep) * ((x / drawn_from.size[rows[k]]) ** 2 - square)
        now = noise.sd * x - noise.A[1:] @ history
        history = np.vstack([now[None, :], history[:-1]])
        return np.asarray(now)

    return drawn
