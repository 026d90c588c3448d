"""The analysis of one log: from its bytes to the rows of the fleet's tables."""

from __future__ import annotations

import hashlib
import os
import stat
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

from canid import __version__
from canid.analysis.drive import drive_parameters
from canid.analysis.drive.drive_reader import Drive, read_drive
from canid.analysis.fleet.failed import NO_MEMORY, Failed, failure_of, reason_of
from canid.analysis.fleet.job import Failure, Job, Outcome, Settings, Source, Status
from canid.analysis.fleet.key import key
from canid.analysis.fleet.one_log import detail_rows, drive_row, monitor_misfits, peak_memory
from canid.analysis.fleet.one_log.plain_values import Row
from canid.analysis.fleet.planning.fetched import Listed, fetched
from canid.analysis.fleet.storage.columns import DRIVES, TABLES
from canid.analysis.tables import column_map, kinds
from canid.analysis.tables.table import open_table
from canid.io.logs import Log, formats, open_log
from canid.models.diagnosis import diagnose as diagnosis
from canid.signals.vehicle import Vehicle
from canid.values.errors import ConfigError, LogError
from canid.values.text.json_values import line
from canid.values.types import Trace

# bytes that are hashed at once
_BLOCK_BYTES = 1_000_000
_CHANGED = "changed while it was read; run again when nothing writes to it"


class _File(NamedTuple):
    """What of a file must not change while it is read."""

    device: int
    inode: int
    size: int
    modified_ns: int
    changed_ns: int  # of any kind: a modification time can be set back

    @classmethod
    def of(cls, path: Path) -> _File:
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            kind = "a folder" if stat.S_ISDIR(status.st_mode) else "a pipe, a socket or a device"
            raise Failed(Failure.NOT_A_LOG, f"is {kind}, not a file")
        return cls(status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


# gives a local path for a log and what was listed of it, as `fetched.fetched` does
Fetched = Callable[[str, Listed], AbstractContextManager[Path]]


def analyse(job: Job, source: Source, local: Fetched = fetched) -> Outcome:
    """Analyse one log: read it, identify, diagnose, and make rows of what was found.

    Args:
        job: the log and the settings.
        source: how it is decoded.
        local: fetches it, where it is in a storage.

    Returns:
        the rows of `columns.TABLES`; or why there are none. No log raises, whatever it holds.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> job = Job("replay_logs/following_urban.blf", -1, 0, "", Settings(windows=False, diagnosis=False, traffic=False))
        >>> outcome = analyse(job, Source(read_vehicle("generic"), None, "generic"))
        >>> outcome.status.value, 5.0 < outcome.tables["drives"][0]["range_rate_K"] < 6.0
        ('ok', True)
        >>> analyse(job._replace(log="no.blf"), Source(read_vehicle("generic"), None, "generic")).failure.value
        'missing'
    """
    path = job.log
    try:
        with local(job.log, Listed(job.size, job.modified_ns)) as file:
            path = str(file)
            return _of_file(file, job, source)
    except Exception as error:  # whatever a library raises about one log: the other logs go on
        return _failed(job, "", error, Failure.ERROR, path)


def _failed(job: Job, results_key: str, error: BaseException, otherwise: Failure, path: str) -> Outcome:
    failure = failure_of(error, otherwise)
    reason = NO_MEMORY if failure is Failure.MEMORY else reason_of(error, path, job.log)
    return Outcome(job.log, results_key, Status.FAILED, failure, reason, {})


def _of_file(path: Path, job: Job, source: Source) -> Outcome:
    before = _File.of(path)
    of_listed = path == Path(job.log)
    if of_listed and (0 <= job.size != before.size or job.modified_ns not in (0, before.modified_ns)):
        raise Failed(Failure.CHANGED, "changed since it was listed; run again when nothing writes to it")
    sha256 = _sha256(path, before.size)
    results_key = key(sha256, source.fingerprint, job.settings)
    try:
        outcome = _analysed(path, job, source, sha256, results_key)
    except Failed as error:
        outcome = _failed(job, results_key, error, Failure.ERROR, str(path))
    except LogError as error:
        outcome = _failed(job, results_key, error, Failure.NOT_A_LOG, str(path))
    except ConfigError as error:
        outcome = _failed(job, results_key, error, Failure.NOTHING_MAPPED, str(path))
    except Exception as error:  # of any kind: an error in canid costs one log
        outcome = _failed(job, results_key, error, Failure.ERROR, str(path))
    if _File.of(path) != before:
        return Outcome(job.log, "", Status.FAILED, Failure.CHANGED, _CHANGED, {})
    return outcome


def _sha256(path: Path, size: int) -> str:
    """SHA-256 of a file of `size` bytes."""
    done, digest = 0, hashlib.sha256()
    # a pipe that has just taken the file's place must not be waited for
    with open(
        os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)), "rb"
    ) as file:
        while done <= size and (block := file.read(min(_BLOCK_BYTES, size + 1 - done))):
            done += len(block)
            digest.update(block)
    if size == 0 and done == 0:
        raise Failed(Failure.EMPTY, "is empty")
    if done != size:
        raise Failed(Failure.CHANGED, _CHANGED)
    return digest.hexdigest()


def _analysed(path: Path, job: Job, source: Source, sha256: str, results_key: str) -> Outcome:
    begun, cpu = time.monotonic(), time.process_time()
    peak_memory.restart()
    log, vehicle = opened_log(path, source)
    drive = read_log(path, log, vehicle)
    health = drive.health
    tables = _tables(drive, vehicle, log.start_utc, job.settings)
    row = tables["drives"][0]
    row |= {
        "sha256": sha256,
        "canid": __version__,
        "cpu_s": time.process_time() - cpu,
        "wall_s": time.monotonic() - begun,
        "peak_bytes": peak_memory.peak_bytes(),
    }
    keyed = {
        name: [{"key": results_key, **row_of_table} for row_of_table in rows] for name, rows in tables.items()
    }
    wrong = "; ".join(filter(None, (health.damage.says if health.damage else "", health.back_in_time)))
    status = Status.DAMAGED if wrong else Status.OK
    return Outcome(job.log, results_key, status, Failure.NONE, " ".join(wrong.split()), keyed)


def opened_log(path: Path, source: Source) -> tuple[Log, Vehicle]:
    """Open a log with its vehicle, or a table with its column map."""
    if formats.format_of(path) is None and kinds.suffix(path) not in kinds.SUFFIXES:
        raise Failed(Failure.NOT_A_LOG, f"unknown log format {kinds.suffix(path) or '(no suffix)'!r}")
    try:
        table = kinds.is_table(path)
    except ConfigError as error:
        raise Failed(failure_of(error, Failure.NOT_A_LOG), str(error)) from None
    if table:
        by = source.columns
        if by is None and source.vehicle is not None:
            by = column_map.of_vehicle(source.vehicle)
        opened = open_table(path, by)
        return opened.log, opened.vehicle
    if source.vehicle is None:
        raise Failed(Failure.NOTHING_MAPPED, "is a log of CAN frames: name its vehicle file with --vehicle")
    return open_log(path), source.vehicle


def read_log(path: Path, log: Log, vehicle: Vehicle) -> Drive:
    """Read an opened log as a drive. Raises Failed."""
    try:
        return read_drive(path, vehicle, estimating=False, log=log)
    except LogError as error:
        # whole, but without a frame
        nothing = log.damage is None and not log.frames_read
        raise Failed(failure_of(error, Failure.EMPTY if nothing else Failure.NOT_A_LOG), str(error)) from None


def _tables(drive: Drive, vehicle: Vehicle, start_utc: float, settings: Settings) -> dict[str, list[Row]]:
    trace, health = drive.trace, drive.health
    identified = drive_parameters.identify(trace, sliding=settings.windows, **vehicle.estimators)
    reports = monitor_misfits.monitor_reports(trace) if settings.windows else iter(())
    misfits = monitor_misfits.misfits(reports)
    row: Row = {column.name: None for column in DRIVES if column.name != "key"}
    row |= drive_row.read_columns(health, vehicle, start_utc)
    row |= drive_row.identified_columns(identified, vehicle)
    row["monitor_misfits"] = len(misfits) if settings.windows else None
    if settings.traffic:
        row["traffic_json"] = _traffic(trace, row["output"])
    tables: dict[str, list[Row]] = {name: [] for name in TABLES}
    tables["drives"] = [row]
    tables["windows"] = detail_rows.window_rows(identified.windows)
    tables["events"] = detail_rows.event_rows(identified, health, misfits)
    if settings.diagnosis:
        # the numbers that are kept are those of `identify`
        report = diagnosis.diagnose(trace, arbitrated=False)
        row |= drive_row.diagnosed_columns(report)
        tables["findings"] = detail_rows.finding_rows(report)
        tables["power"] = detail_rows.power_rows(report)
    return tables


def _traffic(trace: Trace, output: str) -> str | None:
    """Car-following models of traffic simulators; None: none can be calibrated on this drive."""
    try:
        from canid.analysis.sumo import driver_model

        return line(driver_model.to_json(driver_model.fit(trace, output)))
    except MemoryError:
        raise
    except Exception:  # of any kind: a drive has all its other results without it
        return None
