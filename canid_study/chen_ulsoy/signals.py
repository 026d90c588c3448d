"""Spectra and coherence of lateral error and steering angle (Chen & Ulsoy 2001, Fig. 4-7), by Welch's method (1967).

And whether the error excites enough directions for a model to be found from it (sec. 2.3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import coherence, welch

from canid.mathematics.identification.confidence import MISS
from canid.values.types import Array

# s; of one window: frequencies 0.05 Hz apart, and five half-overlapping windows in a segment of a minute
WINDOW_S = 20.0
# decimals, m: values that are equal to these are the same
_DECIMALS = 9


class Spectra(NamedTuple):
    """Averages over all segments."""

    frequency: Array  # (F,) Hz
    error: Array  # (F,) power spectral density, m²/Hz
    angle: Array  # (F,) deg²/Hz
    coherence: Array  # (F,)
    threshold: float  # coherence that independent signals exceed in 5 % at one frequency
    fall_error_db: float  # from the largest to that at the Nyquist frequency
    fall_angle_db: float
    averages: int  # windows that the coherence averages over


def spectra(error: Array, angle: Array, dt: float) -> Spectra:
    """Average over all windows of all segments.

    Args:
        error: (S, N).
        angle: (S, N).
        dt: s.

    >>> x, y = np.random.default_rng(0).normal(size=(2, 8, 600))
    >>> spectrum = spectra(x, y, 0.1)
    >>> bool((spectrum.coherence[1:-1] > spectrum.threshold).mean() < 0.2), round(spectrum.threshold, 3)
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
        f,
        whole_y,
        whole_d,
        C,
        1.0 - MISS ** (1.0 / (averages - 1)),
        _fall_db(whole_y),
        _fall_db(whole_d),
        averages,
    )


def left_spectra(error: Array, n: Array, dt: float, settle: float) -> Spectra | None:
    """The same of the error and what the model leaves of the angle, in whole windows behind its first seconds.

    Args:
        error: (S, N).
        n: (S, N); NaN where a model has none.
        dt: s.
        settle: s in which the simulated model forgets how it began.

    Returns:
        None where no segment has one.

    >>> y = np.random.default_rng(0).normal(size=(8, 600))
    >>> bool(left_spectra(y, 2.0 * y, 0.1, 3.0).coherence[1:].min() > 0.999)
    True
    """
    known = np.isfinite(n).all(axis=1)
    if not known.any():
        return None
    N = error.shape[1]
    size = min(round(WINDOW_S / dt), N)
    last = size * max((N - round(settle / dt)) // size, 1)
    return spectra(error[known, -last:], n[known, -last:], dt)


def excitation(error: Array, order: int) -> Array:
    """Smallest eigenvalue of the covariance of `order` successive errors, in each segment, over that of their rounding.

    An input excites persistently of an order where that covariance is positive definite (Ljung 1999, def. 13.1). Values
    that are rounded to steps of q have at least q²/12 in each direction, whatever was there before.

    Args:
        error: (S, N) m.
        order: of the covariance.

    Returns:
        (S,); about 1 and less: nothing but rounding is there in one direction.

    >>> t = np.arange(600) * 0.1
    >>> wave = np.sin(t + np.arange(6)[:, None])
    >>> noise = np.random.default_rng(0).normal(size=wave.shape)
    >>> [bool((excitation(np.round(x, 2), 4) > 2.0).all()) for x in (wave, wave + 0.1 * noise)]
    [False, True]
    """
    values = np.unique(np.round(error, _DECIMALS))
    step = float(np.diff(values).min()) if len(values) > 1 else 10.0**-_DECIMALS
    lags = np.lib.stride_tricks.sliding_window_view(error - error.mean(axis=1, keepdims=True), order, axis=1)
    covariance = np.einsum("sni,snj->sij", lags, lags) / lags.shape[1]
    smallest: Array = np.linalg.eigvalsh(covariance)[:, 0]
    return np.maximum(smallest, 0.0) / (step**2 / 12.0)


def _fall_db(power: Array) -> float:
    """From the largest to the mean of the highest tenth of frequencies."""
    top = power[-max(len(power) // 10, 1) : -1]
    return float(10.0 * np.log10(power.max() / max(float(top.mean()), 1e-300)))
