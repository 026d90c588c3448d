"""What the reports show of the radar's noise and of the motion, and what that is good for."""

from __future__ import annotations

import numpy as np
import pytest

from canid.signals.samples import report_noise, smoothing
from canid.signals.samples.report_noise import Noise
from tests import seeds
from tests.samples.test_smoothing import drive


@pytest.mark.parametrize("factor", [0.2, 1.0, 3.0])
def test_the_noise_is_found_whatever_it_is(factor: float) -> None:
    """Within 15 % after a minute, for radars from a fifth to three times the usual noise."""
    rng = np.random.default_rng(round(10 * factor))
    t, gap, rate, _, _ = drive(rng, 60.0)
    sd = factor * 0.25, factor * 0.12
    state = smoothing.State()
    for k in range(t.size):
        at = float(gap[k] + sd[0] * rng.standard_normal()), float(rate[k] + sd[1] * rng.standard_normal())
        state, _, changed = smoothing.step(state, float(t[k]), *at, Noise())
        assert not changed
    found = report_noise.noise(state.shown, Noise())
    assert found.gap == pytest.approx(sd[0], rel=0.15)
    assert found.range_rate == pytest.approx(sd[1], rel=0.15)


@pytest.mark.slow("whole logs")
def test_what_is_missed_is_independent_of_what_is_smoothed() -> None:
    """The error of a smoothed range rate correlates with it, now or up to 1 s later, by less than 2 % of its variance.

    Berkson's case: only then does the radar's noise bend no gain and no delay.
    """
    worst = []
    for seed, (factor, liveliness) in enumerate([(1.0, 1.0), (2.5, 1.0), (2.0, 0.3)]):
        rng = np.random.default_rng(seed)
        t, gap, rate, _, _ = drive(rng, 600.0)
        gap, rate = 40.0 + liveliness * (gap - 40.0), liveliness * rate
        state, out = smoothing.State(), []
        for k in range(t.size):
            at = (
                float(gap[k] + factor * 0.25 * rng.standard_normal()),
                float(rate[k] + factor * 0.12 * rng.standard_normal()),
            )
            state, ready, _ = smoothing.step(state, float(t[k]), *at, Noise())
            out += [point.range_rate for point in ready]
        x = np.array(out)[1200:]
        error = rate[1200 : 1200 + len(x)] - x
        worst.append(
            max(abs(float(np.mean(error[: len(x) - lag] * x[lag:]))) / float(x.var()) for lag in range(21))
        )
    assert max(worst) < 0.02, worst


def test_a_stated_noise_is_kept() -> None:
    """What the vehicle file states is not estimated; what it leaves open is."""
    state = report_noise.State(gap_square=0.01, rate_square=0.04)
    assert report_noise.noise(state, Noise(0.4)) == pytest.approx((0.4, 0.2))


def test_an_outlier_and_another_target_are_no_noise() -> None:
    """A jump by 20 m moves the estimate by less than a tenth; a signal that stands still keeps the least noise."""
    state = report_noise.State()
    for k in range(2000):
        gap = 30.0 + (20.0 if k > 1000 else 0.0) + 0.25 * (-1.0) ** (k * (k + 1) // 2)
        before, state = state, report_noise.step(state, 0.05 * k, gap, 1.0, 0.0, 0.05)
        if k == 1005:
            assert state.gap_square < 1.1 * before.gap_square * 1.1
    assert report_noise.noise(state, Noise()).range_rate < 0.03
    assert state.jerk == report_noise.JERK_DENSITY


@pytest.mark.parametrize("own_speed", [20.0, np.nan])
@seeds.mostly(0.95)
def test_a_gap_in_steps_moves_no_range_rate(own_speed: float, seed: int) -> None:
    """What is missed of the range rate is as with a fine gap, to 12 %; by the noise that the steps show, 20 to 50 % more."""
    rng = np.random.default_rng(seed)
    t, gap, rate, _, _ = drive(rng, 300.0, 10.0)
    seen = rate + 0.05 * rng.standard_normal(t.size)
    noisy = gap + 0.1 * rng.standard_normal(t.size)
    errors = []
    for reported in (noisy, np.round(noisy / 2.0) * 2.0):
        state, out = smoothing.State(), []
        for now, *report in zip(t.tolist(), reported.tolist(), seen.tolist(), strict=True):
            state, ready, _ = smoothing.step(state, now, *report, Noise(), own_speed=own_speed)
            out += [point.range_rate for point in ready]
        errors.append(float(np.std((np.array(out) - rate[: len(out)])[600:])))
    assert errors[1] < 1.12 * errors[0], errors
