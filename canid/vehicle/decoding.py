"""Frames → readings. What a frame cannot mean becomes NaN and is counted; nothing here raises."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import NamedTuple

from canid.types import NAN, Event, Flag, Frame, Reading, TrackReading
from canid.vehicle.bits import number
from canid.vehicle.mapping import Condition, MessageMap, RoleMap, SignalMap, TrackMap, Vehicle
from canid.vehicle.roles import QUICK

Decoded = Reading | TrackReading | Event

# A counter that repeats once or twice is a frame sent twice by a gateway; five at 20 Hz are a quarter of a
# second in which the sender's program did not run. A slow message is not waited for that long: what its counter has
# said for longer than the role's `stale` is as old as a message that does not come.
FROZEN_AFTER = 5
NO_DATA = int(Flag.REMOTE | Flag.ERROR)


class Life(NamedTuple):
    """A message's rolling counter: its last number, whether it moved, and how long it stands still."""

    last: float
    moved: bool = False
    still: int = 0
    moved_at: float = 0.0  # s, when it last moved


class Decoding(NamedTuple):
    """What decoding remembers."""

    counters: Mapping[str, int] = {}  # what was not measured, and why -> how often
    buses: Mapping[str, int] = {}  # message -> the bus that it is taken from
    elsewhere: Mapping[str, int] = {}  # message -> another bus, on which it was seen too
    lives: Mapping[tuple[str, int | None], Life] = {}  # by name and bus of the message
    seen: frozenset[str] = frozenset()  # roles (and "lead", of tracks) that came at least once


Init = Callable[[], Decoding]
Step = Callable[[Decoding, Frame], tuple[Decoding, list[Decoded]]]


class Plan(NamedTuple):
    """What to do with one message."""

    message: MessageMap
    roles: tuple[RoleMap, ...]
    tracks: tuple[TrackMap, ...]
    claimed: frozenset[int]  # buses on which this id is another message
    stale: float  # s, of the tracks' reports


def decoder(vehicle: Vehicle) -> tuple[Init, Step]:
    """Make the decoder of a vehicle.

    Returns:
        `init() -> state` and `step(state, frame) -> (state, what the frame says)`. A frame whose id is not
        mapped costs one dictionary look-up. `state.counters` says what was left out, and how often.

    Example:
        >>> from canid.vehicle import decoder, read_vehicle
        >>> init, step = decoder(read_vehicle("generic"))
        >>> state, readings = step(init(), Frame(0.5, 0, 0x110, bytes([50, 0, 0, 0])))
        >>> readings[0]
        Reading(t=0.5, role='pedal', value=20.0)
    """
    plans_of = table(vehicle)

    def step(state: Decoding, frame: Frame) -> tuple[Decoding, list[Decoded]]:
        plans = plans_of.get(frame.id)
        if plans is None or frame.flags & NO_DATA:
            return state, []
        out: list[Decoded] = []
        for plan in plans:
            if plan.message.extended == bool(frame.flags & 1):  # Flag.EXTENDED; the enum is slow
                state = _step(plan, state, frame, out)
        return state, out

    return Decoding, step


def table(vehicle: Vehicle) -> dict[int, tuple[Plan, ...]]:
    """Tabulate message id -> what to do."""
    plans: dict[int, tuple[Plan, ...]] = {}
    for message in vehicle.messages:
        key = (message.name, message.bus)
        same = (message.id, message.extended)
        others = {m.bus for m in vehicle.messages if (m.id, m.extended) == same and m != message}
        plan = Plan(
            message,
            tuple(role for role in vehicle.roles.values() if (role.message, role.bus) == key),
            tuple(track for track in vehicle.lead.tracks or () if (track.message, track.bus) == key),
            frozenset(bus for bus in others if bus is not None),
            QUICK if vehicle.lead.stale is None else vehicle.lead.stale,
        )
        plans[message.id] = (*plans.get(message.id, ()), plan)
    return plans


def _step(plan: Plan, state: Decoding, frame: Frame, out: list[Decoded]) -> Decoding:
    message = plan.message
    state, taken, event = taken_from(plan, state, frame.bus, frame.t)
    if event is not None:
        out.append(event)
    if not taken:
        return state if frame.bus in plan.claimed else counted(state, {ignored(message, frame.bus): 1})

    data = frame.data
    bits = 8 * len(data)
    little, big = int.from_bytes(data, "little"), int.from_bytes(data, "big")
    problems: list[str] = []
    still, age = 0, 0.0
    if message.counter is not None:
        raw = _raw(message.counter, little, big, bits)
        if raw is not None:
            key = (message.name, message.bus)
            life = _life(state.lives.get(key), raw, frame.t)
            still, age = life.still, frame.t - life.moved_at if life.moved else 0.0
            state = state._replace(lives={**state.lives, key: life})
    for selector, where, defined in message.selectors:
        raw = _raw(where, little, big, bits)
        if raw is not None and raw not in defined:
            problems.append(undefined(message, selector, raw))

    for role in plan.roles:
        value = _value(role.how, role.role, little, big, bits, problems)
        if value is None:
            continue
        if (still >= FROZEN_AFTER or age > role.stale) and value == value:
            problems.append(stale(role.role, message.name))
            value = NAN
        out.append(Reading(frame.t, role.role, value))
        if role.role not in state.seen:
            state = state._replace(seen=state.seen | {role.role})
    alive = still < FROZEN_AFTER and not age > plan.stale
    for track in plan.tracks:
        out.append(_track(track, frame.t, alive, little, big, bits, problems))
        if "lead" not in state.seen:
            state = state._replace(seen=state.seen | {"lead"})
    return counted(state, Counter(problems)) if problems else state


def taken_from(plan: Plan, state: Decoding, bus: int, t: float) -> tuple[Decoding, bool, Event | None]:
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
    there first; the neighbours tell which of the two is meant.
    """
    others = [of for other, of in state.buses.items() if other != name]
    return others.count(bus) > others.count(-1 if taken is None else taken)


# What is counted, in words that live and desk share.


def ignored(message: MessageMap, bus: int) -> str:
    """A frame with the message's id on a bus that is not the message's."""
    return f"{message.name}: frame on bus {bus} ignored"


def undefined(message: MessageMap, selector: str, raw: float) -> str:
    """A multiplexer's value that stands for nothing."""
    return f"{message.name}: {selector} = {raw:g} is not defined in the DBC"


def short(what: str) -> str:
    """A frame that ends before the signal does."""
    return f"{what}: frame too short"


def no_value(what: str, text: str) -> str:
    """A value-table entry that says that there is none."""
    return f'{what}: "{text}"'


def out_of_range(what: str) -> str:
    """A value outside what the vehicle file or the DBC allows."""
    return f"{what}: out of range"


def stale(what: str, message: str) -> str:
    """A message whose sender does not run."""
    return f"{what}: stale, the counter of {message} stands still"


def counted(state: Decoding, problems: Mapping[str, int]) -> Decoding:
    """Add to what was not measured."""
    counters = dict(state.counters)
    for problem, n in problems.items():
        counters[problem] = counters.get(problem, 0) + n
    return state._replace(counters=counters)


def _life(life: Life | None, raw: float, t: float) -> Life:
    if life is None:
        return Life(raw)
    if raw != life.last:
        return Life(raw, True, 0, t)
    return life._replace(still=life.still + 1) if life.moved else life


def _raw(where: tuple[int, int, bool, bool, bool], little: int, big: int, bits: int) -> float | None:
    """As `bits.raw_of`, with the frame's two readings as an integer made once for all its signals."""
    start, length, motorola, signed, floating = where
    if motorola:
        end = (start | 7) - start + (start & ~7) + length
        if end > bits:
            return None
        raw = big >> (bits - end)
    else:
        if start + length > bits:
            return None
        raw = little >> start
    raw &= (1 << length) - 1
    if not signed and not floating:
        return raw
    return number(raw, where)  # type: ignore[arg-type]


def _value(how: SignalMap, what: str, little: int, big: int, bits: int, problems: list[str]) -> float | None:
    """Compute the value in the role's unit: NaN, there is none; None, the frame does not carry it."""
    if how.when and not _present(how.when, little, big, bits):
        return None
    raw = _raw(how.bits, little, big, bits)
    if raw is None:
        problems.append(short(what))
        return NAN
    if how.no_value and raw in how.no_value:
        problems.append(no_value(what, how.no_value[int(raw)]))
        return NAN
    value = raw * how.factor + how.offset
    if not how.low <= value <= how.high:
        problems.append(out_of_range(what))
        return NAN
    if how.kind != "bool":
        return value
    true = value != 0.0 if how.on is None else value in how.on
    return float(true != how.invert)


def _present(when: Condition, little: int, big: int, bits: int) -> bool:
    return all(_raw(where, little, big, bits) in values for where, values in when)


def _track(
    track: TrackMap, t: float, alive: bool, little: int, big: int, bits: int, problems: list[str]
) -> TrackReading:
    """Make one track's report. An invalid track's numbers mean nothing: NaN, and nothing to count."""
    unknown: list[str] = []
    valid = 1.0 if track.valid is None else _value(track.valid, "track", little, big, bits, unknown)
    if valid != 1.0:
        return TrackReading(t, track.track, NAN, NAN, NAN, False, False)
    if not alive:
        problems.append(stale("track", track.message))
        return TrackReading(t, track.track, NAN, NAN, NAN, False, False)

    def value(how: SignalMap | None, what: str) -> float:
        found = None if how is None else _value(how, what, little, big, bits, problems)
        return NAN if found is None else found

    distance, rate = value(track.distance, "track distance"), value(track.rate, "track rate")
    new = value(track.new, "track new") == 1.0
    there = distance == distance and rate == rate
    return TrackReading(t, track.track, distance, rate, value(track.lateral, "track lateral"), there, new)


def seen(state: Decoding) -> frozenset[str]:
    """Name the roles that came at least once (with or without a value); "lead" stands for radar tracks."""
    return state.seen


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
    if item.bus is not None:
        other = state.elsewhere.get(item.message)
        but = f", but on bus {other}" if other is not None else ""
        return f"never seen on bus {item.bus}{but}"
    if item.message in state.buses:
        how = item.how.signal if isinstance(item, RoleMap) else "its signals"
        return f"came, but never with {how} (a multiplexed signal)"
    return "never seen"
