"""Data types of the analysis of one log: what is to be done (`Job`), and what came of it (`Outcome`).

Both can be pickled, and hold nothing of the machine that made them: the same function runs in a local process and on a
Dask worker.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, NamedTuple

from canid.analysis.tables.column_map import ColumnMap
from canid.signals.vehicle import Vehicle


class Source(NamedTuple):
    """How logs are decoded: by a vehicle file, or, of tables, by a column map. One for many logs."""

    vehicle: Vehicle | None
    columns: ColumnMap | None
    fingerprint: str  # of all that changes a number: vehicle file, DBC files, column map


class Settings(NamedTuple):
    """What is computed of each log, and what it may take."""

    windows: bool = True  # estimates over sliding windows, and the monitor
    diagnosis: bool = True
    traffic: bool = True  # car-following models that traffic simulators have, calibrated
    timeout_s: float = 3600.0  # s of wall time for one log
    memory_bytes: int = 4_000_000_000  # that the process of one log may allocate


class Job(NamedTuple):
    """One log to be analysed."""

    log: str  # path or URL
    size: int  # bytes, when the log was listed
    modified_ns: int  # ns since 1970, when the log was listed; 0: not known
    source: str  # key of its `Source`
    settings: Settings = Settings()
    together: tuple[Job, ...] = ()  # logs that are diagnosed together; then `log` is no log, but their key
    of_car: bool = False  # together: of one car, whoever drove; else of one driver


class Status(Enum):
    """What an analysis came to. The member's value is its public name."""

    OK = "ok"
    DAMAGED = "damaged"  # the log is damaged: results rest on what could be read of it
    FAILED = "failed"


class Failure(Enum):
    """Why a log has no results. The member's value is its public name."""

    NONE = ""
    MISSING = "missing"  # no such file
    PERMISSION = "permission"
    UNREADABLE = "unreadable"  # an error of the disk
    NOT_REACHED = "not_reached"  # its storage did not answer: says nothing of the log
    NOT_A_LOG = "not_a_log"  # no log format, or damaged from its first byte on
    EMPTY = "empty"
    NOTHING_MAPPED = "nothing_mapped"  # a log of another vehicle
    UNMAPPED = "unmapped"  # the plan knows no driver or no vehicle file for it
    CHANGED = "changed"  # while it was read
    TIMEOUT = "timeout"
    MEMORY = "memory"
    CRASHED = "crashed"  # its process ended without an answer
    ERROR = "error"  # an error in canid


# what another attempt may mend without any change of the log: such a log is tried again by the next run
TRANSIENT = frozenset(
    {
        Failure.MISSING,
        Failure.PERMISSION,
        Failure.UNREADABLE,
        Failure.NOT_REACHED,
        Failure.CHANGED,
        Failure.TIMEOUT,
        Failure.MEMORY,
    }
    | {Failure.CRASHED}
)


class Outcome(NamedTuple):
    """What came of one log."""

    log: str
    key: str  # SHA-256 of the log's bytes, its source, the settings and canid's version: see `analysis.key`; "": not read
    status: Status
    failure: Failure
    reason: str  # one line; "": nothing was wrong
    # table name (columns.py) -> rows, each a mapping of column names to plain Python values; None: not known
    tables: Mapping[str, Sequence[Mapping[str, Any]]]
