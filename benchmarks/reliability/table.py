"""Outcomes of many trials as a table, and as lines of a file from which a run goes on."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path

from benchmarks.reliability.outcome import Outcome


def markdown(outcomes: Iterable[Outcome]) -> str:
    """One row per group.

    >>> print(markdown([Outcome("a", 0.1, 3), Outcome("a", 0.2, 5, "bad")]).splitlines()[-1])
    | a | 2 | 0.150 s | 0.200 s | 8 | 1: bad |
    """
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.group, []).append(outcome)
    lines = ["| | trials | lost, median | most | frames lost | wrong |", "|---|---|---|---|---|---|"]
    for name, rows in groups.items():
        lost = sorted(row.lost for row in rows if not math.isnan(row.lost))
        middle = (lost[(len(lost) - 1) // 2] + lost[len(lost) // 2]) / 2 if lost else math.nan
        wrong = [row.wrong for row in rows if row.wrong]
        reported = f"{len(wrong)}: {wrong[0]}" if wrong else "0"
        times = f"{middle:.3f} s | {lost[-1]:.3f} s" if lost else "– | –"
        lines.append(f"| {name} | {len(rows)} | {times} | {sum(row.frames for row in rows):,} | {reported} |")
    return "\n".join(lines)


def stored(path: Path) -> dict[int, list[Outcome]]:
    """Trials that a file holds already."""
    done: dict[int, list[Outcome]] = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        trial, outcomes = json.loads(line)
        done[trial] = [Outcome(*each) for each in outcomes]
    return done


def line(trial: int, outcomes: list[Outcome]) -> str:
    """One trial as a line of the file."""
    return json.dumps([trial, outcomes])
