"""Coverage of the intervals of K, τ, θ on simulated drives, through the whole pipeline.

    python -m benchmarks truth [--drives 12] [--minutes 5]

Each drive has another driver, profile, noise model and seed; encoded through dbc/generic.dbc with the radar's noise
and quantisation, decoded, smoothed, gated and estimated as on a bus.
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import canid
from canid.models.pipeline import pipeline
from canid.models.simulation import NOISES, frames, simulate
from canid.signals.vehicle import read_vehicle
from canid.values.types import Estimate, Identifiable, Status
from tests.pipeline_outputs import outputs

PROFILES = ("mixed", "urban", "motorway")
# s between two estimates that are counted: windows of 60 s overlap, so the shares vary more than their number says
SPACING_S = 10.0


def drive(job: tuple[int, float, str, str]) -> list[tuple[str, str, str, float, float, float, float, float]]:
    """Rows (estimator, channel, parameter, t, value, low, high, truth) of one drive."""
    seed, minutes, profile, noise = job
    vehicle = read_vehicle("generic")
    simulation = simulate(minutes=minutes, seed=seed, profile=profile, noise=noise)
    truth = simulation.truth["channels"]
    rows, due = [], defaultdict(float)
    for item in outputs(pipeline.build(vehicle), frames(simulation, vehicle)):
        if not isinstance(item, Estimate) or item.status is not Status.OK or item.t < due[item.estimator]:
            continue
        due[item.estimator] = item.t + SPACING_S
        for name, ch in item.channels.items():
            of = truth[name] | {"tau_plus_dead_time": truth[name]["tau"] + truth[name]["dead_time"]}
            for what in ("K", "tau", "dead_time", "tau_plus_dead_time"):
                iv = getattr(ch, what)
                if ch.status is not Identifiable.NOT and iv.value == iv.value:
                    rows.append((item.estimator, name, what, item.t, iv.value, iv.low, iv.high, of[what]))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks truth", description=__doc__.splitlines()[0])
    parser.add_argument("--drives", type=int, default=12)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--first-seed", type=int, default=1000)
    args = parser.parse_args()
    kinds = [noise for noise in NOISES if noise != "none"]
    jobs = [
        (args.first_seed + k, args.minutes, PROFILES[k % len(PROFILES)], kinds[k % len(kinds)])
        for k in range(args.drives)
    ]
    with ProcessPoolExecutor(2) as pool:
        per_drive = list(pool.map(drive, jobs))
    print(
        f"canid {canid.__version__}: {args.drives} drives of {args.minutes:g} min, noise {', '.join(kinds)}"
    )
    print(
        f"{'by':6} {'answer to':14} {'parameter':19} {'estimates':>9} {'inside':>7} {'median error':>13} {'half width':>11}"
    )
    groups = defaultdict(list)
    for rows in per_drive:
        for by, name, what, _, value, low, high, true in rows:
            groups[by, name, what].append((low <= true <= high, value - true, (high - low) / 2))
    for (by, name, what), cells in sorted(groups.items()):
        inside, error, half = (np.array(x, dtype=float) for x in zip(*cells, strict=True))
        print(
            f"{by:6} {name:14} {what:19} {len(cells):9} {100 * inside.mean():6.0f} % "
            f"{np.median(error):+13.3f} {np.median(half):11.3f}"
        )
    for job, rows in zip(jobs, per_drive, strict=True):
        for by in ("armax", "fopdt"):
            mine = [low <= true <= high for b, *_, low, high, true in rows if b == by]
            share = f"{100 * np.mean(mine):.0f} %" if mine else "no estimate"
            print(f"  seed {job[0]} {job[2]:9} {job[3]:9} {by}: {share} of {len(mine)}")


if __name__ == "__main__":
    main()
