"""Steering by Chen & Ulsoy's driver, from frames to A and B: does every interval hold the truth, however long the drive."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.identification.table import Settings, Table, each
from canid.mathematics.estimators import armax_whole_drive
from canid.mathematics.identification.armax.armax_batch import Orders
from canid.models.pipeline import pipeline
from canid.models.simulation import Simulation, frames
from canid.models.simulation.car import Car
from canid.models.simulation.lane import Steering, keep_lane
from canid.signals.samples.trace_assembly import trace
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.frame_columns import columns_of
from canid.values.types import Sample, Trace

# Runs per length: an hour takes 15 s
MINUTES = ((1.0, 1), (2.0, 1), (10.0, 2), (60.0, 5))
NAMES = ("a1", "a2", "b1", "b2")
LATE = (0.0, 0.013, 0.048, 0.081)  # s, the driver's instants after the log's first frame, in turn
UNIT = 1.96


class Run(NamedTuple):
    """Of one drive."""

    held: np.ndarray  # (4,) bool
    error: np.ndarray  # (4,) in standard errors
    gain: bool  # K inside


def table(settings: Settings) -> list[Table]:
    """Share of drives whose interval holds a1, a2, b1, b2 and K."""
    rows: list[tuple[object, ...]] = []
    for minutes, share in MINUTES:
        some = settings.few(share) if share > 1 else settings
        done = [run for run in each(some, one, minutes) if run is not None]
        held = np.mean([(*run.held, run.gain) for run in done], axis=0)
        bias = np.mean([run.error for run in done], axis=0)
        rows.append((f"{minutes:g} min", len(done), *held, float(np.max(np.abs(bias)))))
    return [
        Table(
            "Steering, ARMAX(2,2,1) at 10 Hz from frames at 50 Hz: share of 95 % intervals that hold the truth",
            ("drive", "runs", *NAMES, "K", "largest mean error / sd"),
            rows,
            (
                f"The driver decides {', '.join(f'{1e3 * late:.0f}' for late in LATE)} ms after canid's tenths of a "
                "second, in turn; wheel angle in steps of 0.1°, lateral offset in steps of 5 mm, "
                "each message on a clock of its own.",
            ),
        )
    ]


def one(seed: int, minutes: float) -> Run | None:
    """Drive, record, identify."""
    car = read_vehicle("generic_lane")
    simulated = _later(keep_lane(minutes + 0.2, seed, Steering(), Car(), {}, ()), LATE[seed % len(LATE)])
    found = armax_whole_drive.identify(seen(simulated, car), Orders())
    if found is None:
        return None
    truth = simulated.truth["armax"]
    sd, fit = found.model.standard_errors, found.model
    true = np.array([*truth["A"][1:], *truth["B"]["lateral_offset"]])
    error = np.array([*fit.A[1:], *fit.B[0]]) - true
    z = error / np.array([*sd.A[1:], *sd.B[0]])
    K, (gain,) = simulated.truth["channels"]["lateral_offset"]["K"], found.channels.values()
    return Run(np.abs(z) <= UNIT, z, bool(gain.K.low <= K <= gain.K.high))


def seen(simulated: Simulation, car: Vehicle) -> Trace:
    """Encode and sample a drive, as canid does with a log."""
    built = pipeline.build(car, estimating=False)
    _, out = built.step(built.init(), columns_of(frames(simulated, car)))
    return trace([x for _, x in out if isinstance(x, Sample)], car.driver, pipeline.DT)


def _later(simulated: Simulation, late: float) -> Simulation:
    """Let the log begin so much before one of the driver's instants [s]."""
    skip = round((0.1 - late) / simulated.dt) % round(0.1 / simulated.dt)
    columns = {name: column[skip:] for name, column in simulated.columns.items()}
    columns["t"] = columns["t"] - columns["t"][0]
    return simulated._replace(columns=columns)
