"""Fits of segments, structures, |Delta|, bounds and margins of lane keeping against planted systems and second routes."""

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.mathematics.identification.armax.armax_batch import fit_armax
from canid_study.chen_ulsoy import (
    bounds,
    closed_loop,
    model_structures,
    nonlinearity,
    robustness,
    stationarity,
    unstructured,
)
from canid_study.chen_ulsoy.poles import poles_and_gain
from canid_study.chen_ulsoy.segment_fits import fit_joint, fit_segments, reasonable
from canid_study.chen_ulsoy.signals import spectra
from canid_study.printed_numbers import STEERING_TABLES
from tests.seeds import mostly

MODEL = np.array([-1.2623, 0.3697, 4.134, -4.0337])


def driven(rng, S, N=600, c=0.3, sd=0.25):
    """ARMAX(2,2,1) of Table 1 behind an error that is no feedback: low-pass noise."""
    u = lfilter([0.1], [1.0, -0.9], rng.normal(size=(S, N + 50)), axis=1)
    e = sd * rng.normal(size=(S, N + 50))
    a1, a2, b1, b2 = MODEL
    d = lfilter([0.0, b1, b2], [1.0, a1, a2], u, axis=1) + lfilter([1.0, c], [1.0, a1, a2], e, axis=1)
    return d[:, 50:], u[:, 50:]


def test_every_segment_is_what_the_batch_fit_of_one_finds(seed):
    """Same least sum of squares as `fit_armax`, segment by segment, to 0.01 %; errors alike to 15 %."""
    d, u = driven(np.random.default_rng(seed), 6)
    mine = fit_segments(d, u)
    for k in range(6):
        one = fit_armax(d[k], u[k][:, None], np.full(600, True))
        residual = one.residual[np.isfinite(one.residual)]
        own = mine.residual[k][np.isfinite(mine.residual[k])]
        assert float(own @ own) <= float(residual @ residual) * 1.0001
        expected = np.sqrt(np.diag(one.covariance) / one.variance_inflation)
        assert np.sqrt(np.diag(mine.covariance[k])) == pytest.approx(expected, rel=0.15)


@mostly(0.95)
def test_intervals_of_minute_fits_hold_the_truth(seed):
    """120 minutes without feedback: each of four parameters inside its 95 % interval in 88 % and more."""
    d, u = driven(np.random.default_rng(seed), 120)
    found = fit_segments(d, u)
    sd = np.sqrt(np.einsum("kjj->kj", found.model_covariance))
    assert (np.abs(found.model - MODEL) < 1.96 * sd).mean(axis=0) == pytest.approx(0.95, abs=0.07)


@mostly(0.95)
def test_one_fit_over_all_segments_holds_the_truth(seed):
    """40 minutes with offsets of their own: within 3.5 of its standard errors, which are a sixth of a minute's."""
    rng = np.random.default_rng(seed)
    d, u = driven(rng, 40)
    levels = rng.normal(size=40)
    d = d + levels[:, None]
    found = fit_joint(d, u, np.array([*MODEL, 0.0]))
    sd = np.sqrt(np.diag(found.covariance))
    assert np.all(np.abs(found.theta - [*MODEL, 0.3]) < 3.5 * sd)
    assert found.offset / (1 + MODEL[0] + MODEL[1]) == pytest.approx(levels, abs=0.8)


def test_a_segment_that_does_not_move_gives_nan_and_leaves_the_others(seed):
    """A constant error has no fit; its neighbours are as without it."""
    d, u = driven(np.random.default_rng(seed), 3)
    alone = fit_segments(d[[0, 2]], u[[0, 2]])
    u[1], d[1] = 0.0, 0.0
    found = fit_segments(d, u)
    assert np.isnan(found.theta[1]).all()
    assert found.theta[[0, 2]] == pytest.approx(alone.theta, abs=1e-6)


@mostly(0.95)
@pytest.mark.parametrize("structure", model_structures.STRUCTURES)
def test_each_structure_recovers_a_system_of_its_own(structure, seed):
    """3,000 samples: on 40 drives F was within 0.009, B within 0.026, C of BJ within 0.06; a zero far from the poles."""
    rng = np.random.default_rng(seed)
    u, e = rng.normal(size=3000), 0.3 * rng.normal(size=3000)
    F, B, C, D = [1.0, -1.2, 0.4], [0.0, 2.0, 1.0], [1.0, 0.5], [1.0, -0.8, 0.2]
    noise = {
        "ARX": lfilter([1.0], F, e),
        "ARMAX": lfilter(C, F, e),
        "OE": e,
        "BJ": lfilter(C, D, e),
    }[structure]
    y = lfilter(B, F, u) + noise
    found = model_structures.fit(structure, y, u)
    poles = found.parameters["A" if structure in ("ARX", "ARMAX") else "F"]
    assert poles == pytest.approx(F[1:], abs=0.02)
    assert found.parameters["B"] == pytest.approx(B[1:], abs=0.05)
    assert found.loss == pytest.approx(0.09, rel=0.12)
    if structure == "BJ":
        assert found.parameters["C"] == pytest.approx([0.5], abs=0.15)


def test_no_structure_loses_more_than_a_better_one_finds(seed):
    """BJ's sum of squares against scipy's least_squares on the same residual from the same kind of start: within 1.05."""
    from scipy.optimize import least_squares

    rng = np.random.default_rng(seed)
    d, u = driven(rng, 1)
    y, x = d[0] - d[0].mean(), u[0] - u[0].mean()
    found = model_structures.fit("BJ", d[0], u[0])

    def residual(t):
        w = lfilter([0.0, *t[:2]], [1.0, *t[2:4]], x)
        return np.nan_to_num(lfilter([1.0, *t[5:7]], [1.0, t[4]], y - w), nan=1e3, posinf=1e3, neginf=-1e3)

    best = least_squares(residual, [4.0, -4.0, -1.2, 0.4, 0.3, -1.2, 0.4])
    assert found.loss <= 1.05 * 2.0 * best.cost / len(y)


def test_residual_correlations_are_the_textbook_sums(seed):
    """Lag 3 by hand; the sign of the lag: an input that repeats the residual two samples later is feedback, at lag -2."""
    rng = np.random.default_rng(seed)
    e = rng.normal(size=500)
    u = np.concatenate([np.zeros(2), e[:-2]])
    plot = model_structures.residual_plot(e, u)
    x = e - e.mean()
    assert plot.auto[25 + 3] == pytest.approx(x[3:] @ x[:-3] / (x @ x))
    assert int(plot.lags[np.argmax(np.abs(plot.cross))]) == -2
    assert plot.auto_bound == pytest.approx(2.5758 / 500**0.5, rel=1e-4)


def test_no_delta_where_nothing_is_left(seed):
    """|Delta| of n = 0 is 0; of n that is itself an ARX(2) response it is that response."""
    u = np.random.default_rng(seed).normal(size=(2, 600))
    assert np.abs(unstructured.delta(np.zeros_like(u), u, 0.1)).max() == 0.0
    n = lfilter([0.0, 0.5, 0.1], [1.0, -1.1, 0.3], u, axis=1)
    q = np.exp(-2j * np.pi * unstructured.FREQUENCIES * 0.1)
    expected = (0.5 * q + 0.1 * q**2) / (1 - 1.1 * q + 0.3 * q**2)
    assert unstructured.delta(n, u, 0.1)[1] == pytest.approx(expected, rel=1e-6)


def test_what_is_left_of_a_noise_free_driver_is_nothing(seed):
    """Angle by another route (lfilter): n is zero but for the start."""
    u = np.random.default_rng(seed).normal(size=(1, 600))
    d = lfilter([0.0, *MODEL[2:]], [1.0, *MODEL[:2]], u, axis=1)
    n = unstructured.left(d, u, np.array([[*MODEL, 0.0]]))
    assert np.abs(n[:, 200:]).max() < 1e-9


@mostly(0.95)
def test_a_repeated_loop_moves_as_the_measured_one(seed):
    """Standard deviations of 30 repeated minutes within 20 % of those they were made from."""
    rng = np.random.default_rng(seed)
    S, N = 30, 600
    d, y = np.zeros((S, N)), np.zeros((S, N))
    e, w = 0.25 * rng.normal(size=(S, N)), 0.02 * rng.normal(size=(S, N))
    for t in range(2, N):
        d[:, t] = (
            -MODEL[0] * d[:, t - 1]
            - MODEL[1] * d[:, t - 2]
            + MODEL[2] * y[:, t - 1]
            + MODEL[3] * y[:, t - 2]
            + e[:, t]
        )
        y[:, t] = 1.9 * y[:, t - 1] - 0.905 * y[:, t - 2] - 0.003 * d[:, t - 1] + w[:, t]
    car = closed_loop.fit_car(d, y)
    again = closed_loop.repeat(
        np.tile(MODEL, (S, 1)), np.zeros(S), np.zeros(S), np.full(S, 0.25), car, d, y, rng
    )
    for made, measured in zip(again, (d, y), strict=True):
        assert made[:, 50:].std() == pytest.approx(measured[:, 50:].std(), rel=0.2)


@mostly(0.95)
def test_a_dead_zone_is_found_and_a_linear_driver_is_not_accused(seed):
    """20 minutes of a driver who sees nothing within 0.1 m, and of one who sees everything."""
    rng = np.random.default_rng(seed)
    u = lfilter([0.1], [1.0, -0.9], rng.normal(size=(20, 600)), axis=1)
    e = lfilter([1.0], [1.0, *MODEL[:2]], 0.1 * rng.normal(size=u.shape), axis=1)
    found = {}
    for half in (0.0, 0.1):
        d = lfilter([0.0, *MODEL[2:]], [1.0, *MODEL[:2]], u - np.clip(u, -half, half), axis=1) + e
        found[half] = nonlinearity.dead_zone(fit_segments(d, u), d, u)
    assert found[0.1].p_value < 1e-4
    assert found[0.1].statistic > 0.0
    assert found[0.0].p_value > 0.01


def test_the_least_bound_lies_above_and_is_least(seed):
    """Above every |Delta|, and 1 % less is not; the printed eq. 5 comes back from its own magnitude."""
    x = np.abs(np.random.default_rng(seed).normal(size=(40, len(unstructured.FREQUENCIES)))) + 0.1
    found = bounds.bound("x", x, x)
    assert found.above == 0.0
    assert np.all(found.magnitude >= found.largest * (1 - 1e-9))
    assert np.any(0.99 * found.magnitude < found.largest)


def test_margins_of_the_printed_driver():
    """Crossover, phase and gain margin of Table 1's means at 25 m/s by numpy alone; gains past it are unstable."""
    r = robustness.of_model(MODEL, np.zeros(len(unstructured.FREQUENCIES)), 25.0)
    w, L = robustness.OMEGA, r.loop
    at = int(np.argmax(np.abs(L) < 1.0))
    assert w[at - 1] <= r.margins.crossover <= w[at]
    phase = np.interp(np.log(r.margins.crossover), np.log(w), np.unwrap(np.angle(L)))
    assert r.margins.phase_margin_deg == pytest.approx((np.rad2deg(phase) + 180.0) % 360.0, abs=0.1)
    assert r.stable
    assert r.small_gain == 0.0
    for factor, stable in ((0.97, True), (1.03, False)):
        gain = factor * r.margins.gain_margin
        scaled = MODEL * [1.0, 1.0, gain, gain]
        assert robustness.of_model(scaled, np.zeros(len(unstructured.FREQUENCIES)), 25.0).stable is stable


def test_poles_of_the_printed_means_are_the_roots():
    """Table 1, estimation: by numpy's roots."""
    model = np.array([STEERING_TABLES[0].mean])
    found = poles_and_gain(model, np.zeros((1, 4, 4)), 0.1)
    z = np.roots([1.0, *model[0, :2]])
    assert np.sort(found.poles[0].real) == pytest.approx(np.sort(np.log(z) / 0.1))
    assert reasonable(model)[0]


def test_reverse_arrangements_are_counted_right(seed):
    """Against a double loop; a trend is seen, white noise passes in 95 %."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=20)
    count = sum(x[i] > x[j] for i in range(20) for j in range(i + 1, 20))
    expected = (count - 95.0) / (20 * 19 * 45 / 72.0) ** 0.5
    assert stationarity.statistic(x) == pytest.approx(expected)
    assert stationarity.passes(rng.normal(size=(1000, 600))).mean() == pytest.approx(0.95, abs=0.04)
    assert not stationarity.passes(rng.normal(size=(1, 600)) * np.linspace(0.2, 3.0, 600))[0]


def test_coherence_is_that_of_the_planted_noise(seed):
    """Signal and noise of equal power: coherence 0.5; the threshold holds 95 % of independent signals."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(60, 600))
    half = spectra(x, x + rng.normal(size=x.shape), 0.1)
    assert half.coherence[2:-2].mean() == pytest.approx(0.5, abs=0.03)
    above = []
    for _ in range(20):  # 33 frequencies each
        nothing = spectra(x, rng.normal(size=x.shape), 0.1)
        above.append((nothing.coherence[1:-1] > nothing.threshold).mean())
    assert np.mean(above) == pytest.approx(0.05, abs=0.04)
