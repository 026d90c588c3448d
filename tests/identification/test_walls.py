"""The descent of a Box-Jenkins model goes on along its walls; no other start finds more."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from canid.mathematics.identification.armax.box_jenkins import at_stride, fit_rows, ready_rows
from canid.mathematics.identification.armax.box_jenkins_channels import channels
from canid.mathematics.identification.armax.prediction_errors import BoxJenkinsOrders, Rows, split
from canid.mathematics.identification.armax.walled_descent import DAMPING, at_pole_wall, descend, within
from canid.mathematics.identification.identifiability import quotable
from canid.values.types import Array
from tests.identification.slow_noise_loop import Hidden, drive


def rows_of(seed: int, hidden: Hidden, seconds: float = 200.0) -> Rows:
    output, inputs = drive(seed, seconds, hidden)
    return ready_rows(output, inputs, np.full(len(output), True))


@pytest.mark.slow("descends from many starts")
@pytest.mark.parametrize("seed", range(3))
def test_no_other_start_gains(seed: int) -> None:
    """Of a driver so quick that the pole is pressed against zero: less than 1 in 2 log likelihood from nine starts."""
    rows = rows_of(seed, Hidden(tau=0.06, dead_time=0.35, remembers=0.95, noise=0.05, freedom=8.0))
    fit = fit_rows(rows, 0.1)
    assert fit is not None
    data = at_stride(rows._replace(delays=fit.delays), fit.stride)._replace(root=fit.root)
    o, count = data.orders, int((data.age >= 0).sum()) / fit.stride
    for lags in itertools.product((0.1, 0.5, 2.0), repeat=2):
        theta = fit.theta.copy()
        for i, lag in enumerate(lags):
            at = i * (o.nb + o.nf) + o.nb
            pole = -np.exp(-0.1 / lag)
            theta[at - o.nb : at] = 0.5 * theta[at - o.nb : at].sum() * (1.0 + pole) / (1.0 + theta[at])
            theta[at] = pole
        other = descend(theta, data, 0.1, np.full(len(theta), True))
        assert other is not None
        assert count * np.log(fit.cost * fit.stride / other.cost) < 1.0, lags


def test_a_wall_of_one_parameter_does_not_hold_the_others() -> None:
    """From a start on two walls the gain of the other input is found."""
    rng = np.random.default_rng(5)
    u, e = rng.normal(size=(1500, 2)), 0.05 * rng.normal(size=1500)
    y = e + 0.7 * np.roll(u[:, 0], 2)
    w = np.zeros(1500)
    for t in range(3, 1500):
        w[t] = 0.8 * w[t - 1] + 0.4 * u[t - 2, 1] + 0.1 * u[t - 3, 1]
    rows = at_stride(ready_rows(y + w, u, np.full(1500, True), BoxJenkinsOrders(2, 1, 0, 1, 2)), 1)
    # the first input's answer has no lag: its pole and its second coefficient belong on their walls
    theta = np.array([0.1, 0.0, 0.0, 0.0, 0.1, -0.5, 0.0, 0.0])
    found = descend(theta, rows, 0.1, np.full(8, True), DAMPING)
    assert found is not None
    B, F, *_ = split(found.theta, rows.orders, 2)
    assert np.allclose(B[1], [0.4, 0.1], atol=0.03)
    assert abs(F[1, 0] + 0.8) < 0.03
    assert abs(B[0].sum() / (1.0 + F[0, 0]) - 0.7) < 0.03


@pytest.mark.slow("fits a model for each of many lags")
def test_a_pole_at_its_wall_gives_no_lag() -> None:
    """Gain and sum are averaged over lags there, and tau and dead time are never quoted."""
    hidden = Hidden(tau=0.02, dead_time=0.35, remembers=0.9, noise=0.05, freedom=20.0)
    walls = 0
    for seed in range(4):
        rows = rows_of(seed, hidden, 120.0)
        fit = fit_rows(rows, 0.1)
        assert fit is not None
        found = channels(("a", "b"), fit, rows, 0.1)
        for channel, wall in zip(found.values(), at_pole_wall(fit.theta, fit.orders, 2, 0.1), strict=True):
            walls += wall
            assert not (wall and quotable(channel, "tau"))
    assert walls


@pytest.mark.parametrize(
    "theta", [[1.0, -0.2, 0.3, 0.0, 0.5], [-1.0, 0.2, -1.5, 1.0, -2.0], [0.0, 0.0, -0.5, 0.0, 0.0]]
)
def test_what_is_within_stays(theta: list[float]) -> None:
    """Projecting twice is projecting once."""
    o = BoxJenkinsOrders(2, 1, 0, 1)
    once: Array = within(np.array(theta), o, 1, 0.95)
    assert np.allclose(within(once, o, 1, 0.95), once, atol=1e-12)
