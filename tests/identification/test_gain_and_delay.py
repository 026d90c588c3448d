"""Moments of the polynomials are those of the impulse response, and their deviations those of Monte Carlo."""

import math

import numpy as np
import pytest

from canid.mathematics.identification.armax import gain_and_delay
from canid.values.types import Identifiable, Interval
from tests.identification.first_order_response import response

DT = 0.1


def discretise(K, tau, dead_time):
    """B and A of a lag with dead time, input joined by lines: from the exact response to a unit pulse."""
    pulse = np.zeros(400)
    pulse[50] = 1.0
    g = K * response(pulse, DT, tau, dead_time).x[50:]
    a = math.exp(-DT / tau)
    B = g.copy()
    B[1:] -= a * g[:-1]
    # before the cause there is nothing; a pulse joined by lines begins one sample early
    early = K * response(pulse, DT, tau, dead_time).x[49]
    return np.array([1.0, -a]), B[:40], early


@pytest.mark.parametrize(("tau", "dead_time"), [(0.4, 0.2), (0.685, 0.3), (1.5, 0.45), (0.25, 0.13)])
def test_inverts_the_exact_discretisation(tau, dead_time):
    """K, tau and dead time come back from exact polynomials to a twentieth of a sample."""
    A, B, early = discretise(5.0, tau, dead_time)
    assert abs(early) < 1e-12
    estimated = gain_and_delay.channel(A, B, 0, 1e-12 * np.eye(1 + len(B)), DT)
    assert math.isclose(estimated.K.value, 5.0, rel_tol=1e-6)
    assert abs(estimated.tau_plus_dead_time.value - tau - dead_time) < 1e-6
    assert abs(estimated.tau.value - tau) < 0.006
    assert abs(estimated.dead_time.value - dead_time) < 0.006


def test_mean_and_variance_are_those_of_the_impulse_response():
    """The quotient rule for cumulants agrees with summing a long impulse response."""
    A, B = np.array([1.0, -1.3, 0.42]), np.array([0.5, 0.3, -0.1])
    g = np.zeros(600)
    for t in range(600):
        g[t] = (B[t - 2] if 2 <= t < 5 else 0.0) - sum(A[i] * g[t - i] for i in (1, 2) if t >= i)
    at = np.arange(600.0)
    mean = g @ at / g.sum()
    variance = g @ at**2 / g.sum() - mean**2
    estimated = gain_and_delay.channel(A, B, 2, 1e-12 * np.eye(5), 1.0)
    assert math.isclose(estimated.K.value, g.sum(), rel_tol=1e-9)
    ma, va, *_ = gain_and_delay._mean_and_variance(A, np.arange(3.0))
    mb, vb, *_ = gain_and_delay._mean_and_variance(B, 2 + np.arange(3.0))
    assert math.isclose(mb - ma, mean, rel_tol=1e-9)
    assert math.isclose(vb - va, variance, rel_tol=1e-9)


@pytest.mark.slow("whole drives through the pipeline")
def test_intervals_are_those_of_monte_carlo():
    """The delta method's and Fieller's intervals agree with drawing the polynomials."""
    A, B, _ = discretise(5.0, 0.5, 0.1)
    B = B[:4]
    cov = np.diag([1e-6] + [2e-5] * 4)
    estimated = gain_and_delay.channel(A, B, 0, cov, DT)
    assert estimated.status is Identifiable.OK
    draws = np.random.default_rng(0).multivariate_normal(np.r_[A[1:], B], cov, 4000)
    each = [gain_and_delay.channel(np.r_[1.0, d[:1]], d[1:], 0, 1e-14 * np.eye(5), DT) for d in draws]
    for name in ("K", "tau", "dead_time", "tau_plus_dead_time"):
        values = [getattr(c, name).value for c in each]
        low, high = np.quantile(values, (0.025, 0.975))
        got = getattr(estimated, name)
        assert abs(got.low - low) < 0.15 * (high - low), name
        assert abs(got.high - high) < 0.15 * (high - low), name


def test_fieller_is_the_set_of_ratios_that_the_data_do_not_reject():
    """Both ends are 1.96 deviations of b - K a from zero; a denominator that may be zero gives nothing."""
    b, a, vb, va, vab = 0.5, 0.1, 0.01, 4e-4, 1e-3
    got = gain_and_delay.ratio(b, a, vb, va, vab)
    for K in (got.low, got.high):
        assert math.isclose(abs(b - K * a), 1.959964 * math.sqrt(vb - 2 * K * vab + K * K * va), rel_tol=1e-5)
    assert math.isnan(gain_and_delay.ratio(0.5, 0.1, 0.01, 0.01, 0.0).value)


def test_the_anytime_gain_is_the_plain_one_made_wider_by_the_data():
    """After 2 min it is as wide as the theory says, with less data wider; the value stays."""
    plain = Interval(4.0, 3.0, 5.5)
    for seconds, times in ((120.0, 3.035 / 1.96), (15.0, 3.637 / 1.96)):
        interval = gain_and_delay.anytime(plain, seconds)
        assert interval.value == plain.value
        assert math.isclose(interval.high - interval.low, times * 2.5, rel_tol=0.01)


def test_no_lag_is_claimed_for_a_lead_or_an_unstable_answer():
    """Negative variance, negative delay or a pole outside the circle: no tau, no gain where there is none."""
    lead = gain_and_delay.channel(np.array([1.0, -0.5]), np.array([5.0, -4.0]), 1, 1e-10 * np.eye(3), DT)
    assert lead.status is Identifiable.GAIN_ONLY
    assert math.isnan(lead.tau.value)
    runaway = gain_and_delay.channel(np.array([1.0, -1.1]), np.array([1.0]), 1, 1e-10 * np.eye(2), DT)
    assert runaway.status is Identifiable.NOT
    assert math.isnan(runaway.K.value)
