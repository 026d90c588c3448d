"""Numbers as text: value, 95 % interval and unit, with the decimals that the interval supports."""

from __future__ import annotations

import math

from canid.values import interval_text
from canid.values.interval_text import DASH as DASH
from canid.values.types import Interval

# significant digits of a number without an interval
PLAIN_DIGITS = 3
# what is smaller is 0 to every reader: no quantity of a drive has a unit in which that much matters
LEAST = 1e-9
# Units of the model's inputs and outputs and of derived quantities. All other roles have theirs in `vehicle.roles`, which
# imports cantools: too slow for the start of a recording.
UNITS = {
    "pedal": "%",
    "accel": "m/s²",
    "accel_command": "m/s²",
    "steering_angle": "°",
    "headway": "s",
    "headway_error": "s",
    "range_rate": "m/s",
    "lateral_offset": "m",
    "lead_accel": "m/s²",
}
# symbols for what `vehicle.roles` writes in ASCII
UNIT_SYMBOLS = {"m/s2": "m/s²", "deg": "°"}


def decimals(iv: Interval) -> int:
    """Decimals that the width of an interval supports: two significant digits of its half.

    Example:
        >>> decimals(Interval(0.34, 0.28, 0.41)), decimals(Interval(31.4, 24.0, 37.0))
        (2, 0)
    """
    return interval_text.decimals(iv.low, iv.high)


def interval(iv: Interval, unit: str = "", places: int | None = None) -> str:
    """Value, 95 % interval and unit; a dash where there is no estimate.

    Args:
        iv: value and interval.
        unit: of both.
        places: decimals; default: as many as the width of the interval supports. The live view fixes them, so that
            nothing jumps.

    Example:
        >>> interval(Interval(0.3412, 0.281, 0.409), "s"), interval(Interval(), "s")
        ('0.34 [0.28, 0.41] s', '–')
        >>> interval(Interval(2.0), "s"), interval(Interval(31.4, 24.0, 37.0), places=2)
        ('2.00 [–, –] s', '31.40 [24.00, 37.00]')
    """
    if not math.isfinite(iv.value):
        return DASH
    return _with_unit(interval_text.interval_text(*iv, places), unit)


def percent(iv: Interval) -> str:
    """A share as a percentage.

    Example:
        >>> percent(Interval(0.31, 0.24, 0.37))
        '31 [24, 37] %'
    """
    return interval(Interval(*(100.0 * x for x in iv)), "%")


def number(x: float, unit: str = "", digits: int = PLAIN_DIGITS) -> str:
    """A number without an interval: three significant digits, no fewer than its integer part has, and its unit.

    Example:
        >>> number(2.1187, "m/s"), number(999.7), number(float("nan"), "s"), number(0.12344, digits=4)
        ('2.12 m/s', '1000', '–', '0.1234')
        >>> number(-0.00008727), number(3e-12)
        ('-0.0000873', '0')
    """
    if not math.isfinite(x):
        return DASH
    # .3g of 999.7 would be 1e+03, and of 0.00008 8e-05
    if abs(x) < LEAST:
        text = "0"
    elif abs(x) >= 10**digits - 0.5:
        text = f"{x:.0f}"
    elif abs(x) < 1e-4:
        text = f"{x:.{digits - 1 - math.floor(math.log10(abs(x)))}f}".rstrip("0")
    else:
        text = f"{x:.{digits}g}"
    return _with_unit(text, unit)


def plural(n: int, what: str) -> str:
    """So many of something.

    Example:
        >>> plural(1, "drive"), plural(1200, "drive")
        ('1 drive', '1,200 drives')
    """
    return f"{n:,} {what}{'' if n == 1 else 's'}"


def fit_text(percent: float) -> str:
    """Fit of a simulation, 100 · (1 − rms error over rms about the mean); below 0 with what that means.

    Example:
        >>> fit_text(73.61), fit_text(-19.7)
        ('73.6 %', '-19.7 %, worse than the mean alone')
    """
    return f"{number(percent, '%')}{', worse than the mean alone' if percent < 0.0 else ''}"


def same_digits(low: float, high: float) -> int:
    """How many leading digits are the same in a range: those of a position are, over a drive.

    Example:
        >>> same_digits(46.8701, 46.8714), same_digits(16.85, 16.87), same_digits(0.0, 3.0), same_digits(2.0, 2.0)
        (4, 2, 0, 0)
    """
    span = high - low
    return math.floor(math.log10(max(abs(low), abs(high)) / span)) if 0.0 < span < math.inf else 0


def p_text(p: float) -> str:
    """A p-value in words; below a thousandth nobody decides by its size.

    Example:
        >>> p_text(0.0312), p_text(3e-05)
        ('p 0.03', 'p < 0.001')
    """
    return f"p {chance(p)}"


def chance(p: float, digits: int = 1) -> str:
    """A probability that chance alone does as much.

    Example:
        >>> chance(0.0312), chance(3e-05), chance(0.0312, 2)
        ('0.03', '< 0.001', '0.031')
    """
    return "< 0.001" if p < 0.001 else f"{p:.{digits}g}"


def time_range(start: float, stop: float) -> str:
    """Start and end in s of the log, as --start and --stop take them.

    Example:
        >>> time_range(312.0, 342.04)
        '312–342 s'
    """
    places = 0 if stop - start >= 10.0 else 1
    return f"{start:.{places}f}–{stop:.{places}f} s"


def clock(t: float) -> str:
    """Seconds as minutes and seconds.

    Example:
        >>> clock(83.25)
        '1:23.2'
    """
    if not math.isfinite(t):
        return DASH
    minutes, seconds = divmod(max(t, 0.0), 60.0)
    return f"{int(minutes)}:{int(seconds * 10) / 10:04.1f}"


def role_unit(role: str) -> str:
    """Unit of a role, derived ones included; empty where it has none.

    Example:
        >>> role_unit("accel"), role_unit("headway"), role_unit("gap_reported"), role_unit("brake")
        ('m/s²', 's', 'm', '')
    """
    role = role.removesuffix("_reported")  # by the sensor, before the lead was smoothed
    if role in UNITS:
        return UNITS[role]
    from canid.values.roles import ROLES

    unit = ROLES[role].unit if role in ROLES else ""
    return UNIT_SYMBOLS.get(unit, unit)


def gain_unit(output: str, name: str) -> str:
    """Unit of the gain K from an input to the output.

    Example:
        >>> gain_unit("pedal", "range_rate")
        '% per m/s'
    """
    return f"{UNITS.get(output, '')} per {UNITS.get(name, '')}"


def file_size(n: float) -> str:
    """Bytes as kB, below 1 MB, or MB.

    Example:
        >>> file_size(33_920), file_size(2_500_000)
        ('34 kB', '2.5 MB')
    """
    return f"{n / 1e3:.0f} kB" if n < 999_500 else f"{n / 1e6:.1f} MB"


def _with_unit(text: str, unit: str) -> str:
    # "1" marks a parameter without a unit
    return f"{text} {unit}" if unit not in ("", "1") else text
