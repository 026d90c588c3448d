"""What to drive next: which driver's next drive teaches most, and how it should be driven."""

from __future__ import annotations

import math
from typing import Any

from canid.fleet.database import rows
from canid.fleet_summary import Driver, FleetSummary, Next, Population
from canid.types import Interval
from canid.views.fleet_report.labels import label

# entries: a list that somebody acts on
MAX_ENTRIES = 12
# relative half width of an own estimate from which on a gain is hardly known: the sign is, the size is not
HARDLY_KNOWN = 0.5
# s of usable driving that a whole drive's τ + θ needs, as the documentation advises (docs/what_the_numbers_mean.md)
LONG_ENOUGH_S = 600.0


def chosen(of: FleetSummary, db: Any) -> tuple[Next, ...]:
    """What to drive next, what is missing most first.

    Args:
        of: the summary without it.
        db: from `database.opened`.
    """
    out = [*_of_unknown(of, db)]
    for population in of.populations:
        out += _of_population(population)
    return tuple(out[:MAX_ENTRIES])


def _of_unknown(of: FleetSummary, db: Any) -> list[Next]:
    """Drivers of whom nothing is known."""
    known = {driver.name for population in of.populations for driver in population.drivers}
    out = []
    for row in rows(
        db,
        "SELECT driver, count(*) AS n, coalesce(sum(usable), 0) AS usable, "
        "coalesce(max(behind_lead), 0) AS lead, bool_or(len(coalesce(signal_findings, [])) > 0) AS faults "
        "FROM drives WHERE coalesce(driver, '') <> '' GROUP BY driver ORDER BY driver",
    ):
        if row["driver"] in known:
            continue
        drives = f"nothing is known from {row['n']:,} log{'s' if row['n'] > 1 else ''}"
        if row["faults"]:
            what = "correct the signals first: `canid check` on one of the logs names them"
        elif row["usable"] < LONG_ENOUGH_S:
            what = "drive 10 min behind a lead whose speed changes"
        else:
            what = "drive with varying speed and headway"
        out.append(Next(row["driver"], what, drives))
    # the least first would be an order without a reason: by name
    return out[: MAX_ENTRIES // 2]


def _of_population(of: Population) -> list[Next]:
    gains = [one for one in of.parameters if one.name.endswith(".K") and one.drives]
    if not gains:
        return []
    key = gains[-1].name
    single = [driver for driver in of.drivers if driver.drives == 1]
    out = []
    if len(single) == len(of.drivers) and len(single) > 1:
        out.append(
            Next(
                "every driver",
                "drive once more",
                "one drive each: the spread within a driver cannot be separated from that between drivers",
            )
        )
    unsure = sorted(of.drivers, key=lambda driver: (-_relative(driver, key), driver.name))
    for driver in unsure:
        wide = _relative(driver, key)
        if wide <= HARDLY_KNOWN:
            break
        known = (
            f"{label(key)} is known to ± {100.0 * wide:.0f} % only"
            if math.isfinite(wide)
            else f"{label(key)} is not known"
        )
        minutes = f"{driver.usable / 60.0:.0f} min in {driver.drives} drive{'s' if driver.drives > 1 else ''}"
        out.append(
            Next(
                driver.name, "drive behind a lead whose speed changes, 10 min or more", f"{known}; {minutes}"
            )
        )
    return out[:MAX_ENTRIES]


def _relative(driver: Driver, name: str) -> float:
    """Half width of the own interval over the estimate."""
    iv = driver.own.get(name, Interval())
    if not all(map(math.isfinite, iv)) or not iv.value:
        return math.inf
    return (iv.high - iv.low) / (2.0 * abs(iv.value))
