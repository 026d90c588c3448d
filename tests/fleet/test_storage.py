"""Logs in a bucket and on a web server have the results of a local folder, whatever the storage does meanwhile."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("s3fs", reason="needs s3fs: pip install 'canid[s3]'")
pytest.importorskip("moto", reason="needs moto: pip install 'canid[dev]'")

from canid.analysis.fleet.running import storage_wait
from tests.fleet import short_logs
from tests.fleet.short_logs import QUICK, fleet, fleet_here, table
from tests.fleet.storage_servers import BUCKET, LOGS, S3, Web, numbers, s3, web

pytestmark = pytest.mark.slow("runs of a fleet in processes of their own, against real servers")
URL = f"s3://{BUCKET}/fleet"


@pytest.fixture(scope="module")
def bucket(logs: Path) -> Iterator[S3]:
    with s3() as made:
        made.put(logs, "fleet")
        yield made


@pytest.fixture
def here(bucket: S3, monkeypatch: pytest.MonkeyPatch) -> S3:
    """The bucket, as commands of this process and their children find it."""
    bucket.is_known_here(monkeypatch)
    return bucket


@pytest.fixture
def server(logs: Path) -> Iterator[Web]:
    with web(logs) as made:
        yield made


def started(*words: object, environment: dict[str, str] | None = None) -> subprocess.Popen[str]:
    return subprocess.Popen(
        short_logs.command(*words),
        cwd=short_logs.REPO,
        env={**short_logs.environment(), **(environment or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def stored(folder: Path, number: int) -> None:
    """Wait until so many outcomes are stored."""
    deadline = time.monotonic() + short_logs.PATIENCE_S
    while sum(path.read_bytes().count(b'["outcomes"') for path in folder.glob("segments/*")) < number:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def line_with(words: str, of: subprocess.Popen[str]) -> str:
    """The next line on standard error that has these words."""
    assert of.stderr is not None
    return next(line for line in of.stderr if words in line)


@pytest.mark.parametrize("words", [URL, f"{URL}/**/*.log"])
def test_a_bucket_gives_what_the_folder_gives(
    here: S3, words: str, expected: list[tuple[Any, ...]], tmp_path: Path
) -> None:
    """A folder and a pattern; the second run analyses nothing."""
    first = fleet_here(words, "-o", tmp_path / "out", *QUICK)
    assert first.returncode == 0, first
    assert numbers(tmp_path / "out") == expected
    again = fleet_here(words, "-o", tmp_path / "out", *QUICK)
    assert (again.returncode, "0 analysed now" in again.stdout) == (0, True)


def test_a_web_server_gives_what_the_folder_gives(
    server: Web, expected: list[tuple[Any, ...]], tmp_path: Path
) -> None:
    """Python's own: a folder and a pattern; a driver's name with a space is that of the folder, not of the URL."""
    for words in (server.url, f"{server.url}**/*.log"):
        done = fleet(words, "-o", tmp_path / "out", *QUICK)
        assert done.returncode == 0, done
        assert numbers(tmp_path / "out") == expected
    assert "0 analysed now" in done.stdout


def test_what_is_wrong_with_a_bucket_is_one_line(bucket: S3, tmp_path: Path) -> None:
    """A bucket that is not there, no credentials, wrong ones aside, which moto takes, and nothing that listens."""
    environment = bucket.environment()
    cases = (
        ("s3://no-such-bucket/fleet", environment, "bucket does not exist"),
        (URL, {k: v for k, v in environment.items() if "KEY" not in k}, "credentials"),
        (f"s3://{BUCKET}/nothing here", environment, "cannot be listed"),
    )
    for words, env, says in cases:
        of = started(words, "-o", tmp_path / "out", *QUICK, environment=env)
        out, errors = of.communicate(timeout=short_logs.PATIENCE_S)
        assert (of.returncode, out) == (2, "")
        assert len(errors.splitlines()) == 1, errors
        assert says in errors


def test_an_endpoint_that_dies_half_way_is_waited_for(
    bucket: S3, expected: list[tuple[Any, ...]], tmp_path: Path
) -> None:
    """The run pauses and says so; once the endpoint is back it goes on, and no log has failed."""
    of = started(URL, "-o", tmp_path / "out", *QUICK, "--workers", 1, environment=bucket.environment())
    try:
        stored(tmp_path / "out", 2)
        bucket.stop()
        waits = line_with("does not answer", of)
        assert f"s3://{BUCKET} does not answer" in waits
        assert "logs wait for it" in waits
    finally:
        bucket.start()
    out, errors = of.communicate(timeout=short_logs.PATIENCE_S)
    assert (of.returncode, f"{LOGS} ok" in out) == (0, True), (out, errors)
    assert "answers again" in errors
    assert "Traceback" not in errors
    assert numbers(tmp_path / "out") == expected


def test_a_storage_that_stays_away_costs_no_log(
    server: Web, expected: list[tuple[Any, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its logs are `not_reached`, exit code 4; the same command analyses those, and only those."""
    monkeypatch.setattr(storage_wait, "PATIENCE_S", 1.0)
    given = storage_wait._answering

    def answering(*words: Any) -> Iterator[Any]:
        for number, job in enumerate(given(*words)):
            if number == 3:
                server.stop()
            yield job

    with monkeypatch.context() as patch:
        patch.setattr(storage_wait, "_answering", answering)
        done = fleet_here(server.url, "-o", tmp_path / "out", *QUICK, "--workers", 1)
    assert done.returncode == 4
    assert "the same command tries them again" in done.stderr
    reached = table(tmp_path / "out", "logs", "count(*)", "WHERE status = 'ok'")[0][0]
    rows = table(tmp_path / "out", "logs", "failure, reason", "WHERE status = 'failed'")
    assert len(rows) == LOGS - reached
    assert {failure for failure, _ in rows} == {"not_reached"}
    assert f"({len(rows)} not_reached)" in done.stdout
    server.start()
    again = fleet_here(server.url, "-o", tmp_path / "out", *QUICK)
    assert (again.returncode, f"{len(rows)} analysed now" in again.stdout) == (0, True)
    assert numbers(tmp_path / "out") == expected


def test_a_slow_server_takes_its_time(server: Web, expected: list[tuple[Any, ...]], tmp_path: Path) -> None:
    """Slow is no failure."""
    server.stop()
    server.start(pause_s=0.1)
    done = fleet_here(server.url, "-o", tmp_path / "out", *QUICK)
    assert done.returncode == 0, done
    assert numbers(tmp_path / "out") == expected


def test_an_object_that_is_written_anew_is_analysed_anew(here: S3, logs: Path, tmp_path: Path) -> None:
    """In a bucket of its own prefix: one log of four has other bytes; the others keep their results."""
    source = tmp_path / "source"
    short_logs.write(source, 4, 8.0)
    here.put(source, "changing")
    words = (f"s3://{BUCKET}/changing", "-o", tmp_path / "out", *QUICK)
    assert fleet_here(*words).returncode == 0
    before = set(table(tmp_path / "out", "logs", "log, key"))
    (changed,) = sorted(source.rglob("*001.log"))
    changed.write_bytes(short_logs.log(99, 8.0))
    for path in source.rglob("*.log"):
        if path != changed:
            path.unlink()
    time.sleep(1.1)  # S3 states whole seconds
    here.put(source, "changing")
    again = fleet_here(*words)
    assert "1 analysed now" in again.stdout
    after = set(table(tmp_path / "out", "logs", "log, key"))
    assert len(before & after) == 3
