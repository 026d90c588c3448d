"""Names and units of pooled parameters as people read them."""

from __future__ import annotations

import math

from canid.values.fleet_summary import Kind, Parameter
from canid.values.interval_text import DASH
from canid.values.text.names import SYMBOLS, readable
from canid.values.text.numbers import UNIT_SYMBOLS, gain_unit, interval
from canid.values.types import Interval

_OTHER = {"noise_sd": "noise sd", "wanted_headway": "wanted headway"}


def label(name: str) -> str:
    """A parameter by its name in a table of estimates.

    Example:
        >>> label("range_rate.log_tau_plus_dead_time"), label("headway_error.K"), label("log_noise_sd")
        ('range rate τ+θ', 'headway error K', 'noise sd')
    """
    channel, _, parameter = name.rpartition(".")
    plain = parameter.removeprefix("log_")
    if not channel:
        return _OTHER.get(plain, readable(plain))
    return f"{readable(channel)} {SYMBOLS.get(plain, plain)}"


def unit(name: str, kind: Kind) -> str:
    """Unit of a parameter, of a logarithm that of the parameter itself.

    Example:
        >>> unit("range_rate.K", Kind("accel", "m/s²")), unit("log_noise_sd", Kind("pedal", "%"))
        ('m/s² per m/s', '%')
    """
    channel, _, parameter = name.rpartition(".")
    if parameter == "K":
        return gain_unit(kind.output, channel)
    if parameter == "log_noise_sd":
        return UNIT_SYMBOLS.get(kind.unit, kind.unit)
    return "s"


def spread(parameter: Parameter, which: Interval) -> str:
    """A standard deviation between or within drivers; of a logarithm as a share.

    Example:
        >>> iv = Interval(0.2, 0.1, 0.3)
        >>> spread(Parameter("x.log_tau", "s", True, 9, 9, iv, iv, iv, iv, ""), iv)
        '20 [10, 30] %'
    """
    if not math.isfinite(which.value):
        return DASH
    return interval(Interval(*(100.0 * x for x in which)), "%") if parameter.log else interval(which)


def short(text: str, length: int) -> str:
    """A name of at most so many characters; its middle is left out.

    Example:
        >>> short("anna", 10), short("fleet/2019/anna", 9)
        ('anna', 'flee…anna')
    """
    if len(text) <= length:
        return text
    half = (length - 1) // 2
    return f"{text[: length - 1 - half]}…{text[-half:]}"


def hours(seconds: float) -> str:
    """A duration in minutes or hours.

    Example:
        >>> hours(900.0), hours(7200.0), hours(3.6e6)
        ('15 min', '2.0 h', '1,000 h')
    """
    if seconds < 3600.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:,.1f} h" if seconds < 360_000.0 else f"{seconds / 3600.0:,.0f} h"
