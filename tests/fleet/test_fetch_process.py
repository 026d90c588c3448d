"""A log of a storage is fetched by a process that reads no log, for one that may not connect."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("aiohttp", reason="needs aiohttp: pip install 'canid[fleet]'")

from canid.analysis.fleet.job import Failure, Job, Status
from canid.analysis.fleet.planning import remote
from canid.analysis.fleet.running.isolated import Child
from tests.fleet import short_logs
from tests.fleet.fleet_jobs import GENERIC, QUICK, job
from tests.fleet.storage_servers import Web, web
from tests.fleet.test_isolated import numbers

LOGS = {"a.log": short_logs.log(1, 6.0), "b.log": short_logs.log(2, 6.0), "bad.asc": b"no log\n" * 9}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the server has."""
    made = tmp_path_factory.mktemp("served")
    for name, content in LOGS.items():
        (made / name).write_bytes(content)
    return made


@pytest.fixture
def server(folder: Path) -> Iterator[Web]:
    with web(folder) as made:
        yield made


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where temporary files are."""
    made = tmp_path / "scratch"
    made.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(made))
    return made


@pytest.fixture
def child(scratch: Path) -> Iterator[Child]:
    made = Child()
    yield made
    made.close()


def of(url: str, size: int = -1) -> Job:
    return Job(url, size, 0, "generic", QUICK)


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_a_log_of_a_server_has_the_numbers_of_its_file(
    server: Web, folder: Path, scratch: Path, child: Child
) -> None:
    """Through both processes; so do its failures, and no copy is left."""
    for one in remote.listed(f"{server.url}*.log"):
        found = child.analyse(of(one.log, one.size), GENERIC)
        local = child.analyse(job(folder / one.log.rpartition("/")[2]), GENERIC)
        assert found.status is Status.OK, found.reason
        assert numbers(found._replace(log="")) == numbers(local._replace(log=""))
        assert str(scratch) not in str(found)
        assert files(scratch) == []
    for name, size, failure in (
        ("none.log", -1, Failure.MISSING),
        ("a.log", 9, Failure.CHANGED),
        ("bad.asc", -1, Failure.NOT_A_LOG),
    ):
        outcome = child.analyse(of(server.url + name, size), GENERIC)
        assert (outcome.failure, outcome.tables) == (failure, {}), outcome.reason
        assert "\n" not in outcome.reason
        assert str(scratch) not in outcome.reason
        assert files(scratch) == []
    child.close()
    assert list(scratch.iterdir()) == []


@pytest.mark.slow("a server that is waited for")
def test_a_server_that_is_slow_costs_the_time_of_one_log(server: Web, scratch: Path, child: Child) -> None:
    """`timeout`; its copy is deleted, and the next log is analysed."""
    assert child.analyse(of(f"{server.url}a.log"), GENERIC).status is Status.OK
    server.stop()
    server.start(pause_s=5.0)
    slow = of(f"{server.url}a.log")
    outcome = child.analyse(slow._replace(settings=QUICK._replace(timeout_s=2.0)), GENERIC)
    assert (outcome.failure, "2 s" in outcome.reason) == (Failure.TIMEOUT, True)
    assert files(scratch) == []
    server.stop()
    server.start()
    assert child.analyse(of(f"{server.url}b.log"), GENERIC).status is Status.OK


@pytest.mark.slow("a diagnosis")
def test_logs_that_are_diagnosed_together_are_fetched_one_by_one(
    server: Web, folder: Path, scratch: Path, child: Child
) -> None:
    """The rows are those of the files; one that is missing is named."""
    there, here = server.url, f"{folder}/"
    for names in (("a.log", "b.log"), ("a.log", "none.log")):
        found, local = (
            child.analyse(of("key")._replace(together=tuple(of(where + name) for name in names)), GENERIC)
            for where in (there, here)
        )
        assert numbers(found._replace(reason="")).replace(there, here) == numbers(local._replace(reason=""))
        assert (found.status is Status.OK) == ("none.log" not in names)
        assert ("none.log" in found.reason) == ("none.log" in names)
        assert files(scratch) == []
