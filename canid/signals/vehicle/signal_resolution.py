"""Resolution of a vehicle file's entries to the DBC's signals: names, units, ranges, value tables."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import Dbc, bits_of, carried, condition_of
from canid.signals.vehicle.j1939 import PROTOCOL, first_no_value, own_source
from canid.signals.vehicle.mapping import SignalMap
from canid.signals.vehicle.quoting import brief, several, shown
from canid.signals.vehicle.schema import SignalEntry, did_you_mean
from canid.signals.vehicle.units import examples, factor_to, unit_of
from canid.values.roles import ROLES, Role
from canid.values.types import FullScale

# of factors, offsets and limits: beyond the widest of real units (mm to km, 2^-32 degrees), and far from where squares
# of values leave the range of a float
_MIN_FACTOR, _MAX_FACTOR = 1e-12, 1e12
# bytes of a frame of CAN FD, and of a J1939 message in packets, of which the first 64 are decoded
_FRAME_BYTES, _TRANSPORTED_BYTES = 64, 1785

# A value-table text that says "there is no value", for roles whose other texts are values (gear, switches).
_NO_VALUE_TEXT = re.compile(
    r"not.?avail|invalid|error|fault|fail|unknown|undefined|reserved|no.?(value|target|data|object|lane)|init"
    r"|(^|\W)(sna|n/?a)($|\W)",
    re.IGNORECASE,
)


class Mistakes(NamedTuple):
    """Errors and warnings, collected while a vehicle file is read."""

    errors: list[str]
    warnings: list[str]


def find_message(name: str, bus: int | None, files: Sequence[Dbc], key: str) -> tuple[Dbc, Message] | str:
    """Find the message of that name; of several files that hold it, the one of that bus, else the first."""
    holding = [file for file in files if name in file.messages]
    if not holding:
        known = [message for file in files for message in file.messages]
        where = several([file.file for file in files])
        return f'{key}: no message "{brief(name)}" in {where}{did_you_mean(name, known)}'
    chosen = next((file for file in holding if bus is not None and file.bus == bus), holding[0])
    return chosen, chosen.messages[name]


def find_source(given: int | None, message: Message, dbc: Dbc, key: str, mistakes: Mistakes) -> int | None:
    """The address from which a J1939 message is taken; None: the first that is seen."""
    if message.protocol == PROTOCOL:
        return given if given is not None else own_source(message, dbc.messages.values())
    if given is not None:
        mistakes.errors.append(
            f"{key}.source: is for J1939 messages, and {brief(message.name)} is none; where it is one, write "
            f'{{ file = "{brief(dbc.file)}", protocol = "j1939" }} in dbc'
        )
    return None


def find_signal(name: str, message: Message, key: str) -> Signal | str:
    """Find the signal of that name in a message."""
    known = {signal.name: signal for signal in message.signals}
    if name not in known:
        return f'{key}: no signal "{brief(name)}" in message {brief(message.name)}{did_you_mean(name, known)}'
    return known[name]


def signal_map(
    entry: SignalEntry, message: Message, signal: Signal, role: Role, key: str, mistakes: Mistakes
) -> SignalMap | None:
    """Return how the raw number of a signal is converted to the value of a role; None (and an error) if it cannot be."""
    to_role = _unit_factor(entry, signal, role, key)
    if isinstance(to_role, str):
        mistakes.errors.append(to_role)
        return None
    if entry.invert and role.kind != "bool":
        mistakes.errors.append(f"{key}.invert: is for yes/no roles; write scale = -1")
        return None
    if entry.on is not None and role.kind != "bool":
        mistakes.errors.append(f"{key}.on: is for yes/no roles only")
        return None
    if entry.full_scale is not None and role is not ROLES["pedal"]:
        mistakes.errors.append(f"{key}.full_scale: is for the pedal only")
        return None
    when = condition_of(message, signal)
    most = _TRANSPORTED_BYTES if message.protocol == PROTOCOL else _FRAME_BYTES
    if not carried(signal) or when is None or not 0 < message.length <= most:
        mistakes.errors.append(
            f"{key}: {brief(message.name)}.{brief(signal.name)} does not fit into a CAN frame: the DBC gives the message "
            f"{shown(message.length)} bytes, and the signal {shown(signal.length)} bits from bit {shown(signal.start)}; "
            "correct the DBC"
        )
        return None
    factor = signal.scale * entry.scale * to_role
    offset = (signal.offset * entry.scale + entry.offset) * to_role
    if not (_MIN_FACTOR <= abs(factor) <= _MAX_FACTOR and abs(offset) <= _MAX_FACTOR):
        mistakes.errors.append(
            f"{key}: {brief(signal.name)} has the factor {factor:g} and the offset {offset:g}, which cannot give "
            f"{role.unit or 'a number'}; check scale and offset here and in the DBC"
        )
        return None
    low, high = _range(entry, signal, key, mistakes)
    return SignalMap(
        signal=signal.name,
        bits=bits_of(signal),
        factor=factor,
        offset=offset,
        low=low * to_role,
        high=high * to_role,
        kind=role.kind,
        when=when,
        no_value={raw: brief(text) for raw, text in signal.choices.items() if _is_no_value(text, role)},
        on=None if entry.on is None else frozenset(entry.on),
        invert=entry.invert,
        reserved=first_no_value(message, signal),
        elsewhere=_elsewhere(entry, message, signal, role, key, mistakes),
    )


# %; where a pedal's range ends whose 100 % is full travel: 102 are 255 steps of 0.4, 102.3 are 1023 of 0.1
_FULL_SCALE_PERCENT = (99.0, 103.0)


def full_scale(entry: SignalEntry, signal: Signal, how: SignalMap) -> FullScale:
    """What says of a pedal that 100 % is its full travel: the vehicle file, or the range in the database.

    Args:
        entry: of the vehicle file. A scale in it is a claim that needs a reason of its own.
        signal: of the database.
        how: what the two come to.
    """
    high = max(raw * how.factor + how.offset for raw in how.bits.reach)
    if entry.full_scale is not None:
        return FullScale(f"the vehicle file states it: {brief(entry.full_scale)}", high)
    if entry.scale != 1.0 or entry.offset != 0.0:
        return FullScale("", high)
    least, most = _FULL_SCALE_PERCENT
    to_role = how.factor / signal.scale
    if signal.maximum is not None and least <= signal.maximum * to_role <= most:
        return FullScale(f"its range in the database ends at {signal.maximum * to_role:.4g} %", high)
    stated = signal.minimum is not None and signal.maximum is not None and signal.minimum < signal.maximum
    if not stated and signal.scale != 1.0 and least <= high <= most:
        return FullScale(f"its bits end at {high:.4g} % by the factor in the database", high)
    return FullScale("", high)


def _elsewhere(
    entry: SignalEntry, message: Message, signal: Signal, role: Role, key: str, mistakes: Mistakes
) -> tuple[SignalMap, ...]:
    """The same for the other pages of a signal that lies or is scaled differently there."""
    maps = (signal_map(entry, message, each, role, key, mistakes) for each in signal.elsewhere)
    return tuple(how for how in maps if how is not None)


def _is_no_value(text: str, role: Role) -> bool:
    if role.kind == "number":
        # A text that is itself a number ("0.5 m") only labels the value.
        return re.match(r"[+-]?\d", text) is None
    return _NO_VALUE_TEXT.search(text) is not None


def _unit_factor(entry: SignalEntry, signal: Signal, role: Role, key: str) -> float | str:
    """Find the factor from the signal's unit to the role's."""
    if not role.unit:
        return 1.0
    source = entry.unit if entry.unit is not None else signal.unit
    factor = factor_to(source, role.unit)
    if factor is not None:
        return factor
    if entry.unit is None and entry.scale != 1.0 and unit_of(source) is None:
        return 1.0  # a scale for an unknown unit converts to the role's own unit
    known = examples(role.unit)
    if entry.unit is not None:
        return f'{key}.unit: "{brief(entry.unit)}" cannot be converted to {role.unit}; use one of {known}'
    has = (
        f'has the unit "{brief(source)}", which cannot be converted to {role.unit}'
        if source
        else "has no unit in the DBC"
    )
    return f'{key}: {brief(signal.name)} {has}; set unit = "..." ({known}), or scale = ... to {role.unit}'


def _range(entry: SignalEntry, signal: Signal, key: str, mistakes: Mistakes) -> tuple[float, float]:
    """Find the limits in the entry's unit: its own `valid`, else the DBC's where it is plausible."""
    if entry.valid is not None:
        return entry.valid[0], entry.valid[1]
    low, high = signal.minimum, signal.maximum
    # [0|0] means in a DBC that no range is given.
    if low is None or high is None or not -math.inf < low < high < math.inf:
        return -math.inf, math.inf
    # One LSB: the range is a rounded decimal number, as 102.3 for 1023 · 0.1.
    lsb = 0.0 if signal.floating else abs(signal.scale)
    ends = sorted(raw * signal.scale + signal.offset for raw in bits_of(signal).reach)
    cuts_low, cuts_high = low > ends[0] + lsb, high < ends[1] - lsb
    beyond_low, beyond_high = low < ends[0] - lsb, high > ends[1] + lsb
    if (cuts_low and beyond_high) or (cuts_high and beyond_low):
        # The range forbids values that the signal can take and allows some that it cannot: it was written in
        # raw numbers or in another unit. Applying it would discard good data.
        mistakes.warnings.append(
            f"{key}: the DBC's range [{low:g}|{high:g}] of {brief(signal.name)} does not fit its bits "
            f"({ends[0]:g} to {ends[1]:g}) and is ignored; set valid = [low, high]"
        )
        return -math.inf, math.inf
    limits = sorted(
        value * entry.scale + entry.offset
        for value in (low - lsb if cuts_low else -math.inf, high + lsb if cuts_high else math.inf)
    )
    return limits[0], limits[1]
