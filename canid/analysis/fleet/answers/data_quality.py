"""What the data of a fleet lack: logs that failed, damage, faults of signals, drives that no model fits any more."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from typing import Any

from canid.analysis.fleet.storage.database import rows
from canid.values.fleet_summary import Counted, Counts, Excluded

# names that stand for the rest
EXAMPLES = 3


def counts(db: Any) -> Counts:
    """Count logs, drivers and hours; logs with the same bytes once.

    Args:
        db: from `database.opened`.
    """
    (row,) = rows(
        db,
        """SELECT count(*) AS logs,
       count(*) FILTER (status = 'ok' AND duplicate_of IS NULL) AS ok,
       count(*) FILTER (status = 'damaged' AND duplicate_of IS NULL) AS damaged,
       count(*) FILTER (status = 'failed') AS failed,
       count(*) FILTER (duplicate_of IS NOT NULL AND status <> 'failed') AS duplicates,
       count(*) FILTER (status IS NULL) AS open,
       count(DISTINCT driver) FILTER (status <> 'failed' AND driver <> '') AS drivers,
       count(DISTINCT car) FILTER (status <> 'failed' AND car <> '') AS cars,
       coalesce(sum(duration) FILTER (duplicate_of IS NULL), 0) AS duration,
       coalesce(sum(behind_lead) FILTER (duplicate_of IS NULL), 0) AS behind_lead,
       coalesce(sum(usable) FILTER (duplicate_of IS NULL), 0) AS usable
FROM drives""",
    )
    return Counts(**row)


def failures(db: Any) -> tuple[Counted, ...]:
    """Logs without results, by the kind of failure, the most frequent first."""
    return _counted(
        db,
        "SELECT coalesce(failure, '') AS what, coalesce(reason, '') AS says, log AS name FROM drives "
        "WHERE status = 'failed'",
    )


def damaged(db: Any) -> tuple[Counted, ...]:
    """Logs that were read in part."""
    return _counted(
        db,
        "SELECT 'damaged' AS what, coalesce(reason, '') AS says, log AS name FROM drives "
        "WHERE status = 'damaged' AND duplicate_of IS NULL",
    )


def signals(db: Any) -> tuple[Counted, ...]:
    """Faults of signals, those of most logs first."""
    return _counted(
        db,
        """SELECT d.fault AS what, coalesce(e.says, '') AS says, d.log AS name
FROM (SELECT key, log, unnest(signal_findings) AS fault FROM drives WHERE duplicate_of IS NULL) d
LEFT JOIN (SELECT key, name, min(says) AS says FROM events WHERE kind = 'signal' GROUP BY ALL) e
ON e.key = d.key AND e.name = d.fault""",
    )


def misfits(db: Any) -> tuple[Counted, ...]:
    """Drives during which the monitor reported that the model fits no longer, by what it reported."""
    return _counted(
        db,
        """SELECT coalesce(e.name, '') AS what, min(e.says) AS says, d.log AS name
FROM events e JOIN drives d USING (key) WHERE e.kind = 'monitor' AND d.duplicate_of IS NULL
GROUP BY e.name, d.log""",
    )


def excluded(drives: Iterable[Excluded]) -> tuple[Counted, ...]:
    """Drives that are no part of a population, by the reason.

    Example:
        >>> excluded([Excluded("a.blf", "anna", "too short"), Excluded("b.blf", "ben", "too short")])
        (Counted(what='too short', number=2, says='', examples=('a.blf', 'b.blf')),)
    """
    by: dict[str, list[str]] = {}
    for drive in drives:
        by.setdefault(drive.why, []).append(drive.log)
    counted = [Counted(why, len(logs), "", tuple(logs[:EXAMPLES])) for why, logs in by.items()]
    return tuple(sorted(counted, key=lambda reason: (-reason.number, reason.what)))


def drivers_excluded(drives: Iterable[Excluded], pooled: Collection[str]) -> tuple[Counted, ...]:
    """Drivers of whom no drive is part of a population, each with the number of drives and their most frequent reason.

    Args:
        drives: that are no part of a population.
        pooled: drivers of those that are.

    Example:
        >>> left = [Excluded("a.blf", "anna", "too short"), Excluded("b.blf", "ben", "too short")]
        >>> drivers_excluded(left, {"ben"})
        (Counted(what='anna', number=1, says='too short', examples=('a.blf',)),)
    """
    by: dict[str, list[Excluded]] = {}
    for drive in drives:
        if drive.driver and drive.driver not in pooled:
            by.setdefault(drive.driver, []).append(drive)
    out = []
    for driver, left in sorted(by.items()):
        ((why, _),) = Counter(drive.why for drive in left).most_common(1)
        out.append(Counted(driver, len(left), why, tuple(drive.log for drive in left[:EXAMPLES])))
    return tuple(out)


def _counted(db: Any, sql: str) -> tuple[Counted, ...]:
    counted = rows(
        db,
        # what is said is said of the first example
        f"SELECT what, count(*) AS n, arg_min(says, name) AS says, list(name ORDER BY name)[:{EXAMPLES}] AS names "
        f"FROM ({sql}) GROUP BY what ORDER BY n DESC, what",
    )
    return tuple(Counted(row["what"], row["n"], row["says"], tuple(row["names"])) for row in counted)
