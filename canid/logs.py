"""A recorded log through the pipeline: outputs one by one, or whole columns."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from canid import clock, pipeline, state_file
from canid.desk import trace as desk
from canid.errors import CanidError, ConfigError, LogError
from canid.frames import Log, open_log
from canid.frames.columns import gather, select
from canid.saving import sealed
from canid.saving.knowledge import EVERY, go_on, keeping
from canid.types import (
    TASK_INPUTS,
    Array,
    Damage,
    Driver,
    Estimate,
    Event,
    Frame,
    Sample,
    Signal,
    Trace,
)
from canid.vehicle import Decoding, Vehicle, column_decoding, missing, read_vehicle

# frames of mapped ids: what is decoded together need not be put together; with 64 bytes of data each they are 21 MB
DECODED_AT_ONCE = 262_144


# frames of whatever id: numpy's overhead is spread over them
AT_ONCE = 65_536


class Health(NamedTuple):
    """What a log's reading has shown beside its numbers; each entry is a sentence."""

    frames: int
    duration: float  # s
    mapped: int  # roles that came at least once; radar tracks are one
    damage: Damage | None
    back_in_time: str  # "" or what was left out
    counters: dict[str, int]  # "gap: no target" -> n
    missing: tuple[str, ...]
    events: tuple[Event, ...]


_Step = tuple[pipeline.State, Frame, list[pipeline.Output]]


class Drive(NamedTuple):
    """All that came out of one log."""

    trace: Trace
    estimates: tuple[Estimate, ...]
    health: Health


def window(frames: Iterable[Frame], start: float, stop: float) -> Iterator[Frame]:
    """Frames of [start, stop] s; they keep their times.

    Example:
        >>> [f.t for f in window([Frame(t, 0, 1, b"") for t in (0.0, 1.0, 2.0)], 0.5, 1.5)]
        [1.0]
    """
    return (frame for frame in frames if start <= frame.t <= stop)


def as_vehicle(vehicle: Vehicle | str | Path) -> Vehicle:
    """Read the vehicle file, unless it was read before."""
    return vehicle if isinstance(vehicle, Vehicle) else read_vehicle(vehicle)


def run(
    log: Log,
    vehicle: Vehicle,
    *,
    estimating: bool = True,
    dt: float = pipeline.DT,
    start: float = 0.0,
    stop: float = float("inf"),
    keep: str | Path | None = None,
) -> Generator[_Step, None, None]:
    """Frame by frame: the state after it, the frame, and what came out.

    Args:
        log: from `open_log`.
        vehicle: from `read_vehicle`.
        estimating: run the estimators as well.
        dt: step of the grid, s.
        start: s, leave out what is earlier.
        stop: s, leave out what is later.
        keep: go on from the state in this file, and save there every 10 s and at the end.

    Raises:
        ConfigError: the state file cannot be read.
        OutputError: the state cannot be saved.
    """
    running = pipeline.build(vehicle, estimating=estimating, dt=dt)
    frames = window(log, start, stop)
    steps = _plain(running, frames) if keep is None else _kept(running, frames, keep, log, vehicle, dt)
    with closing(steps):
        for state, frame, out in steps:
            # the grid begins a little before the first frame: there is nothing there
            yield state, frame, [item for item in out if item.t >= start]


def _plain(running: pipeline.Pipeline, frames: Iterable[Frame]) -> Generator[_Step, None, None]:
    state = running.init()
    for frame in frames:
        state, out = running.step(state, frame)
        yield state, frame, out


def _kept(
    running: pipeline.Pipeline,
    frames: Iterator[Frame],
    path: str | Path,
    log: Log,
    vehicle: Vehicle,
    dt: float,
) -> Generator[_Step, None, None]:
    saved = state_file.read(path)
    state_file.try_out(path)
    first = next(frames, None)
    if first is None:
        return
    # only a log without a date is as old as this moment
    begins = log.start_utc if math.isfinite(log.start_utc) else time.time() - first.t
    keep, state, events = keeping(vehicle, running, dt), running.init(), []
    if saved is not None:
        state, event = go_on(running, keep, saved, begins + first.t, first.t)
        events.append(event)
    writable = saved is None or sealed.ours(saved)

    def save(t: float) -> None:
        known = pipeline.known(state)
        if known is not None and writable:
            state_file.write(path, keep.save(known, begins + t))

    due, frame = time.monotonic() + EVERY, first
    try:
        for frame in chain([first], frames):
            state, out = running.step(state, frame)
            yield state, frame, [*events, *out]
            events = []
            if time.monotonic() >= due:
                due = time.monotonic() + EVERY
                save(frame.t)
    finally:
        save(frame.t)


class Ran(Protocol):
    """What is looked at of a pipeline that ran, live or on columns."""

    @property
    def clock(self) -> clock.State:
        """Of the log."""

    @property
    def decode(self) -> Decoding:
        """What decoding has seen."""


def health(
    log: Log,
    vehicle: Vehicle,
    state: Ran | None,
    frames: int,
    last: float,
    events: Iterable[Event],
) -> Health:
    """Sum up what reading a log has shown."""
    if state is None:
        return Health(frames, last, 0, log.damage, "", {}, (), tuple(events))
    back = state.clock
    says = (
        f"{back.dropped} frames go back in time (by up to {back.worst:.3g} s) and were left out"
        if back.dropped
        else ""
    )
    never = tuple(missing(vehicle, state.decode))
    mapped = len(state.decode.seen)
    return Health(frames, last, mapped, log.damage, says, dict(state.decode.counters), never, tuple(events))


def trace(samples: list[Sample], driver: Driver, dt: float) -> Trace:
    """Samples as columns; rows that the log skips are NaN."""
    names = TASK_INPUTS[driver.task]
    roles = sorted({role for sample in samples for role in sample.signals})
    return Trace(
        dt=dt,
        t=np.array([s.t for s in samples]),
        output=np.array([s.output for s in samples]),
        inputs=np.array([s.inputs for s in samples]).reshape(len(samples), len(names)),
        input_names=names,
        gate=tuple(s.gate for s in samples),
        learn=np.array([s.learn for s in samples], dtype=bool),
        segment=np.array([s.segment for s in samples], dtype=np.int64),
        signals={role: np.array([s.signals.get(role, np.nan) for s in samples]) for role in roles},
    )


def read_drive(
    path: str | Path,
    vehicle: Vehicle | str | Path,
    *,
    dt: float = pipeline.DT,
    estimating: bool = True,
    start: float = 0.0,
    stop: float = float("inf"),
    log: Log | None = None,
    progress: Callable[[float], None] | None = None,
) -> Drive:
    """Run a whole log through the pipeline.

    Args:
        path: the log.
        vehicle: a vehicle file, its name, or what `read_vehicle` returned.
        dt: step of the grid, s.
        estimating: run the estimators as well.
        start: s, leave out what is earlier.
        stop: s, leave out what is later.
        log: the opened log, where the caller has it.
        progress: called now and then with the fraction that was read.

    Raises:
        ConfigError: the vehicle file is wrong, nothing in the log is mapped by it, or the part holds no frames.
        LogError: the log cannot be read.
    """
    car = as_vehicle(vehicle)
    log = open_log(path) if log is None else log
    read = _estimated if estimating else _on_columns
    drive = read(log, car, dt, start, stop, progress)
    if not drive.health.frames:
        raise nothing_read(path, start, stop, log.damage)
    if not drive.health.mapped:
        raise nothing_mapped(path, car, drive.health.frames)
    return drive


_Progress = Callable[[float], None] | None


def _on_columns(log: Log, car: Vehicle, dt: float, start: float, stop: float, progress: _Progress) -> Drive:
    """The desk path: the same samples and events as frame by frame."""
    init, step = desk.build(car, dt)
    state, frames, last = init(), 0, 0.0
    parts: list[desk.Samples] = []
    for chunk in gather(log.columns(), AT_ONCE):
        if start > 0.0 or stop < float("inf"):
            chunk = select(chunk, (chunk.t >= start) & (chunk.t <= stop))
        if not chunk.t.size:
            continue
        state, samples = step(state, chunk)
        parts.append(samples)
        frames += len(chunk.t)
        last = float(chunk.t[-1])
        if progress is not None:
            progress(log.progress)
    events = [event for part in parts for event in part.events if event.t >= start]
    shown = health(log, car, state if frames else None, frames, last, events)
    return Drive(desk.trace(parts, car, dt, start), (), shown)


def _estimated(log: Log, car: Vehicle, dt: float, start: float, stop: float, progress: _Progress) -> Drive:
    """Frame by frame, with the estimators."""
    samples: list[Sample] = []
    estimates: list[Estimate] = []
    events: list[Event] = []
    state, frames, last = None, 0, 0.0
    for after, frame, out in run(log, car, dt=dt, start=start, stop=stop):
        state = after
        frames += 1
        last = frame.t
        if progress is not None and out:
            progress(log.progress)
        for item in out:
            if isinstance(item, Sample):
                samples.append(item)
            elif isinstance(item, Estimate):
                estimates.append(item)
            elif isinstance(item, Event):
                events.append(item)
    shown = health(log, car, state, frames, last, events)
    return Drive(trace(samples, car.driver, dt), tuple(estimates), shown)


def nothing_read(path: str | Path, start: float, stop: float, damage: Damage | None) -> CanidError:
    """The error for a log, or a part of one, without any frame."""
    if damage:
        return LogError(f"{path}: {damage.says}")
    if start > 0 or stop < float("inf"):
        return ConfigError(
            f"{path}: no frames between {start:g} and {stop:g} s; look with `canid check {path}`"
        )
    return LogError(f"{path} holds no frames")


def nothing_mapped(path: str | Path, vehicle: Vehicle, frames: int) -> ConfigError:
    """The error for a log in which no mapped id occurs."""
    return ConfigError(
        f"{path}: none of its {frames:,} frames has an id that {vehicle.name} maps "
        f"(is it this vehicle's log? `canid check LOG` lists its ids)"
    )


def read_trace(path: str | Path, vehicle: Vehicle | str | Path, dt: float = pipeline.DT) -> Trace:
    """Read a log as uniform columns: signals decoded, lead chosen and smoothed, gates judged.

    Args:
        path: .blf, .asc, candump .log, .csv, .trc or .mf4.
        vehicle: a vehicle file, its name, or what `read_vehicle` returned.
        dt: step of the grid, s.

    Returns:
        a `Trace`; NaN = not measured.
    """
    return read_drive(path, vehicle, dt=dt, estimating=False).trace


def read_signals(path: str | Path, vehicle: Vehicle | str | Path) -> dict[str, Signal]:
    """Read the mapped signals as they came, in SI, unsampled.

    Args:
        path: the log.
        vehicle: a vehicle file, its name, or what `read_vehicle` returned.

    Returns:
        role -> `Signal(t, value)`, t in s since the log's first frame. Radar tracks are left out: `read_trace` has the lead.
    """
    car = as_vehicle(vehicle)
    init, step = column_decoding.column_decoder(car)
    state = init()
    times: dict[str, list[Array]] = {}
    values: dict[str, list[Array]] = {}
    for chunk in gather(open_log(path).columns(column_decoding.ids(car)), DECODED_AT_ONCE):
        state, said = step(state, chunk)
        of_rows = {id(row): chunk.t[row] for _, row, _ in said.roles}
        for role, row, value in said.roles:
            times.setdefault(role, []).append(of_rows[id(row)])
            values.setdefault(role, []).append(value)
    # signals of the same frames share their times
    joined = {tuple(map(id, parts)): np.concatenate(parts) for parts in times.values()}
    return {
        role: Signal(joined[tuple(map(id, times[role]))], np.concatenate(values[role]))
        for role in sorted(times)
    }


def replay(
    path: str | Path, vehicle: Vehicle | str | Path, *, state: str | Path | None = None
) -> Iterator[Estimate]:
    """Estimates from a log, one by one, as they would have come live.

    Args:
        path: the log.
        vehicle: a vehicle file, its name, or what `read_vehicle` returned.
        state: go on from what was learnt before and saved in this file; save there every 10 s and at the end.

    Yields:
        an `Estimate` of each estimator every half second of the log.
    """
    with closing(run(open_log(path), as_vehicle(vehicle), keep=state)) as steps:
        for _, _, out in steps:
            yield from (item for item in out if isinstance(item, Estimate))
