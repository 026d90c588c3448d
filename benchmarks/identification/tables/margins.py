"""Do the intervals of the stability margins and of the string peak hold: a pedal through frames and log, an acceleration."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.identification import acceleration
from benchmarks.identification.gain_drives import PUBLISHED
from benchmarks.identification.noise_models import NOISE_MODELS
from benchmarks.identification.table import Settings, Table, each
from canid.analysis.drive.drive_reader import read_trace
from canid.io.logs import write_log
from canid.mathematics.estimators.fopdt import FOPDT, FopdtSettings
from canid.mathematics.systems import following_loop
from canid.mathematics.systems.following_loop import FollowingLoop
from canid.mathematics.systems.identified_loop import identified_loop
from canid.models.simulation import START_UTC, frames, simulate
from canid.signals.vehicle import read_vehicle
from canid.values.types import TASK_INPUTS, Interval, LearnGate, OutputFilter, Trace

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
    channels, car = simulation.truth["channels"], simulation.truth["car"]
    first, second = channels["headway_error"], channels["range_rate"]
    K, tau, late = (np.array([[first[name], second[name]]]) for name in ("K", "tau", "dead_time"))
    speed = float(np.median(trace.signals["speed"][trace.learn]))
    cars = (np.array([x]) for x in (car["power"], car["lag"], 2.0 * car["drag"] * speed))
    return _compared(trace, "pedal", FollowingLoop(K, tau, late, 1.0, 1.0, *cars))


def run_acceleration(seed: int) -> Run:
    """The same of a driver whose output is the acceleration; simulated apart from canid."""
    made = acceleration.drive(seed, MINUTES, NOISE_MODELS[3])
    n = len(made.acceleration)
    trace = Trace(
        dt=acceleration.DT,
        t=np.arange(n) * acceleration.DT,
        output=acceleration.published(made, PUBLISHED, seed),
        inputs=made.inputs,
        input_names=TASK_INPUTS["car_following"],
        gate=(LearnGate.OPEN,) * n,
        learn=np.full(n, True),
        segment=np.zeros(n, dtype=np.int64),
        signals={"speed": made.speed, "headway": made.inputs[:, 0] + acceleration.HEADWAY},
        output_filter=OutputFilter(PUBLISHED.kind, PUBLISHED.width),  # type: ignore[arg-type]
    )
    one, two = made.channels
    K, tau, late = (np.array([[a, b]]) for a, b in zip(one, two, strict=True))
    return _compared(trace, "accel", FollowingLoop(K, tau, late, 1.0, 1.0))


def _compared(trace: Trace, output: str, truth: FollowingLoop) -> Run:
    """Identify, and compare with the truth at the same speed and headway."""
    fopdt = FOPDT.identify(trace, FopdtSettings(output_filter=trace.output_filter, output=output))
    loop = identified_loop(fopdt.model, fopdt.channels, trace, output)
    if loop.says:
        return Run(loop.says, (), ())
    of = following_loop.margins(truth._replace(speed=loop.speed, headway=loop.headway))
    return Run(
        "",
        tuple(getattr(loop, name) for name, *_ in QUANTITIES),
        tuple(float(getattr(of, name)[0]) for _, name, *_ in QUANTITIES),
    )


def table(settings: Settings) -> list[Table]:
    """Print coverage, half-width and bias for each kind of traffic."""
    few = settings.few(5)
    rows: list[tuple[object, ...]] = []
    for name, done in (
        *((f"pedal, {profile}", each(few, run, profile)) for profile in PROFILES),
        ("acceleration", each(few, run_acceleration)),
    ):
        known = [one for one in done if not one.says]
        for i, (_, _, quantity, unit) in enumerate(QUANTITIES):
            found, true = [one.found[i] for one in known], np.array([one.true[i] for one in known])
            low, high, value = (
                np.array([getattr(iv, end) for iv in found]) for end in ("low", "high", "value")
            )
            if not np.isfinite(value).any():
                continue
            held = (low - 1e-9 <= true) & (true <= high + 1e-9)
            rows.append(
                (
                    name,
                    f"{quantity} ({unit})" if unit else quantity,
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
                "output",
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
                "driver's gains and delays and the car are identified from the same drive. Acceleration: another simulator, "
                "Savitzky-Golay 1.1 s, noise OU 1 s and white of 0.25 m/s², drivers drawn.",
            ),
        )
    ]
