"""Attacks by time: runs, queries and reports of one fleet's folder at once, in drawn interleavings, killed now and then."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.outcome import Outcome
from tests.fixtures.fleet_interleavings import interleaved

PROMISE = "an answer is that of one whole generation of a fleet's tables, and the last answer is right"


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One interleaving."""
    wrong, actions = interleaved(folder, rng)
    yield Outcome(
        "4 to 7 of run, query, report at once with pauses in their calls, some killed; then a run and a query",
        math.nan,
        0,
        "; ".join(wrong),
        tried=actions,
    )
