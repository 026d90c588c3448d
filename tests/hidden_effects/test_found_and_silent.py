"""Every effect is named at the strengths that its file states, and nothing is named at those too small to matter.

The cases come from the catalogue: a new effect brings its own. Drives are canid's own simulator's; the plants of the
benchmark, which share no formula with the catalogue, are tested in tests/diagnosis.
"""

from __future__ import annotations

import pytest

from canid.simulation import simulate
from tests.hidden_effects.planted_by_canid import Case, block, by_columns, cases, drive, named

# a drive of some minutes may not excite an effect at all: one of so many must show it
DRIVES = 3


@pytest.mark.parametrize("case", cases("found_at"), ids=str)
def test_an_effect_is_named(case: Case) -> None:
    """At each of its strengths, on the first drive or on one of two more."""
    instead = {}
    for k in range(DRIVES):
        one = case._replace(seed=case.seed + k)
        found = named(drive(one), block(case.effect))
        if case.effect.id in found:
            return
        instead[one.seed] = found
    pytest.fail(f"not named; named instead, by seed: {instead}")


@pytest.mark.parametrize("case", cases("silent_at"), ids=str)
def test_a_negligible_effect_is_not_named(case: Case) -> None:
    found = named(drive(case), block(case.effect))
    assert not found, f"seed {case.seed}: {found} named"


@pytest.mark.parametrize(("seed", "profile"), [(41, "mixed"), (42, "urban"), (43, "motorway")])
def test_a_clean_drive_gets_no_name_from_any_block(seed: int, profile: str) -> None:
    trace = by_columns(simulate(6.0, seed, profile))
    for where in ("mask", "sensing", "vehicle", "driver", "remnant"):
        assert not named(trace, where), f"seed {seed}, {where}"
