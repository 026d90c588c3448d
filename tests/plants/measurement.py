"""A planted drive as canid gets it: frames, a log with a file of its truth, or directly the trace that the log gives.

`trace` is a short cut of `write` and `canid.read_trace`, with the same numbers: a benchmark of hundreds of logs has no
use for the files. Where the short cut does not hold (radar tracks, floats in the DBC) it goes the long way.
"""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from canid.io.logs import write_log
from canid.models.pipeline import pipeline
from canid.signals.samples import lead, learning_gate, own_speed
from canid.signals.samples.lead_readings import REPORTED
from canid.signals.samples.sampler import sampled_roles
from canid.signals.samples.trace_assembly import trace as as_trace
from canid.signals.vehicle import Vehicle, encoder, read_vehicle
from canid.values.types import Frame, Reading, Sample, Trace
from tests.pipeline_outputs import outputs
from tests.plants import fixed_lag_smoother, quantisation
from tests.plants.grid import Came, sampled
from tests.plants.planted_drive import Array, Planted
from tests.plants.sensors import Message, noise, sense

LEAN = Path(__file__).with_name("lean.toml")
# s since the epoch; Tuesday, 6 January 2026, 07:00 UTC: any fixed time, so that a seed gives the same bytes
START_UTC = 1767682800.0


@cache
def lean() -> Vehicle:
    """Read the vehicle whose logs hold what a diagnosis can use and no more."""
    return read_vehicle(LEAN)


def frames(planted: Planted, vehicle: Vehicle, seed: int | None = None) -> list[Frame]:
    """Encode a planted drive.

    Args:
        planted: from a planting simulator.
        vehicle: which messages, with what periods and resolutions.
        seed: of the sensors; None takes the drive's.

    Returns:
        Frames in the order of their times, the first one at t = 0. The same drive and seed give the same frames.
    """
    messages = sense(planted, vehicle, _seed(planted, seed))
    encode = encoder(vehicle)
    columns = [{role: x.tolist() for role, x in message.values.items()} for message in messages]
    streams = [[(t, i, k) for k, t in enumerate(message.t.tolist())] for i, message in enumerate(messages)]

    def made() -> Iterator[Frame]:
        for t, i, k in heapq.merge(*streams):
            values = {role: x[k] for role, x in columns[i].items()}
            yield from encode(t, values, {messages[i].of.name: k})

    return list(made())


def write(
    planted: Planted,
    path: str | Path,
    vehicle: Vehicle | None = None,
    seed: int | None = None,
) -> Path:
    """Write a planted drive as a log, and its truth next to it.

    Args:
        planted: from a planting simulator.
        path: of the log; the suffix chooses the format.
        vehicle: None takes the lean one.
        seed: of the sensors; None takes the drive's.

    Returns:
        The file of the truth: DRIVE.truth.json next to DRIVE.blf.
    """
    car, path = lean() if vehicle is None else vehicle, Path(path)
    write_log(path, frames(planted, car, seed), START_UTC)
    truth = path.with_name(path.name.removesuffix(path.suffix) + ".truth.json")
    truth.write_text(truth_text(planted, car, seed), encoding="utf-8")
    return truth


def truth_text(planted: Planted, vehicle: Vehicle, seed: int | None = None) -> str:
    """The truth as JSON, with the sensors' noise in it."""
    sensors = noise(_seed(planted, seed))._asdict()
    return json.dumps({"vehicle": vehicle.name, **planted.truth, "sensors": sensors}, indent=2) + "\n"


def trace(planted: Planted, vehicle: Vehicle | None = None, seed: int | None = None) -> Trace:
    """The trace that `canid.read_trace` gives for the log that `write` writes.

    Args:
        planted: from a planting simulator.
        vehicle: None takes the lean one.
        seed: of the sensors; None takes the drive's.

    Example:
        >>> from tests.plants.plant_one import plant
        >>> drive = trace(plant({}, seed=1, minutes=1, noise="ar1", profile="mixed"))
        >>> drive.dt, sorted(drive.signals)[:3]
        (0.1, ['accel', 'altitude', 'brake'])
    """
    car = lean() if vehicle is None else vehicle
    if not _short_cut(car):
        return _long_way(frames(planted, car, seed), car)
    return of_messages(sense(planted, car, _seed(planted, seed)), car)


def of_messages(messages: list[Message], car: Vehicle) -> Trace:
    """The trace of what the sensors say; for vehicles for which the short cut holds.

    Args:
        messages: from `sense`.
        car: whose messages they are.
    """
    every = np.sort(np.concatenate([message.t for message in messages]))
    came = {
        role: Came(t, value, t)
        for message in messages
        for role, (t, value) in quantisation.readings(message, car).items()
    }
    reported = {of: came[role] for role, of in REPORTED.items()}
    came |= reported | _lead(came, every, car)
    if "speed" in came:
        came["own_speed"] = came["speed"]
    t, columns = sampled(came, sampled_roles(car), every, pipeline.DT)
    columns = own_speed.range_rates(columns)
    rows = zip(t.tolist(), *(x.tolist() for x in columns.values()), strict=True)
    judged, samples = learning_gate.init(), []
    for at, *values in rows:
        judged, sample = learning_gate.step(
            judged, at, dict(zip(columns, values, strict=True)), car.driver, pipeline.DT
        )
        samples.append(sample)
    return as_trace(samples, car.driver, pipeline.DT)


def _seed(planted: Planted, seed: int | None) -> int:
    return int(planted.truth["seed"]) if seed is None else seed


def _short_cut(vehicle: Vehicle) -> bool:
    """Return whether this vehicle's logs are of the plain kind: one radar message, whole numbers."""
    radar = {
        vehicle.roles[role].message for role in ("gap", "range_rate", "lead_valid") if role in vehicle.roles
    }
    plain = all(quantisation.whole(role.how) for role in vehicle.roles.values())
    following = vehicle.driver.task == "car_following" and vehicle.lead.tracks is None
    return following and plain and len(radar) == 1


def _long_way(drive: list[Frame], vehicle: Vehicle) -> Trace:
    running = pipeline.build(vehicle, estimating=False)
    samples = [item for item in outputs(running, drive) if isinstance(item, Sample)]
    return as_trace(samples, vehicle.driver, pipeline.DT)


def _lead(came: dict[str, Came], every: Array, vehicle: Vehicle) -> dict[str, Came]:
    """What becomes of the radar's reports: the lead's smoothed motion, the target and whether there is one."""
    t, gap, _ = came["gap"]
    rate = came["range_rate"].value
    valid = came["lead_valid"].value if "lead_valid" in came else np.ones(len(t))
    settings = lead.stated_noise(vehicle)
    # a report is taken up with the first frame after it
    known = np.append(every, np.inf)[np.searchsorted(every, t, side="right")]
    own = _own_speeds(came.get("speed"), t, known, lead.settings_of(vehicle).speed)
    found = fixed_lag_smoother.smoothed(t, gap, rate, own, settings) if (valid == 1.0).all() else None
    if found is None:
        return _step_by_step(came, valid, known, vehicle)
    gaps, rates, speeds, done = found
    at, when = t[: len(done)], known[done]
    one = np.ones(len(at))
    columns = {"gap": gaps, "range_rate": rates, "lead_speed": speeds, "lead_valid": one, "target": one}
    there = np.isfinite(when)
    return {role: Came(at[there], x[there], when[there]) for role, x in columns.items()}


def _own_speeds(speed: Came | None, t: Array, known: Array, stale: float) -> Array:
    """(m,) m/s, own speed at each report by the readings that have come when it is taken up; NaN: not known."""
    state, out, n = own_speed.State(), np.full(len(t), np.nan), 0
    if speed is None:
        return out
    times, values, came = (x.tolist() for x in speed)
    for k, (at, when) in enumerate(zip(t.tolist(), known.tolist(), strict=True)):
        while n < len(times) and came[n] < when:
            state = own_speed.put(state, times[n], values[n])
            n += 1
        state, out[k] = own_speed.at(state, at, stale)
    return out


def _step_by_step(came: dict[str, Came], valid: Array, known: Array, vehicle: Vehicle) -> dict[str, Came]:
    """As `_lead`, by canid's own function: for drives on which the target changes or is lost."""
    settings = lead.settings_of(vehicle)._replace(valid=None)
    state = lead.init()
    out: dict[str, tuple[list[float], list[float], list[float]]] = {}
    speed = came.get("speed", Came(*np.zeros((3, 0))))
    own = list(zip(*(x.tolist() for x in speed), strict=True))
    n = 0
    t, gap, _ = came["gap"]
    reports = zip(*(x.tolist() for x in (t, gap, came["range_rate"].value, valid, known)), strict=True)
    for at, g, w, ok, when in reports:
        if when == np.inf:
            break
        # what comes before the report does, and between it and the frame that takes it up
        while n < len(own) and own[n][2] < when:
            state = state._replace(own=own_speed.put(state.own, *own[n][:2]))
            n += 1
        for role, value in (("gap", g), ("range_rate", w), ("lead_valid", ok)):
            state, _ = lead.step(state, Reading(at, role, value), settings)
        # any later reading takes the report up
        state, items = lead.step(state, Reading(when, "", 0.0), settings)
        for item in items:
            if isinstance(item, Reading) and item.role:
                times, values, knowns = out.setdefault(item.role, ([], [], []))
                if not times or item.t > times[-1]:
                    times.append(item.t)
                    values.append(item.value)
                    knowns.append(when)
    missing = ("gap", "range_rate", "lead_speed", "lead_valid", "target")
    return {role: Came(*(np.array(x) for x in out.get(role, ([], [], [])))) for role in missing}
