"""Coverage, bias and error of every quotable number in a world of another form.

    python -m benchmarks outside_form [--runs 200] [--minutes 3 10 20] [--noise KIND] [--first-seed S]
        [--only truth|optima|changes] [--data ../shared/data] [--raw]

The plant is none of canid's simulators (plant.py): automatic gearbox, brake with hold, late coarse radar, losses, cut-ins,
wheel ticks, wanted gap standstill + headway v, seven noises. Dead times are compared with the driver's own less the radar's
latency, which no log shows; `--raw` with the driver's own.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

# one thread, and run as a folder: the package is benchmarks.outside_form
os.environ["OMP_NUM_THREADS"] = "1"
if not __package__:
    sys.path[0] = str(Path(__file__).resolve().parents[2])

import numpy as np

from benchmarks.outside_form import changes, optima
from benchmarks.outside_form.bounds import deviations
from canid import identify
from canid.mathematics.identification.identifiability import quotable
from tests.plants.outside_form import NOISES, World, draw, drive
from tests.plants.outside_form_sensors import seen

FIELDS = {"K": "K", "tau": "tau", "theta": "dead_time", "sum": "tau_plus_dead_time"}
CHANNELS = {"1": "headway_error", "2": "range_rate"}


class Number(NamedTuple):
    """One quotable number."""

    method: str
    name: str
    error: float
    z: float  # in its own standard deviations
    inside: bool
    bound: float  # least standard deviation
    world: World


def truth(world: World, name: str, raw: bool) -> float:
    """The true value of a parameter, as a log can show it."""
    i = int(name[-1]) - 1
    theta = world.theta[i] - (0.0 if raw else world.latency)
    return {"K": (world.K1, world.K2)[i], "tau": world.tau[i], "theta": theta, "sum": world.tau[i] + theta}[
        name[:-1]
    ]


def numbers(world: World, raw: bool) -> tuple[list[Number], list[str]]:
    """All quotable numbers of a drive, and its lines."""
    driven = drive(world)
    trace = seen(world, driven)
    least = deviations(world, driven, float(trace.t[0]), trace.learn)
    out, lines = [], []
    for method, found in identify(trace, select_orders=False, sliding=False).whole.items():
        lines += [] if found is None else [f"{method}: {line}" for line in found.lines]
        for which, channel in CHANNELS.items():
            for short, field in FIELDS.items():
                of = None if found is None else found.channels[channel]
                if of is None or not quotable(of, field):
                    continue
                iv, true = getattr(of, field), truth(world, short + which, raw)
                sd = (iv.high - iv.low) / 3.92
                error = iv.value - true
                bound = least.get(short + which, math.nan)
                out.append(
                    Number(method, short + which, error, error / sd, iv.low <= true <= iv.high, bound, world)
                )
    return out, lines


def table(every: list[Number], by: str = "") -> str:
    """Rows by method and parameter, and by a field of the world."""
    groups: dict[tuple[str, str, str], list[Number]] = defaultdict(list)
    for number in every:
        cause = {
            "": "",
            "noise": number.world.noise,
            "minutes": f"{number.world.minutes:g} min",
            "standstill": "s0 > 0" if number.world.standstill else "s0 = 0",
            "road": number.world.road,
        }[by]
        groups[number.method, number.name, cause].append(number)
    lines = [
        "| | n | held | above / below | mean z | sd z | error / bound |",
        "|---|---|---|---|---|---|---|",
    ]
    for (method, name, cause), of in sorted(groups.items()):
        z = np.array([x.z for x in of])
        held = np.array([x.inside for x in of])
        ratio = np.sqrt(np.mean([(x.error / x.bound) ** 2 for x in of]))
        lines.append(
            f"| {name} {method} {cause} | {len(of)} | {held.mean():.2f} | {int((~held & (z > 0)).sum())} / "
            f"{int((~held & (z < 0)).sum())} | {z.mean():+.2f} | {z.std():.2f} | {ratio:.2f} |"
        )
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks/outside_form", description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200, help="drives")
    parser.add_argument(
        "--minutes", type=float, nargs="+", default=[3.0, 10.0, 20.0], help="lengths, in turn"
    )
    parser.add_argument("--noise", choices=NOISES, help="one kind; else all but act_and_wait in turn")
    parser.add_argument("--first-seed", type=int, default=7000)
    parser.add_argument("--only", choices=("truth", "optima", "changes"))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--raw", action="store_true", help="dead times against the driver's own")
    parser.add_argument("--lines", action="store_true", help="print what each drive says")
    given = parser.parse_args()
    if given.only == "changes":
        print(f"\n{changes.table(given.runs, given.minutes, given.first_seed)}")
        return 0
    if given.only != "optima":
        every: list[Number] = []
        for run in range(given.runs):
            minutes = given.minutes[run % len(given.minutes)]
            world = draw(given.first_seed + run, minutes, given.noise)
            found, lines = numbers(world, given.raw)
            every += found
            missed = ", ".join(f"{x.name} {x.method} z {x.z:+.1f}" for x in found if not x.inside)
            print(
                f"{world.seed} {minutes:g} {world.noise} {world.road} s0 {world.standstill:.1f}: "
                f"{len(found)} quoted, {missed or 'all hold'}",
                flush=True,
            )
            if given.lines:
                print("  " + "\n  ".join(lines), flush=True)
        for by in ("", "standstill", "minutes", "noise", "road"):
            print(f"\n{table(every, by)}", flush=True)
    if given.only != "truth":
        print(f"\n{optima.table(given.data)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
