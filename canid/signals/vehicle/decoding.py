"""Decoding: chunks of frames → readings by role. What a frame cannot mean becomes NaN and is counted; nothing raises.

What goes on from frame to frame (counters, the bus of each message) goes on from chunk to chunk.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial

import numpy as np

from canid.signals.vehicle import j1939, made_roles, transport_protocol
from canid.signals.vehicle.bits import Bools, Payloads, Rows, payloads, raws_of
from canid.signals.vehicle.containers import contained
from canid.signals.vehicle.decoding_plan import Plan, Table, make_table
from canid.signals.vehicle.decoding_state import Decoded, Decoding, RoleReadings, TrackReadings, add_counts
from canid.signals.vehicle.mapping import MessageMap, RoleMap, SignalMap, TrackMap, Vehicle
from canid.signals.vehicle.message_counter import CounterAge, counter_ages, frozen_frames
from canid.signals.vehicle.message_sources import NO_DATA, frames_of_groups, keep_bus, keep_sender
from canid.signals.vehicle.signal_values import among, plain_values, read_values
from canid.values.types import NAN, Array, Columns, Event

Init = Callable[[], Decoding]
Step = Callable[[Decoding, Columns], tuple[Decoding, Decoded]]


def decoder(vehicle: Vehicle) -> tuple[Init, Step]:
    """Make the decoder of a vehicle.

    Returns:
        `init() -> state` and `step(state, chunk) -> (state, decoded)`. `state.counters` says what was left out, and
        how often.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> init, step = decoder(read_vehicle("generic"))
        >>> data = np.array([[50, 0, 0, 0, 0, 0, 0, 0]] * 2, np.uint8)
        >>> words = (np.array([x, x], kind) for x, kind in ((0, "u2"), (0x110, "u4"), (0, "u1"), (4, "u1")))
        >>> state, decoded = step(init(), Columns(np.array([0.5, 0.6]), *words, data))
        >>> decoded.roles[0].role, decoded.roles[0].value.tolist()
        ('pedal', [20.0, 20.0])
    """
    return Decoding, partial(_step, make_table(vehicle))


def _step(table: Table, state: Decoding, chunk: Columns) -> tuple[Decoding, Decoded]:
    matched = []
    problems: Counter[str] = Counter()
    if table.by_group:
        state, chunk = _assembled(table, state, chunk, problems)
    ids = set(chunk.id.tolist())
    for id_ in table.by_id.keys() & ids:
        of_id = np.flatnonzero(chunk.id == id_)
        flags = chunk.flags[of_id]
        for plan in table.by_id[id_]:
            # Flag.EXTENDED is 1
            fits = (flags & (NO_DATA | 1)) == int(plan.message.extended)
            rows = of_id if fits.all() else of_id[fits]
            if rows.size:
                matched.append((plan, rows))
    events: list[tuple[int, Event]] = []
    if table.by_group:
        state, groups = frames_of_groups(table.by_group, ids, state, chunk, problems)
        matched += groups
    matched.sort(key=lambda item: item[0].place)
    state, matched = keep_bus(matched, state, chunk, events, problems)
    if table.by_group:
        state, matched = keep_sender(matched, state, chunk, events, problems)
    roles: list[RoleReadings] = []
    tracks: list[TrackReadings] = []
    out_of_range: list[RoleReadings] = []
    for plan, rows in matched:
        state = _message(plan, state, rows, chunk, roles, tracks, out_of_range, problems)
    if table.made:
        held, roles = made_roles.step(table.made, state.parts, roles, chunk.t, problems)
        state = state._replace(parts=held)
    if problems:
        state = add_counts(state, problems)
    return state, Decoded(tuple(roles), tuple(tracks), tuple(events), tuple(out_of_range))


def _assembled(
    table: Table, state: Decoding, chunk: Columns, problems: Counter[str]
) -> tuple[Decoding, Columns]:
    """Messages that come in packets, each in the place of its last one."""
    transfers, made = transport_protocol.step(state.transfers, chunk, table.by_group)
    if transfers is not state.transfers:
        state = state._replace(transfers=transfers)
    if made is None:
        return state, chunk
    for group, n in made.incomplete.items():
        problems[f"{table.by_group[group][0].message.name}: packets are missing"] += n
    return state, transport_protocol.replaced(chunk, made)


def mapped_ids(vehicle: Vehicle) -> frozenset[int] | None:
    """The ids that a vehicle maps; None: of J1939 messages, which come under many ids.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> 0x110 in mapped_ids(read_vehicle("generic"))
        True
    """
    if any(message.protocol == j1939.PROTOCOL for message in vehicle.messages):
        return None
    return frozenset(message.id for message in vehicle.messages)


def is_mapped(vehicle: Vehicle, id_: int, extended: bool) -> bool:
    """Whether a vehicle maps something of the frames with an id.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> is_mapped(read_vehicle("generic"), 0x110, False), is_mapped(read_vehicle("generic"), 0x110, True)
        (True, False)
    """
    return any(j1939.matches(message, id_, extended) for message in vehicle.messages)


def _message(
    plan: Plan,
    state: Decoding,
    rows: Rows,
    chunk: Columns,
    roles: list[RoleReadings],
    tracks: list[TrackReadings],
    out_of_range: list[RoleReadings],
    problems: Counter[str],
) -> Decoding:
    """Read one message's frames."""
    message = plan.message
    data, length = chunk.data[rows], chunk.length[rows]
    if message.container is not None:
        holding, data, length = contained(message.container, data, length)
        rows = rows[holding]
        if not rows.size:
            return state
    frames = payloads(data, length)
    ages: CounterAge | None = None
    if message.counter is not None:
        key = (message.name, message.bus, message.source)
        counter, ages = counter_ages(state.alive.get(key), message.counter, frames, chunk.t[rows])
        if counter is not None:
            state = state._replace(alive={**state.alive, key: counter})
    for selector, where, defined in message.selectors:
        raw, there = raws_of(where, frames)
        unknown = ~among(raw, defined)
        for number in raw[unknown if there is None else unknown & there].tolist():
            problems[_undefined_text(message, selector, number)] += 1
    seen = set()
    plain = plain_values(plan.plain, frames) if plan.plain is not None else {}
    for role in plan.roles:
        present: Bools | None = None
        if role.role in plain:
            value = plain[role.role]
        else:
            value, present = read_values(role.how, role.role, frames, problems)
        at, frozen = rows, None if ages is None else frozen_frames(ages, role.stale)
        if present is not None:
            if not present.any():
                continue
            value, at = value[present], rows[present]
            frozen = None if frozen is None else frozen[present]
        if frozen is not None:
            value = _stale(value, frozen, _stale_text(role.role, message.name), problems)
        if role.role == "pedal" and role.role not in plain and np.isnan(value).any():
            out_of_range += _out_of_range(role, rows, frames)
        roles.append(RoleReadings(role.role, at, value))
        seen.add(role.role)
    frozen = None if ages is None or not plan.tracks else frozen_frames(ages, plan.stale)
    for track in plan.tracks:
        for number, which in _objects(track, frames):
            if which.all():
                tracks.append(_track(track._replace(track=number), rows, frames, frozen, problems))
                continue
            some = payloads(frames.data[which], frames.length[which])
            frozen_here = None if frozen is None else frozen[which]
            tracks.append(_track(track._replace(track=number), rows[which], some, frozen_here, problems))
        seen.add("lead")
    return state if seen <= state.seen else state._replace(seen=state.seen | seen)


def _objects(track: TrackMap, frames: Payloads) -> list[tuple[int, Bools]]:
    """Which frames report on which object: all on one; of a page those with the page; of a list by the id in the frame."""
    there = np.ones(len(frames.data), bool)
    for where, numbers in track.distance.when:
        raw, long_enough = raws_of(where, frames)
        there &= among(raw, numbers) if long_enough is None else among(raw, numbers) & long_enough
    if track.number is None:
        return [(track.track, there)] if there.any() else []
    ids, present = read_values(track.number, "track", frames, Counter())
    there &= np.isfinite(ids) if present is None else np.isfinite(ids) & present
    return [(int(number), there & (ids == number)) for number in np.unique(ids[there]).tolist()]


def _out_of_range(role: RoleMap, rows: Rows, frames: Payloads) -> list[RoleReadings]:
    """The readings of a role that are left out because they are out of its range."""
    value, present = read_values(role.how._replace(low=-np.inf, high=np.inf), role.role, frames, Counter())
    outside = (value < role.how.low) | (value > role.how.high)
    beyond = np.flatnonzero(outside if present is None else outside & present)
    return [RoleReadings(role.role, rows[beyond], value[beyond])] if beyond.size else []


def _stale(value: Array, frozen: Bools, problem: str, problems: Counter[str]) -> Array:
    hit = frozen & (value == value)
    if hit.any():
        problems[problem] += int(hit.sum())
        value = np.where(frozen, NAN, value)
    return value


def _track(
    track: TrackMap, rows: Rows, frames: Payloads, frozen: Bools | None, problems: Counter[str]
) -> TrackReadings:
    """One track's reports. An invalid track's numbers mean nothing: NaN, and nothing to count."""
    n = len(rows)
    good = np.ones(n, bool)
    if track.valid is not None:
        value, present = read_values(track.valid, "track", frames, Counter())
        good = value == 1.0 if present is None else (value == 1.0) & present
    if frozen is not None:
        lost = good & frozen
        if lost.any():
            problems[_stale_text("track", track.message)] += int(lost.sum())
            good &= ~frozen
    chosen = np.flatnonzero(good)
    some = frames if len(chosen) == n else payloads(frames.data[chosen], frames.length[chosen])

    def values(how: SignalMap | None, what: str) -> Array:
        out = np.full(n, NAN)
        if how is not None and chosen.size:
            value, present = read_values(how, what, some, problems)
            out[chosen] = value if present is None else np.where(present, value, NAN)
        return out

    distance, rate = values(track.distance, "track distance"), values(track.rate, "track rate")
    new = values(track.new, "track new") == 1.0
    there = (distance == distance) & (rate == rate)
    lateral = values(track.lateral, "track lateral")
    if track.angle is not None:  # polar: distance along the beam
        angle = values(track.angle, "track angle")
        lateral = distance * np.sin(angle)
        distance = np.where(angle == angle, distance * np.cos(angle), distance)
    return TrackReadings(track.track, rows, distance, rate, lateral, there, new)


def _undefined_text(message: MessageMap, selector: str, raw: float) -> str:
    """A multiplexer's value that the DBC does not define."""
    return f"{message.name}: {selector} = {raw:g} is not defined in the DBC"


def _stale_text(what: str, message: str) -> str:
    """A message whose sender does not run."""
    return f"{what}: stale, the counter of {message} stands still"
