"""Stability of the car-following loop against its simulation and against the textbook."""

import math

import numpy as np
import pytest

from canid.mathematics.identification import closed_loop_stability
from canid.values.types import Channel, Interval


def grows(K, tau, dead_time, speed, headway, seconds=150.0, dt=0.02):
    """Whether a small disturbance of the gap grows, by Euler steps of the delayed equations."""
    n, late = round(seconds / dt), np.round(np.array(dead_time) / dt).astype(int)
    v, gap, x = 0.0, 1.0, [0.0, 0.0]
    seen, size = [[0.0] * n, [0.0] * n], np.empty(n)
    for i in range(n):
        seen[0][i], seen[1][i] = (gap - headway * v) / speed, -v
        for k in range(2):
            u = seen[k][i - late[k]] if i >= late[k] else 0.0
            x[k] += dt * (u - x[k]) / tau[k]
        gap, v = gap - dt * v, v + dt * (K[0] * x[0] + K[1] * x[1])
        size[i] = abs(v) + 0.1 * abs(gap)
        if size[i] > 1e6:
            return True
    return size[-n // 4 :].max() > size[n // 4 : n // 2].max()


def test_the_count_of_growing_modes_agrees_with_a_simulation():
    """Drawn drivers, stable and not: the argument principle and Euler steps never disagree."""
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(14):
        K = np.array([rng.uniform(0.05, 6.0), rng.uniform(0.0, 3.0)])
        tau, dead_time = rng.uniform(0.1, 1.2, 2), np.round(rng.uniform(0.0, 1.0, 2), 2)
        speed, headway = rng.uniform(8.0, 35.0), rng.uniform(0.8, 2.5)
        counts = [
            int(
                closed_loop_stability.unstable_roots(K[None] * x, tau[None], dead_time[None], speed, headway)[
                    0
                ]
            )
            for x in (0.97, 1.0, 1.03)
        ]
        if len(set(counts)) > 1:  # at the limit Euler's step decides
            continue
        seen.add(counts[1] > 0)
        assert grows(K, tau, dead_time, speed, headway) == (counts[1] > 0), (K, tau, dead_time)
    assert seen == {True, False}


@pytest.mark.parametrize("dead_time", [0.2, 0.5, 1.4])
def test_a_delayed_integrator_is_stable_up_to_half_pi(dead_time):
    """dv/dt = -K v(t - theta) is stable for K theta < pi/2 (Hayes 1950); an unstable pair follows beyond."""
    for share, count in ((0.98, 0), (1.02, 2)):
        K = np.array([[1e-9, share * math.pi / 2.0 / dead_time]])
        delays = np.full((1, 2), 1e-6), np.full((1, 2), dead_time)
        assert closed_loop_stability.unstable_roots(K, *delays, 20.0, 1.5)[0] == count


def test_a_negative_gain_of_headway_diverges():
    """One real mode grows, whatever the gain of range rate."""
    delays = np.full((1, 2), 0.3), np.full((1, 2), 0.3)
    assert closed_loop_stability.unstable_roots(np.array([[-0.2, 0.6]]), *delays, 20.0, 1.5)[0] == 1


def test_an_interval_across_the_limit_is_unstable_in_part():
    """The share of an interval on the wrong side of the limit is found to a tenth."""
    quick = Channel(Interval(1e-6, 1e-6, 1e-6), Interval(1e-6, 1e-6, 1e-6), Interval(0.5, 0.5, 0.5))
    limit = math.pi
    across = quick._replace(K=Interval(limit, limit - 0.5, limit + 0.5))
    assert abs(closed_loop_stability.unstable_share((quick, across), 20.0, 1.5) - 0.5) < 0.1
    assert closed_loop_stability.unstable_share((quick, across), 20.0, 1.5) == (
        closed_loop_stability.unstable_share((quick, across), 20.0, 1.5)
    )
