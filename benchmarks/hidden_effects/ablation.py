"""What each adequacy test is worth: which drives would be answered otherwise if it were left out.

The bound on p is shared by all tests: leaving one out would raise it by some 4 %, which is not counted here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from benchmarks.hidden_effects import table
from benchmarks.hidden_effects.drives import CLEAN
from benchmarks.hidden_effects.outcomes import CANID, Outcome
from benchmarks.hidden_effects.peers.answer import ADEQUATE, NAMED, UNEXPLAINED, Answer

# tests by the module of canid/models/diagnosis/adequacy that makes them; the others are families of `alternatives`
MODULES = {
    "intermittent_gain": ("unsteady",),
    "skewness": ("one side",),
    "unnamed_patterns": ("standing still", "line", "rhythm", "wander"),
}


class Changed(NamedTuple):
    """What leaving out some tests would change."""

    fails: int  # drives on which one of them fails
    alone: int  # drives on which no other test fails
    better: int  # answers that would become right: a clean drive adequate, a planted effect named
    worse: int  # answers that would become wrong: a wrong name, or an effect overlooked
    seeds: tuple[int, ...]  # of the drives whose answer would change


def without(o: Outcome, tests: frozenset[str]) -> Answer:
    """Return the answer that would have been given without some tests."""
    answer = o.answers[CANID]
    if answer.says != UNEXPLAINED or not o.failed or not set(o.failed) <= tests:
        return answer
    if not o.suspected:
        return answer._replace(says=ADEQUATE, sets=())
    # causes that make the simulation of held-out data worse stay unexplained
    return answer if o.gain.value < 0 else answer._replace(says=NAMED, sets=o.suspected)


def right(o: Outcome, a: Answer) -> bool:
    """Is a clean drive adequate, a planted effect named, and one that cannot be named noticed?"""
    if o.drive.kind == CLEAN:
        return a.says == ADEQUATE
    if table.single(o):
        return table.right(o, a)
    return table.exactly(o, a) if len(o.truth) > 1 else a.says == UNEXPLAINED


def changed(outcomes: Sequence[Outcome], tests: frozenset[str]) -> Changed:
    """Leave out some tests."""
    pairs = [(o, o.answers[CANID], without(o, tests)) for o in outcomes]
    moved = [(o, right(o, old), right(o, new)) for o, old, new in pairs if old != new]
    return Changed(
        sum(bool(set(o.failed) & tests) for o in outcomes),
        len(moved),
        sum(new and not old for _, old, new in moved),
        sum(old and not new for _, old, new in moved),
        tuple(o.drive.seed for o, _, _ in moved),
    )


def lines(outcomes: Sequence[Outcome]) -> list[str]:
    """Return a table of one line per test, and of one per module."""
    names = sorted({name for o in outcomes for name in o.tests})
    of_modules = {name for tests in MODULES.values() for name in tests}
    groups = {name: frozenset([name]) for name in names}
    groups |= {f"{module} (module)": frozenset(tests) for module, tests in MODULES.items()}
    groups["alternatives (module)"] = frozenset(names) - of_modules
    heads = "left out", "fails on", "alone", "right instead of wrong", "wrong instead of right", "seeds"
    out = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    for name, tests in groups.items():
        c = changed(outcomes, tests)
        seeds = ", ".join(map(str, c.seeds)) or "–"
        out.append(f"| {name} | {c.fails} | {c.alone} | {c.better} | {c.worse} | {seeds} |")
    return out
