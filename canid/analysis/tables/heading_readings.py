"""What a heading stands for where its name alone leaves it open: judged by the unit, then by the values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.tables.heading_words import undecided_in_words as undecided
from canid.analysis.tables.headings import EXTRA, HEADWAY, Heading, role_of
from canid.analysis.tables.remedies import Remedies
from canid.analysis.tables.source import Source, clean, number
from canid.signals.vehicle.quoting import brief
from canid.signals.vehicle.units import factor_to, unit_of
from canid.values.roles import ROLES
from canid.values.types import Array

# the name that stands for adaptive cruise control, an acceleration and an accelerator pedal
ACC = "acc"
CRUISE, BRAKE = "cruise_active", "brake"
# roles that are written by one name; the first that the unit fits is meant
_SIBLINGS = {"gap": (HEADWAY,), HEADWAY: ("gap",), "accel": ("pedal",), ACC: ("accel", "pedal")}
# dimensions of what is measured: a column with such a unit is no switch
_MEASURED = ("speed", "length", "acceleration")
# states of a switch; a column with more different numbers is measured
_MAX_STATES = 8
# share of a drive in which the brake is pressed at most
_MAX_BRAKED = 0.5
# of the values of a switch; a program that resamples writes others where it changes
_WHOLE_SHARE = 0.95
# m/s²; no car brakes or accelerates harder
_MAX_ACCEL = 15.0
# %; a pedal's sensor may be off by some percent
MAX_PEDAL = 110.0
# s; a driver who follows has his median headway in here (Vogel 2002; the Highway Capacity Manual's following ends at 5 s)
_HEADWAYS_S = (0.25, 8.0)
# m/s; below it a headway says nothing
_MIN_SPEED = 5.0


# names, as `Heading.name`, of differences of two speeds besides those in words
_DIFFERENCES = ("dv", "d_v", "deltav")
# share of its changes in which a distance falls and rises at least, if it is a gap; rows of one change of it; and the share
# of those in which the sum of a difference of speeds has one sign with it
_FALLS, _ROWS, _AGREE, _MIN_CHANGES = 0.1, 20, 0.8, 50


class Readings(NamedTuple):
    """Roles of the columns."""

    roles: Mapping[int, str]  # place -> role, of the columns that have one
    notes: tuple[str, ...] = ()  # what was judged, and the second reading
    closing: tuple[int, ...] = ()  # range rates that are positive where the gap closes


def readings(parsed: Sequence[Heading], source: Source | None, says: Remedies) -> Readings:
    """The roles that the columns have.

    Args:
        parsed: the headings.
        source: of the columns; None: the headings are roles, and nothing is judged.
        says: what the user can do, for the notes.

    Example:
        >>> from canid.analysis.tables.headings import heading
        >>> from canid.analysis.tables.remedies import COMMAND_LINE
        >>> from canid.analysis.tables.sources.array_source import ArraySource
        >>> table = ArraySource({"t": np.arange(9) * 0.1, "acc": 0.1 * np.arange(-4, 5), "headway [m]": np.arange(9)})
        >>> readings([heading(text) for text in table.headings], table, COMMAND_LINE).roles
        {0: 'time', 1: 'accel', 2: 'gap'}
    """
    named = {place: role for place, head in enumerate(parsed) if (role := role_of(head)) is not None}
    if source is None:
        return Readings(named)
    roles, notes = dict(named), list[str]()
    for place, role in named.items():
        head = parsed[place]
        meant, why = _by_unit(role, head)
        if not why and (head.unit is None or role == BRAKE):
            meant, why = _by_values(role, head, place, named, parsed, source)
        if not why:
            continue
        if meant != role and meant in named.values():
            meant, why = "", f"{why}, which another column is"
        if meant:
            roles[place] = meant
        else:
            del roles[place]
        other = role if meant != role and role != BRAKE else next(iter(_SIBLINGS.get(role, ())), "")
        taken = f"taken as {meant}" if meant else "not used"
        remedy = f"; where it is {other}: {says.column(other, brief(head.text.strip()))}" if other else ""
        notes.append(f"{brief(head.text.strip())}: {taken}: {why}{remedy}")
    more, turned = _by_changes(roles, parsed, source, says)
    return Readings(roles, (*notes, *more), turned)


def _by_changes(
    roles: dict[int, str], parsed: Sequence[Heading], source: Source, says: Remedies
) -> tuple[list[str], tuple[int, ...]]:
    """Take columns that may be the gap or the range rate for what their changes show: notes, and those that close."""
    notes, places = list[str](), {role: place for place, role in roles.items()}
    near = [k for k, head in enumerate(parsed) if k not in roles and undecided(head.name) == "distance"]
    if len(near) == 1 and "speed" in places and not {"gap", HEADWAY, "spacing"} & places.keys():
        x, v = (
            _column(source, k) * (factor_to(parsed[k].unit or unit, unit) or np.nan)
            for k, unit in ((near[0], "m"), (places["speed"], "m/s"))
        )
        steps = np.diff(x)[np.diff(x) != 0.0]
        fall = float(np.mean(steps < 0.0)) if steps.size else 0.0
        if _FALLS <= fall <= 1.0 - _FALLS and _follows(headway := _headways(x, v)[1]):
            roles[near[0]], places["gap"] = "gap", near[0]
            notes.append(
                f"{brief(parsed[near[0]].text.strip())}: taken as gap: it rises and falls, with a median headway of "
                f"{headway:.2g} s; where it is another distance: {says.column('gap')}"
            )
    rates = [
        k
        for k, head in enumerate(parsed)
        if k not in roles and (head.name in _DIFFERENCES or undecided(head.name) == "difference")
    ]
    if "gap" not in places or len(rates) != 1 or {"range_rate", "lead_speed"} & places.keys():
        return notes, ()
    sign = _sign(_column(source, places["gap"], whole=True), _column(source, rates[0], whole=True))
    text = brief(parsed[rates[0]].text.strip())
    if not sign:
        remedy = says.column("range_rate", text)
        return [*notes, f"{text}: not used: the change of the gap does not show its sign: {remedy}"], ()
    roles[rates[0]] = "range_rate"
    way = "opens" if sign > 0.0 else "closes"
    notes.append(f"{text}: taken as range_rate, positive where the gap {way}, as its changes show")
    return notes, (rates[0],) if sign < 0.0 else ()


def _sign(gap: Array, rate: Array) -> float:
    """The sign of the sum of the rate with the change of the gap; 0: it has none.

    >>> k = np.arange(400.0)
    >>> _sign(30.0 + np.sin(0.03 * k), np.cos(0.03 * k)), _sign(30.0 + np.sin(0.03 * k), -np.cos(0.03 * k))
    (1.0, -1.0)
    """
    both = np.isfinite(gap) & np.isfinite(rate)
    gap, sums = gap[both], np.cumsum(rate[both])
    change, sums = gap[_ROWS:] - gap[:-_ROWS], sums[_ROWS:] - sums[:-_ROWS]
    if len(sums) < _MIN_CHANGES:
        return 0.0
    agree = np.sign(change * sums)[np.abs(sums) >= np.median(np.abs(sums))]
    mean = float(agree.mean())
    return float(np.sign(mean)) if abs(mean) >= 2.0 * _AGREE - 1.0 else 0.0


def _by_unit(role: str, head: Heading) -> tuple[str, str]:
    """The role that the stated unit allows, "": none, and why; no reason: the role stays."""
    unit = unit_of(head.unit) if head.unit else None
    if unit is None or head.unit is None:
        return role, ""
    wanted = _unit(role)
    if (wanted and factor_to(head.unit, wanted) is not None) or (head.unit, wanted) == ("ms", "m/s"):
        return role, ""
    for sibling in _SIBLINGS.get(head.name if role == CRUISE else role, ()):
        if factor_to(head.unit, _unit(sibling)) is not None:
            return sibling, f"its unit is {head.unit}"
    if role == CRUISE and unit.dimension in _MEASURED:
        return "", f"its unit is {head.unit}, so it is no switch"
    return role, ""


def _unit(role: str) -> str:
    return ROLES[role].unit if role in ROLES else EXTRA[role]


def _by_values(
    role: str,
    head: Heading,
    place: int,
    named: Mapping[int, str],
    parsed: Sequence[Heading],
    source: Source,
) -> tuple[str, str]:
    """As `_by_unit`, for a column that states no unit."""
    if role == CRUISE:
        return _switch(head.name, place, source)
    if role == BRAKE:
        return _pressure(place, source)
    speeds = [k for k, other in named.items() if other == "speed"]
    if head.name in ("gap", HEADWAY) and len(speeds) == 1:
        return _distance(role, head.name, place, speeds[0], parsed[speeds[0]].unit, source)
    return role, ""


def _switch(name: str, place: int, source: Source) -> tuple[str, str]:
    x = _numbers(source.sample()[place])
    if name == ACC and x.size and _has_states(x):
        # a car that stands at first has an acceleration of 0
        x = _column(source, place)
    if not x.size or _has_states(x):
        return CRUISE, ""
    low, high = np.percentile(x, (0.5, 99.5)).tolist()
    why = f"its values, {low:.3g} to {high:.3g}, are those of no switch"
    if name == ACC and low < 0.0:
        return ("accel" if max(-low, high) <= _MAX_ACCEL else ""), why
    return ("pedal" if name == ACC and high <= MAX_PEDAL else ""), why


def _pressure(place: int, source: Source) -> tuple[str, str]:
    """A brake whose pressure or travel was measured is a switch if it is 0 where it is released."""
    x = _numbers(source.sample()[place])
    if (
        not x.size
        or _has_states(x)
        or (share := float(np.mean((x := _column(source, place)) != 0.0))) <= _MAX_BRAKED
    ):
        return BRAKE, ""
    return (
        "",
        f"{x.min():.3g} to {x.max():.3g}, and not 0 in {share:.0%} of the rows: not the state of a switch",
    )


def _has_states(x: Array) -> bool:
    whole = x[x == np.round(x)]
    few = len(whole) >= _WHOLE_SHARE * len(x) and len(np.unique(whole)) <= _MAX_STATES
    return few and float(x.min()) >= -1.0


def _distance(
    role: str, name: str, place: int, speed: int, unit: str | None, source: Source
) -> tuple[str, str]:
    sample = source.sample()
    factor = factor_to(unit, "m/s") if unit else 1.0
    if factor is None:
        return role, ""
    as_time, as_length = _headways(_numbers(sample[place]), _numbers(sample[speed]) * factor)
    other = next(iter(_SIBLINGS[role]))
    fits = {HEADWAY: _follows(as_time), "gap": _follows(as_length)}
    if not fits[role] and fits[other]:
        # the first rows may be those of something else than a lead
        as_time, as_length = _headways(_column(source, place), _column(source, speed) * factor)
        fits = {HEADWAY: _follows(as_time), "gap": _follows(as_length)}
        if not fits[role] and fits[other]:
            right, wrong = (as_time, as_length) if other == HEADWAY else (as_length, as_time)
            return other, f"it gives a median headway of {right:.2g} s, and {wrong:.2g} s as {role}"
    if name == HEADWAY and all(fits.values()):
        return (
            role,
            f"it has no unit, and gives a median headway of {as_time:.2g} s, or {as_length:.2g} s as gap",
        )
    return role, ""


def _headways(x: Array, speed: Array) -> tuple[float, float]:
    """Median headways in s of a column that is one, and of one that is a distance in m; NaN: neither can be."""
    x, speed = x[np.isfinite(x) & (x > 0.0)], speed[np.isfinite(speed) & (speed > _MIN_SPEED)]
    if not (x.size and speed.size):
        return float("nan"), float("nan")
    median = float(np.median(x))
    return median, median / float(np.median(speed))


def _follows(headway: float) -> bool:
    return _HEADWAYS_S[0] <= headway <= _HEADWAYS_S[1]


def _numbers(cells: Sequence[str]) -> Array:
    """The numbers among the cells of a sample."""
    values = clean(np.array([number(cell) for cell in cells], float))
    return np.asarray(values[np.isfinite(values)], float)


def _column(source: Source, place: int, *, whole: bool = False) -> Array:
    """The numbers of a column; `whole`: NaN where a row has none."""
    parts = [clean(block.numbers[:, 0]) for block in source.blocks([place], [])]
    values = np.concatenate([np.zeros(0), *parts])
    return np.asarray(values if whole else values[np.isfinite(values)], float)
