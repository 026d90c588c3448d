"""Do the intervals of the stability margins and of the string peak hold: canid's own simulator, through frames and log."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.identification.table import Settings, Table, each
from canid.drive_reader import read_trace
from canid.estimators.fopdt import FOPDT, FopdtSettings
from canid.logs import write_log
from canid.simulation import START_UTC, frames, simulate
from canid.systems import following_loop
from canid.systems.following_loop import FollowingLoop
from canid.systems.identified_loop import identified_loop
from canid.types import Interval
from canid.vehicle import read_vehicle

MINUTES = 6.0
PROFILES = ("mixed", "urban")
# what `IdentifiedLoop` calls it, what `LoopMargins` does, the column, its unit
QUANTITIES = (
    ("phase_margin", "phase_margin_deg", "phase margin", "°"),
    ("gain_margin", "gain_margin", "gain margin", ""),
    ("delay_margin", "delay_margin_s", "delay margin", "s"),
    ("modulus_margin", "modulus_margin", "modulus margin", ""),
    ("string_peak", "string_peak", "largest \\|v/v_lead\\|", ""),
)


class Run(NamedTuple):
    """One drive."""

    says: str
    found: tuple[Interval, ...]  # in the order of QUANTITIES
    true: tuple[float, ...]


def run(seed: int, profile: str) -> Run:
    """Simulate a drive, identify it, and compare with the driver who drove."""
    vehicle, simulation = read_vehicle("generic"), simulate(minutes=MINUTES, seed=seed, profile=profile)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.blf"
        write_log(path, frames(simulation, vehicle), START_UTC)
        trace = read_trace(path, vehicle)
    fopdt = FOPDT.identify(trace, FopdtSettings(output_filter=trace.output_filter))
    loop = identified_loop(fopdt.model, fopdt.channels, trace)
    if loop.says:
        return Run(loop.says, (), ())
    truth = simulation.truth
    channels, car = truth["channels"], truth["car"]
    first, second = channels["headway_error"], channels["range_rate"]
    K, tau, late = (np.array([[first[name], second[name]]]) for name in ("K", "tau", "dead_time"))
    cars = (np.array([x]) for x in (car["power"], car["lag"], 2.0 * car["drag"] * loop.speed))
    of = following_loop.margins(FollowingLoop(K, tau, late, loop.speed, loop.headway, *cars))
    return Run(
        "",
        tuple(getattr(loop, name) for name, *_ in QUANTITIES),
        tuple(float(getattr(of, name)[0]) for _, name, *_ in QUANTITIES),
    )


def table(settings: Settings) -> list[Table]:
    """Print coverage, half-width and bias for each kind of traffic."""
    few = settings.few(5)
    rows: list[tuple[object, ...]] = []
    for profile in PROFILES:
        done = each(few, run, profile)
        known = [one for one in done if not one.says]
        for i, (_, _, name, unit) in enumerate(QUANTITIES):
            found, true = [one.found[i] for one in known], np.array([one.true[i] for one in known])
            low, high, value = (
                np.array([getattr(iv, end) for iv in found]) for end in ("low", "high", "value")
            )
            held = (low - 1e-9 <= true) & (true <= high + 1e-9)
            rows.append(
                (
                    profile,
                    f"{name} ({unit})" if unit else name,
                    f"{len(known)} of {len(done)}",
                    float(np.median(true)),
                    float(held.mean()),
                    float(np.median(0.5 * (high - low))),
                    float(np.median(value - true)),
                )
            )
    return [
        Table(
            f"Margins of the identified driver with the car, {MINUTES:.0f} min of car following in closed loop",
            (
                "lead",
                "quantity",
                "given in",
                "truth (median)",
                "95 % intervals hold it",
                "half-width",
                "median error",
            ),
            rows,
            (
                "canid's simulator, driver drawn by the seed, pedal noise AR(1) of 1.5 %, through frames and log; the "
                "driver's gains and delays and the car are identified from the same drive.",
            ),
        )
    ]
