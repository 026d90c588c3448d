"""A planted fleet through `canid fleet`, scored by its truth.

    python -m benchmarks planted_fleet [--seed S] [--fleets N --drivers D --drives M] [--keep DIR]
        [--into docs/evidence/fleet.md]
    python -m benchmarks planted_fleet --coverage [--seed S]

200 drives of 30 drivers who are drawn from a hidden population, in 3 cars, with 4 hidden causes, a driver who changes
over the weeks, two drives in each other's folders and two groups. A fleet is a function of its seed alone; without --seed
one is drawn, and printed. With --fleets N it plants N fleets, for coverage over many populations; --coverage is 40 small
clean ones, of which only what is pooled is analysed: a minute of CPU each, 40 min in all. What is known after each fleet
is printed, and written --into the page.
"""

from __future__ import annotations

import argparse
import os
import secrets
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

# one thread: the matrices are small
os.environ["OMP_NUM_THREADS"] = "1"

from benchmarks.fleet import page, planted_answers, planted_table
from benchmarks.fleet.fleet_runs import machine, run
from benchmarks.fleet.planted_score import Score, read_truth, score, single_drives
from tests.fleet.planted.drive_files import write
from tests.fleet.planted.planted_fleet import CARS, Size, layout

# --coverage: enough drivers and drives to keep the two spreads apart, and no analysis of what no pool holds
COVERAGE = {
    "fleets": 40,
    "drivers": 5,
    "drives": 15,
    "cars": 1,
    "minutes": (2.5, 3.0),
    "clean": True,
    "no_diagnosis": True,
    "no_windows": True,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Plant, run, score, print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks planted_fleet",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seed", type=int, help="of the first fleet; default: drawn")
    parser.add_argument("--fleets", type=int, default=1, metavar="N")
    parser.add_argument("--drivers", type=int, default=30)
    parser.add_argument("--drives", type=int, default=200)
    parser.add_argument("--cars", type=int, default=3, choices=(1, 2, 3))
    parser.add_argument("--minutes", type=float, nargs=2, default=(3.0, 8.0), metavar=("FROM", "TO"))
    parser.add_argument(
        "--clean", action="store_true", help="no cause, no change, no swap, no groups: coverage alone"
    )
    parser.add_argument("--no-diagnosis", action="store_true")
    parser.add_argument(
        "--no-windows",
        action="store_true",
        help="neither sliding windows nor models of traffic: as no pool does",
    )
    parser.add_argument(
        "--together",
        metavar="TIME",
        help="diagnose drives of a driver together as well, up to so much: 30min",
    )
    parser.add_argument(
        "--coverage",
        action="store_true",
        help="40 clean fleets of 15 drives of 5 drivers in one car, 2.5 to 3 min each, whole drives alone",
    )
    parser.add_argument("--quick", action="store_true", help="24 drives of 6 drivers")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--nice", type=int, default=0)
    parser.add_argument(
        "--keep",
        type=Path,
        metavar="DIR",
        help="keep logs and results; a fleet that is there is not made again",
    )
    parser.add_argument("--into", type=Path, metavar="PAGE", help="replace the table of this page")
    parsed, given = argparse.Namespace(), list(sys.argv[1:] if argv is None else argv)
    if parser.parse_args(given).coverage:
        # what is said besides holds
        parsed = argparse.Namespace(**COVERAGE)
    args = parser.parse_args(given, parsed)
    first = secrets.randbelow(10**6) if args.seed is None else args.seed
    size = Size(
        drivers=6 if args.quick else args.drivers,
        drives=24 if args.quick else args.drives,
        minutes=tuple(args.minutes),
        cars=CARS[: args.cars],
        habit_drivers=1 if args.quick else 3,
    )
    if args.clean:
        size = size._replace(causes=False, changed=False, swapped=False, groups_differ=False)
    scores: list[Score] = []
    answered: list[planted_answers.Answers] = []
    lines: list[str] = []
    for seed in range(first, first + args.fleets):
        print(f"seed {seed}", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory() as temporary:
            home = (args.keep or Path(temporary)) / f"fleet {seed}"
            one, answers, said = fleet(seed, size, home, args)
        scores.append(one)
        answered.append(answers)
        lines += said
        text = "\n".join(
            [
                *planted_table.table(scores),
                "",
                *planted_answers.table(answered),
                "",
                *lines,
                "",
                f"Machine: {machine()}.",
            ]
        )
        print(planted_table.totals(scores), file=sys.stderr, flush=True)
        if args.into is not None:
            page.replace(args.into, "planted fleet", text)
    print(text)
    return 0


def fleet(
    seed: int, size: Size, home: Path, args: argparse.Namespace
) -> tuple[Score, planted_answers.Answers, list[str]]:
    """Plant one fleet, run canid on it and score it; lines on the run itself."""
    truth = home / "truth.json"
    begin = time.perf_counter()
    if not truth.exists():
        write(layout(seed, size), home, args.workers)
    planted = time.perf_counter() - begin
    words: list[str | Path] = [home / "logs", "-o", home / "results", "--vehicles", home / "map.toml"]
    words += ["--workers", str(args.workers), *["--no-diagnosis"] * args.no_diagnosis]
    words += ["--no-windows", "--no-traffic"] * args.no_windows
    ran = run(words, nice=args.nice)
    joint = None
    if args.together is not None:
        together = ["--together", args.together, "--workers", str(args.workers)]
        joint = run(["causes", home / "results", *together], nice=args.nice)
    found = read_truth(truth)
    begin = time.perf_counter()
    # the summary writes the tables of drivers and population
    answers = planted_answers.answers(home / "results", found)
    summary = time.perf_counter() - begin
    out = score(home / "results", found)
    lines = [
        f"Seed {seed}: planted in {planted:.0f} s, canid fleet {ran.wall_s:.0f} s ({ran.cpu_s:.0f} s of CPU, "
        f"{args.workers} workers), client {ran.client_bytes / 1e6:.0f} MB, largest worker {ran.worker_bytes / 1e6:.0f} MB; "
        f"summary {summary:.0f} s."
    ]
    if joint is not None:
        lines.append(
            f"canid fleet causes --together {args.together}: {joint.wall_s:.0f} s ({joint.cpu_s:.0f} s of CPU)."
        )
    if not args.no_diagnosis:
        planted_in, named, clean, false = single_drives(home / "results", found)
        lines.append(
            f"Each drive alone: a planted cause is named in {named} of {planted_in} drives that have one, and some cause in "
            f"{false} of {clean} that have none."
        )
    return out, answers, lines


if __name__ == "__main__":
    sys.exit(main())
