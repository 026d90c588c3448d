"""Chunks of frames → the samples of a trace, with everything that goes on from chunk to chunk in one state."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid import clock, gate, lead
from canid.desk import grid, lead_readings, session_time
from canid.pipeline import sampled_roles
from canid.types import TASK_INPUTS, Array, Columns, Event, Gate, Trace
from canid.vehicle import Decoding, Vehicle
from canid.vehicle.column_decoding import RoleReadings, column_decoder


class State(NamedTuple):
    """Everything that the next chunk's meaning depends on."""

    clock: clock.State
    decode: Decoding
    lead: lead.State
    grid: grid.State
    gate: gate.State


class Samples(NamedTuple):
    """Samples as columns, and what happened meanwhile."""

    t: Array  # (n,) s
    output: Array  # (n,)
    inputs: Array  # (n, m)
    gate: tuple[Gate, ...]  # (n,)
    learn: npt.NDArray[np.bool_]  # (n,)
    segment: npt.NDArray[np.int64]  # (n,)
    signals: dict[str, Array]  # role -> (n,)
    events: tuple[Event, ...]


Step = Callable[[State, Columns], tuple[State, Samples]]


def build(vehicle: Vehicle, dt: float) -> tuple[Callable[[], State], Step]:
    """Compose a vehicle's desk path, as `pipeline.build` composes its live one.

    Returns:
        `init() -> state` and `step(state, chunk) -> (state, samples)`.
    """
    decode_init, decode = column_decoder(vehicle)
    roles = sampled_roles(vehicle)
    driver = vehicle.driver
    following = driver.task == "car_following"
    settings = lead.settings_of(vehicle)
    names = TASK_INPUTS[driver.task]

    def init() -> State:
        return State(clock.init(), decode_init(), lead.init(), grid.State(), gate.init())

    def step(state: State, chunk: Columns) -> tuple[State, Samples]:
        now, timed = session_time.step(state.clock, chunk)
        frames = timed.frames
        decoded, said = decode(state.decode, frames)
        follow, sampling = state.lead, state.grid
        passed: tuple[RoleReadings, ...] = said.roles
        events = [*timed.events, *said.events]
        if following:
            follow, led = lead_readings.step(follow, said, frames, settings)
            passed = led.passed
            events += led.events
            for role, made in led.made.items():
                sampling = grid.put(sampling, role, made.t, made.value, sampling.frames + made.row)
        for role, (row, value) in _by_role(passed).items():
            sampling = grid.put(sampling, role, frames.t[row], value, sampling.frames + row)
        sampling, given = grid.take(sampling, timed.latest, dt, roles)
        judged, samples = state.gate, []
        for points in given:
            judged, more = _gated(judged, points)
            samples.append(more)
        events.sort(key=lambda item: item[0])
        after = State(now, decoded, follow, sampling, judged)
        return after, _joined(samples, tuple(event for _, event in events))

    def _gated(state: gate.State, points: grid.Points) -> tuple[gate.State, Samples]:
        rows = zip(*(column.tolist() for column in points.values.values()), strict=True)
        headway, gates, learn, segment, inputs, output = [], [], [], [], [], []
        for t, row in zip(points.t.tolist(), rows, strict=True):
            state, sample = gate.step(state, t, dict(zip(points.values, row, strict=True)), driver, dt)
            headway.append(sample.signals["headway"])
            gates.append(sample.gate)
            learn.append(sample.learn)
            segment.append(sample.segment)
            inputs.append(sample.inputs)
            output.append(sample.output)
        signals = {**points.values, "headway": np.array(headway)}
        columns = np.array(inputs).reshape(-1, len(names)), tuple(gates), np.array(learn, bool)
        return state, Samples(points.t, np.array(output), *columns, np.array(segment, np.int64), signals, ())

    def _joined(parts: list[Samples], events: tuple[Event, ...]) -> Samples:
        return Samples(*joined(parts, names), events)

    return init, step


def _by_role(passed: tuple[RoleReadings, ...]) -> dict[str, tuple[npt.NDArray[np.int64], Array]]:
    """Row and value of each role; one that several messages carry, in the order of the frames."""
    parts: dict[str, list[RoleReadings]] = {}
    for readings in passed:
        parts.setdefault(readings.role, []).append(readings)
    out = {}
    for role, of in parts.items():
        row, value = np.concatenate([r.row for r in of]), np.concatenate([r.value for r in of])
        order = np.argsort(row, kind="stable") if len(of) > 1 else slice(None)
        out[role] = row[order], value[order]
    return out


_Joined = tuple[
    Array, Array, Array, tuple[Gate, ...], npt.NDArray[np.bool_], npt.NDArray[np.int64], dict[str, Array]
]


def joined(parts: list[Samples], names: tuple[str, ...]) -> _Joined:
    """Put samples together."""
    roles = sorted(parts[0].signals) if parts else []
    return (
        np.concatenate([np.zeros(0), *(part.t for part in parts)]),
        np.concatenate([np.zeros(0), *(part.output for part in parts)]),
        np.concatenate([np.zeros((0, len(names))), *(part.inputs for part in parts)]),
        tuple(of for part in parts for of in part.gate),
        np.concatenate([np.zeros(0, bool), *(part.learn for part in parts)]),
        np.concatenate([np.zeros(0, np.int64), *(part.segment for part in parts)]),
        {role: np.concatenate([part.signals[role] for part in parts]) for role in roles},
    )


def trace(parts: list[Samples], vehicle: Vehicle, dt: float, start: float) -> Trace:
    """All samples from `start` s on as a trace: the grid begins a little before the first frame."""
    names = TASK_INPUTS[vehicle.driver.task]
    t, output, inputs, gates, learn, segment, signals = joined([part for part in parts if part.t.size], names)
    from_ = int(np.searchsorted(t, start))
    return Trace(
        dt=dt,
        t=t[from_:],
        output=output[from_:],
        inputs=inputs[from_:],
        input_names=names,
        gate=gates[from_:],
        learn=learn[from_:],
        segment=segment[from_:],
        signals={role: value[from_:] for role, value in signals.items()} if len(t) > from_ else {},
    )
