"""`canid fleet --workers N` listens nowhere: nobody on the machine can command its processes."""

from __future__ import annotations

import ast
import os
import socket
import subprocess
import time
from pathlib import Path

import pytest

from tests.fixtures import sockets
from tests.fleet import short_logs
from tests.fleet.dask_processes import descendants
from tests.fleet.short_logs import QUICK, REPO

WORKERS = 3
LOGS = 9
# what listens, or starts what does
NAMES = frozenset(
    {
        *("LocalCluster", "SpecCluster", "Scheduler", "Worker", "Nanny", "SSHCluster"),
        *("bind", "listen", "create_server", "start_server", "Listener", "Manager", "BaseManager"),
    }
)


@pytest.mark.slow("a run of a fleet in processes of its own")
def test_no_process_of_a_run_listens(tmp_path: Path) -> None:
    """At no time, with more workers than cores: no socket of TCP or Unix, and every worker was there."""
    workers = max(WORKERS, len(os.sched_getaffinity(0)) + 1)
    short_logs.write(tmp_path / "logs", max(LOGS, 2 * workers), 8.0)
    words = (tmp_path / "logs", "-o", tmp_path / "out", *QUICK, "--workers", workers)
    running = subprocess.Popen(
        short_logs.command(*words),
        cwd=REPO, env=short_logs.environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    most = 0
    deadline = time.monotonic() + short_logs.PATIENCE_S
    while running.poll() is None:
        assert time.monotonic() < deadline
        below = descendants(running.pid)
        most = max(most, len(below))
        assert sockets.listening([running.pid, *below]) == []
        time.sleep(0.02)
    assert running.returncode == 0
    assert most >= workers


@pytest.mark.parametrize("family", [socket.AF_INET, socket.AF_INET6, socket.AF_UNIX])
def test_a_socket_that_listens_is_seen(family: socket.AddressFamily) -> None:
    """Of this process, by /proc: on loopback, and one of Unix without a name in the file system."""
    before = sockets.listening([os.getpid()])
    with socket.socket(family) as made:
        places = {
            socket.AF_INET: ("127.0.0.1", 0),
            socket.AF_INET6: ("::1", 0),
            socket.AF_UNIX: "\0canid test",
        }
        made.bind(places[family])
        assert sockets.listening([os.getpid()]) == before
        made.listen()
        (found,) = set(sockets.listening([os.getpid()])) - set(before)
        name = made.getsockname()
        assert (found.host, found.port) == (("", 0) if family is socket.AF_UNIX else name[:2])


def listeners(source: str) -> list[str]:
    """Names of what listens, as far as a source calls or imports it."""
    found = []
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Attribute(attr=name) | ast.Name(id=name):
                found.append(name)
            case ast.ImportFrom(names=names):
                found += [one.name for one in names]
    return [name for name in found if name in NAMES]


def test_nothing_of_a_fleet_starts_what_listens() -> None:
    """No file of canid/analysis/fleet names a server, whatever the number of workers: read from the source."""
    files = sorted((REPO / "canid/analysis/fleet").rglob("*.py"))
    assert {str(path): names for path in files if (names := listeners(path.read_text("utf-8")))} == {}


def test_such_a_name_is_found() -> None:
    assert listeners("import distributed\ndistributed.LocalCluster(2)\nfrom socket import create_server\n")
