"""The frequency response as measured: an ARX model of so many coefficients that it assumes no form of the driver.

Spectra alone cannot part the driver's answer from the way in which the driver's own noise returns through car and traffic:
in a closed loop S_yu/S_uu is drawn towards the loop's inverse. The direct prediction-error method is consistent there as
soon as its noise model is rich enough (Forssell & Ljung 1999, sec. 4.1), as an ARX model of high order is (Ljung & Wahlberg
1992).
Its band is that of least squares, pointwise 95 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.systems.driver_response import FREQUENCIES_HZ, Band, Complex
from canid.values.runs import Flags
from canid.values.types import Array, Trace

# s of the output's and of each input's past in the model
OUTPUT_PAST_S, INPUT_PAST_S = 2.5, 4.0
# usable samples for each coefficient: with fewer the band is as wide as the figure
LEAST_PER_COEFFICIENT = 8
DRAWS = 400
# frequencies that are given
POINTS = 24
# coefficients at most: of finer sampling the past is as short as that
MOST_LAGS = 40


class Measured(NamedTuple):
    """One input's measured response."""

    frequency: Array  # (m,) Hz
    magnitude: Band  # (m,) output units per input unit
    phase: Band  # (m,) degrees, unwrapped from the lowest frequency on
    samples: int


def measured_responses(trace: Trace) -> Mapping[str, Measured]:
    """Measure the response to every input of a drive; empty: too few uninterrupted data.

    Args:
        trace: of the drive; a sample is used if it may be learned from and all of its past is known.
    """
    na, nb = (min(round(past / trace.dt), MOST_LAGS) for past in (OUTPUT_PAST_S, INPUT_PAST_S))
    rows = np.column_stack([trace.output, trace.inputs])
    known: Flags = np.asarray(np.isfinite(rows).all(axis=1))
    most, n = max(na, nb), len(rows)
    count = na + len(trace.input_names) * nb + 1
    if n <= most:
        return {}
    at = np.arange(most, n)
    # as many known samples of the same segment before it as the model reaches back
    broken = np.cumsum(~known | (np.diff(trace.segment, prepend=trace.segment[:1]) != 0))
    at = at[trace.learn[at] & (broken[at] == broken[at - most]) & known[at - most]]
    if len(at) < LEAST_PER_COEFFICIENT * count:
        return {}
    past = [-trace.output[at - k] for k in range(1, na + 1)]
    past += [u[at - k] for u in trace.inputs.T for k in range(1, nb + 1)]
    regressors = np.column_stack([*past, np.ones(len(at))])
    y = trace.output[at]
    scale = np.maximum(np.abs(regressors).max(axis=0), 1e-300)
    # coefficients that the data do not hold, as those of an input that stands still, are zero
    inverse = np.linalg.pinv((regressors / scale).T @ (regressors / scale), rcond=1e-12, hermitian=True)
    theta = inverse @ ((regressors / scale).T @ y)
    left = y - (regressors / scale) @ theta
    covariance = inverse * float(left @ left) / (len(at) - count)
    drawn = np.random.default_rng(0).multivariate_normal(theta, covariance, DRAWS, method="eigh")
    theta, drawn = theta / scale, drawn / scale
    f: Array = np.geomspace(FREQUENCIES_HZ[0], min(FREQUENCIES_HZ[-1], 0.4 / trace.dt), POINTS)
    z = np.exp(-2j * math.pi * f * trace.dt)
    powers = z[:, None] ** np.arange(1, most + 1)
    out = {}
    for i, name in enumerate(trace.input_names):
        columns = slice(na + i * nb, na + (i + 1) * nb)
        point, many = (
            (each[..., columns] @ powers[:, :nb].T) / (1.0 + each[..., :na] @ powers[:, :na].T)
            for each in (theta, drawn)
        )
        out[name] = Measured(f, *_along_and_across(point, many), len(at))
    return out


def _along_and_across(at: Complex, drawn: Complex) -> tuple[Band, Band]:
    """Magnitude and phase (degrees), with intervals from the scatter of a complex number along it and across.

    Not from magnitudes of the draws: the magnitude of an estimate that is nothing but noise is that of the noise, and a
    draw around it is larger still.
    """
    size = np.abs(at)
    turned = (drawn - at) * (at / np.maximum(size, 1e-300)).conj()
    along, across = (NORMAL_QUANTILE * np.std(part, axis=0) for part in (turned.real, turned.imag))
    angle = np.degrees(np.arcsin(np.minimum(across / np.maximum(size, 1e-300), 1.0)))
    angle = np.where(across < size, angle, 180.0)
    phase = np.degrees(np.unwrap(np.angle(at)))
    return Band(size, np.maximum(size - along, 0.0), size + along), Band(phase, phase - angle, phase + angle)
