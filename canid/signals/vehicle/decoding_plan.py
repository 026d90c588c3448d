"""What to do with each frame: a vehicle's messages, tabulated by id and by J1939 parameter group."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.signals.vehicle import j1939
from canid.signals.vehicle.bits import EXACT_BITS, Bools, Rows
from canid.signals.vehicle.mapping import MessageMap, RoleMap, SignalMap, TrackMap, Vehicle, carried
from canid.values.roles import CONTROL_MAX_AGE_S
from canid.values.types import Array


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
    made: tuple[RoleMap, ...]  # roles that are made of others


def make_table(vehicle: Vehicle) -> Table:
    """Tabulate what to do, by id and by parameter group."""
    by_id: dict[int, tuple[Plan, ...]] = {}
    by_group: dict[int, tuple[Plan, ...]] = {}
    first = {id_: k for k, id_ in enumerate(dict.fromkeys(message.id for message in vehicle.messages))}
    read = carried(vehicle.roles.values())
    for message in vehicle.messages:
        key = (message.name, message.bus, message.source)
        others = [
            m for m in vehicle.messages if m != message and j1939.matches(m, message.id, message.extended)
        ]
        rivals = {m.bus for m in others if m.source == message.source and m.container is None}
        roles = tuple(r for r in read if (r.message, r.bus, r.source) == key)
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
    return Table(by_id, by_group, tuple(role for role in vehicle.roles.values() if role.parts))


def _is_plain(how: SignalMap) -> bool:
    whole = not how.bits.floating and how.bits.length <= EXACT_BITS and how.bits.end <= 64
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
