"""The filter that an output passed before it was recorded: undone for the noise, and applied to the model's answers.

An acceleration is mostly the derivative of measured speeds, smoothed by a centred filter F. The output is then
F (answer + noise), and F looks into the future: in a closed loop the inputs there have already answered to the noise
here, so that comparing it with filtered answers is biased (on accelerations behind a Savitzky-Golay filter of 1.1 s the
dead time comes out near 0.45 s, whatever it is). With G, the inverse of F as far as F leaves anything, G F is nearly
one: G times the output is compared with G F times the answers, exactly, and its noise is the driver's own again.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array, OutputFilter

# Power, against the filter's gain at zero, below which nothing is restored: what is there was rounded, not measured.
LOST_POWER = 1e-4
# s; the inverse is cut off so far from its middle. The answers pass what is left of it too, so nothing is lost but
# the rows at the ends.
REACH_S = 2.5
# Time constants after which a first-order filter has forgotten.
FORGOTTEN = 5.0
# Frequencies at which the filter is inverted.
FREQUENCIES = 2048
# Why no delay may be quoted of an output that passed a filter nobody has stated.
DELAYS_HOLD_IT = "τ and θ hold the delay of the output's own filter: state it, [driver] output_filter"


class Kernel(NamedTuple):
    """Weights of the rows from `before` earlier to `after` later."""

    weights: Array  # (before + 1 + after,), of the latest row first
    before: int
    after: int


class Equalizer(NamedTuple):
    """What output and answers pass, so that both have passed the same."""

    output: Kernel  # G
    answers: Kernel  # G F


def kernel(output_filter: OutputFilter, step: float) -> Kernel:
    """Weights of a filter for rows every `step` s; they sum to one.

    >>> kernel(OutputFilter("moving_average", 0.3), 0.1).weights.round(3)
    array([0.333, 0.333, 0.333])
    >>> kernel(OutputFilter("savitzky_golay", 0.5), 0.1).weights.round(2)
    array([0.1 , 0.25, 0.3 , 0.25, 0.1 ])
    """
    if output_filter.kind == "first_order" and output_filter.width > 0.0:
        lags = np.arange(int(np.ceil(FORGOTTEN * output_filter.width / step)) + 1)
        weights = np.exp(-lags * step / output_filter.width)
        return Kernel(weights / weights.sum(), len(lags) - 1, 0)
    half = round((output_filter.width / step - 1.0) / 2.0)
    if output_filter.kind not in ("savitzky_golay", "moving_average") or half < 1:
        return Kernel(np.ones(1), 0, 0)
    if output_filter.kind == "moving_average":
        weights = np.ones(2 * half + 1)
    else:
        # The slope of a local parabola weighs each speed by its distance from the middle (Savitzky & Golay 1964);
        # summed, these are weights on the mean acceleration between two speeds.
        between = np.cumsum(np.arange(-half, half + 1.0))[:-1]
        weights = np.convolve(-between, [0.5, 0.5])
    return Kernel(weights / weights.sum(), half, half)


def is_unknown(output_filter: OutputFilter | None) -> bool:
    """Whether the output was smoothed in a way that nobody has stated.

    >>> is_unknown(OutputFilter("unknown")), is_unknown(None)
    (True, False)
    """
    return output_filter is not None and output_filter.kind == "unknown"


@cache
def equalizer(output_filter: OutputFilter | None, step: float) -> Equalizer | None:
    """Make it for rows every `step` s; None: the filter is unknown, or leaves everything as it is.

    >>> made = equalizer(OutputFilter("moving_average", 0.5), 0.1)
    >>> round(float(made.answers.weights[made.answers.after]), 1), round(float(made.answers.weights.sum()), 2)
    (1.0, 1.01)
    """
    if output_filter is None:
        return None
    smoothing = kernel(output_filter, step)
    if len(smoothing.weights) == 1:
        return None
    at = np.arange(-smoothing.after, smoothing.before + 1)
    response = np.exp(-2j * np.pi * np.outer(np.fft.rfftfreq(FREQUENCIES), at)) @ smoothing.weights
    inverse = np.fft.irfft(np.conj(response) / (np.abs(response) ** 2 + LOST_POWER))
    reach = max(round(REACH_S / step), 1)
    taper = np.hanning(2 * reach + 3)[1:-1]
    weights = np.roll(inverse, reach)[: 2 * reach + 1] * taper
    both = np.convolve(weights, smoothing.weights)
    for shared in (weights, both):
        shared.setflags(write=False)
    return Equalizer(
        Kernel(weights, reach, reach), Kernel(both, reach + smoothing.before, reach + smoothing.after)
    )


def apply(by: Kernel, x: Array) -> Array:
    """Filter (n,); the first `before` and the last `after` values lack what lies beyond the ends. None of none.

    >>> apply(Kernel(np.array([0.5, 0.5]), 1, 0), np.array([1.0, 2.0, 4.0]))
    array([0.5, 1.5, 3. ])
    """
    if not x.size:
        return x
    out: Array = np.convolve(x, by.weights)[by.after : by.after + len(x)]
    return out


def complete(by: Kernel, known: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Where all values that a kernel reads are known, (n,).

    >>> complete(Kernel(np.array([0.5, 0.5]), 1, 0), np.array([True, True, False, True]))
    array([False,  True, False, False])
    """
    taps = len(by.weights)
    out: npt.NDArray[np.bool_] = apply(by._replace(weights=np.ones(taps)), known.astype(float)) > taps - 0.5
    return out


def filtered(by: Kernel, x: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Filter (n,) with NaN where nothing is known; and where all that the kernel reads is.

    >>> filtered(Kernel(np.array([0.5, 0.5]), 1, 0), np.array([1.0, 2.0, np.nan]))[0][:2]
    array([0.5, 1.5])
    """
    known = np.isfinite(x)
    return apply(by, np.where(known, x, 0.0)), complete(by, known)
