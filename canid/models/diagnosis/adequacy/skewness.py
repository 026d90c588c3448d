"""Skewness of the smoothed residual: slow, occasional pushes that always go the same way.

Reactions to something unmeasured, as a bend of the road, resemble autocorrelated noise. Noise is symmetric; a driver who
lifts for every bend and presses for none leaves a skewed residual.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.values.findings import Flags
from canid.values.types import Array

# s over which the residual is smoothed: shorter than the pushes, so that quick noise is averaged out
SMOOTHING_WINDOWS_S = (1.0, 2.0)
# standard deviations of the residual between the model and floor or ceiling, which cut one side off
LIMIT_DISTANCE_SIGMAS = 3.0
# s; slower than this is a random walk of the desired headway
CORRELATION_S = 20.0
# samples per window, and samples that are needed
SAMPLES_PER_WINDOW, MIN_SMOOTHED_SAMPLES = 4, 80
# standard deviations; one outlier is no skewness
OUTLIER_SIGMAS = 4.0
# skewness of pushes that fill a third of the time: what explains a share s of the residual leaves 1.5 s^(3/2)
PUSH_SKEWNESS = 1.5


class Skewness(NamedTuple):
    """How one-sided a residual is."""

    p: float  # chance of more
    statistic: float  # squared standard deviations
    share: float  # of the residual's variance, roughly


def detect(data: DriverData, solved: FittedDriver) -> Skewness:
    """Test the skewness of the residual and of its innovations, smoothed over each window."""
    output, model = data.output, solved.fitted.model
    free = solved.rows & ~output.hidden
    left = np.where(output.usable, output.y - model, 0.0)
    away = LIMIT_DISTANCE_SIGMAS * float(np.std(left[free])) if free.any() else 0.0
    far = free.copy()
    if data.pedal:
        far &= model > output.floor + away
    far &= model < output.ceiling - away
    best, tests = Skewness(1.0, 0.0, 0.0), 0
    # divided by the noise scale: heteroskedastic noise is not skewed noise
    for source in (left / solved.noise.size, np.where(free, solved.fitted.scored.e, 0.0)):
        for window in SMOOTHING_WINDOWS_S:
            k = round(window / output.dt)
            shape = np.hanning(2 * k + 1)
            if source.size < 4 * k or k < 1:
                continue
            smooth = np.convolve(source, shape / shape.sum(), "same")
            inside = np.convolve(far, np.ones(2 * k + 1), "same") > 2 * k + 0.5
            every = max(k // SAMPLES_PER_WINDOW, 1)
            x, known = smooth[::every], inside[::every]
            if np.count_nonzero(known) < MIN_SMOOTHED_SAMPLES:
                continue
            tests += 1
            score, skewness = skewed(x, known, round(CORRELATION_S / (every * output.dt)))
            p = float(chi2.sf(score * score, 1))
            if p < best.p:
                share = min((abs(skewness) / PUSH_SKEWNESS) ** (2 / 3), 1.0)
                part = float(np.var(x[known])) / max(float(np.var(source[far])), 1e-12)
                best = Skewness(p, score * score, share * min(part, 1.0))
    return best._replace(p=min(1.0, best.p * max(tests, 1)))


def skewed(x: Array, known: Flags, reach: int) -> tuple[float, float]:
    """Skewness of x, in standard deviations and as such.

    The third Hermite polynomial of a normal x has the autocovariance 6 ρ³ where x has ρ.

    Args:
        x: (n,).
        known: (n,) samples that count.
        reach: samples after which nothing is remembered.

    Example:
        >>> x = np.random.default_rng(1).normal(size=2000)
        >>> known = np.ones(2000, dtype=bool)
        >>> abs(skewed(x, known, 10)[0]) < 2, skewed(np.exp(0.5 * x), known, 10)[0] > 5
        (True, True)
    """
    n = int(np.count_nonzero(known))
    z = np.where(known, (x - x[known].mean()) / max(float(x[known].std()), 1e-12), 0.0)

    def pairs(y: Array) -> Array:
        spectrum = np.abs(np.fft.rfft(y, 2 * y.size)) ** 2
        out: Array = np.fft.irfft(spectrum)[1:reach]
        return out

    number = np.maximum(pairs(known.astype(float)), 1.0)
    rho = np.clip(pairs(z) / number, 0.0, 1.0)
    variance = 6.0 * (n + 2.0 * float(rho**3 @ number))
    z = np.clip(z, -OUTLIER_SIGMAS, OUTLIER_SIGMAS)
    third = float(np.sum(np.where(known, z**3 - 3.0 * z, 0.0)))
    return third / float(np.sqrt(variance)), third / n
