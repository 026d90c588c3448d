"""Values of the roles in SI, from a table's columns: units, signs, texts; what was not recorded is derived."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from canid.analysis.tables.column_map import ColumnEntry
from canid.analysis.tables.heading_readings import MAX_PEDAL
from canid.analysis.tables.headings import EXTRA, HEADWAY
from canid.analysis.tables.resolution import Found
from canid.analysis.tables.slopes import ACCEL_WIDTH_S, SPEED_WIDTH_S, slope
from canid.analysis.tables.source import EMPTY, NO_NUMBER, clean
from canid.signals.samples import missing_codes
from canid.signals.vehicle.quoting import brief
from canid.signals.vehicle.units import examples, factor_to
from canid.values.errors import ConfigError
from canid.values.roles import ROLES
from canid.values.types import Array, Driver, OutputFilter

# %; a pedal that never exceeds this, without a unit, is a fraction of 1
FRACTION = 1.0
# m/s; a car that is faster than this most of the time has its speed in km/h
MAX_USUAL_SPEED = 70.0
# of the values of a pedal, up to which they are judged: a few may stand for "none"
_USUAL_SHARE = 0.99
YES = ("true", "yes", "on", "t", "y", "active", "enabled", "pressed", "1")
NO = ("false", "no", "off", "f", "n", "inactive", "disabled", "released", "0")


class Values(NamedTuple):
    """A table's roles."""

    roles: dict[str, Array]  # role -> (n,) in its unit; EMPTY, NO_NUMBER and NaN stand for what is not there
    notes: list[str]  # what was derived, or taken for granted


def unit_of_role(role: str) -> str:
    """The unit of a role, or of another column of a table."""
    return ROLES[role].unit if role in ROLES else EXTRA[role]


def in_si(
    role: str, origin: Found, column: Array | list[str], sign: Array | None, name: str, notes: list[str]
) -> Array:
    """One column in its role's unit.

    Args:
        role: or another column of `EXTRA`.
        origin: where it comes from.
        column: its cells.
        sign: of the column whose sign it takes.
        name: of the table, for messages.
        notes: takes what was taken for granted.

    Raises:
        ConfigError: the unit is not one of the role, or the column holds texts.
    """
    entry = origin.entry
    boolean = role in ROLES and ROLES[role].kind == "bool"
    if isinstance(column, list):
        if not boolean:
            shown = next((cell for cell in column if cell), "")
            raise ConfigError(
                f'{name}: column {brief(_names(entry))} for {role} holds no numbers ("{brief(shown)}")'
            )
        return _switch(column, entry)
    special = (column == EMPTY) | (column == NO_NUMBER) | ~np.isfinite(column)
    if boolean:
        true = (
            np.isin(column, [float(x) for x in entry.true if _is_number(x)]) if entry.true else column != 0.0
        )
        return np.where(special, np.where(np.isfinite(column), column, np.nan), true.astype(float))
    factor = _factor(role, origin, clean(column), name, notes)
    with np.errstate(all="ignore"):
        value = (
            (column * entry.scale + entry.offset) * factor
            if (entry.scale, entry.offset) != (1.0, 0.0)
            else (column * factor if factor != 1.0 else column.copy())
        )
    value = np.abs(value) if entry.absolute else value
    if sign is not None:
        value = value * np.sign(clean(sign))
    value = -value if origin.closing else value
    for none in entry.none:
        value[column == none] = np.nan
    if entry.valid is not None:
        value[(value < entry.valid[0]) | (value > entry.valid[1])] = NO_NUMBER
    return np.where(special, np.where(np.isfinite(column), column, np.nan), value)


def _names(entry: ColumnEntry) -> str:
    return entry.names[0]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _switch(column: list[str], entry: ColumnEntry) -> Array:
    yes = [x.lower() for x in entry.true] or YES
    out = np.full(len(column), float(NO_NUMBER))
    for k, cell in enumerate(column):
        text = cell.strip().lower()
        if not text:
            out[k] = EMPTY
        elif text in yes or (entry.true and text not in yes):
            out[k] = float(text in yes)
        elif text in NO:
            out[k] = 0.0
    return out


def _factor(role: str, origin: Found, known: Array, name: str, notes: list[str]) -> float:
    """From the column's unit to the role's. Raises ConfigError."""
    wanted = unit_of_role(role)
    if not wanted or not origin.unit:
        return _judged(role, known, name, notes) if origin.unit is None else 1.0
    if role == "pedal" and origin.unit == "%" and known.size and np.nanmax(np.append(known, 0.0)) <= FRACTION:
        return _judged(role, known, name, notes)  # as spreadsheets hold what they show in %
    unit = "m/s" if origin.unit == "ms" and wanted == "m/s" else origin.unit
    factor = factor_to(unit, wanted)
    if factor is None:
        raise ConfigError(
            f'{name}: {role}: "{brief(origin.unit)}" is no unit of it; write one of {examples(wanted)}'
        )
    return factor


def _judged(role: str, known: Array, name: str, notes: list[str]) -> float:
    """The factor of a column without a unit: its role's own unit, if the numbers may be that."""
    finite = known[np.isfinite(known)]
    if not finite.size:
        return 1.0
    if role == "pedal" and 0.0 < finite.max() <= FRACTION and finite.min() >= 0.0:
        notes.append(f"{name}: pedal: no value is above 1: taken as a fraction of the full travel")
        return 100.0
    if role == "pedal" and (high := float(np.quantile(finite, _USUAL_SHARE))) > MAX_PEDAL:
        raise ConfigError(
            f"{name}: pedal: 1 % of its values are above {high:.4g}, and no unit is stated: state %, or the scale of "
            "what counts"
        )
    if role == "pedal" and np.ptp(finite) > 0.0 and (finite == np.rint(finite)).all():
        notes.append(
            f"{name}: pedal: whole numbers up to {finite.max():.0f} without a unit: taken in %; where they are counts, "
            "K is wrong by their scale: state it (scale, or % in the heading)"
        )
    if role in ("speed", "lead_speed") and np.median(np.abs(finite)) > MAX_USUAL_SPEED:
        raise ConfigError(
            f"{name}: {role}: its median of {np.median(np.abs(finite)):.4g} is no speed in m/s; state the unit in the "
            f"header, such as {role} [km/h]"
        )
    return 1.0


def derived(values: Values, t: Array, driver: Driver | None, name: str) -> tuple[Values, Driver]:
    """Derive gap, range rate, speed and acceleration where they were not recorded, and choose the driver's output.

    Args:
        values: roles and other columns, in SI.
        t: (n,) s.
        driver: as stated; None: judged from the columns.
        name: of the table, for messages.

    Raises:
        ConfigError: what the task needs is not there; names what is missing, and the remedy.
    """
    roles, notes = dict(values.roles), list(values.notes)
    for role in ("lead_speed", HEADWAY):
        if role in roles:
            roles[role] = _without_codes(role, roles[role], t, notes, name)

    def known(role: str) -> Array | None:
        return clean(roles[role]) if role in roles else None

    if "speed" not in roles and "position" in roles:
        roles["speed"] = slope(t, clean(roles["position"]), SPEED_WIDTH_S)
        notes.append(f"{name}: speed: the slope of the position over {SPEED_WIDTH_S:g} s")
    if "gap" not in roles:
        _gap(roles, t, notes, name)
    if "range_rate" not in roles and "gap" in roles:
        lead = known("lead_speed")
        if lead is None and "lead_position" in roles:
            lead = slope(t, clean(roles["lead_position"]), SPEED_WIDTH_S)
        if lead is not None and "speed" in roles:
            roles["range_rate"] = _like(lead - _at(t, clean(roles["speed"]), lead), roles.get("lead_speed"))
    lead_id = known("lead_id")
    if lead_id is not None:
        roles["lead_valid"] = _valid(lead_id, roles.get("lead_valid"))
    given = {role: x for role, x in roles.items() if role in ROLES and np.isfinite(clean(x)).any()}
    given.pop("lead_speed", None)
    chosen = driver if driver is not None else _driver(given)
    if chosen.output == "accel" and "accel" not in given and "speed" in given:
        given["accel"] = slope(t, clean(given["speed"]), ACCEL_WIDTH_S)
        chosen = chosen._replace(output_filter=OutputFilter("savitzky_golay", ACCEL_WIDTH_S))
        notes.append(
            f"{name}: no pedal and no acceleration: the output is the slope of the speed over {ACCEL_WIDTH_S:g} s"
        )
    elif chosen.output_filter is None:
        chosen = chosen._replace(
            output_filter=OutputFilter("unknown" if chosen.output == "accel" else "none")
        )
    return Values(given, notes), chosen


def _without_codes(role: str, column: Array, t: Array, notes: list[str], name: str) -> Array:
    """A column without the numbers that stand for "not measured": what is derived of them differs in each row."""
    value = clean(column)
    first, _ = missing_codes.codes(missing_codes.Watch(), "range_rate", t, value)
    again = missing_codes.Watch(change=first.change, changes=first.changes, visits=first.visits)
    none = missing_codes.codes(again, "range_rate", t, value)[1]
    if not none.any():
        return column
    numbers = ", ".join(f"{x:.4g}" for x in np.unique(value[none])[:3])
    notes.append(f"{name}: {role}: {numbers} is reached by jumps alone: {none.sum():,} rows are not measured")
    return np.where(none, np.nan, column)


def _driver(given: Mapping[str, Array]) -> Driver:
    """The task and output that the columns allow."""
    if {"lateral_offset", "steering_angle"} <= given.keys() and "gap" not in given:
        return Driver("lane_keeping", "steering_angle")
    pedal = given.get("pedal")
    if pedal is not None and np.nanmax(clean(pedal)) > 0.0:
        return Driver("car_following", "pedal")
    return Driver("car_following", "accel")


def _gap(roles: dict[str, Array], t: Array, notes: list[str], name: str) -> None:
    """Gap by whatever says it: spacing, positions, or the headway."""
    length = clean(roles["lead_length"]) if "lead_length" in roles else None
    if "spacing" in roles and length is not None:
        roles["gap"] = _like(clean(roles["spacing"]) - _at(t, length, roles["spacing"]), roles["spacing"])
        notes.append(f"{name}: gap: the spacing without the length of the vehicle ahead")
    elif "lead_position" in roles and "position" in roles and length is not None:
        roles["gap"] = clean(roles["lead_position"]) - clean(roles["position"]) - length
        notes.append(f"{name}: gap: between the positions, without the length of the vehicle ahead")
    elif length is not None and {"length", "east", "north", "lead_east", "lead_north"} <= roles.keys():
        east, north, own_length = (clean(roles[role]) for role in ("east", "north", "length"))
        between = np.hypot(clean(roles["lead_east"]) - east, clean(roles["lead_north"]) - north)
        roles["gap"] = between - (own_length + length) / 2.0
        notes.append(f"{name}: gap: between the centres, without half of both lengths")
    elif HEADWAY in roles and "speed" in roles:
        headway = clean(roles[HEADWAY])
        roles["gap"] = _like(headway * _at(t, clean(roles["speed"]), headway), roles[HEADWAY])
        notes.append(f"{name}: gap: headway times speed")


def _at(t: Array, x: Array, wanted: Array) -> Array:
    """Values in the rows of `wanted`: the own where there is one, else between the neighbours."""
    there = np.isfinite(x)
    if there.all() or not there.any():
        return x
    missing = ~there & np.isfinite(clean(wanted))
    # in a table of several rates; where every row should have one, a hole stays a hole
    if np.median(np.diff(np.flatnonzero(there))) <= 1.0 if there.sum() > 1 else True:
        return x
    out = x.copy()
    out[missing] = np.interp(t[missing], t[there], x[there])
    return out


def _like(value: Array, source: Array | None) -> Array:
    """Derived values; a cell that was empty in what they are made of is empty."""
    if source is None:
        return value
    return np.where((source == EMPTY) | (source == NO_NUMBER), source, value)


def _valid(lead: Array, stated: Array | None) -> Array:
    """Whether there is a lead; not in the row in which it becomes another one, so that its history begins anew."""
    there = np.isfinite(lead)
    before = np.concatenate([[np.nan], lead[:-1]])
    changed = there & np.isfinite(before) & (before != lead)
    valid = (there & ~changed).astype(float)
    return valid if stated is None else np.where(clean(stated) == 0.0, 0.0, valid)


def missing(given: Mapping[str, Array], driver: Driver, needs: Callable[[str], tuple[str, ...]]) -> list[str]:
    """Roles that the task needs and the table does not have."""
    needed = [driver.output, *needs(driver.task)]
    return [role for role in dict.fromkeys(needed) if role not in given]


# what a table needs, in one sentence
NEEDED = (
    "to follow a vehicle it needs time, speed, gap (or headway) and range_rate (or lead_speed), and pedal or accel; to keep "
    "a lane time, lateral_offset and steering_angle"
)
