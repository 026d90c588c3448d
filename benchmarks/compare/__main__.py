"""How often `canid compare` calls one simulated driver two, and how often it finds two drivers: docs/compare.md.

    python -m benchmarks compare [--same 60] [--different 30] [--jobs 2] [--seed 1] [--into docs/compare.md]

Each driver, spectrum of noise, lead, road profile and length (2 to 20 min) is drawn; both drives of a pair are of one
length, behind different leads, and go through simulation, frames, a .blf log, reading and identification. Of the different
pairs one half have a gain of range rate 1.5 times as large, the other half a dead time to range rate 0.3 s longer.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.compare import drives
from benchmarks.identification.table import Table, markdown
from canid.analysis.comparison.comparison import DIFFERENT, Comparison, compare
from canid.values.text.names import label

BEGIN, END = "<!-- compare: begin -->", "<!-- compare: end -->"
# what differs between two drivers: name, parameter that shows it
CHANGES = (
    ("K of range rate 1.5 times as large", "K"),
    ("dead time to range rate 0.3 s longer", "tau_plus_dead_time"),
)
GAIN_FACTOR, DEAD_TIME_MORE_S = 1.5, 0.3
# lengths that stand together in the table of power, min
SHORT_MIN = 3.0


class Pair(NamedTuple):
    """One pair of drives, compared."""

    minutes: float
    found: Comparison
    ratio: float  # true, of the parameter that differs; 1: none does
    took: float  # s of CPU


def same(number: int, seed: int) -> Pair:
    """Two drives of one driver."""
    return _pair(number, seed, "")


def different(number: int, seed: int) -> Pair:
    """Two drives of two drivers that differ in one parameter, by turns."""
    return _pair(number, seed, CHANGES[number % 2][1])


def _pair(number: int, seed: int, change: str) -> Pair:
    began = time.process_time()
    rng = np.random.default_rng([seed, number, len(change)])
    driver, noise = drives.drawn(int(rng.integers(2**31)))
    other = driver
    if change == "K":
        other = driver._replace(K2=GAIN_FACTOR * driver.K2)
    elif change:
        other = driver._replace(dead_time2=driver.dead_time2 + DEAD_TIME_MORE_S)
    minutes = drives.length(rng)
    made = [
        drives.estimates(one, noise, minutes, int(rng.integers(2**31)), str(rng.choice(drives.PROFILES)))
        for one in (driver, other)
    ]
    found = compare(drives.side("A", made[0]), drives.side("B", made[1]))
    return Pair(minutes, found, GAIN_FACTOR if change == "K" else 1.0, time.process_time() - began)


def tables(ones: Sequence[Pair], others: Sequence[Pair]) -> list[Table]:
    """False differences by parameter; power by length."""
    wrong = [pair for pair in ones if pair.found.verdict == DIFFERENT]
    names = list(dict.fromkeys(row.name for pair in ones for row in pair.found.rows if row.compared))
    rows: list[tuple[object, ...]] = [
        ("any parameter", len(ones), "–", f"{len(wrong)} ({len(wrong) / len(ones):.1%})")
    ]
    for name in names:
        known = [row for pair in ones for row in pair.found.rows if row.name == name and row.compared]
        alone = sum(row.p < 0.05 for row in known)
        rows.append(
            (label(name), len(known), f"{alone / len(known):.0%}", str(sum(row.differs for row in known)))
        )
    power: list[tuple[object, ...]] = []
    for k, (name, field) in enumerate(CHANGES):
        own = list(others[k::2])
        for title, part in (
            (f"up to {SHORT_MIN:.0f} min", [p for p in own if p.minutes <= SHORT_MIN]),
            ("longer", [p for p in own if p.minutes > SHORT_MIN]),
        ):
            if not part:
                continue
            found = sum(pair.found.verdict == DIFFERENT for pair in part)
            which = [
                row
                for pair in part
                for row in pair.found.rows
                if row.name == f"range_rate {field}" and row.compared
            ]
            named = sum(row.differs for row in which)
            seen = [row.detectable / row.a.value if field == "K" else row.detectable for row in which]
            size = float(np.median(seen)) if seen else float("nan")
            unit = "%" if field == "K" else "s"
            power.append(
                (name, title, len(part), f"{found} of {len(part)}", f"{named} of {len(which)}",
                 f"{100 * size:.0f} %" if unit == "%" else f"{size:.2f} s")
            )  # fmt: skip
    return [
        Table(
            f"Two drives of one driver: {len(ones)} pairs",
            ("parameter", "pairs compared", "95 % interval of the difference misses 0", "called different"),
            rows,
            ("At most 5 % of the pairs may be called different, all parameters together.",),
        ),
        Table(
            f"Two drivers: {len(others)} pairs",
            (
                "what differs",
                "drives",
                "pairs",
                "called different",
                "by that parameter",
                "detectable (median)",
            ),
            power,
        ),
    ]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the pairs."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks compare",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--same", type=int, default=60, help="pairs of one driver")
    parser.add_argument("--different", type=int, default=30, help="pairs of two drivers")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--into", type=Path, metavar="PAGE", help="replace the tables of this page")
    args = parser.parse_args(argv)
    with ProcessPoolExecutor(args.jobs) as pool:
        ones = list(pool.map(partial(same, seed=args.seed), range(args.same)))
        others = list(pool.map(partial(different, seed=args.seed), range(args.different)))
    took = sum(pair.took for pair in (*ones, *others))
    text = "\n\n".join(markdown(table) for table in tables(ones, others))
    text += f"\n\nSeed {args.seed}; {took:.0f} s of CPU."
    print(text)
    if args.into is not None:
        before, _, rest = args.into.read_text(encoding="utf-8").partition(BEGIN)
        args.into.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.partition(END)[2]}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
