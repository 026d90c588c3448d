"""Jobs of real logs, with the settings that cost least."""

from __future__ import annotations

from pathlib import Path

from canid.analysis.fleet.job import Job, Settings, Source
from canid.signals.vehicle import read_vehicle

REPO = Path(__file__).parents[2]
SHIPPED = REPO / "replay_logs"
URBAN = SHIPPED / "following_urban.blf"
# the whole drive alone. The time limit is the usual one: a shorter one ends sound children on a busy machine
QUICK = Settings(windows=False, diagnosis=False, traffic=False, memory_bytes=1_000_000_000)
GENERIC = Source(read_vehicle("generic"), None, "generic")
SOURCES = {"generic": GENERIC}


def job(path: Path | str, settings: Settings = QUICK) -> Job:
    """A job as a listing makes it; of a file that is not there the size is not known."""
    file = Path(path)
    found = file.stat() if file.is_file() else None
    if found is None:
        return Job(str(path), -1, 0, "generic", settings)
    return Job(str(path), found.st_size, found.st_mtime_ns, "generic", settings)


def sparse(path: Path, size: int) -> Path:
    """A file of zeros that takes no room on the disk."""
    with path.open("wb") as file:
        file.truncate(size)
    return path
