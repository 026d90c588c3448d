"""Decoding: chunks of frames → readings by role. What a frame cannot mean becomes NaN and is counted; nothing raises.

What goes on from frame to frame (counters, the bus of each message) goes on from chunk to chunk.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.types import NAN, Array, Columns, Event, Flag
from canid.vehicle import j1939
from canid.vehicle.bits import Bits, Payloads, payloads, raws_of
from canid.vehicle.containers import contained
from canid.vehicle.mapping import MessageMap, RoleMap, SignalMap, TrackMap, Vehicle
from canid.vehicle.roles import CONTROL_MAX_AGE_S

# A counter that repeats once or twice is a frame sent twice by a gateway; five at 20 Hz are a quarter of a
# second in which the sender's program did not run. A slow message is not waited for that long: what its counter has
# said for longer than the role's `stale` is as old as a message that does not come.
FROZEN_AFTER_REPEATS = 5
NO_DATA = int(Flag.REMOTE | Flag.ERROR)
# frames whose bus is decided one by one before asking again whether the rest is settled
_FRAMES_PER_ROUND = 256

Rows = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


class AliveCounter(NamedTuple):
    """A message's rolling counter: its last number, whether it ever moved, and for how many frames it has repeated."""

    last: float
    moved: bool = False
    repeats: int = 0
    moved_at: float = 0.0  # s, when it last moved


class Decoding(NamedTuple):
    """What decoding remembers."""

    counters: Mapping[str, int] = {}  # what was not measured, and why -> how often
    buses: Mapping[str, int] = {}  # message -> the bus that it is taken from
    elsewhere: Mapping[str, int] = {}  # message -> another bus, on which it was seen too
    senders: Mapping[str, int] = {}  # J1939 message -> the source address that it is taken from
    other_senders: Mapping[str, int] = {}  # J1939 message -> another source that sent it too
    # by name, bus and source of the message
    alive: Mapping[tuple[str, int | None, int | None], AliveCounter] = {}
    seen: frozenset[str] = frozenset()  # roles (and "lead", of tracks) that came at least once


class RoleReadings(NamedTuple):
    """One role's values."""

    role: str
    row: Rows  # (m,) which frame of the chunk holds it
    value: Array  # (m,) in the role's unit; NaN: the frame holds no value


class TrackReadings(NamedTuple):
    """One radar track's reports."""

    track: int
    row: Rows  # (m,)
    distance: Array  # (m,) m
    rate: Array  # (m,) m/s
    lateral: Array  # (m,) m
    valid: Bools  # (m,)
    new: Bools  # (m,)


class Decoded(NamedTuple):
    """A decoded chunk. Of one frame, readings come in the order of these tuples: roles, then tracks."""

    roles: tuple[RoleReadings, ...]
    tracks: tuple[TrackReadings, ...]
    events: tuple[tuple[int, Event], ...]  # with the row of the frame that caused it


Init = Callable[[], Decoding]
Step = Callable[[Decoding, Columns], tuple[Decoding, Decoded]]


class PlainSignals(NamedTuple):
    """Signals of one message that are whole numbers within its first eight bytes, in every frame: decoded together."""

    roles: tuple[str, ...]
    motorola: Rows  # (k,) 0 or 1
    shift: npt.NDArray[np.uint64]  # (k, 1)
    mask: npt.NDArray[np.uint64]  # (k, 1)
    sign: npt.NDArray[np.uint64]  # (k, 1) the sign bit; 0: unsigned
    factor: Array  # (k, 1)
    offset: Array  # (k, 1)
    low: Array  # (k, 1) in the role's unit
    high: Array  # (k, 1)
    bytes: int  # that a frame needs to hold them all
    no_value: tuple[
        Rows, npt.NDArray[np.int64]
    ]  # (m,) which of the roles, and (m, 1) a number that stands for no value
    switches: Rows  # (b,) which of the roles are yes/no
    inverted: Bools  # (b, 1)


class Plan(NamedTuple):
    """What to do with one message."""

    message: MessageMap
    roles: tuple[RoleMap, ...]
    tracks: tuple[TrackMap, ...]
    claimed: frozenset[int]  # buses on which this id is another message
    stale: float  # s, of the tracks' reports
    place: int  # in the order of the table
    plain: PlainSignals | None  # roles that are decoded together; the others one by one
    claimed_sources: frozenset[int]  # J1939: from which the same parameter group is mapped too


class Table(NamedTuple):
    """What to do with frames."""

    by_id: Mapping[int, tuple[Plan, ...]]
    by_group: Mapping[int, tuple[Plan, ...]]  # J1939: by parameter group


def decoder(vehicle: Vehicle) -> tuple[Init, Step]:
    """Make the decoder of a vehicle.

    Returns:
        `init() -> state` and `step(state, chunk) -> (state, decoded)`. `state.counters` says what was left out, and
        how often.

    Example:
        >>> from canid.vehicle import read_vehicle
        >>> init, step = decoder(read_vehicle("generic"))
        >>> data = np.array([[50, 0, 0, 0, 0, 0, 0, 0]] * 2, np.uint8)
        >>> words = (np.array([x, x], kind) for x, kind in ((0, "u2"), (0x110, "u4"), (0, "u1"), (4, "u1")))
        >>> state, decoded = step(init(), Columns(np.array([0.5, 0.6]), *words, data))
        >>> decoded.roles[0].role, decoded.roles[0].value.tolist()
        ('pedal', [20.0, 20.0])
    """
    return Decoding, partial(_step, _table(vehicle))


def _step(table: Table, state: Decoding, chunk: Columns) -> tuple[Decoding, Decoded]:
    found = []
    ids = set(chunk.id.tolist())
    for id_ in table.by_id.keys() & ids:
        of_id = np.flatnonzero(chunk.id == id_)
        flags = chunk.flags[of_id]
        for plan in table.by_id[id_]:
            # Flag.EXTENDED is 1
            fits = (flags & (NO_DATA | 1)) == int(plan.message.extended)
            rows = of_id if fits.all() else of_id[fits]
            if rows.size:
                found.append((plan, rows))
    events: list[tuple[int, Event]] = []
    problems: Counter[str] = Counter()
    if table.by_group:
        state, groups = _of_groups(table.by_group, ids, state, chunk, problems)
        found += groups
    found.sort(key=lambda item: item[0].place)
    state, found = _on_their_bus(found, state, chunk, events, problems)
    if table.by_group:
        state, found = _from_their_sender(found, state, chunk, events, problems)
    roles: list[RoleReadings] = []
    tracks: list[TrackReadings] = []
    for plan, rows in found:
        state = _message(plan, state, rows, chunk, roles, tracks, problems)
    if problems:
        state = _counted(state, problems)
    return state, Decoded(tuple(roles), tuple(tracks), tuple(events))


def mapped_ids(vehicle: Vehicle) -> frozenset[int] | None:
    """The ids that a vehicle maps; None: of J1939 messages, which come under many ids.

    Example:
        >>> from canid.vehicle import read_vehicle
        >>> 0x110 in mapped_ids(read_vehicle("generic"))
        True
    """
    if any(message.protocol == j1939.PROTOCOL for message in vehicle.messages):
        return None
    return frozenset(message.id for message in vehicle.messages)


def is_mapped(vehicle: Vehicle, id_: int, extended: bool) -> bool:
    """Whether a vehicle maps something of the frames with an id.

    Example:
        >>> from canid.vehicle import read_vehicle
        >>> is_mapped(read_vehicle("generic"), 0x110, False), is_mapped(read_vehicle("generic"), 0x110, True)
        (True, False)
    """
    return any(j1939.matches(message, id_, extended) for message in vehicle.messages)


def _table(vehicle: Vehicle) -> Table:
    """Tabulate what to do, by id and by parameter group."""
    by_id: dict[int, tuple[Plan, ...]] = {}
    by_group: dict[int, tuple[Plan, ...]] = {}
    first = {id_: k for k, id_ in enumerate(dict.fromkeys(message.id for message in vehicle.messages))}
    for message in vehicle.messages:
        key = (message.name, message.bus, message.source)
        others = [
            m for m in vehicle.messages if m != message and j1939.matches(m, message.id, message.extended)
        ]
        rivals = {m.bus for m in others if m.source == message.source and m.container is None}
        roles = tuple(r for r in vehicle.roles.values() if (r.message, r.bus, r.source) == key)
        plan = Plan(
            message,
            roles,
            tuple(t for t in vehicle.lead.tracks or () if (t.message, t.bus, t.source) == key),
            frozenset(bus for bus in rivals if bus is not None),
            CONTROL_MAX_AGE_S if vehicle.lead.stale is None else vehicle.lead.stale,
            first[message.id],
            _plain(tuple(role for role in roles if _is_plain(role.how))),
            frozenset(m.source for m in others if m.source is not None),
        )
        of_protocol = message.protocol == j1939.PROTOCOL
        plans, number = (by_group, j1939.pgn_of(message.id)) if of_protocol else (by_id, message.id)
        plans[number] = (*plans.get(number, ()), plan)
    return Table(by_id, by_group)


def _is_plain(how: SignalMap) -> bool:
    whole = not how.bits.floating and how.bits.length < 64 and how.bits.end <= 64
    return whole and not how.when and (how.kind != "bool" or how.on is None)


def _plain(roles: tuple[RoleMap, ...]) -> PlainSignals | None:
    if not roles:
        return None
    hows = [role.how for role in roles]
    shifts = [64 - how.bits.end if how.bits.motorola else how.bits.start for how in hows]
    signs = [1 << (how.bits.length - 1) if how.bits.signed else 0 for how in hows]
    no_value = [(k, number) for k, how in enumerate(hows) for number in how.no_value if abs(number) < 1 << 63]
    switches = [k for k, how in enumerate(hows) if how.kind == "bool"]
    return PlainSignals(
        tuple(role.role for role in roles),
        np.array([int(how.bits.motorola) for how in hows]),
        np.array(shifts, np.uint64)[:, None],
        np.array([(1 << how.bits.length) - 1 for how in hows], np.uint64)[:, None],
        np.array(signs, np.uint64)[:, None],
        np.array([how.factor for how in hows])[:, None],
        np.array([how.offset for how in hows])[:, None],
        np.array([_limits(how)[0] for how in hows])[:, None],
        np.array([_limits(how)[1] for how in hows])[:, None],
        max(-(-how.bits.end // 8) for how in hows),
        (
            np.array([k for k, _ in no_value], np.int64),
            np.array([number for _, number in no_value], np.int64)[:, None],
        ),
        np.array(switches, np.int64),
        np.array([hows[k].invert for k in switches], bool)[:, None],
    )


def _limits(how: SignalMap) -> tuple[float, float]:
    """The range of values, without those of reserved raw numbers."""
    if how.reserved is None:
        return how.low, how.high
    edge = (how.reserved[0] - 0.5) * how.factor + how.offset
    return (how.low, min(how.high, edge)) if how.factor > 0.0 else (max(how.low, edge), how.high)


def _plain_values(plain: PlainSignals, frames: Payloads) -> dict[str, Array]:
    """Values of the plain signals, by role; a role is missing where a frame has none: `_values` counts why."""
    if frames.shortest < plain.bytes:
        return {}
    raw = np.array((frames.little, frames.big))[plain.motorola] >> plain.shift & plain.mask
    number = ((raw ^ plain.sign) - plain.sign).view(np.int64)  # two's complement, modulo 2^64
    with np.errstate(all="ignore"):
        value = number * plain.factor + plain.offset
    good: Bools = np.all((value >= plain.low) & (value <= plain.high), axis=1)
    which, no_value = plain.no_value
    if len(which):
        good[which[(number[which] == no_value).any(axis=1)]] = False
    if len(plain.switches):
        value[plain.switches] = (value[plain.switches] != 0.0) != plain.inverted
    return {role: value[k] for k, role in enumerate(plain.roles) if good[k]}


_Found = list[tuple[Plan, Rows]]


def _of_groups(
    by_group: Mapping[int, tuple[Plan, ...]],
    ids: Collection[int],
    state: Decoding,
    chunk: Columns,
    problems: Counter[str],
) -> tuple[Decoding, _Found]:
    """Frames of the parameter groups that are mapped, from any source, or from the one that the vehicle file names."""
    wanted: dict[int, list[int]] = {}
    for id_ in sorted(ids):
        if (group := j1939.pgn_of(id_)) in by_group:
            wanted.setdefault(group, []).append(id_)
    found: _Found = []
    for group, of_group in wanted.items():
        rows = np.flatnonzero(_among(chunk.id, frozenset(of_group)))
        rows = rows[(chunk.flags[rows] & (NO_DATA | 1)) == 1]
        for plan in by_group[group] if rows.size else ():
            mine = rows
            if plan.message.source is not None:
                home = chunk.id[rows] & 0xFF == plan.message.source
                mine = rows[home]
                state = _ignore_senders(plan, rows[~home], state, chunk, problems)
            if mine.size:
                found.append((plan, mine))
    return state, found


def _from_their_sender(
    found: _Found,
    state: Decoding,
    chunk: Columns,
    events: list[tuple[int, Event]],
    problems: Counter[str],
) -> tuple[Decoding, _Found]:
    """Keep the frames of the first sender of each J1939 message whose source the vehicle file does not name."""
    kept: _Found = []
    for plan, rows in found:
        message = plan.message
        if message.protocol != j1939.PROTOCOL or message.source is not None:
            kept.append((plan, rows))
            continue
        sources = chunk.id[rows] & 0xFF
        free = ~np.isin(sources, tuple(plan.claimed_sources))
        sender = state.senders.get(message.name)
        if sender is None:
            if not free.any():
                continue
            sender = int(sources[free][0])
            state = state._replace(senders={**state.senders, message.name: sender})
        home = sources == sender
        away = rows[~home]
        known = message.name in state.other_senders
        state = _ignore_senders(plan, away, state, chunk, problems)
        if not known and message.name in state.other_senders:
            other = state.other_senders[message.name]
            says = (
                f"{message.name} (PGN {j1939.pgn_of(message.id)}) comes from source 0x{sender:02X} and from 0x{other:02X}; "
                f"0x{sender:02X} is used. To choose, write source = 0x{other:02X} in the vehicle file"
            )
            events.append((int(away[0]), Event(float(chunk.t[away[0]]), "ambiguous_source", says)))
        if home.any():
            kept.append((plan, rows[home]))
    return state, kept


def _ignore_senders(
    plan: Plan, away: Rows, state: Decoding, chunk: Columns, problems: Counter[str]
) -> Decoding:
    """Count frames from other sources, but for those that another entry of the vehicle file names."""
    numbers, counts = np.unique(chunk.id[away] & 0xFF, return_counts=True)
    name = plan.message.name
    for source, n in zip(numbers.tolist(), counts.tolist(), strict=True):
        if source not in plan.claimed_sources:
            problems[_sender_text(plan.message, source)] += n
            if name not in state.other_senders:
                state = state._replace(other_senders={**state.other_senders, name: source})
    return state


def _on_their_bus(
    found: _Found,
    state: Decoding,
    chunk: Columns,
    events: list[tuple[int, Event]],
    problems: Counter[str],
) -> tuple[Decoding, _Found]:
    """Keep the frames on their message's bus."""
    out: dict[int, list[Rows]] = {}
    unsettled: dict[int, Rows] = {}
    for k, (plan, rows) in enumerate(found):
        if plan.message.bus is None:
            unsettled[k] = rows
            continue
        home = chunk.bus[rows] == plan.message.bus
        out[k] = [rows[home]]
        away = rows[~home & ~np.isin(chunk.bus[rows], tuple(plan.claimed))] if not home.all() else rows[:0]
        if away.size:
            first = int(away[0])
            state, _, _ = _taken_from(plan, state, int(chunk.bus[first]), float(chunk.t[first]))
            numbers, counts = np.unique(chunk.bus[away], return_counts=True)
            for bus, n in zip(numbers.tolist(), counts.tolist(), strict=True):
                problems[_ignored_text(plan.message, bus)] += n
    while unsettled:
        # messages whose frames are all on the bus that they are taken from are settled together
        for k, rows in list(unsettled.items()):
            if (chunk.bus[rows] == state.buses.get(found[k][0].message.name, -1)).all():
                out.setdefault(k, []).append(unsettled.pop(k))
        state = _decide_frame_by_frame(found, unsettled, out, state, chunk, events, problems)
    kept = {k: np.concatenate(parts) for k, parts in sorted(out.items())}
    return state, [(found[k][0], rows) for k, rows in kept.items() if rows.size]


def _decide_frame_by_frame(
    found: _Found,
    unsettled: dict[int, Rows],
    out: dict[int, list[Rows]],
    state: Decoding,
    chunk: Columns,
    events: list[tuple[int, Event]],
    problems: Counter[str],
) -> Decoding:
    """Decide on the next unsettled frames one by one, all messages together: each depends on the buses of the others."""
    order = sorted((row, k) for k, rows in unsettled.items() for row in rows[:_FRAMES_PER_ROUND].tolist())[
        :_FRAMES_PER_ROUND
    ]
    kept: dict[int, list[int]] = {}
    for row, k in order:
        plan, bus = found[k][0], int(chunk.bus[row])
        state, taken, event = _taken_from(plan, state, bus, float(chunk.t[row]))
        if event is not None:
            events.append((row, event))
        if taken:
            kept.setdefault(k, []).append(row)
        elif bus not in plan.claimed:
            problems[_ignored_text(plan.message, bus)] += 1
    for k, taken_rows in kept.items():
        out.setdefault(k, []).append(np.array(taken_rows))
    for k, n in Counter(k for _, k in order).items():
        unsettled[k] = unsettled[k][n:]
    return state


def _message(
    plan: Plan,
    state: Decoding,
    rows: Rows,
    chunk: Columns,
    roles: list[RoleReadings],
    tracks: list[TrackReadings],
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
        counter, ages = _counter_ages(state.alive.get(key), message.counter, frames, chunk.t[rows])
        if counter is not None:
            state = state._replace(alive={**state.alive, key: counter})
    for selector, where, defined in message.selectors:
        raw, there = raws_of(where, frames)
        unknown = ~_among(raw, defined)
        for number in raw[unknown if there is None else unknown & there].tolist():
            problems[_undefined_text(message, selector, number)] += 1
    seen = set()
    plain = _plain_values(plan.plain, frames) if plan.plain is not None else {}
    for role in plan.roles:
        present: Bools | None = None
        if role.role in plain:
            value = plain[role.role]
        else:
            value, present = _values(role.how, role.role, frames, problems)
        at, frozen = rows, None if ages is None else _frozen(ages, role.stale)
        if present is not None:
            if not present.any():
                continue
            value, at = value[present], rows[present]
            frozen = None if frozen is None else frozen[present]
        if frozen is not None:
            value = _stale(value, frozen, _stale_text(role.role, message.name), problems)
        roles.append(RoleReadings(role.role, at, value))
        seen.add(role.role)
    frozen = None if ages is None or not plan.tracks else _frozen(ages, plan.stale)
    for track in plan.tracks:
        tracks.append(_track(track, rows, frames, frozen, problems))
        seen.add("lead")
    return state if seen <= state.seen else state._replace(seen=state.seen | seen)


def _stale(value: Array, frozen: Bools, problem: str, problems: Counter[str]) -> Array:
    hit = frozen & (value == value)
    if hit.any():
        problems[problem] += int(hit.sum())
        value = np.where(frozen, NAN, value)
    return value


class CounterAge(NamedTuple):
    """For how long a counter has repeated, frame by frame; 0 where it never moved, or the frame ends before it."""

    repeats: Rows  # (n,) frames
    age: Array  # (n,) s


def _frozen(ages: CounterAge, stale: float) -> Bools | None:
    """In which frames the counter has repeated for too long; None: in none."""
    frozen = (ages.repeats >= FROZEN_AFTER_REPEATS) | (ages.age > stale)
    return frozen if frozen.any() else None


def _counter_ages(
    before: AliveCounter | None, counter: Bits, frames: Payloads, t: Array
) -> tuple[AliveCounter | None, CounterAge | None]:
    """The counter after these frames, and for how long it has repeated in each of them."""
    raw, there = raws_of(counter, frames)
    long_enough = np.arange(len(raw)) if there is None else np.flatnonzero(there)
    if not long_enough.size:
        return before, None
    raw = raw[long_enough]
    last = raw[0] if before is None else before.last
    moved = np.concatenate([np.array([last], raw.dtype), raw[:-1]]) != raw
    index = np.arange(len(raw))
    latest = np.maximum.accumulate(np.where(moved, index, -1))
    # before the first move here: as long as it repeated before; a counter that never moved counts nothing
    ever = before is not None and before.moved
    if there is None and moved[1:].all() and (moved[0] or not ever):
        # the usual case: no frame repeats the one before
        moved_at_last = float(t[-1]) if len(raw) > 1 or moved[0] else 0.0
        return AliveCounter(raw[-1].item(), bool(moved.any()) or ever, 0, moved_at_last), None
    start = (-1 - before.repeats) if before is not None and ever else index
    repeats = np.where(latest >= 0, index - latest, index - start)
    t = t[long_enough]
    moved_at = np.where(latest >= 0, t[latest], before.moved_at if before is not None else 0.0)
    age = np.where((latest >= 0) | ever, t - moved_at, 0.0)
    after = AliveCounter(raw[-1].item(), bool(latest[-1] >= 0) or ever, int(repeats[-1]), float(moved_at[-1]))
    ages = CounterAge(np.zeros(len(frames.length), np.int64), np.zeros(len(frames.length)))
    ages.repeats[long_enough] = repeats
    ages.age[long_enough] = age
    return after, ages


def _values(
    how: SignalMap, what: str, frames: Payloads, problems: Counter[str]
) -> tuple[Array, Bools | None]:
    """The values in the role's unit, NaN where there is none, and which frames carry it (None: all)."""
    present: Bools | None = None
    for where, numbers in how.when:
        raw, there = raws_of(where, frames)
        fits = _among(raw, numbers)
        fits = fits if there is None else fits & there
        present = fits if present is None else present & fits
    raw, there = raws_of(how.bits, frames)
    with np.errstate(all="ignore"):
        value = (raw * how.factor).astype(np.float64, copy=False)
        value += how.offset
    # frames that count: those that carry it and are long enough, whose text and range nobody has objected to
    good = present
    if there is not None:
        lacking = ~there if present is None else present & ~there
        _drop(value, lacking, _short_text(what), problems)
        good = there if present is None else present & there
    if how.reserved is not None:
        error, absent = how.reserved
        for hit, text in (((raw >= error) & (raw < absent), "error"), (raw >= absent, "not available")):
            hit = hit if good is None else hit & good
            _drop(value, hit, _no_value_text(what, text), problems)
            good = ~hit if good is None else good & ~hit
    for number, text in how.no_value.items():
        hit = raw == number
        if hit.any():
            hit = hit if good is None else hit & good
            _drop(value, hit, _no_value_text(what, text), problems)
            good = ~hit if good is None else good & ~hit
    if not _cannot_leave(how):
        with np.errstate(invalid="ignore"):
            hit = ~((value >= how.low) & (value <= how.high))
        if hit.any():
            hit = hit if good is None else hit & good
            _drop(value, hit, _out_of_range_text(what), problems)
    if how.kind == "bool":
        true = value != 0.0 if how.on is None else np.isin(value, tuple(how.on))
        value = np.where(value == value, (true != how.invert).astype(np.float64), NAN)
    return value, present


def _drop(value: Array, hit: Bools, problem: str, problems: Counter[str]) -> None:
    n = int(np.count_nonzero(hit))
    if n:
        value[hit] = NAN
        problems[problem] += n


def _cannot_leave(how: SignalMap) -> bool:
    """Whether every raw number is within the signal's range."""
    if how.bits.floating:
        return False
    ends = [raw * how.factor + how.offset for raw in how.bits.reach]
    return how.low <= min(ends) and max(ends) <= how.high


def _among(raw: npt.NDArray[np.generic], numbers: frozenset[int]) -> Bools:
    """Which raw numbers are among these; a handful, so each is compared."""
    found = np.zeros(len(raw), bool)
    for number in numbers:
        found |= raw == number
    return found


def _track(
    track: TrackMap, rows: Rows, frames: Payloads, frozen: Bools | None, problems: Counter[str]
) -> TrackReadings:
    """One track's reports. An invalid track's numbers mean nothing: NaN, and nothing to count."""
    n = len(rows)
    good = np.ones(n, bool)
    if track.valid is not None:
        value, present = _values(track.valid, "track", frames, Counter())
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
            value, present = _values(how, what, some, problems)
            out[chosen] = value if present is None else np.where(present, value, NAN)
        return out

    distance, rate = values(track.distance, "track distance"), values(track.rate, "track rate")
    new = values(track.new, "track new") == 1.0
    there = (distance == distance) & (rate == rate)
    return TrackReadings(
        track.track, rows, distance, rate, values(track.lateral, "track lateral"), there, new
    )


def _taken_from(plan: Plan, state: Decoding, bus: int, t: float) -> tuple[Decoding, bool, Event | None]:
    """Decide whether a frame with a message's id is the message, by its bus.

    Returns:
        the next state, the decision, and what the user should know of it.
    """
    message = plan.message
    name = message.name
    taken = message.bus if message.bus is not None else state.buses.get(name)
    if taken is None and bus not in plan.claimed:
        taken = bus
        state = state._replace(buses={**state.buses, name: taken})
    if taken == bus:
        return state, True, None
    if message.bus is None and _at_home(state, name, bus, taken):
        says = (
            f"{name} (0x{message.id:X}) comes on bus {taken} and on bus {bus}; bus {bus} is used, "
            f"where most of the mapped messages are. To choose, write bus = {taken} in the vehicle file"
        )
        elsewhere = state.elsewhere if taken is None else {**state.elsewhere, name: taken}
        moved = state._replace(buses={**state.buses, name: bus}, elsewhere=elsewhere)
        return moved, True, Event(t, "ambiguous_bus", says)
    if bus in plan.claimed or name in state.elsewhere:
        return state, False, None  # another message's own frame, or nothing new
    state = state._replace(elsewhere={**state.elsewhere, name: bus})
    if message.bus is not None:
        return state, False, None
    says = (
        f"{name} (0x{message.id:X}) comes on bus {taken} and on bus {bus}; "
        f"bus {taken} is used. To choose, write bus = {bus} in the vehicle file"
    )
    return state, False, Event(t, "ambiguous_bus", says)


def _at_home(state: Decoding, name: str, bus: int, taken: int | None) -> bool:
    """Are more of the other unbound messages on `bus` than where this one is taken from?

    A vehicle file that binds nothing means one bus. An id that another bus uses for something else may come from
    there first; the other messages show which of the two is meant.
    """
    others = [of for other, of in state.buses.items() if other != name]
    return others.count(bus) > others.count(-1 if taken is None else taken)


# What is counted, in words.


def _ignored_text(message: MessageMap, bus: int) -> str:
    """A frame with the message's id on a bus that is not the message's."""
    return f"{message.name}: frame on bus {bus} ignored"


def _sender_text(message: MessageMap, source: int) -> str:
    """A frame of the message's parameter group from a sender that is not the message's."""
    return f"{message.name}: frame from source 0x{source:02X} ignored"


def _undefined_text(message: MessageMap, selector: str, raw: float) -> str:
    """A multiplexer's value that the DBC does not define."""
    return f"{message.name}: {selector} = {raw:g} is not defined in the DBC"


def _short_text(what: str) -> str:
    """A frame that ends before the signal does."""
    return f"{what}: frame too short"


def _no_value_text(what: str, text: str) -> str:
    """A value-table entry that says that there is none."""
    return f'{what}: "{text}"'


def _out_of_range_text(what: str) -> str:
    """A value outside what the vehicle file or the DBC allows."""
    return f"{what}: out of range"


def _stale_text(what: str, message: str) -> str:
    """A message whose sender does not run."""
    return f"{what}: stale, the counter of {message} stands still"


def _counted(state: Decoding, problems: Mapping[str, int]) -> Decoding:
    """Add to what was not measured."""
    counters = dict(state.counters)
    for problem, n in problems.items():
        counters[problem] = counters.get(problem, 0) + n
    return state._replace(counters=counters)


def missing(vehicle: Vehicle, state: Decoding) -> list[str]:
    """Say what is mapped and never came, one sentence each.

    Example:
        >>> from canid.vehicle import decoder, read_vehicle
        >>> vehicle = read_vehicle("generic")
        >>> missing(vehicle, decoder(vehicle)[0]())[0]
        'pedal: message ENGINE_DATA (0x110) never seen'
    """
    lines = [
        f"{role.role}: message {role.message} (0x{role.id:X}) {_where(role, state)}"
        for role in vehicle.roles.values()
        if role.role not in state.seen
    ]
    tracks = vehicle.lead.tracks or ()
    if tracks and "lead" not in state.seen:
        first = tracks[0]
        lines.append(
            f"lead: none of the {len(tracks)} track messages from {first.message} (0x{first.id:X}) on: "
            f"{_where(first, state)}"
        )
    return lines


def _where(item: RoleMap | TrackMap, state: Decoding) -> str:
    if item.source is not None and item.message not in state.buses:
        other = state.other_senders.get(item.message)
        but = f", but from 0x{other:02X}" if other is not None else ""
        return f"never seen from source 0x{item.source:02X}{but}"
    if item.bus is not None:
        other = state.elsewhere.get(item.message)
        but = f", but on bus {other}" if other is not None else ""
        return f"never seen on bus {item.bus}{but}"
    if item.message in state.buses:
        how = item.how.signal if isinstance(item, RoleMap) else "its signals"
        return f"came, but never with {how} (a multiplexed signal)"
    return "never seen"
