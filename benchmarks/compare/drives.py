"""Simulated drives of known drivers, through frames and a log, identified as `canid compare` does it."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from canid.analysis.comparison.drive import DriveEstimates, Side
from canid.analysis.comparison.result_estimates import of_identified
from canid.analysis.drive.drive_parameters import identify
from canid.analysis.drive.drive_reader import read_trace
from canid.io.logs import write_log
from canid.models.simulation import START_UTC, frames, simulate
from canid.models.simulation.driver import DriverTruth, draw_driver
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.text.numbers import role_unit

# min, and how often: from a town errand to a stretch of motorway
MINUTES = (2.0, 3.0, 5.0, 10.0, 20.0)
SHARES = (0.25, 0.25, 0.25, 0.15, 0.1)
# how the lead drives
PROFILES = ("mixed", "urban", "motorway")
# spectra of a driver's noise; each driver has one
NOISES = ("ar1", "ar4", "resonant", "mix")


@cache
def vehicle() -> Vehicle:
    """Return the built-in vehicle, read once."""
    return read_vehicle("generic")


def drawn(seed: int) -> tuple[DriverTruth, str]:
    """Draw a driver and the spectrum of the driver's noise."""
    rng = np.random.default_rng([seed, 17])
    return draw_driver(rng), NOISES[int(rng.integers(len(NOISES)))]


def estimates(driver: DriverTruth, noise: str, minutes: float, seed: int, profile: str) -> DriveEstimates:
    """Drive, record, read and identify, as the comparison takes it."""
    drive = simulate(minutes=minutes, seed=seed, profile=profile, noise=noise, driver=driver)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.blf"
        write_log(path, frames(drive, vehicle()), START_UTC)
        trace = read_trace(path, vehicle())
    found = identify(trace, select_orders=False, sliding=False, **vehicle().estimators)
    unit = role_unit(found.drive_summary.output)
    return of_identified(found, f"{profile} {seed}", vehicle().name, unit)


def length(rng: np.random.Generator) -> float:
    """Draw a drive's length, min."""
    return float(rng.choice(MINUTES, p=SHARES))


def side(label: str, *drives: DriveEstimates) -> Side:
    """Return a side of these drives."""
    return Side(label, drives)
