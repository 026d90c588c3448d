"""Thousands of short logs that all differ: pieces of long drives as frames of 10 Hz, written by a few processes."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from canid.io.logs import write_log
from canid.signals.vehicle import encoder, read_vehicle
from canid.values.types import Frame
from tests.plants import measurement
from tests.plants.plant_one import plant

# s between two frames of a message
PERIOD_S = 0.1
ROLES = ("pedal", "speed", "gap", "range_rate", "lead_valid")
# min; one drive gives this many minutes of logs
DRIVE_MIN = 60.0
# times that a drive is measured, with other noise and cut at other times: what costs most is to simulate it
MEASURED = 5
# s; the lengths of the logs
SECONDS = (20.0, 30.0)
# drivers in whose folders the logs lie
DRIVERS = 100
NOISE_SD = {"pedal": 0.0, "speed": 0.02, "gap": 0.15, "range_rate": 0.08, "lead_valid": 0.0}


def vehicle_file(folder: Path) -> Path:
    """Write a vehicle whose logs hold three messages, each at 10 Hz."""
    generic = (measurement.LEAN.parent / "../../dbc/generic.dbc").resolve()
    text = generic.read_text(encoding="utf-8")
    for id_, ms in ((272, 20), (288, 20), (304, 50)):
        cycle = f'BA_ "GenMsgCycleTime" BO_ {id_} {ms};'
        assert cycle in text
        text = text.replace(cycle, f'BA_ "GenMsgCycleTime" BO_ {id_} {1000 * PERIOD_S:.0f};')
    (folder / "short.dbc").write_text(text, encoding="utf-8")
    lines = [line for line in measurement.LEAN.read_text(encoding="utf-8").splitlines() if _wanted(line)]
    path = folder / "short.toml"
    path.write_text("\n".join(lines).replace("../../dbc/generic.dbc", "short.dbc") + "\n", encoding="utf-8")
    return path


def _wanted(line: str) -> bool:
    role, is_signal, _ = line.partition(' = "')
    return not is_signal or role in ROLES or role in ("name", "task", "output") or "[" in line


def write(number: int, folder: Path, seed: int, processes: int = 2) -> Path:
    """Write logs into folders of drivers; what is there already is left.

    Args:
        number: of logs.
        folder: gets logs/DRIVER/NAME.blf and the vehicle file.
        seed: of all drives.
        processes: that write at once.

    Returns:
        the vehicle file.
    """
    vehicle = vehicle_file(folder)
    per_drive = MEASURED * int(DRIVE_MIN * 60.0 / SECONDS[1])
    jobs = [
        (seed + k, range(first, min(first + per_drive, number)), str(folder), str(vehicle))
        for k, first in enumerate(range(0, number, per_drive))
    ]
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        for _ in pool.map(_write, jobs):
            pass
    return vehicle


def name(k: int) -> str:
    """Path of a log below the folder of the logs.

    Example:
        >>> name(205)
        'driver 05/log 00205.blf'
    """
    return f"driver {k % DRIVERS:02d}/log {k:05d}.blf"


def _write(job: tuple[int, range, str, str]) -> None:
    seed, numbers, folder, file = job
    vehicle = read_vehicle(file)
    encode = encoder(vehicle)
    rng = np.random.default_rng([seed, 5])
    drive = plant({}, seed=seed, minutes=DRIVE_MIN, noise="ar1", profile="mixed")
    step = round(PERIOD_S / drive.dt)
    columns = {role: drive.columns[role][::step] for role in ROLES}
    of = {
        message.name: [role.role for role in vehicle.roles.values() if role.message == message.name]
        for message in vehicle.messages
    }
    start, total = 0, len(columns["speed"])
    for k in numbers:
        n = round(float(rng.uniform(*SECONDS)) / PERIOD_S)
        if start + n > total:
            start = int(rng.integers(round(SECONDS[0] / PERIOD_S)))
        path = Path(folder, "logs", name(k))
        if path.exists():
            start += n
            continue
        values = {
            role: x[start : start + n] + NOISE_SD[role] * rng.standard_normal(n)
            for role, x in columns.items()
        }
        start += n
        frames: list[Frame] = []
        for i in range(n):
            for j, (message, roles) in enumerate(of.items()):
                t = round((i * PERIOD_S + j * 1e-3) * 1e9) * 1e-9
                frames += encode(t, {role: float(values[role][i]) for role in roles}, {message: i})
        path.parent.mkdir(parents=True, exist_ok=True)
        write_log(path, frames, 1_772_431_200.0 + 60.0 * k)
