"""Small logs that all differ: some seconds of a shipped log as candump text, each from another second of it."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

REPO = Path(__file__).parents[2]
URBAN = REPO / "replay_logs/following_urban.blf"
# s; bounds what hangs
PATIENCE_S = 120.0
# whole drives alone: some milliseconds a log
QUICK = ("--vehicle", "generic", "--no-diagnosis", "--no-windows", "--no-traffic")
# of a fleet's folder
TABLES = (
    "logs",
    "drives",
    "windows",
    "events",
    "findings",
    "power",
    "drivers",
    "population",
    "joint_findings",
)


@cache
def frames() -> list[tuple[float, str]]:
    """Time in s since the first frame, and the rest of a candump line."""
    from canid.io.logs import open_log

    found = []
    for frame in open_log(URBAN):
        if frame.t > 60.0:
            break
        found.append((frame.t, f"can{frame.bus} {frame.id:03X}#{bytes(frame.data).hex().upper()}"))
    return found


def log(number: int, seconds: float = 2.0) -> bytes:
    """A log of some seconds; each number gives other bytes, all of about the same length."""
    start = (number * 0.37) % (58.0 - seconds)
    lines = [f"({1e9 + number + t:.6f}) {rest}" for t, rest in frames() if start <= t < start + seconds]
    return ("\n".join(lines) + "\n").encode()


def write(folder: Path, number: int, seconds: float = 2.0, drivers: int = 3) -> list[Path]:
    """Write logs of some drivers into a folder each."""
    paths = []
    for k in range(number):
        path = folder / f"driver {k % drivers}" / f"drive {k:03d}.log"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(log(k, seconds))
        paths.append(path)
    return paths


def environment() -> dict[str, str]:
    """Of a real command."""
    return {**os.environ, "OMP_NUM_THREADS": "1"}


def command(*words: object) -> list[str]:
    """A real canid command."""
    return [sys.executable, "-m", "canid", "fleet", *map(str, words)]


def fleet(*words: object, **settings: Any) -> subprocess.CompletedProcess[str]:
    """Run `canid fleet` in a process of its own."""
    return subprocess.run(
        command(*words),
        cwd=settings.pop("cwd", REPO),
        env=environment(),
        capture_output=True,
        text=True,
        errors="surrogateescape",
        timeout=PATIENCE_S,
        check=False,
        **settings,
    )


class Done(NamedTuple):
    """A command that has ended."""

    returncode: int
    stdout: str
    stderr: str


def fleet_here(*words: object) -> Done:
    """Run `canid fleet` in this process: as `fleet`, without the imports of a new one."""
    from canid.ui.cli import main

    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main(["fleet", *map(str, words)])
    return Done(code, out.getvalue(), err.getvalue())


def table(folder: Path, name: str, columns: str = "*", rest: str = "") -> list[tuple[Any, ...]]:
    """Rows of a table of a fleet's folder."""
    import duckdb

    with duckdb.connect() as db:
        path = str(folder / f"{name}.parquet").replace("'", "''")
        return db.execute(f"SELECT {columns} FROM read_parquet('{path}') {rest}").fetchall()
