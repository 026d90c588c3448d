"""A vehicle on the buses of one log: names in the vehicle file become the numbers of that log."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from canid.signals.vehicle.mapping import RoleMap, Vehicle
from canid.values.bus_names import NamedBus


def on_buses(vehicle: Vehicle, numbers: Mapping[str, int]) -> Vehicle:
    """Give every mapped message the number that its bus has in a log.

    A log of one interface alone has one bus: where the vehicle file binds everything to one bus as well, it is meant,
    whatever their numbers (a log of can1, a file with `bus = 0`).

    Args:
        vehicle: from `read_vehicle`.
        numbers: interface -> bus, as the log has them; empty where its format has numbers and no names.

    Example:
        >>> from canid.signals.vehicle.vehicle_file import read_vehicle
        >>> car = read_vehicle("generic")
        >>> on_buses(car, {"can1": 1}) is car
        True
    """
    new = numbers_in(numbers, vehicle)
    if all(number == bus for bus, number in new.items()):
        return vehicle
    lead = vehicle.lead
    if lead.tracks is not None:
        lead = lead._replace(tracks=tuple(t._replace(bus=_new(t.bus, new)) for t in lead.tracks))
    return vehicle._replace(
        roles={role: _moved(mapped, new) for role, mapped in vehicle.roles.items()},
        lead=lead,
        messages=tuple(m._replace(bus=_new(m.bus, new)) for m in vehicle.messages),
    )


def numbers_in(numbers: Mapping[str, int], vehicle: Vehicle, others: Iterable[int] = ()) -> dict[int, int]:
    """The number in a log of each bus to which a vehicle file binds a mapped message, and of `others` that it names."""
    bound = {message.bus for message in vehicle.messages if message.bus is not None}
    new = {bus: bus.on(numbers) if isinstance(bus, NamedBus) else bus for bus in {*bound, *others}}
    named = any(isinstance(bus, NamedBus) for bus in bound)
    if len(numbers) == 1 and len(bound) == 1 and not named:
        new |= dict.fromkeys(bound, next(iter(numbers.values())))
    return new


def _moved(role: RoleMap, new: Mapping[int, int]) -> RoleMap:
    return role._replace(bus=_new(role.bus, new), parts=tuple(_moved(part, new) for part in role.parts))


def _new(bus: int | None, new: Mapping[int, int]) -> int | None:
    return None if bus is None else new.get(bus, bus)
