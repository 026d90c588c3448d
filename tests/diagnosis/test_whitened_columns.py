"""Columns are whitened as each would be by itself, and what is whitened stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

from canid.models.diagnosis.fitting.least_squares import Problem, jacobian
from canid.models.diagnosis.fitting.likelihood import Noise, Output, whitened

N, COLUMNS = 700, 5


# one of each way to filter: by convolutions, in blocks, sample by sample
@pytest.mark.parametrize("order", [0, 4, 20, 40])
def test_columns_are_whitened_one_by_one(order: int) -> None:
    """A(q) x / (sd size), written out, of one column and of many; their arrays are left alone."""
    rng = np.random.default_rng(order)
    A = np.r_[1.0, rng.normal(0.0, 0.1, order)]
    noise = Noise(A, 1.7, np.exp(rng.normal(0.0, 0.2, N)), np.empty(0))
    x = rng.normal(size=(N, COLUMNS))
    before = x.copy()
    padded = np.r_[np.zeros((order, COLUMNS)), x]
    plain = sum(a * padded[order - k : order - k + N] for k, a in enumerate(A))
    expected = plain / (1.7 * noise.size)[:, None]
    np.testing.assert_allclose(whitened(noise, x), expected, atol=1e-12)
    np.testing.assert_allclose(whitened(noise, x[:, 0]), expected[:, 0], atol=1e-12)
    np.testing.assert_array_equal(x, before)


def test_derivatives_of_samples_that_do_not_count_are_0_even_where_the_model_has_none() -> None:
    """The jacobian of a linear model is its whitened columns times the slope; rows that do not count are 0, not NaN."""
    rng = np.random.default_rng(7)
    X, flags = rng.normal(size=(N, COLUMNS)), np.zeros(N, dtype=bool)
    rows = rng.uniform(size=N) < 0.8
    X[~rows] = np.nan
    noise = Noise(np.ones(1), 0.5, np.ones(N), np.empty(0))
    output = Output(np.zeros(N), rows, flags, -np.inf, flags, np.inf, 0.1)
    box = np.full(COLUMNS, -9.0), np.full(COLUMNS, 9.0), np.ones(COLUMNS)
    problem = Problem(output, rows, noise, lambda q: X @ q, tuple(range(COLUMNS)), *box)
    q = np.zeros(COLUMNS)
    J = jacobian(problem, q, X @ q, np.where(rows, -1.0, 0.0))
    np.testing.assert_array_equal(J[~rows], 0.0)
    np.testing.assert_allclose(J[rows], -2.0 * X[rows], rtol=1e-9)
