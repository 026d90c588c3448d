"""Gap and range rate: smoother than the radar, hardly late, and never from the far future."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.signals.samples import smoothing
from canid.signals.samples.report_noise import Noise
from canid.signals.samples.smoothing import Smoothed, State, lag

NOISE = Noise(0.25, 0.12)


def drive(rng: np.random.Generator, duration: float = 120.0, hz: float = 20.0) -> tuple[np.ndarray, ...]:
    """True gap and range rate of a following drive, and what a noisy radar reports of them."""
    t = np.arange(0, duration, 1 / hz)
    phase = rng.uniform(0, 2 * math.pi, 3)
    rate = sum(
        a * np.sin(2 * math.pi * f * t + p)
        for a, f, p in zip((1.5, 0.6, 0.3), (0.03, 0.1, 0.25), phase, strict=True)
    )
    gap = 40 + np.cumsum(rate) / hz
    return (
        t,
        gap,
        rate,
        gap + NOISE.gap * rng.standard_normal(t.size),
        rate + NOISE.range_rate * rng.standard_normal(t.size),
    )


def run(t: np.ndarray, gap: np.ndarray, rate: np.ndarray) -> tuple[list[Smoothed], int]:
    state, out, changes = State(), [], 0
    for k in range(t.size):
        state, ready, changed = smoothing.step(state, float(t[k]), float(gap[k]), float(rate[k]), NOISE)
        out += ready
        changes += changed
    return out + smoothing.flush(state), changes


def test_each_report_comes_out_once_in_order() -> None:
    t, _, _, gap, rate = drive(np.random.default_rng(1), 20.0)
    out, changes = run(t, gap, rate)
    assert [p.t for p in out] == t.tolist()
    assert changes == 0


def test_it_is_better_than_the_radar_and_not_late() -> None:
    """Noise at most 60 % of the reports', and no delay beyond 15 ms (the reports' own noise allows 5)."""
    ratios, lags = [], []
    for seed in range(5):
        t, gap, rate, seen_gap, seen_rate = drive(np.random.default_rng(seed))
        out, _ = run(t, seen_gap, seen_rate)
        error = np.array([p.range_rate for p in out]) - rate
        ratios.append(error[100:-20].std() / NOISE.range_rate)
        slope = np.gradient(rate, t)
        lags.append(-(error[100:-20] @ slope[100:-20]) / (slope[100:-20] @ slope[100:-20]))
        error_gap = np.array([p.gap for p in out]) - gap
        assert error_gap[100:-20].std() < 0.5 * NOISE.gap
    assert np.mean(ratios) < 0.6
    assert abs(np.mean(lags)) < 0.015


@pytest.mark.slow("whole logs")
@pytest.mark.parametrize(("hz", "noise"), [(20.0, NOISE), (100.0, NOISE), (10.0, Noise(0.02, 0.5))])
def test_it_is_the_fixed_lag_smoother_of_filterpy(hz: float, noise: Noise) -> None:
    """Each report as filterpy smooths it with the reports up to `lag` later, whatever is missing of them: to 1e-9."""
    kalman = pytest.importorskip(
        "filterpy.kalman", reason="filterpy is not installed (pip install canid[dev])"
    )
    rng = np.random.default_rng(6)
    t, _, _, gap, rate = drive(rng, 6.0, hz)
    gap[rng.random(t.size) < 0.1] = np.nan
    rate[rng.random(t.size) < 0.1] = np.nan
    gap[0], rate[0] = 40.0, np.nan
    kept = (rng.random(t.size) > 0.1) & ~(np.isnan(gap) & np.isnan(rate))
    kept[0] = True
    t, gap, rate = t[kept] + 1e-3 * rng.random(kept.sum()), gap[kept], rate[kept]
    state, out, jerk = State(), [], []
    for k in range(t.size):
        jerk.append(state.shown.jerk)
        state, ready, changed = smoothing.step(state, float(t[k]), float(gap[k]), float(rate[k]), noise)
        assert not changed
        assert not state.misfits
        out += ready
    out += smoothing.flush(state)

    kf = kalman.KalmanFilter(dim_x=3, dim_z=1)
    kf.x, kf.P = np.array([gap[0], 0.0, 0.0]), np.diag([noise.gap**2, 100.0, 1.0])
    Xs, Ps, Fs, Qs = [kf.x], [kf.P], [np.eye(3)], [np.zeros((3, 3))]
    for k in range(1, t.size):
        dt = t[k] - t[k - 1]
        Fs.append(np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]]))
        c = np.array([[dt**5 / 20, dt**4 / 8, dt**3 / 6], [0, dt**3 / 3, dt**2 / 2], [0, 0, dt]])
        Qs.append(jerk[k] * (c + np.triu(c, 1).T))
        kf.predict(F=Fs[-1], Q=Qs[-1])
        for z, sd, H in ((gap[k], noise.gap, np.eye(3)[:1]), (rate[k], noise.range_rate, np.eye(3)[1:2])):
            if not np.isnan(z):
                kf.update(z, R=sd**2, H=H)
        Xs.append(kf.x.copy())
        Ps.append(kf.P.copy())
    for k, point in enumerate(out):
        until = min(np.searchsorted(t, t[k] + lag(noise) - 5e-10), t.size - 1) + 1
        past = slice(max(until - 120, 0), until)  # what comes before k does not matter to the way back
        X, *_ = kf.rts_smoother(*(np.array(x[past]) for x in (Xs, Ps)), Fs=Fs[past], Qs=Qs[past])
        assert abs(X[k - past.start, 0] - point.gap) < 1e-9
        assert abs(X[k - past.start, 1] - point.range_rate) < 1e-9


def test_nothing_later_than_the_lag_is_used() -> None:
    """What comes out for t does not change when reports later than t + `lag` (and one report) do."""
    t, _, _, gap, rate = drive(np.random.default_rng(2), 20.0)
    out, _ = run(t, gap, rate)
    cut = 200
    other, _ = run(t, np.r_[gap[:cut], gap[cut:] + 1.0], np.r_[rate[:cut], rate[cut:] - 0.5])
    safe = sum(p.t + lag(NOISE) < t[cut - 1] for p in out)
    assert safe > 150
    assert out[:safe] == other[:safe]


def test_state_is_a_value() -> None:
    """The same state gives the same answer however often it is used."""
    t, _, _, gap, rate = drive(np.random.default_rng(3), 5.0)
    state = State()
    for k in range(60):
        state, _, _ = smoothing.step(state, float(t[k]), float(gap[k]), float(rate[k]), NOISE)
    first = smoothing.step(state, float(t[60]), float(gap[60]), float(rate[60]), NOISE)
    again = smoothing.step(state, float(t[60]), float(gap[60]), float(rate[60]), NOISE)
    assert first[1:] == again[1:]


def test_a_gap_in_the_reports_is_survived() -> None:
    t, _, _, gap, rate = drive(np.random.default_rng(4), 20.0)
    keep = (t < 8.0) | (t > 8.35)
    out, changes = run(t[keep], gap[keep], rate[keep])
    assert changes == 0
    assert len(out) == keep.sum()


def test_another_vehicle_is_a_change_and_an_outlier_is_not() -> None:
    t, _, _, gap, rate = drive(np.random.default_rng(5), 20.0)
    outlier = gap.copy()
    outlier[150] += 30.0
    assert run(t, outlier, rate)[1] == 0
    cut_in = np.where(t > 10.0, gap - 15.0, gap)
    out, changes = run(t, cut_in, rate)
    assert changes == 1
    smoothed = np.array([p.range_rate for p in out])
    assert np.abs(smoothed).max() < np.abs(rate).max() + 0.3  # no jump of 15 m in 50 ms becomes a range rate


def test_later_reports_than_the_lag_hardly_move_an_estimate(seed: int) -> None:
    """Behind a radar four times as noisy as a good one too: by less than an eighth of its error, as variances."""
    rng, noise = np.random.default_rng(seed), Noise(0.4, 0.2)
    t, _, rate, _, _ = drive(rng, 100.0, 10.0)
    gap = 40.0 + np.cumsum(rate) / 10.0
    reports = (
        gap + noise.gap * rng.standard_normal(t.size),
        rate + noise.range_rate * rng.standard_normal(t.size),
    )
    estimates = []
    for longest in (lag(noise), smoothing.LEAD_LAG_S):
        state, out = State(), []
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(smoothing, "lag", lambda _, s=longest: s)
            for k in range(t.size):
                report = float(t[k]), float(reports[0][k]), float(reports[1][k])
                state, ready, _ = smoothing.step(state, *report, noise)
                out += ready
        estimates.append(np.array([p.range_rate for p in out + smoothing.flush(state)])[50:-20])
    moved = np.var(estimates[0] - estimates[1]) / np.var(estimates[1] - rate[50:-20])
    assert moved < 0.12
