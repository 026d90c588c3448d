"""What decoding remembers from chunk to chunk, what it gives, and what never came."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from canid.signals.vehicle.bits import Bools, Rows
from canid.signals.vehicle.mapping import RoleMap, TrackMap, Vehicle, carried
from canid.signals.vehicle.message_counter import AliveCounter
from canid.signals.vehicle.transport_protocol import Transfer
from canid.values.types import Array, Event


class Decoding(NamedTuple):
    """What decoding remembers."""

    counters: Mapping[str, int] = {}  # what was not measured, and why -> how often
    buses: Mapping[str, int] = {}  # message -> the bus that it is taken from
    elsewhere: Mapping[str, int] = {}  # message -> another bus, on which it was seen too
    senders: Mapping[str, int] = {}  # J1939 message -> the source address that it is taken from
    other_senders: Mapping[str, int] = {}  # J1939 message -> another source that sent it too
    # by name, bus and source of the message
    alive: Mapping[tuple[str, int | None, int | None], AliveCounter] = {}
    # of what roles are made of: the latest reading, s and in its unit
    parts: Mapping[str, tuple[float, float]] = {}
    transfers: Mapping[tuple[int, int, int], Transfer] = {}  # J1939 messages that come in packets
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
    # of the driver's pedal: several different ones show a wrong scale
    out_of_range: tuple[RoleReadings, ...] = ()


def add_counts(state: Decoding, problems: Mapping[str, int]) -> Decoding:
    """Add to what was not measured."""
    counters = dict(state.counters)
    for problem, n in problems.items():
        counters[problem] = counters.get(problem, 0) + n
    return state._replace(counters=counters)


def missing(vehicle: Vehicle, state: Decoding) -> list[str]:
    """Say what is mapped and never came, one sentence each.

    Example:
        >>> from canid.signals.vehicle import decoder, read_vehicle
        >>> vehicle = read_vehicle("generic")
        >>> missing(vehicle, decoder(vehicle)[0]())[0]
        'pedal: message ENGINE_DATA (0x110) never seen'
    """
    lines = [
        f"{role.role}: message {role.message} (0x{role.id:X}) {_where(role, state)}"
        for role in carried(vehicle.roles.values())
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
