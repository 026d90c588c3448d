"""Several inputs together (Grover 2021, sec. 4.5): the sum of models fitted one by one, and what is fitted jointly.

Two responses that each fit the same output add up to about twice the output: the triangle inequality bounds the percentage
of fit of their sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.values.types import Array
from canid_study.grover import miso_bound, output_error, reduction
from canid_study.grover.output_error import OutputError, fit_percent
from canid_study.grover.reduction import FirstOrder

# output units; no pedal and no acceleration is as large, and a response that is has lost all digits of the output
MAX_SIMULATED = 1e12


class Miso(NamedTuple):
    """Percentages of fit of two inputs together on one record, and what they simulate."""

    high_sum: float  # of the per-input models, added
    high_refit: float  # their responses weighed anew: then it is no longer the models that were identified
    reduced_sum: float
    reduced_refit: float
    bound: tuple[float, float]  # of high_sum, by the triangle inequality from the two per-input fits
    high: Array  # (n,) simulated by the sum
    high_weighed: Array  # (n,) weighed anew
    low: Array  # (n,) simulated by the sum of the reduced
    low_weighed: Array  # (n,)
    weights: tuple[
        Array, Array
    ]  # (2,) of the high-order models and of the reduced, with which they are weighed anew


def together(
    output: Array, inputs: Array, dt: float, high: Sequence[OutputError], low: Sequence[FirstOrder]
) -> Miso:
    """Compare on the record from which the models are.

    Args:
        output: (n,) detrended.
        inputs: (n, 2) detrended.
        dt: s.
        high: of high order, one per input.
        low: of first order, one per input.
    """
    simulated = np.column_stack([model.simulated for model in high])
    first = np.column_stack(
        [
            _with_state(
                output, model.K * reduction.response(u, model.tau, model.dead_time, dt), [model.tau], dt
            )
            for model, u in zip(low, inputs.T, strict=True)
        ]
    )
    weights = _weights(output, simulated), _weights(output, first)
    weighed, first_weighed = simulated @ weights[0], first @ weights[1]
    return Miso(
        fit_percent(output, simulated.sum(axis=1)),
        fit_percent(output, weighed),
        fit_percent(output, first.sum(axis=1)),
        fit_percent(output, first_weighed),
        miso_bound.bound(high[0].fit_percent, high[1].fit_percent),
        simulated.sum(axis=1),
        weighed,
        first.sum(axis=1),
        first_weighed,
        weights,
    )


def on_another(
    output: Array,
    inputs: Array,
    high: Sequence[OutputError],
    weights: Array | None = None,
    begin: int | None = None,
) -> Array:
    """Simulate the sum of high-order models on another record, each from the initial state that fits best.

    Args:
        output: (n,) detrended.
        inputs: (n, 2) detrended.
        high: one per input.
        weights: (2,) of each; None: one.
        begin: samples at the beginning from which the initial states are found; None: all; 0: none, at rest.

    Returns:
        (n,), infinite where an unstable model diverges.
    """
    n = len(output)
    with np.errstate(over="ignore", invalid="ignore"):
        responses = [output_error.simulate(m, u) for m, u in zip(high, inputs.T, strict=True)]
        raw = np.column_stack(responses) @ (np.ones(len(high)) if weights is None else weights)
        states = np.hstack([output_error.initial_responses(m, n) for m in high])
        largest = float(np.abs(raw).max()) + float(np.abs(states).max())
    # beyond, squares overflow, and the initial states have no digits left to correct with
    if not largest < MAX_SIMULATED:
        return np.full(n, np.inf)
    return raw + _from_beginning(states, output - raw, begin)


def first_order_on(
    output: Array,
    inputs: Array,
    dt: float,
    models: Sequence[FirstOrder],
    *,
    line: bool = False,
    begin: int | None = None,
) -> Array:
    """Simulate the sum of first-order models on a record, from the initial states that fit best.

    Args:
        output: (n,) detrended.
        inputs: (n, m) detrended.
        dt: s.
        models: one per input.
        line: a straight line as well, where the models are not of detrended records.
        begin: samples at the beginning from which the initial states are found; None: all.
    """
    raw = np.sum(
        [
            model.K * reduction.response(u, model.tau, model.dead_time, dt)
            for model, u in zip(models, inputs.T, strict=True)
        ],
        axis=0,
    )
    return _with_state(output, raw, [model.tau for model in models], dt, line=line, begin=begin)


def _with_state(
    output: Array,
    raw: Array,
    taus: Sequence[float],
    dt: float,
    *,
    line: bool = False,
    begin: int | None = None,
) -> Array:
    n = len(output)
    columns = [reduction.decay(n, tau, dt) for tau in taus]
    if line:
        columns += [np.ones(n), np.linspace(-1.0, 1.0, n)]
    return raw + _from_beginning(np.column_stack(columns), output - raw, begin)


def _from_beginning(basis: Array, error: Array, begin: int | None) -> Array:
    """Combination of the columns (n, k) that fits the first samples of the error best, over all samples."""
    if begin == 0:
        return np.zeros(len(basis))
    size = np.maximum(np.linalg.norm(basis[:begin], axis=0), 1e-300)
    weights = np.linalg.lstsq(basis[:begin] / size, error[:begin], rcond=1e-12)[0]
    out: Array = np.asarray(basis / size @ weights, np.float64)
    return out


def _weights(output: Array, simulated: Array) -> Array:
    """Least-squares factor of each column."""
    return np.asarray(np.linalg.lstsq(simulated, output, rcond=None)[0], np.float64)
