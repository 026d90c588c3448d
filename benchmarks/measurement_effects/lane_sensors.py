"""What sensors do to a lane-keeping drive: gains that hold, what is withheld and named, and false causes.

    python -m benchmarks lane_sensors [--drives 8] [--diagnosed 2] [--effect WORD] [--rates 20,50] [--first-seed 8200]

Drives of the lane keeper that is not canid's, as tables, with the effects of tests/plants/lane_tables.py at four strengths.
`--drawn N` draws combinations of up to three effects instead, as `sensor_effects` does.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import canid
from benchmarks.measurement_effects.__main__ import listed
from canid.analysis.drive import drive_parameters
from canid.models.effects.sensing import clock_skew
from canid.values.errors import CanidError
from tests.plants.lane_tables import CLOCK, EFFECTS, lane_drive
from tests.plants.quoted_intervals import Quoted, quoted, trace, tried_lane
from tests.plants.sensor_effects import Drawn, applied


class Job(NamedTuple):
    """A drive at one rate, with every effect that is asked for."""

    seed: int
    rate: float  # Hz
    places: tuple[int, ...]  # in EFFECTS
    diagnosed: bool


class Outcome(NamedTuple):
    """What is said of a drive with one effect."""

    job: Job
    place: int  # in EFFECTS; -1: the drive as it is
    strength: float
    identified: tuple[Quoted, ...]
    findings: tuple[str, ...]
    diagnosed: tuple[Quoted, ...] | None  # None: not diagnosed
    causes: tuple[str, ...]  # false ones: of a clock that runs off that is none which has it as a rival


def outcomes(job: Job) -> list[Outcome]:
    """The drive as it is, and with each effect at each strength."""
    drive, out = lane_drive(job.seed, rate=job.rate), []
    cells = [(-1, 0.0), *((place, x) for place in job.places for x in EFFECTS[place].strengths)]
    for place, strength in cells:
        changed = drive
        if place >= 0:
            rng = np.random.default_rng([job.seed, place + 1])
            changed = applied(drive, (Drawn(EFFECTS[place], strength),), rng)
        try:
            given = trace(changed)
        except CanidError:
            out.append(Outcome(job, place, strength, (), ("refused",), None, ()))
            continue
        found = _judged(quoted(drive_parameters.whole_drive(given), drive.truth))
        names = tuple(dict.fromkeys(each.name for each in given.findings))
        said, causes = None, tuple[str, ...]()
        if job.diagnosed:
            report = canid.diagnose(given)
            said = _judged(quoted(report.extended, drive.truth))
            right = clock_skew.EFFECT.id if place >= 0 and EFFECTS[place].name == CLOCK else ""
            causes = tuple(x.effect for x in report.findings if right not in (x.effect, *x.rivals))
        out.append(Outcome(job, place, strength, found, names, said, causes))
    return out


def _judged(numbers: Sequence[Quoted]) -> tuple[Quoted, ...]:
    """Numbers with a truth: three lags and a dead time are no one lag and dead time, their sum is."""
    return tuple(each for each in numbers if each.parameter in ("K", "tau_plus_dead_time"))


def rows(found: Sequence[Outcome]) -> Iterator[str]:
    """The table, one row for each effect: cells are of the strengths in their order."""
    yield "| effect | strengths | `identify`: hold | `diagnose`: hold | findings, drives | false causes |"
    yield "|---|---|---|---|---|---|"
    for place in sorted({one.place for one in found}):
        mine = [one for one in found if one.place == place]
        strengths = sorted({one.strength for one in mine})
        parts = [[one for one in mine if one.strength == strength] for strength in strengths]
        number = sum(one.diagnosed is not None for one in mine)
        cells = [
            " · ".join(_held([each for one in part for each in one.identified]) for part in parts),
            " · ".join(_held([each for one in part for each in one.diagnosed or ()]) for part in parts),
            _counted(x for one in mine for x in one.findings),
            f"{sum(bool(one.causes) for one in mine)}/{number} {_counted(x for one in mine for x in one.causes)}",
        ]
        name = "none" if place < 0 else EFFECTS[place].name
        unit = "" if place < 0 else f"{' · '.join(f'{x:g}' for x in strengths)} {EFFECTS[place].unit}"
        yield f"| {name} | {unit} | {' | '.join(cells)} |"


def _held(numbers: Sequence[Quoted]) -> str:
    return f"{sum(each.covers for each in numbers)}/{len(numbers)}" if numbers else "–"


def _counted(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}` {number}" for name, number in Counter(names).most_common(4))


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks lane_sensors",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=8)
    parser.add_argument("--diagnosed", type=int, default=2, help="of them, diagnosed as well; default: 2")
    parser.add_argument("--effect", default="", help="only effects whose name holds this")
    parser.add_argument("--rates", default="20,50", help="Hz; default: 20,50")
    parser.add_argument("--drawn", type=int, default=0, metavar="N", help="N drawn combinations instead")
    parser.add_argument("--first-seed", type=int, default=8200)
    parser.add_argument("--processes", type=int, default=2)
    args = parser.parse_args()
    seeds = range(args.first_seed, args.first_seed + (args.drawn or args.drives))
    with ProcessPoolExecutor(args.processes) as pool:
        if args.drawn:
            for one in pool.map(tried_lane, seeds):
                print(listed(one), flush=True)
            return
        places = tuple(k for k, each in enumerate(EFFECTS) if args.effect in each.name)
        for rate in map(float, args.rates.split(",")):
            jobs = [Job(seed, rate, places, k < args.diagnosed) for k, seed in enumerate(seeds)]
            print(f"\n{rate:g} Hz, seeds {seeds[0]} to {seeds[-1]}\n")
            for line in rows([one for part in pool.map(outcomes, jobs) for one in part]):
                print(line, flush=True)


if __name__ == "__main__":
    main()
