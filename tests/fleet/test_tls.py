"""A cluster as docs/fleet.md has it does the work of whoever has its certificate, and of nobody else."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

pytest.importorskip("distributed", reason="needs distributed: pip install 'canid[fleet]'")

import dask
import distributed.comm.core  # noqa: F401  # its import is none of a test's time

from canid.analysis.fleet.running import dask_cluster
from canid.values.errors import ConfigError
from tests.fixtures import sockets
from tests.fleet import certificates, short_logs
from tests.fleet.dask_processes import DASK, HOST, PATIENCE_S, descendants, free_port
from tests.fleet.short_logs import QUICK, REPO, table

# of Dask's own threads, at the end of the process
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
LOGS = 3
NOBODY = 65534
# connects as Dask does, to each address in turn
CONNECT = """
import asyncio, sys
from distributed.comm import connect
from distributed.security import Security
async def tried(address):
    try:
        comm = await connect(address, timeout=5, **Security().get_connection_args("client"))
        await comm.write({"op": "identity", "reply": True})
        answer = await asyncio.wait_for(comm.read(), 5)
        return "answered" if "type" in answer else repr(answer)
    except Exception as error:
        return type(error).__name__
print(*[asyncio.run(tried(address)) for address in sys.argv[1:]])
"""


class Running(NamedTuple):
    """A cluster that runs."""

    address: str
    environment: dict[str, str]
    listening: list[sockets.Socket]


def commands() -> tuple[str, str]:
    """Of the scheduler and of a worker, as the page has them; the loop around the worker is left out."""
    page = (REPO / "docs/fleet.md").read_text("utf-8")
    scheduler = re.search(r"^dask scheduler .*$", page, flags=re.M)
    worker = re.search(r"dask worker [^;]*", page)
    assert scheduler is not None
    assert worker is not None
    return scheduler[0], worker[0]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    home = tmp_path_factory.mktemp("home")
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **certificates.made(home)}
    port = free_port()
    others = {
        "dask": DASK,
        "eth0": "lo",
        "8786": str(port),
        f"tls://scheduler-host:{8786}": f"tls://{HOST}:{port}",
    }
    started = [
        subprocess.Popen(
            [others.get(word, word) for word in command.split()],
            cwd=home,
            env=environment,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        for command in commands()
    ]
    address = f"tls://{HOST}:{port}"
    try:
        deadline = time.monotonic() + PATIENCE_S
        # the scheduler, the worker and its nanny, and the two servers without pages
        while len(found := listened(started)) < 5:
            assert all(one.poll() is None for one in started)
            assert time.monotonic() < deadline
            time.sleep(0.2)
        yield Running(address, environment, found)
    finally:
        for one in reversed(started):
            one.terminate()
            one.wait()


def listened(started: list[subprocess.Popen[bytes]]) -> list[sockets.Socket]:
    return sockets.listening(pid for one in started for pid in (one.pid, *descendants(one.pid)))


def tried(addresses: list[str], environment: dict[str, str], *before: str) -> list[str]:
    """What becomes of connections of another process."""
    done = subprocess.run(
        [*before, sys.executable, "-c", CONNECT, *addresses],
        cwd="/", env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=True,
    )  # fmt: skip
    return done.stdout.split()


def http_answer(port: int) -> bytes:
    """The first line that a server of web pages gives; of another one, nothing that begins with HTTP."""
    with socket.create_connection((HOST, port), timeout=2.0) as made:
        made.sendall(b"GET /status HTTP/1.0\r\n\r\n")
        try:
            return made.recv(100).partition(b"\r\n")[0]
        except OSError:
            return b""


@pytest.mark.slow("a cluster of Dask in processes of their own")
def test_only_the_certificate_opens_it(running: Running, tmp_path: Path) -> None:
    """Every port: of scheduler, worker and nanny. Refused: another user, without TLS and with a certificate of his own."""
    ports = sorted({one.port for one in running.listening})
    of_dask = [port for port in ports if not http_answer(port).startswith(b"HTTP")]
    assert (len(ports), len(of_dask)) == (5, 3)
    secured = [f"tls://{HOST}:{port}" for port in of_dask]
    assert tried(secured, running.environment) == ["answered"] * 3
    # another user, where this one may become another; else the same one without the files
    other = ("setpriv", "--reuid", str(NOBODY), "--clear-groups") if os.geteuid() == 0 else ()
    plain = {key: value for key, value in running.environment.items() if key != "DASK_CONFIG"}
    refused = tried([f"tcp://{HOST}:{port}" for port in of_dask], plain, *other)
    assert "answered" not in refused
    own = {**plain, **certificates.made(tmp_path)}
    assert "answered" not in tried(secured, own)
    if other:
        # the folder of the certificate is closed to him, even where its name is known
        assert "answered" not in tried(secured, running.environment, *other)


@pytest.mark.slow("a cluster of Dask in processes of their own")
def test_it_listens_on_the_named_network_and_has_no_page(running: Running) -> None:
    assert {one.host for one in running.listening} == {HOST}
    pages = [line for one in running.listening if (line := http_answer(one.port)).startswith(b"HTTP")]
    assert len(pages) == 2
    assert all(b" 404 " in line for line in pages)


@pytest.mark.slow("a cluster of Dask in processes of their own")
def test_a_fleet_is_analysed_with_it_and_without_it_one_line_says_so(
    running: Running, tmp_path: Path
) -> None:
    """The rows are those of this machine; without the certificate, or with another one, exit code 2 and what to do."""
    short_logs.write(tmp_path / "logs", LOGS, 8.0)
    plain = {key: value for key, value in running.environment.items() if key != "DASK_CONFIG"}
    words = [tmp_path / "logs", *QUICK, "--json", "-"]

    def ran(out: str, environment: dict[str, str], *more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            short_logs.command(*words, "-o", tmp_path / out, *more),
            cwd=REPO, env=environment, capture_output=True, text=True, timeout=short_logs.PATIENCE_S, check=False,
        )  # fmt: skip

    with_it = ran("cluster", running.environment, "--scheduler", running.address)
    assert with_it.returncode == 0, with_it.stderr
    assert ran("here", plain).returncode == 0
    columns = "log, key, status, range_rate_K, duration, fit_percent"
    assert table(tmp_path / "cluster", "drives", columns) == table(tmp_path / "here", "drives", columns)
    other = {**plain, **certificates.made(tmp_path)}
    for environment, says in ((plain, "no certificate"), (other, "its certificate is none")):
        refused = ran("none", environment, "--scheduler", running.address)
        assert refused.returncode == 2
        assert says in refused.stderr.splitlines()[-1]
        assert "Traceback" not in refused.stderr


@pytest.mark.parametrize(
    ("settings", "address", "says"),
    [
        ({}, "tls://127.0.0.1:1", "names no certificate for clients"),
        ({"distributed.comm.require-encryption": True}, "tcp://127.0.0.1:1", "requires encryption"),
        (
            {"distributed.comm.tls.ca-file": "/no.pem", "distributed.comm.tls.client.cert": "/no.pem"},
            "tls://127.0.0.1:1",
            "cannot be used",
        ),
        ({}, "", "is empty"),
    ],
)
def test_certificates_that_cannot_serve_are_one_line(
    settings: dict[str, object], address: str, says: str
) -> None:
    """Before anything is connected to."""
    with dask.config.set(settings), pytest.raises(ConfigError, match=says) as raised:
        dask_cluster.connected(address, 0.0)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("tcp://192.0.2.1:8786", True),
        ("node1:8786", True),
        ("tcp://[2001:db8::1]:8786", True),
        ("ws://node1:8786", True),
        ("tcp://node1:no port", True),
        ("tls://node1:8786", False),
        ("tcp://127.0.0.1:8786", False),
        ("localhost:8786", False),
    ],
)
def test_a_connection_without_tls_is_said(address: str, said: bool) -> None:
    """One line that says what it means and what to do, for schedulers on other machines alone."""
    line = dask_cluster.exposure(address)
    assert bool(line) is said
    assert "\n" not in line
