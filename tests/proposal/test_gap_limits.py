"""Limits of a gap that `init` proposes leave out what stands for no vehicle ahead, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from canid.analysis.proposal.gap_limits import gap_limits

T = 0.1 * np.arange(3000)
SPEED = 22.0 + 2.0 * np.sin(T / 9.0)
GAP = np.round(40.0 + 12.0 * np.sin(T / 7.0), 1)
EMPTY = (T > 50.0) & (T < 70.0) | (T > 130.0) & (T < 150.0)
ENDS = 0.0, 204.7


@pytest.mark.parametrize(
    ("number", "limits"),
    [(0.0, (0.05, 204.7)), (204.7, (0.0, 204.65)), (150.0, (0.0, 149.95)), (-0.5, (-0.45, 204.7))],
)
def test_limits_are_half_a_step_from_the_number(number: float, limits: tuple[float, float]) -> None:
    """On its side; the other end is that of the bits."""
    found = gap_limits(T, np.where(EMPTY, number, GAP), SPEED, ENDS, 0.1)
    assert found == pytest.approx(limits)


def test_a_gap_that_always_stands_for_a_vehicle_needs_none() -> None:
    """No more than one that no limits can leave out, or a log without any vehicle."""
    assert gap_limits(T, GAP, SPEED, ENDS, 0.1) is None
    assert gap_limits(T, np.where(EMPTY, 40.0, GAP), SPEED, ENDS, 0.1) is None
    assert gap_limits(T, np.zeros(len(T)), SPEED, ENDS, 0.1) is None
