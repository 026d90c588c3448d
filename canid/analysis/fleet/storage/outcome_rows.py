"""What a fleet's folder keeps of each outcome, and how a later run recognises a log that it knows."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Mapping
from typing import Any, NamedTuple

from canid.analysis.fleet.job import TRANSIENT, Failure, Settings, Status
from canid.analysis.fleet.key import IDENTITY
from canid.analysis.fleet.planning.plan import PlannedLog
from canid.analysis.fleet.storage.columns import Column

OUTCOMES = (
    Column("identity", "VARCHAR", "", "hash of path, size, time, source, settings and canid's version"),
    Column("log", "VARCHAR"),
    Column("bytes", "BIGINT"),
    Column("key", "VARCHAR"),
    Column("status", "VARCHAR"),
    Column("failure", "VARCHAR"),
    Column("reason", "VARCHAR"),
    Column("analysed_utc", "VARCHAR"),
    Column("attempts", "INTEGER"),
)


class Known(NamedTuple):
    """What is known of one log as it was."""

    key: str  # "": it has none
    status: Status
    failure: Failure
    reason: str
    analysed_utc: str  # ISO 8601
    attempts: int
    size: int  # bytes

    @property
    def has_results(self) -> bool:
        """Whether rows are stored under its key."""
        return self.status is not Status.FAILED and self.key != ""

    def final(self, *, retry_failed: bool) -> bool:
        """Whether another attempt would give nothing else.

        Example:
            >>> Known("", Status.FAILED, Failure.EMPTY, "", "", 1, 0).final(retry_failed=False)
            True
            >>> Known("", Status.FAILED, Failure.TIMEOUT, "", "", 1, 9).final(retry_failed=False)
            False
        """
        return self.status is not Status.FAILED or not (retry_failed or self.failure in TRANSIENT)


def computed(settings: Settings) -> str:
    """What of the settings, and of canid, decides the numbers."""
    return json.dumps([settings.windows, settings.diagnosis, settings.traffic, IDENTITY])


def identity(log: PlannedLog, computed: str) -> bytes:
    """Hash by which a log is recognised that has not changed since.

    Args:
        log: the log.
        computed: `computed`.

    Example:
        >>> log = PlannedLog("/a.blf", "/", 1, 2, "anna", "car", "", "source")
        >>> identity(log, "") == identity(log._replace(driver="ben"), "")
        True
        >>> identity(log, "") == identity(log._replace(modified_ns=3), "")
        False
    """
    text = f"{log.size}\0{log.modified_ns}\0{log.source}\0{computed}\0".encode()
    return hashlib.blake2b(text + os.fsencode(log.log), digest_size=16).digest()


def known(row: Mapping[str, Any]) -> tuple[bytes, Known]:
    """A stored row as what is known, with its identity."""
    return bytes.fromhex(row["identity"]), Known(
        row["key"] or "",
        Status(row["status"]),
        _failure(row["failure"]),
        sys.intern(row["reason"] or ""),
        # many logs end in one second
        sys.intern(row["analysed_utc"] or ""),
        row["attempts"] or 1,
        row["bytes"] or 0,
    )


def _failure(value: str | None) -> Failure:
    try:
        return Failure(value or "")
    except ValueError:  # of another version of canid
        return Failure.ERROR
