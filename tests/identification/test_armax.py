"""ARMAX finds what was planted, in batch and sample by sample, through gaps, with honest intervals."""

import math

import numpy as np
import pytest

from canid.identification import armax_batch, armax_recursive, orders
from canid.identification.armax_batch import Orders, fit_armax

# Chen & Ulsoy 2001, table 1, mean; b and c1 = -0.5 as in the measured reference
TABLE_1 = np.array([-1.2623, 0.3697, 4.134, -4.0337, 0.0, -0.5])


def simulate(theta, o, u, e):
    """A y = B u + c0 + C e, written as the loop."""
    m = u.shape[1]
    a, b = theta[: o.na], theta[o.na : o.na + m * o.nb].reshape(m, o.nb)
    c0, c = theta[o.na + m * o.nb], theta[o.na + m * o.nb + 1 :]
    y = np.zeros(len(u))
    for t in range(o.lag() + o.nc, len(u)):
        y[t] = c0 + e[t] - sum(a[i] * y[t - 1 - i] for i in range(o.na))
        y[t] += sum(b[i, j] * u[t - o.nk - j, i] for i in range(m) for j in range(o.nb))
        y[t] += sum(c[i] * e[t - 1 - i] for i in range(o.nc))
    return y


def table_1(seed, N=600):
    rng = np.random.default_rng(seed)
    u, w = np.zeros(N + 200), rng.normal(size=N + 200)
    for k in range(2, N + 200):
        u[k] = 1.6 * u[k - 1] - 0.64 * u[k - 2] + w[k]
    u = (0.3 * u / u.std())[:, None]
    y = simulate(TABLE_1, Orders(), u, 0.1 * rng.normal(size=N + 200))
    return y[200:], u[200:]


def test_recovers_table_1_near_the_bound():
    """Error in units of the Cramér-Rao deviation is one, and 95 % intervals cover, over twelve runs."""
    errors, hits = [], []
    for seed in range(12):
        y, u = table_1(seed)
        fit = fit_armax(y, u, np.full(600, True))
        sd = np.sqrt(np.diag(fit.covariance))
        errors.append((fit.theta - TABLE_1) / (sd / fit.temper**0.5))
        hits.append(np.abs(fit.theta - TABLE_1) < 1.96 * sd)
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    # 12 runs: chi-squared puts the rms of a unit Gaussian below 1.48 in 99.5 %
    assert (rms < 1.5).all(), rms
    assert np.mean(hits) > 0.85


def test_gradient_is_the_difference_quotient():
    """psi is minus the derivative of the innovations, in every parameter and over a gap."""
    rng = np.random.default_rng(0)
    o = Orders(2, 2, 2, 1)
    y, u = rng.normal(size=200), rng.normal(size=(200, 2))
    usable = np.full(200, True)
    usable[90:95] = False
    data, _ = armax_batch._ready(y, u, usable, o, None)
    phi = armax_batch._regressors(data, o)
    theta = rng.normal(size=o.count(2)) * 0.2
    _, psi = armax_batch._predict(theta, phi, data, o)
    for i in range(len(theta)):
        step = np.zeros(len(theta))
        step[i] = 1e-6
        high, _ = armax_batch._predict(theta + step, phi, data, o)
        low, _ = armax_batch._predict(theta - step, phi, data, o)
        assert np.allclose(psi[i], -(high - low) / 2e-6, atol=1e-6)


def test_gaps_do_not_bias():
    """Holes full of nonsense and a broken segment cost data, not truth."""
    y, u = table_1(3, N=1500)
    usable = np.arange(1500) % 200 >= 40
    y[~usable] = math.nan
    u[::200] = math.nan
    segment = (np.arange(1500) >= 700).astype(np.int64)
    fit = fit_armax(y, u, usable, segment=segment)
    sd = np.sqrt(np.diag(fit.covariance))
    assert (np.abs(fit.theta - TABLE_1) < 3.5 * sd).all()
    assert np.isnan(fit.residual[~usable]).all()


def test_two_inputs_with_offset_and_higher_orders():
    """Every parameter of a three-pole model with two inputs and an offset comes back."""
    o = Orders(3, 2, 2, 2)
    A = np.real(np.poly([0.8, 0.5 * np.exp(0.6j), 0.5 * np.exp(-0.6j)]))[1:]
    truth = np.r_[A, 1.0, -0.4, 0.3, 0.6, 2.0, 0.5, 0.2]
    rng = np.random.default_rng(4)
    u = rng.normal(size=(6000, 2))
    y = simulate(truth, o, u, 0.2 * rng.normal(size=6000))
    fit = fit_armax(y, u, np.full(6000, True), o)
    assert (np.abs(fit.theta - truth) < 4 * np.sqrt(np.diag(fit.covariance))).all()
    assert fit.whiteness.white
    assert np.allclose(fit.A, np.r_[1, A], atol=0.05)
    assert fit.B.shape == (2, 2)
    assert fit.offset == fit.theta[7]
    assert np.isclose(sorted(np.abs(fit.poles))[-1], 0.8, atol=0.05)


def test_recursion_ends_where_the_batch_does():
    """From a 15 s start, without forgetting, the recursion at sample 600 is within a third of the batch's
    deviation in the mean, and none is lost."""
    apart = []
    for seed in range(8):
        y, u = table_1(100 + seed)
        batch = fit_armax(y, u, np.full(600, True))
        state = armax_recursive.begin(fit_armax(y[:150], u[:150], np.full(150, True)))
        for k in range(150, 600):
            state, _ = armax_recursive.step(state, Orders(), float(y[k]), u[k].tolist(), 1.0)
        sd = np.sqrt(np.diag(batch.covariance))
        apart.append((np.array(state.theta) - batch.theta) / sd)
        assert np.abs(np.array(state.theta) - TABLE_1).max() < 5 * sd.max()
        # the covariances agree as well: both are the information of the same 600 samples
        ratio = np.sqrt(np.diag(armax_recursive.covariance(state))) / sd
        assert ((ratio > 0.6) & (ratio < 1.7)).all()
    assert np.median(np.abs(apart)) < 1 / 3


def test_c_stays_stable_whatever_comes():
    """Pulses that would throw C outside the circle are survived with finite, stable parameters."""
    from canid.identification.polynomial import is_stable

    y, u = table_1(7)
    state = armax_recursive.begin(fit_armax(y[:150], u[:150], np.full(150, True)))
    rng = np.random.default_rng(0)
    for k in range(150, 600):
        kick = 50.0 * rng.normal() if k % 37 == 0 else 0.0
        state, _ = armax_recursive.step(state, Orders(), float(y[k]) + kick, u[k].tolist(), 0.97)
        assert is_stable(state.theta[-1:], 1.0)
        assert np.isfinite(state.theta).all()
        assert min(state.factors.d) > 0.0


def test_twenty_minutes_without_excitation_are_survived():
    """After 20 min of an input that only trembles, the transfer function is still the one learnt before."""
    rng = np.random.default_rng(5)
    N = 3000
    y, u = table_1(5, N=N)
    quiet_u = 1e-3 * rng.normal(size=(12_000, 1))
    quiet = simulate(TABLE_1, Orders(), quiet_u, 0.002 * rng.normal(size=12_000))
    state = armax_recursive.begin(fit_armax(y[:150], u[:150], np.full(150, True)))
    for k in range(150, N):
        state, _ = armax_recursive.step(state, Orders(), float(y[k]), u[k].tolist(), 0.99)

    def transfer(theta):
        z = np.exp(-2j * np.pi * 0.2 * 0.1)
        return (theta[2] * z + theta[3] * z**2) / (1 + theta[0] * z + theta[1] * z**2)

    truth = transfer(TABLE_1)
    state = armax_recursive.rest(state)
    for k in range(12_000):
        state, _ = armax_recursive.step(state, Orders(), float(quiet[k]), quiet_u[k].tolist(), 0.99)
    assert min(state.factors.d) > 0.0
    assert abs(transfer(state.theta) / truth - 1) < 0.35


def test_a_restart_learns_nothing_until_the_lags_are_real():
    """After `rest` the first samples only fill the lags."""
    y, u = table_1(8)
    state = armax_recursive.begin(fit_armax(y, u, np.full(600, True)))
    for _ in range(2):
        new, e = armax_recursive.step(state, Orders(), 1e9, [1e9], 0.99)
        assert math.isnan(e)
        assert new.theta == state.theta
        state = new


def test_weak_data_give_none_and_wrong_calls_raise():
    """Constant or too few data: None. Shapes and orders that make no sense: ValueError."""
    assert fit_armax(np.ones(500), np.ones((500, 2)), np.full(500, True)) is None
    assert fit_armax(np.arange(20.0), np.ones((20, 1)), np.full(20, True)) is None
    assert fit_armax(np.zeros(0), np.zeros((0, 2)), np.zeros(0, bool)) is None
    with pytest.raises(ValueError, match="expected"):
        fit_armax(np.ones(5), np.ones((6, 1)), np.full(5, True))
    with pytest.raises(ValueError, match="nb"):
        fit_armax(np.ones(5), np.ones((5, 1)), np.full(5, True), Orders(1, 0, 1, 1))


def test_order_selection_finds_the_dead_time():
    """Among the candidates BIC ranks the planted dead time first, and white residuals say so."""
    rng = np.random.default_rng(9)
    o = Orders(2, 2, 1, 4)
    u = np.cumsum(rng.normal(size=(2000, 1)), axis=0) * 0.2
    y = simulate(np.r_[-1.2, 0.35, 0.8, 0.4, 1.0, -0.3], o, u, 0.3 * rng.normal(size=2000))
    best = orders.compare(y, u, np.full(2000, True))[0]
    assert best.orders == o
    assert best.white
