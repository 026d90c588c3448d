"""One drive of the benchmark: SUMO → frames → .blf → identify, diagnose, and the same driver behind another lead."""

from __future__ import annotations

import json
import math
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import canid
from benchmarks import other_drive
from benchmarks.sumo.lead_speeds import lead_speeds
from benchmarks.sumo.sumo_drive import Driven, drive
from benchmarks.sumo.sumo_drivers import driver
from canid.io.logs import write_log
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import pedal
from canid.models.diagnosis.prepared_drive import Prepared
from canid.models.simulation import START_UTC, frames
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.findings import Report
from canid.values.types import NAN, Interval, Trace

VEHICLE = Path(__file__).with_name("vehicle.toml")
# effects of a driver who changes over time: wrong on every driver here
OF_TIME = {"gain_change", "gain_drift", "delay_drift", "headway_drift", "attention_gap", "periodic_task"}


class Outcome(NamedTuple):
    """What came of one drive; errors in closed loop by model: [gap, speed]."""

    seed: int
    model: str
    action_step: float  # s; 0.05: every step
    leads: str
    # [value, low, high] and the model's own derivative; range rate 1/s, headway m/s² per s
    range_rate_gain: list[float]
    range_rate_derivative: float
    headway_gain: list[float]
    headway_derivative: float
    verdict: str
    named: list[str]
    surrogates: list[str]
    stated_gain: list[float]  # of the error variance in open loop
    achieved_gain: float  # on the second drive
    fit_percent: float
    errors: dict[str, list[float]]  # on the second drive
    identify_s: float  # CPU
    diagnose_s: float


def run(seed: int, minutes: float, data: Path) -> Outcome:
    """Run the drive of a seed."""
    of = driver(seed)
    names, *leads = lead_speeds(seed, minutes, data)
    vehicle = read_vehicle(VEHICLE)
    first, second = (drive(of, lead) for lead in leads)
    trace, other = (recorded(one, vehicle) for one in (first, second))
    begin = time.process_time()
    identified = canid.identify(trace, select_orders=False)
    identify_s = time.process_time() - begin
    begin = time.process_time()
    report = canid.diagnose(trace, rivals=True)
    diagnose_s = time.process_time() - begin
    errors, achieved = judged(trace, other, report)
    K = {name: channel.K for name, channel in identified.channels.items()}
    speed = float(np.median(first.simulation.columns["speed"]))
    drivers = [one for one in report.findings if one.where == "driver"]
    return Outcome(
        seed, of.model, of.action_step, names,
        list(K.get("range_rate", Interval())), first.derivatives.range_rate,
        list(K.get("headway_error", Interval())), first.derivatives.gap * speed,
        report.verdict.value,
        [one.effect for one in drivers if not one.surrogate], [one.effect for one in drivers if one.surrogate],
        list(report.gain), achieved, report.baseline.fit_percent,
        {name: list(error) for name, error in errors.items()}, identify_s, diagnose_s,
    )  # fmt: skip


def recorded(of: Driven, vehicle: Vehicle) -> Trace:
    """Record a drive as a .blf with the radar's noise, and read it."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "drive.blf")
        write_log(log, frames(of.simulation, vehicle), START_UTC)
        return canid.read_trace(log, vehicle)


def judged(trace: Trace, other: Trace, report: Report) -> tuple[other_drive.Errors, float]:
    """Errors of all models behind the other lead, and what the chosen one gains there in open loop."""
    here, there = other_drive.prepared(trace), other_drive.prepared(other)
    if here is None or there is None:
        return {}, NAN
    chosen = other_drive.chosen(here, report)
    models = {other_drive.BASELINE: here.fitted, other_drive.CHOSEN: chosen}
    extended = bool(chosen.model.effects)
    gained = 1 - _variance(chosen, there) / _variance(here.fitted, there) if extended else NAN
    return other_drive.with_recommended(other_drive.carried(here, there, models), report), gained


def _variance(model: FittedDriver, there: Prepared) -> float:
    output = there.data.output
    return float(np.var((output.y - pedal(model.model, there.data, model.q))[output.usable]))


def line(of: Outcome) -> str:
    """As a line of JSON; null where nothing is known."""
    return json.dumps(_known(of._asdict()), allow_nan=False)


def stored(path: Path | None) -> list[Outcome]:
    """Read the lines of a file; []: there is none."""
    if path is None or not path.exists():
        return []
    rows = (json.loads(text) for text in path.read_text(encoding="utf-8").splitlines() if text.strip())
    return [Outcome(**{name: _numbers(value) for name, value in row.items()}) for row in rows]


def _known(x: Any) -> Any:
    if isinstance(x, float):
        return x if math.isfinite(x) else None
    if isinstance(x, dict):
        return {name: _known(value) for name, value in x.items()}
    return [_known(value) for value in x] if isinstance(x, list) else x


def _numbers(x: Any) -> Any:
    if x is None:
        return NAN
    return [_numbers(value) for value in x] if isinstance(x, list) else x
