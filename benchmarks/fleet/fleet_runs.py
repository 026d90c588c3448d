"""`canid fleet` as its own program: wall time, CPU time and peak memory of the client and of its worker processes."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import duckdb

# s between two readings of the processes' memory; a peak is kept by the kernel until the process ends
POLL_S = 0.2
# s that a scheduler or a worker may take to start on a loaded machine
START_S = 60.0
# of the documentation, for all processes of the cluster: idle ones take less of a core
DASK_SETTINGS = {
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "5s",
}
# what the exit codes of a run with results are: done, and done with logs that failed
GOOD_EXITS = (0, 4)


class Ran(NamedTuple):
    """One run."""

    exit: int
    wall_s: float
    cpu_s: float  # of the program and all processes that it started and waited for
    client_cpu_s: float  # of the program alone
    client_bytes: int  # peak of resident memory, of the program alone
    worker_bytes: int  # the largest peak of any process below it
    output: str  # standard output and errors


def run(words: Sequence[str | Path], *, nice: int = 0, check: bool = True) -> Ran:
    """Run `canid fleet WORDS`.

    Args:
        words: of the command line.
        nice: added to the priority.
        check: fail on exit codes other than 0 and 4.

    Raises:
        RuntimeError: the program failed; with what it printed.
    """
    command = [sys.executable, "-m", "canid", "fleet", *map(str, words)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    begin = time.perf_counter()
    with (
        tempfile.TemporaryFile() as output,
        subprocess.Popen(
            ["nice", "-n", str(nice), *command],
            stdout=output,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            env=environment,
        ) as program,
    ):
        client = worker = 0
        own = 0.0
        pid = 0
        while not pid:
            client, own = max(client, _peak(program.pid)), max(own, _cpu(program.pid))
            worker = max([worker, *map(_peak, _below(program.pid))])
            pid, status, usage = os.wait4(program.pid, os.WNOHANG)
            if not pid:
                time.sleep(POLL_S)
        wall = time.perf_counter() - begin
        program.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        text = output.read().decode(errors="replace")
    if check and program.returncode not in GOOD_EXITS:
        raise RuntimeError(f"canid fleet ended with {program.returncode}:\n{text}")
    return Ran(program.returncode, wall, usage.ru_utime + usage.ru_stime, own, client, worker, text)


def _peak(pid: int) -> int:
    """Peak of resident memory, bytes; 0: the process has ended."""
    try:
        with open(f"/proc/{pid}/status", encoding="utf-8") as file:
            for line in file:
                if line.startswith("VmHWM"):
                    return int(line.split()[1]) * 1024
    except (OSError, ValueError):
        pass
    return 0


def _cpu(pid: int) -> float:
    """CPU time of a process itself, s."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    # fields 14 and 15 of proc(5); the state, field 3, is the first one here
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def _below(pid: int) -> list[int]:
    """All processes that a process has started, and those that they have."""
    out: list[int] = []
    pending = [pid]
    while pending:
        try:
            texts = [path.read_text() for path in Path(f"/proc/{pending.pop()}/task").glob("*/children")]
        except OSError:
            continue
        found = [int(word) for text in texts for word in text.split()]
        out += found
        pending += found
    return out


@contextmanager
def cluster(workers: int, folder: Path) -> Iterator[str]:
    """A Dask scheduler and one worker process with a thread for each core, as the documentation starts them, on loopback.

    Args:
        workers: threads of it, each with a child that analyses.
        folder: for the scheduler's file and the log.

    Yields:
        the scheduler's address.
    """
    name = folder / "scheduler.json"
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **DASK_SETTINGS}
    dask = [sys.executable, "-m", "dask"]
    scheduler = [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    worker = [*dask, "worker", "--scheduler-file", str(name), "--nthreads", str(workers), "--nworkers", "1"]
    worker += ["--no-dashboard"]
    started: list[subprocess.Popen[bytes]] = []
    with (folder / "dask.log").open("ab") as log:
        try:
            commands = [[*scheduler, "--scheduler-file", str(name)], worker]
            started += [
                subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=folder)
                for command in commands
            ]
            yield _address(name)
        finally:
            for one in reversed(started):
                one.terminate()
            for one in started:
                try:
                    one.wait(10)
                except subprocess.TimeoutExpired:
                    one.kill()
                    one.wait()


def _address(name: Path) -> str:
    from distributed import Client

    begin = time.monotonic()
    while not name.exists():
        if time.monotonic() - begin > START_S:
            raise RuntimeError("the Dask scheduler did not start")
        time.sleep(0.1)
    time.sleep(0.2)
    address = str(json.loads(name.read_text(encoding="utf-8"))["address"])
    with Client(address, timeout=START_S) as client:  # type: ignore[no-untyped-call]
        client.wait_for_workers(1, timeout=START_S)
    return address


def rows(folder: Path, sql: str) -> list[dict[str, Any]]:
    """Rows of a query; {name} in it is the table NAME of a fleet's folder.

    Args:
        folder: of `canid fleet -o`.
        sql: such as "SELECT * FROM {drives}".
    """
    tables = {path.stem: f"read_parquet('{path}')" for path in folder.glob("*.parquet")}
    with duckdb.connect() as db:
        done = db.execute(sql.format_map(tables))
        names = [column[0] for column in done.description]
        return [dict(zip(names, row, strict=True)) for row in done.fetchall()]


def machine() -> str:
    """The machine and its load, for the line below a table."""
    one, five, _ = os.getloadavg()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return (
        f"{os.cpu_count()} cores ({platform.machine()}), {memory:.0f} GiB, Python {platform.python_version()}, "
        f"load average {one:.1f} (1 min), {five:.1f} (5 min)"
    )
