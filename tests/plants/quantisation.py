"""Through the DBC and back, a whole column at once: what `vehicle.encoder` and `vehicle.decoder` do value by value.

Worth its lines because a benchmark of hundreds of logs spends half its time there; a test holds it against both.
"""

from __future__ import annotations

import numpy as np

from canid.signals.vehicle import Vehicle
from canid.signals.vehicle.mapping import SignalMap
from tests.plants.planted_drive import Array
from tests.plants.sensors import NAN, Message


def whole(how: SignalMap) -> bool:
    """Return whether this signal is one that `through` knows: no IEEE float."""
    return not how.bits.floating


def through(how: SignalMap, values: Array) -> Array:
    """What remains of (m,) values once they were written into frames and read again, NaN for nothing.

    >>> from canid.signals.vehicle import read_vehicle
    >>> through(read_vehicle("generic").roles["pedal"].how, np.array([12.3, -5.0, NAN])).tolist()
    [12.4, 0.0, nan]
    """
    lowest, highest = how.bits.reach
    if how.kind == "bool":
        wanted = (np.nan_to_num(values, nan=0.0) != 0.0) != how.invert
        raw = np.trunc((np.where(wanted, min(how.on) if how.on else 1.0, 0.0) - how.offset) / how.factor)
    else:
        given = np.clip(values, how.low, how.high)
        raw = np.clip(np.rint((given - how.offset) / how.factor), lowest, highest)
        for taken in how.no_value:
            # next to a number that means "nothing" the neighbour is taken, the lower one first
            raw = np.where(raw == taken, taken - 1 if taken - 1 not in how.no_value else taken + 1, raw)
        raw = np.where(np.isnan(values), _nothing(how), raw)
    out = raw * how.factor + how.offset
    out = np.where((out < how.low) | (out > how.high) | np.isin(raw, list(how.no_value)), NAN, out)
    if how.kind != "bool":
        return out
    true = out != 0.0 if how.on is None else np.isin(out, list(how.on))
    return np.where(np.isnan(out), NAN, (true != how.invert).astype(float))


def _nothing(how: SignalMap) -> float:
    """The raw number that is written where there is nothing."""
    if how.no_value:
        return float(next(iter(how.no_value)))
    beyond = [r for r in reversed(how.bits.reach) if not how.low <= r * how.factor + how.offset <= how.high]
    return beyond[0] if beyond else 0.0


def readings(message: Message, vehicle: Vehicle) -> dict[str, tuple[Array, Array]]:
    """Role -> (times s, values) as the decoder would give them; pages of a multiplexed message take turns."""
    roles = [r for r in vehicle.roles.values() if (r.message, r.bus) == (message.of.name, message.of.bus)]
    pages = sorted({_page(r.how) for r in roles} - {()}) or [()]
    out = {}
    for role in roles:
        page = _page(role.how)
        every = slice(pages.index(page), None, len(pages)) if page in pages else slice(None)
        t = message.t[every]
        values = message.values.get(role.role)
        out[role.role] = t, through(role.how, np.full(len(t), NAN) if values is None else values[every])
    return out


def _page(how: SignalMap) -> tuple[object, ...]:
    return tuple((where, min(values)) for where, values in how.when)
