"""The seed of a run: fixed in `make test`, drawn in `make test-all`, and any number again by CANID_SEED.

A run with drawn seeds fails where canid is wrong, and by chance at most once in a thousand runs: a claim that holds on
most drives, not on each, says on how many (`mostly`), and tests/test_chances.py adds up what is left to chance.
pytest's processes share the seed by the environment. A test asks for its own part by the fixture `seed` of conftest.py,
which prints it where the test fails.
"""

from __future__ import annotations

import functools
import os
import secrets
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar
from zlib import crc32

import pytest
from scipy.stats import binom

VARIABLE = "CANID_SEED"
FIXED = "20261125"
T = TypeVar("T")
DRAWN = os.environ.get(VARIABLE) == "drawn" or "CANID_DRAWN" in os.environ
if os.environ.get(VARIABLE) == "drawn":
    os.environ |= {VARIABLE: str(secrets.randbelow(10**6)), "CANID_DRAWN": "1"}
SEED = int(os.environ.setdefault(VARIABLE, FIXED))
# all cases of the slow tests, of which a run with drawn seeds takes a part
ALL_CASES = bool(os.environ.get("CANID_ALL_CASES"))
# so many drives of each claim instead of one, and the count is printed: `CANID_DRAWS=40 pytest -rP TEST` measures a share
DRAWS = int(os.environ.get("CANID_DRAWS", "0"))
# of a single test that holds as often as it says; a suite has some two hundred of them
CHANCE = 4e-6


def seed(purpose: str) -> int:
    """Derive a seed from that of the run.

    Args:
        purpose: the test's name, so that no two tests draw the same.

    Example:
        >>> seed("a") == seed("a") != seed("b")
        True
    """
    return crc32(f"{SEED} {purpose}".encode()) % 10**6


def in_turn(cases: Sequence[Any], parts: int, purpose: str, marks: Sequence[Any] = ()) -> list[Any]:
    """All cases as parameters of a test, of which a run takes one of so many parts; a case that is named is run.

    Args:
        cases: values, or tuples of values, of `pytest.mark.parametrize`.
        parts: how many runs of the whole take as long as one of all cases.
        purpose: the test's name.
        marks: of every case.

    Example:
        >>> [len(each.marks) for each in in_turn([1, 2, 3, 4], 2, "a")].count(0) in (2, 4)
        True
    """
    taken = range(len(cases))[seed(f"part {purpose}") % parts :: parts]
    if ALL_CASES:
        taken = range(len(cases))
    return [
        pytest.param(
            *(case if isinstance(case, tuple) else (case,)),
            marks=[*marks, *(() if k in taken else (pytest.mark.another_run,))],
        )
        for k, case in enumerate(cases)
    ]


class Claim(NamedTuple):
    """How a claim about a share of drives is tested where its first drive speaks against it."""

    share: float
    more: int  # drives after one that failed
    needed: int  # of them, so that the claim stands
    chance: float  # of a failure where the share is true


def claim(share: float) -> Claim:
    """The fewest drives after a first failure with which a true claim fails with a chance of `CHANCE` at most.

    The claim falls where fewer than half of them pass: one that holds on as many drives as it says fails
    (1 - share) P(X < needed) of the runs, X binomial.

    Args:
        share: of drives on which a test passes, above a half.

    Example:
        >>> claim(0.98).more, claim(0.98).needed, claim(0.98).chance < CHANCE
        (4, 2, True)
        >>> claim(0.8).chance < CHANCE < (1 - 0.8) * 0.2**5
        True
    """
    for more in range(2, 200, 2):
        needed = more // 2
        chance = (1.0 - share) * float(binom.cdf(needed - 1, more, share))
        if chance <= CHANCE:
            return Claim(share, more, needed, chance)
    raise ValueError(f"share {share} is not above a half")


def by_chance(chance: float) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorate a test that counts drives itself, with the chance that it fails though what it claims is true.

    Args:
        chance: from the counts in the test, derived where they stand.

    Example:
        >>> by_chance(1e-6)(lambda seed: None).chance
        1e-06
    """

    def decorated(test: Callable[..., None]) -> Callable[..., None]:
        test.chance = chance  # type: ignore[attr-defined]
        return test

    return decorated


def _failed(error: BaseException) -> bool:
    """Whether a claim failed; a test that pytest-timeout ended is an error of its own."""
    return "pytest-timeout" not in str(error)


def mostly(share: float) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorate a test that holds on most drives, not on each: where the first one fails, more are drawn.

    A test whose share is true fails with the chance that `claim` gives; one that fails on every drive fails always. Not
    for what has to hold on every drive.

    Args:
        share: of drives on which the test passes; a lower bound, from at least twenty drives or from theory.

    The test takes `seed` by name, and raises AssertionError (or calls pytest.fail) where it fails.

    Example:
        >>> drawn = []
        >>> @mostly(0.98)
        ... def test(seed):
        ...     drawn.append(seed)
        ...     assert len(drawn) > 2
        >>> test(seed=5)
        seed 5 failed:
        seed 1000008 failed as well:
        >>> len(drawn), len(set(drawn))
        (4, 4)
    """
    says = claim(share)

    def decorated(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def measured(*args: Any, seed: int, **kwargs: Any) -> None:
            passed = 0
            for number in range(DRAWS):
                try:
                    test(*args, seed=(seed + 1_000_003 * number) % 10**7, **kwargs)
                    passed += 1
                except (AssertionError, pytest.fail.Exception) as error:
                    if not _failed(error):
                        raise
                    print(str(error).partition("\n")[0])
            print(f"passed on {passed} of {DRAWS} drives, stated {share:.0%}")
            assert binom.cdf(passed, DRAWS, share) > 1e-3

        @functools.wraps(test)
        def drawn_again(*args: Any, seed: int, **kwargs: Any) -> None:
            try:
                test(*args, seed=seed, **kwargs)
                return
            except (AssertionError, pytest.fail.Exception) as first:
                if not _failed(first):
                    raise
                print(f"seed {seed} failed: {first}".rstrip())
            passed = 0
            for number in range(1, says.more + 1):
                another = (seed + 1_000_003 * number) % 10**7
                try:
                    test(*args, seed=another, **kwargs)
                    passed += 1
                except (AssertionError, pytest.fail.Exception) as error:
                    if not _failed(error) or passed + says.more - number < says.needed:
                        raise
                    print(f"seed {another} failed as well: {error}".rstrip())
                if passed >= says.needed:
                    return

        run = measured if DRAWS else drawn_again
        run.chance = says.chance  # type: ignore[attr-defined]
        return run

    return decorated
