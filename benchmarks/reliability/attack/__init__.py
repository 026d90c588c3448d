"""Attacks from outside on what docs/reliability.md promises: each round draws new ones, for every family.

A round runs every family once, several at a time (`TOGETHER`), those that measure times alone; what a family does in
a round is drawn from the seed, the round and the family's name, so that `--seed S --only FAMILY` does it again.
"""

from __future__ import annotations

import math
import random
import sys
import traceback
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.reliability.outcome import Outcome

TRIALS = 50
# family -> its module has PROMISE, ATTACK and attack(folder, rng), which yields an Outcome with the attack as group
FAMILIES = {
    "talk": "talk",
    "overwrite": "overwriting",
    "links": "links",
    "listen-only": "listening",
    "impossible": "impossible_frames",
    "folder": "hostile_folder",
    "damage": "damaged_logs",
    "tables": "damaged_tables",
    "numbers": "impossible_numbers",
    "lost": "lost_files",
    "mounts": "mounts",
    "names": "hostile_names",
    "meanings": "meanings",
    "configuration": "hostile_configuration",
    "formulas": "formulas",
    "addresses": "addresses",
    "workers": "workers",
    "generations": "generations",
    "memory": "memory",
    "ring": "ring_files",
    "kill": "killed",
    "stop": "stopping",
    "writes": "write_errors",
    "clocks": "clocks",
    "ages": "ring_clocks",
    "page": "page",
}
# families that measure how long something takes, and need the machine for themselves
ALONE = ("kill", "stop")
# families at a time
TOGETHER = 3


def trial(k: int, seed: int = 0, only: Sequence[str] = ()) -> Iterator[Outcome]:
    """Round `k`: every family, or some, with what it draws."""
    names = [name for name in FAMILIES if not only or name in only]
    together = [name for name in names if name not in ALONE]
    with ThreadPoolExecutor(TOGETHER) as pool:
        for outcomes in pool.map(lambda name: round_of(name, k, seed), together):
            yield from outcomes
    for name in names:
        if name in ALONE:
            yield from round_of(name, k, seed)


def round_of(name: str, k: int, seed: int) -> list[Outcome]:
    """One family's part of a round."""
    family = import_module(f"{__name__}.{FAMILIES[name]}")
    rng = random.Random(f"attack {seed} {k} {name}")
    with TemporaryDirectory(prefix="attack", ignore_cleanup_errors=True) as folder:
        try:
            return [
                each._replace(group=f"{name}: {each.group}", wrong=_one_line(each.wrong))
                for each in family.attack(Path(folder), rng)
            ]
        except Exception as error:  # an attack that cannot be judged is one that went wrong
            traceback.print_exc(file=sys.stderr)
            return [Outcome(f"{name}: not judged", math.nan, 0, f"{type(error).__name__}: {error}")]


def markdown(outcomes: Iterable[Outcome]) -> str:
    """The table: promise, attack, rounds, result."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.group, []).append(outcome)
    order = list(FAMILIES)
    said: set[str] = set()
    lines = ["| promise | attack | rounds | result |", "|---|---|---|---|"]
    for group in sorted(groups, key=lambda group: order.index(group.partition(":")[0])):
        name, _, attack = group.partition(": ")
        rows = groups[group]
        promise = "" if name in said else import_module(f"{__name__}.{FAMILIES[name]}").PROMISE
        said.add(name)
        lines.append(f"| {promise} | {attack} | {len(rows):,} | {_result(rows)} |")
    return "\n".join(lines)


def _result(rows: list[Outcome]) -> str:
    wrong = [row.wrong for row in rows if row.wrong]
    result = f"{len(rows) - len(wrong):,} of {len(rows):,} kept"
    tried = sum(row.tried for row in rows)
    if tried > len(rows):
        result += f", {tried:,} cases"
    times = [row.lost for row in rows if not math.isnan(row.lost)]
    if times:
        result += f"; {rows[0].measure or 'at most'} {max(times):.2f} s"
    return result + (f"; broken: {wrong[0]}" if wrong else "")


def _one_line(text: str) -> str:
    return " ".join(text.split())[:600].replace("|", "/")
