"""Which delays of a whole drive anybody could quote: canid next to a fit that knows all but the driver's numbers.

    python -m benchmarks delay_bound [--drives 10] [--seconds 600] [--first-seed 930000]

Drives of two simulators that are not canid's (tests/plants/outside_drives.py) in tables of 20 Hz. The oracle has the inputs
without noise at 100 Hz, the form of the answer and the correlation of the driver's noise: generalised least squares from the
truth on, Fisher's information with canid's box, and canid's rule of what may be quoted.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from scipy.signal import lfilter

import canid
from benchmarks.measurement_effects.drives import Drive, drawn_drive, identified, quoted
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt.information_bounds import precision
from canid.mathematics.identification.fopdt.reduced_basis import TAU_MIN, Box
from canid.mathematics.identification.identifiability import judge
from canid.values.types import QUOTED, Array, Interval
from tests.plants.outside_drives import SIMULATORS, STEP

ROW_S = 0.05
# s, correlation of each driver's noise; s, headway that is wanted, and where the answer to it bends, of the simulators
NOISE_S = {"Helly": 1.0, "acceleration": 0.7}
WANTED_S, BEND_S = {"Helly": 2.0, "acceleration": 1.5}, 4.0
BOX = Box(TAU_MIN, 3.0, 1.5)
CHANNELS = ("range_rate", "headway_error")
DELAYS = ("tau", "dead_time", "tau_plus_dead_time")


def answer(x: Array, tau: float, dead_time: float) -> Array:
    """Unit answer to an input at `STEP`, by the simulators' own rule, at any dead time."""
    k, keep = np.arange(len(x)), np.exp(-STEP / tau)
    middle = 0.5 * sum(np.interp(k - dead_time / STEP - late, k, x) for late in (0.0, 1.0))
    out: Array = lfilter([1.0 - keep], [1.0, -keep], middle)
    return out


def oracle(simulator: str, drive: Drive) -> dict[tuple[str, str], tuple[float, bool]]:
    """What may be quoted: standard deviation, and whether the 95 % interval holds the truth.

    Args:
        simulator: a name of `SIMULATORS`.
        drive: without noise of sensors, at `STEP`.
    """
    truth, every = drive.truth, round(ROW_S / STEP)
    headway = drive.columns["gap"] / drive.columns["speed"] - WANTED_S[simulator]
    bent = headway if simulator == "Helly" else BEND_S * np.tanh(headway / BEND_S)
    inputs, output = (drive.columns["range_rate"], bent), drive.columns[truth.output][::every]
    free = drive.t[::every] > 5.0
    if truth.output == "pedal":
        free &= (output > 0.0) & (output < 100.0)
    both, keep = free[1:] & free[:-1], np.exp(-ROW_S / NOISE_S[simulator])

    def white(p: Array) -> Array:
        made = p[6] + sum(p[i] * answer(x, p[2 + i], p[4 + i])[::every] for i, x in enumerate(inputs))
        left = output - made
        innovations: Array = (left[1:] - keep * left[:-1])[both]
        return innovations

    p = np.array([*(truth.of(name, what) for what in ("K", "tau", "dead_time") for name in CHANNELS), 0.0])
    p[6] = float(np.mean(output[free]))
    covariance = np.eye(len(p))
    small = np.array([1e-3 * p[0], 1e-3 * p[1], 2e-3, 2e-3, STEP, STEP, 1e-3])
    start, box = p.copy(), np.diag([*np.repeat([0.0, *precision(BOX)], 2), 0.0])
    # of a delay that nobody can know the box alone keeps the iteration; the bound is that at the truth
    for k in range(4):
        J = np.column_stack([(white(p - h) - white(p + h)) / (2.0 * h.sum()) for h in np.diag(small)])
        left = white(p)
        variance = float(np.mean(left**2))
        information = J.T @ J / variance + box
        covariance = np.linalg.inv(information) if k == 0 else covariance
        p = p + np.linalg.solve(information, J.T @ left / variance - box @ (p - start))
        p[2:6] = np.clip(p[2:6], 0.05, BOX.dead_time_max)
    out = {}
    for i, name in enumerate(CHANNELS):
        tau, late = 2 + i, 4 + i
        sd = dict(zip(("K", "tau", "dead_time"), np.sqrt(covariance.diagonal()[[i, tau, late]]), strict=True))
        sd["tau_plus_dead_time"] = np.sqrt(covariance[np.ix_([tau, late], [tau, late])].sum())
        value = {"K": p[i], "tau": p[tau], "dead_time": p[late], "tau_plus_dead_time": p[tau] + p[late]}
        half = NORMAL_QUANTILE * sd["K"]
        status = judge(Interval(p[i], p[i] - half, p[i] + half), *sd.values())
        for what in QUOTED[status]:
            error = abs(value[what] - truth.of(name, what))
            out[name, what] = float(sd[what]), bool(error <= NORMAL_QUANTILE * sd[what])
    return out


def main() -> None:
    """Print a line for each drive, and the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks delay_bound",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=10, help="of each simulator [10]")
    parser.add_argument("--seconds", type=float, default=600.0, help="of each drive [600]")
    parser.add_argument("--first-seed", type=int, default=930_000)
    args = parser.parse_args()
    print(f"canid {canid.__version__}")
    total = Counter[tuple[str, str, str, str]]()
    for simulator in SIMULATORS:
        for seed in range(args.first_seed, args.first_seed + args.drives):
            fine = drawn_drive(simulator, seed, dt=STEP, noise=0.0, seconds=args.seconds)
            possible = oracle(simulator, fine)
            drive = drawn_drive(simulator, seed, dt=ROW_S, seconds=args.seconds)
            known = {(one.channel, one.parameter): one for one in quoted(identified(drive), drive.truth)}
            held = {"oracle": {key: holds for key, (_, holds) in possible.items()}}
            held["canid"] = {key: one.covers for key, one in known.items()}
            for who, numbers in held.items():
                for (channel, what), holds in numbers.items():
                    total[simulator, channel, what, who] += 1
                    total[simulator, channel, what, f"{who} holds"] += holds
            said = [
                f"{channel} {what} " + "/".join(who for who in held if (channel, what) in held[who])
                for channel in CHANNELS
                for what in DELAYS
                if any((channel, what) in numbers for numbers in held.values())
            ]
            print(f"{simulator} {seed}: {'; '.join(said)}", flush=True)
    print("| simulator, number | drives | oracle quotes | holds | canid quotes | holds |")
    print("|---|---|---|---|---|---|")
    for simulator, channel, what in sorted({key[:3] for key in total}):
        cells = [
            total[simulator, channel, what, who] for who in ("oracle", "oracle holds", "canid", "canid holds")
        ]
        print(f"| {simulator}, {channel} {what} | {args.drives} | {' | '.join(map(str, cells))} |")


if __name__ == "__main__":
    main()
