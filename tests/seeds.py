"""The seed of a run: drawn anew each time, or taken from CANID_SEED to run the same again.

pytest's processes share it by the environment. A test asks for its own part by the fixture `seed` of conftest.py, which
prints it where the test fails.
"""

from __future__ import annotations

import functools
import os
import secrets
from collections.abc import Callable, Sequence
from typing import Any, TypeVar
from zlib import crc32

import pytest

VARIABLE = "CANID_SEED"
T = TypeVar("T")
SEED = int(os.environ.setdefault(VARIABLE, str(secrets.randbelow(10**6))))


def seed(purpose: str) -> int:
    """Derive a seed from that of the run.

    Args:
        purpose: the test's name, so that no two tests draw the same.

    Example:
        >>> seed("a") == seed("a") != seed("b")
        True
    """
    return crc32(f"{SEED} {purpose}".encode()) % 10**6


def part(cases: Sequence[T], parts: int, purpose: str) -> list[T]:
    """One of so many parts of a test's cases, drawn in each run; all of them with CANID_ALL_STRENGTHS=1.

    Args:
        cases: of one kind, whose failures would mostly come together.
        parts: how many runs of the whole take as long as one of all cases.
        purpose: the test's name.

    Example:
        >>> 1 <= len(part([1, 2, 3], 2, "a")) <= 2 or bool(os.environ.get("CANID_ALL_STRENGTHS"))
        True
    """
    if os.environ.get("CANID_ALL_STRENGTHS"):
        return list(cases)
    return list(cases[seed(f"part {purpose}") % parts :: parts])


def two_of_three(test: Callable[..., None]) -> Callable[..., None]:
    """Decorate a test that holds on nearly every drive, not on each: two of three drawn drives have to pass.

    The second and third drive are made only where the first one fails. A test that fails on a share q of the drives by
    chance fails once in 1 / (2 q²) runs (q = 0.02: 1,250), and one that fails on most drives fails nearly always. Not
    for what has to hold on every drive.

    Args:
        test: takes `seed` by name, and raises AssertionError (or calls pytest.fail) where it fails.

    Example:
        >>> drawn = []
        >>> def test(seed):
        ...     drawn.append(seed)
        ...     assert len(drawn) > 1
        >>> two_of_three(test)(seed=5)
        seed 5 failed:
        seed 1000008, drawn as the first one failed
        seed 2000011, drawn as the first one failed
        >>> len(drawn), len(set(drawn))
        (3, 3)
    """

    @functools.wraps(test)
    def drawn_again(*args: Any, seed: int, **kwargs: Any) -> None:
        try:
            test(*args, seed=seed, **kwargs)
        except (AssertionError, pytest.fail.Exception) as first:
            print(f"seed {seed} failed: {first}".rstrip())
            for number in (1, 2):
                another = (seed + 1_000_003 * number) % 10**7
                print(f"seed {another}, drawn as the first one failed")
                test(*args, seed=another, **kwargs)

    return drawn_again
