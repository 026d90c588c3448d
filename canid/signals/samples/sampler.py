"""The composition of this folder: chunks of frames → samples, with everything that goes on from chunk to chunk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from canid.signals.samples import (
    lead,
    lead_limits,
    lead_readings,
    learning_gate,
    limited_values,
    missing_codes,
    no_lane,
    no_target,
    own_speed,
    reading_spans,
    repeated_reports,
    sampling_grid,
    session_clock,
    stamps,
    update_instants,
)
from canid.signals.samples.lead import REPORTED
from canid.signals.samples.lead_readings import Made
from canid.signals.samples.limited_values import AT_LIMIT
from canid.signals.samples.reading_facts import OutOfRange, ReadingFact
from canid.signals.samples.sampling_grid import Ints, Readings, Role
from canid.signals.vehicle import Vehicle, decoder
from canid.signals.vehicle.decoding import Step as DecodingStep
from canid.signals.vehicle.decoding_state import Decoded, Decoding, RoleReadings, add_counts
from canid.values.types import NAN, TASK_INPUTS, Array, Columns, Driver, Event, Sample

# roles that the lead makes, whatever the vehicle maps
MADE = {
    "lead_valid": Role(switch=True, stale=1.0),
    "target": Role(switch=True, stale=60.0),
}
# s; half the width of the parabola through a signal that a vehicle's inertia smooths: of a movement of 0.5 Hz it misses
# 0.1 % to the side, where nothing that a driver does now moves the vehicle by then, and 0.4 % along the road
SMOOTH_SIDEWAYS_S, SMOOTH_ALONG_S = 0.15, 0.25
# s; likewise through a noisy speed, within the lag of the lead's smoothing
WIDEST_ALONG_S = 0.8


class State(NamedTuple):
    """Everything that the next chunk's meaning depends on."""

    clock: session_clock.State
    decoding: Decoding
    lead: lead.State
    grid: sampling_grid.State
    gate: learning_gate.State
    instants: update_instants.State
    stamps: stamps.State
    spans: reading_spans.State
    no_target: no_target.State = no_target.State()
    no_lane: no_lane.State = no_lane.State()
    limits: limited_values.State = limited_values.init()
    repeats: Mapping[str, repeated_reports.Readings] = {}
    codes: missing_codes.State = missing_codes.init()


class Samples(NamedTuple):
    """What a chunk has completed, each with the row of the frame that completed or caused it."""

    samples: list[tuple[int, Sample]]
    events: list[tuple[int, Event]]
    stamps: list[tuple[int, ReadingFact]]
    decoded: Decoded  # what the frames held
    t: Array  # (n,) s, of the frames that were decoded


class Sampler(NamedTuple):
    """A vehicle's path from frames to samples: pure functions."""

    init: Callable[[], State]
    step: Callable[[State, Columns], tuple[State, Samples]]


class _Settings(NamedTuple):
    """Of a vehicle."""

    decode: DecodingStep
    lead: lead.Settings | None  # None: no lead is followed
    roles: Mapping[str, Role]
    driver: Driver
    stamped: frozenset[str]  # one role of each message whose stamps are watched
    dt: float  # s
    updated: str  # role whose instants are the grid; "": none
    largest: float  # gap of the largest raw number, m


_NO_READINGS = Readings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def sampler(vehicle: Vehicle, dt: float) -> Sampler:
    """Compose a vehicle's path from frames to samples.

    Args:
        vehicle: from `read_vehicle`.
        dt: step of the grid, s.

    Returns:
        `init() -> state` and `step(state, chunk) -> (state, samples)`. However the frames are divided into chunks,
        the samples are the same to the last bit.
    """
    init_decoding, decode = decoder(vehicle)
    following = vehicle.driver.task == "car_following"
    settings = _Settings(
        decode,
        lead.settings_of(vehicle) if following else None,
        sampled_roles(vehicle),
        vehicle.driver,
        _stamped(vehicle),
        dt,
        "" if following else vehicle.driver.output,
        no_target.largest_raw(vehicle),
    )
    init = partial(_init, init_decoding)
    return Sampler(init, partial(_step, settings))


# roles that a model needs, besides the driver's output
NEEDED = ("speed", "gap", "range_rate", "lateral_offset")


def _stamped(vehicle: Vehicle) -> frozenset[str]:
    """One role of each message that carries what the model needs."""
    by_message: dict[tuple[str, int | None], str] = {}
    for role in (vehicle.driver.output, *NEEDED):
        how = vehicle.roles.get(role)
        if how is not None:
            by_message.setdefault((how.message, how.bus), role)
    return frozenset(by_message.values())


def sampled_roles(vehicle: Vehicle) -> dict[str, Role]:
    """How each role that this vehicle has is brought onto the grid."""
    needed = {vehicle.driver.output, *NEEDED}
    roles = {
        role: Role(how.switch, how.stale, role in needed and not how.switch)
        for role, how in vehicle.roles.items()
        if role != "lead_valid"
    }
    if vehicle.driver.task == "car_following":
        age = lead.settings_of(vehicle).age._asdict()
        if vehicle.lead.rate_from_gap:
            age["range_rate"] = age["gap"]
        following = {role: Role(stale=age[role], needed=True) for role in REPORTED}
        reported = {name: Role(stale=age[role]) for role, name in REPORTED.items()}
        roles[AT_LIMIT] = Role(switch=True, stale=age["range_rate"])
        roles |= following | MADE | reported | {"lead_speed": Role(stale=age["range_rate"])}
        if "speed" in roles:
            roles["own_speed"] = Role(
                stale=roles["speed"].stale, smooth=SMOOTH_ALONG_S, widest=WIDEST_ALONG_S
            )
    elif vehicle.driver.output in roles:
        # the wheel's corner at a decision is where the lines before and after it meet
        output = roles[vehicle.driver.output]
        roles[vehicle.driver.output] = output._replace(updated=True)
        for name in TASK_INPUTS[vehicle.driver.task]:
            if name in roles:
                roles[name] = roles[name]._replace(smooth=SMOOTH_SIDEWAYS_S)
    return roles


def _init(init_decoding: Callable[[], Decoding]) -> State:
    return State(
        session_clock.init(),
        init_decoding(),
        lead.init(),
        sampling_grid.init(),
        learning_gate.init(),
        update_instants.init(),
        stamps.init(),
        reading_spans.init(),
    )


def _step(settings: _Settings, state: State, chunk: Columns) -> tuple[State, Samples]:
    clock, timed = session_clock.step(state.clock, chunk)
    frames, first = timed.frames, state.grid.frames
    decoding, decoded = settings.decode(state.decoding, frames)
    codes, decoded, missing = missing_codes.step(state.codes, decoded, frames.t)
    targets, lane = state.no_target, state.no_lane
    if settings.lead is not None:
        targets, decoded, empty = no_target.step(targets, decoded, frames.t, settings.largest)
    else:
        lane, decoded, empty = no_lane.step(lane, decoded, frames.t)
    if empty or missing:
        decoding = add_counts(add_counts(decoding, missing), empty)
    reported = tuple(each for each in decoded.roles if each.role in limited_values.WATCHED)
    limits, within = limited_values.step(state.limits, decoded, frames.t)
    decoded, known, marks = within.decoded, within.limits, within.marks
    following, passed, repeats = state.lead, decoded.roles, state.repeats
    events = [*timed.events, *decoded.events]
    made: Mapping[str, Made] = {}
    unlimited = made
    if settings.lead is not None:
        repeats, fresh = repeated_reports.separate(repeats, decoded, frames.t)
        following, followed = lead_readings.step(
            following, fresh, frames, settings.lead, sampling_grid.pauses(state.grid, timed.latest)
        )
        passed, made = followed.passed, followed.made
        events += followed.events
        unlimited = made
        if settings.lead.from_tracks:
            limits, (made, known, marks) = lead_limits.step(limits, made, frames.t)
    intervals, stamped = state.stamps, list[tuple[int, ReadingFact]](known)
    for role, row, _ in decoded.roles:
        if role in settings.stamped:
            intervals, spans = stamps.step(intervals, role, frames.t[row], row)
            stamped += spans
    for role, row, value in decoded.out_of_range:
        beyond = zip(row.tolist(), frames.t[row].tolist(), value.tolist(), strict=True)
        stamped += [(at, OutOfRange(role, t, number)) for at, t, number in beyond]
    readings = _by_role((*passed, *marks), made, frames, first)
    watched = state.spans
    came = _by_role(tuple(each for each in decoded.roles if each.role in REPORTED), {}, frames, first)
    before = _by_role(reported, {}, frames, first)
    for source, role in _sources(settings.driver):
        if source in readings:
            t, value, frame = came.get(role, readings[source])
            whole = before.get(role) or unlimited.get(source)
            if whole is not None:
                # a reading at a limit has come all the same
                value = np.where(np.isnan(value) & np.isfinite(whole.value), np.inf, value)
            watched, over = reading_spans.step(watched, role, t, value, frame - first)
            stamped += over
    if "own_speed" in settings.roles and "speed" in readings:
        readings["own_speed"] = readings["speed"]
    grid = sampling_grid.put(state.grid, readings)
    instants = state.instants
    if settings.updated:
        instants = _instants(settings, instants, readings.get(settings.updated), timed.latest, first)
        grid, parts = sampling_grid.take(grid, timed.latest, settings.dt, settings.roles, instants.grid)
        instants = update_instants.trimmed(instants, (grid.next - 1) * settings.dt)
    else:
        grid, parts = sampling_grid.take(grid, timed.latest, settings.dt, settings.roles)
    gate, samples = state.gate, []
    for points in parts:
        variances = _variances(settings, points)
        at_points = own_speed.range_rates(points.values)
        columns = (column.tolist() for column in (points.frame - first, points.t, *at_points.values()))
        for row, t, *values in zip(*columns, strict=True):
            gate, sample = learning_gate.step(
                gate, t, dict(zip(at_points, values, strict=True)), settings.driver, settings.dt
            )
            if variances is not None:
                sample = sample._replace(variance=next(variances))
            samples.append((row, sample))
    events.sort(key=_row)
    if timed.rows is not None:
        rows = timed.rows.tolist()
        samples = [(rows[row], sample) for row, sample in samples]
        events = [(rows[row], event) for row, event in events]
        stamped = [(rows[row], span) for row, span in stamped]
    stamped.sort(key=_row)
    after = State(
        clock,
        decoding,
        following,
        grid,
        gate,
        instants,
        intervals,
        watched,
        targets,
        lane,
        limits,
        repeats,
        codes,
    )
    return after, Samples(samples, events, stamped, decoded, frames.t)


def _sources(driver: Driver) -> tuple[tuple[str, str], ...]:
    """Roles whose readings are watched, as they were reported, and what they are called."""
    inputs = ("speed", *REPORTED) if driver.task == "car_following" else TASK_INPUTS[driver.task]
    return (*((REPORTED.get(role, role), role) for role in inputs), (driver.output, driver.output))


def _variances(settings: _Settings, points: sampling_grid.Points) -> Iterator[tuple[float, ...]] | None:
    """Of output and inputs, sample by sample; None: of none is anything known."""
    names = (settings.driver.output, *TASK_INPUTS[settings.driver.task])
    if not any(name in points.variances for name in names):
        return None
    unknown = np.full(len(points.t), NAN)
    return zip(*(points.variances.get(name, unknown).tolist() for name in names), strict=True)


def _instants(
    settings: _Settings, state: update_instants.State, readings: Readings | None, latest: Array, first: int
) -> update_instants.State:
    """Instants at which the output is updated, after some more frames."""
    if not latest.size:
        return state
    t, value, frame = readings if readings is not None else _NO_READINGS
    return update_instants.step(state, t, value, latest[frame - first], float(latest[-1]), settings.dt)


def _row(item: tuple[int, Event | ReadingFact]) -> int:
    return item[0]


def _by_role(
    passed: tuple[RoleReadings, ...], made: Mapping[str, Made], frames: Columns, first: int
) -> dict[str, Readings]:
    """Readings of each role; of one that has several sources, in the order of the frames."""
    parts: dict[str, list[Readings]] = {}
    for role, (t, value, row) in made.items():
        parts.setdefault(role, []).append(Readings(t, value, first + row))
    shared: dict[int, tuple[Array, Ints]] = {}  # roles of one message share their rows
    for role, row, value in passed:
        if id(row) not in shared:
            shared[id(row)] = frames.t[row], first + row
        t, frame = shared[id(row)]
        parts.setdefault(role, []).append(Readings(t, value, frame))
    return {role: sources[0] if len(sources) == 1 else _in_order(sources) for role, sources in parts.items()}


def _in_order(parts: list[Readings]) -> Readings:
    t, value, frame = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(frame, kind="stable")
    return Readings(t[order], value[order], frame[order])
