"""The diagnosis of several drives together, of one driver in one car, or of one car: which drives, and what came of it.

A cause that each drive alone is too short to show is found on all of them together, and each drive says whether it holds
there by a fit to the others (`canid.diagnosis.diagnose.diagnose_drives`). Of a car, whoever drove, its sensors and the car
itself are diagnosed (`several_drives.shared_car`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from canid.diagnosis.diagnose import diagnose_drives
from canid.diagnosis.several_drives import shared_car
from canid.diagnosis.several_drives.joined_drives import join
from canid.effects import CATALOGUE
from canid.findings import DriveShare, Finding, Verdict
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
    """Plan: of each driver in each car, and of each car, the drives with the most usable time, up to so much together.

    Args:
        db: from `database.opened`.
        settings: limits of one diagnosis.
        max_s: s of usable driving.

    Returns:
        Jobs, each with the columns of its rows that are known now. A driver with one usable drive has none, nor has a car
        that one person drove, whose drives are those of the driver.
    """
    found = rows(
        db,
        """SELECT l.log, l.bytes, l.modified_ns, l.source, coalesce(l.driver, '') AS driver, coalesce(l.car, '') AS car,
       d.key, d.usable, d.behind_lead
FROM logs l JOIN drives d ON d.log = l.log
WHERE d.key IS NOT NULL AND l.source IS NOT NULL AND d.behind_lead >= ? AND coalesce(l.driver, '') <> ''
  AND d.task = 'car_following' ORDER BY driver, car, l.source, d.usable DESC, d.key""",
        [MIN_USABLE_S],
    )
    drivers: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    cars: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in found:
        if row["usable"] >= MIN_USABLE_S:
            of = (row["driver"], row["car"], row["source"])
            drivers.setdefault(of, []).append(row)
        # a wrong sensor makes no drive useless for the diagnosis of the car
        cars.setdefault((row["car"], row["source"]), []).append({**row, "usable": row["behind_lead"]})
    out = [
        _job("driver", driver, car, source, _longest(drives, max_s), settings)
        for (driver, car, source), drives in drivers.items()
    ]
    out += [
        _job("car", "", car, source, _longest(_by_turns(drives), max_s), settings)
        for (car, source), drives in cars.items()
        if len({one["driver"] for one in drives}) > 1
    ]
    return [one for one in out if one is not None]


def _longest(drives: list[dict[str, Any]], max_s: float) -> list[dict[str, Any]]:
    """The first drives that fit into so much time."""
    chosen: list[dict[str, Any]] = []
    for row in drives:
        if sum(one["usable"] for one in chosen) + row["usable"] <= max_s:
            chosen.append(row)
    return chosen


def _by_turns(drives: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Each driver's longest drive first, then each one's second: a cause in a car shows with whoever drives."""
    turn: dict[str, int] = {}
    ordered = []
    for row in sorted(drives, key=lambda one: (-one["usable"], one["key"])):
        turn[row["driver"]] = turn.get(row["driver"], 0) + 1
        ordered.append((turn[row["driver"]], row))
    return [row for _, row in sorted(ordered, key=lambda one: one[0])]


def _job(
    subject: str, driver: str, car: str, source: str, chosen: list[dict[str, Any]], settings: Settings
) -> tuple[Job, Mapping[str, Any]] | None:
    if len(chosen) < 2:
        return None
    of = key([one["key"] for one in chosen], subject)
    members = tuple(
        Job(one["log"], one["bytes"] or -1, one["modified_ns"] or 0, source, settings) for one in chosen
    )
    job = Job(of, -1, 0, source, settings, members, subject == "car")
    usable = sum(one["usable"] for one in chosen)
    return job, {"key": of, "subject": subject, "driver": driver, "car": car, "usable": usable}


def key(keys: Iterable[str], subject: str = "driver") -> str:
    """Key of what several drives say together, in whatever order.

    Args:
        keys: of the drives.
        subject: "driver" or "car".

    Example:
        >>> key(["a", "b"]) == key(["b", "a"]) != key(["a"])
        True
    """
    return hashlib.sha256("\n".join(["joint", subject, IDENTITY, *sorted(keys)]).encode()).hexdigest()


def diagnose_together(job: Job, source: Source) -> Outcome:
    """Diagnose the logs of `job.together`.

    Args:
        job: with two or more logs of one driver in one car, or of one car.
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
        names = [one.log for one in job.together]
        made = (_rows_of_car if job.of_car else _rows_of_driver)(traces, names)
    except Exception as error:  # whatever a library raises about one driver: the others go on
        reason = reason_of(error, path, log)
        if log != job.log:
            reason = f"{log}: {reason}"
        return Outcome(job.log, job.log, Status.FAILED, failure_of(error, Failure.ERROR), reason, {})
    return Outcome(job.log, job.log, Status.OK, Failure.NONE, "", {"joint_findings": made})


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


def _rows_of_driver(traces: Sequence[Trace], names: Sequence[str]) -> list[dict[str, Any]]:
    report = diagnose_drives(traces, names)
    return found_rows(report.findings, report.drives, report.verdict.value, report.says)


def _rows_of_car(traces: Sequence[Trace], names: Sequence[str]) -> list[dict[str, Any]]:
    """Of sensors and car alone: the drivers are diagnosed each by himself."""
    joined = join(traces)
    of = shared_car.diagnose_car(joined, traces, names, CATALOGUE)
    context = of.contexts[0]
    findings = (*context.sensing.findings, *context.vehicle.findings)
    verdict = Verdict.NAMED if any(not one.surrogate for one in findings) else Verdict.ADEQUATE
    says = "no cause is named in the sensors or in the car"
    return found_rows(findings, of.drives, verdict.value, says)


def found_rows(
    findings: Sequence[Finding], drives: Sequence[DriveShare], verdict: str, says: str
) -> list[dict[str, Any]]:
    """One row per cause, or one that says why there is none."""
    common = {"logs": len(drives) or None, "verdict": verdict}
    return [{**common, **_finding(one, drives)} for one in findings] or [{**common, "says": says}]


def _finding(finding: Finding, drives: Sequence[DriveShare]) -> dict[str, Any]:
    gains = [one.gains[finding.effect] for one in drives if finding.effect in one.gains]
    return {
        "effect": finding.effect,
        "where": finding.where,
        "rivals": list(finding.rivals),
        "surrogate": bool(finding.surrogate),
        **interval_columns("gain", finding.gain),
        # of a sensor there is no fit to other drives
        "holds_on": sum(gain.low > 0.0 for gain in gains) if gains else None,
        "says": finding.says,
    }
