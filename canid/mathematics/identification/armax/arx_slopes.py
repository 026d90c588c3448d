"""Slopes of an ARX model of one input by its gain and its dead time, in products over seconds.

With the white residual e and B u what the input adds, the slope by a relative gain is B u and that by the dead time −B u′;
next to them stand the offset and all lags, so that a test of a drift counts what the model itself may take of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.armax.armax_batch import ArmaxFit
from canid.values.types import Array


class Slopes(NamedTuple):
    """Products of the slopes over blocks of a second, as `dead_time_trend.fit` takes them for one input."""

    parts: Array  # (b, c, c) of gain, offset, lags, dead time (1/s) and the residual, over the residual's deviation
    inputs: int
    end: Array  # (b,) s, of the last row of each block


def products(fit: ArmaxFit, output: Array, given: Array, dt: float) -> Slopes:
    """Multiply the slopes at a fit out.

    Args:
        fit: an ARX model (nc = 0) of one input.
        output: (n,) that it was fitted to; NaN where not measured.
        given: (n,) its input, likewise.
        dt: s, of the grid.

    Example:
        >>> from canid.mathematics.identification.armax.armax_batch import Orders, fit_armax
        >>> rng, y = np.random.default_rng(0), np.zeros(900)
        >>> u = rng.normal(size=900)
        >>> for t in range(2, 900): y[t] = 0.8 * y[t-1] + 0.5 * u[t-2] + 0.1 * rng.normal()
        >>> fit = fit_armax(y, u[:, None], np.ones(900, dtype=bool), Orders(1, 3, 0, 1))
        >>> slopes = products(fit, y, u, 0.1)
        >>> slopes.parts.shape, round(float(slopes.end[-1]), 1)  # gain, offset, one lag of y, two of u, dead time, residual
        ((90, 7, 7), 89.9)
    """
    order, b = fit.orders, fit.B[0]
    known = np.isfinite(fit.residual)

    def lags(x: Array, first: int, count: int) -> Array:
        x = np.where(np.isfinite(x), x, 0.0)
        return np.array([np.r_[np.zeros(k), x[: x.size - k]] for k in range(first, first + count)])

    u = lags(given, order.nk, order.nb + 1)
    gain, slower = b @ u[:-1], -(b @ (u[:-1] - u[1:])) / dt
    # the gain's slope holds the lag that is left out
    others = np.delete(u[:-1], int(np.argmax(np.abs(b))), axis=0)
    rows = [gain[None], np.ones((1, gain.size)), lags(output, 1, order.na), others, slower[None]]
    columns = np.vstack([*rows, np.where(known, fit.residual, 0.0)[None]]) / fit.sigma
    columns[:, ~known] = 0.0
    block = max(round(1.0 / dt), 1)
    lacking = -columns.shape[1] % block
    blocks = np.pad(columns, ((0, 0), (lacking, 0))).reshape(len(columns), -1, block).transpose(1, 0, 2)
    end = (np.arange(1, len(blocks) + 1) * block - lacking - 1) * dt
    return Slopes(blocks @ blocks.transpose(0, 2, 1), 1, end)
