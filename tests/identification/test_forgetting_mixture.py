"""Predictive weights keep the longest memory while nothing changes, leave it when it is refuted, and come back."""

import math

import numpy as np
import pytest

from canid.mathematics.identification.armax import forgetting_mixture

LAMBDAS = (0.98, 0.99, 0.995, 1.0)


def follow(signal, trust=None):
    """Means of several memories of a noisy level: the trust after each sample, and the first refutation."""
    k = len(LAMBDAS)
    mean, weight = np.full(k, float(np.mean(signal[:100]))), np.full(k, 50.0)
    trust, seen, refuted = trust or forgetting_mixture.begin(LAMBDAS), [], None
    for t, y in enumerate(signal):
        errors = y - mean
        spreads = 1.0 + 1.0 / weight
        trust = forgetting_mixture.step(trust, errors.tolist(), spreads.tolist(), 1.0)
        weight = np.array(LAMBDAS) * weight + 1.0
        mean = mean + errors / weight
        seen.append(trust)
        if refuted is None and forgetting_mixture.refuted(trust) is not None:
            refuted = t
    return seen, refuted


@pytest.mark.slow("fits many drives")
def test_the_longest_stays_on_top_while_nothing_changes():
    """In thirty records of 500 s the longest memory is never refuted and has nearly the whole share in the mean."""
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(30):
        seen, refuted = follow(rng.normal(size=5000))
        assert refuted is None
        shares.append(np.mean([forgetting_mixture.shares(x)[-1] for x in seen]))
    assert np.mean(shares) > 0.9


def test_a_jump_refutes_the_longest_and_a_short_one_leads():
    """A level that jumps by two deviations is noticed within ten seconds at 10 Hz, by a memory that can follow."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        signal = rng.normal(size=1500) + np.where(np.arange(1500) < 1000, 0.0, 2.0)
        seen, refuted = follow(signal)
        assert 1000 <= refuted < 1100
        best = forgetting_mixture.refuted(seen[refuted])
        assert best < len(LAMBDAS) - 1
        assert seen[refuted].weights[best] == max(seen[refuted].weights[:-1])


def test_odds_are_a_test_martingale():
    """With the truth as longest memory the mean of exp(odds against it) grows no faster than its samples."""
    rng = np.random.default_rng(2)
    wrong = 0
    for _ in range(40):
        trust = forgetting_mixture.begin((0.99, 1.0))
        for e in rng.normal(size=1000):
            trust = forgetting_mixture.step(trust, (e - 0.3, e), (1.0, 1.0), 1.0)
            wrong += trust.odds > math.log(1000.0 * 40.0 / 0.01)
    # 40 000 chances of e^-odds each: the union bound is 1 %
    assert wrong == 0


def test_weights_are_a_distribution_whatever_comes():
    """Errors of any size, alike or not: weights stay finite, positive, and sum to one."""
    rng = np.random.default_rng(3)
    trust = forgetting_mixture.begin(LAMBDAS)
    for size in (0.0, 1e-9, 1.0, 1e6, 1e150):
        for _ in range(20):
            trust = forgetting_mixture.step(
                trust, (size * rng.normal(size=4)).tolist(), [1.0, 1.1, 2.0, 1e9], 1.0
            )
            assert all(0.0 <= w <= 1.0 for w in trust.weights)
            assert math.isclose(sum(trust.weights), 1.0)
            assert math.isclose(sum(forgetting_mixture.shares(trust)), 1.0)
            assert trust.odds >= 0.0


def test_renewal_makes_the_odds_even():
    """After the longest began anew it is not refuted again at once, and the weights stand."""
    before = forgetting_mixture.Trust((0.2, 0.7, 0.1), (1e-5, 1e-5), 20.0)
    after = forgetting_mixture.renew(before)
    assert forgetting_mixture.refuted(before) == 1
    assert forgetting_mixture.refuted(after) is None
    assert after.weights == before.weights


def test_one_memory_needs_no_weights():
    """A bank of one is always believed and never refuted."""
    trust = forgetting_mixture.begin((0.99,))
    assert forgetting_mixture.step(trust, (1e9,), (1.0,), 1.0) == trust
    assert forgetting_mixture.shares(trust) == (1.0,)
    assert forgetting_mixture.refuted(trust) is None
