"""Predictive weights keep the longest memory while nothing changes, leave it when it is refuted, and come back."""

import math

import numpy as np

from canid.identification import memories

LAMBDAS = (0.98, 0.99, 0.995, 1.0)


def follow(signal, trust=None):
    """Means of several memories of a noisy level: the trust after each sample, and the first refutation."""
    k = len(LAMBDAS)
    mean, weight = np.full(k, float(np.mean(signal[:100]))), np.full(k, 50.0)
    trust, seen, refuted = trust or memories.begin(k), [], None
    for t, y in enumerate(signal):
        errors = y - mean
        spreads = 1.0 + 1.0 / weight
        trust = memories.step(trust, errors.tolist(), spreads.tolist(), 1.0)
        weight = np.array(LAMBDAS) * weight + 1.0
        mean = mean + errors / weight
        seen.append(trust)
        if refuted is None and memories.refuted(trust) is not None:
            refuted = t
    return seen, refuted


def test_the_longest_stays_on_top_while_nothing_changes():
    """In thirty records of 500 s the longest memory is never refuted and has nearly the whole share in the mean."""
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(30):
        seen, refuted = follow(rng.normal(size=5000))
        assert refuted is None
        shares.append(np.mean([memories.shares(x)[-1] for x in seen]))
    assert np.mean(shares) > 0.9


def test_a_jump_refutes_the_longest_and_a_short_one_leads():
    """A level that jumps by two deviations is noticed within ten seconds at 10 Hz, by a memory that can follow."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        signal = rng.normal(size=1500) + np.where(np.arange(1500) < 1000, 0.0, 2.0)
        seen, refuted = follow(signal)
        assert 1000 <= refuted < 1100
        best = memories.refuted(seen[refuted])
        assert best < len(LAMBDAS) - 1
        assert seen[refuted].weights[best] == max(seen[refuted].weights[:-1])


def test_odds_are_a_test_martingale():
    """With the truth as longest memory the mean of exp(odds against it) grows no faster than its samples."""
    rng = np.random.default_rng(2)
    wrong = 0
    for _ in range(40):
        trust = memories.begin(2)
        for e in rng.normal(size=1000):
            trust = memories.step(trust, (e - 0.3, e), (1.0, 1.0), 1.0)
            wrong += trust.odds > math.log(1000.0 * 40.0 / 0.01)
    # 40 000 chances of e^-odds each: the union bound is 1 %
    assert wrong == 0


def test_weights_are_a_distribution_whatever_comes():
    """Errors of any size, alike or not: weights stay finite, positive, and sum to one."""
    rng = np.random.default_rng(3)
    trust = memories.begin(4)
    for size in (0.0, 1e-9, 1.0, 1e6, 1e150):
        for _ in range(20):
            trust = memories.step(trust, (size * rng.normal(size=4)).tolist(), [1.0, 1.1, 2.0, 1e9], 1.0)
            assert all(0.0 <= w <= 1.0 for w in trust.weights)
            assert math.isclose(sum(trust.weights), 1.0)
            assert math.isclose(sum(memories.shares(trust)), 1.0)
            assert trust.odds >= 0.0


def test_renewal_shares_between_the_two_and_forgets_the_odds():
    """The longest and the one it began anew from are equals, the others keep what they had."""
    before = memories.Trust((0.2, 0.7, 0.1), 20.0)
    after = memories.renew(before, 1)
    assert np.allclose(after.weights, (0.2, 0.4, 0.4))
    assert memories.refuted(after) is None


def test_one_memory_needs_no_weights():
    """A bank of one is always believed and never refuted."""
    trust = memories.begin(1)
    assert memories.step(trust, (1e9,), (1.0,), 1.0) == trust
    assert memories.shares(trust) == (1.0,)
    assert memories.refuted(trust) is None
