"""Runs of a radar's reports at the desk: the same numbers as report by report, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from canid import smoothing
from canid.desk import smoothing_runs
from canid.smoothing import Noise, Smoothed, State

NOISE = Noise(0.25, 0.12)


def reports(seed: int, n: int = 400, hz: float = 20.0, jitter: float = 0.004) -> tuple[np.ndarray, ...]:
    """Times, gaps and range rates of one target, as a noisy radar reports them."""
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(n) / hz + rng.uniform(0.0, jitter, n), 9)
    rate = 1.5 * np.sin(0.4 * t + seed)
    gap = 40.0 + np.cumsum(rate) / hz
    return t, gap + NOISE.gap * rng.standard_normal(n), rate + NOISE.range_rate * rng.standard_normal(n)


def one_by_one(
    state: State, t: np.ndarray, gap: np.ndarray, rate: np.ndarray
) -> tuple[State, list[Smoothed]]:
    out = []
    for report in zip(t.tolist(), gap.tolist(), rate.tolist(), strict=True):
        state, more, _ = smoothing.step(state, *report, NOISE)
        out += more
    return state, out


def in_runs(
    state: State, t: np.ndarray, gap: np.ndarray, rate: np.ndarray, most: int
) -> tuple[State, list[Smoothed], int]:
    """As far as runs go, of `most` reports at the most, and one by one where they end."""
    out, i, alone = [], 0, 0
    while i < len(t):
        part = slice(i, i + most)
        state, taken, smoothed = smoothing_runs.step(state, t[part], gap[part], rate[part], NOISE)
        if smoothed is not None:
            assert (t[part][smoothed.by] > smoothed.t).all()
            out += [Smoothed(*item) for item in zip(*(c.tolist() for c in smoothed[:3]), strict=True)]
        i += taken
        if taken < min(most, len(t) - (i - taken)):
            state, more = one_by_one(state, t[i : i + 1], gap[i : i + 1], rate[i : i + 1])
            out += more
            i, alone = i + 1, alone + 1
    return state, out, alone


@pytest.mark.parametrize("most", [1, 2, 7, 400])
@pytest.mark.parametrize("hz", [10.0, 20.0, 100.0])
def test_a_run_is_its_reports_one_by_one(hz: float, most: int) -> None:
    """However it is cut: the same points, the same state; and only the first report needs a step of its own."""
    t, gap, rate = reports(3, hz=hz, jitter=0.2 / hz)
    state, out = one_by_one(State(), t, gap, rate)
    then, found, alone = in_runs(State(), t, gap, rate, most)
    assert found == out
    assert then == state
    assert alone == 1


@pytest.mark.parametrize("seed", range(8))
def test_whatever_ends_a_run(seed: int) -> None:
    """Outliers, other targets, pauses, reports that come twice or out of order."""
    rng = np.random.default_rng(100 + seed)
    t, gap, rate = reports(seed)
    gap[rng.integers(0, len(t), 12)] += rng.choice([-20.0, 20.0], 12)
    rate[rng.integers(0, len(t), 6)] += 15.0
    for begin in rng.integers(0, len(t), 3).tolist():
        gap[begin:] += rng.choice([-12.0, 12.0])
    for begin in rng.integers(0, len(t), 3).tolist():
        t[begin:] += rng.uniform(0.3, 1.5)
    for k in rng.integers(2, len(t), 5).tolist():
        t[k] = t[k - 1] if rng.random() < 0.5 else t[k - 2]
    state, out = one_by_one(State(), t, gap, rate)
    then, found, alone = in_runs(State(), t, gap, rate, 400)
    assert found == out
    assert then == state
    assert 1 < alone < len(t) / 2
