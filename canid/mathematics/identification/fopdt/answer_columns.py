"""Rows of a window or a drive at one point (tau, dead time): output, answers and their slopes, whitened and weighted.

With lags and dead times near those of a fit, the driver's response is linear in what may change: gains and offset, and
small shifts of lag and dead time (Gauss-Newton). So the question whether a gain changed is a linear regression on a few
columns, here made ready for it: whitened by the fit's noise model, each minute on a scale of its own, and with Huber's
weights, because the shocks of people have heavy tails (Student's t with 3 to 5 degrees of freedom on measured drives).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt import information_bounds, reduced_basis
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.identification.fopdt.regression_rows import Layout
from canid.mathematics.identification.output_filter import Equalizer, apply, equalizer
from canid.values.state_constraints import FINITE, NOT_NEGATIVE, POSITIVE
from canid.values.types import Array, OutputFilter

# Standard deviations beyond which a whitened residual counts as so large only (Huber 1964): with Gaussian shocks this
# costs 2 % of the information
HUBER_SD = 2.0
# MAD of a Gaussian, in standard deviations
MAD_SD = 0.6745
# s; a stretch with a noise scale of its own: the scale of a person's shocks changes with the traffic
SCALE_S = 60.0
# rows that a scale needs; fewer take that of all rows
MIN_SCALE_ROWS = 100


class Reference(NamedTuple):
    """The fit that columns are made at."""

    K: Annotated[Array, FINITE]  # (m,)
    tau: Annotated[Array, FINITE]  # (m,) s
    dead_time: Annotated[Array, FINITE]  # (m,) s
    size: Annotated[Array, POSITIVE]  # (m,) of each gain, as its changes are measured against it
    noise: Annotated[Array, FINITE]  # (p,) autoregression of every `stride`-th row
    stride: Annotated[int, POSITIVE]
    variance_inflation: Annotated[float, FINITE]
    scale: Annotated[float, NOT_NEGATIVE]  # robust sd of the whitened residual; 0: not known


class Columns(NamedTuple):
    """Whitened columns on the scale of the noise, zero where not usable: a regression on them has variance one."""

    values: Array  # (c, n) answers (m), offset, slopes by tau (m) and dead time (m), output
    weight: Array  # (n,) Huber's, over the noise's variance
    usable: npt.NDArray[np.bool_]  # (n,)
    inputs: int  # m
    precision: Array  # (c - 1,) of the prior of each column's coefficient: the box of tau and dead time
    scale: float  # robust sd of the whitened residual


def reference(fit: ProcessFit) -> Reference | None:
    """Take a fit as the point; None where it has no numbers."""
    gains = [channel.K for channel in fit.channels]
    # a gain that is not identifiable may change by what it is uncertain by
    size = np.array([max(abs(K.value), (K.high - K.low) / (2.0 * NORMAL_QUANTILE)) for K in gains])
    point = fit.point
    if fit.start is None or not (np.isfinite(size).all() and (size > 0.0).all()):
        return None
    return Reference(
        point.K, point.tau, point.dead_time, size, fit.noise, fit.stride, fit.variance_inflation, 0.0
    )


def basis_columns(layout: Layout, rows: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Take answers of all nodes of the basis, one, and the output from rows.

    Args:
        layout: of the rows.
        rows: (n, width) from `regression_rows.put`.

    Returns:
        (m b + 2, n), zero where nothing is known; (n,) usable.
    """
    first = 2 + layout.inputs
    out = np.empty((rows.shape[1] - first + 2, len(rows)))
    out[:-2], out[-2], out[-1] = rows[:, first:].T, 1.0, rows[:, 0]
    known = np.isfinite(out)
    usable: npt.NDArray[np.bool_] = (rows[:, 1] > 0.0) & known.all(axis=0)
    out[~known] = 0.0
    return out, usable


def turn(layout: Layout, at: Reference) -> Array:
    """Weights (c, m b + 2) of the basis columns in those of `Columns.values`."""
    m, b = layout.inputs, layout.basis.size
    weights = reduced_basis.with_slopes(layout.basis, at.tau, at.dead_time)  # (3, m, b)
    weights[1:] *= at.K[:, None]
    out = np.zeros((3 * m + 2, m * b + 2))
    out[m, -2] = out[-1, -1] = 1.0
    for i in range(m):
        # the answer comes before the offset, its slopes after it
        out[[i, m + 1 + i, 2 * m + 1 + i], i * b : (i + 1) * b] = weights[:, i]
    return out


def raw(layout: Layout, rows: Array, at: Reference) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Make the columns of `Columns.values`, not whitened.

    Args:
        layout: of the rows.
        rows: (n, width) from `regression_rows.put`.
        at: the point.

    Returns:
        (c, n), zero where nothing is known; (n,) usable.
    """
    columns, usable = basis_columns(layout, rows)
    return turn(layout, at) @ columns, usable


def rows_read(by: Equalizer | None) -> int:
    """Rows to either side that the longest of both filters reads."""
    return 0 if by is None else max(by.answers.before, by.answers.after)


def white(
    columns: Array,
    usable: npt.NDArray[np.bool_],
    at: Reference,
    output_filter: OutputFilter | None,
    step: float,
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Whiten columns, the output the last of them.

    Args:
        columns: (c, n).
        usable: (n,).
        at: the point, with its noise model.
        output_filter: that the output has passed.
        step: s, of the rows.

    Returns:
        (c, n), zero where not known; (n,) known.
    """
    by = equalizer(output_filter, step)
    values = columns.copy()
    if by is not None:
        for k, row in enumerate(columns):
            values[k] = apply(by.output if k == len(columns) - 1 else by.answers, row)
        reach = rows_read(by)
        near = np.convolve(~usable, np.ones(2 * reach + 1))[reach : reach + len(usable)]
        usable = usable & (near < 0.5)
        usable[:reach], usable[len(usable) - reach :] = False, False
    if not usable.any():
        return np.zeros_like(values), usable
    values *= usable
    plain, known = values.copy(), usable.copy()
    for i, phi in enumerate(at.noise, 1):
        lag = i * at.stride
        values[:, lag:] -= phi * plain[:, :-lag]
        known[lag:] &= usable[:-lag]
        known[:lag] = False
    values *= known
    return values, known


def whitened(
    layout: Layout,
    columns: Array,
    usable: npt.NDArray[np.bool_],
    at: Reference,
    output_filter: OutputFilter | None = None,
) -> Columns | None:
    """Whiten and weigh; None where too few rows are left.

    Args:
        layout: of the rows.
        columns: (c, n) from `raw`.
        usable: (n,).
        at: the point, with its noise model.
        output_filter: that the output has passed.
    """
    m = layout.inputs
    if not usable.any():
        return None
    # numbers near zero keep their digits when products are summed
    columns = np.vstack([columns[:-1], columns[-1] - float(columns[-1, usable].mean())])
    values, known = white(columns, usable, at, output_filter, layout.step)
    if int(known.sum()) < MIN_SCALE_ROWS:
        return None
    by_tau, by_dead_time = information_bounds.precision(layout.basis.box)
    precision = np.concatenate([np.zeros(m + 1), np.full(m, by_tau), np.full(m, by_dead_time)])
    unweighed = Columns(values, known.astype(float), known, m, precision, 1.0)
    return weighed(unweighed, residual(unweighed), at, round(SCALE_S / layout.step))


def residual(columns: Columns, more: Array | None = None) -> Array:
    """Residual (n,) of the regression of the output on all columns.

    Args:
        columns: weighed or not.
        more: (k, n) further columns.
    """
    X, y = columns.values[:-1], columns.values[-1]
    precision = columns.precision
    if more is not None:
        X, precision = np.vstack([X, more]), np.concatenate([precision, np.zeros(len(more))])
    weighted = X * columns.weight
    G = weighted @ X.T
    # without a scale the prior's precision has no meaning yet: what is not identifiable is held by the ridge
    G.flat[:: len(G) + 1] += precision * (columns.scale > 0.0) + 1e-9 * (np.diag(G) + 1e-300)
    out: Array = (y - np.linalg.solve(G, weighted @ y) @ X) * columns.usable
    return out


def weighed(columns: Columns, e: Array, at: Reference, stretch: int, least: float = 0.0) -> Columns:
    """Weigh the rows by a residual: Huber's weights over the variance of each stretch.

    Args:
        columns: whitened.
        e: (n,) residual.
        at: the point: inflation of the variance, and stride.
        stretch: rows with a scale of their own.
        least: of the scale; the residual of a fit that chose its change point is a little too small.
    """
    usable = columns.usable
    overall = max(_scale(e[usable]), least)
    weight = np.zeros(len(e))
    for first in range(0, len(e), stretch):
        part = slice(first, first + stretch)
        stretch_e = e[part][usable[part]]
        scale = max(_scale(stretch_e), least) if len(stretch_e) >= MIN_SCALE_ROWS else overall
        z = np.abs(e[part]) / scale
        w = np.minimum(1.0, HUBER_SD / np.maximum(z, 1e-9)) * usable[part]
        # the variance of a sum of clipped shocks, over the square of what they are clipped by
        variance = float(w @ (w * z * z)) / max(float(w.sum()), 1e-9) * scale * scale
        weight[part] = w / max(variance * at.variance_inflation * at.stride, 1e-300)
    return columns._replace(weight=weight, scale=overall)


def _scale(e: Array) -> float:
    """Robust sd: median absolute deviation (Hampel 1974)."""
    middle = len(e) // 2
    return max(float(np.partition(np.abs(e), middle)[middle]) / MAD_SD, 1e-12) if len(e) else 1e-12
