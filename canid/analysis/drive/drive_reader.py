"""A recorded log through the pipeline: outputs one by one, or whole columns."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.io.files import state_file
from canid.io.logs import Log, open_log
from canid.mathematics.estimators.status import ESTIMATE_EVERY_S
from canid.models.pipeline import pipeline
from canid.models.saving import checksum
from canid.models.saving.saved_state import SAVE_INTERVAL_S, resume, saver
from canid.signals.samples import session_clock, trace_assembly
from canid.signals.signal_checks import signal_checks
from canid.signals.vehicle import Vehicle, decoder, mapped_ids, missing, on_buses, read_vehicle
from canid.values.errors import CanidError, ConfigError, DamagedLogError, LogError
from canid.values.frame_columns import gather, select
from canid.values.presentation import Tabled
from canid.values.types import (
    Array,
    Columns,
    Damage,
    Estimate,
    Event,
    Flag,
    Sample,
    Signal,
    SignalReport,
    Trace,
)
from canid.values.window import WHOLE, Window

# frames of mapped ids: what is decoded together need not be put together; with 64 bytes of data each they are 21 MB
FRAMES_PER_DECODED_CHUNK = 262_144

# frames of whatever id: numpy's overhead is spread over them
FRAMES_PER_CHUNK = 65_536

# frames between two updates of a display: 2 s of a full 500 kbit/s bus
FRAMES_PER_ESTIMATED_CHUNK = 4096


class Health(NamedTuple):
    """What reading a log has shown apart from its numbers; each entry is a sentence."""

    frames: int
    duration: float  # s
    mapped: int  # roles that came at least once; radar tracks are one
    damage: Damage | None
    back_in_time: str  # "" or what was left out
    counters: dict[str, int]  # "gap: no target" -> n
    missing: tuple[str, ...]
    events: tuple[Event, ...]
    remarks: tuple[str, ...] = ()  # how the log was read, where the reader had to decide

    @property
    def said(self) -> tuple[str, ...]:
        """What is missing, and how the log was read."""
        return (*self.missing, *self.remarks)


class Step(NamedTuple):
    """One chunk of a log through the pipeline."""

    state: pipeline.State  # after it
    chunk: Columns
    out: list[pipeline.Output]


class _Drive(NamedTuple):
    trace: Trace
    estimates: tuple[Estimate, ...]
    health: Health

    def __repr__(self) -> str:
        return f"Drive({self.trace!r}, {len(self.estimates)} estimates, {self.health.frames:,} frames)"


class Drive(_Drive, Tabled):
    """All that came out of one log."""

    __slots__ = ()


def as_vehicle(vehicle: Vehicle | str | Path, log: Log | None = None) -> Vehicle:
    """Read the vehicle file, unless it was read before; on the buses of a log, where there is one."""
    car = vehicle if isinstance(vehicle, Vehicle) else read_vehicle(vehicle)
    if log is None:
        return car
    log.know(car.messages)
    return on_buses(car, log.buses)


def run(
    log: Log,
    vehicle: Vehicle,
    *,
    estimating: bool = True,
    dt: float = pipeline.DT,
    within: Window = WHOLE,
    keep: str | Path | None = None,
    span: float | Callable[[float], float] = float("inf"),
) -> Generator[Step, None, None]:
    """Run a log through the pipeline, chunk by chunk.

    Args:
        log: from `open_log`.
        vehicle: from `read_vehicle`.
        estimating: run the estimators as well.
        dt: step of the grid, s.
        within: the part of the log.
        keep: go on from the state in this file, and save there every 10 s and at the end.
        span: s of the log that a chunk may last; or a function of the time of its first frame, asked for each chunk.

    Raises:
        ConfigError: the state file cannot be read.
        OutputError: the state cannot be saved.
    """
    running = pipeline.build(vehicle, estimating=estimating, dt=dt)
    chunks = _chunks(log, within, FRAMES_PER_ESTIMATED_CHUNK if estimating else FRAMES_PER_CHUNK, span)
    steps = _plain(running, chunks) if keep is None else _kept(running, chunks, keep, log, vehicle, dt)
    with closing(steps):
        for state, chunk, out in steps:
            # the grid begins a little before the first frame: there is nothing there
            yield Step(state, chunk, [item for item in out if item.t >= within.begin])


def _chunks(log: Log, within: Window, size: int, span: float | Callable[[float], float]) -> Iterator[Columns]:
    """The log's frames that are wanted, about `size` at once and at most `span` s of them."""
    # a part is that of times that go on; of the whole the pipeline finds a counter's wraps, and reports them
    frames = log.columns() if within.is_whole else session_clock.unwrapped(log.columns())
    for chunk in gather(frames, size):
        chunk = within.columns(chunk)
        n = len(chunk.t)
        if not n:
            continue
        if callable(span):
            yield from _pieces(chunk, span)
            continue
        cuts = set(range(0, max(n - size // 2, 1), size))
        if span < float("inf"):
            part = np.floor(np.maximum.accumulate(chunk.t) / span)
            cuts |= set((np.flatnonzero(np.diff(part)) + 1).tolist())
        ends = sorted(cuts)
        for begin, end in zip(ends, [*ends[1:], n], strict=True):
            yield chunk if end - begin == n else select(chunk, np.arange(begin, end))


def _pieces(chunk: Columns, span: Callable[[float], float]) -> Iterator[Columns]:
    """The frames of `chunk`, cut where `span` says so just then."""
    latest = np.maximum.accumulate(chunk.t)
    begin, n = 0, len(chunk.t)
    while begin < n:
        first = float(latest[begin])
        end = max(int(np.searchsorted(latest, first + span(first), "left")), begin + 1)
        yield chunk if end - begin == n else select(chunk, np.arange(begin, end))
        begin = end


def _plain(running: pipeline.Pipeline, chunks: Iterable[Columns]) -> Generator[Step, None, None]:
    state = running.init()
    for chunk in chunks:
        state, out = running.step(state, chunk)
        yield Step(state, chunk, [item for _, item in out])


def _kept(
    running: pipeline.Pipeline,
    chunks: Iterator[Columns],
    path: str | Path,
    log: Log,
    vehicle: Vehicle,
    dt: float,
) -> Generator[Step, None, None]:
    saved = state_file.read(path)
    state_file.check_writable(path)
    first = next(chunks, None)
    if first is None:
        return
    t = float(first.t[0])
    # a log without a date is taken to begin now
    begins = log.start_utc if math.isfinite(log.start_utc) else time.time() - t
    saving, state, events = saver(vehicle, running, dt), running.init(), []
    if saved is not None:
        state, event = resume(running, saving, saved, begins + t, t)
        events.append(event)
    writable = saved is None or checksum.ours(saved)

    def save() -> None:
        known = pipeline.known(state)
        if known is not None and writable:
            state_file.write(path, saving.save(known, begins + t))

    due = time.monotonic() + SAVE_INTERVAL_S
    try:
        for chunk in chain([first], chunks):
            state, out = running.step(state, chunk)
            t = float(chunk.t[-1])
            yield Step(state, chunk, [*events, *(item for _, item in out)])
            events = []
            if time.monotonic() >= due:
                due = time.monotonic() + SAVE_INTERVAL_S
                save()
    finally:
        save()


def health(
    log: Log,
    vehicle: Vehicle,
    state: pipeline.State | None,
    frames: int,
    last: float,
    events: Sequence[Event],
) -> Health:
    """Sum up what reading a log has shown."""
    if state is None:
        return Health(frames, last, 0, log.damage, "", {}, (), tuple(events), log.remarks)
    decoding = state.sampler.decoding
    says = session_clock.back_in_time(state.sampler.clock)
    steps = tuple(event.says for event in events if event.what == "clock_step")
    never = tuple(missing(vehicle, decoding))
    return Health(
        frames,
        float(session_clock.session_time(state.sampler.clock, last)),
        len(decoding.seen),
        log.damage,
        says,
        dict(decoding.counters),
        never,
        tuple(events),
        (*log.remarks, *steps),
    )


def read_drive(
    path: str | Path,
    vehicle: Vehicle | str | Path,
    *,
    dt: float = pipeline.DT,
    estimating: bool = True,
    start: float = -math.inf,
    stop: float = math.inf,
    log: Log | None = None,
    progress: Callable[[float], None] | None = None,
) -> Drive:
    """Run a whole log through the pipeline.

    Args:
        path: the log.
        vehicle: a vehicle file, its name, or what `read_vehicle` returned.
        dt: step of the grid, s.
        estimating: run the estimators as well.
        start: s since the log's first frame, leave out what is earlier; -inf: nothing.
        stop: s, leave out what is later.
        log: the opened log, where the caller has it.
        progress: called now and then with the fraction that was read.

    Raises:
        ConfigError: the vehicle file is wrong, nothing in the log is mapped by it, or the part holds no frames.
        LogError: the log cannot be read.
    """
    car = as_vehicle(vehicle)
    log = open_log(path) if log is None else log
    car = as_vehicle(car, log)
    parts: list[Trace] = []
    reports: list[SignalReport] = []
    estimates: list[Estimate] = []
    events: list[Event] = []
    within = Window(start, stop)
    state, frames, last = None, 0, 0.0
    for after, chunk, out in run(log, car, estimating=estimating, dt=dt, within=within):
        state = after
        frames += len(chunk.t)
        last = float(chunk.t[-1])
        parts.append(trace_assembly.trace([item for item in out if isinstance(item, Sample)], car.driver, dt))
        estimates += [item for item in out if isinstance(item, Estimate)]
        events += [item for item in out if isinstance(item, Event)]
        reports += [item for item in out if isinstance(item, SignalReport)]
        if progress is not None:
            progress(log.progress)
    if state is None:
        raise nothing_read(path, within, log.damage)
    shown = health(log, car, state, frames, last, events)
    if not shown.mapped:
        raise nothing_mapped(path, car, shown)
    trace = trace_assembly.joined(parts)._replace(findings=signal_checks.episodes(reports))
    return Drive(trace, tuple(estimates), shown)


def nothing_read(path: str | Path, within: Window, damage: Damage | None) -> CanidError:
    """The error for a log, or a part of one, without any frame."""
    if damage:
        return DamagedLogError(f"{path}: {damage.says}")
    if not within.is_whole:
        return ConfigError(
            f"{path}: no frames between {within.begin:g} and {within.stop:g} s; see `canid check {path}`"
        )
    return LogError(f"{path} holds no frames")


def nothing_mapped(path: str | Path, vehicle: Vehicle, health: Health) -> ConfigError:
    """The error for a log without any value of a role, with the reason: frames left out, or a message that never came."""
    if says := errors_alone(path):
        return ConfigError(says)
    says = f"{path}: its {health.frames:,} frames hold no value that {vehicle.name} maps:"
    if health.back_in_time:
        return ConfigError(f"{says} {health.back_in_time}; see `canid check {path}`")
    return ConfigError(
        f"{says} {health.missing[0]} (is it this vehicle's log? `canid check {path}` lists its ids)"
    )


def errors_alone(path: str | Path) -> str:
    """Say that a log holds error frames and no others, and why that may be; "": it holds others, or is none."""
    n = 0
    try:
        for chunk in open_log(path).columns():
            n += len(chunk.t)
            if not (chunk.flags & int(Flag.ERROR)).all():
                return ""
    except CanidError:
        return ""
    why = "wrong bit rate, no termination, or no other node was on while it was recorded"
    return f"{path}: all of its {n:,} frames are error frames: {why}" if n else ""


def read_trace(path: str | Path, vehicle: Vehicle | str | Path, dt: float = pipeline.DT) -> Trace:
    """Read a log as uniform columns: signals decoded, lead chosen and smoothed, gates judged.

    Args:
        path: .blf, .asc, candump .log, .csv, .trc, .mf4, .pcap or .pcapng.
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
    log = open_log(path)
    car = as_vehicle(vehicle, log)
    init, step = decoder(car)
    state = init()
    times: dict[str, list[Array]] = {}
    values: dict[str, list[Array]] = {}
    frames = session_clock.unwrapped(log.columns(mapped_ids(car)))
    for chunk in gather(frames, FRAMES_PER_DECODED_CHUNK):
        state, decoded = step(state, chunk)
        of_rows = {id(row): chunk.t[row] for _, row, _ in decoded.roles}
        for role, row, value in decoded.roles:
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
    # closed early, it saves a state that is at most half a second of the log ahead of the last estimate
    span = float("inf") if state is None else ESTIMATE_EVERY_S
    car, log = as_vehicle(vehicle), open_log(path)
    with closing(run(log, as_vehicle(car, log), keep=state, span=span)) as steps:
        for step in steps:
            yield from (item for item in step.out if isinstance(item, Estimate))
