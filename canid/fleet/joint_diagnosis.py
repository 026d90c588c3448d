"""The diagnosis of several drives of one driver in one car together: which drives, and what came of it.

A cause that each drive alone is too short to show is found on all of them together, and each drive says whether it holds
there by a fit to the others (`canid.diagnosis.diagnose.diagnose_drives`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from canid.diagnosis.diagnose import diagnose_drives
from canid.findings import Finding, Report
from canid.fleet.analysis import opened_log, read_log
from canid.fleet.database import rows
from canid.fleet.failed import Failed, failure_of, reason_of
from canid.fleet.fetched import Listed, fetched
from canid.fleet.job import Failure, Job, Outcome, Settings, Source, Status
from canid.fleet.key import IDENTITY
from canid.fleet.plain_values import interval_columns
from canid.types import Trace

# s that are diagnosed together at most: an hour shows what a fleet's drives show, and its cost grows with the length
MAX_S = 3600.0
# s of a drive below which it adds nothing but its own offset
MIN_USABLE_S = 60.0


def jobs(db: Any, settings: Settings, max_s: float = MAX_S) -> list[tuple[Job, Mapping[str, Any]]]:
    """Plan: of each driver in each car the drives with the most usable time, up to so much together.

    Args:
        db: from `database.opened`.
        settings: limits of one diagnosis.
        max_s: s of usable driving.

    Returns:
        Jobs, each with the columns of its rows that are known now. A driver with one usable drive has none.
    """
    found = rows(
        db,
        """SELECT l.log, l.bytes, l.modified_ns, l.source, coalesce(l.driver, '') AS driver, coalesce(l.car, '') AS car,
       d.key, d.usable
FROM logs l JOIN drives d ON d.log = l.log
WHERE d.key IS NOT NULL AND l.source IS NOT NULL AND d.usable >= ? AND coalesce(l.driver, '') <> ''
  AND d.task = 'car_following' ORDER BY driver, car, l.source, d.usable DESC, d.key""",
        [MIN_USABLE_S],
    )
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for row in found:
        chosen = groups.setdefault((row["driver"], row["car"], row["source"]), [])
        if sum(one["usable"] for one in chosen) + row["usable"] <= max_s:
            chosen.append(row)
    out: list[tuple[Job, Mapping[str, Any]]] = []
    for (driver, car, source), chosen in groups.items():
        if len(chosen) > 1:
            of = key([one["key"] for one in chosen])
            members = tuple(
                Job(one["log"], one["bytes"] or -1, one["modified_ns"] or 0, source, settings)
                for one in chosen
            )
            job = Job(of, -1, 0, source, settings, members)
            usable = sum(one["usable"] for one in chosen)
            out.append(
                (job, {"key": of, "subject": "driver", "driver": driver, "car": car, "usable": usable})
            )
    return out


def key(keys: Iterable[str]) -> str:
    """Key of what several drives say together, in whatever order.

    Example:
        >>> key(["a", "b"]) == key(["b", "a"]) != key(["a"])
        True
    """
    return hashlib.sha256("\n".join(["joint", IDENTITY, *sorted(keys)]).encode()).hexdigest()


def diagnose_together(job: Job, source: Source) -> Outcome:
    """Diagnose the logs of `job.together`.

    Args:
        job: with two or more logs of one driver in one car.
        source: how all of them are decoded.

    Returns:
        rows of `columns.JOINT_FINDINGS`, one without a cause where none was found; or why there are none.
    """
    path, log = "", job.log
    try:
        traces: list[Trace] = []
        for one in job.together:
            log = one.log
            with fetched(one.log, Listed(one.size, one.modified_ns)) as local:
                path = str(local)
                _check_unchanged(local, one)
                traces.append(_trace(local, source))
        log = job.log
        report = diagnose_drives(traces, [one.log for one in job.together])
    except Exception as error:  # whatever a library raises about one driver: the others go on
        reason = reason_of(error, path, log)
        if log != job.log:
            reason = f"{log}: {reason}"
        return Outcome(job.log, job.log, Status.FAILED, failure_of(error, Failure.ERROR), reason, {})
    return Outcome(
        job.log, job.log, Status.OK, Failure.NONE, "", {"joint_findings": list(found_rows(report))}
    )


def _check_unchanged(path: Path, job: Job) -> None:
    """Refuse a log that is not the one that was analysed. Raises Failed, or OSError where it is gone."""
    now = path.stat()
    if path == Path(job.log) and (
        0 <= job.size != now.st_size or job.modified_ns not in (0, now.st_mtime_ns)
    ):
        raise Failed(Failure.CHANGED, "changed since it was analysed: run canid fleet again")


def _trace(path: Path, source: Source) -> Trace:
    log, vehicle = opened_log(path, source)
    return read_log(path, log, vehicle).trace


def found_rows(report: Report) -> Iterable[dict[str, Any]]:
    """One row per cause, or one that says why there is none."""
    common = {"logs": len(report.drives) or None, "verdict": report.verdict.value}
    if not report.findings:
        yield {**common, "says": report.says}
    for finding in report.findings:
        yield {**common, **_finding(finding, report)}


def _finding(finding: Finding, report: Report) -> dict[str, Any]:
    gains = [one.gains[finding.effect] for one in report.drives if finding.effect in one.gains]
    return {
        "effect": finding.effect,
        "where": finding.where,
        "rivals": list(finding.rivals),
        "surrogate": bool(finding.surrogate),
        **interval_columns("gain", finding.gain),
        "holds_on": sum(gain.low > 0.0 for gain in gains),
        "says": finding.says,
    }
