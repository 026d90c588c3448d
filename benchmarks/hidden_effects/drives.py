"""Which drives the table is made of: each is a function of its own seed, so that a long run can be cut anywhere.

Of 20 drives in a row 8 are clean, 5 hide one cause of the catalogue, 2 one near the edge of what can be seen, 2 hide
two, 1 hides one that is taken out of the catalogue, and 2 one that nobody's catalogue holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple, TypeVar

import numpy as np

from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Kind
from tests.plants import plant_one, plant_two
from tests.plants.plant_one.strengths import STRENGTHS
from tests.plants.plant_two.strengths import USUAL
from tests.plants.planted_drive import NOISES, OUTSIDE, PROFILES, Plant

CLEAN, ONE, FAINT, TWO, REMOVED, FOREIGN = "clean", "one", "faint", "two", "removed", "foreign"
# in an order in which a short run meets all of them
PATTERN = (
    CLEAN, ONE, CLEAN, TWO, ONE, CLEAN, FOREIGN, CLEAN, ONE, FAINT,
    CLEAN, ONE, CLEAN, TWO, REMOVED, CLEAN, FOREIGN, CLEAN, ONE, FAINT,
)  # fmt: skip
# most drives to work take 10 to 30 min; half of these are short, for what is hard is hard there
MINUTES = (10.0, 10.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0)

SIMULATORS: dict[str, Plant] = {"one": plant_one.plant, "two": plant_two.plant}
# causes of the driver that a drive of 10 to 60 min must show
IDS = tuple(e.id for e in CATALOGUE if e.where == "driver" and e.kind is not Kind.MASK and e.found_at)
PAIRS = tuple(combinations(IDS, 2))
# what is in nobody's catalogue, by the simulator that knows it
FOREIGNERS = {
    "one": tuple(name for name in OUTSIDE if name in STRENGTHS),
    "two": tuple(name for name in OUTSIDE if name in USUAL),
}

T = TypeVar("T")


class Drive(NamedTuple):
    """One drive of the table."""

    seed: int
    kind: str
    simulator: str
    noise: str
    profile: str
    minutes: float
    effects: tuple[str, ...]  # that it hides


def drive(seed: int) -> Drive:
    """Lay out the drive of a seed.

    Within its kind every effect comes as often as any other, in an order drawn anew each time that all have come; so do
    noises, profiles, lengths and simulators.

    Args:
        seed: not negative.

    Example:
        >>> one = drive(90_001)
        >>> one.kind, len(one.effects), one == drive(90_001)
        ('one', 1, True)
    """
    lap, place = divmod(seed, len(PATTERN))
    kind = PATTERN[place]
    # how many of its kind came before it
    number = lap * PATTERN.count(kind) + PATTERN[:place].count(kind)
    simulator = ("one", "two")[number % 2]
    turn = number // 2  # of its simulator
    effects: tuple[str, ...] = ()
    if kind == TWO:
        effects = _turn(PAIRS, number, kind)
    elif kind == FOREIGN:
        effects = (_turn(FOREIGNERS[simulator], turn, kind + simulator),)
    elif kind != CLEAN:
        effects = (_turn(IDS, turn, kind + simulator),)
    return Drive(
        seed=seed,
        kind=kind,
        simulator=simulator,
        noise=_turn(NOISES, turn, kind + simulator + "noise"),
        profile=_turn(PROFILES, turn, kind + simulator + "profile"),
        minutes=_turn(MINUTES, turn, kind + simulator + "minutes"),
        effects=effects,
    )


def drives(logs: int, first_seed: int) -> list[Drive]:
    """Lay out `logs` drives; a shorter run is the beginning of a longer one."""
    return [drive(first_seed + k) for k in range(logs)]


def another_pair(seed: int, attempt: int) -> tuple[str, ...]:
    """Draw other effects for a drive whose pair was too weak."""
    return PAIRS[int(np.random.default_rng([seed, attempt]).integers(len(PAIRS)))]


def _turn(of: Sequence[T], number: int, purpose: str) -> T:
    """The number-th of a sequence that is shuffled anew each time it has come round."""
    lap, place = divmod(number, len(of))
    order = np.random.default_rng([lap, *purpose.encode()]).permutation(len(of))
    return of[int(order[place])]
