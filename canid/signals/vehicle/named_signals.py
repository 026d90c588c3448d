"""Any signal of a vehicle's DBC files, as "MESSAGE.SIGNAL" in the DBC's own unit: not only those that have a role."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from canid.signals.vehicle.database import Dbc, message_map
from canid.signals.vehicle.mapping import MessageMap, RoleMap
from canid.signals.vehicle.schema import SignalEntry
from canid.signals.vehicle.signal_resolution import (
    Mistakes,
    find_message,
    find_signal,
    find_source,
    signal_map,
)
from canid.values.roles import SWITCH_MAX_AGE_S, Role

# periods of a message after which its last value is not measured any more: five missed are no jitter
_MAX_MISSED = 5


class NamedSignal(NamedTuple):
    """A signal by its name in the DBC, as decoding needs it."""

    role: RoleMap  # whose role is the name, and whose unit is the DBC's
    message: MessageMap


def names_of(files: Sequence[Dbc]) -> list[str]:
    """All names "MESSAGE.SIGNAL"."""
    return [f"{m.name}.{s.name}" for file in files for m in file.messages.values() for s in m.signals]


def named_signal(name: str, files: Sequence[Dbc]) -> NamedSignal | str:
    """Find a signal by "MESSAGE.SIGNAL"; a sentence where there is none, or no frame can carry it.

    Example:
        >>> from canid.signals.vehicle.vehicle_file import read_databases
        >>> found = named_signal("EGO_SPEED.Speed", read_databases("generic"))
        >>> found if isinstance(found, str) else (found.role.unit, found.message.id)
        'EGO_SPEED.Speed: no signal "Speed" in message EGO_SPEED (did you mean "VehicleSpeed"?)'
    """
    message_name, _, signal_name = name.partition(".")
    match = find_message(message_name, None, files, name)
    if isinstance(match, str):
        return match
    dbc, message = match
    signal = find_signal(signal_name, message, name)
    if isinstance(signal, str):
        return signal
    mistakes = Mistakes([], [])
    # a state: a text of the value table (a gear, a mode) is a value, unless it says that there is none
    how = signal_map(SignalEntry(signal=name), message, signal, Role("", "state", ""), name, mistakes)
    if how is None:
        return mistakes.errors[0]
    late = _MAX_MISSED * message.period if math.isfinite(message.period) else 0.0
    role = RoleMap(
        role=name,
        message=message.name,
        id=message.id,
        extended=message.extended,
        bus=dbc.bus,
        unit=signal.unit,
        stale=max(SWITCH_MAX_AGE_S, late),
        how=how,
        source=find_source(None, message, dbc, name, mistakes),
    )
    whole = message_map(message, dbc.bus, role.source)
    return NamedSignal(role, whole._replace(length=max(whole.length, -(-how.bits.end // 8))))
