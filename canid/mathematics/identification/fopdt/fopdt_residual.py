"""Residual of a FOPDT fit, whitened by its noise model: what the residual tests are made of.

Made outside the fit, from rows (regression_rows.py) and what the fit says of itself: the weights of its basis, the
offset, the noise model and its stride.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import autoregression, residual_tests
from canid.mathematics.identification.fopdt import offset_drift, regression_rows
from canid.mathematics.identification.fopdt.grid_search import CHUNK_ROWS, ProcessFit
from canid.mathematics.identification.output_filter import equalizer, filtered
from canid.values.types import NAN, Array, OutputFilter, ResidualTests, Trace


class Simulated(NamedTuple):
    """Rows, with the fitted model's answer in the place of the basis' answers."""

    output: Array  # (n,)
    answer: Array  # (n,) without the offset; NaN where it is not known
    usable: npt.NDArray[np.bool_]  # (n,)
    inputs: Array  # (n, m)
    step: float  # s


def simulate_window(layout: regression_rows.Layout, window: Array, fit: ProcessFit) -> Simulated:
    """Simulate a window's rows.

    Args:
        layout: of the rows.
        window: (n, width).
        fit: of these rows.
    """
    m = layout.inputs
    answer = window[:, 2 + m :] @ fit.point.w
    return Simulated(window[:, 0], answer, window[:, 1] > 0.0, window[:, 2 : 2 + m], layout.step)


def simulate_drive(layout: regression_rows.Layout, trace: Trace, fit: ProcessFit, settle: float) -> Simulated:
    """Make a drive's rows again, piece by piece, and simulate them.

    Args:
        layout: of the rows.
        trace: of the drive.
        fit: of these rows.
        settle: s after a break in which the unknown history still matters.
    """
    samples = np.column_stack([trace.output, trace.learn, trace.segment.astype(float), trace.inputs])
    state, parts = regression_rows.State(), []
    for first in range(0, len(samples), CHUNK_ROWS):
        state, rows = regression_rows.put(layout, state, samples[first : first + CHUNK_ROWS], settle)
        parts.append(simulate_window(layout, rows, fit))
    if not parts:
        return simulate_window(layout, np.zeros((0, layout.width)), fit)
    return Simulated(
        np.concatenate([part.output for part in parts]),
        np.concatenate([part.answer for part in parts]),
        np.concatenate([part.usable for part in parts]),
        np.concatenate([part.inputs for part in parts]),
        layout.step,
    )


def whitened(
    simulated: Simulated, fit: ProcessFit, output_filter: OutputFilter | None = None
) -> tuple[Array, Array]:
    """Whitened residual and response of the model (n,), NaN where they or their past are not usable.

    Args:
        simulated: the rows.
        fit: of these rows.
        output_filter: as in the fit.
    """
    output, answer, usable = simulated.output, simulated.answer, simulated.usable
    by = equalizer(output_filter, simulated.step)
    if by is not None:
        output, known = filtered(by.output, output)
        answer, also = filtered(by.answers, answer)
        usable = usable & known & also
    response = np.where(usable, answer, NAN)
    residual = np.where(usable, output - answer - fit.point.offset, 0.0)
    residual = offset_drift.of_fit(fit.drift, residual, usable, fit.noise, fit.stride, simulated.step)
    both = np.where(usable, residual, NAN), response
    e, white = (autoregression.whiten(x, fit.noise, fit.stride) for x in both)
    for x in (e, white):
        x[: len(fit.noise) * fit.stride] = NAN
    return e, white


def run_tests(
    simulated: Simulated, fit: ProcessFit, names: Sequence[str], output_filter: OutputFilter | None = None
) -> ResidualTests:
    """Residual tests of a fit, over all phases of its stride.

    Args:
        simulated: the rows.
        fit: of these rows.
        names: (m,) of the inputs.
        output_filter: as in the fit.
    """
    e, response = whitened(simulated, fit, output_filter)
    return residual_tests.run_tests(e, simulated.inputs, names, len(fit.noise), fit.stride, response)
