"""The screen beside the estimators: is it silent on clean drives, how soon does it tell a change, and what does it cost?

    python benchmarks/screen.py [--clean 36] [--drives 12] [--first-seed 61000]

Drives of both planting simulators, all noises and profiles, as canid samples them from the encoded log.
"""

from __future__ import annotations

import argparse
import itertools
import os
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from benchmarks.hidden_effects import plant_one, plant_two
from benchmarks.hidden_effects.planted import NOISES, PROFILES, Plant
from benchmarks.hidden_effects.sensed import lean, trace
from benchmarks.midway import CHANGES, Change, Scene
from canid import pipeline
from canid.screening import watch
from canid.types import Sample, Screened, Trace, Watch

PLANTS: tuple[Plant, ...] = (plant_one.plant, plant_two.plant)
# min; three lengths of clean drives, and one of those that change
CLEAN_MINUTES = (10.0, 20.0, 30.0)
MINUTES = 12.0
# of the drive; by then minutes were learnt, and minutes are left
MIDDLE = (0.4, 0.6)
# s after the first word, when the block is looked at once more
LATER = 60.0


class Alarm(NamedTuple):
    """The screen begins to suspect."""

    t: float  # s
    since: float  # s
    block: str
    says: str


def samples(drive: Trace) -> Iterator[Sample]:
    """Row by row, with all signals."""
    signals = {role: x.tolist() for role, x in drive.signals.items()}
    rows = zip(drive.t.tolist(), drive.output.tolist(), drive.inputs.tolist(), strict=True)
    for k, (t, y, u) in enumerate(rows):
        at = {role: x[k] for role, x in signals.items()}
        yield Sample(t, y, tuple(u), drive.gate[k], bool(drive.learn[k]), int(drive.segment[k]), at)


def screened(drive: Trace) -> list[Screened]:
    """All that the screen says along a drive."""
    screen = watch.make(drive.input_names)
    state, said = screen.init(), []
    for sample in samples(drive):
        state, now = screen.step(state, sample)
        said += [now] if now is not None else []
    return said


def alarms(said: list[Screened]) -> list[Alarm]:
    """Whenever a block begins to be suspected."""
    out, before = [], ""
    for now in said:
        if now.block not in ("", before):
            out.append(Alarm(now.t, now.since, now.block, now.says))
        before = now.block
    return out


def kinds(first: int) -> Iterator[tuple[Plant, dict[str, Any]]]:
    """Drives without end, always another seed: 12 have each simulator and noise, 36 each profile with them."""
    for k in itertools.count():
        noise, plant = k // 2 % len(NOISES), k % 2
        profile = PROFILES[(noise + plant + k // 12) % len(PROFILES)]
        yield PLANTS[plant], {"seed": first + k, "noise": NOISES[noise], "profile": profile}


def clean(number: int, first: int) -> None:
    """Count false alarms."""
    hours, told = 0.0, []
    looked: Counter[str] = Counter()
    for k, (plant, how) in enumerate(itertools.islice(kinds(first), number)):
        minutes = CLEAN_MINUTES[k % len(CLEAN_MINUTES)]
        said = screened(trace(plant({}, minutes=minutes, **how)))
        hours += minutes / 60.0
        told += [(how, alarm) for alarm in alarms(said)]
        looked.update(block for block, of in said[-1].blocks.items() if of.state is Watch.FITS)
    print(
        f"clean: {len(told)} false alarms in {hours:.1f} h of {number} drives: {len(told) / hours:.2f} per hour"
    )
    print("  blocks that fit at the end: " + ", ".join(f"{b} {looked[b]}" for b in watch.BLOCKS))
    for how, alarm in told:
        print(f"  {how}: {alarm}")


def changed(change: Change, number: int, first: int, verbose: bool) -> list[str]:
    """One row: what was told of a change."""
    delays, off, early = [], [], 0
    blocks, later = Counter[str](), Counter[str]()
    for plant, how in itertools.islice(kinds(first), number):
        at = float(np.random.default_rng([how["seed"], 3]).uniform(*MIDDLE)) * MINUTES * 60.0
        drive, begins = change.make(Scene(plant, how | {"minutes": MINUTES}, at))
        told = alarms(screened(trace(drive)))
        early += sum(a.t < begins for a in told)
        after = [a for a in told if a.t >= begins]
        if verbose:
            print(
                how,
                round(begins),
                [(round(a.t - begins, 1), round(a.since - begins, 1), *a[2:]) for a in told],
            )
        if after:
            delays.append(after[0].t - begins)
            off.append(after[0].since - begins)
            blocks[after[0].block] += 1
            until = after[0].t + LATER
            later[[a.block for a in after if a.t <= until][-1]] += 1
    row = [change.name, change.block, f"{len(delays)} of {number}"]
    if not delays:
        return [*row, "–", "–", "–", "–", str(early)]
    low, mid, high = np.quantile(off, (0.1, 0.5, 0.9))
    said = [", ".join(f"{block} {n}" for block, n in of.most_common()) for of in (blocks, later)]
    return [*row, f"{np.median(delays):.0f}", f"{mid:+.0f} ({low:+.0f} to {high:+.0f})", *said, str(early)]


def cost(first: int) -> None:
    """Time the screen and the estimators, sample by sample in turn."""
    plant, how = next(kinds(first))
    drive = trace(plant({}, minutes=10.0, **how))
    running = [(e.name, e.init(), e.step) for e in pipeline.estimators(lean())]
    screen = watch.make(drive.input_names)
    running.append(("screen", screen.init(), screen.step))
    spent: Counter[str] = Counter()
    for sample in samples(drive):
        for k, (name, state, step) in enumerate(running):
            began = time.process_time_ns()
            state, _ = step(state, sample)
            spent[name] += time.process_time_ns() - began
            running[k] = name, state, step
    seconds = 1e9 * len(drive.t) * drive.dt
    others = sum(ns for name, ns in spent.items() if name != "screen")
    shares = ", ".join(f"{name} {100.0 * ns / seconds:.2f} %" for name, ns in spent.items())
    print(f"cost: of a core at {1.0 / drive.dt:.0f} Hz: {shares}; ")
    print(f"  the screen takes {100.0 * spent['screen'] / others:.1f} % of what the estimators take")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clean", type=int, default=36)
    parser.add_argument("--drives", type=int, default=12, help="per change")
    parser.add_argument("--first-seed", type=int, default=61000)
    parser.add_argument("--only", default="", help="changes whose name contains this")
    parser.add_argument("--verbose", action="store_true")
    args = parser.parse_args()
    cost(args.first_seed)
    if args.clean:
        clean(args.clean, args.first_seed)
    print(
        "| change | block | told | delay s | since − truth s (10–90 %) | suspected | a minute later | too early |"
    )
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for change in CHANGES:
        if args.only in change.name:
            row = changed(change, args.drives, args.first_seed + 500, args.verbose)
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
