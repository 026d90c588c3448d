"""A folder of results in a bucket holds what a local one holds, whatever ends the run, whichever machine goes on."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("s3fs", reason="needs s3fs: pip install 'canid[s3]'")
pytest.importorskip("moto", reason="needs moto: pip install 'canid[dev]'")

from canid.analysis.fleet.storage import mirror, parts, store
from tests.fleet import short_logs
from tests.fleet.short_logs import QUICK, Done, fleet_here, table
from tests.fleet.storage_servers import BUCKET, LOGS, S3, numbers, s3

pytestmark = pytest.mark.slow("runs of a fleet in processes of their own, against a real server")


@pytest.fixture(scope="module")
def bucket() -> Iterator[S3]:
    with s3() as made:
        yield made


@pytest.fixture
def url(bucket: S3, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A place in the bucket, on a machine that has never seen it."""
    bucket.is_known_here(monkeypatch)
    on_machine(monkeypatch, tmp_path / "first")
    return f"s3://{BUCKET}/" + re.sub(r"\W", "-", request.node.name)


def on_machine(monkeypatch: pytest.MonkeyPatch, caches: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(caches))


def fetched(url: str, into: Path) -> Path:
    """What the bucket holds, by another program than canid."""
    import fsspec

    system, path = fsspec.core.url_to_fs(url)
    system.invalidate_cache()
    system.get(path, str(into), recursive=True)
    return into


def run(logs: Path, url: str, *words: object) -> Done:
    return fleet_here(logs, "-o", url, *QUICK, *words)


def test_a_bucket_holds_what_a_local_folder_holds(
    url: str, logs: Path, expected: list[tuple[Any, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second run analyses nothing, on another machine either; a question is answered from the bucket."""
    first = run(logs, url)
    assert first.returncode == 0, first
    held = fetched(url, tmp_path / "held")
    assert numbers(held) == expected
    # the journal and the lock stay on the machine
    assert sorted(path.name for path in held.iterdir() if path.suffix != ".parquet") == [
        "fleet.json",
        "parts",
    ]
    for machine in ("first", "second"):
        on_machine(monkeypatch, tmp_path / machine)
        again = run(logs, url)
        assert (again.returncode, "0 analysed now" in again.stdout) == (0, True), again
    on_machine(monkeypatch, tmp_path / "third")
    asked = fleet_here("query", url, "SELECT count(*) AS n FROM drives", "--format", "csv")
    assert (asked.returncode, asked.stdout.split()) == (0, ["n", str(LOGS)]), asked


@pytest.mark.parametrize("machine", ["first", "second"])
def test_a_killed_run_goes_on(
    url: str,
    logs: Path,
    expected: list[tuple[Any, ...]],
    machine: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On the same machine by its journal, on another one from the parts that are in the bucket; the bucket is the same."""
    monkeypatch.setattr(store, "SEGMENT_OUTCOMES", 2)
    given = mirror._Mirror._send_part
    sent: list[str] = []

    def send(self: Any, part: Path) -> None:
        if len(sent) == 2:  # in the middle of the third part
            last = part / "outcomes.parquet"
            hidden = last.with_name("hidden")
            last.rename(hidden)
            try:
                given(self, part)
            finally:
                hidden.rename(last)
            raise KeyboardInterrupt
        given(self, part)
        sent.append(part.name)

    with monkeypatch.context() as patch:
        patch.setattr(mirror._Mirror, "_send_part", send)
        patch.setattr(mirror._Mirror, "push", _until_interrupted(mirror._Mirror.push))
        assert run(logs, url, "--workers", 1).returncode != 0
    on_machine(monkeypatch, tmp_path / machine)
    again = run(logs, url)
    assert again.returncode == 0, again
    analysed = int(again.stdout.partition(" analysed now")[0].rpartition(" ")[2])
    assert analysed <= (LOGS - 6 if machine == "first" else LOGS - 4)
    held = fetched(url, tmp_path / "held")
    assert numbers(held) == expected
    assert sorted(table(held, "logs", "key")) == sorted(table(held / "parts/*", "outcomes", "DISTINCT key"))


def _until_interrupted(push: Any) -> Any:
    """A machine that is gone uploads nothing more."""
    gone: list[bool] = []

    def pushed(self: Any) -> None:
        if not gone:
            try:
                push(self)
            except KeyboardInterrupt:
                gone.append(True)
                raise

    return pushed


def test_a_process_that_is_killed_costs_nothing(
    url: str, logs: Path, expected: list[tuple[Any, ...]], tmp_path: Path
) -> None:
    """By SIGKILL, after the journal has an outcome; the same command goes on."""
    running = subprocess.Popen(
        short_logs.command(logs, "-o", url, *QUICK, "--workers", 1),
        cwd=short_logs.REPO,
        env=short_logs.environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    folder, deadline = mirror.copy_of(url), time.monotonic() + short_logs.PATIENCE_S
    while not any(b'["outcomes"' in path.read_bytes() for path in folder.glob("segments/*")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    running.send_signal(signal.SIGKILL)
    running.communicate()
    again = run(logs, url)
    assert again.returncode == 0, again
    assert f" {LOGS} analysed now" not in again.stdout
    assert numbers(fetched(url, tmp_path / "held")) == expected


def test_merged_parts_take_the_place_of_the_others(
    url: str, logs: Path, expected: list[tuple[Any, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "SEGMENT_OUTCOMES", 1)
    monkeypatch.setattr(parts, "MAX_PARTS", 3)
    assert run(logs, url).returncode == 0
    held = fetched(url, tmp_path / "held")
    assert numbers(held) == expected
    names = sorted(path.name for path in (held / "parts").iterdir())
    assert len(names) <= 4
    assert names == sorted(path.name for path in (mirror.copy_of(url) / "parts").iterdir())


def test_two_machines_at_once_are_said(
    url: str, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second one to write a part of the same number stops, and overwrites nothing."""
    given = mirror._Mirror.pull
    on_other = tmp_path / "other"
    short_logs.write(on_other, 2, 9.0)

    def pull(self: Any) -> None:
        given(self)
        monkeypatch.setattr(mirror._Mirror, "pull", given)
        on_machine(monkeypatch, tmp_path / "second")
        assert run(on_other, url).returncode == 0

    monkeypatch.setattr(mirror._Mirror, "pull", pull)
    done = run(logs, url)
    assert done.returncode != 0
    assert "another run has written part 000001" in done.stderr
    assert "Traceback" not in done.stderr
    assert len(numbers(fetched(url, tmp_path / "held"))) == 2


def test_other_things_are_left_alone(url: str, bucket: S3, logs: Path, tmp_path: Path) -> None:
    """A place with other files is refused; results below the logs' own place are no logs."""
    bucket.put(logs, url.rpartition("/")[2])
    refused = run(logs, url)
    assert refused.returncode != 0
    assert "holds other things" in refused.stderr
    for analysed in (LOGS, 0):
        done = fleet_here(url, "-o", f"{url}/results", *QUICK)
        assert (done.returncode, f"{LOGS} logs: {LOGS} ok; {analysed} analysed now" in done.stdout) == (
            0,
            True,
        ), done
