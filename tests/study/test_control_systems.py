"""The adapter to python-control agrees with scipy, numpy and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import linalg, optimize, signal

from canid_study.systems import control_systems as systems
from canid_study.systems.control_systems import Missing, System
from canid_study.systems.first_order_envelope import first_order_envelope
from canid_study.systems.first_order_reduction import first_order_reduction

# fourth order with two resonances and a zero in the right half plane
RESONANT = System((-3.5, 450.0, 8700.0, 25000.0), (1.0, 5.0, 430.0, 620.0, 10800.0))
SAMPLED = System((4.134, -4.0337), (1.0, -1.2623, 0.3697), dt=0.1)
OMEGA = np.geomspace(0.01, 100.0, 800)


def growing_poles(loop: System) -> int:
    """Poles of the closed loop in the right half plane, of the dead time's Padé approximant."""
    rational = systems.rational(loop)
    return int(np.sum(np.roots(np.polyadd(rational.num, rational.den)).real > 0.0))


def test_poles_zeros_and_gain_are_those_of_numpy() -> None:
    for system in (RESONANT, SAMPLED):
        at = 0.0 if system.dt is None else 1.0
        np.testing.assert_allclose(np.sort(systems.poles(system)), np.sort(np.roots(system.den)))
        np.testing.assert_allclose(np.sort(systems.zeros(system)), np.sort(np.roots(system.num)))
        gain = np.polyval(system.num, at) / np.polyval(system.den, at)
        assert systems.dc_gain(system) == pytest.approx(gain)
        assert systems.stable(system)
    assert not systems.stable(System((1.0,), (1.0, -0.1)))
    assert not systems.stable(System((1.0,), (1.0, -1.1), dt=0.1))


def test_frequency_responses_are_those_of_scipy_times_the_dead_time() -> None:
    late = RESONANT._replace(dead_time=0.4)
    of_scipy = signal.freqs(RESONANT.num, RESONANT.den, OMEGA)[1] * np.exp(-0.4j * OMEGA)
    np.testing.assert_allclose(systems.frequency_response(late, OMEGA), of_scipy, rtol=1e-9)
    w = np.linspace(0.1, 30.0, 50)
    of_scipy = signal.freqz(np.append(0.0, SAMPLED.num), SAMPLED.den, w * 0.1)[1]
    np.testing.assert_allclose(systems.frequency_response(SAMPLED, w), of_scipy, rtol=1e-9)


def test_damping_of_sampled_poles_is_that_of_their_logarithms() -> None:
    found = systems.damping(SAMPLED)
    s = np.log(found.poles.astype(complex)) / 0.1
    np.testing.assert_allclose(found.natural_frequency, np.abs(s))
    np.testing.assert_allclose(found.ratio, -s.real / np.abs(s))


def test_step_response_is_that_of_scipy_later() -> None:
    t = np.linspace(0.0, 10.0, 2001)
    y = systems.step_response(RESONANT._replace(dead_time=0.5), t)
    of_scipy = signal.step((RESONANT.num, RESONANT.den), T=t)[1]
    np.testing.assert_allclose(y[100:], of_scipy[:-100], atol=1e-6)
    assert not y[:100].any()


def test_a_series_multiplies_responses() -> None:
    one, other = systems.first_order(2.0, 0.3), System((1.0,), (1.0, 2.0, 5.0))
    g, h = (systems.frequency_response(x, OMEGA) for x in (one, other))
    both = systems.frequency_response(systems.series(one, other), OMEGA)
    np.testing.assert_allclose(both, g * h, rtol=1e-9)
    with pytest.raises(ValueError, match="sample intervals"):
        systems.series(one, SAMPLED)


def test_margins_of_a_loop_with_dead_time_are_those_of_root_finding() -> None:
    """K e^(-theta s) / (s (1 + tau s)): crossovers by bisection."""
    K, tau, theta = 1.3, 0.4, 0.5
    loop = System((K,), (tau, 1.0, 0.0), dead_time=theta)
    found = systems.margins(OMEGA, systems.frequency_response(loop, OMEGA))
    wc = optimize.brentq(lambda w: K / (w * math.hypot(1.0, tau * w)) - 1.0, 0.01, 100.0)
    phase = math.pi / 2 - math.atan(tau * wc) - theta * wc
    w180 = optimize.brentq(lambda w: math.pi / 2 - math.atan(tau * w) - theta * w, 0.01, 5.0)
    assert found.crossover == pytest.approx(wc, rel=1e-5)
    assert found.phase_margin_deg == pytest.approx(math.degrees(phase), abs=1e-3)
    assert found.delay_margin_s == pytest.approx(phase / wc, rel=1e-4)
    assert found.gain_margin == pytest.approx(w180 * math.hypot(1.0, tau * w180) / K, rel=1e-4)
    assert found.phase_crossover == pytest.approx(w180, rel=1e-4)
    dense = np.geomspace(0.1, 50.0, 100_000)
    nearest = np.abs(1.0 + systems.frequency_response(loop, dense)).min()
    assert found.modulus_margin == pytest.approx(nearest, rel=1e-3)


def test_a_dead_time_of_the_delay_margin_is_the_limit_of_stability() -> None:
    loop = System((1.3,), (0.4, 1.0, 0.0))
    margin = systems.margins(OMEGA, systems.frequency_response(loop, OMEGA)).delay_margin_s
    below, above = (growing_poles(loop._replace(dead_time=share * margin)) for share in (0.98, 1.02))
    assert (below, above) == (0, 2)


def test_disk_margins_are_the_least_distance_of_the_balanced_sensitivity() -> None:
    """alpha = min 2 |1 + L| / |1 - L| (Seiler, Packard & Gahinet 2020), of the exact dead time."""
    loop = System((0.8,), (0.4, 1.0, 0.0), dead_time=0.4)
    L = systems.frequency_response(loop, OMEGA)
    alpha = float(np.min(2.0 * np.abs(1.0 + L) / np.abs(1.0 - L)))
    found = systems.disk_margins(loop, OMEGA)
    assert found.disk == pytest.approx(alpha, rel=1e-3)
    assert found.gain_margin == pytest.approx((2.0 + alpha) / (2.0 - alpha), rel=1e-3)
    assert found.phase_margin_deg == pytest.approx(math.degrees(2.0 * math.atan(alpha / 2.0)), rel=1e-3)


def test_a_pade_approximant_has_the_phase_of_the_dead_time() -> None:
    w = np.linspace(0.1, 3.3, 30) / 0.5
    of_pade = systems.frequency_response(systems.rational(System((1.0,), (1.0,), dead_time=0.5)), w)
    assert np.rad2deg(np.abs(np.angle(of_pade * np.exp(0.5j * w)))).max() < 0.1
    by_samples = systems.rational(SAMPLED._replace(dead_time=0.3))
    np.testing.assert_allclose(
        systems.frequency_response(by_samples, w),
        systems.frequency_response(SAMPLED._replace(dead_time=0.3), w),
    )


def test_hankel_values_are_those_of_scipy_and_the_bound_holds() -> None:
    A, B, C, _ = signal.tf2ss(RESONANT.num, RESONANT.den)
    P = linalg.solve_continuous_lyapunov(A, -B @ B.T)
    Q = linalg.solve_continuous_lyapunov(A.T, -C.T @ C)
    hankel = np.sqrt(np.sort(np.linalg.eigvals(P @ Q).real)[::-1])
    for order in (1, 2, 3):
        found = systems.balanced_truncation(RESONANT, order)
        if isinstance(found, Missing):
            pytest.skip(found.remedy)
        np.testing.assert_allclose(found.hankel, hankel, rtol=1e-6)
        assert found.error_bound == pytest.approx(2.0 * hankel[order:].sum(), rel=1e-6)
        off = systems.frequency_response(RESONANT, OMEGA) - systems.frequency_response(found.system, OMEGA)
        assert np.abs(off).max() <= found.error_bound * (1.0 + 1e-9)
        assert len(systems.poles(found.system)) == order


def test_without_slycot_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    import control

    def refuse(*_: object) -> None:
        raise control.exception.ControlSlycot("can't find slycot")

    monkeypatch.setattr(control, "hankel_singular_values", refuse)
    monkeypatch.setattr(control, "balanced_reduction", refuse)
    found = systems.balanced_truncation(RESONANT, 1)
    assert isinstance(found, Missing)
    assert "canid[study]" in found.remedy


def test_balanced_truncation_refuses_what_it_is_not_defined_for() -> None:
    for system, order in (
        (System((1.0,), (1.0, -1.0, 2.0)), 1),
        (RESONANT._replace(dead_time=0.1), 1),
        (RESONANT, 4),
        (RESONANT, 0),
    ):
        with pytest.raises(ValueError, match=r"order|balanced"):
            systems.balanced_truncation(system, order)


def test_the_reduction_of_a_first_order_is_itself() -> None:
    w = np.linspace(0.01, 2.0 * math.pi, 400)
    for dead_time in (False, True):
        of = systems.first_order(-4.0, 0.7, 0.35 if dead_time else 0.0)
        found = first_order_reduction(w, systems.frequency_response(of, w), np.ones(400), dead_time=dead_time)
        assert pytest.approx(-4.0, abs=1e-3) == found.K
        assert found.tau == pytest.approx(0.7, abs=1e-3)
        assert found.dead_time == pytest.approx(of.dead_time, abs=1e-3)
        assert found.fit_percent > 99.9


def test_the_reduction_is_what_least_squares_on_a_record_finds() -> None:
    """scipy's least squares of the outputs in time, for an input with the spectrum of the weight."""
    w = np.linspace(0.02, 6.0, 300)
    found = first_order_reduction(w, systems.frequency_response(RESONANT, w), np.ones(300))
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 320.0, 0.04)
    phase = rng.uniform(0.0, 2.0 * math.pi, 300)
    u = np.cos(np.outer(t, w) + phase).sum(axis=1)
    y = signal.lsim((RESONANT.num, RESONANT.den), u, t)[1]
    kept = t > 20.0

    def left(x: np.ndarray) -> np.ndarray:
        return (y - signal.lsim(((x[0],), (x[1], 1.0)), u, t)[1])[kept]

    fit = optimize.least_squares(left, (3.0, 0.2), bounds=((-50.0, 1e-3), (50.0, 5.0)))
    assert pytest.approx(fit.x[0], rel=0.05) == found.K
    assert found.tau == pytest.approx(fit.x[1], abs=0.02)


def test_the_envelope_lies_above_and_touches(seed: int) -> None:
    rng = np.random.default_rng(seed)
    w = np.geomspace(0.05, 30.0, 80)
    errors = np.abs(
        [
            systems.frequency_response(System((g, g * z), (1.0, p)), w)
            for g, z, p in rng.uniform(0.5, 4.0, (12, 3))
        ]
    )
    found = first_order_envelope(w, errors)
    over = np.abs(systems.frequency_response(found.system, w)) / errors.max(axis=0)
    assert over.min() == pytest.approx(1.0, abs=1e-6)
    assert found.excess_db == pytest.approx(float(np.mean(20.0 * np.log10(over))), abs=1e-6)
    # no other first-order weight that lies above is nearer
    for _ in range(300):
        zero, pole = np.exp(rng.uniform(-5.0, 5.0, 2))
        shape = np.abs(systems.frequency_response(System((1.0, zero), (1.0, pole)), w))
        raised = shape * (errors.max(axis=0) / shape).max()
        excess = np.mean(20.0 * np.log10(raised / errors.max(axis=0)))
        assert excess >= found.excess_db - 0.02
