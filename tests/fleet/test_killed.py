"""A run that is killed at any point loses nothing that was stored, stores nothing twice, and goes on."""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any, Self

import pytest

from tests.fleet import short_logs
from tests.fleet.short_logs import QUICK, REPO, fleet_here, table

TABLES = ("logs", "drives", "windows", "events", "findings", "power")
# what differs between two runs of the same logs
OF_A_RUN = "analysed_utc, attempts"


def logs(folder: Path) -> Path:
    """Thirteen logs: some bad, some damaged, two with the same bytes."""
    for number in range(13):
        path = folder / f"driver {number % 2}/{number:02d}.log"
        path.parent.mkdir(parents=True, exist_ok=True)
        kind = b"bad %d" if number % 5 == 4 else b"%d!" if number % 5 == 3 else b"%d"
        path.write_bytes(kind % (number if number != 11 else 10) + b"")
    return folder


def rows(folder: Path) -> dict[str, list[tuple[Any, ...]]]:
    """All rows of all tables, sorted, as text."""
    found = {}
    for name in TABLES:
        columns = f"* EXCLUDE ({OF_A_RUN})" if name == "logs" else "*"
        found[name] = sorted(table(folder, name, columns), key=repr)
    return found


class Forks:
    """The program `killed_runs`."""

    def __init__(self, logs: Path, folder: Path) -> None:
        self.folder = folder
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.fleet.killed_runs", str(logs), str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=REPO,
            env=short_logs.environment(),
        )
        assert self._line() == "ready"

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def run(self, after: int = 0) -> str:
        """One run that is killed before a call."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{after}\n")
        self._process.stdin.flush()
        ended = self._line()
        assert ended in ("done", "killed")
        return ended

    def noted(self, name: str) -> list[str]:
        """Logs of all runs so far."""
        path = Path(f"{self.folder}.{name}")
        return path.read_text().splitlines() if path.exists() else []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        with self._process:
            pass


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_kill_before_any_call_that_changes_files(tmp_path: Path, seed: int) -> None:
    """Killed before write, sync, rename or delete number n, for n drawn anew until a run comes through: the tables are
    those of an undisturbed run, no stored log is analysed again, and one more run analyses none.
    """
    source = logs(tmp_path / "logs")
    with Forks(source, tmp_path / "calm") as calm:
        assert calm.run() == "done"
    expected = rows(tmp_path / "calm")
    assert [len(expected[name]) for name in TABLES] == [13, 13, 50, 10, 20, 10]
    rng = random.Random(seed)
    for attempt in range(2):
        with Forks(source, tmp_path / f"killed {attempt}") as forks:
            kills = 0
            # at first within the first part, later anywhere: a run has some 220 calls
            while forks.run(rng.randrange(1, 30 if kills < 8 else 230)) != "done":
                kills += 1
                stored, submitted = forks.noted("stored"), forks.noted("submitted")
                assert max(Counter(stored).values(), default=0) <= 1
                # each kill costs the one outcome that was not stored yet
                assert len(submitted) - len(stored) <= kills
            assert kills >= 5
            assert rows(forks.folder) == expected
            before = len(forks.noted("submitted"))
            assert forks.run() == "done"
            assert len(forks.noted("submitted")) == before
            assert not list((forks.folder / "segments").iterdir())
            assert [path.name for path in forks.folder.rglob("*.new")] == []


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_every_call_may_be_the_last_one(tmp_path: Path, seed: int) -> None:
    """A run that is killed once, and one more: for every seventh call of a run, begun at a drawn one."""
    source = logs(tmp_path / "logs")
    for path in sorted(source.rglob("*.log"))[5:]:
        path.unlink()
    with Forks(source, tmp_path / "calm") as calm:
        assert calm.run() == "done"
    expected = rows(tmp_path / "calm")
    after = seed % 7
    with Forks(source, tmp_path / "out") as forks:
        while True:
            after += 7
            if forks.run(after) == "done":
                break
            assert forks.run() == "done"
            assert rows(forks.folder) == expected, after
            assert max(Counter(forks.noted("stored")).values()) == 1, after
            for path in sorted(forks.folder.rglob("*"), reverse=True):
                path.rmdir() if path.is_dir() else path.unlink()
            forks.folder.rmdir()
            for name in ("stored", "submitted"):
                Path(f"{forks.folder}.{name}").unlink()
    assert after > 50


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_second_run_with_more_logs_may_be_killed_anywhere(tmp_path: Path, seed: int) -> None:
    """Tables that an earlier run has left, and a plan with other logs: after a kill and one more run they are those of
    the new plan, for a kill before every thirteenth call, begun at a drawn one.
    """
    source = logs(tmp_path / "logs")
    files = sorted(source.rglob("*.log"))
    later = {path: path.read_bytes() for path in files[4:8]}
    for path in files[4:]:
        path.unlink()
    with Forks(source, tmp_path / "first") as forks:
        assert forks.run() == "done"
    files[0].unlink()
    for path, content in later.items():
        path.write_bytes(content)
    with Forks(source, tmp_path / "calm") as forks:
        assert forks.run() == "done"
    expected = rows(tmp_path / "calm")
    after = seed % 13
    with Forks(source, tmp_path / "out") as forks:
        while True:
            shutil.copytree(tmp_path / "first", forks.folder)
            after += 13
            if forks.run(after) == "done":
                break
            assert forks.run() == "done"
            assert rows(forks.folder) == expected, after
            shutil.rmtree(forks.folder)
    assert after > 50


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_the_real_command_killed_at_random_times(tmp_path: Path, seed: int) -> None:
    """`canid fleet` with its real workers, ended by kill -9 twice: the tables are those of an undisturbed run, and
    one more run has nothing to do.
    """
    source = tmp_path / "logs"
    short_logs.write(source, 24)
    assert fleet_here(source, "-o", tmp_path / "calm", *QUICK).returncode == 0
    rng = random.Random(seed)
    killed = 0
    for _ in range(2):
        running = subprocess.Popen(
            short_logs.command(source, "-o", tmp_path / "out", *QUICK, "--workers", 2),
            cwd=REPO,
            env=short_logs.environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        segments = tmp_path / "out/segments"
        begun = sum(path.stat().st_size for path in segments.glob("*")) if segments.exists() else 0
        deadline = time.monotonic() + short_logs.PATIENCE_S
        # once something was stored: a kill before that shows nothing
        while running.poll() is None and time.monotonic() < deadline:
            if segments.exists() and sum(path.stat().st_size for path in segments.glob("*")) > begun:
                break
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.3))
        running.send_signal(signal.SIGKILL)
        killed += running.wait() == -signal.SIGKILL
    assert killed >= 1
    done = fleet_here(source, "-o", tmp_path / "out", *QUICK)
    assert done.returncode == 0, done.stderr
    assert "24 ok" in done.stdout
    numbers = "log, driver, status, headway_error_K, duration, identify_json"
    assert table(tmp_path / "out", "drives", numbers) == table(tmp_path / "calm", "drives", numbers)
    assert table(tmp_path / "out", "drives", "count(DISTINCT key), count(*)") == [(24, 24)]
    again = fleet_here(source, "-o", tmp_path / "out", *QUICK)
    assert "0 analysed now" in again.stdout
