"""Cells that hold a number and its unit, as "12.5 m": the unit of a column goes to its heading."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from canid.analysis.tables import time_column
from canid.analysis.tables.headings import heading
from canid.signals.vehicle.units import unit_of

_WITH_UNIT = re.compile(
    r"(?P<number>[-+]?[\d.,]*\d(?:e[-+]?\d+)?)\s*(?P<unit>[^\W\d_]\S{0,7}|%|°|µ\S{1,2})", re.IGNORECASE
)


def number_and_unit(cell: str) -> tuple[str, str]:
    """A cell without its unit, and the unit; "": it has none that is known.

    Example:
        >>> number_and_unit("12.5 km/h"), number_and_unit("0,1s"), number_and_unit("7 of 9"), number_and_unit("3e5")
        (('12.5', 'km/h'), ('0,1', 's'), ('7 of 9', ''), ('3e5', ''))
    """
    match = _WITH_UNIT.fullmatch(cell)
    if match is None or (unit_of(match["unit"]) is None and time_column.unit_name(match["unit"]) is None):
        return cell, ""
    return match["number"], match["unit"]


def units_of(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> dict[int, str]:
    """The units that the cells of columns hold, by the columns' places.

    A column has one where most of its cells that are not empty hold it, and its heading states none or the same.

    Example:
        >>> units_of(["time", "gap [m]"], [["0.0 s", "9 m"], ["0.1 s", "8 m"]])
        {0: 's', 1: 'm'}
    """
    out: dict[int, str] = {}
    for k, name in enumerate(headings):
        cells = [row[k] for row in rows if k < len(row) and row[k]]
        units = [unit for cell in cells if (unit := number_and_unit(cell)[1])]
        unit = max(set(units), key=units.count, default="")
        stated = heading(name).unit
        if 2 * units.count(unit) > len(cells) and (stated is None or stated.lower() == unit.lower()):
            out[k] = unit
    return out


def with_units(headings: Sequence[str], units: Mapping[int, str]) -> tuple[str, ...]:
    """The headings, with the units of their cells where they state none.

    Example:
        >>> with_units(["time", "gap [m]"], {0: "s", 1: "m"})
        ('time [s]', 'gap [m]')
    """
    return tuple(
        f"{name} [{units[k]}]" if k in units and heading(name).unit is None else name
        for k, name in enumerate(headings)
    )
