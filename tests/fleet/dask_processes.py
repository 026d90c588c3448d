"""A real Dask cluster on loopback, started by the commands that docs/fleet.md states."""

from __future__ import annotations

import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

HOST = "127.0.0.1"
DASK = str(Path(sys.executable).parent / "dask")
# s; bounds what hangs
PATIENCE_S = 90.0


def free_port() -> int:
    with socket.socket() as made:
        made.bind((HOST, 0))
        return int(made.getsockname()[1])


def descendants(pid: int) -> list[int]:
    """All processes below one, as far as they live."""
    out: list[int] = []
    with suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text(encoding="ascii").split():
                out += [int(child), *descendants(int(child))]
    return out


def command_line(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


class Cluster:
    """A scheduler and workers that are started again where they end, as a service manager does."""

    def __init__(self, folder: Path, workers: int = 2):
        self.port, self.folder = free_port(), folder
        self.address = f"tcp://{HOST}:{self.port}"
        self._groups: list[subprocess.Popen[bytes]] = []
        self.scheduler = self.start_scheduler()
        for _ in range(workers):
            self.start_worker()

    def _start(self, command: str, **environment: str) -> subprocess.Popen[bytes]:
        with (self.folder / "dask.txt").open("ab") as log:
            made = subprocess.Popen(
                ["sh", "-c", command], stdout=log, stderr=log, start_new_session=True, cwd=self.folder,
                env={**os.environ, "OMP_NUM_THREADS": "1", "DASK_TEMPORARY_DIRECTORY": str(self.folder),
                     # as Dask's default of 3, but a log that kills its workers costs fewer of them
                     "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1", **environment},
            )  # fmt: skip
        self._groups.append(made)
        return made

    def start_scheduler(self) -> subprocess.Popen[bytes]:
        return self._start(
            f"exec {shlex.quote(DASK)} scheduler --host {HOST} --port {self.port} --no-dashboard"
        )

    def start_worker(self, hidden: Path | None = None, **environment: str) -> None:
        """Start a worker; it sees an empty folder in the place of `hidden`."""
        one = f"{shlex.quote(DASK)} worker {self.address} --host {HOST} --nthreads 1 --no-dashboard"
        if hidden is not None:
            inside = f"mount -t tmpfs none {shlex.quote(str(hidden))} && exec {one}"
            one = f"unshare --mount sh -c {shlex.quote(inside)}"
        self._start(f"while sleep 0.1; do {one}; done", **environment)

    def restart_scheduler(self) -> None:
        """Kill it, and start another one at the same address."""
        self.scheduler.kill()
        self.scheduler.wait()
        self.scheduler = self.start_scheduler()

    def processes(self, words: str) -> list[int]:
        """Of this cluster, whose command line has these words."""
        below = [pid for one in self._groups for pid in descendants(one.pid)]
        return [pid for pid in below if words in command_line(pid)]

    def close(self) -> None:
        for one in self._groups:
            with suppress(ProcessLookupError):
                os.killpg(one.pid, signal.SIGKILL)
            one.wait()

    def wait(self, workers: int) -> None:
        """Wait until the scheduler answers and has so many workers."""
        from distributed import Client

        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                with Client(self.address, timeout=5.0, set_as_default=False) as client:
                    if workers:
                        client.wait_for_workers(workers, timeout=PATIENCE_S)
                return
            except (OSError, TimeoutError):
                assert time.monotonic() < deadline
                time.sleep(0.2)


@contextmanager
def cluster(folder: Path, workers: int = 2) -> Iterator[Cluster]:
    """A cluster that is ready."""
    made = Cluster(folder, workers)
    try:
        made.wait(workers)
        yield made
    finally:
        made.close()
