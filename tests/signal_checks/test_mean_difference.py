"""The difference of two means is the weighted integral of the rate, in every check that compares the two."""

from __future__ import annotations

import numpy as np
import pytest

from canid.signals.signal_checks import blocks, delayed_rate, gap_and_range_rate, integrated_acceleration
from canid.signals.signal_checks.blocks import Block
from canid.signals.signal_checks.mean_difference import integrals
from tests.signal_checks.synthetic import DT, Array, samples


def integrated(rate: Array) -> Array:
    """The quantity whose rate this is, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * DT * (rate[1:] + rate[:-1]))])


def made(seed: int) -> list[Block]:
    """Blocks of a drive with white accelerations and range rates, whose integrals are speed and gap."""
    rng = np.random.default_rng(seed)
    accel, range_rate = 0.5 * rng.standard_normal((2, 1600))
    columns = {
        "gap": 50.0 + integrated(range_rate),
        "range_rate": range_rate,
        "speed": 20.0 + integrated(accel),
        "accel": accel,
        "pedal": accel,
        "lead_valid": np.ones(1600),
    }
    state, out = blocks.init(), []
    for sample in samples(columns):
        state, block = blocks.step(state, sample, DT)
        out += [] if block is None else [block]
    return out


@pytest.mark.parametrize("n", [2, 3, 10, 50])
def test_the_difference_of_two_means_is_the_weighted_integral(n: int, seed: int) -> None:
    """For any rate and any number of samples, exactly; with the two weights exchanged it is not."""
    rate = np.random.default_rng(seed).standard_normal(2 * n)
    quantity = integrated(rate)
    first, second = integrals(rate[:n], DT), integrals(rate[n:], DT)
    difference = quantity[n:].mean() - quantity[:n].mean()
    assert first.rise + second.fall == pytest.approx(difference, abs=1e-12)
    assert first.fall + second.rise != pytest.approx(difference, abs=1e-6)


def test_changes_and_integrals_agree_in_every_check(seed: int) -> None:
    """Without noise nothing is left: gap and range rate, speed and acceleration, and the delay between them."""
    of_gap, of_speed = gap_and_range_rate.init(), integrated_acceleration.init()
    late = [delayed_rate.init() for _ in delayed_rate.CHECKS]
    for block in made(seed):
        of_gap, _ = gap_and_range_rate.step(of_gap, block)
        of_speed, _ = integrated_acceleration.step(of_speed, block)
        late = [check.step(state, block)[0] for check, state in zip(delayed_rate.CHECKS, late, strict=True)]
    assert len(of_gap.windows) >= 20
    assert [w.integral for w in of_gap.windows] == pytest.approx([w.change for w in of_gap.windows], abs=1e-9)
    assert len(of_speed.changes) == integrated_acceleration.KEPT
    assert of_speed.integrals == pytest.approx(of_speed.changes, abs=1e-9)
    assert [delayed_rate.delay(state)[0] for state in late] == pytest.approx([0.0, 0.0], abs=1e-9)
