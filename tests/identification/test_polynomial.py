"""Stability by step-down agrees with the roots; division agrees with the loop."""

import numpy as np

from canid.mathematics.identification.armax import polynomial


def test_step_down_agrees_with_the_roots():
    """Five hundred random polynomials up to order four, at two radii."""
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(500):
        c = rng.normal(size=rng.integers(1, 5))
        largest = np.abs(np.roots(np.r_[1.0, c])).max()
        for radius in (1.0, 0.9):
            stable = polynomial.is_stable(c.tolist(), radius)
            assert stable == bool(largest < radius)
            seen.add(stable)
    assert seen == {True, False}


def test_projection_moves_only_what_is_outside():
    """Zeros inside stay, zeros outside end on the circle, conjugate pairs stay real polynomials."""
    zeros = np.array([0.5, 1.3 * np.exp(1j), 1.3 * np.exp(-1j), -1.05])
    c = np.real(np.poly(zeros))[1:]
    got = np.roots(np.r_[1.0, polynomial.project(c, 0.95)])
    assert np.isclose(np.sort(np.abs(got)), [0.5, 0.95, 0.95, 0.95]).all()
    assert np.isclose(np.abs(got - 0.5).min(), 0.0, atol=1e-9)
    inside = np.array([-0.5, 0.2])
    assert polynomial.project(inside, 0.95) is inside


def test_division_is_the_recursion():
    """1/C of orders zero to three equals the loop, for several rows at once."""
    rng = np.random.default_rng(1)
    for zeros in ([], [0.9], [0.8 * np.exp(0.5j), 0.8 * np.exp(-0.5j)], [0.5, 0.5, -0.9]):
        c = np.real(np.poly(zeros))[1:] if zeros else np.zeros(0)
        x = rng.normal(size=(2, 400))
        y = np.zeros_like(x)
        for t in range(400):
            y[:, t] = x[:, t] - sum(c[i] * y[:, t - 1 - i] for i in range(len(c)) if t > i)
        assert np.allclose(polynomial.divide(x, c), y, atol=1e-8)
