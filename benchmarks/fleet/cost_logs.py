"""Logs for the benchmark of cost: drives of 3 min, and one long log among short ones."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

from canid.io.logs import write_log
from tests.plants import measurement
from tests.plants.plant_one import plant

NOISES, PROFILES = ("ar1", "ar4", "mix"), ("mixed", "urban", "motorway")


class Logs(NamedTuple):
    """Where they lie, and their vehicle file."""

    folder: Path
    vehicle: Path


def drives(number: int, folder: Path, minutes: float = 3.0) -> Logs:
    """Write drives of one length."""
    return _written([(f"driver {k % 6}/drive {k:02d}.blf", minutes, k) for k in range(number)], folder)


def long_and_short(long_min: float, number: int, folder: Path) -> Logs:
    """Write a long log, the last one by name, and `number` logs of 1 min."""
    short = [(f"driver {k % 6}/drive {k:02d}.blf", 1.0, 100 + k) for k in range(number)]
    return _written([*short, ("driver 9/long.blf", long_min, 99)], folder)


def _written(wanted: list[tuple[str, float, int]], folder: Path) -> Logs:
    jobs = [(str(folder / name), minutes, seed) for name, minutes, seed in wanted]
    jobs = [job for job in jobs if not Path(job[0]).exists()]
    for path, _, _ in jobs:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
    if jobs:
        with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
            for _ in pool.map(_write, jobs):
                pass
    return Logs(folder, measurement.LEAN)


def _write(job: tuple[str, float, int]) -> None:
    path, minutes, seed = job
    noise, profile = NOISES[seed % len(NOISES)], PROFILES[seed // len(NOISES) % len(PROFILES)]
    drive = plant({}, seed=seed, minutes=minutes, noise=noise, profile=profile)
    write_log(path, measurement.frames(drive, measurement.lean()), 1_772_431_200.0 + 86_400.0 * seed)
