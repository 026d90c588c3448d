"""Numbers with unit and interval, at the precision that their doubt allows; and names of roles and causes for people."""

from __future__ import annotations

import math

from canid.types import Interval
from canid.vehicle.roles import ROLES
from canid.views.words import INPUT_UNITS, INPUT_WORDS, OUTPUT_UNITS, SYMBOLS

# significant digits of a number that has no interval to tell how many make sense
PLAIN_DIGITS = 3
# decimals that a reader can still take in, however narrow the interval
MOST_DECIMALS = 6
# what `vehicle.roles` spells for a keyboard
SPELT = {"m/s2": "m/s²", "deg": "°"}
# units of what `vehicle.roles` does not have because it is derived
DERIVED_UNITS = {"headway": "s", "lead_accel": "m/s²", **INPUT_UNITS}


def decimals(iv: Interval) -> int:
    """Tell how many decimals the width of an interval allows: two digits of its half.

    Example:
        >>> decimals(Interval(0.34, 0.28, 0.41)), decimals(Interval(31.4, 24.0, 37.0))
        (2, 0)
    """
    width = iv.high - iv.low
    if not (math.isfinite(width) and width > 0.0):
        return 2
    return min(max(1 - math.floor(math.log10(width)), 0), MOST_DECIMALS)


def measure(iv: Interval, unit: str = "") -> str:
    """Value, 95 % interval, unit; a dash where there is nothing to tell.

    Example:
        >>> measure(Interval(0.3412, 0.281, 0.409), "s"), measure(Interval(), "s")
        ('0.34 [0.28, 0.41] s', '–')
        >>> measure(Interval(2.0), "s")
        '2.00 [–, –] s'
    """
    if not math.isfinite(iv.value):
        return "–"
    places = decimals(iv)
    low, high = (f"{x:.{places}f}" if math.isfinite(x) else "–" for x in (iv.low, iv.high))
    return _with_unit(f"{iv.value:.{places}f} [{low}, {high}]", unit)


def percent(iv: Interval) -> str:
    """Write a share as per cent.

    Example:
        >>> percent(Interval(0.31, 0.24, 0.37))
        '31 [24, 37] %'
    """
    return measure(Interval(*(100.0 * x for x in iv)), "%")


def number(x: float, unit: str = "") -> str:
    """Write a number that has no interval: three digits, and its unit.

    Example:
        >>> number(2.1187, "m/s"), number(1234.5), number(float("nan"), "s")
        ('2.12 m/s', '1234', '–')
    """
    if not math.isfinite(x):
        return "–"
    text = f"{x:.0f}" if abs(x) >= 10**PLAIN_DIGITS else f"{x:.{PLAIN_DIGITS}g}"
    return _with_unit(text, unit)


def stretch(start: float, stop: float) -> str:
    """From when to when, in s of the log: what --start and --stop take.

    Example:
        >>> stretch(312.0, 342.04)
        '312–342 s'
    """
    places = 0 if stop - start >= 10.0 else 1
    return f"{start:.{places}f}–{stop:.{places}f} s"


def role_unit(role: str) -> str:
    """Unit of a role, derived ones included; empty where it has none.

    Example:
        >>> role_unit("accel"), role_unit("headway"), role_unit("brake")
        ('m/s²', 's', '')
    """
    if role in DERIVED_UNITS:
        return DERIVED_UNITS[role]
    unit = ROLES[role].unit if role in ROLES else ""
    return SPELT.get(unit, unit)


def spoken(name: str) -> str:
    """Write a role or a cause as people say it.

    Example:
        >>> spoken("headway_dead_zone"), spoken("headway_error")
        ('headway dead zone', 'headway error')
    """
    return INPUT_WORDS.get(name, name.replace("_", " "))


def either(names: tuple[str, ...]) -> str:
    """Name causes that cannot be told apart.

    Example:
        >>> either(("standstill_gap", "range_offset"))
        'standstill gap or range offset'
    """
    return " or ".join(map(spoken, names))


def shifted(key: str, output: str) -> tuple[str, str]:
    """Name and unit of a parameter in `Report.shifts`.

    Example:
        >>> shifted("range_rate K", "pedal"), shifted("range_rate tau", "pedal"), shifted("p0", "pedal")
        (('range rate K', '% per m/s'), ('range rate τ', 's'), ('p0', '%'))
    """
    channel, _, what = key.rpartition(" ")
    name = f"{spoken(channel)} {SYMBOLS.get(what, what)}".strip()
    unit = OUTPUT_UNITS.get(output, "")
    if not channel:
        return name, unit
    if what == "K" and channel in INPUT_UNITS:
        return name, f"{unit} per {INPUT_UNITS[channel]}"
    return name, "s" if what in ("tau", "dead_time", "tau_plus_dead_time") else ""


def _with_unit(text: str, unit: str) -> str:
    # "1" is how a parameter says that it has no unit
    return f"{text} {unit}" if unit not in ("", "1") else text
