"""The diagnosis of several drives together, of one driver in one car, or of one car: which drives, and what came of it.

A cause that each drive alone is too short to show is found on all of them together, and each drive says whether it holds
there by a fit to the others (`canid.models.diagnosis.diagnose.diagnose_drives`). Of a car, whoever drove, its sensors and
the car itself are diagnosed (`several_drives.shared_car`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from canid.analysis.fleet.answers.recent_traces import RecentTraces
from canid.analysis.fleet.failed import Failed, failure_of, reason_of
from canid.analysis.fleet.job import Failure, Job, Outcome, Settings, Source, Status
from canid.analysis.fleet.key import IDENTITY
from canid.analysis.fleet.one_log.analysis import Fetched, opened_log, read_log
from canid.analysis.fleet.one_log.plain_values import interval_columns
from canid.analysis.fleet.planning.fetched import Listed, fetched
from canid.analysis.fleet.storage.database import rows
from canid.models.diagnosis.diagnose import diagnose_drives
from canid.models.diagnosis.several_drives import shared_car
from canid.models.diagnosis.several_drives.joined_drives import join
from canid.models.effects import CATALOGUE
from canid.values.findings import DriveShare, Finding, Verdict
from canid.values.types import Trace

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
    candidates = rows(
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
    for row in candidates:
        if row["usable"] >= MIN_USABLE_S:
            whose = (row["driver"], row["car"], row["source"])
            drivers.setdefault(whose, []).append(row)
        # a wrong sensor makes no drive useless for the diagnosis of the car
        cars.setdefault((row["car"], row["source"]), []).append({**row, "usable": row["behind_lead"]})
    out = [
        _job("driver", driver, car, source, _longest(drives, max_s), settings)
        for (driver, car, source), drives in drivers.items()
    ]
    out += [
        _job("car", "", car, source, _longest(_by_turns(drives), max_s), settings)
        for (car, source), drives in cars.items()
        if len({drive["driver"] for drive in drives}) > 1
    ]
    return [job for job in out if job is not None]


def _longest(drives: list[dict[str, Any]], max_s: float) -> list[dict[str, Any]]:
    """The first drives that fit into so much time."""
    chosen: list[dict[str, Any]] = []
    for row in drives:
        if sum(earlier["usable"] for earlier in chosen) + row["usable"] <= max_s:
            chosen.append(row)
    return chosen


def _by_turns(drives: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Each driver's longest drive first, then each one's second: a cause in a car shows with whoever drives."""
    turn: dict[str, int] = {}
    ordered = []
    for row in sorted(drives, key=lambda drive: (-drive["usable"], drive["key"])):
        turn[row["driver"]] = turn.get(row["driver"], 0) + 1
        ordered.append((turn[row["driver"]], row))
    return [row for _, row in sorted(ordered, key=lambda turned: turned[0])]


def _job(
    subject: str, driver: str, car: str, source: str, chosen: list[dict[str, Any]], settings: Settings
) -> tuple[Job, Mapping[str, Any]] | None:
    if len(chosen) < 2:
        return None
    joint_key = key([drive["key"] for drive in chosen], subject)
    members = tuple(
        Job(drive["log"], drive["bytes"] or -1, drive["modified_ns"] or 0, source, settings)
        for drive in chosen
    )
    job = Job(joint_key, -1, 0, source, settings, members, subject == "car")
    usable = sum(drive["usable"] for drive in chosen)
    return job, {"key": joint_key, "subject": subject, "driver": driver, "car": car, "usable": usable}


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


def diagnose_together(job: Job, source: Source, recent: RecentTraces, local: Fetched = fetched) -> Outcome:
    """Diagnose the logs of `job.together`.

    Args:
        job: with two or more logs of one driver in one car, or of one car.
        source: how all of them are decoded.
        recent: what this process has read last.
        local: fetches a log, where it is in a storage.

    Returns:
        rows of `columns.JOINT_FINDINGS`, one without a cause where none was found; or why there are none.
    """
    try:
        traces = [
            recent.trace(
                f"{member.log} {member.size} {member.modified_ns} {source.fingerprint}",
                partial(_trace, member, source, local),
            )
            for member in job.together
        ]
        names = [member.log for member in job.together]
        made = (_rows_of_car if job.of_car else _rows_of_driver)(traces, names)
    except Exception as error:  # whatever a library raises about one driver: the others go on
        reason = reason_of(error, "", job.log)
        return Outcome(job.log, job.log, Status.FAILED, failure_of(error, Failure.ERROR), reason, {})
    return Outcome(job.log, job.log, Status.OK, Failure.NONE, "", {"joint_findings": made})


def _check_unchanged(path: Path, job: Job) -> None:
    """Refuse a log that is not the one that was analysed. Raises Failed, or OSError where it is gone."""
    now = path.stat()
    if path == Path(job.log) and (
        0 <= job.size != now.st_size or job.modified_ns not in (0, now.st_mtime_ns)
    ):
        raise Failed(Failure.CHANGED, "changed since it was analysed: run canid fleet again")


def _trace(member: Job, source: Source, local: Fetched) -> Trace:
    """Read one drive. Raises Failed, which names it."""
    path = ""
    try:
        with local(member.log, Listed(member.size, member.modified_ns)) as file:
            path = str(file)
            _check_unchanged(file, member)
            log, vehicle = opened_log(file, source)
            return read_log(file, log, vehicle).trace
    except Exception as error:  # as of one log alone
        reason = reason_of(error, path, member.log)
        raise Failed(failure_of(error, Failure.ERROR), f"{member.log}: {reason}") from None


def _rows_of_driver(traces: Sequence[Trace], names: Sequence[str]) -> list[dict[str, Any]]:
    # neither their numbers nor what is said of a gain is kept
    report = diagnose_drives(traces, names, arbitrated=False, null_gain=False)
    return found_rows(report.findings, report.drives, report.verdict.value, report.says)


def _rows_of_car(traces: Sequence[Trace], names: Sequence[str]) -> list[dict[str, Any]]:
    """Of sensors and car alone: the drivers are diagnosed each by himself."""
    joined = join(traces)
    diagnosis = shared_car.diagnose_car(joined, traces, names, CATALOGUE)
    context = diagnosis.contexts[0]
    findings = (*context.sensing.findings, *context.vehicle.findings)
    verdict = Verdict.NAMED if any(not finding.surrogate for finding in findings) else Verdict.ADEQUATE
    says = "no cause is named in the sensors or in the car"
    return found_rows(findings, diagnosis.drives, verdict.value, says)


def found_rows(
    findings: Sequence[Finding], drives: Sequence[DriveShare], verdict: str, says: str
) -> list[dict[str, Any]]:
    """One row per cause, or one that says why there is none."""
    common = {"logs": len(drives) or None, "verdict": verdict}
    return [{**common, **_finding(finding, drives)} for finding in findings] or [{**common, "says": says}]


def _finding(finding: Finding, drives: Sequence[DriveShare]) -> dict[str, Any]:
    gains = [drive.gains[finding.effect] for drive in drives if finding.effect in drive.gains]
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
