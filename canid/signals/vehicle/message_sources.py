"""Which of the frames with a message's id are the message: by its bus, and by its sender (J1939)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping

import numpy as np

from canid.signals.vehicle import j1939
from canid.signals.vehicle.bits import Rows
from canid.signals.vehicle.decoding_plan import Plan
from canid.signals.vehicle.decoding_state import Decoding
from canid.signals.vehicle.mapping import MessageMap
from canid.signals.vehicle.signal_values import among
from canid.values.types import Columns, Event, Flag

NO_DATA = int(Flag.REMOTE | Flag.ERROR)

# buses that are counted by name: more than a car has, and a hostile log has 65,535
_NAMED_BUSES = 64
# frames whose bus is decided one by one before asking again whether the rest is settled
_FRAMES_PER_ROUND = 256

_Found = list[tuple[Plan, Rows]]


def frames_of_groups(
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
    matched: _Found = []
    for group, of_group in wanted.items():
        rows = np.flatnonzero(among(chunk.id, frozenset(of_group)))
        rows = rows[(chunk.flags[rows] & (NO_DATA | 1)) == 1]
        for plan in by_group[group] if rows.size else ():
            mine = rows
            if plan.message.source is not None:
                home = chunk.id[rows] & 0xFF == plan.message.source
                mine = rows[home]
                state = _ignore_senders(plan, rows[~home], state, chunk, problems)
            if mine.size:
                matched.append((plan, mine))
    return state, matched


def keep_sender(
    matched: _Found,
    state: Decoding,
    chunk: Columns,
    events: list[tuple[int, Event]],
    problems: Counter[str],
) -> tuple[Decoding, _Found]:
    """Keep the frames of the first sender of each J1939 message whose source the vehicle file does not name."""
    kept: _Found = []
    for plan, rows in matched:
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


def keep_bus(
    matched: _Found,
    state: Decoding,
    chunk: Columns,
    events: list[tuple[int, Event]],
    problems: Counter[str],
) -> tuple[Decoding, _Found]:
    """Keep the frames on their message's bus."""
    out: dict[int, list[Rows]] = {}
    unsettled: dict[int, Rows] = {}
    for k, (plan, rows) in enumerate(matched):
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
            if (chunk.bus[rows] == state.buses.get(matched[k][0].message.name, -1)).all():
                out.setdefault(k, []).append(unsettled.pop(k))
        state = _decide_frame_by_frame(matched, unsettled, out, state, chunk, events, problems)
    kept = {k: np.concatenate(parts) for k, parts in sorted(out.items())}
    return state, [(matched[k][0], rows) for k, rows in kept.items() if rows.size]


def _decide_frame_by_frame(
    matched: _Found,
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
        plan, bus = matched[k][0], int(chunk.bus[row])
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
    others = [its_bus for other, its_bus in state.buses.items() if other != name]
    return others.count(bus) > others.count(-1 if taken is None else taken)


def _ignored_text(message: MessageMap, bus: int) -> str:
    """A frame with the message's id on a bus that is not the message's."""
    where = f"bus {bus}" if bus < _NAMED_BUSES else f"a bus from {_NAMED_BUSES} on"
    return f"{message.name}: frame on {where} ignored"


def _sender_text(message: MessageMap, source: int) -> str:
    """A frame of the message's parameter group from a sender that is not the message's."""
    return f"{message.name}: frame from source 0x{source:02X} ignored"
