"""Ranges in which parameters are searched, and which estimates stand at an end of theirs.

There the data would move the parameter on: its value is that of the range, and its interval ends where the range does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from canid.models.diagnosis.driver import driver_model
from canid.models.diagnosis.lane import lane_model
from canid.models.diagnosis.rivals.rival_models import MODELS
from canid.models.effects import CATALOGUE
from canid.values.findings import Finding, Fit, Report, Rival, RivalCause
from canid.values.identified_model import DRIVER
from canid.values.text.names import SYMBOLS, readable
from canid.values.text.numbers import interval, number
from canid.values.types import Interval

# of a parameter's range (of its logarithm where it is searched by that); nearer than this it stands at an end, as the
# searches themselves have it (`baseline_check`, `calibration`)
RANGE_SHARE = 1e-3
# places of a channel's parameters in the models of the driver
CHANNELS = {
    "headway_error": {"K": (driver_model.K1,), "tau": (driver_model.TAU1,), "dead_time": (driver_model.THETA1,)},
    "range_rate": {"K": (driver_model.K2,), "tau": (driver_model.TAU2,), "dead_time": (driver_model.THETA2,)},
}  # fmt: skip
LANE = {"K": (lane_model.K,), "tau": (lane_model.TAU,), "dead_time": (lane_model.THETA,)}
# parameters of a form that a fit moves, where it has them
FORM = {"headway_desired": "s", "standstill": "m", "free_speed": "m/s"}
FORM_NAMES = {"T": "headway_desired", "s0": "standstill", "v0": "free_speed"}


class AtBound(NamedTuple):
    """An estimate at an end of the range that is searched."""

    side: str  # "lower", "upper"
    low: float  # the range
    high: float
    unit: str

    @property
    def end(self) -> float:
        """The end of the range at which it stands."""
        return self.low if self.side == "lower" else self.high


def at_bound(value: float, low: float, high: float, unit: str = "", *, log: bool = False) -> AtBound | None:
    """At which end of its range a value stands; None: between them, or not known.

    Example:
        >>> at_bound(2.9999, 0.0, 3.0, "s"), at_bound(1.0, 0.0, 3.0)
        (AtBound(side='upper', low=0.0, high=3.0, unit='s'), None)
    """
    if not (math.isfinite(value) and math.isfinite(high - low) and high > low):
        return None
    place = (value - low) / (high - low)
    if log and place > 0:
        place = math.log(value / low) / math.log(high / low)
    if RANGE_SHARE < place < 1 - RANGE_SHARE:
        return None
    return AtBound("lower" if place < 0.5 else "upper", low, high, unit)


def text(iv: Interval, unit: str, bound: AtBound | None) -> str:
    """An estimate as text: at an end of its range that end and what the interval leaves, else value and interval.

    Example:
        >>> text(Interval(3.0, 1.19, 3.0), "s", AtBound("upper", 0.0, 3.0, "s"))
        'at its upper bound, 3 s (95 %: above 1.19 s)'
        >>> text(Interval(80.0, 5.0, 80.0), "m/s", AtBound("upper", 5.0, 80.0, "m/s"))
        'at its upper bound, 80 m/s'
        >>> text(Interval(1.0, 0.8, 1.2), "s", None)
        '1.00 [0.80, 1.20] s'
    """
    if bound is None:
        return interval(iv, unit)
    word, end = ("below", iv.high) if bound.side == "lower" else ("above", iv.low)
    # an interval as wide as the range says nothing
    rest = f" (95 %: {word} {number(end, unit)})" if bound.low < end < bound.high else ""
    return f"at its {bound.side} bound, {number(bound.end, unit or bound.unit)}{rest}"


def of_parameter(key: str, iv: Interval, half_step: float = 0.0) -> AtBound | None:
    """Of a parameter of the driver.

    Args:
        key: as in `Report.shifts`.
        iv: its estimate.
        half_step: s that the dead time of a driver who keeps the lane holds in addition.

    Example:
        >>> of_parameter("headway_error dead_time", Interval(3.0, 1.2, 3.0))
        AtBound(side='upper', low=0.0, high=3.0, unit='s')
    """
    channel, _, what = key.rpartition(" ")
    lane = channel == "lateral_offset"
    places = LANE if lane else CHANNELS.get(channel)
    if places is None or what not in SYMBOLS:
        return None
    low, high = (lane_model.LOW, lane_model.HIGH) if lane else (driver_model.LOW, driver_model.HIGH)
    indices = (*places["tau"], *places["dead_time"]) if what == "tau_plus_dead_time" else places[what]
    late = half_step if lane and what in ("dead_time", "tau_plus_dead_time") else 0.0
    bound = at_bound(iv.value, sum(low[k] for k in indices) + late, sum(high[k] for k in indices) + late)
    return bound if bound is None or what == "K" else bound._replace(unit="s")


def of_fit(fit: Fit, half_step: float = 0.0) -> dict[str, AtBound]:
    """Of all parameters of a model: the channels' by their keys in `Report.shifts`, those of the form by their names."""
    bounds = {
        f"{name} {what}": of_parameter(f"{name} {what}", getattr(channel, what), half_step)
        for name, channel in fit.channels.items()
        for what in SYMBOLS
    }
    if fit.form is not None:
        bounds |= {name: of_form(fit.form.name, name, iv) for name, iv in fit.form.parameters.items()}
    return {key: bound for key, bound in bounds.items() if bound is not None}


def of_form(form: str, name: str, iv: Interval) -> AtBound | None:
    """Of a parameter of the wanted gap; where it follows from others, as T of a constant headway does, it has no range."""
    moved = {"gap": ("T",), "free_speed": ("T", "s0", "v0")}.get(form, ())
    if name not in moved:
        return None
    k = DRIVER.index(FORM_NAMES[name])
    return at_bound(iv.value, driver_model.LOW[k], driver_model.HIGH[k], FORM[FORM_NAMES[name]])


def of_finding(finding: Finding | RivalCause) -> dict[str, AtBound]:
    """Of the parameters of a finding or rival."""
    by = {effect.id: effect for effect in CATALOGUE}
    parameters = by[finding.effect].parameters if finding.effect in by else ()
    units = finding.units
    ranges = [(p.name, p.low, p.high, units.get(p.name, "")) for p in parameters if not p.change_point]
    return _of_each(finding.parameters, ranges)


def of_rival(rival: Rival) -> dict[str, AtBound]:
    """Of the parameters of a published model."""
    by = {model.name: model for model in MODELS}
    parameters = by[rival.model].parameters if rival.model in by else ()
    return _of_each(rival.parameters, [(p.name, p.low, p.high, p.unit) for p in parameters], log=True)


def _of_each(
    values: Mapping[str, Interval], ranges: Iterable[tuple[str, float, float, str]], *, log: bool = False
) -> dict[str, AtBound]:
    """Of the values whose range (name, low, high, unit) is known; `log`: ranges above 0 are logarithmic."""
    bounds = {
        name: at_bound(values[name].value, low, high, unit, log=log and low > 0)
        for name, low, high, unit in ranges
        if name in values
    }
    return {name: bound for name, bound in bounds.items() if bound is not None}


def of_model(driver: Mapping[str, float], form: str) -> dict[str, AtBound]:
    """Of the final model's parameters that a fit moved."""
    moved = {"gap": ("headway_desired",), "free_speed": tuple(FORM)}.get(form, ())
    units = {"tau1": "s", "tau2": "s", "dead_time1": "s", "dead_time2": "s"} | FORM
    bounds: dict[str, AtBound] = {}
    for k, name in enumerate(DRIVER):
        if name in driver and (name in moved or name not in FORM) and name != "offset":
            at = at_bound(driver[name], driver_model.LOW[k], driver_model.HIGH[k], units.get(name, ""))
            bounds |= {name: at} if at is not None else {}
    return bounds


def without_intervals(says: str, report: Report) -> str:
    """A sentence of the diagnosis with bounds instead of values and intervals of estimates that stand there."""
    for finding in report.findings:
        for name, at in of_finding(finding).items():
            iv = finding.parameters[name]
            shown = interval(iv)
            says = says.replace(shown, f"{number(at.end)} (the {at.side} bound of what is searched)")
    return says


def remarks(report: Report) -> list[str]:
    """Sentences for the verdict: of what was found, what stands at an end of its range and is no estimate."""
    return [
        f"{readable(name).capitalize()} of {readable(finding.effect)} is at the {at.side} bound of what is searched, "
        f"{number(at.end, at.unit)}: not an estimate."
        for finding in report.findings
        for name, at in of_finding(finding).items()
    ]
