"""Which causes `diagnose` names on drives whose driver and car have none, because of what a sensor does.

    python -m benchmarks sensor_causes [--drives 1] [--effect WORD] [--strength K] [--first-seed 47000]

The drives and effects of `sensor_effects`, diagnosed and not identified: some 4 s of CPU time each. A cause that is named
as one of several, of which one is a sensor's, stands among the sensors: "a or b".
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import canid
from benchmarks.measurement_effects.drives import drawn_drive, trace
from canid.models.diagnosis.vehicle.pedal_record import END_OF_RECORD
from canid.models.effects import CATALOGUE
from canid.values.errors import CanidError
from canid.values.findings import Verdict
from tests.plants.outside_drives import SIMULATORS
from tests.plants.sensor_effects import EFFECTS, Drawn, applied

# what `diagnose` names as "or" one of these it does not blame the driver for
SENSORS = {END_OF_RECORD, *(effect.id for effect in CATALOGUE if effect.where == "sensing")}


class Job(NamedTuple):
    """A drive with one effect."""

    simulator: str
    seed: int
    place: int  # in EFFECTS
    strength: float


class Outcome(NamedTuple):
    """What is said of it."""

    job: Job
    verdict: Verdict | None  # None: canid refuses the table
    causes: tuple[str, ...]  # of driver and car, each of which is false
    sensing: tuple[str, ...]


def outcome(job: Job) -> Outcome:
    """Diagnose one drive."""
    rng = np.random.default_rng([job.seed, job.place + 1])
    drive = drawn_drive(job.simulator, job.seed)
    try:
        report = canid.diagnose(
            trace(applied(drive, (Drawn(EFFECTS[job.place], job.strength),), rng)), arbitrated=False
        )
    except CanidError:
        return Outcome(job, None, (), ())
    undecided = [each for each in report.findings if SENSORS & {*each.rivals}]
    blamed = tuple(
        each.effect
        for each in report.findings
        if each.where in ("driver", "vehicle") and each not in undecided
    )
    sensing = tuple(each.effect for each in report.findings if each.where == "sensing")
    sensing += tuple(
        " or ".join((each.effect, *each.rivals)) for each in undecided if each.where != "sensing"
    )
    return Outcome(job, report.verdict, blamed, sensing)


def rows(found: Sequence[Outcome]) -> Iterator[str]:
    """The table, one row for each effect."""
    yield "| effect | strengths | drives with a cause in driver or car | named | in a sensor | verdicts |"
    yield "|---|---|---|---|---|---|"
    for place in sorted({one.job.place for one in found}):
        some = [one for one in found if one.job.place == place]
        strengths = sorted({one.job.strength for one in some})
        blamed, sensing = (
            ", ".join(f"`{name}` {number}" for name, number in Counter(names).most_common())
            for names in ([x for one in some for x in one.causes], [x for one in some for x in one.sensing])
        )
        verdicts = Counter("refused" if one.verdict is None else one.verdict.value for one in some)
        said = ", ".join(f"{name} {number}" for name, number in verdicts.most_common())
        yield (
            f"| {EFFECTS[place].name} | {' · '.join(f'{x:g}' for x in strengths)} {EFFECTS[place].unit} | "
            f"{sum(bool(one.causes) for one in some)}/{len(some)} | {blamed} | {sensing} | {said} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks sensor_causes",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=1, help="of each simulator; default: 1")
    parser.add_argument("--effect", default="", help="only effects whose name holds this")
    parser.add_argument("--strength", type=int, choices=range(1, 5), help="only this one; default: all four")
    parser.add_argument("--first-seed", type=int, default=47_000)
    parser.add_argument("--processes", type=int, default=2)
    args = parser.parse_args()
    jobs = [
        Job(simulator, seed, place, strength)
        for seed in range(args.first_seed, args.first_seed + args.drives)
        for simulator in SIMULATORS
        for place, effect in enumerate(EFFECTS)
        if args.effect in effect.name
        for k, strength in enumerate(effect.strengths, 1)
        if args.strength in (None, k)
    ]
    with ProcessPoolExecutor(args.processes) as pool:
        for line in rows(list(pool.map(outcome, jobs))):
            print(line)


if __name__ == "__main__":
    main()
