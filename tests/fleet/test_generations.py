"""An answer about a fleet is that of one whole generation of its tables, whatever runs, queries and reports do meanwhile."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from canid.analysis.fleet.answers.summary import current, summarise
from canid.analysis.fleet.storage import generations, store, summary_tables
from canid.analysis.fleet.storage.database import database, rows
from canid.analysis.fleet.storage.lock import LockError
from canid.mathematics.population import hierarchical, weighted_drives
from canid.values.errors import DamagedLogError
from tests.fixtures import fleet_interleavings, stored_fleet
from tests.fleet.short_logs import REPO, fleet_here

COUNTS = "SELECT (SELECT count(*) FROM logs) AS logs, (SELECT count(key) FROM drives) AS drives"


class Stored(NamedTuple):
    """A folder with stored outcomes and no tables yet, and the rows of its logs."""

    folder: Path
    logs: list[dict[str, Any]]


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Stored:
    folder = tmp_path_factory.mktemp("stored") / "fleet"
    return Stored(folder, stored_fleet.made(folder, drivers=2, drives=2))


@pytest.fixture
def fleet(stored: Stored, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stored:
    """A folder of its own, with the tables of two logs."""
    monkeypatch.setattr(hierarchical, "STEPS", stored_fleet.STEPS)
    for name in ("DRAWS", "FEWEST_DRAWS", "FIXED_EFFECTS_STEPS"):
        monkeypatch.setattr(weighted_drives, name, stored_fleet.STEPS)
    folder = tmp_path / "fleet"
    shutil.copytree(stored.folder, folder)
    stored_fleet.run(folder, stored.logs[:2], pooled=False)
    return Stored(folder, stored.logs)


def counts(db: Any) -> tuple[int, int]:
    (row,) = rows(db, COUNTS)
    return row["logs"], row["drives"]


def pooled(folder: Path) -> dict[str, int]:
    """Drives of each driver, as `canid fleet query` says them."""
    done = fleet_here("query", folder, "SELECT driver, drives FROM drivers", "--format", "json")
    assert done.returncode == 0, done.stderr
    return {row["driver"]: row["drives"] for row in json.loads(done.stdout)}


@contextmanager
def another_run(folder: Path) -> Iterator[None]:
    """Another process that holds the folder's lock."""
    code = (
        "import sys, time\nfrom pathlib import Path\nfrom canid.analysis.fleet.storage.lock import held\n"
        "with held(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(1000)"
    )
    with subprocess.Popen([sys.executable, "-c", code, folder], stdout=subprocess.PIPE, cwd=REPO) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == b"held\n"
            yield
        finally:
            process.kill()


@pytest.mark.long("runs of a fleet in processes of their own")
def test_a_report_that_began_before_a_run_leaves_no_older_summary(fleet: Stored) -> None:
    """Read, then a run with more logs, then written: the summary of the old drives is not kept, and not counted as the
    new one's; the next answer is that of the new drives.
    """
    with database(fleet.folder) as of:
        before = counts(of.db)
        stored_fleet.run(fleet.folder, fleet.logs, pooled=False)
        # the tables that are open are still those of the two logs
        assert counts(of.db) == before == (2, 2)
        assert of.replaced()
        made: dict[str, Any] = {"drivers": [{"driver": "driver 000", "drives": 1}], "population": []}
        assert not summary_tables.kept(fleet.folder, of.opened.generation, made)
    assert not current(fleet.folder)
    assert not (fleet.folder / "drivers.parquet").exists()
    # even where an older canid has written one, with any time
    summary_tables.written(fleet.folder, made, of.opened.generation)
    os.utime(fleet.folder / "drivers.parquet", (4e9, 4e9))
    assert not current(fleet.folder)
    assert pooled(fleet.folder) == {"driver 000": 2, "driver 001": 2}
    assert current(fleet.folder)


def test_while_a_run_works_answers_are_right_and_nothing_is_written(fleet: Stored) -> None:
    """Another process has the lock: the drivers are those of the drives, and no file of the folder changes."""
    with another_run(fleet.folder):
        before = {path: path.read_bytes() for path in fleet.folder.rglob("*.*") if path.is_file()}
        assert pooled(fleet.folder) == {"driver 000": 1, "driver 001": 1}
        assert {path: path.read_bytes() for path in fleet.folder.rglob("*.*") if path.is_file()} == before
    assert not current(fleet.folder)


def test_a_summary_within_a_run_leaves_the_run_its_lock(fleet: Stored) -> None:
    """A process that closed a second descriptor of its lock would have none: another run could begin."""
    code = (
        "import sys\nfrom pathlib import Path\nfrom canid.analysis.fleet.storage import lock\n"
        "try:\n    with lock.held(Path(sys.argv[1])):\n        print('free')\nexcept lock.LockError:\n    print('held')"
    )

    def other() -> str:
        words = [sys.executable, "-c", code, str(fleet.folder)]
        return subprocess.run(words, capture_output=True, text=True, cwd=REPO, check=True).stdout.strip()

    with store.opened(fleet.folder) as of:
        assert summary_tables.kept(fleet.folder, generations.current(fleet.folder), {"drivers": []})
        of.check()
        assert other() == "held"
    assert other() == "free"


def test_a_page_carries_the_hash_of_what_it_was_made_from(fleet: Stored) -> None:
    """Of the tables that were read, not of those that a run has written since."""
    read = sha256((fleet.folder / "logs.parquet").read_bytes()).hexdigest()
    with database(fleet.folder) as of:
        stored_fleet.run(fleet.folder, fleet.logs, pooled=False)
        assert of.opened.files["logs"].sha256() == read
    assert sha256((fleet.folder / "logs.parquet").read_bytes()).hexdigest() != read
    summary = summarise(fleet.folder)
    assert summary.logs_sha256 == sha256((fleet.folder / "logs.parquet").read_bytes()).hexdigest()


FURTHER = pytest.mark.slow("further places of a kill")


# names that a run gives: that of the folder of its tables, by which they count, and then those of six tables
@pytest.mark.long("runs of a fleet in processes of their own")
@pytest.mark.parametrize("at", [1, 4, *(pytest.param(at, marks=FURTHER) for at in (2, 3, 5, 6, 7))])
def test_tables_are_whole_after_a_kill_between_two_of_them(fleet: Stored, at: int) -> None:
    """A run that is killed before it gives a table its name: a reader has the old tables all or the new ones all, and the
    next run, of whatever logs, leaves nothing of it.
    """
    out = fleet.folder.with_name("killed")
    assert (
        fleet_interleavings.server().done("run", fleet.folder, out, logs=fleet.logs, kill_at=at)
        == -signal.SIGKILL
    )
    with database(fleet.folder) as of:
        assert counts(of.db) == ((2, 2) if at == 1 else (4, 4))
    stored_fleet.run(fleet.folder, fleet.logs[:3], pooled=False)
    with database(fleet.folder) as of:
        assert counts(of.db) == (3, 3)
    assert [
        path for path in fleet.folder.iterdir() if path.suffix == ".new" or path.name == generations.PENDING
    ] == []


def test_tables_of_several_generations_are_one_line(
    fleet: Stored, stored: Stored, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As somebody leaves them who copies a single table from another folder: an error that says what to do, and a run
    of the same logs mends it.
    """
    other = tmp_path / "other"
    shutil.copytree(stored.folder, other)
    stored_fleet.run(other, stored.logs, pooled=False)
    shutil.copy(other / "drives.parquet", fleet.folder)
    monkeypatch.setattr(generations, "_PATIENCE_S", 0.0)
    with pytest.raises(DamagedLogError, match=r"several runs.*run `canid fleet`"), database(fleet.folder):
        pass
    stored_fleet.run(fleet.folder, fleet.logs[:2], pooled=False)
    with database(fleet.folder) as of:
        assert counts(of.db) == (2, 2)


def test_two_processes_have_no_temporary_name_in_common(fleet: Stored) -> None:
    """A run that begins deletes what killed runs have left, and nothing that a reader is at: readers write nothing there."""
    with database(fleet.folder) as of:
        before = sorted(path.name for path in fleet.folder.rglob("*"))
        rows(of.db, "SELECT count(*) FROM drives ORDER BY ALL")
        assert sorted(path.name for path in fleet.folder.rglob("*")) == before
        with another_run(fleet.folder), pytest.raises(LockError), store.opened(fleet.folder):
            pass


@pytest.mark.slow("ten interleavings of processes")
def test_drawn_interleavings(tmp_path: Path, seed: int) -> None:
    """Runs, queries and reports at once, some killed: as `python -m benchmarks reliability attack` draws a thousand."""
    rng = random.Random(seed)
    for k in range(10):
        (tmp_path / str(k)).mkdir()
        assert fleet_interleavings.interleaved(tmp_path / str(k), rng).wrong == [], (seed, k)
