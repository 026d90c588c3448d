"""Values that were joined by lines and rounded behind that: a linear spline at one phase alone leaves just the rounding.

A program that draws lines between readings writes them with the decimals of its file. Each value is then off its line by
a uniform error of up to half a step, which hides single bends: a period is proposed by the periodogram of the squared
second differences, and the spline of that period judged by its sum of squares (Widrow & Kollar 2008). With its knots
halfway between, it must leave more in half of the segments: what bends a few times has no clock.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from canid.signals.samples.update_instants import ROUNDING_KURTOSIS, SURE_SD, line_residuals
from canid.values.types import Array

# s; bends are looked for in means over so long
MEAN_S = 0.1
# Hz, of the knots that are looked for, oversampled four times for spans of ten seconds
RATES = np.arange(36, 200) / 40.0
# power of the periodogram over its mean, from which on a spline is tried: of 40 independent exponential ones the largest
# exceeds it once in 10
MIN_PEAK = 6.0
# relative to the proposed period, and phases of each, that are tried; rounds in which both become twice as fine
PERIODS, PHASES, ROUNDS = np.linspace(0.9925, 1.0075, 4), 12, 6
# of the readings, that must be straight within their rounding: where noise is larger there is nothing to fit
STRAIGHT_STEPS, STRAIGHT_SHARE = 2.05, 0.3
# readings from knot to knot, of fewer a spline takes nearly all; means that are needed; readings that it is fitted to
MIN_KNOT_READINGS, MIN_MEANS, READINGS = 2.5, 50, 200
# segments that must bend, and their share: a smooth signal bends in some
MIN_SEGMENTS, MIN_BENT_SHARE = 6, 0.5


def period(t: Array, value: Array, step: float) -> float:
    """Seconds between the knots; 0: there are none.

    Args:
        t: (n,) s, ascending, at about equal intervals.
        value: (n,).
        step: to multiples of which they are rounded.

    Example:
        >>> t, knots = 0.05 * np.arange(200), np.random.default_rng(1).standard_normal(30)
        >>> lines = np.interp(t, 0.13 + 0.4 * np.arange(30), knots)
        >>> round(period(t, np.round(lines, 1), 0.1), 2), period(t, np.round(np.sin(t), 1), 0.1)
        (0.4, 0.0)
    """
    interval = float(t[-1] - t[0]) / (len(t) - 1)
    width = max(round(MEAN_S / interval), 1)
    means = len(t) // width
    straight = np.abs(np.diff(value, 2)) <= STRAIGHT_STEPS * step
    if not step > 0.0 or means < MIN_MEANS or straight.mean() < STRAIGHT_SHARE:
        return 0.0
    mean = value[: means * width].reshape(means, width).mean(axis=1)
    bend = np.square(np.diff(mean, 2))
    rates = RATES[RATES * interval * MIN_KNOT_READINGS <= 1.0]
    waves = _waves(len(bend), round(width * interval, 4))[: len(rates)]
    power = np.square(np.abs(waves @ (bend - bend.mean())))
    k = int(power.argmax())
    if not power[k] > MIN_PEAK * power.mean():
        return 0.0
    every = max(len(t) // READINGS, 1)
    t, value = t[::every] - t.mean(), value[::every]
    best = _best(t, value, (PERIODS / rates[k])[:, np.newaxis], np.arange(PHASES) / PHASES)
    wide, turn = 0.5 * float(PERIODS[1] - PERIODS[0]) * best[1], 0.5 * best[1] / PHASES
    near = np.array([-1.0, 0.0, 1.0])
    for fine in (0.5 ** np.arange(ROUNDS)).tolist():
        _, dt, phase = best
        periods = (dt + fine * wide * near)[:, np.newaxis]
        best = _best(t, value, periods, (phase + fine * turn * near) / periods)
    variance = step * step / 12.0
    # the rate may be a harmonic of that of the knots
    _, dt, phase = best
    twice = _best(t, value, np.array([[2.0 * dt]]), 0.5 * phase / dt + np.array([0.0, 0.5]))
    for left, dt, phase in (twice, best):
        free = len(t) - (t[-1] - t[0]) / dt - 2.0
        if left <= variance * (free + SURE_SD * (ROUNDING_KURTOSIS * free) ** 0.5):
            # knots halfway between must leave more than the rounding
            halfway = np.square(line_residuals(t, value, np.array([dt]), np.array([phase + 0.5 * dt]))[0])
            segment = np.floor((t - phase) / dt - 0.5).astype(int)
            total, length = (np.bincount(segment - segment[0], weights) for weights in (halfway, None))
            bent = total > variance * (length + SURE_SD * np.sqrt(ROUNDING_KURTOSIS * length))
            return dt if np.count_nonzero(bent) >= max(MIN_SEGMENTS, MIN_BENT_SHARE * len(bent)) else 0.0
    return 0.0


@lru_cache(8)
def _waves(n: int, interval: float) -> npt.NDArray[np.complex128]:
    """Waves of `RATES` at n instants that are so many s apart, (rates, n)."""
    waves: npt.NDArray[np.complex128] = np.exp(-2j * np.pi * interval * np.outer(RATES, np.arange(n)))
    return waves


def _best(t: Array, value: Array, periods: Array, turns: Array) -> tuple[float, float, float]:
    """The least sum of squares that a spline leaves, and its period and phase; `turns`: of a period, each of each period."""
    dt, phase = (each.ravel() for each in np.broadcast_arrays(periods, periods * turns))
    left = np.square(line_residuals(t, value, dt, phase)).sum(axis=1)
    k = int(left.argmin())
    return float(left[k]), float(dt[k]), float(phase[k])
