"""The residual tests keep their level and see what they are for."""

import numpy as np
import pytest

from canid.identification import residuals


def test_white_noise_passes_at_the_stated_level():
    """Of 400 white series about one per cent fails, and coloured ones fail nearly all."""
    rng = np.random.default_rng(0)
    failed = sum(not residuals.whiteness(rng.normal(size=600)).white for _ in range(400))
    assert failed <= 11  # binomial 0.01: 99.9 %
    coloured = 0
    for _ in range(50):
        e = rng.normal(size=601)
        coloured += not residuals.whiteness(e[1:] + 0.3 * e[:-1]).white
    assert coloured >= 48


def test_bound_agrees_with_the_exact_quantile():
    """Wilson and Hilferty's chi-squared quantile agrees with scipy's."""
    stats = pytest.importorskip("scipy.stats")
    for k in (5, 22, 25, 60):
        assert abs(residuals.chi2_bound(k) / stats.chi2.ppf(0.99, k) - 1) < 3e-3


def test_a_missed_answer_shows_at_positive_lags_and_feedback_at_negative_ones():
    """Correlation with earlier inputs is an answer not modelled; with later inputs, a closed loop."""
    rng = np.random.default_rng(1)
    u, e = rng.normal(size=800), rng.normal(size=800)
    missed = residuals.cross(e + 0.4 * np.roll(u, 3), u)
    assert not missed.causal
    assert not missed.feedback
    assert int(np.argmax(np.abs(missed.correlation))) - residuals.LAGS == 3
    closed = residuals.cross(e, u + 0.4 * np.roll(e, 5))
    assert closed.causal
    assert closed.feedback


def test_left_over_colour_widens_and_white_noise_does_not():
    """For an AR(1) score of 0.6 the factor approaches (1+0.6)/(1-0.6) = 4; for white noise it is one."""
    rng = np.random.default_rng(2)
    e = np.zeros(20_000)
    w = rng.normal(size=20_000)
    for k in range(1, 20_000):
        e[k] = 0.6 * e[k - 1] + w[k]
    ones = np.ones((1, 20_000))
    assert 3.3 < residuals.left_over(ones * e, ones * e.std(), 60) < 4.5
    assert residuals.left_over(ones * w, ones, 20) < 1.3


def test_nothing_to_test_is_not_white():
    """Empty, short or constant-zero residuals pass no test."""
    for e in (np.zeros(0), np.zeros(200), np.ones(3)):
        assert not residuals.whiteness(e).white
