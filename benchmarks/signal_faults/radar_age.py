"""The age of a radar's reports (signals/signal_checks/own_motion.py): does its interval hold, when is it a finding?

    python -m benchmarks radar_age [--drives 80] [--minutes 5 10] [--first-seed 1600300]

Drivers of random gains, lags and own motion follow random leads, with a dead time of 0.2 to 0.8 s and without one; radars of
four noises report 0, 0.2 or 0.5 s late. `stated`: an age comes out; `held`: its 95 % interval holds the truth, of these;
`found`: drives with a finding (false where the truth is 0 s).
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from canid.signals.signal_checks import own_motion
from canid.signals.signal_checks.blocks import COLUMNS, GAP, RANGE_RATE, SPEED, Block
from canid.values.types import Array

STEP_S, DT = 0.05, 0.1  # s, of the integration and between samples
DEAD_TIMES = {"none": (0.0, 0.0), "0.2 to 0.8 s": (0.2, 0.8)}
# m/s, of range rate and speed
NOISES = ((0.02, 0.005), (0.05, 0.02), (0.1, 0.02), (0.2, 0.05))
LATE_S = (0.0, 0.2, 0.5)
HEADWAY_S = 2.0


def smooth(n: int, seconds: Array, rng: np.random.Generator) -> Array:
    """(n, drives): white noise through two lags each, with standard deviation 1."""
    keep = np.exp(-STEP_S / seconds)
    x, y = np.zeros(len(seconds)), np.zeros(len(seconds))
    out = np.empty((n + 2000, len(seconds)))
    for k, e in enumerate(rng.standard_normal(out.shape)):
        x = keep * x + (1.0 - keep) * e
        y = keep * y + (1.0 - keep) * x
        out[k] = y
    standard: Array = out[2000:] / out[2000:].std(axis=0)
    return standard


def following(
    seed: int, drives: int, minutes: float, dead_times: tuple[float, float]
) -> tuple[Array, Array, Array]:
    """Gap, range rate and speed without noise, (n, drives) each; drives that swing by more than 25 m/s are left out."""
    rng, n = np.random.default_rng(seed), round(minutes * 60.0 / STEP_S)
    lead = 20.0 + rng.uniform(1.5, 4.0, drives) * smooth(n, rng.choice([3.0, 6.0, 10.0], drives), rng)
    own = rng.uniform(0.1, 0.5, drives) * smooth(n, rng.choice([0.5, 1.0, 2.0], drives), rng)
    k_rate, k_gap = rng.uniform(0.2, 0.8, drives), rng.uniform(0.03, 0.15, drives)
    tau, late = rng.uniform(0.2, 0.7, drives), np.rint(rng.uniform(*dead_times, drives) / STEP_S).astype(int)
    v, gap, a = lead[0].copy(), HEADWAY_S * lead[0], np.zeros(drives)
    line, drive = np.zeros((40, drives)), np.arange(drives)
    gaps, speeds = np.empty((n, drives)), np.empty((n, drives))
    for k in range(n):
        gaps[k], speeds[k] = gap, v
        line[k % 40] = k_gap * (gap - HEADWAY_S * v) + k_rate * (lead[k] - v)
        a += STEP_S / tau * (line[(k - late) % 40, drive] + own[k] - a)
        gap = gap + STEP_S * (lead[k] - v)
        v = v + STEP_S * a
    kept = np.abs(lead - speeds).max(axis=0) < 25.0
    every = round(DT / STEP_S)
    return gaps[::every, kept], (lead - speeds)[::every, kept], speeds[::every, kept]


def judged(gap: Array, rate: Array, speed: Array) -> own_motion.State:
    """Run the check over a drive, (n,) each."""
    state, per_block = own_motion.init(), round(1.0 / DT)
    for first in range(0, len(gap) - per_block + 1, per_block):
        values = np.full((per_block, len(COLUMNS)), np.nan)
        rows = slice(first, first + per_block)
        values[:, GAP], values[:, RANGE_RATE], values[:, SPEED] = gap[rows], rate[rows], speed[rows]
        mean = tuple(values.mean(axis=0).tolist())
        t = (first + per_block - 1) * DT
        state, _ = own_motion.step(state, Block(t, DT, values, mean, mean, True, True))
    return state


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=80)
    parser.add_argument("--minutes", type=float, nargs="*", default=[5.0, 10.0])
    parser.add_argument("--first-seed", type=int, default=1600300)
    arguments = parser.parse_args()
    print("dead time | late, s | drives | stated | held | found")
    for name, dead_times in DEAD_TIMES.items():
        drives = [
            following(arguments.first_seed + k, arguments.drives, m, dead_times)
            for k, m in enumerate(arguments.minutes)
        ]
        for late in LATE_S:
            counts = np.zeros(4, dtype=int)
            rng = np.random.default_rng(arguments.first_seed)
            for gap, rate, speed in drives:
                for j in range(gap.shape[1]):
                    for rate_sd, speed_sd in NOISES:
                        shift = round(late / DT)
                        reported = [
                            np.concatenate([np.full(shift, x[0, j]), x[:, j]])[: len(x)] for x in (gap, rate)
                        ]
                        state = judged(
                            reported[0],
                            reported[1] + rate_sd * rng.standard_normal(len(rate)),
                            speed[:, j] + speed_sd * rng.standard_normal(len(speed)),
                        )
                        age, wide = own_motion.interval(state)
                        found = state.found is not None and state.found.name == "radar_latency"
                        counts += [1, wide == wide, abs(age - late) <= wide, found]
            print(f"{name} | {late} | " + " | ".join(map(str, counts.tolist())), flush=True)


if __name__ == "__main__":
    main()
