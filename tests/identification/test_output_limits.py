"""A limit of an output is found where there is one, and nowhere else: not where a person holds the pedal still."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.mathematics.identification import output_limits
from canid.mathematics.identification.first_order import scan
from canid.values.types import Array

N = 6000  # 10 min at 10 Hz
NOWHERE = (-math.inf, math.inf)
STEPS = (0.0, 0.1, 0.4)


def demand(seed: int) -> Array:
    """(N,) %, of mean 30 and standard deviation 8, slow and quick."""
    rng = np.random.default_rng([seed, 41])
    slow, quick = (
        scan(math.sqrt(1.0 - a * a) * rng.normal(size=N), np.array([a]))
        for a in (math.exp(-0.03), math.exp(-0.3))
    )
    out: Array = 30.0 + 7.7 * slow + 2.0 * quick
    return out


def rounded(y: Array, step: float) -> Array:
    return np.round(y / step) * step if step else y


def held(y: Array, samples: int) -> Array:
    return np.repeat(y[::samples], samples)[: len(y)]


KINDS = {
    "moving": lambda y: y,
    "held for 2 s": lambda y: held(y, 20),
    "of a slow sender": lambda y: held(y, 5),
}


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("kind", KINDS)
def test_an_output_that_has_no_limit_shows_none(kind: str, step: float, seed: int) -> None:
    y = rounded(KINDS[kind](demand(seed)), step)
    assert output_limits.find(y.tolist())[:2] == NOWHERE


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_limit_on_either_side_is_found(kind: str, step: float, seed: int) -> None:
    y = rounded(KINDS[kind](demand(seed)), step)
    low, high = rounded(np.quantile(y, [0.25, 0.75]), step)
    for limits in ((low, math.inf), (-math.inf, high), (low, high)):
        found = output_limits.find(np.clip(y, *limits).tolist())
        assert (found.lower, found.upper) == pytest.approx(limits, abs=1e-9)


def test_turns_next_to_a_limit_do_not_hide_it() -> None:
    """Three of four movements turn one to three sensor steps before the limit, at which the fourth stays for 0.4 s."""
    way = [0.0, 1.0, 2.0, 3.0]
    turned = [[*way, height, height, *way[::-1]] for height in (3.7, 3.8, 3.9)]
    moves = [*turned, [*way, 4.0, 4.0, 4.0, 4.0, *way[::-1]]]
    y = np.concatenate([sign * np.array(move) for _ in range(60) for move in moves for sign in (1.0, -1.0)])
    assert output_limits.find(y.tolist())[:2] == (-4.0, 4.0)
    # and no one stays there
    turns = np.concatenate(
        [sign * np.array([*way, 4.0, *way[::-1]]) for _ in range(60) for sign in (1.0, -1.0)]
    )
    assert output_limits.find(turns.tolist())[:2] == NOWHERE


def test_a_quick_swing_of_one_height_is_no_limit() -> None:
    """At 0.7 Hz each sample next to the top belongs to a swing without one at the top."""
    for phase in np.linspace(0.0, 0.1, 5):
        y = rounded(1.42 * np.sin(2 * math.pi * 0.698 * 0.1 * np.arange(N) + phase), 0.02)
        assert output_limits.find(y.tolist())[:2] == NOWHERE


def test_a_person_who_holds_the_pedal_still_at_its_largest_value_is_no_limit() -> None:
    rng = np.random.default_rng(7)
    levels = np.concatenate([rng.uniform(10.0, 30.0, 60), [34.0]])
    # the largest value is held for longest, and its sensor flickers
    y = np.concatenate([np.full(rng.integers(20, 80), level) for level in levels] + [np.full(600, 34.0)])
    y[-600::7] = 33.6
    assert output_limits.find(y.tolist())[:2] == NOWHERE


def test_a_motion_that_turns_at_one_height_every_time_is_no_limit() -> None:
    for step in (0.1, 0.4, 1.0):
        y = rounded(30.0 + 8.0 * np.sin(0.03 * np.arange(N)), step)
        assert output_limits.find(y.tolist())[:2] == NOWHERE


def test_a_value_that_is_passed_later_was_no_limit() -> None:
    y = np.minimum(demand(3), 35.0).tolist()
    assert output_limits.find(y).upper == 35.0
    assert output_limits.find([*y, 50.0]).upper == math.inf


def test_the_sides_are_alike() -> None:
    y = np.clip(demand(4), 25.0, 36.0)
    found, mirrored = output_limits.find(y.tolist()), output_limits.find((-y).tolist())
    assert (mirrored.lower, mirrored.upper, mirrored.margin) == (-found.upper, -found.lower, found.margin)
    assert [found.side(x) for x in (25.0, 30.0, 36.0)] == [-1, 0, 1]


def test_the_next_sample_is_at_a_limit_only_after_one_within_its_margin() -> None:
    # without what is quick: that is not within reach of anything
    y = np.minimum(scan(0.2 * demand(5), np.array([0.8])), 36.0)
    found = output_limits.find(y.tolist())
    at = np.flatnonzero(np.array([found.side(x) for x in y.tolist()]) == 1)
    before = y[at[at > 0] - 1]
    assert np.mean(before >= found.upper - found.margin) > 0.99
    assert found.margin < 0.5 * y.std()
