"""Every effect is named at the strengths that its file states, and nothing is named at those too small to matter.

The cases come from the catalogue: a new effect brings its own. Drives are canid's own simulator's; on those of the
plants, which share no formula with the catalogue, every cause is required in every run (test_required_causes.py).
"""

from __future__ import annotations

import pytest

from canid.models.effects import CATALOGUE
from tests.hidden_effects.planted_by_canid import Case, block, cases, drive, named
from tests.hidden_effects.required_causes import REQUIRED

# a drive of some minutes may not excite an effect at all: one of so many must show it
DRIVES = 3


# effects that no plant plants are in every run
NEW = {effect.id for effect in CATALOGUE} - set(REQUIRED)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("case", cases("found_at", 4, NEW), ids=str)
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


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("case", cases("silent_at", 3), ids=str)
def test_a_negligible_effect_is_not_named(case: Case) -> None:
    found = named(drive(case), block(case.effect))
    assert not found, f"seed {case.seed}: {found} named"
