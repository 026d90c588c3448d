"""The monitor: false alarms on clean drives, delay of detecting a change, and cost.

    python -m benchmarks change_detection [--clean 36] [--drives 12] [--first-seed 61000]

Drives of both planting simulators, all noises and profiles, as canid samples them from the encoded log.
"""

from __future__ import annotations

import argparse
import itertools
import os
import time
from collections import Counter

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from canid.models.monitor import change_monitor
from canid.models.pipeline import pipeline
from canid.values.types import BlockStatus
from tests.plants.changes import CHANGES, Change, Scene
from tests.plants.measurement import lean, trace
from tests.plants.monitor_runs import alarms, kinds, reports, samples

# min; three lengths of clean drives, and one of those that change
CLEAN_MINUTES = (10.0, 20.0, 30.0)
MINUTES = 12.0
# of the drive: minutes to learn before, and minutes to detect after
CHANGE_SHARE = (0.4, 0.6)
# s after the first alarm, when the suspected block is recorded again
LATER_S = 60.0


def clean(number: int, first: int) -> None:
    """Count false alarms."""
    hours, found = 0.0, []
    fits: Counter[str] = Counter()
    for k, (plant, how) in enumerate(itertools.islice(kinds(first), number)):
        minutes = CLEAN_MINUTES[k % len(CLEAN_MINUTES)]
        reported = reports(trace(plant({}, minutes=minutes, **how)))
        hours += minutes / 60.0
        found += [(how, alarm) for alarm in alarms(reported)]
        fits.update(block for block, of in reported[-1].blocks.items() if of.state is BlockStatus.FITS)
    print(
        f"clean: {len(found)} false alarms in {hours:.1f} h of {number} drives: {len(found) / hours:.2f} per hour"
    )
    print("  blocks that fit at the end: " + ", ".join(f"{b} {fits[b]}" for b in change_monitor.BLOCKS))
    for how, alarm in found:
        print(f"  {how}: {alarm}")


def changed(change: Change, number: int, first: int, verbose: bool) -> list[str]:
    """One row: the alarms after a change."""
    delays, off, early = [], [], 0
    blocks, later = Counter[str](), Counter[str]()
    for plant, how in itertools.islice(kinds(first), number):
        at = float(np.random.default_rng([how["seed"], 3]).uniform(*CHANGE_SHARE)) * MINUTES * 60.0
        drive, begins = change.make(Scene(plant, how | {"minutes": MINUTES}, at))
        found = alarms(reports(trace(drive)))
        early += sum(a.t < begins for a in found)
        after = [a for a in found if a.t >= begins]
        if verbose:
            print(
                how,
                round(begins),
                [(round(a.t - begins, 1), round(a.since - begins, 1), *a[2:]) for a in found],
            )
        if after:
            delays.append(after[0].t - begins)
            off.append(after[0].since - begins)
            blocks[after[0].block] += 1
            until = after[0].t + LATER_S
            later[[a.block for a in after if a.t <= until][-1]] += 1
    row = [change.name, change.block, f"{len(delays)} of {number}"]
    if not delays:
        return [*row, "–", "–", "–", "–", str(early)]
    low, mid, high = np.quantile(off, (0.1, 0.5, 0.9))
    named = [", ".join(f"{block} {n}" for block, n in of.most_common()) for of in (blocks, later)]
    return [*row, f"{np.median(delays):.0f}", f"{mid:+.0f} ({low:+.0f} to {high:+.0f})", *named, str(early)]


def cost(first: int) -> None:
    """Time the monitor and the estimators, sample by sample in turn."""
    plant, how = next(kinds(first))
    drive = trace(plant({}, minutes=10.0, **how))
    running = [(e.name, e.init(), e.step) for e in pipeline.estimators(lean())]
    monitor = change_monitor.make(drive.input_names)
    running.append(("monitor", monitor.init(), monitor.step))
    spent: Counter[str] = Counter()
    for sample in samples(drive):
        for k, (name, state, step) in enumerate(running):
            began = time.process_time_ns()
            state, _ = step(state, sample)
            spent[name] += time.process_time_ns() - began
            running[k] = name, state, step
    seconds = 1e9 * len(drive.t) * drive.dt
    others = sum(ns for name, ns in spent.items() if name != "monitor")
    shares = ", ".join(f"{name} {100.0 * ns / seconds:.2f} %" for name, ns in spent.items())
    print(f"cost: of a core at {1.0 / drive.dt:.0f} Hz: {shares}; ")
    print(f"  the monitor takes {100.0 * spent['monitor'] / others:.1f} % of what the estimators take")


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks change_detection", description=__doc__.splitlines()[0]
    )
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
        "| change | block | detected | delay s | since − truth s (10–90 %) | suspected | a minute later | too early |"
    )
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for change in CHANGES:
        if args.only in change.name:
            row = changed(change, args.drives, args.first_seed + 500, args.verbose)
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
