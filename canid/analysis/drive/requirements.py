"""What a CI job requires of an identified driver: `range_rate.K in 3..8`, judged by what may be quoted."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from canid.analysis.drive.drive_parameters import Identified
from canid.values.errors import ConfigError
from canid.values.text.names import SYMBOLS, readable
from canid.values.text.numbers import gain_unit, interval, number
from canid.values.types import QUOTED, Interval

_FORM = re.compile(
    r"\s*(?:(?P<channel>\w+)\.)?(?P<what>\w+)\s+in\s+(?P<low>[^.\s]\S*?|\.\d\S*?)\.\.(?P<high>\S+)\s*"
)
_EXAMPLE = '"range_rate.K in 3..8" or "fit_percent in 50..100"'


class Requirement(NamedTuple):
    """A parameter of a channel, or the fit, and the range in which it has to be."""

    text: str  # as it was given
    channel: str  # "": the fit
    what: str  # "K", "tau", "dead_time", "tau_plus_dead_time"; "fit_percent"
    low: float
    high: float


class Judged(NamedTuple):
    """A requirement on one drive."""

    requirement: Requirement
    says: str  # the value, with its interval, or why there is none
    failed: str  # why it is not met; "": it is


def requirement(text: str) -> Requirement:
    """Parse `CHANNEL.PARAMETER in LOW..HIGH`; raises ConfigError.

    Example:
        >>> requirement("range_rate.K in 3..8")[1:]
        ('range_rate', 'K', 3.0, 8.0)
        >>> requirement("fit_percent in 50..inf")[1:]
        ('', 'fit_percent', 50.0, inf)
    """
    match = _FORM.fullmatch(text)
    if match is None:
        raise ConfigError(f"identify: --require {text!r} is no requirement; one is {_EXAMPLE}")
    channel, what = match["channel"] or "", match["what"]
    if what not in (SYMBOLS if channel else ("fit_percent",)):
        known = ", ".join(SYMBOLS) if channel else "fit_percent, or CHANNEL.PARAMETER"
        raise ConfigError(f"identify: --require {text!r}: {what} is not one of {known}")
    try:
        low, high = float(match["low"]), float(match["high"])
    except ValueError:
        raise ConfigError(f"identify: --require {text!r}: the range is two numbers, such as 3..8") from None
    if not low <= high:
        raise ConfigError(f"identify: --require {text!r}: the range is empty")
    return Requirement(text, channel, what, low, high)


def judged(requirements: Sequence[Requirement], drive: Identified, output: str = "") -> list[Judged]:
    """Judge each requirement on a drive.

    A parameter is met where it may be quoted and its estimate lies in the range. What may not be quoted is not met: no
    number holds for it.

    Args:
        requirements: from `requirement`.
        drive: from `identify`.
        output: role of the driver's output, for the unit of K.

    Raises:
        ConfigError: a drive of this task has no such channel.

    Example:
        >>> from canid.mathematics.estimators.estimator import WholeDrive
        >>> from canid.values.types import Channel, Identifiable
        >>> K = Channel(Interval(5.6, 5.0, 6.2), status=Identifiable.GAIN_ONLY)
        >>> result = Identified(60.0, 50.0, (), {"fopdt": WholeDrive({"range_rate": K})}, ())
        >>> judged([requirement("range_rate.K in 3..5")], result, "pedal")[0].failed
        'range rate K is 5.6 [5.0, 6.2] % per m/s, not in 3 to 5'
    """
    return [_judged(each, drive, output) for each in requirements]


def _judged(requirement: Requirement, drive: Identified, output: str) -> Judged:
    headline = drive.headline
    if not requirement.channel:
        fit = drive.fit_percent
        return _within(requirement, Interval(fit), f"the fit is {number(fit, '%')}", math.isfinite(fit))
    channels = {} if headline is None else headline.channels
    if channels and requirement.channel not in channels:
        raise ConfigError(
            f"identify: --require {requirement.text!r}: {requirement.channel} is not one of {', '.join(channels)}"
        )
    name = f"{readable(requirement.channel)} {SYMBOLS[requirement.what]}"
    channel = channels.get(requirement.channel)
    if channel is None:
        return Judged(requirement, "nothing was identified", f"{name}: nothing was identified")
    value: Interval = getattr(channel, requirement.what)
    unit = (
        gain_unit(output, requirement.channel)
        if requirement.what == "K" and output
        else "s" * (requirement.what != "K")
    )
    known = QUOTED[channel.status]
    # τ and θ known apart give their sum too
    quotable = requirement.what in known or (
        requirement.what == "tau_plus_dead_time" and {"tau", "dead_time"} <= set(known)
    )
    return _within(requirement, value, f"{name} is {interval(value, unit)}", quotable, channel.withheld)


def _within(requirement: Requirement, value: Interval, says: str, quotable: bool, why: str = "") -> Judged:
    if not quotable:
        open_ = f"{says}, which may not be quoted{f': {why}' if why else ''}"
        return Judged(requirement, open_, open_)
    inside = requirement.low <= value.value <= requirement.high
    return Judged(
        requirement,
        says,
        "" if inside else f"{says}, not in {number(requirement.low)} to {number(requirement.high)}",
    )
