"""What is wrong with a cluster is said in one line and costs no log: real processes, in namespaces of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("distributed", reason="needs distributed: pip install 'canid[fleet]'")

from canid.analysis.fleet.job import Job, Outcome
from canid.analysis.fleet.running import dask_run, local_run
from canid.values.errors import ConfigError
from tests.fleet import short_logs
from tests.fleet.dask_processes import cluster
from tests.fleet.fleet_jobs import SOURCES, job
from tests.fleet.short_logs import QUICK
from tests.fleet.test_isolated import numbers

pytestmark = [
    pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning"),
    pytest.mark.slow("runs of a fleet in processes of their own"),
]
LOGS = 6
NAMESPACES = (
    subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False).returncode == 0
    if Path("/usr/bin/unshare").exists()
    else False
)
needs_namespaces = pytest.mark.skipif(not NAMESPACES, reason="needs namespaces of mounts: root, unshare")
# a worker whose canid says that it is another one
OTHER = "import canid.analysis.fleet.key as key\nkey.PROGRAM = {!r}\n"


@pytest.fixture
def jobs(tmp_path: Path) -> list[Job]:
    folder = tmp_path / "logs"
    folder.mkdir()
    for k in range(LOGS - 1):
        (folder / f"{k}.log").write_bytes(short_logs.log(k, 8.0))
    return [job(folder / f"{k}.log") for k in range(LOGS)]  # the last one is missing


def run(jobs: list[Job], address: str, **settings: Any) -> list[Outcome]:
    return list(dask_run.outcomes(jobs, SOURCES, scheduler=address, **settings))


@needs_namespaces
def test_a_worker_that_does_not_see_the_logs_wins_none(tmp_path: Path, jobs: list[Job]) -> None:
    """It fails fastest: its logs are analysed by the other one, it is named once, and what is missing for all is missing."""
    lines: list[str] = []
    with cluster(tmp_path, 0) as made:
        made.start_worker(hidden=tmp_path / "logs")
        made.wait(1)
        made.start_worker()
        made.wait(2)
        found = run(jobs, made.address, inform=lines.append)
    expected = local_run.outcomes(jobs, SOURCES, 1)
    assert {one.log: numbers(one) for one in found} == {one.log: numbers(one) for one in expected}
    assert len(found) == LOGS
    (said,) = lines
    assert "does not see" in said
    assert "it gets no more logs" in said


@needs_namespaces
def test_where_no_worker_sees_the_logs_the_run_ends(tmp_path: Path, jobs: list[Job]) -> None:
    """One line says what to do; no log has failed for it."""
    with cluster(tmp_path, 0) as made:
        made.start_worker(hidden=tmp_path / "logs")
        made.wait(1)
        with pytest.raises(ConfigError, match="no worker that sees the logs: mount them") as raised:
            run(jobs[:-1], made.address, patience_s=2.0)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("other", ["0.0.9/1/3.11", "0.0.9/1", "SAME/2.7"])
def test_workers_of_another_version_are_refused(tmp_path: Path, jobs: list[Job], other: str) -> None:
    """Another canid, one before this line was thought of, another Python: one line with both versions."""
    from canid.analysis.fleet.key import IDENTITY, PROGRAM

    (tmp_path / "sitecustomize.py").write_text(OTHER.format(other.replace("SAME", IDENTITY)), "utf-8")
    with cluster(tmp_path, 0) as made:
        made.start_worker(PYTHONPATH=f"{tmp_path}{os.pathsep}{short_logs.REPO}")
        made.wait(1)
        with pytest.raises(ConfigError, match="install the same versions on all machines") as raised:
            run(jobs, made.address)
    assert PROGRAM.rpartition("/")[2] in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("workers", [0, 1])
def test_a_scheduler_that_is_killed_is_one_line(tmp_path: Path, jobs: list[Job], workers: int) -> None:
    """While the run waits for a worker, and in the middle of its logs: no traceback of Dask's, and exit code 2 or 1."""
    settings = QUICK if workers == 0 else ("--vehicle", "generic", "--no-diagnosis")
    with cluster(tmp_path, workers) as made:
        text = (
            "import sys; from canid.ui.cli import main; from canid.analysis.fleet.running import dask_run\n"
            "given = dask_run.outcomes\n"
            "dask_run.outcomes = lambda *words, **named: given(*words, **named, patience_s=3.0)\n"
            "sys.exit(main(sys.argv[1:]))\n"
        )
        of = subprocess.Popen(
            [sys.executable, "-c", text, "fleet", tmp_path / "logs", "-o", tmp_path / "out", *settings,
             "--scheduler", made.address],
            cwd=short_logs.REPO, env=short_logs.environment(), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        if workers == 0:
            assert of.stderr is not None
            assert any("has no worker; waiting" in line for line in of.stderr)
        else:
            deadline = time.monotonic() + short_logs.PATIENCE_S
            while not any(path.stat().st_size for path in (tmp_path / "out").glob("segments/*")):
                assert time.monotonic() < deadline
                time.sleep(0.02)
        made.scheduler.kill()
        _, errors = of.communicate(timeout=short_logs.PATIENCE_S)
    assert of.returncode in (1, 2)
    assert "Traceback" not in errors
    assert all(line.startswith("canid: ") for line in errors.splitlines()), errors


@pytest.mark.parametrize("where", [(), ("--workers", "20")])
def test_after_a_kill_the_same_command_goes_on_at_once(
    tmp_path: Path, jobs: list[Job], where: tuple[str, ...]
) -> None:
    """With a process per core, and with more: no orphan holds the folder."""
    words = (tmp_path / "logs", "-o", tmp_path / "out", *QUICK, *where)
    of = subprocess.Popen(
        short_logs.command(*words),
        cwd=short_logs.REPO, env=short_logs.environment(),
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    deadline = time.monotonic() + short_logs.PATIENCE_S
    while not any(path.stat().st_size for path in (tmp_path / "out").glob("segments/*")):
        assert of.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(of.pid, signal.SIGKILL)
    of.wait()
    again = short_logs.fleet(*words)
    assert (again.returncode, f"{LOGS - 1} ok" in again.stdout) == (0, True), again
