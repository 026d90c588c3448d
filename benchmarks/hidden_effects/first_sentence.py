"""Does the first sentence of a diagnosis alone hold what was planted, by its numbers?

    python -m benchmarks.hidden_effects.first_sentence [--drives 40] [--first-seed 5000] [--workers 1]

A reader sees the first sentence and nothing else: right where it finds the planted cause and one of its intervals holds
the strength; left open where it has the cause among those that explain the drive as well, or that the drive would have
hidden; misled where it finds others alone, or another strength; and nothing is said where it names none of these.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from typing import NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

import canid
from benchmarks.hidden_effects.drawn_drives import print_table
from canid.ui.views.diagnosis_report.diagnosis_answer import answer
from canid.values.text.names import readable
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

# effect -> parameter, and strengths between which it is drawn: those that a driver of the literature has
PLANTED = {
    "relative_speed_dead_zone": ("width", 0.6, 1.3),
    "looming_gain": ("exponent", 0.5, 1.1),
    "asymmetric_gain": ("share", 0.25, 0.5),
    "lead_acceleration": ("gain", 3.0, 8.0),
    "speed_gain": ("exponent", 0.5, 1.0),
    "headway_dead_zone": ("width", 0.3, 0.6),
}
_INTERVAL = re.compile(r"(-?\d[\d.e-]*) ?(?:[^\s\[]+ )?\[(-?\d[\d.e-]*), (-?\d[\d.e-]*)\]")


class Read(NamedTuple):
    """What a reader of the first sentence learns of one drive."""

    seed: int
    effect: str
    planted: float
    verdict: str
    sentence: str
    found: tuple[str, ...]  # effects of the findings

    @property
    def outcome(self) -> str:
        """Right, misled, left open, or nothing said."""
        if self.effect in self.found:
            return "right" if holds(self.sentence, self.planted) else "misled"
        if readable(self.effect) in self.sentence:
            return "open"
        return "misled" if self.verdict in ("named", "one_of") else "nothing"


def holds(sentence: str, planted: float) -> bool:
    """Whether one of the intervals in a sentence holds a number.

    Example:
        >>> holds("The driver does not respond to relative speeds below 1.0 [0.8, 1.3] m/s.", 0.9)
        True
    """
    found = [tuple(map(float, numbers)) for numbers in _INTERVAL.findall(sentence)]
    return any(low <= planted <= high for _, low, high in found)


def run(seed: int) -> Read:
    """Draw a drive, hide one cause in it, and read the first sentence."""
    rng = np.random.default_rng(seed)
    effect = tuple(PLANTED)[seed % len(PLANTED)]
    name, weakest, strongest = PLANTED[effect]
    planted = float(rng.uniform(weakest, strongest))
    plant = (plant_one, plant_two)[seed // len(PLANTED) % 2]
    noise = str(rng.choice(("white", "ar1", "mix")))
    made = plant.plant({effect: {name: planted}}, seed=seed, minutes=10.0, noise=noise, profile="mixed")
    report = canid.diagnose(trace(made))
    found = tuple(finding.effect for finding in report.findings)
    read = Read(seed, effect, planted, report.verdict.value, answer(report)[0], found)
    print(f"{read.seed} {read.outcome}: {effect} {planted:.3g}: {read.sentence}", file=sys.stderr, flush=True)
    return read


def table(found: Sequence[Read]) -> list[str]:
    """A row for each effect."""
    lines = ["| planted | drives | right | misled | left open | nothing said |", "|---|---|---|---|---|---|"]
    for effect in (*PLANTED, ""):
        of = [one.outcome for one in found if not effect or one.effect == effect]
        counts = " | ".join(str(of.count(what)) for what in ("right", "misled", "open", "nothing"))
        lines.append(f"| {effect or 'all'} | {len(of)} | {counts} |")
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    return print_table("benchmarks.hidden_effects.first_sentence", __doc__, 40, 5000, run, table, argv)


if __name__ == "__main__":
    sys.exit(main())
