"""Clean drives of both outside simulators, radars of four kinds, 10 and 20 Hz: whatever is found is false."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.measurement_effects.drives import Drive, Quoted, drawn_drive, quoted, trace
from canid.analysis.drive import drive_parameters
from tests.plants.outside_drives import SIMULATORS
from tests.plants.sensor_effects import RADAR, hold, step

KINDS = ("good", "coarse", "noisy", "held")
# factor of the sensors' noise in a noisy one: 0.4 m, 0.2 m/s
NOISY = 4.0
# m and m/s, of a coarse radar; s between the reports of a held one
GAP_STEP, RATE_STEP, HELD_S = 0.5, 0.1, 0.1
# s between rows
RATES = (0.1, 0.05)
# of so many drives one is identified
IDENTIFIED = 3


class Clean(NamedTuple):
    """A drive, and what is said of it."""

    name: str
    findings: tuple[str, ...]  # each with its sentence
    quoted: tuple[Quoted, ...] | None  # None: not identified


def drive(seed: int) -> tuple[str, Drive]:
    """Draw a drive; simulator, radar and rate by the seed, all of them in turn."""
    simulator, kind = tuple(SIMULATORS)[seed % 2], KINDS[seed // 2 % 4]
    dt, rng = RATES[seed // 8 % 2], np.random.default_rng([seed, 49])
    of = drawn_drive(simulator, seed, dt=dt, noise=NOISY if kind == "noisy" else 1.0)
    if kind == "coarse":
        of = step(step(of, GAP_STEP, rng, role="gap"), RATE_STEP, rng, role="range_rate")
    if kind == "held":
        of = hold(of, HELD_S, rng, roles=RADAR)
    return f"{simulator} {seed}, {1.0 / dt:.0f} Hz, radar {kind}", of


def judged(seed: int) -> Clean:
    """Check a drive, and identify it where its turn comes."""
    name, of = drive(seed)
    read = trace(of)
    said = tuple(f"{each.name}: {each.says}" for each in read.findings)
    if seed // 16 % IDENTIFIED:
        return Clean(name, said, None)
    return Clean(name, said, quoted(drive_parameters.whole_drive(read), of.truth))


def listed(one: Clean) -> str:
    """A drive on one line."""
    misses = [str(each) for each in one.quoted or () if not each.covers]
    return "; ".join([f"{one.name}: {', '.join(one.findings) or 'no finding'}", *misses])
