"""On a real Dask cluster every log has the rows of this machine, exactly once, whatever is killed in the middle."""

from __future__ import annotations

import os
import shlex
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("distributed", reason="needs distributed: pip install 'canid[fleet]'")

from canid.analysis.fleet.job import Failure, Job, Outcome, Status
from canid.analysis.fleet.running import dask_run, dask_worker, local_run
from canid.values.errors import CanidError, ConfigError
from tests.fleet import short_logs
from tests.fleet.dask_processes import Cluster, cluster, descendants, free_port
from tests.fleet.fleet_jobs import GENERIC, SOURCES, job
from tests.fleet.test_isolated import gone, numbers

# of Dask's own threads, at the end of the process
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
LOGS = 8


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> list[Job]:
    folder = tmp_path_factory.mktemp("logs")
    for k in range(LOGS - 1):
        (folder / f"{k}.log").write_bytes(short_logs.log(k, 8.0))
    return [job(folder / f"{k}.log") for k in range(LOGS)]  # the last one is missing


@pytest.fixture(scope="module")
def expected(jobs: list[Job]) -> dict[str, str]:
    return {of.log: numbers(of) for of in local_run.outcomes(jobs, SOURCES, 2)}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("dask")) as made:
        yield made


def check(found: list[Outcome], expected: dict[str, str], times: int = 1) -> None:
    assert len(found) == times * len(expected)
    for log, of in expected.items():
        assert [numbers(one) for one in found if one.log == log] == [of] * times


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_rows_are_those_of_this_machine(
    running: Cluster, jobs: list[Job], expected: dict[str, str]
) -> None:
    """Every row, to the last bit, and every failure; jobs are taken a few at a time."""
    taken: list[Job] = []

    def lazily() -> Iterator[Job]:
        for one in jobs:
            taken.append(one)
            yield one

    found = []
    for outcome in dask_run.outcomes(lazily(), SOURCES, scheduler=running.address):
        found.append(outcome)
        assert len(taken) - len(found) < 2 * dask_run.JOBS_PER_THREAD
    check(found, expected)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_worker_that_is_killed_loses_nothing(
    running: Cluster, jobs: list[Job], expected: dict[str, str]
) -> None:
    """Its logs are analysed elsewhere: none is lost, none comes twice, none fails for it; its children end as well."""
    found = []
    children: list[int] = []
    lines: list[str] = []
    for outcome in dask_run.outcomes(jobs * 2, SOURCES, scheduler=running.address, inform=lines.append):
        found.append(outcome)
        if len(found) == 3:
            workers = running.processes("multiprocessing.spawn")
            assert len(workers) == 2
            children = descendants(workers[0])
            assert children
            os.kill(workers[0], signal.SIGKILL)
    check(found, expected, 2)
    assert all(gone(pid) for pid in children)
    (said,) = (line for line in lines if "has ended in the middle of" in line)
    assert "analysed again" in said


# of a job whose unpickling ends a worker; in the scheduler, which unpickles it as well, it stays what it is
POISON = (
    "__import__('os').kill(__import__('os').getpid(), 9) if 'worker' in __import__('sys').argv[0:2] "
    "else type('Poison', (), {'__reduce__': lambda self: (eval, (code, {'code': code}))})()"
)


class Poison:
    def __reduce__(self) -> Any:
        return (eval, (POISON, {"code": POISON}))


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_log_that_kills_its_workers_fails_alone(
    running: Cluster, jobs: list[Job], expected: dict[str, str]
) -> None:
    """`crashed`; no other log is blamed for it, whatever was in the same workers' hands."""
    poisoned = Job("poison.blf", -1, 0, "generic", together=(Poison(),))  # type: ignore[arg-type]
    found = list(dask_run.outcomes([*jobs[:3], poisoned, *jobs[3:]], SOURCES, scheduler=running.address))
    (failed,) = (one for one in found if one.log == poisoned.log)
    assert (failed.status, failed.failure) == (Status.FAILED, Failure.CRASHED)
    check([one for one in found if one is not failed], expected)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_scheduler_is_killed_and_comes_back(
    running: Cluster, jobs: list[Job], expected: dict[str, str]
) -> None:
    """At the same address: what has no outcome is submitted again, with one line for the user."""
    lines: list[str] = []
    found = []
    for outcome in dask_run.outcomes(jobs, SOURCES, scheduler=running.address, inform=lines.append):
        found.append(outcome)
        if len(found) == 2:
            running.restart_scheduler()
    check(found, expected)
    # at the beginning the workers that the test before has killed may not be back
    (lost,) = (line for line in lines if "is lost" in line)
    assert running.address in lost


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_scheduler_that_never_comes_back(tmp_path: Path, jobs: list[Job]) -> None:
    """What was yielded is kept; then one line that says what to do."""
    with cluster(tmp_path, 1) as made:
        found: list[Outcome] = []

        def run() -> None:
            for outcome in dask_run.outcomes(jobs, SOURCES, scheduler=made.address, patience_s=2.0):
                found.append(outcome)
                if len(found) == 2:
                    made.scheduler.kill()

        with pytest.raises(CanidError, match="run the same command again") as raised:
            run()
    assert 2 <= len(found) < LOGS
    assert "\n" not in str(raised.value)


def test_another_version_is_refused() -> None:
    """Numbers of another release never come into one folder."""
    with pytest.raises(ConfigError, match=r"has canid .*, this is 0\.0\.9"):
        dask_worker.analyse("0.0.9/1", job("no.blf"), GENERIC)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_workers_without_canid_are_refused(tmp_path: Path, jobs: list[Job]) -> None:
    """One line, before the first log, that says which process it is and what to install."""
    with cluster(tmp_path, 0) as made:
        # a worker whose `import canid` fails: a file of that name comes first on its path
        hidden = tmp_path / "hidden" / "canid"
        hidden.mkdir(parents=True)
        (hidden / "__init__.py").write_text("raise ModuleNotFoundError(\"No module named 'canid'\")\n")
        made._start(
            f"{shlex.quote(sys.executable)} -m distributed.cli.dask_worker {made.address} --host 127.0.0.1 --nthreads 1 "
            "--no-dashboard",
            PYTHONPATH=str(hidden.parent),
        )
        with pytest.raises(ConfigError, match="cannot import canid") as raised:
            next(dask_run.outcomes(jobs, SOURCES, scheduler=made.address))
    assert "\n" not in str(raised.value)


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:{port}", "no address at all"])
def test_nothing_at_the_address(address: str, jobs: list[Job], monkeypatch: pytest.MonkeyPatch) -> None:
    """One line that names the address, within some seconds."""
    monkeypatch.setattr("canid.analysis.fleet.running.dask_cluster.CONNECT_S", 1.0)
    named = address.format(port=free_port())
    with pytest.raises(ConfigError) as raised:
        next(dask_run.outcomes(jobs, SOURCES, scheduler=named))
    assert named in str(raised.value)
    assert "\n" not in str(raised.value)
