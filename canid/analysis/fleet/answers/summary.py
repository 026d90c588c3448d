"""What a fleet says: the folder's tables summarised for the report, and its tables of drivers and of the population."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from canid.analysis.fleet.answers import causes, data_quality, estimates, next_drives, questions, sentences
from canid.analysis.fleet.answers.pooled import driver_row, parameter_row, population
from canid.analysis.fleet.storage import generations, summary_tables
from canid.analysis.fleet.storage.database import Database, database, rows
from canid.mathematics.population import drive_forecast, hierarchical
from canid.mathematics.population.drive_table import DriveTable
from canid.values.fleet_summary import Excluded, FleetSummary, Kind, Next, Population


def summarise(folder: str | Path) -> FleetSummary:
    """Summarise a fleet, and write `drivers.parquet` and `population.parquet` into its folder.

    They are written where the folder still holds the drives that are summarised and no run works there, else not at all.

    Args:
        folder: of `canid fleet -o`.

    Returns:
        Weak data are sentences in it: one drive, or none, gives a summary as well.

    Raises:
        ConfigError: it is no folder of canid fleet.
        LogError: a table is damaged.
        OutputError: the tables cannot be written.
    """
    folder = Path(folder)
    with database(folder) as fleet:
        summary = _found(fleet, folder)
    summary_tables.kept(folder, fleet.opened.generation, tables(summary))
    return summary


def pool(fleet: Database, folder: str | Path) -> None:
    """Make the tables of drivers and of the population of what is open, and write them as `summarise` does.

    Raises:
        OutputError: they cannot be written; they are those of the drives all the same.
    """
    made = tables(_found(fleet, Path(folder)))
    fleet.put(made)
    summary_tables.kept(Path(folder), fleet.opened.generation, made)


def tables(summary: FleetSummary) -> dict[str, list[Mapping[str, Any]]]:
    """The rows of the tables of drivers and of the population."""
    return {
        "drivers": [
            driver_row(pooled, driver) for pooled in summary.populations for driver in pooled.drivers
        ],
        "population": [
            parameter_row(pooled, parameter)
            for pooled in summary.populations
            for parameter in pooled.parameters
        ],
    }


def current(folder: str | Path) -> bool:
    """Are the tables of drivers and of the population those of the folder's drives.

    Example:
        >>> current("replay_logs")
        False
    """
    if not generations.is_folder(folder):
        return False
    with database(folder) as fleet:
        return fleet.opened.has_pooled()


def _found(fleet: Database, folder: Path) -> FleetSummary:
    db = fleet.db
    counts = data_quality.counts(db)
    populations: list[Population] = []
    left_out: list[Excluded] = []
    gains: list[Next] = []
    for kind in estimates.kinds(db):
        pooled, excluded, coming = _population(db, kind)
        gains += coming
        populations.append(pooled)
        left_out += excluded
    left_out += estimates.without_output(db)
    drivers = {driver.name for pooled in populations for driver in pooled.drivers}
    of_causes, no_causes = causes.found(db)
    summary = FleetSummary(
        folder=folder.name or str(folder),
        verdict="",
        sentences=(),
        counts=counts,
        failures=data_quality.failures(db),
        damaged=data_quality.damaged(db),
        signals=data_quality.signals(db),
        excluded=data_quality.excluded(left_out),
        drivers_excluded=data_quality.drivers_excluded(left_out, drivers),
        misfits=data_quality.misfits(db),
        populations=tuple(populations),
        causes=of_causes,
        no_causes=no_causes,
        next_drives=(),
        provenance=_provenance(db),
        logs_sha256=fleet.opened.files["logs"].sha256(),
    )
    summary = summary._replace(
        next_drives=(*next_drives.chosen(summary, db), *gains)[: next_drives.MAX_ENTRIES]
    )
    return summary._replace(verdict=sentences.verdict(summary), sentences=sentences.sentences(summary))


def _population(db: Any, kind: Kind) -> tuple[Population, tuple[Excluded, ...], list[Next]]:
    names = estimates.names_of(db, kind)
    selections = tuple(estimates.selection(db, kind, some) for some in names)
    pools = tuple(hierarchical.pool(selection.table) for selection in selections)
    table: DriveTable = selections[0].table
    pooled = population(selections, pools)._replace(questions=questions.asked(table, pools[0], kind))
    coming = next_drives.of_forecasts(drive_forecast.forecasts(table, pools[0]), pooled.drivers)
    return pooled, selections[0].excluded, coming


def _provenance(db: Any) -> dict[str, str]:
    """What makes these numbers; the same tables give the same hash."""
    (row,) = rows(
        db,
        """SELECT count(DISTINCT key) AS results, count(DISTINCT canid) AS versions,
       string_agg(DISTINCT canid, ', ' ORDER BY canid) AS canid,
       string_agg(DISTINCT vehicle, ', ' ORDER BY vehicle) AS vehicles FROM drives WHERE key IS NOT NULL""",
    )
    (sources,) = rows(
        db, "SELECT count(DISTINCT source) AS n, list(DISTINCT source ORDER BY source) AS found FROM logs"
    )
    keys = db.execute("SELECT DISTINCT key FROM drives WHERE key IS NOT NULL ORDER BY key").fetchall()
    digest = hashlib.sha256("\n".join(key for (key,) in keys).encode()).hexdigest()
    named = [str(source) for source in sources["found"] or () if source]
    out = {
        "results": f"{row['results']:,} logs, sha256 of their keys {digest}",
        "analysed by": f"canid {row['canid'] or '–'}",
        "vehicles": _brief(str(row["vehicles"] or "–"), 300),
        "sources": _brief(", ".join(named) or "–", 300),
    }
    if row["versions"] and row["versions"] > 1:
        out["analysed by"] += ": several versions; `canid fleet` with the newest makes them one"
    return out


def _brief(text: str, length: int) -> str:
    return text if len(text) <= length else f"{text[:length]}…"
