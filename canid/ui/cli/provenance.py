"""Provenance of a diagnosis: hashes of the files, versions and the command that reproduces it."""

from __future__ import annotations

import hashlib
import math
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from canid import __version__
from canid.io.logs.log import open_log
from canid.signals.vehicle import Vehicle
from canid.values.errors import CanidError
from canid.values.findings import Provenance

# packages whose release can change a number
NUMERIC_PACKAGES = ("numpy", "scipy", "python-can", "cantools")


def sha256(path: str | Path) -> str:
    """SHA-256 of a file; empty if it cannot be read any more (a pipe, a deleted file)."""
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def versions() -> dict[str, str]:
    """Versions of canid, Python and the numeric packages.

    Example:
        >>> sorted(versions())[:3]
        ['canid', 'cantools', 'numpy']
    """
    releases = {"canid": __version__, "python": platform.python_version()}
    for name in NUMERIC_PACKAGES:
        try:
            releases[name] = version(name)
        except PackageNotFoundError:
            releases[name] = "unknown"
    return releases


def recorded(log: str | Path) -> str:
    """When a log begins, UTC; empty where it does not say or cannot be read."""
    try:
        start = open_log(log).start_utc
    except (CanidError, OSError):
        return ""
    if not math.isfinite(start):
        return ""
    return f"{datetime.fromtimestamp(start, UTC):%Y-%m-%d %H:%M:%S} UTC"


def provenance(logs: Sequence[str], vehicle: Vehicle | None, command: str) -> Provenance:
    """Provenance of the diagnosis of one log, or of several together; of tables, without a vehicle file."""
    path = vehicle.path if vehicle is not None else ""
    return Provenance(
        log=", ".join(logs),
        log_sha256=", ".join(map(sha256, logs)),
        vehicle=path,
        vehicle_sha256=sha256(path) if path else "",
        command=command,
        versions=versions(),
        dbc_sha256={file: sha256(file) for file in (vehicle.dbc if vehicle is not None else ())},
        recorded=", ".join(filter(None, map(recorded, logs))),
    )
