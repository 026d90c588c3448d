"""Cars without an acceleration column: false causes on clean drives, and planted causes found, with and without the column.

    python -m benchmarks acceleration_slope [--clean 60] [--drives 12] [--minutes 8] [--first-seed 43000]

Drives of an outside simulator (tests/plants/outside_cars.py). Clean ones go through cars that answer at once or lag by 0.1
to 0.5 s, rough and smooth pedals, a noise of the speed of 0.01 to 0.1 m/s or steps of that size, and 10, 20 and 50 Hz. A
planted cause counts as found if it is among the findings on the vehicle.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from canid.models.diagnosis import masks
from canid.models.diagnosis.vehicle import vehicle_block
from canid.values.types import Trace
from tests.plants.outside_cars import Car, PedalMotion, Sensors, car_drive

LAGS_S = (0.0, 0.1, 0.3, 0.5)
# an engine that takes the pedal's value as it is, and one that takes it from a bus
PERIODS_S = (0.01, 0.05)
RATES_HZ = (10.0, 20.0, 50.0)
# noise and step, m/s
SPEEDS = ((0.01, 0.0), (0.03, 0.0), (0.1, 0.0), (0.0, 0.01), (0.01, 0.05), (0.0, 0.1))
# strength m/s² per %, level %, drag 1/m; the last one's motor brakes by 3.3 m/s² at a released pedal
CARS = ((0.04, 12.0, 5e-4), (0.06, 25.0, 4e-4), (0.12, 30.0, 4e-4))
MOTIONS = ((1.0, 3.0), (2.0, 1.5), (2.0, 0.5), (4.0, 1.0))
PLANTED = (
    ("turbo_lag", Car(low_load_lag=0.6)),
    ("turbo_lag", Car(low_load_lag=1.0)),
    ("pedal_map", Car(curvature=0.3)),
    ("pedal_map", Car(curvature=0.5)),
    ("actuator_lag", Car(second_lag=0.3)),
    ("actuator_lag", Car(second_lag=0.6)),
)


def named(trace: Trace) -> tuple[str, ...]:
    """The causes that are named in the car."""
    found = vehicle_block.diagnose_vehicle(trace, masks.recognise(trace)[0])
    return tuple(finding.effect for finding in found.findings)


def clean(k: int, seed: int, seconds: float) -> Trace:
    """The k-th clean drive: lags, pedals and speeds in turn, the rest drawn."""
    rng = np.random.default_rng([seed, 1])
    strength, level, drag = CARS[rng.integers(len(CARS))]
    sd, correlation = MOTIONS[rng.integers(len(MOTIONS))]
    noise, step = SPEEDS[k % len(SPEEDS)]
    car = Car(LAGS_S[k % len(LAGS_S)], strength, level, drag, period=float(rng.choice(PERIODS_S)))
    motion = PedalMotion(sd, correlation, rough=k // 2 % 2 == 0)
    return car_drive(seed, car, motion, Sensors(float(rng.choice(RATES_HZ)), noise, step), seconds)


def planted(k: int, seed: int, car: Car, seconds: float, *, accel: bool) -> Trace:
    """The k-th drive with a cause: of each, a third answers at once besides it."""
    sensors = Sensors(RATES_HZ[k % 3], SPEEDS[k % 2][0], accel=accel)
    return car_drive(
        seed, car._replace(lag=(0.0, 0.2, 0.3)[k % 3]), PedalMotion(3.0, rough=k % 2 == 0), sensors, seconds
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--clean", type=int, default=60, help="clean drives [60]")
    parser.add_argument("--drives", type=int, default=12, help="drives of each planted cause [12]")
    parser.add_argument("--minutes", type=float, default=8.0, help="of each drive [8]")
    parser.add_argument("--first-seed", type=int, default=43_000, help="of the clean drives [43000]")
    args = parser.parse_args()
    seconds, wrong = 60.0 * args.minutes, 0
    for k in range(args.clean):
        causes = named(clean(k, args.first_seed + k, seconds))
        wrong += bool(causes)
        if causes:
            print(f"clean drive {args.first_seed + k}: {', '.join(causes)}", flush=True)
    print(f"clean: a cause is named in the car of {wrong} of {args.clean}", flush=True)
    print(f"{'planted':<34}{'from the speed':>15}{'recorded':>10}{'others':>8}")
    for cause, car in PLANTED:
        found, others = {False: 0, True: 0}, 0
        for k in range(args.drives):
            for accel in found:
                causes = named(planted(k, args.first_seed + 1000 + k, car, seconds, accel=accel))
                found[accel] += cause in causes
                others += bool(set(causes) - {cause})
        strength = max(car.low_load_lag, car.second_lag, car.curvature)
        print(f"{cause + f' {strength:g}':<34}{found[False]:>15}{found[True]:>10}{others:>8}", flush=True)


if __name__ == "__main__":
    main()
