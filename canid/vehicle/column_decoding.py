"""Columns of frames → columns of readings: what `decoding` says of each frame, for thousands of them at once.

Value by value, count by count and event by event the same: the words and the choice of a bus are `decoding`'s own,
and whatever goes on from frame to frame goes on from chunk to chunk.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.types import NAN, Array, Columns, Event
from canid.vehicle import decoding
from canid.vehicle.bits import Bits
from canid.vehicle.column_bits import Payloads, payloads, raws_of
from canid.vehicle.decoding import FROZEN_AFTER, NO_DATA, Decoding, Life, Plan
from canid.vehicle.mapping import SignalMap, TrackMap, Vehicle

# frames looked at one by one before asking again whether the rest is settled
_LOOKED_AT = 256

Rows = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


class RoleReadings(NamedTuple):
    """One role's values."""

    role: str
    row: Rows  # (m,) which frame of the chunk said it
    value: Array  # (m,) in the role's unit; NaN: the frame said that there is none


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
    """What a chunk says. Of one frame, readings come in the order of these tuples: roles, then tracks."""

    roles: tuple[RoleReadings, ...]
    tracks: tuple[TrackReadings, ...]
    events: tuple[tuple[int, Event], ...]  # with the row of the frame that made it


Init = Callable[[], Decoding]
Step = Callable[[Decoding, Columns], tuple[Decoding, Decoded]]


def column_decoder(vehicle: Vehicle) -> tuple[Init, Step]:
    """Make the decoder of a vehicle, for columns.

    Returns:
        `init() -> state` and `step(state, chunk) -> (state, what the chunk says)`. The state is that of
        `decoding.decoder` after the same frames.

    Example:
        >>> from canid.vehicle import read_vehicle
        >>> init, step = column_decoder(read_vehicle("generic"))
        >>> data = np.array([[50, 0, 0, 0, 0, 0, 0, 0]] * 2, np.uint8)
        >>> words = (np.array([x, x], kind) for x, kind in ((0, "u2"), (0x110, "u4"), (0, "u1"), (4, "u1")))
        >>> state, said = step(init(), Columns(np.array([0.5, 0.6]), *words, data))
        >>> said.roles[0].role, said.roles[0].value.tolist()
        ('pedal', [20.0, 20.0])
    """
    table = decoding.table(vehicle)

    def step(state: Decoding, chunk: Columns) -> tuple[Decoding, Decoded]:
        found = []
        for id_, plans in table.items():
            of_id = np.flatnonzero(chunk.id == id_)
            if not of_id.size:
                continue
            flags = chunk.flags[of_id]
            for plan in plans:
                # Flag.EXTENDED is 1
                fits = (flags & (NO_DATA | 1)) == int(plan.message.extended)
                rows = of_id if fits.all() else of_id[fits]
                if rows.size:
                    found.append((plan, rows))
        events: list[tuple[int, Event]] = []
        problems: Counter[str] = Counter()
        state, found = _taken(found, state, chunk, events, problems)
        roles: list[RoleReadings] = []
        tracks: list[TrackReadings] = []
        for plan, rows in found:
            state = _message(plan, state, rows, chunk, roles, tracks, problems)
        if problems:
            state = decoding.counted(state, problems)
        return state, Decoded(tuple(roles), tuple(tracks), tuple(events))

    return Decoding, step


_Found = list[tuple[Plan, Rows]]


def _taken(
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
            state, _, _ = decoding.taken_from(plan, state, int(chunk.bus[first]), float(chunk.t[first]))
            numbers, counts = np.unique(chunk.bus[away], return_counts=True)
            for bus, n in zip(numbers.tolist(), counts.tolist(), strict=True):
                problems[decoding.ignored(plan.message, bus)] += n
    while unsettled:
        # messages whose frames are all on the bus that they are taken from need no look at each
        for k, rows in list(unsettled.items()):
            if (chunk.bus[rows] == state.buses.get(found[k][0].message.name, -1)).all():
                out.setdefault(k, []).append(unsettled.pop(k))
        state = _next(found, unsettled, out, state, chunk, events, problems)
    kept = {k: np.concatenate(parts) for k, parts in sorted(out.items())}
    return state, [(found[k][0], rows) for k, rows in kept.items() if rows.size]


def _next(
    found: _Found,
    unsettled: dict[int, Rows],
    out: dict[int, list[Rows]],
    state: Decoding,
    chunk: Columns,
    events: list[tuple[int, Event]],
    problems: Counter[str],
) -> Decoding:
    """Decide on the next unsettled frames one by one, all messages together: they look at each other's buses."""
    order = sorted((row, k) for k, rows in unsettled.items() for row in rows[:_LOOKED_AT].tolist())[
        :_LOOKED_AT
    ]
    kept: dict[int, list[int]] = {}
    for row, k in order:
        plan, bus = found[k][0], int(chunk.bus[row])
        state, taken, event = decoding.taken_from(plan, state, bus, float(chunk.t[row]))
        if event is not None:
            events.append((row, event))
        if taken:
            kept.setdefault(k, []).append(row)
        elif bus not in plan.claimed:
            problems[decoding.ignored(plan.message, bus)] += 1
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
    frames = payloads(chunk.data[rows], chunk.length[rows])
    stands: Stands | None = None
    if message.counter is not None:
        key = (message.name, message.bus)
        life, stands = _lives(state.lives.get(key), message.counter, frames, chunk.t[rows])
        if life is not None:
            state = state._replace(lives={**state.lives, key: life})
    for selector, where, defined in message.selectors:
        raw, there = raws_of(where, frames)
        unknown = ~_among(raw, defined)
        for number in raw[unknown if there is None else unknown & there].tolist():
            problems[decoding.undefined(message, selector, number)] += 1
    seen = set()
    for role in plan.roles:
        value, present = _values(role.how, role.role, frames, problems)
        at, stood = rows, None if stands is None else _frozen(stands, role.stale)
        if present is not None:
            if not present.any():
                continue
            value, at = value[present], rows[present]
            stood = None if stood is None else stood[present]
        if stood is not None:
            value = _stale(value, stood, decoding.stale(role.role, message.name), problems)
        roles.append(RoleReadings(role.role, at, value))
        seen.add(role.role)
    frozen = _frozen(stands, plan.stale) if stands is not None and plan.tracks else None
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


class Stands(NamedTuple):
    """For how long a counter has stood still, frame by frame; 0 where it never moved, or the frame ends before it."""

    still: Rows  # (n,) frames
    age: Array  # (n,) s


def _frozen(stands: Stands, stale: float) -> Bools | None:
    """In which frames it has stood still for too long; None: in none."""
    frozen = (stands.still >= FROZEN_AFTER) | (stands.age > stale)
    return frozen if frozen.any() else None


def _lives(life: Life | None, counter: Bits, frames: Payloads, t: Array) -> tuple[Life | None, Stands | None]:
    """The counter after these frames, and how it stood in each of them."""
    raw, there = raws_of(counter, frames)
    long_enough = np.arange(len(raw)) if there is None else np.flatnonzero(there)
    if not long_enough.size:
        return life, None
    raw = raw[long_enough]
    before = raw[0] if life is None else life.last
    moved = np.concatenate([np.array([before], raw.dtype), raw[:-1]]) != raw
    index = np.arange(len(raw))
    latest = np.maximum.accumulate(np.where(moved, index, -1))
    # before the first move here: as long as it stood before; a counter that never moved counts nothing
    start = (-1 - life.still) if life is not None and life.moved else index
    if life is None:
        # the first number is no repetition of one before
        start = index
    still = np.where(latest >= 0, index - latest, index - start)
    t = t[long_enough]
    once = life is not None and life.moved
    moved_at = np.where(latest >= 0, t[latest], life.moved_at if life is not None else 0.0)
    age = np.where((latest >= 0) | once, t - moved_at, 0.0)
    after = Life(raw[-1].item(), bool(latest[-1] >= 0) or once, int(still[-1]), float(moved_at[-1]))
    stands = Stands(np.zeros(len(frames.length), np.int64), np.zeros(len(frames.length)))
    stands.still[long_enough] = still
    stands.age[long_enough] = age
    return after, stands


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
        _drop(value, lacking, decoding.short(what), problems)
        good = there if present is None else present & there
    for number, text in how.no_value.items():
        hit = raw == number
        if hit.any():
            hit = hit if good is None else hit & good
            _drop(value, hit, decoding.no_value(what, text), problems)
            good = ~hit if good is None else good & ~hit
    if not _cannot_leave(how):
        with np.errstate(invalid="ignore"):
            hit = ~((value >= how.low) & (value <= how.high))
        if hit.any():
            hit = hit if good is None else hit & good
            _drop(value, hit, decoding.out_of_range(what), problems)
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
    """Which raw numbers are among these; a handful, so each is looked for."""
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
        stood = good & frozen
        if stood.any():
            problems[decoding.stale("track", track.message)] += int(stood.sum())
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


def ids(vehicle: Vehicle) -> frozenset[int]:
    """The ids that a vehicle maps.

    Example:
        >>> from canid.vehicle import read_vehicle
        >>> 0x110 in ids(read_vehicle("generic"))
        True
    """
    return frozenset(message.id for message in vehicle.messages)
