"""State of a recursive Box-Jenkins model, and the least squares of its memories at the common lags and dead times."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.identification import innovation_law
from canid.mathematics.identification.armax import forgetting_mixture
from canid.mathematics.identification.fopdt import posterior_cells, reduced_basis
from canid.mathematics.identification.fopdt import regression_rows as rows
from canid.mathematics.identification.fopdt.row_noise import by_channel
from canid.values.state_constraints import FINITE, NOT_NEGATIVE, POSITIVE
from canid.values.types import NAN, Array


class Quality(NamedTuple):
    """Exponentially weighted means and variances of the output and of what the simulation leaves."""

    mean: tuple[float, float]
    power: Annotated[tuple[float, float], NOT_NEGATIVE]
    samples: Annotated[int, NOT_NEGATIVE]

    @property
    def fit_percent(self) -> float:
        """Of the simulation; NaN: not known."""
        y, v = self.power
        return 100.0 * (1.0 - (v / y) ** 0.5) if y > 0.0 else NAN


class State(NamedTuple):
    """What the next rows need; k memories, the longest last, c columns: answers, output, one, lagged residuals."""

    making: rows.State
    tail: Array  # (n, width) rows that whitening or the output filter still needs
    ready: int  # rows of the tail that are history alone
    ar: Annotated[Array, FINITE]  # (p,) of every `stride`-th row
    mean_ar: Annotated[Array, FINITE]  # (p,) mean over the rows that the longest memory knows
    stride: Annotated[int, POSITIVE]
    reference: float  # subtracted from the output
    products: Annotated[Array, FINITE]  # (k, c, c)
    weights: Annotated[Array, NOT_NEGATIVE]  # (2, k) sums of the rows' weights and of their squares
    regions: Annotated[tuple[posterior_cells.Region, ...], FINITE]  # where the posterior lies
    point: Annotated[Array, FINITE]  # (3, m) gain, tau, dead time at which predictions are made
    nodes: Annotated[Array, FINITE]  # (3, m, m b) weights of the unit answers there, and of their slopes
    offset: float
    trust: forgetting_mixture.Trust
    recent: Annotated[float, NOT_NEGATIVE]  # variance of the innovations over the last RECENT_S seconds
    score: Annotated[Array, NOT_NEGATIVE]  # (2, 3 m) as of armax_recursive.State
    tested: Array  # (n, 2 + m) the last innovations, outputs and inputs
    law: innovation_law.Law  # of the innovations
    quality: Annotated[Quality, FINITE]
    blocks: Annotated[int, NOT_NEGATIVE]
    phase: Annotated[int, NOT_NEGATIVE]  # of the next row within the stride
    restarts: Annotated[int, NOT_NEGATIVE]  # times that the longest memory was refuted


def unit_answers(layout: rows.Layout, tau: Array, dead_time: Array) -> Array:
    """(3, m, m b) weights of the unit answers and of their slopes by lag and dead time, by channel."""
    each = reduced_basis.with_slopes(layout.basis, tau, dead_time)
    return np.array([by_channel(layout, w) for w in each])


def solved(layout: rows.Layout, state: State) -> tuple[Array, Array, Array, Array, Array]:
    """Least squares of gains, offset and what D errs by, (m + 1 + p,), in each memory at the common lags and dead times.

    Returns:
        (m + 1 + p, c) these regressors from the columns; (k, m + 1 + p) their products with the output; the solution; the
        inverse of their products; (k, m) sums of squares of the unit answers.
    """
    m, size = layout.inputs, layout.inputs * layout.basis.size
    turn = np.zeros((m + 1 + len(state.ar), state.products.shape[1]))
    turn[:m, :size] = state.nodes[0]
    turn[m:, size + 1 :] = np.eye(len(turn) - m)
    part = turn @ state.products
    gram, along = part @ turn.T, part[:, :, size]
    held = gram[:, range(m), range(m)].copy()
    # what never moved stays zero
    gram[:, range(len(turn)), range(len(turn))] *= 1.0 + 1e-9
    gram += 1e-9 * np.eye(len(turn))
    inverse = np.asarray(np.linalg.inv(gram), np.float64)
    theta: Array = np.einsum("kij,kj->ki", inverse, along)
    return turn, along, theta, inverse, held


def lead(state: State) -> int:
    """Return the memory that is believed most."""
    return max(range(len(state.trust.weights)), key=state.trust.weights.__getitem__)
