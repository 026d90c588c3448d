"""A step of the gains in the live estimator: followed, reported once with its time, and the same in live and batch."""

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.mathematics.estimators import fopdt, status
from canid.mathematics.estimators.windows import reported_estimates
from canid.values.types import LearnGate, Sample
from tests.plants.first_order_lag import answer
from tests.seeds import mostly

DT = 0.1
STEP_AT, END = 100.0, 145.0
K = 5.6


def drive(seed, factor):
    """Range rate and the answer of a driver whose gain steps at `STEP_AT`, with autocorrelated noise, as samples."""
    rng = np.random.default_rng(seed)
    n = round(END / DT)
    u = lfilter([1.0], [1.0, -0.95], 0.5 * rng.normal(size=n))
    gain = K * np.where(np.arange(n) * DT < STEP_AT, 1.0, factor)
    noise = lfilter([1.0], [1.0, -0.9], 0.3 * rng.normal(size=n))
    y = 20.0 + gain * answer(u, DT, 0.4, 0.2) + noise
    return [
        Sample(round(k * DT, 6), float(a), (float(b),), LearnGate.OPEN, True, 0, {})
        for k, (a, b) in enumerate(zip(y, u, strict=True))
    ]


def live(samples):
    """Every estimate, as in a session."""
    running = fopdt.FOPDT.make(("range_rate",), DT)
    state, out = running.init(), []
    for sample in samples:
        state, estimate = running.step(state, sample)
        out += [estimate] if estimate is not None else []
    return out


@pytest.fixture
def stepped(seed):
    return drive(seed, 1.5)


@pytest.mark.slow("estimates over whole drives")
@mostly(0.95)
def test_a_step_is_reported_once_with_its_time_and_both_gains(seed):
    """x1.5 behind a lively lead: one new change, within 30 s, dated to 5 s, K before and after in (wide) reach."""
    estimates = live(drive(seed, 1.5))
    new = [e for e in estimates if e.change is not None and e.change.new]
    assert len(new) == 1
    change = new[0].change
    assert STEP_AT <= new[0].t <= STEP_AT + 30.0
    assert abs(change.t.value - STEP_AT) <= 5.0
    # five standard errors: one drive is drawn, and all intervals together must hold
    for interval, truth in ((change.before["range_rate"], K), (change.after["range_rate"], 1.5 * K)):
        assert abs(interval.value - truth) <= 2.5 * (interval.high - interval.low) / 2.0
    last = estimates[-1].channels["range_rate"].K
    assert abs(last.value - 1.5 * K) <= 2.5 * (last.high - last.low) / 2.0


@pytest.mark.slow("estimates over whole drives")
def test_the_windows_of_a_drive_with_a_step_are_the_live_numbers(stepped):
    """Bit for bit, the change included: every reported estimate of batch is the one of live at that time."""
    running = fopdt.FOPDT.make(("range_rate",), DT)
    by_time = {e.t: e for e in live(stepped)}
    reported = reported_estimates([running], stepped)
    assert any(e.change is not None for e in reported)
    for e in reported:
        assert e._replace(headline=False) == by_time[e.t], e.t
    assert {int(e.t // status.REPORT_EVERY_S) for e in reported} >= set(range(3, 14))


@pytest.mark.slow("estimates over whole drives")
@mostly(0.95)
def test_a_constant_driver_is_not_reported(seed):
    """No step, no change, and the gain of the last window is the driver's."""
    estimates = live(drive(seed, 1.0))
    assert all(e.change is None for e in estimates)
    last = estimates[-1].channels["range_rate"].K
    assert abs(last.value - K) <= 2.5 * (last.high - last.low) / 2.0
