"""Simulate the logs of this folder, reproducible to the byte: python replay_logs/make.py [FOLDER]."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.io.logs import write_log
from canid.models.simulation import START_UTC, Simulation, frames, simulate, truth_text
from canid.models.simulation.model_drive import drawn_lead, drive
from canid.signals.vehicle import read_vehicle
from canid.values.identified_model import DRIVER, IdentifiedModel, NoiseLaw
from canid.values.types import Interval


class Drive(NamedTuple):
    """A drive, and the vehicle whose messages carry it."""

    vehicle: str
    drive: Simulation


def drives() -> dict[str, Drive]:
    """Return log name -> drive."""
    return {
        "following_mixed.blf": Drive("generic", simulate(3, seed=1, profile="mixed")),
        "following_urban.blf": Drive("generic", simulate(3, seed=6, profile="urban", noise="mix")),
        "following_motorway.asc": Drive("generic", simulate(1.5, seed=4, profile="motorway")),
        # The radar loses the lead twice (3 s and 12 s), and another vehicle cuts in after 100 s.
        "following_lost_lead.blf": Drive(
            "generic", simulate(3, seed=3, lost=[(40.0, 43.0), (130.0, 142.0)], cut_in=100.0)
        ),
        "lane_keeping.blf": Drive("generic_lane", simulate(2, seed=1, profile="lane")),
        # One for each vehicle whose measured drives are not part of canid.
        "toyota_rav4_2017_simulated.blf": Drive(
            "toyota_rav4_2017", simulate(0.75, seed=4, profile="motorway")
        ),
        "openacc_simulated.blf": Drive("openacc", track_drive(3, seed=2, smoothing=SAVITZKY_GOLAY_S)),
        "openacc_asta_simulated.blf": Drive("openacc_asta", track_drive(3, seed=5, smoothing=CENTRAL_S)),
    }


# s over which the acceleration is derived from the speed: half-widths of the filters that docs/evidence/measured.md states
SAVITZKY_GOLAY_S, CENTRAL_S = 0.5, 0.1


def track_drive(minutes: float, seed: int, smoothing: float) -> Simulation:
    """Drive as on a proving ground: what the driver asks for is an acceleration, and no pedal is recorded.

    Args:
        minutes: length.
        seed: of lead and noise.
        smoothing: s; the recorded acceleration is the slope of a line through the speeds of 10 Hz this far to both
            sides, as it was derived from the measured speeds.
    """
    person = (0.1, 0.06, 0.45, 0.6, 0.5, 0.6, 0.5, 1.6, 0.0, 0.0)
    model = IdentifiedModel(
        output="accel",
        form="time_headway",
        driver=dict(zip(DRIVER, person, strict=True)),
        covariance=np.zeros((len(DRIVER), len(DRIVER))),
        names=DRIVER,
        effects={},
        noise=NoiseLaw(0.1, (math.exp(-0.1),), 0.03),
        car=None,
        driven={"speed": Interval(20.0, 10.0, 30.0), "headway": Interval(1.6, 1.2, 2.0)},
    )
    made = drive(model, drawn_lead(model, "mixed", minutes, seed), seed)
    step, half = round(0.1 / made.dt), round(smoothing / 0.1)
    speed = made.columns["speed"]
    ends = np.pad(speed, half * step, mode="edge")
    lags = np.arange(-half, half + 1)
    weights = lags / (0.1 * float((lags**2).sum()))
    slope = sum(
        w * ends[(half + k) * step : (half + k) * step + speed.size]
        for w, k in zip(weights, lags, strict=True)
    )
    return made._replace(columns={**made.columns, "accel": slope}, truth={"profile": "mixed", **made.truth})


def main(folder: Path) -> None:
    """Write all logs, each with a file of its true parameters."""
    for name, (vehicle_name, simulation) in drives().items():
        vehicle = read_vehicle(vehicle_name)
        path = folder / name
        path.unlink(missing_ok=True)
        write_log(path, frames(simulation, vehicle), START_UTC)
        path.with_suffix(".truth.json").write_text(truth_text(simulation, vehicle), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
