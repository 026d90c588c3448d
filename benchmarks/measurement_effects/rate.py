"""Signals that are slow, held, joined by lines, coarse, late or off their clock: what is quoted, and what is found.

    python -m benchmarks signal_rates [--drives 6] [--minutes 8] [--only "pedal at 2 Hz"]

Drives of a loop that is none of canid's, measured by instruments of their own rate, step and lag. `held`: quoted intervals
of 95 % that hold the truth; `quoted`: of K, tau and dead time (or their sum) of both inputs.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from benchmarks.measurement_effects.sampled_loop import ROLES, Instrument, Truth, drive, recorded, write
from canid.analysis.drive_results import identify
from canid.values.types import QUOTED

# drivers, in turn
TRUTHS = (Truth(), Truth(4.0, 5.0, 0.5, 0.35))
RADAR = ("gap", "range_rate")
SLOW = Instrument(hz=2.0)


def every(how: Instrument, roles: tuple[str, ...] = ROLES) -> dict[str, Instrument]:
    """One instrument for several roles."""
    return dict.fromkeys(roles, how)


CASES: Mapping[str, Mapping[str, Instrument]] = {
    "10 Hz": {},
    "10 Hz, noise": {"gap": Instrument(noise=0.15), "range_rate": Instrument(noise=0.08)},
    "20 Hz": every(Instrument(hz=20.0)),
    "6 Hz": every(Instrument(hz=6.0)),
    "5 Hz": every(Instrument(hz=5.0)),
    "5 Hz, radar between": every(Instrument(hz=5.0, start=0.1), RADAR) | {"pedal": Instrument(hz=5.0)},
    "4 Hz": every(Instrument(hz=4.0)),
    "3.3 Hz": every(Instrument(hz=3.3)),
    "2 Hz": every(SLOW),
    "2 Hz, held": every(SLOW._replace(kind="hold")),
    "pedal at 4 Hz": {"pedal": Instrument(hz=4.0)},
    "pedal at 3.3 Hz": {"pedal": Instrument(hz=3.3)},
    "pedal at 2 Hz": {"pedal": SLOW},
    "pedal at 2 Hz, lines": {"pedal": SLOW._replace(kind="line")},
    "speed at 2 Hz": {"speed": SLOW},
    "radar at 4 Hz, lines": every(Instrument(hz=4.0, kind="line"), RADAR),
    "radar at 2 Hz, lines": every(SLOW._replace(kind="line"), RADAR),
    "radar at 1 Hz, lines": every(Instrument(hz=1.0, kind="line"), RADAR),
    "radar at 2 Hz, held": every(SLOW._replace(kind="hold"), RADAR),
    "steps 0.5 m, 0.25 m/s": {"gap": Instrument(step=0.5), "range_rate": Instrument(step=0.25)},
    "steps 1 m, 0.5 m/s": {"gap": Instrument(step=1.0), "range_rate": Instrument(step=0.5)},
    "the same with noise": {
        "gap": Instrument(step=1.0, noise=0.2),
        "range_rate": Instrument(step=0.5, noise=0.1),
    },
    "range rate late by 0.1 s": {"range_rate": Instrument(lag=0.1)},
    "range rate late by 0.4 s": {"range_rate": Instrument(lag=0.4)},
    "gap late by 0.2 s": {"gap": Instrument(lag=0.2)},
    "gap late by 0.4 s": {"gap": Instrument(lag=0.4)},
    "pedal 300 ppm off its clock": {"pedal": Instrument(drift=3e-4)},
}


def outcome(path: Path, truth: Truth) -> tuple[int, int, set[str]]:
    """Quoted parameters, those whose interval holds the truth, and findings."""
    result = identify(path, select_orders=False, sliding=False)
    quoted = held = 0
    for name, channel in result.channels.items():
        right = {
            "K": getattr(truth, name),
            "tau": truth.tau,
            "dead_time": truth.theta,
            "tau_plus_dead_time": truth.tau + truth.theta,
        }
        for parameter in QUOTED[channel.status]:
            interval = getattr(channel, parameter)
            quoted += 1
            held += interval.low <= right[parameter] <= interval.high
    return quoted, held, {finding.name for finding in result.findings}


def main() -> None:
    """Print a row per case."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=6)
    parser.add_argument("--minutes", type=float, default=8.0)
    parser.add_argument("--only", default="", help="name of one case")
    args = parser.parse_args()
    numbers = range(args.drives)
    fine = [
        drive(np.random.default_rng([k, 5]), 60.0 * args.minutes, TRUTHS[k % len(TRUTHS)]) for k in numbers
    ]
    print(f"{'signals':28} {'quoted':>6} {'held':>5}  drives with a finding, of {args.drives}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.csv"
        for name, instruments in CASES.items():
            if args.only not in ("", name):
                continue
            quoted, held, found = 0, 0, Counter[str]()
            for k in numbers:
                write(path, recorded(fine[k], instruments, np.random.default_rng([k, 6])))
                some, right, names = outcome(path, TRUTHS[k % len(TRUTHS)])
                quoted, held = quoted + some, held + right
                found.update(names)
            says = ", ".join(f"`{each}` {n}" for each, n in sorted(found.items()))
            print(f"{name:28} {quoted:6} {held:5}  {says}", flush=True)


if __name__ == "__main__":
    main()
