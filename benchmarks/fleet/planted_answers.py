"""What the summary of a planted fleet says in words: changes, drives in a wrong folder, groups, causes by car."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.fleet.planted_score import CHANGED, kinds, swapped
from canid.analysis.fleet.answers.summary import summarise
from canid.values.fleet_summary import FleetSummary, Questions
from tests.fleet.planted.planted_fleet import GROUPS

# q up to which a cause counts as stated: the rate that the fleet keeps
MAX_Q = 0.05


class Answers(NamedTuple):
    """How many answers are right; each question over all cars together."""

    tested: dict[str, int]  # question -> tests
    true: dict[str, int]  # of which something is there
    found: dict[str, int]  # of these, found
    false: dict[str, int]  # found where nothing is there
    causes: list[tuple[str, str, bool, float]]  # car, effect, planted there, q
    missed: list[tuple[str, str]]  # car, effect planted there and not stated


def answers(folder: Path, truth: Mapping[str, Any]) -> Answers:
    """Summarise a folder and hold the answers against the truth.

    Args:
        folder: of `canid fleet -o`.
        truth: of the fleet.
    """
    found = summarise(folder)
    out = Answers({}, {}, {}, {}, *_causes(found, truth))
    kind, wrong = kinds(truth), swapped(truth)
    differ = bool(truth["size"]["groups_differ"])
    for population in found.populations:
        for asked in population.questions:
            if "change" in asked.question:
                _count(out, "a driver changes", asked, [kind.get(t.subject) == CHANGED for t in asked.tests])
            elif "stands with" in asked.question:
                there = [any(test.subject.endswith("/" + path) for path in wrong) for test in asked.tests]
                _count(out, "a drive in another driver's folder", asked, there)
            elif "groups" in asked.question:
                names = [all(name in test.subject for name in GROUPS) for test in asked.tests]
                _count(out, "groups differ", asked, [differ and both for both in names])
    return out


def _count(out: Answers, name: str, asked: Questions, there: Sequence[bool]) -> None:
    for counts, number in (
        (out.tested, asked.asked),
        (out.true, sum(there)),
        (out.found, sum(test.found and so for test, so in zip(asked.tests, there, strict=True))),
        (out.false, sum(test.found and not so for test, so in zip(asked.tests, there, strict=True))),
    ):
        counts[name] = counts.get(name, 0) + number


def _causes(
    found: FleetSummary, truth: Mapping[str, Any]
) -> tuple[list[tuple[str, str, bool, float]], list[tuple[str, str]]]:
    planted = {(car, effect) for car, effects in truth["car_causes"].items() for effect in effects}
    for drive in truth["drives"].values():
        planted |= {(drive["car"], effect) for effect in truth["drivers"][drive["driver"]]["habit"]}
    stated = [(one.car, one.effect, (one.car, one.effect) in planted, one.q) for one in found.causes]
    named = {(car, effect) for car, effect, _, q in stated if q <= MAX_Q}
    return stated, sorted(planted - named)


def table(of: Sequence[Answers]) -> list[str]:
    """Lines of the table."""
    out = ["| question, over all cars | tests | there | found | false |", "|---|---|---|---|---|"]
    for name in dict.fromkeys(name for one in of for name in one.tested):
        numbers = [
            sum(counts.get(name, 0) for counts in each)
            for each in zip(*((one.tested, one.true, one.found, one.false) for one in of), strict=True)
        ]
        out.append(f"| {name} | {' | '.join(map(str, numbers))} |")
    stated = [cause for one in of for cause in one.causes if cause[3] <= MAX_Q]
    right = sum(planted for _, _, planted, _ in stated)
    missed = [cause for one in of for cause in one.missed]
    out.append(
        f"| a cause in a car or of its drivers, q ≤ {MAX_Q:g} | {sum(len(one.causes) for one in of)} | "
        f"{right + len(missed)} | {right} | {len(stated) - right} |"
    )
    false = [f"{effect} in {car} (q {q:.2g})" for car, effect, planted, q in stated if not planted]
    out += ["", f"False causes: {', '.join(false) or 'none'}."]
    out += [f"Missed causes: {', '.join(f'{effect} in {car}' for car, effect in missed) or 'none'}."]
    return out
