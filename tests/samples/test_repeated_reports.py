"""Reports that a radar sends more than once, and coarse ones that are equal by chance."""

from __future__ import annotations

import numpy as np
import pytest

from canid.signals.samples import repeated_reports, report_noise, smoothing
from canid.signals.samples.report_noise import Noise
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.types import Array
from tests import seeds
from tests.samples.test_smoothing import NOISE, drive

HZ, SECONDS, SPEED = 10.0, 300.0, 20.0


def smoothed(t: Array, gap: Array, rate: Array, times: int) -> tuple[float, Noise]:
    """What is missed of the range rate, and the noise that was found: standard deviations; each report is sent so often."""
    state, missed = smoothing.State(), []
    seen_rate = rate + NOISE.range_rate * np.random.default_rng(t.size).standard_normal(t.size)
    seen_gap = gap + NOISE.gap * np.random.default_rng(t.size + 1).standard_normal(t.size)
    for k, now in enumerate(t.tolist()):
        for again in range(times):
            at = now + again / (HZ * times)
            report = float(seen_gap[k]), float(seen_rate[k])
            state, ready, _ = smoothing.step(state, at, *report, Noise(), own_speed=SPEED)
            missed += [point.range_rate - np.interp(point.t, t, rate) for point in ready]
    return float(np.std(missed[len(missed) // 5 :])), report_noise.noise(state.shown, Noise())


@pytest.mark.parametrize("times", [2, 5])
@seeds.mostly(0.95)
def test_a_report_that_is_sent_again_is_no_measurement(times: int, seed: int) -> None:
    """The smoother misses as much as without repeats, to 5 %, and finds the same noise, to 10 %; it missed twice as much."""
    t, gap, rate, _, _ = drive(np.random.default_rng(seed), SECONDS, HZ)
    (once, noise), (often, found) = (smoothed(t, gap, rate, each) for each in (1, times))
    assert often < 1.05 * once, (often, once)
    assert found == pytest.approx(noise, rel=0.1)


@pytest.mark.parametrize(("gap_step", "rate_step"), [(0.1, 0.1), (0.2, 0.25), (1.0, 0.25)])
@pytest.mark.parametrize("hz", [10.0, 50.0])
@seeds.mostly(0.95)
def test_coarse_reports_that_are_equal_by_chance_are_new(
    hz: float, gap_step: float, rate_step: float, seed: int
) -> None:
    """Of reports in steps of one to five standard deviations of their noise, a hundredth at most is left out."""
    t, gap, rate, _, _ = drive(np.random.default_rng(seed), 120.0, hz)
    rng, state, last, left_out = np.random.default_rng(seed + 1), repeated_reports.State(), 0.0, 0
    gap = np.rint((gap + 0.1 * rng.standard_normal(t.size)) / gap_step) * gap_step
    rate = np.rint((rate + 0.05 * rng.standard_normal(t.size)) / rate_step) * rate_step
    for now, *report in zip(t.tolist(), gap.tolist(), rate.tolist(), strict=True):
        state, again = repeated_reports.step(state, *report, now - last)
        last, left_out = (last, left_out + 1) if again else (now, left_out)
    assert left_out <= 0.01 * t.size, left_out


def test_a_lead_at_rest_is_seen_all_the_time() -> None:
    """Two cars at rest: smoothed reports come on, at most a quarter of a second and a report apart."""
    state, times = smoothing.State(), []
    for k in range(4000):
        moved = max(0.0, 30.0 - 0.05 * (k // 2))
        report = (10.0 + moved, -1.0 - 1e-3 * (k // 2 % 7)) if moved > 0.0 else (10.0, 0.0)
        state, ready, _ = smoothing.step(state, 0.05 * k, *report, Noise(), own_speed=SPEED)
        times += [point.t for point in ready]
    assert max(np.diff(times)) < 0.31, max(np.diff(times))


def missed(t: Array, rate: Array, *reports: Array) -> float:
    """What the smoother misses of a range rate, as a standard deviation, m/s; the reports are of gap and range rate."""
    state, out = smoothing.State(), []
    for now, *report in zip(t.tolist(), *(x.tolist() for x in reports), strict=True):
        state, ready, _ = smoothing.step(state, now, *report, Noise(), own_speed=SPEED)
        out += ready
    error = np.array([point.range_rate - np.interp(point.t, t, rate) for point in out])
    return float(np.std(error[len(error) // 3 :]))


@pytest.mark.parametrize(
    ("hz", "gap_step", "rate_step"),
    [((10.0, 10.0), 0.5, 0.1), ((13.0, 13.0), 0.1, 0.1), ((20.0, 10.0), 0.01, 0.01)],
)
@seeds.mostly(0.95)
def test_noise_that_lasts_for_more_than_a_report_is_smoothed_as_such(
    hz: tuple[float, float], gap_step: float, rate_step: float, seed: int
) -> None:
    """Sent again at 20 Hz, coarse, irregularly or the range rate alone: missed by a third more than at 10 Hz at most."""
    t, gap, rate, _, _ = drive(np.random.default_rng(seed), 200.0, 20.0)
    rng = np.random.default_rng(seed + 1)
    gap = gap + 0.1 * rng.standard_normal(t.size)
    seen = rate + 0.05 * rng.standard_normal(t.size)
    gap, seen = np.rint(gap / gap_step) * gap_step, np.rint(seen / rate_step) * rate_step
    rows = [np.searchsorted(t, np.floor(t * each + 1e-9) / each - 1e-9) for each in hz]
    again = missed(t, rate, gap[rows[0]], seen[rows[1]])
    once = missed(t[::2], rate[::2], gap[::2], seen[::2])
    print(f"{again:.4f} m/s instead of {once:.4f} m/s")
    assert again < 1.35 * once, (again, once)


def at_own_times(t: Array, x: Array, hz: float, begin: float) -> Array:
    """A value at the rows at which it is new, NaN at the others."""
    numbers = np.floor((t - begin) * hz + 1e-6)
    return np.where(np.diff(numbers, prepend=numbers[0] - 1) > 0, x, np.nan)


@pytest.mark.parametrize("hz", [(10.0, 10.0), (10.0, 14.0), (16.0, 9.0)])
@seeds.mostly(0.95)
def test_gap_and_range_rate_at_times_of_their_own(hz: tuple[float, float], seed: int) -> None:
    """The noise of each is found to 15 %, and the range rate is missed by a fifth more than in one report at most."""
    rng = np.random.default_rng(seed)
    t, gap, rate, _, _ = drive(rng, 300.0, 50.0)
    factor = rng.uniform(1.0, 4.0)
    sd = 0.1 * factor, 0.05 * factor
    seen = gap + sd[0] * rng.standard_normal(t.size), rate + sd[1] * rng.standard_normal(t.size)
    begin = rng.uniform(0.0, 0.1)
    own = [
        at_own_times(t, x, each, begin + 0.05 * k) for k, (x, each) in enumerate(zip(seen, hz, strict=True))
    ]
    state, out = smoothing.State(), []
    for now, *report in zip(t.tolist(), *(x.tolist() for x in own), strict=True):
        state, ready, _ = smoothing.step(state, now, *report, Noise(), own_speed=SPEED)
        out += ready
    found = report_noise.noise(state.shown, Noise())
    assert found == pytest.approx(sd, rel=0.15), (found, sd)
    error = np.array([point.range_rate - np.interp(point.t, t, rate) for point in out])
    rows = np.searchsorted(t, np.arange(0.0, t[-1], 1.0 / hz[1]) - 1e-9)
    once = missed(t[rows], rate[rows], *(x[rows] for x in seen))
    assert float(np.std(error[len(error) // 3 :])) < 1.2 * once, once


def separated(t: Array, value: Array) -> Array:
    """Which readings of a gap are left."""
    readings = RoleReadings("gap", np.arange(t.size), value)
    _, left = repeated_reports.separate({}, Decoded((readings,), (), (), ()), t)
    kept = np.zeros(t.size, bool)
    kept[left.roles[0].row] = True
    return kept


@pytest.mark.parametrize(("hz", "rows"), [(10.0, 20.0), (14.0, 50.0), (10.0, 100.0), (13.0, 20.0)])
@seeds.mostly(0.95)
def test_a_value_that_is_sent_again_by_itself_is_no_measurement(hz: float, rows: float, seed: int) -> None:
    """After a quarter minute all that is left is new, or has stood for long; whatever differs is left."""
    rng = np.random.default_rng(seed)
    t, gap, _, _, _ = drive(rng, 120.0, rows)
    step = rng.choice([0.001, 0.05, 0.1])
    seen = np.rint((gap + 0.1 * rng.uniform(1.0, 3.0) * rng.standard_normal(t.size)) / step) * step
    new = np.isfinite(at_own_times(t, seen, hz, rng.uniform(0.0, 1.0 / hz)))
    held = seen[np.maximum.accumulate(new * np.arange(t.size))]
    kept = separated(t, held)
    # a new value that happens to be the old one is none
    differs = np.diff(held, prepend=np.nan) != 0.0
    stands = t - t[np.maximum.accumulate(differs * np.arange(t.size))]
    assert not (kept & ~differs & (t > 15.0) & (stands < repeated_reports.MAX_REPEAT_S - 1e-6)).any()
    assert kept[differs].all()


@pytest.mark.parametrize("step", [0.05, 0.1, 0.5])
@pytest.mark.parametrize("hz", [10.0, 20.0, 50.0])
@seeds.mostly(0.95)
def test_coarse_values_that_stay_by_chance_are_new(hz: float, step: float, seed: int) -> None:
    """With noise of a tenth of a step to three steps, or none at all: a hundredth at most is left out."""
    rng = np.random.default_rng(seed)
    t, gap, _, _, _ = drive(rng, 120.0, hz)
    noise = rng.choice([0.0, 0.1, 0.3, 1.0, 3.0])
    seen = np.rint(gap / step + noise * rng.standard_normal(t.size)) * step
    assert separated(t, seen).mean() >= 0.99, noise
