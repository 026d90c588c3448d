"""What to drive next: which driver's next drive teaches most, and how it should be driven."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from canid.analysis.fleet.answers.labels import label
from canid.analysis.fleet.storage.database import rows
from canid.mathematics.population.drive_forecast import Forecast
from canid.values.fleet_summary import Driver, FleetSummary, Next

# entries: a list that somebody acts on
MAX_ENTRIES = 12
# gain of a drive, as a share of the spread between drivers, below which the driver is known well enough among the others
MIN_GAIN = 0.1
HOW = "drive behind a lead whose speed changes, 10 min or more"
# s of usable driving that a whole drive's τ + θ needs, as the documentation advises (docs/what_the_numbers_mean.md)
LONG_ENOUGH_S = 600.0


def chosen(summary: FleetSummary, db: Any) -> tuple[Next, ...]:
    """What to drive next, what is missing most first.

    Args:
        summary: the summary without it.
        db: from `database.opened`.
    """
    return (*_of_unknown(summary, db), *_once_more(summary))


def _of_unknown(summary: FleetSummary, db: Any) -> list[Next]:
    """Drivers of whom nothing is known."""
    known = {driver.name for population in summary.populations for driver in population.drivers}
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


def _once_more(summary: FleetSummary) -> list[Next]:
    """Where every driver has one drive, the two spreads cannot be separated."""
    out = []
    for population in summary.populations:
        if len(population.drivers) > 1 and all(driver.drives == 1 for driver in population.drivers):
            why = "one drive each: the spread within a driver cannot be separated from that between drivers"
            out.append(Next(f"some drivers of {population.kind.text()}", "drive once more", why))
    return out


def of_forecasts(forecasts: Sequence[Forecast], known: Iterable[Driver]) -> list[Next]:
    """Drivers whose next drive narrows an interval most, by at least `MIN_GAIN` of the spread between drivers.

    Args:
        forecasts: of one population, those that gain most first.
        known: its drivers.
    """
    by_name = {driver.name: driver for driver in known}
    out: dict[str, Next] = {}
    for forecast in forecasts:
        if forecast.gain < MIN_GAIN:
            break
        # what noise and wanted headway lack needs no drive of its own kind
        if forecast.driver in out or forecast.driver not in by_name or "." not in forecast.parameter:
            continue
        narrower = 100.0 * (1.0 - forecast.expected / forecast.width)
        rests = (
            f"{forecast.drives} of {by_name[forecast.driver].drives} drives, "
            f"{by_name[forecast.driver].usable / 60.0:.0f} min usable"
        )
        why = f"{label(forecast.parameter)} is known from {rests}; its interval would be {narrower:.0f} % narrower"
        out[forecast.driver] = Next(forecast.driver, HOW, why)
    return list(out.values())
