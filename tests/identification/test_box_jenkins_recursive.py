"""Recursive Box-Jenkins model: what a batch fit of all rows finds, a driver who changes, and a step of any size."""

import numpy as np
import pytest

from canid.mathematics.identification.armax import box_jenkins_posterior, box_jenkins_state
from canid.mathematics.identification.armax import box_jenkins_recursive as recursion
from canid.mathematics.identification.first_order import scan
from canid.mathematics.identification.fopdt import fopdt_fit
from tests.seeds import mostly

DT, SETTLE, BLOCK, START = 0.1, 4.5, 20, 300
FORGETTING = (0.98, 0.99, 0.995, 0.998, 1.0)
LAYOUT = fopdt_fit.row_layout(2, DT, 3.0, 1.5)


def drive(seed, n=3000, change=1.0, decay=0.9, still_from=10**9):
    """Samples of a driver with lags of 0.7 and 0.4 s and noise of its own pole; gains times `change` from half on.

    The inputs move as vehicles do: what is faster than 1.3 Hz the estimators take for noise (input_noise.py).
    """
    rng = np.random.default_rng(seed)
    u = np.column_stack(
        [scan(0.02 * rng.normal(size=n), np.array([0.985])), scan(0.2 * rng.normal(size=n), np.array([0.95]))]
    )
    for _ in range(2):
        u = scan(0.2 * u.T, np.array([0.8])).T
    u[still_from:] *= 1e-3
    factor = np.where(np.arange(n) < n // 2, 1.0, change)
    answers = [
        K * np.roll(scan((1.0 - a) * x, np.array([a])), late)
        for K, a, late, x in zip((4.4, 5.6), np.exp(-DT / np.array([0.7, 0.4])), (3, 2), u.T, strict=True)
    ]
    noise = scan(0.4 * rng.normal(size=n), np.array([decay]))
    y = 30.0 + factor * (answers[0] + answers[1]) + noise
    return np.column_stack([y, np.ones(n), np.zeros(n), u])


def run(samples, forgetting=FORGETTING):
    """State after all samples, begun with the first half minute."""
    state = recursion.begin(LAYOUT, samples[:START], forgetting, None, SETTLE)
    assert state is not None
    for k in range(START, len(samples), BLOCK):
        state = recursion.step(LAYOUT, state, samples[k : k + BLOCK], forgetting, None, SETTLE)
    return state


@pytest.mark.slow("fits many drives")
@pytest.mark.parametrize("decay", [0.0, 0.9, 0.97])
@mostly(0.8)
def test_it_finds_what_a_batch_fit_of_all_rows_finds(decay, seed):
    """Gains and sums of lag and dead time differ from the batch posterior's by less than half of its half-width."""
    samples = drive(seed, decay=decay)
    found = box_jenkins_posterior.channels(LAYOUT, run(samples))
    batch = fopdt_fit.fit_process(samples[:, 0], samples[:, 3:], np.full(len(samples), True), DT).channels
    for own, other in zip(found, batch, strict=True):
        for name in ("K", "tau_plus_dead_time"):
            a, b = getattr(own, name), getattr(other, name)
            half = 0.5 * (b.high - b.low)
            assert abs(a.value - b.value) < 0.5 * half
            assert 0.5 < (a.high - a.low) / (b.high - b.low) < 2.0


@pytest.mark.slow("fits many drives")
def test_the_noise_model_follows_the_whole_drive():
    """D begins with half a minute, and ends near the noise's own pole."""
    state = run(drive(2, n=9000, decay=0.9))
    assert abs(state.ar[0] - 0.9) < 0.05
    assert np.abs(state.ar[1:]).max() < 0.08


@pytest.mark.slow("fits many drives")
def test_another_driver_is_followed():
    """Half the gain more at 150 s: the longest memory is refuted, and K of range rate is the new one's a minute later."""
    inside, restarts = 0, 0
    for seed in range(4):
        state = run(drive(seed, n=4000, change=1.5))
        K = box_jenkins_posterior.channels(LAYOUT, state)[1].K
        assert abs(K.value / (1.5 * 5.6) - 1.0) < 0.1
        inside += K.low < 1.5 * 5.6 < K.high
        restarts += state.restarts
    assert inside >= 3
    assert restarts >= 3


@pytest.mark.slow("fits many drives")
def test_a_driver_who_does_not_change_is_not_refuted():
    """Over 7 min of five drives no memory begins anew."""
    assert sum(run(drive(seed, n=4000)).restarts for seed in range(10, 15)) == 0


@pytest.mark.slow("fits many drives")
@mostly(0.9)
def test_nothing_is_forgotten_while_nothing_moves(seed):
    """Ten minutes of still inputs take nothing from the longest memory and next to nothing from the shortest."""
    samples = drive(seed, n=8000, still_from=2000)
    before, after = run(samples[:2000]), run(samples)
    K = [
        box_jenkins_posterior._channels_of(LAYOUT, one, len(FORGETTING) - 1, 1.0)[1].K
        for one in (before, after)
    ]
    # ten minutes more show the offset, which the gains of the first three depend on
    assert abs(K[1].value - K[0].value) < 0.25 * (K[0].high - K[0].low)
    assert 0.8 < (K[1].high - K[1].low) / (K[0].high - K[0].low) < 1.2
    held = [box_jenkins_state.solved(LAYOUT, one)[4][0, 1] for one in (before, after)]
    assert held[1] > 0.5 * held[0]
    assert np.linalg.eigvalsh(after.products).min() > -1e-9 * np.abs(after.products).max()


def test_too_few_samples_are_no_start():
    assert recursion.begin(LAYOUT, drive(4)[:60], FORGETTING, None, SETTLE) is None
