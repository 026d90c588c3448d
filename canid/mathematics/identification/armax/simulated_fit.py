"""Simulation of a fitted model from its inputs alone, and how much of the output it explains (Ljung 1999, sec. 16.5)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.armax import polynomial
from canid.mathematics.identification.armax.armax_batch import ArmaxFit
from canid.values.types import NAN, Array

# s; after which a simulation has forgotten that it began at rest
FORGOTTEN_S = 4.5


def fit_percent(output: Array, residual: Array, usable: npt.NDArray[np.bool_]) -> float:
    """Return 100 (1 - |residual| / |output|), both about their means; zero: no better than the mean.

    Args:
        output: (n,).
        residual: (n,) output minus simulation.
        usable: (n,) which are compared.

    >>> y = np.array([1.0, 2.0, 3.0, 4.0])
    >>> fit_percent(y, 0.5 * y, np.full(4, True)), fit_percent(y, 2.0 * y, np.full(4, True))
    (50.0, -100.0)
    """
    if not usable.any():
        return NAN
    power = float(np.var(output[usable]))
    return 100.0 * (1.0 - (float(np.var(residual[usable])) / power) ** 0.5) if power > 0.0 else NAN


def armax_fit_percent(
    fit: ArmaxFit,
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    segment: npt.NDArray[np.int64] | None,
    dt: float,
) -> float:
    """Simulate B/A u from rest in every run of known inputs, and compare where the rest is forgotten.

    Args:
        fit: of these samples.
        output: (N,).
        inputs: (N, m).
        usable: (N,) whether the output may be compared.
        segment: (N,), changes where the inputs' history breaks.
        dt: s, the grid's step.

    Returns:
        In %; NaN where nothing can be compared, or the model is unstable.

    >>> from canid.mathematics.identification.armax.armax_batch import Orders, fit_armax
    >>> rng = np.random.default_rng(0)
    >>> u, e, y = rng.normal(size=(800, 1)), 0.1 * rng.normal(size=800), np.zeros(800)
    >>> for t in range(1, 800): y[t] = 0.8 * y[t-1] + 0.5 * u[t-1, 0] + e[t]
    >>> fit, every = fit_armax(y, u, np.full(800, True), Orders(1, 1, 0, 1)), np.full(800, True)
    >>> round(armax_fit_percent(fit, y, u, every, None, 0.1) / 10.0)
    8
    """
    simulated = simulate(fit, inputs, segment, dt)
    compared = usable & np.isfinite(simulated) & np.isfinite(output)
    return fit_percent(output, output - simulated, np.asarray(compared))


def simulate(fit: ArmaxFit, inputs: Array, segment: npt.NDArray[np.int64] | None, dt: float) -> Array:
    """Simulate B/A u from rest in every run of known inputs.

    Args:
        fit: the model.
        inputs: (N, m).
        segment: (N,), changes where the inputs' history breaks.
        dt: s, the grid's step.

    Returns:
        (N,) without the offset; NaN where the rest is not yet forgotten, and everywhere where the model is unstable.
    """
    if not polynomial.is_stable(fit.A[1:].tolist()):
        return np.full(len(inputs), NAN)
    known: npt.NDArray[np.bool_] = np.asarray(np.isfinite(inputs).all(axis=1))
    driven = since(known, segment)
    simulated = np.zeros(len(inputs))
    for b, u in zip(fit.B, np.where(known[:, None], inputs, 0.0).T, strict=True):
        for lag, value in enumerate(b, fit.orders.nk):
            late = np.zeros(len(u))
            late[lag:] = u[: len(u) - lag] if lag else u
            simulated += value * np.where(driven >= lag, late, 0.0)
    simulated = polynomial.divide(simulated, fit.A[1:], driven)
    settled: Array = np.where(driven >= round(FORGOTTEN_S / dt), simulated, NAN)
    return settled


def since(good: npt.NDArray[np.bool_], segment: npt.NDArray[np.int64] | None) -> npt.NDArray[np.int64]:
    """Samples since a run of True in one segment began, (n,); -1 outside.

    >>> since(np.array([True, True, False, True]), None)
    array([ 0,  1, -1,  0])
    """
    k = np.arange(len(good))
    begins = good & ~np.concatenate([[False], good[:-1]])
    if segment is not None:
        begins |= good & np.concatenate([[False], np.diff(segment) != 0])
    first = np.maximum.accumulate(np.where(begins, k, 0))
    return np.where(good, k - first, -1)
