"""A log that hangs, eats memory or ends its process costs itself alone; a child never outlives its parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from canid.analysis.fleet.job import Failure, Job, Outcome, Status
from canid.analysis.fleet.one_log.analysis import analyse
from canid.analysis.fleet.running import local_run
from canid.analysis.fleet.running.isolated import Child
from tests.exact import exact
from tests.fixtures.ended import PATIENCE_S, gone
from tests.fleet import short_logs
from tests.fleet.fleet_jobs import GENERIC, QUICK, REPO, SOURCES, URBAN, job, sparse

# bytes of zeros that take some seconds to hash, and room for nothing
SLOW_BYTES = 20_000_000_000


@pytest.fixture
def child() -> Iterator[Child]:
    made = Child()
    yield made
    made.close()


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log that keeps a child busy for a minute."""
    return sparse(tmp_path_factory.mktemp("slow") / "slow.blf", SLOW_BYTES)


def numbers(outcome: Outcome) -> str:
    """An outcome without what the machine was doing just then."""
    rows = {
        name: [{k: v for k, v in row.items() if k not in ("cpu_s", "wall_s", "peak_bytes")} for row in of]
        for name, of in outcome.tables.items()
    }
    return exact((outcome._replace(tables={}), rows))


def busy(child: Child) -> int:
    """Wait until there is a child; its process."""
    deadline = time.monotonic() + PATIENCE_S
    while child.pid is None and time.monotonic() < deadline:
        time.sleep(0.01)
    assert child.pid is not None
    return child.pid


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_child_gives_the_numbers_of_a_direct_call(child: Child, tmp_path: Path) -> None:
    """One child analyses log after log, in whatever order, and each has the numbers of a process of its own."""
    paths = [tmp_path / f"{k}.log" for k in range(3)]
    for k, path in enumerate(paths):
        path.write_bytes(short_logs.log(k, 20.0))
    jobs = [job(paths[0]), job(URBAN), job(paths[1]), job(paths[0]), job(paths[2])]
    pids = set()
    for one in jobs:
        assert numbers(child.analyse(one, GENERIC)) == numbers(analyse(one, GENERIC))
        pids.add(child.pid)
    assert len(pids) == 1


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_what_dask_sets_for_its_workers_does_not_slow_an_analysis(
    child: Child, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dask makes malloc give back memory at once, which costs an analysis a sixth; all else is inherited."""
    monkeypatch.setenv("MALLOC_TRIM_THRESHOLD_", "65536")
    monkeypatch.setenv("CANID_OF_A_TEST", "kept")
    log = tmp_path / "0.log"
    log.write_bytes(short_logs.log(0))
    assert child.analyse(job(log), GENERIC).log == str(log)
    found = Path(f"/proc/{child.pid}/environ").read_bytes().split(b"\0")
    assert b"CANID_OF_A_TEST=kept" in found
    assert not any(one.startswith(b"MALLOC_TRIM_THRESHOLD_") for one in found)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_log_that_takes_too_long_is_ended_and_the_next_one_analysed(child: Child, slow: Path) -> None:
    """`timeout`; the child is replaced, and nothing of it is left."""
    assert child.analyse(job(URBAN), GENERIC).status is Status.OK
    pid = child.pid
    assert pid is not None
    outcome = child.analyse(job(slow, QUICK._replace(timeout_s=0.3)), GENERIC)
    assert (outcome.status, outcome.failure) == (Status.FAILED, Failure.TIMEOUT)
    assert "0.3 s" in outcome.reason
    assert gone(pid)
    assert child.analyse(job(URBAN), GENERIC).status is Status.OK
    assert child.pid != pid


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_a_child_that_is_killed_in_the_middle(child: Child, slow: Path, number: signal.Signals) -> None:
    """`crashed`, with the signal's name; the next log is analysed by a new one."""
    outcomes: list[Outcome] = []
    thread = threading.Thread(target=lambda: outcomes.append(child.analyse(job(slow), GENERIC)))
    thread.start()
    os.kill(busy(child), number)
    thread.join(PATIENCE_S)
    (outcome,) = outcomes
    assert (outcome.status, outcome.failure, outcome.tables) == (Status.FAILED, Failure.CRASHED, {})
    assert number.name in outcome.reason
    assert child.analyse(job(URBAN), GENERIC).status is Status.OK


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("megabytes", [60, 250])
def test_a_log_that_takes_too_much_memory(child: Child, tmp_path: Path, megabytes: int) -> None:
    """`memory`, wherever it runs out, a crash of duckdb included; the next log is analysed."""
    duckdb = pytest.importorskip("duckdb")
    path = tmp_path / "bomb.parquet"
    columns = "range * 0.01 AS time, 20.0 AS pedal, 20.0 AS speed, 30.0 AS gap, 0.0 AS range_rate"
    duckdb.sql(f"COPY (SELECT {columns} FROM range(2000000)) TO '{path}' (FORMAT parquet)")
    outcome = child.analyse(job(path, QUICK._replace(memory_bytes=megabytes * 10**6)), GENERIC)
    assert (outcome.status, outcome.failure, outcome.tables) == (Status.FAILED, Failure.MEMORY, {}), (
        outcome.reason
    )
    assert child.analyse(job(URBAN), GENERIC).status is Status.OK


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_what_a_library_prints_gets_not_between_the_answers(child: Child, tmp_path: Path) -> None:
    """A damaged log, of which readers warn on their own ways, is answered as any other; nothing is left in TMPDIR."""
    path = tmp_path / "cut.blf"
    path.write_bytes(URBAN.read_bytes()[:200_000])
    assert child.analyse(job(path), GENERIC).status is Status.DAMAGED
    assert child.analyse(job(URBAN), GENERIC).status is Status.OK


PARENT = """
import sys, threading, time
sys.path.insert(0, {repo!r})
from canid.analysis.fleet.running.isolated import Child
from tests.fleet.fleet_jobs import GENERIC, job
child = Child()
threading.Thread(target=child.analyse, args=(job({path!r}), GENERIC), daemon=True).start()
while child.pid is None:
    time.sleep(0.01)
print(child.pid, flush=True)
time.sleep(600)
"""


def test_a_child_ends_when_its_parent_was_killed(slow: Path) -> None:
    """Also in the middle of a log, with nobody to read its answer."""
    text = PARENT.format(repo=str(REPO), path=str(slow))
    with subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, cwd=REPO) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        parent.kill()
        assert gone(pid)


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_what_a_killed_run_has_left_is_deleted_by_the_next_one(
    child: Child, slow: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder of a run that was killed, with its child or not; that of a run that works stays."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    text = PARENT.format(repo=str(REPO), path=str(slow))
    parents, pids = [], []
    for _ in range(3):
        parents.append(
            subprocess.Popen(
                [sys.executable, "-c", text],
                stdout=subprocess.PIPE,
                cwd=REPO,
                env={**os.environ, "TMPDIR": str(tmp_path)},
            )
        )
        made = parents[-1].stdout
        assert made is not None
        pids.append(int(made.readline()))
    living, killed, killed_with_child = parents
    folders = set(tmp_path.iterdir())
    assert len(folders) == 3
    os.kill(pids[2], signal.SIGKILL)
    for parent in (killed, killed_with_child):
        parent.kill()
        parent.communicate()
    assert all(gone(pid) for pid in pids[1:])
    child.analyse(job(tmp_path / "missing.blf"), GENERIC)
    left = {path for path in folders if path.exists()}
    living.kill()
    living.communicate()
    assert len(left) == 1
    assert gone(pids[0])


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_many_logs_each_have_one_outcome(tmp_path: Path) -> None:
    """Jobs are taken lazily, a few at a time; every one has one outcome, the same as alone, in whatever order."""
    for k in range(12):
        (tmp_path / f"{k}.log").write_bytes(short_logs.log(k, 4.0))
    jobs = [job(tmp_path / f"{k}.log") for k in range(12)] + [job(tmp_path / "gone.blf")]
    taken: list[str] = []

    def lazily() -> Iterator[Job]:
        for one in jobs:
            taken.append(one.log)
            yield one

    found: dict[str, Outcome] = {}
    for outcome in local_run.outcomes(lazily(), SOURCES, 2):
        assert outcome.log not in found
        found[outcome.log] = outcome
        assert len(taken) - len(found) < 2 * local_run.JOBS_PER_WORKER
    assert set(found) == {one.log for one in jobs}
    for one in jobs[::4]:
        assert numbers(found[one.log]) == numbers(analyse(one, GENERIC))


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_closing_ends_all_children(slow: Path) -> None:
    """An interruption waits for no log: the children are gone when the iterator is closed."""
    before = set(children())
    running = local_run.outcomes(iter([job(URBAN), *[job(slow)] * 20]), SOURCES, 2)
    assert next(running).status is Status.OK
    made = set(children()) - before
    assert len(made) == 2
    running.close()
    assert all(gone(pid) for pid in made)


def children() -> list[int]:
    """Of this process."""
    text = Path(f"/proc/self/task/{threading.main_thread().native_id}/children").read_text(encoding="ascii")
    threads = Path("/proc/self/task").iterdir()
    texts = [(thread / "children").read_text(encoding="ascii") for thread in threads]
    return [int(word) for word in " ".join([text, *texts]).split()]


def test_a_source_that_is_missing_is_the_callers_mistake() -> None:
    """It raises, instead of failing every log."""
    with pytest.raises(KeyError):
        list(local_run.outcomes([job(URBAN)._replace(source="another")], SOURCES, 1))
