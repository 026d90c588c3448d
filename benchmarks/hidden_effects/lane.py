"""Hide causes in simulated lane drives and ask `diagnose`: how often is it right, silent, wrong?

    python -m benchmarks.hidden_effects.lane [--clean 24] [--each 10] [--first-seed 700000] [--workers 1] [--wrong]

Two planting simulators take turns; half of the roads have curves.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

# one thread: the matrices are small, and times would be those of threads that wait for each other
os.environ["OMP_NUM_THREADS"] = "1"


import canid
from benchmarks.hidden_effects.shares import seconds, share
from tests.plants.lane_drives import CLEAN, EFFECTS, SIMULATORS, LaneDrive, make

# first seeds of the drives by what is hidden in them, so that no two share a driver
SPACING = 1000
TITLES = ("", "both", "canid's own simulator", "simulator two")


class Outcome(NamedTuple):
    """What was said of one drive."""

    drive: LaneDrive
    verdict: str
    named: tuple[str, ...]  # findings that stand, with their rivals
    inside: tuple[bool, ...]  # does each interval of the planted effect hold its truth?
    gain_inside: bool  # does the interval of the gain K?
    score: float  # nats/min, low end of the log score gain of the planted effect; NaN: not named
    seconds: float  # CPU
    says: str

    @property
    def right(self) -> bool:
        """Is the planted effect named?"""
        return self.drive.effect in self.named

    @property
    def wrong(self) -> bool:
        """Is something named that was not planted?"""
        return bool(self.named) and not self.right


def drives(clean: int, each: int, first: int) -> list[LaneDrive]:
    """The drives of a run, the simulators taking turns."""
    out = []
    for k, effect in enumerate((CLEAN, *EFFECTS)):
        seeds = range(first + k * SPACING, first + k * SPACING + (each if effect else clean))
        out += [LaneDrive(SIMULATORS[seed % 2], effect, seed) for seed in seeds]
    return out


def run(drive: LaneDrive) -> Outcome:
    """Make one drive and diagnose it."""
    made = make(drive)
    began = time.process_time()
    report = canid.diagnose(made.trace)
    took = time.process_time() - began
    standing = [finding for finding in report.findings if not finding.surrogate]
    named = tuple(name for finding in standing for name in (finding.effect, *finding.rivals))
    mine = next((finding for finding in standing if finding.effect == drive.effect), None)
    inside = [
        mine.parameters[name].low <= value <= mine.parameters[name].high
        for name, value in made.parameters.items()
        if mine is not None
    ]
    channel = report.extended.channels.get("lateral_offset")
    held = channel is not None and channel.K.low <= made.gain <= channel.K.high
    score = mine.log_score_gain.low if mine is not None else float("nan")
    return Outcome(drive, report.verdict.value, named, tuple(inside), held, score, took, report.says)


def table(outcomes: Sequence[Outcome]) -> list[str]:
    """The table, in Markdown: rows are figures, columns both simulators together and each alone."""
    lines = ["| figure | " + " | ".join(TITLES[1:]) + " |", "|---|---|---|---|"]

    def row(title: str, of: Sequence[Outcome], what: str) -> None:
        cells = []
        for simulators in (SIMULATORS, SIMULATORS[:1], SIMULATORS[1:]):
            here = [one for one in of if one.drive.simulator in simulators]
            cells.append(cell(here, what))
        lines.append(f"| {title} | {' | '.join(cells)} |")

    clean = [one for one in outcomes if not one.drive.effect]
    planted = [one for one in outcomes if one.drive.effect]
    row("false names on clean drives", clean, "named")
    row("“unexplained” on clean drives", clean, "unexplained")
    row("K in its interval, clean drives", clean, "gain")
    for effect in EFFECTS:
        mine = [one for one in planted if one.drive.effect == effect]
        row(f"`{effect}`: named, or among the rivals", mine, "right")
        row("· detected (named or “unexplained”)", mine, "detected")
        row("· another name instead", mine, "wrong")
        row("· its parameters in their intervals, where named", mine, "parameters")
    row("CPU time of 10 min: median / 95 % / worst", outcomes, "seconds")
    return lines


def cell(of: Sequence[Outcome], what: str) -> str:
    """One figure."""
    if what == "seconds":
        return seconds([one.seconds for one in of])
    if what == "parameters":
        return share([held for one in of for held in one.inside])
    flags = {
        "named": lambda one: bool(one.named),
        "unexplained": lambda one: one.verdict == "unexplained",
        "gain": lambda one: one.gain_inside,
        "right": lambda one: one.right,
        "wrong": lambda one: one.wrong,
        "detected": lambda one: bool(one.named) or one.verdict == "unexplained",
    }
    return share([flags[what](one) for one in of])


def main(argv: Sequence[str] | None = None) -> int:
    """Run the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.hidden_effects.lane",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--clean", type=int, default=24, help="drives without an effect")
    parser.add_argument("--each", type=int, default=10, help="drives with each effect")
    parser.add_argument("--first-seed", type=int, default=700_000)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--wrong", action="store_true", help="list the drives that went wrong")
    args = parser.parse_args(argv)
    wanted = drives(args.clean, args.each, args.first_seed)
    with ProcessPoolExecutor(args.workers) as pool:
        outcomes = []
        for one in pool.map(run, wanted):
            outcomes.append(one)
            print(f"{len(outcomes)} of {len(wanted)} drives", end="\r", file=sys.stderr, flush=True)
    print("\n".join(table(outcomes)))
    for one in outcomes if args.wrong else ():
        if one.wrong or (not one.right and one.drive.effect) or one.verdict == "unexplained":
            print(
                f"{one.drive.simulator} {one.drive.effect or 'clean'} {one.drive.seed}: {one.verdict}: {one.says}"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
