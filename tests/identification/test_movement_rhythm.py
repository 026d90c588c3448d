"""Who holds the pedal and moves it at intervals is told from who drives at all times; and no delay of his is quoted."""

from __future__ import annotations

import numpy as np
import pytest

from canid import identify
from canid.mathematics.identification.identifiability import quotable
from canid.mathematics.identification.movement_rhythm import waiting
from tests.plants.outside_form import draw, drive
from tests.plants.outside_form_sensors import seen
from tests.seeds import mostly

DT, N, STEP = 0.1, 3000, 0.4


def demand(rng: np.random.Generator, slow: float) -> np.ndarray:
    """A demand in % that moves within `slow` s."""
    x, last = np.empty(N), 0.0
    for k, push in enumerate(rng.normal(size=N).tolist()):
        last += DT / slow * (8.0 * push - last)
        x[k] = last
    return np.round((20.0 + x) / STEP) * STEP


def held(rng: np.random.Generator, shortest: float, longest: float) -> np.ndarray:
    wanted, at, out = demand(rng, 1.0), 0, np.empty(N)
    while at < N:
        until = at + max(round(rng.uniform(shortest, longest) / DT), 1)
        out[at:until] = wanted[at]
        at = until
    return out


@mostly(0.95)
def test_uneven_waits_are_found_with_their_mean(seed: int) -> None:
    """Waits drawn evenly between 0.5 and 1.5 s have no rhythm that a line shows, and are no chance."""
    rng = np.random.default_rng(seed)
    found = waiting(held(rng, 0.5, 1.5), np.full(N, True), DT)
    assert found is not None
    assert not found.regular
    assert found.interval == pytest.approx(1.0, abs=0.12)


@mostly(0.95)
@pytest.mark.parametrize("slow", [0.3, 2.0, 10.0, 60.0])
def test_who_drives_at_all_times_does_not_wait(slow: float, seed: int) -> None:
    """A slow pedal stands still between two steps of its sensor too."""
    assert waiting(demand(np.random.default_rng(seed), slow), np.full(N, True), DT) is None


@mostly(0.95)
def test_movements_by_chance_are_no_waits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = np.cumsum(np.where(rng.random(N) < 0.1, np.round(rng.normal(0, 2, N)), 0.0))
    assert waiting(y, np.full(N, True), DT) is None


def test_two_movements_are_no_rhythm() -> None:
    """A pedal that moved for 2 s twice in a minute moved in step with any rhythm of 4 s: 20 samples, one movement."""
    y = np.concatenate([np.zeros(280), np.linspace(0, 30, 21), np.full(270, 30.0), np.linspace(30, 10, 21)])
    assert waiting(y, np.full(len(y), True), DT) is None


@pytest.mark.slow("identifies drives of three minutes")
def test_the_hold_is_said_and_no_delay_is_quoted() -> None:
    """In a world that shares nothing with canid's simulators; the same worlds without the wait say nothing of it."""
    for seed in range(8100, 8104):
        for noise in ("act_and_wait", "ar"):
            world = draw(seed, 3.0, noise)
            found = identify(seen(world, drive(world)), select_orders=False, sliding=False)
            for of in found.whole.values():
                if of is None:
                    continue
                assert any("act and wait" in line for line in of.lines) == (noise == "act_and_wait"), (
                    seed,
                    noise,
                )
                if noise == "act_and_wait":
                    assert not any(quotable(c, "tau_plus_dead_time") for c in of.channels.values()), seed
