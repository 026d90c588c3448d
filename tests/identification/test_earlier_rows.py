"""Rows that have left the window tell a step of the gains as well as rows that are still in it."""

from __future__ import annotations

import numpy as np
import pytest

from canid.mathematics.identification.fopdt import (
    answer_columns,
    earlier_rows,
    fopdt_fit,
    gain_step,
    regression_rows,
)
from canid.mathematics.identification.fopdt.answer_columns import Columns, Reference
from canid.mathematics.identification.fopdt.earlier_rows import Earlier
from canid.values.types import Array

LAYOUT = fopdt_fit.row_layout(2, 0.1, 3.0, 1.5)
AT = Reference(
    np.array([4.0, 6.0]),
    np.array([0.7, 0.4]),
    np.array([0.3, 0.2]),
    np.array([4.0, 6.0]),
    np.array([0.8]),
    1,
    1.0,
    0.0,
)
STEP_ROW, ROWS, LEFT = 1500, 1700, 1100
NOISE_SD = 0.3


def rows(seed: int, factor: float = 0.7) -> Array:
    """Rows of a driver whose gains step, with his own coloured noise."""
    rng = np.random.default_rng(seed)
    inputs = np.cumsum(0.1 * rng.standard_normal((ROWS + 50, 2)), axis=0)
    inputs -= 0.02 * np.arange(len(inputs))[:, None] * inputs[-1] / len(inputs)
    samples = np.column_stack([np.zeros(len(inputs)), np.ones(len(inputs)), np.zeros(len(inputs)), inputs])
    _, made = regression_rows.put(LAYOUT, regression_rows.State(), samples, 4.5)
    made = made[-ROWS:].copy()
    made[:, 1] = 1.0
    by = answer_columns.turn(LAYOUT, AT)
    basis, _ = answer_columns.basis_columns(LAYOUT, made)
    answers = (AT.K @ by[:2]) @ basis * np.where(np.arange(len(made)) < STEP_ROW, 1.0, factor)
    noise = np.zeros(len(made))
    for k in range(1, len(made)):
        noise[k] = 0.8 * noise[k - 1] + NOISE_SD * rng.standard_normal()
    made[:, 0] = 20.0 + answers + noise
    return made


def columns(seen: Array) -> Columns:
    """Whitened, all on the scale of the noise as it was drawn."""
    raw, usable = answer_columns.raw(LAYOUT, seen, AT)
    made = answer_columns.whitened(LAYOUT, raw, usable, AT)
    assert made is not None
    return made._replace(weight=made.usable / NOISE_SD**2)


def evidence(seen: Array, earlier: Array | float = 0.0) -> float:
    """Log of the statistic."""
    return gain_step.steps(columns(seen), AT.size, 10, earlier).evidence


@pytest.mark.parametrize("seed", range(4))
def test_what_has_left_the_window_adds_to_the_evidence(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As much as a window that still has those rows; at another reference as well."""
    monkeypatch.setattr(earlier_rows, "MEMORY_S", 1e9)
    every = rows(seed)
    earlier = Earlier()
    for first in range(0, LEFT, 20):
        # the window at that time: its rows have a mean of their own
        begin = max(first - 100, 0)
        window, part = every[begin : first + 500], slice(first - begin, first - begin + 20)
        until = 0.1 * (first + 20)
        earlier = earlier_rows.absorb(earlier, LAYOUT, window, columns(window), AT, part, until, None)
    known = earlier_rows.products(earlier, LAYOUT, AT)
    short, whole, both = evidence(every[LEFT:]), evidence(every), evidence(every[LEFT:], known)
    assert both > short
    assert both == pytest.approx(whole, rel=0.1)
    # lags that are a little off do not need other rows
    near = AT._replace(tau=AT.tau + 0.05)
    by = answer_columns.turn(LAYOUT, near)
    np.testing.assert_allclose(
        np.delete(np.delete(earlier_rows.products(earlier, LAYOUT, near), 2, 0), 2, 1),
        _without(2, by @ earlier.products @ by.T),
        rtol=1e-6,
        atol=1e-6,
    )


def test_the_level_of_before_says_nothing_of_the_level_now() -> None:
    """Rows of another offset change nothing."""
    every = rows(9, 1.0)
    known = []
    for level in (0.0, 50.0):
        moved = every.copy()
        moved[:, 0] += level
        part = slice(100, 1000)
        earlier = earlier_rows.absorb(Earlier(), LAYOUT, moved, columns(moved), AT, part, 100.0, None)
        known.append(earlier_rows.products(earlier, LAYOUT, AT))
    np.testing.assert_allclose(known[0], known[1], rtol=1e-6, atol=1e-6)
    assert not earlier_rows.products(Earlier(), LAYOUT, AT).any()


def _without(k: int, G: Array) -> Array:
    """Regress column k out of the others."""
    left = G - np.outer(G[:, k], G[k]) / G[k, k]
    return np.delete(np.delete(left, k, 0), k, 1)
