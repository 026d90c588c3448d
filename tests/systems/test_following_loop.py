"""The car-following loop: agrees with python-control, with a simulation in time, and with published numbers recomputed."""

from __future__ import annotations

import numpy as np
import pytest

from canid.mathematics.identification.confidence import QUANTILES
from canid.mathematics.systems import following_loop
from canid.mathematics.systems.following_loop import FollowingLoop
from canid_study.systems import control_systems
from canid_study.systems.control_systems import System


def drawn(rng: np.random.Generator, k: int) -> FollowingLoop:
    """Drivers of a pedal with cars."""
    return FollowingLoop(
        rng.uniform(3.0, 9.0, (k, 2)),
        rng.uniform(0.0, 0.9, (k, 2)),
        rng.uniform(0.0, 0.6, (k, 2)),
        float(rng.uniform(8.0, 30.0)),
        float(rng.uniform(1.0, 2.5)),
        rng.uniform(0.02, 0.06, k),
        rng.uniform(0.1, 0.6, k),
        rng.uniform(0.0, 0.05, k),
    )


def by_control(loop: FollowingLoop, i: int, omega: np.ndarray) -> np.ndarray:
    """L of one driver, channel by channel through the adapter."""

    def over(system: System) -> np.ndarray:
        return control_systems.frequency_response(system, omega)

    (K1, K2), tau, late = loop.K[i], loop.tau[i], loop.dead_time[i]
    strength, lag, damping = (float(x[i]) for x in (loop.strength, loop.lag, loop.damping))
    car = System((strength,), (lag, 1.0))
    headway = control_systems.series(
        control_systems.first_order(float(K1) / loop.speed, float(tau[0]), float(late[0])),
        System((loop.headway, 1.0), (1.0, 0.0)),
    )
    rate = control_systems.first_order(float(K2), float(tau[1]), float(late[1]))
    return (over(headway) + over(rate)) * over(car) * over(System((1.0,), (1.0, damping)))


@pytest.mark.slow("margins over drawn drives")
def test_margins_agree_with_python_control(seed: int) -> None:
    loop = drawn(np.random.default_rng(seed), 12)
    found = following_loop.margins(loop)
    omega = np.geomspace(1e-3, 60.0, 1500)
    checked = 0
    for i in range(12):
        L = by_control(loop, i, omega)
        np.testing.assert_allclose(following_loop.loop_transfer(loop, omega)[i], L, rtol=1e-9)
        if found.unstable[i]:
            continue
        wanted = control_systems.margins(omega, L)
        assert found.phase_margin_deg[i] == pytest.approx(wanted.phase_margin_deg, abs=0.01)
        assert found.crossover[i] == pytest.approx(wanted.crossover, rel=1e-3)
        assert found.delay_margin_s[i] == pytest.approx(wanted.delay_margin_s, rel=1e-3)
        assert found.modulus_margin[i] == pytest.approx(wanted.modulus_margin, rel=1e-3)
        # above the highest frequency given, control finds none
        if wanted.gain_margin < 1e3:
            assert found.gain_margin[i] == pytest.approx(wanted.gain_margin, rel=1e-2)
        checked += 1
    assert checked


def test_a_dead_time_beyond_the_delay_margin_makes_it_unstable(seed: int) -> None:
    """The delay margin against the argument principle, which counts growing modes."""
    loop = drawn(np.random.default_rng(seed), 60)
    margin = following_loop.margins(loop)
    for share, wanted in ((0.97, False), (1.03, True)):
        later = loop._replace(dead_time=loop.dead_time + share * margin.delay_margin_s[:, None])
        stable = ~margin.unstable
        assert (following_loop.unstable(later)[stable] == wanted).all()


def test_a_gain_beyond_the_gain_margin_makes_it_unstable(seed: int) -> None:
    loop = drawn(np.random.default_rng(seed), 60)
    found = following_loop.margins(loop)
    kept = np.flatnonzero(~found.unstable & (found.gain_margin < 200.0) & (found.gain_margin > 1.0))
    assert len(kept)
    few = following_loop.chosen(loop, kept)
    for share, wanted in ((0.97, False), (1.03, True)):
        more = few._replace(strength=few.strength * (1.0 + (found.gain_margin[kept] - 1.0) * share))
        assert (following_loop.unstable(more) == wanted).all()


def test_the_string_peak_is_that_of_a_simulation_in_time() -> None:
    """Behind a lead whose speed swings at the peak's frequency the follower's swings by the peak."""
    K1, K2, tau, late, v0, h, b, car_lag = 4.5, 4.7, 0.6, 0.4, 12.0, 1.4, 0.04, 0.35
    loop = FollowingLoop(
        np.array([[K1, K2]]),
        np.full((1, 2), tau),
        np.full((1, 2), late),
        v0,
        h,
        np.array([b]),
        np.array([car_lag]),
    )
    found = following_loop.margins(loop)
    peak, hz = float(found.string_peak[0]), float(found.string_peak_hz[0])
    assert peak > 1.01
    dt = 0.005
    n, steps = round(30.0 / hz / dt), round(late / dt)
    t = np.arange(n) * dt
    lead = np.sin(2.0 * np.pi * hz * t)
    v = gap = y1 = y2 = a = 0.0
    errors, rates, speed = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(n):
        errors[k], rates[k], speed[k] = (gap - h * v) / v0, lead[k] - v, v
        past = k - steps
        y1 += ((errors[past] if past >= 0 else 0.0) - y1) * dt / tau
        y2 += ((rates[past] if past >= 0 else 0.0) - y2) * dt / tau
        a += (b * (K1 * y1 + K2 * y2) - a) * dt / car_lag
        gap += (lead[k] - v) * dt
        v += a * dt
    last = t > 20.0 / hz
    assert np.ptp(speed[last]) / 2.0 == pytest.approx(peak, rel=0.01)


# K1, tau1, K2, tau2 as printed (Grover 2021, Tables 1 and 2)
PRINTED = [
    (7.8095, 0.141, 6.654, 0.144),
    (4.3671, 0.685, 5.6303, 0.401),
    (11.408, 0.1857, 4.867, 0.0262),
    (4.1461, 0.734, 4.3372, 0.0362),
]


def test_the_printed_drivers_keep_a_car_in_line() -> None:
    """Phase margin 62 to 90 degrees, delay margin 3.2 to 8.8 s, peak at most 1.03, tau read as a lag or as a dead time."""
    every = []
    for speed in (8.0, 15.0, 25.0):
        for K1, t1, K2, t2 in PRINTED:
            delay, none = np.array([[t1, t2]]), np.zeros((1, 2))
            for tau, late in ((delay, none), (none, delay)):
                car = (np.array([0.04]), np.array([0.3]), np.array([0.05]))
                every.append(
                    following_loop.margins(FollowingLoop(np.array([[K1, K2]]), tau, late, speed, 2.0, *car))
                )
    phase, delays, peak = (
        np.array([getattr(m, name)[0] for m in every])
        for name in ("phase_margin_deg", "delay_margin_s", "string_peak")
    )
    assert 61.9 < phase.min() < 62.0 < 90.0 < phase.max() < 90.4
    assert 3.17 < delays.min() < 3.2 < 8.8 < delays.max() < 8.83
    assert peak.min() == 1.0
    assert 1.0301 < peak.max() < 1.0303
    # Table 1 at 8 m/s, tau as a lag
    assert every[0].phase_margin_deg[0] == pytest.approx(71.3095, abs=1e-3)
    assert every[0].gain_margin[0] == pytest.approx(29.0939, rel=1e-4)


def test_an_unstable_loop_has_no_margin() -> None:
    found = following_loop.margins(
        FollowingLoop(np.array([[0.3, 3.0]]), np.full((1, 2), 0.4), np.full((1, 2), 0.5), 20.0, 1.5)
    )
    assert found.unstable[0]
    assert (found.phase_margin_deg[0], found.gain_margin[0], found.delay_margin_s[0]) == (0.0, 1.0, 0.0)
    assert np.isinf(found.string_peak[0])


def test_two_hundred_draws_reach_beyond_each_end_of_an_interval() -> None:
    assert QUANTILES[0] * 200 >= 5  # draws beyond each end
