"""Logs of a planted fleet: each drive by its simulator, through its car's sensors and DBC, into a folder CAR/DRIVER."""

from __future__ import annotations

import json
import multiprocessing
import shutil
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import NamedTuple

from canid.io.logs import write_log
from canid.models.simulation import Car, DriverTruth, simulate
from canid.models.simulation import frames as frames_of_simulation
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.types import Frame
from tests.fleet.planted.planted_fleet import Drive, Fleet, truth
from tests.plants import measurement, plant_one, plant_two
from tests.plants.planted_drive import Plant

PLANTS: dict[str, Plant] = {"one": plant_one.plant, "two": plant_two.plant}
LEAN = measurement.LEAN


class Body(NamedTuple):
    """A car's mechanics, and how often its radar reports."""

    power: float  # m/s² per % of pedal
    lag: float  # s, of the engine
    drag: float  # 1/m
    radar_ms: int  # period of the radar's message


# within what the simulators draw for their own cars
BODIES = {
    "hatchback": Body(0.038, 0.30, 2.8e-4, 50),
    "estate": Body(0.042, 0.35, 2.6e-4, 50),
    "van": Body(0.036, 0.45, 3.2e-4, 100),
}


class Written(NamedTuple):
    """Where a fleet lies."""

    logs: Path  # CAR/DRIVER/NAME.blf and nothing else
    vehicles: dict[str, Path]  # car -> vehicle file
    map: Path  # of `canid fleet --vehicles`
    truth: Path  # outside of `logs`


def write(fleet: Fleet, folder: Path, processes: int = 2) -> Written:
    """Write logs, vehicle files and, outside of the logs' folder, the truth.

    Args:
        fleet: from `layout`.
        folder: must be new or empty.
        processes: that simulate at once.
    """
    logs = folder / "logs"
    logs.mkdir(parents=True)
    vehicles = {car: _vehicle_file(folder / "vehicles", car) for car in fleet.size.cars}
    jobs = [(one, str(logs / one.path), str(vehicles[one.car])) for one in fleet.drives]
    for _, path, _ in jobs:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
    if processes == 1:
        for job in jobs:
            _write(job)
    else:
        # not by fork: the caller may have threads
        with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
            _all(pool.map(_write, jobs, chunksize=4))
    where = folder / "truth.json"
    where.write_text(json.dumps(truth(fleet), indent=1), encoding="utf-8")
    return Written(logs, vehicles, _map(fleet, folder), where)


def frames(drive: Drive, vehicle: Vehicle) -> list[Frame]:
    """Simulate a drive and encode it."""
    body, of = BODIES[drive.car], drive.person
    effects = {name: dict(how) for name, how in drive.effects.items()}
    if drive.simulator == "canid":
        driver = DriverTruth(
            of.K1,
            of.tau,
            of.dead_time1,
            of.K2,
            of.tau,
            of.dead_time2,
            of.headway_desired,
            noise_sd=of.noise_sd,
        )
        simulation = simulate(
            drive.minutes,
            drive.seed,
            drive.profile,
            drive.noise,
            driver=driver,
            car=Car(power=body.power, lag=body.lag, drag=body.drag),
            hide={name: tuple(how.values()) for name, how in effects.items()},
        )
        return frames_of_simulation(simulation, vehicle)
    lags = {"first_lag": 0.3 * body.lag, "second_lag": 0.7 * body.lag}
    car = (
        {"power": body.power, "lag": body.lag, "drag": body.drag}
        if drive.simulator == "one"
        else {"gain": body.power, "drag": body.drag, **lags}
    )
    person = {
        "K1": of.K1,
        "K2": of.K2,
        "tau1": of.tau,
        "tau2": of.tau,
        "dead_time1": of.dead_time1,
        "dead_time2": of.dead_time2,
        "headway_desired": of.headway_desired,
        "noise_sd": of.noise_sd,
    }
    planted = PLANTS[drive.simulator](
        effects,
        seed=drive.seed,
        minutes=drive.minutes,
        noise=drive.noise,
        profile=drive.profile,
        **person,
        **car,
    )
    return measurement.frames(planted, vehicle)


def _write(job: tuple[Drive, str, str]) -> None:
    drive, path, vehicle = job
    write_log(path, frames(drive, _vehicle(vehicle)), drive.start_utc)


@cache
def _vehicle(path: str) -> Vehicle:
    return read_vehicle(path)


def _vehicle_file(folder: Path, car: str) -> Path:
    """A vehicle file and a DBC of the car's own: name, and period of the radar."""
    folder.mkdir(exist_ok=True)
    generic = (LEAN.parent / "../../dbc/generic.dbc").resolve()
    dbc = folder / f"{car}.dbc"
    shutil.copyfile(generic, dbc)
    cycle = 'BA_ "GenMsgCycleTime" BO_ 304 {};'
    text = dbc.read_text(encoding="utf-8")
    assert cycle.format(50) in text
    dbc.write_text(text.replace(cycle.format(50), cycle.format(BODIES[car].radar_ms)), encoding="utf-8")
    lean = LEAN.read_text(encoding="utf-8")
    own = lean.replace("../../dbc/generic.dbc", dbc.name).replace(
        "Lean car-following vehicle", f"Planted {car}"
    )
    assert own.count(car) == 2
    path = folder / f"{car}.toml"
    path.write_text(own, encoding="utf-8")
    return path


def _map(fleet: Fleet, folder: Path) -> Path:
    """The mapping file: drivers and cars are the folders', groups the drivers'."""
    groups = {one.name: one.group for one in fleet.drivers}
    lines = []
    for car, label in sorted({(one.car, one.label) for one in fleet.drives}):
        lines += ["[[drives]]", f'match = "{car}/{label}/*.blf"', f'group = "{groups[label]}"']
        lines += [f'vehicle = "vehicles/{car}.toml"', ""]
    path = folder / "map.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def _all(done: Iterable[None]) -> None:
    for _ in done:
        pass
