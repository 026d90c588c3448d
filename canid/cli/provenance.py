"""What a reader of a diagnosis needs to get the same one again: hashes of the files, versions, the command."""

from __future__ import annotations

import hashlib
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from canid import __version__
from canid.findings import Provenance
from canid.vehicle import Vehicle

# packages whose release can change a number
NUMERIC = ("numpy", "scipy", "python-can", "cantools")


def sha256(path: str | Path) -> str:
    """Hash a file; empty where it cannot be read any more (a pipe, a file that has gone)."""
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def versions() -> dict[str, str]:
    """Releases of canid, Python and the packages that compute.

    Example:
        >>> sorted(versions())[:3]
        ['canid', 'cantools', 'numpy']
    """
    told = {"canid": __version__, "python": platform.python_version()}
    for name in NUMERIC:
        try:
            told[name] = version(name)
        except PackageNotFoundError:
            told[name] = "unknown"
    return told


def provenance(log: str, vehicle: Vehicle, command: str) -> Provenance:
    """Collect it for one log."""
    return Provenance(
        log=log,
        log_sha256=sha256(log),
        vehicle=vehicle.path,
        vehicle_sha256=sha256(vehicle.path),
        command=command,
        versions=versions(),
        dbc_sha256={file: sha256(file) for file in vehicle.dbc},
    )
