"""5,000 damaged logs: none hangs or raises, no frame is invented, at most the bad container or line is lost and told.

More of them, and other seeds: `python -m benchmarks.damaged_logs --mutants 100000 --seed 7`.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from benchmarks.damaged_logs.bases import Base, bases
from benchmarks.damaged_logs.claims import check
from benchmarks.damaged_logs.mutants import mutant

SEED = 1
# how many mutants of each: 5,000 in sum, most of them .blf
COUNTS = {
    "classic": 600, "fd": 600, "mixed": 700, "crossing": 700, "stored": 500, "stored-crossing": 500,
    "asc": 400, "asc-classic": 300, "candump": 350, "csv": 350,
}  # fmt: skip
# one in so many is read frame by frame too
ONE_BY_ONE = 10


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Base]:
    return {base.name: base for base in bases(tmp_path_factory.mktemp("bases"))}


def test_there_are_5000() -> None:
    assert sum(COUNTS.values()) == 5_000


# a guard against hangs, not a promise of speed
@pytest.mark.timeout(120)
@pytest.mark.parametrize("name", COUNTS)
def test_mutants_lose_the_bad_part_only(name: str, whole: dict[str, Base], tmp_path: Path) -> None:
    """Whatever happened to the bytes, all frames of all other parts are there, in order, at their times."""
    base = whole[name]
    rng = random.Random(f"{SEED} {name}")
    path = tmp_path / f"x{base.suffix}"
    kept = lost = 0
    for k in range(COUNTS[name]):
        made = mutant(rng, base)
        try:
            found = check(base, made, path, one_by_one=k % ONE_BY_ONE == 0)
        except AssertionError as error:
            raise AssertionError(f"{name} {k}, {made.what}: {error}") from error
        kept, lost = kept + found.kept, lost + found.lost
    # the damage was no trifle, and yet most was saved
    assert 0 < lost < kept
