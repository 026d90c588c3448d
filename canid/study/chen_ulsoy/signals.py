"""Spectra and coherence of lateral error and steering angle (Chen & Ulsoy 2001, Fig. 4-7), by Welch's method (1967)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import coherence, welch

from canid.identification.confidence import MISS
from canid.types import Array

# s; of one window: frequencies 0.05 Hz apart, and five half-overlapping windows in a segment of a minute
WINDOW_S = 20.0


class Spectra(NamedTuple):
    """Averages over all segments."""

    frequency: Array  # (F,) Hz
    error: Array  # (F,) power spectral density, m²/Hz
    angle: Array  # (F,) deg²/Hz
    coherence: Array  # (F,)
    threshold: float  # coherence that independent signals exceed in 5 % at one frequency
    fall_error_db: float  # from the largest to that at the Nyquist frequency
    fall_angle_db: float


def spectra(error: Array, angle: Array, dt: float) -> Spectra:
    """Average over all windows of all segments.

    Args:
        error: (S, N).
        angle: (S, N).
        dt: s.

    >>> x, y = np.random.default_rng(0).normal(size=(2, 8, 600))
    >>> found = spectra(x, y, 0.1)
    >>> bool((found.coherence[1:-1] > found.threshold).mean() < 0.2), round(found.threshold, 3)
    (True, 0.122)
    """
    size = min(round(WINDOW_S / dt), error.shape[1])
    options = {"fs": 1.0 / dt, "nperseg": size, "detrend": "linear"}
    f, Py = welch(error, **options)
    _, Pd = welch(angle, **options)
    whole_y, whole_d = Py.mean(axis=0), Pd.mean(axis=0)
    # coherence of averages, not the average of coherences: segments are further windows
    C = coherence(error.ravel(), angle.ravel(), fs=1.0 / dt, nperseg=size, noverlap=0, detrend="linear")[1]
    averages = max(error.size // size, 2)
    return Spectra(
        f, whole_y, whole_d, C, 1.0 - MISS ** (1.0 / (averages - 1)), _fall_db(whole_y), _fall_db(whole_d)
    )


def _fall_db(power: Array) -> float:
    """From the largest to the mean of the highest tenth of frequencies."""
    top = power[-max(len(power) // 10, 1) : -1]
    return float(10.0 * np.log10(power.max() / max(float(top.mean()), 1e-300)))
