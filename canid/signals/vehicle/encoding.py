"""Encoding of values by role into frames, for simulated logs and tests: the inverse of decoding."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from canid.signals.vehicle.bits import Bits, put
from canid.signals.vehicle.containers import wrapped
from canid.signals.vehicle.j1939 import with_source
from canid.signals.vehicle.mapping import MessageMap, SignalMap, TrackMap, Vehicle, carried
from canid.values.bus_names import on_log
from canid.values.types import NAN, Flag, Frame

Encode = Callable[..., list[Frame]]


class _Slot(NamedTuple):
    """One signal to fill, from the value of one role; its place in the frame computed beforehand."""

    role: str
    how: SignalMap
    low: float  # smallest and largest raw number
    high: float
    shift: int  # of the raw number in the frame as one integer, read in the signal's own byte order
    mask: int


def _slot(role: str, how: SignalMap, length: int) -> _Slot:
    shift = 8 * length - how.bits.end if how.bits.motorola else how.bits.start
    low, high = how.bits.reach
    if how.reserved is not None:
        high = how.reserved[0] - 1.0
    return _Slot(role, how, low, high, shift, (1 << how.bits.length) - 1)


class _Plan(NamedTuple):
    message: MessageMap
    # Per page of a multiplexed message (one page without): the selectors' raw numbers in place, the signals.
    pages: tuple[tuple[int, tuple[_Slot, ...]], ...]


def encoder(vehicle: Vehicle) -> Encode:
    """Make the encoder of a vehicle.

    Returns:
        `encode(t, values, due=None) -> frames` at time t. `values` maps role -> value in the role's unit; NaN
        (or a role left out) is written as the value table's "no target" or the like, else as a number
        outside the signal's range, else as 0. Values beyond a signal's range are clipped to it. `due` maps
        the names of the messages to send to how often each was sent before: counters and the pages of
        multiplexed messages follow it; None sends all for the first time. Of radar tracks, the first one
        carries gap and range_rate straight ahead and the others are invalid.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> encode = encoder(read_vehicle("generic"))
        >>> encode(1.5, {"pedal": 20.0}, {"ENGINE_DATA": 3})[0].data.hex()
        '32ff3f3f'
    """
    plans = {message.name: _plan(vehicle, message) for message in vehicle.messages}

    def encode(t: float, values: Mapping[str, float], due: Mapping[str, int] | None = None) -> list[Frame]:
        sent = dict.fromkeys(plans, 0) if due is None else due
        return [_frame(t, plans[name], values, tick) for name, tick in sent.items()]

    return encode


def _plan(vehicle: Vehicle, message: MessageMap) -> _Plan:
    slots = [
        _slot(role.role, role.how, message.length)
        for role in carried(vehicle.roles.values())
        if (role.message, role.bus, role.source) == (message.name, message.bus, message.source)
    ]
    for track in vehicle.lead.tracks or ():
        if (track.message, track.bus, track.source) == (message.name, message.bus, message.source):
            slots += _track_slots(track, message.length)
    # A page is one choice of the selectors; each signal's own condition is the choice that shows it.
    choices = {tuple((where, min(values)) for where, values in slot.how.when) for slot in slots}
    # Signals outside every page are in all of them; they need a page of their own only if there is no other.
    choices = {choice for choice in choices if choice} or {()}
    return _Plan(message, tuple(_page(message, choice, slots) for choice in sorted(choices)))


def _page(
    message: MessageMap, choice: tuple[tuple[Bits, int], ...], slots: list[_Slot]
) -> tuple[int, tuple[_Slot, ...]]:
    selected = dict(choice)
    word = 0
    for where, raw in choice:
        word |= put(where, raw, message.length)
    shown = [s for s in slots if all(selected.get(where) in values for where, values in s.how.when)]
    return word, tuple(shown)


def _track_slots(track: TrackMap, length: int) -> list[_Slot]:
    first = track.track == 0
    parts = (
        ("gap", track.distance),
        ("range_rate", track.rate),
        ("lead_valid", track.valid),
        ("zero", track.lateral),
        ("zero", track.angle),
    )
    # "none" is never in the values: it is written as "no value", 0 for a yes/no signal.
    return [_slot(role if first else "none", how, length) for role, how in parts if how is not None]


def _frame(t: float, plan: _Plan, values: Mapping[str, float], tick: int) -> Frame:
    message = plan.message
    word, slots = plan.pages[tick % len(plan.pages)]
    if message.counter is not None:
        word |= put(message.counter, tick % (1 << message.counter.length), message.length)
    little = big = 0
    for slot in slots:
        raw = _raw(slot, 0.0 if slot.role == "zero" else values.get(slot.role, NAN))
        if slot.how.bits.floating:
            word |= put(slot.how.bits, raw, message.length)
        elif slot.how.bits.motorola:
            big |= (int(raw) & slot.mask) << slot.shift
        else:
            little |= (int(raw) & slot.mask) << slot.shift
    word |= little | int.from_bytes(big.to_bytes(message.length, "big"), "little")
    data = word.to_bytes(message.length, "little")
    if message.container is not None:
        data = wrapped(message.container, data)
    flags = int(Flag.EXTENDED) if message.extended else 0
    if len(data) > 8:
        flags |= int(Flag.FD)  # classic CAN carries 8 bytes at most
    return Frame(t, on_log(message.bus, {}) or 0, with_source(message.id, message.source), data, flags)


def _raw(slot: _Slot, value: float) -> float:
    """Return the raw number that decodes to the value, as near as its resolution allows."""
    how = slot.how
    if how.kind == "bool":
        return _raw_bool(how, value)
    if math.isnan(value):
        return _raw_no_value(how)
    raw = (min(max(value, how.low), how.high) - how.offset) / how.factor
    if how.bits.floating:
        return raw
    whole = min(max(round(raw), slot.low), slot.high)
    if not how.no_value:
        return whole
    # The range is one LSB wider than the DBC's, and next to its end lie the numbers that mean "no value".
    return next((w for w in (whole, whole - 1, whole + 1) if int(w) not in how.no_value), whole)


def _raw_bool(how: SignalMap, value: float) -> float:
    true = (not math.isnan(value) and value != 0.0) != how.invert
    wanted = (min(how.on) if how.on else 1.0) if true else 0.0
    return (wanted - how.offset) / how.factor


def _raw_no_value(how: SignalMap) -> float:
    if how.reserved is not None:
        return (1 << how.bits.length) - 1.0
    if how.no_value:
        return next(iter(how.no_value))
    if how.bits.floating:
        return NAN
    for raw in reversed(how.bits.reach):
        if not how.low <= raw * how.factor + how.offset <= how.high:
            return raw
    return 0.0
