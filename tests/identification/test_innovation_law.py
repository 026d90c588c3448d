"""Heavy tails and bursts are found where they are, and not where they are not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.mathematics.identification import innovation_law as law
from canid.mathematics.identification.first_order import scan
from canid.mathematics.identification.fopdt.fopdt_fit import fit_process
from tests.identification.innovation_density import log_density

EVERY = np.full(600, True)


def features(e: np.ndarray, y: np.ndarray) -> np.ndarray:
    change = np.abs(np.diff(y, prepend=y[0]))
    return law.features(e, np.full(len(e), True), np.roll(change, 1), 10.0)


def test_gaussian_noise_stays_gaussian() -> None:
    """At most 1 in 25 windows of a minute is given a tail or a changing scale."""
    rng = np.random.default_rng(11)
    found = [law.fit(e, EVERY, features(e, rng.normal(size=600))).law for e in rng.normal(size=(150, 600))]
    assert sum(math.isfinite(one.freedom) or len(one.slopes) > 0 for one in found) <= 12


@pytest.mark.parametrize("freedom", [3.0, 5.0])
def test_the_tail_is_found(freedom: float) -> None:
    """Degrees of freedom and scale of Student's t, to their sampling error."""
    e = 0.3 * np.random.default_rng(round(freedom)).standard_t(freedom, 12_000)
    found = law.fit(e, np.full(len(e), True), np.zeros((0, len(e))))
    assert 0.75 < found.law.freedom / freedom < 1.35
    assert found.law.sd == pytest.approx(0.3, rel=0.05)
    # a weight is the expected precision: its mean over the weights' own law is one
    assert np.mean(found.mixture * (e / found.law.sd) ** 2) == pytest.approx(1.0, rel=0.02)


def test_bursts_are_followed() -> None:
    """Innovations whose scale follows the last ones: the slope is positive, the held-out density rises."""
    rng = np.random.default_rng(4)
    e, recent = np.zeros(6000), 1.0
    for k in range(6000):
        e[k] = (0.3 + 0.7 * recent) * rng.normal()
        recent += (abs(e[k]) * 1.25 - recent) / 20.0
    rows = np.full(6000, True)
    of = features(e, rng.normal(size=6000))
    found = law.fit(e[:3000], rows[:3000], of[:, :3000])
    assert found.law.slopes[0] > 0.1
    plain = law.equal(3000, float(e[:3000].std()))
    later = law.weights(e[3000:], found.law, of[:, 3000:], rows[3000:])
    assert log_density(e[3000:], later).sum() > log_density(e[3000:], plain).sum() + 20.0


@pytest.mark.slow("fits many drives")
def test_bursts_make_no_gain_wrong_and_intervals_narrower() -> None:
    """A driver with Student's noise of 3 degrees of freedom: K inside as often as stated, intervals 10 % narrower."""
    inside, width = [], []
    for seed in range(24):
        rng = np.random.default_rng([seed, 5])
        u = scan(rng.normal(size=1800), np.array([0.9]))
        x = scan(0.22 * u, np.array([0.78]))
        noise = scan(rng.standard_t(3.0, size=1800), np.array([0.9]))
        y = 3.0 + 2.0 * np.roll(x, 3) + noise
        (channel,) = fit_process(y, u[:, None], np.full(1800, True), 0.1).channels
        inside.append(channel.K.low <= 2.0 <= channel.K.high)
        width.append(channel.K.high - channel.K.low)
    gaussian = 0.0
    for seed in range(6):
        rng = np.random.default_rng([seed, 6])
        u = scan(rng.normal(size=1800), np.array([0.9]))
        x = scan(0.22 * u, np.array([0.78]))
        y = 3.0 + 2.0 * np.roll(x, 3) + scan(3.0**0.5 * rng.normal(size=1800), np.array([0.9]))
        K = fit_process(y, u[:, None], np.full(1800, True), 0.1).channels[0].K
        gaussian += (K.high - K.low) / 6
    assert sum(inside) >= 20
    assert np.median(width) < 0.9 * gaussian
