"""`canid fleet` as users run it: again, after changes, with copies, twice at once, interrupted, on a full disk."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from canid.analysis.fleet.storage import store
from canid.values.errors import ConfigError, OutputError
from tests.fleet import short_logs
from tests.fleet.short_logs import QUICK, REPO, Done, fleet_here, table

PATIENCE_S = short_logs.PATIENCE_S


def analysed(done: Done) -> int:
    """How many logs a run analysed, by what it says."""
    line = next(line for line in done.stdout.splitlines() if "analysed now" in line)
    return int(line.rpartition("; ")[2].split()[0])


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_second_run_does_nothing_and_only_what_changed_is_analysed(tmp_path: Path) -> None:
    """Nothing is analysed twice: not by a second run, not after a move or a touched time; one changed byte is; and drivers
    follow the plan of the last run.
    """
    logs, out = tmp_path / "logs", tmp_path / "out"
    files = short_logs.write(logs, 6)
    (logs / "driver 0/copy.log").write_bytes(files[1].read_bytes())
    first = fleet_here(logs, "-o", out, *QUICK)
    assert (first.returncode, analysed(first)) == (0, 6), first.stderr
    copy = table(out, "logs", "log, key", "WHERE duplicate_of IS NOT NULL")
    assert [Path(log).name for log, _ in copy] == ["drive 001.log"]  # the copy comes first by its path
    assert table(out, "drives", "count(*), count(key), count(DISTINCT key), count(duration)") == [
        (7, 6, 6, 6)
    ]
    before = table(out, "drives", "log, key, sha256, duration", "WHERE duplicate_of IS NULL ORDER BY key")

    times = {path.name: path.stat().st_mtime_ns for path in out.glob("*.parquet")}
    assert analysed(fleet_here(logs, "-o", out, *QUICK)) == 0
    assert {path.name: path.stat().st_mtime_ns for path in out.glob("*.parquet")} == times
    (out / "windows.parquet").unlink()
    assert analysed(fleet_here(logs, "-o", out, *QUICK)) == 0
    assert table(out, "windows", "count(*)") == [(0,)]

    shutil.move(files[0], logs / "moved.log")
    os.utime(files[2])
    (logs / "driver 0/copy.log").unlink()
    files[3].write_bytes(short_logs.log(77))
    changed = fleet_here(logs, "-o", out, *QUICK, "--json", tmp_path / "out.json")
    assert analysed(changed) == 1
    now = table(out, "drives", "log, key, sha256, duration", "WHERE duplicate_of IS NULL ORDER BY key")
    assert len({row[1:] for row in now} & {row[1:] for row in before}) == 5
    assert table(out, "logs", "driver", "WHERE log LIKE '%moved.log'") == [("moved",)]
    found = json.loads((tmp_path / "out.json").read_text())
    assert found["schema"] == "canid/fleet/1"
    assert found["logs"] == {"planned": 6, "ok": 6, "damaged": 0, "failed": 0, "duplicates": 0, "analysed": 1}

    # other settings are other results, and both stay
    assert analysed(fleet_here(logs, "-o", out, *QUICK[:-1])) == 6
    assert analysed(fleet_here(logs, "-o", out, *QUICK)) == 0
    # a plan of fewer logs has tables of those alone
    assert analysed(fleet_here(files[1], "-o", out, *QUICK)) == 0
    assert table(out, "drives", "count(*)") == table(out, "windows", "1 + count(*)") == [(1,)]


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_failures_are_tried_again_where_that_may_help(tmp_path: Path) -> None:
    """A log that took too long is tried by the next run; an empty one is not, unless --retry-failed asks for it."""
    logs, out = tmp_path / "logs", tmp_path / "out"
    files = short_logs.write(logs, 1)
    first = fleet_here(logs, "-o", out, *QUICK, "--timeout", "0.001s", "--workers", 1)
    assert first.returncode == 4
    assert table(out, "logs", "status, failure") == [("failed", "timeout")]
    assert table(out, "drives", "key, reason") == table(out, "logs", "key, reason")
    (files[0].parent / "empty.log").write_bytes(b"")
    second = fleet_here(logs, "-o", out, *QUICK, "--workers", 1)
    assert second.returncode == 4
    assert table(out, "logs", "status, failure, attempts") == [("ok", "", 2), ("failed", "empty", 1)]
    assert analysed(fleet_here(logs, "-o", out, *QUICK)) == 0
    assert analysed(fleet_here(logs, "-o", out, *QUICK, "--retry-failed")) == 1


def test_two_runs_into_one_folder_refuse(tmp_path: Path) -> None:
    """The second one ends with a line that names the first one's process; after a kill -9 the folder is free."""
    logs, out = tmp_path / "logs", tmp_path / "out"
    short_logs.write(logs, 1)
    out.mkdir()
    holding = (
        "import sys, time\nfrom canid.analysis.fleet.storage.lock import held\nfrom pathlib import Path\n"
        "with held(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(1000)"
    )
    with subprocess.Popen([sys.executable, "-c", holding, out], stdout=subprocess.PIPE, cwd=REPO) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == b"held\n"
        second = fleet_here(logs, "-o", out, *QUICK)
        first.kill()
    assert second.returncode == 5
    (line,) = [line for line in second.stderr.splitlines() if "another run" in line]
    assert f"process {first.pid} on " in line
    with store.opened(out):
        pass


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_tables_of_all_drives_are_made_anew_when_the_drives_are_others(tmp_path: Path) -> None:
    """Drivers and population are those of the drives of the plan; the same drives keep them."""
    logs, out = tmp_path / "logs", tmp_path / "out"
    files = short_logs.write(logs, 3)
    assert fleet_here(logs, "-o", out, *QUICK).returncode == 0
    tables = [out / f"{name}.parquet" for name in ("drivers", "population")]
    for change in (None, "driver", "log"):
        before = [table.stat().st_mtime_ns for table in tables]
        if change == "driver":
            (logs / "driver 1").rename(logs / "driver 9")
        elif change == "log":
            files[0].unlink()
        assert fleet_here(logs, "-o", out, *QUICK).returncode == 0
        kept = [table.stat().st_mtime_ns == earlier for table, earlier in zip(tables, before, strict=True)]
        assert kept == [change is None] * 2, change


@pytest.mark.parametrize("name", ["thesis.tex", "fleet.json", "drives.parquet", "segments/000001.jsonl"])
def test_a_folder_with_other_things_is_left_as_it_is(tmp_path: Path, name: str) -> None:
    """Nothing is written into a folder that holds anything but a fleet's results."""
    path = tmp_path / "out" / name
    path.parent.mkdir(parents=True)
    path.write_text("{}")
    with pytest.raises(OutputError, match="holds other things"), store.opened(tmp_path / "out"):
        pass
    assert [file for file in (tmp_path / "out").rglob("*") if file.is_file()] == [path]
    assert path.read_text() == "{}"


def test_a_name_that_no_table_can_have_is_refused(tmp_path: Path) -> None:
    """A folder's name in bytes that are no text: one line, and nothing is made."""
    with (
        pytest.raises(ConfigError, match="choose another"),
        store.opened(os.fsdecode(bytes(tmp_path) + b"/\xff")),
    ):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_worker_that_outlives_a_killed_run_does_not_hold_the_folder(tmp_path: Path) -> None:
    """The lock belongs to one process: a child that was forked while it was held leaves it free."""
    store_folder = tmp_path / "out"
    code = (
        "import os, sys, time\nfrom pathlib import Path\nfrom canid.analysis.fleet.storage.lock import held\n"
        "with held(Path(sys.argv[1])):\n"
        "    child = os.fork()\n    if child == 0:\n        time.sleep(1000)\n"
        "    print(child, flush=True)\n    time.sleep(1000)"
    )
    store_folder.mkdir()
    with subprocess.Popen(
        [sys.executable, "-c", code, store_folder], stdout=subprocess.PIPE, cwd=REPO
    ) as run:
        assert run.stdout is not None
        child = int(run.stdout.readline())
        try:
            run.kill()
            run.wait()
            with store.opened(store_folder):
                pass
        finally:
            os.kill(child, signal.SIGKILL)


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_keeps_what_was_finished(tmp_path: Path, number: signal.Signals) -> None:
    """Ctrl-C and SIGTERM: exit 130 or 143, the tables hold what was finished, and the next run does the rest only."""
    logs, out = tmp_path / "logs", tmp_path / "out"
    short_logs.write(logs, 60)
    with subprocess.Popen(
        short_logs.command(logs, "-o", out, *QUICK, "--workers", 1),
        cwd=REPO,
        env=short_logs.environment(),
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    ) as running:
        deadline = time.monotonic() + PATIENCE_S
        while not any(path.stat().st_size for path in out.glob("segments/*")) and time.monotonic() < deadline:
            time.sleep(0.01)
        running.send_signal(number)
        _, error = running.communicate(timeout=PATIENCE_S)
    assert running.returncode == 128 + number, error
    assert "the same command goes on" in error
    assert "Traceback" not in error
    counts = dict(table(out, "logs", "coalesce(status, 'open'), count(*)", "GROUP BY 1"))
    assert counts["ok"] + counts["open"] == 60
    assert table(out, "drives", "count(key)") == [(counts["ok"],)]
    rest = fleet_here(logs, "-o", out, *QUICK)
    assert (rest.returncode, analysed(rest)) == (0, counts["open"])
    assert table(out, "drives", "count(DISTINCT key)") == [(60,)]


def stored(out: Path) -> int:
    """How many outcomes a folder holds."""
    journals = sum(path.read_bytes().count(b'\n["outcomes",') for path in out.glob("segments/*"))
    parts = (
        table(path.parent, "outcomes", "count(*)")[0][0] for path in out.glob("parts/*/outcomes.parquet")
    )
    return journals + sum(parts)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_files_that_cannot_grow_stop_the_run_which_then_goes_on(tmp_path: Path) -> None:
    """From some outcome on no file may grow beyond a limit, as with a quota: exit 5 with one line; without it the rest is
    analysed.
    """
    logs, out = tmp_path / "logs", tmp_path / "out"
    short_logs.write(logs, 60)
    with subprocess.Popen(
        short_logs.command(logs, "-o", out, *QUICK, "--workers", 1),
        cwd=REPO,
        # a limit of files must not cut a module's bytecode
        env={**short_logs.environment(), "PYTHONDONTWRITEBYTECODE": "1"},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    ) as running:
        deadline = time.monotonic() + PATIENCE_S
        while not (size := sum(path.stat().st_size for path in out.glob("segments/*"))):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        resource.prlimit(running.pid, resource.RLIMIT_FSIZE, (size + 20_000, resource.RLIM_INFINITY))
        _, error = running.communicate(timeout=PATIENCE_S)
    assert running.returncode == 5, error
    (line,) = [line for line in error.splitlines() if "written" in line]
    assert "the same command goes on" in line
    before = stored(out)
    assert 0 < before < 60
    done = fleet_here(logs, "-o", out, *QUICK)
    assert (done.returncode, analysed(done)) == (0, 60 - before)
    assert table(out, "drives", "count(DISTINCT key), count(*)") == [(60, 60)]


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("kilobytes", [100, 250])
def test_a_full_disk_stops_the_run_which_then_goes_on(tmp_path: Path, kilobytes: int) -> None:
    """A real disk that fills in the journal, in a part or in the tables: exit 5 with one line; with room all is there."""
    logs, disk = tmp_path / "logs", tmp_path / "disk"
    short_logs.write(logs, 20)
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(disk)]
    if not shutil.which("mount") or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("a disk of a few kB can be mounted by root only")
    try:
        stopped = fleet_here(logs, "-o", disk / "out", *QUICK)
        assert stopped.returncode == 5, stopped.stderr
        (line,) = [line for line in stopped.stderr.splitlines() if "written" in line]
        assert "the same command goes on" in line
        before = stored(disk / "out")
        subprocess.run(["mount", "-o", "remount,size=20M", str(disk)], check=True)
        done = fleet_here(logs, "-o", disk / "out", *QUICK)
        assert (done.returncode, analysed(done)) == (0, 20 - before)
        assert table(disk / "out", "drives", "count(DISTINCT key), count(*)") == [(20, 20)]
        assert [path for path in (disk / "out").rglob("*") if path.suffix in (".new", ".tmp")] == []
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_words_that_are_no_logs_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A slip in a sub-verb, in a path, and no vehicle: exit 2 and what was meant."""
    monkeypatch.chdir(tmp_path)
    for words, says in (
        (("qurey", "out"), 'did you mean "canid fleet query"'),
        (("nothing", "-o", "out"), "nothing is no file"),
        ((REPO / "replay_logs", "-o", "out"), "--vehicle"),
        ((REPO / "replay_logs", "-o", "out", "--vehicle", "generic", "--json", "a.blf"), "a.blf"),
        ((REPO / "replay_logs", "-o", "out", "--vehicle", "generic", "--report", "a.txt"), "not an .html"),
        ((REPO / "replay_logs", "-o", "out", "--workers", "0"), "number of processes"),
    ):
        done = fleet_here(*words)
        assert done.returncode == 2, (words, done.stderr)
        assert done.stderr.count("\n") == 1
        assert says in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_lock_of_a_process_is_one_that_fcntl_shows(tmp_path: Path) -> None:
    """While a folder is open, no other process can lock its file; afterwards any can."""
    code = "import fcntl, sys\nfcntl.lockf(open(sys.argv[1], 'r+'), fcntl.LOCK_EX | fcntl.LOCK_NB)"
    lock = tmp_path / "out/fleet.lock"

    def free() -> bool:
        return subprocess.run([sys.executable, "-c", code, lock], capture_output=True).returncode == 0

    with store.opened(tmp_path / "out"):
        assert not free()
    assert free()
