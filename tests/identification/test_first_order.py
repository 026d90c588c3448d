"""The lag with dead time is the solution of its differential equation, at any fraction of a sample."""

import numpy as np
import pytest

from canid.mathematics.identification import first_order
from tests.identification.first_order_response import lags, response

DT = 0.1


def textbook(u, tau, dead_time, fine=400):
    """Solve tau x' + x = u(t - dead_time) by the midpoint rule `fine` times finer, u joined by lines."""
    t = np.arange((len(u) - 1) * fine + 1) * DT / fine
    h = DT / fine
    v = np.interp(t - dead_time, np.arange(len(u)) * DT, u)
    middle = np.interp(t + 0.5 * h - dead_time, np.arange(len(u)) * DT, u)
    x = np.empty(len(t))
    x[0] = v[0]
    for k in range(len(t) - 1):
        half = x[k] + 0.5 * h * (v[k] - x[k]) / tau
        x[k + 1] = x[k] + h * (middle[k] - half) / tau
    return x[::fine]


@pytest.mark.parametrize(
    ("tau", "dead_time"), [(0.4, 0.2), (0.05, 0.0), (0.685, 0.3137), (3.0, 1.4999), (0.02, 0.05), (0.5, 0.1)]
)
def test_equals_a_fine_integration_between_samples_too(tau, dead_time):
    """The exact recursion agrees with brute force for lags and dead times on and off the grid."""
    u = np.cumsum(np.random.default_rng(3).normal(size=60))
    got = response(u, DT, tau, dead_time).x
    assert np.allclose(got, textbook(u, tau, dead_time), atol=2e-4 * np.ptp(u))


@pytest.mark.parametrize(("tau", "dead_time"), [(0.4, 0.23), (0.08, 0.01), (2.0, 0.77)])
def test_gradient_is_the_difference_quotient(tau, dead_time):
    """d_tau and d_dead_time are the derivatives of what `response` returns."""
    u = np.cumsum(np.random.default_rng(4).normal(size=300))
    r = response(u, DT, tau, dead_time, starts=(0, 120))
    h = 1e-6

    def x(a, b):
        return response(u, DT, a, b, starts=(0, 120)).x

    by_tau = (x(tau + h, dead_time) - x(tau - h, dead_time)) / (2 * h)
    by_dead_time = (x(tau, dead_time + h) - x(tau, dead_time - h)) / (2 * h)
    # the samples just after the restart still look back across it: nobody uses them
    use = np.r_[0:120, 140:300]
    assert np.allclose(r.d_tau[use], by_tau[use], atol=1e-6 * np.ptp(u))
    assert np.allclose(r.d_dead_time[use], by_dead_time[use], atol=1e-6 * np.ptp(u))


def test_a_restart_forgets_what_was_before():
    """After a start index the answer is that of the piece alone."""
    u = np.random.default_rng(5).normal(size=200)
    whole = lags(u, DT, np.array([0.3, 2.0]), starts=(80,))
    alone = lags(u[80:], DT, np.array([0.3, 2.0]))
    assert np.allclose(whole[:, 80:], alone, atol=1e-14)


def test_scan_equals_the_loop():
    """Doubling gives the recursion's values, also for slow poles and long series."""
    rng = np.random.default_rng(6)
    v = rng.normal(size=(2, 3000))
    alpha = np.array([[0.9997], [-0.4]])
    y = np.zeros_like(v)
    for k in range(3000):
        y[:, k] = (alpha[:, 0] * y[:, k - 1] if k else 0.0) + v[:, k]
    assert np.allclose(first_order.scan(v, alpha), y, atol=1e-9)


def test_impossible_parameters_are_a_wrong_call():
    """A lag of zero or a negative dead time raises at once."""
    with pytest.raises(ValueError, match="tau"):
        response(np.ones(3), DT, 0.0, 0.0)
    with pytest.raises(ValueError, match="dead_time"):
        response(np.ones(3), DT, 1.0, -0.1)
