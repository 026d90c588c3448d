"""2,000 damaged logs, others in each run: none hangs or raises, no frame is invented.

At most the bad container or line is lost, and that is reported.

More of them, and other seeds: `python -m benchmarks.damaged_logs --mutants 100000 --seed 7`.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.damaged_logs.bases import Base, bases
from tests.damaged_logs.claims import check
from tests.damaged_logs.mutants import mutant

# how many mutants of each: 2,000 in sum, most of them .blf
COUNTS = {
    "classic": 240, "fd": 240, "mixed": 280, "crossing": 280, "stored": 200, "stored-crossing": 200,
    "asc": 160, "asc-classic": 120, "candump": 140, "csv": 140,
}  # fmt: skip
# one in so many is read frame by frame too
ONE_BY_ONE = 10


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Base]:
    return {base.name: base for base in bases(tmp_path_factory.mktemp("bases"))}


def test_there_are_2000() -> None:
    assert sum(COUNTS.values()) == 2_000


# a guard against hangs, not a promise of speed
@pytest.mark.slow("many logs, written and read")
@pytest.mark.parametrize("name", COUNTS)
def test_mutants_lose_the_bad_part_only(name: str, whole: dict[str, Base], tmp_path: Path, seed: int) -> None:
    """Whatever happened to the bytes, all frames of all other parts are there, in order, at their times."""
    base = whole[name]
    rng = random.Random(seed)
    path = tmp_path / f"x{base.suffix}"
    kept = lost = 0
    for k in range(COUNTS[name]):
        made = mutant(rng, base)
        try:
            found = check(base, made, path, one_by_one=k % ONE_BY_ONE == 0)
        except AssertionError as error:
            raise AssertionError(f"{name} {k}, seed {seed}, {made.what}: {error}") from error
        kept, lost = kept + found.kept, lost + found.lost
    # the damage was no trifle, and yet most was saved
    assert 0 < lost < kept
