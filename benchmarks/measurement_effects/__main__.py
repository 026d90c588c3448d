"""What sensors do to a measurement: coverage of quoted intervals, what is withheld, what is named.

    python -m benchmarks sensor_effects [--drives 10] [--diagnosed 1] [--effect WORD] [--drawn N] [--clean N]

Drives of two simulators that are not canid's (tests/plants/outside_drives.py), each effect of
tests/plants/sensor_effects.py at four strengths, as tables. `--drawn N` draws combinations of up to three effects
instead, and lists each number that covered the truth, or was not quoted, and is quoted without covering it afterwards.
`--clean N` has drives that nothing is wrong with, radars of four kinds, 10 and 20 Hz: each finding is false; every third
sixteen are identified.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import canid
from benchmarks.measurement_effects.clean import judged
from benchmarks.measurement_effects.clean import listed as listed_clean
from benchmarks.measurement_effects.outcomes import Outcome, rows
from tests.plants.outside_drives import SIMULATORS, drawn_drive
from tests.plants.quoted_intervals import Quoted, Tried, identified, quoted, silent_misses, trace, tried
from tests.plants.sensor_effects import EFFECTS, Drawn, applied


class Job(NamedTuple):
    """One drive, with every effect that is asked for."""

    simulator: str
    seed: int
    effects: tuple[int, ...]  # places in EFFECTS
    diagnosed: bool


def outcomes(job: Job) -> list[Outcome]:
    """The drive as it is, and with each effect at each strength."""
    drive = drawn_drive(job.simulator, job.seed)
    clean = identified(drive)
    before = quoted(clean, drive.truth)
    known = set() if clean is None else {each.name for each in clean.findings}
    out = []
    for place, strength in [(-1, 0.0), *((k, x) for k in job.effects for x in EFFECTS[k].strengths)]:
        rng = np.random.default_rng([job.seed, place + 1])
        changed = drive
        if place >= 0:
            changed = applied(drive, (Drawn(EFFECTS[place], strength),), rng)
        result = clean if place < 0 else identified(changed)
        after = quoted(result, drive.truth)
        findings = () if result is None else tuple({each.name for each in result.findings} - known)
        causes: tuple[str, ...] | None = None
        if job.diagnosed and result is not None:
            named = canid.diagnose(trace(changed)).findings
            causes = tuple(each.effect for each in named if each.where in ("driver", "vehicle"))
        refused = result is None
        misses = tuple(silent_misses(before, after))
        out.append(
            Outcome(
                job.simulator, job.seed, place, strength, before, after, refused, findings, causes, misses
            )
        )
    return out


def listed(one: Tried) -> str:
    """A combination and what it did, on one line."""
    did = "; ".join(map(str, one.misses)) or "no silent miss"
    quotable = f"{len(one.before)} quoted, {len(one.after)} after"
    names = ", ".join(one.findings) or "no finding"
    return f"{one.seed} {one.simulator}: {' + '.join(map(str, one.effects))}: {quotable}; {names}: {did}"


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks sensor_effects",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=10, help="of each simulator; default: 10")
    parser.add_argument("--diagnosed", type=int, default=1, help="of them, diagnosed as well; default: 1")
    parser.add_argument("--effect", default="", help="only effects whose name holds this")
    parser.add_argument("--drawn", type=int, default=0, metavar="N", help="N drawn combinations instead")
    parser.add_argument("--clean", type=int, default=0, metavar="N", help="N clean drives instead")
    parser.add_argument("--first-seed", type=int, default=46_000)
    parser.add_argument("--processes", type=int, default=2)
    args = parser.parse_args()
    seeds = range(args.first_seed, args.first_seed + (args.drawn or args.clean or args.drives))
    print(f"canid {canid.__version__}, seeds {seeds[0]} to {seeds[-1]}", flush=True)
    with ProcessPoolExecutor(args.processes) as pool:
        if args.drawn:
            number, wrong = 0, 0
            for one in pool.map(tried, seeds):
                number += len(one.after)
                wrong += len(one.misses)
                print(listed(one), flush=True)
            print(f"{wrong} silent misses of {number} quoted numbers")
            return
        if args.clean:
            numbers, alarms = list[Quoted](), 0
            for drive in pool.map(judged, seeds):
                numbers += drive.quoted or ()
                alarms += bool(drive.findings)
                print(listed_clean(drive), flush=True)
            held = sum(each.covers for each in numbers)
            print(f"{alarms} of {len(seeds)} drives with a finding; {held} of {len(numbers)} numbers hold")
            return
        places = tuple(k for k, each in enumerate(EFFECTS) if args.effect in each.name)
        jobs = [
            Job(simulator, seed, places, k < args.diagnosed)
            for k, seed in enumerate(seeds)
            for simulator in SIMULATORS
        ]
        found = []
        for job, part in zip(jobs, pool.map(outcomes, jobs), strict=True):
            found += part
            print(
                f"{job.simulator} {job.seed}: {sum(len(each.misses) for each in part)} silent misses",
                flush=True,
            )
    for line in rows(found):
        print(line)


if __name__ == "__main__":
    main()
