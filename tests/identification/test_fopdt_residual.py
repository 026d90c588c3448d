"""The residual of a FOPDT fit, made outside the fit."""

import numpy as np
import pytest

from canid.mathematics.identification import residual_tests
from canid.mathematics.identification.first_order import scan
from canid.mathematics.identification.fopdt import fopdt_fit, fopdt_residual, regression_rows
from canid.values.types import LearnGate, OutputFilter, Trace
from tests.plants.first_order_lag import answer

SETTLE = 4.5  # s
NAMES = ("headway_error", "range_rate")


def drive(seed, n=1800, extra=0.0, smoothed=False):
    """Trace of a driver with two lags and noise of 1 s; `extra` of range rate comes 2.5 s late."""
    rng = np.random.default_rng(seed)
    u = np.column_stack([scan(sd * rng.normal(size=n), np.array([0.97])) for sd in (0.1, 0.3)])
    x = [answer(u[:, k], 0.1, tau, dead_time) for k, (tau, dead_time) in enumerate(((0.5, 0.3), (0.4, 0.2)))]
    noise = scan(0.5 * rng.normal(size=n), np.array([0.9]))
    y = 4.0 * x[0] + 5.0 * x[1] + extra * np.roll(u[:, 1], 25) + noise
    if smoothed:
        y = np.convolve(y, np.ones(7) / 7.0)[3 : n + 3]
    learn = np.full(n, True)
    learn[700:760] = False
    return Trace(
        0.1, np.arange(n) * 0.1, y, u, NAMES, (LearnGate.OPEN,) * n, learn, np.zeros(n, np.int64), {}
    )


def fitted(trace, output_filter=None):
    """Layout, rows and fit of a whole drive."""
    layout = fopdt_fit.row_layout(2, trace.dt, 3.0, 1.5)
    samples = np.column_stack([trace.output, trace.learn, trace.segment, trace.inputs])
    _, rows = regression_rows.put(layout, regression_rows.State(), samples, SETTLE)
    return layout, rows, fopdt_fit.fit_rows(layout, rows, fopdt_fit.Settings(output_filter=output_filter))


def test_the_residual_is_what_the_fit_says_of_itself():
    """Its size is the fit's sigma to a per cent, and what is not usable is not in it."""
    trace = drive(0)
    layout, rows, fit = fitted(trace)
    simulated = fopdt_residual.simulate_window(layout, rows, fit)
    e, _ = fopdt_residual.whitened(simulated, fit)
    assert np.nanstd(e) == pytest.approx(fit.sigma, rel=0.01)
    assert np.isnan(e[700 : 760 + len(fit.noise)]).all()
    drive_again = fopdt_residual.simulate_drive(layout, trace, fit, SETTLE)
    np.testing.assert_allclose(fopdt_residual.whitened(drive_again, fit)[0], e, rtol=1e-9)


def test_a_stride_whitens_every_phase():
    """The residual of a smoothed output is white against itself a stride earlier, in all phases alike."""
    trace = drive(1, smoothed=True)
    layout, rows, fit = fitted(trace, OutputFilter("unknown"))
    assert fit.stride > 1
    e, _ = fopdt_residual.whitened(fopdt_residual.simulate_window(layout, rows, fit), fit)
    for phase in range(fit.stride):
        part = e[phase :: fit.stride]
        known = np.isfinite(part[1:] * part[:-1])
        r = np.corrcoef(part[1:][known], part[:-1][known])[0, 1]
        assert abs(r) < 0.25  # three standard deviations of some 170 pairs
    # phases that know the same are one: as many alarms as one phase has
    pooled = residual_tests.whiteness(residual_tests.phases(e, fit.stride), stride=fit.stride)
    assert pooled.statistic < 2.0 * pooled.bound


def test_a_response_that_is_no_first_order_is_left_over():
    """A second response 2.5 s later is found, on its own input, with its size; without it nothing alarms."""
    for extra, expected in ((0.0, ()), (1.5, ("range_rate",))):
        layout, rows, fit = fitted(drive(2, extra=extra))
        tests = fopdt_residual.run_tests(fopdt_residual.simulate_window(layout, rows, fit), fit, NAMES)
        assert tests.left_over == expected
        assert (tests.left_over_share["range_rate"] > 0.2) == bool(expected)


def test_pooled_phases_alarm_no_more_often_than_one():
    """Residuals whose neighbours know the same, five phases: the left-over test alarms in a few per cent at most."""
    alarms = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        e = np.repeat(rng.normal(size=120), 5) + 0.1 * rng.normal(size=600)
        u = np.convolve(rng.normal(size=600), np.ones(10) / 10.0, mode="same")[:, None]
        alarms += bool(residual_tests.run_tests(e, u, ["range_rate"], 0, 5).left_over)
    assert alarms <= 3
