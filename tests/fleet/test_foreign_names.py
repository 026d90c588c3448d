"""What others put into a fleet's folder is neither written to nor deletes results: links, strays, a removed lock."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from canid.analysis.fleet.job import Settings
from canid.analysis.fleet.planning.plan import planned
from canid.analysis.fleet.running import run as fleet_run
from canid.analysis.fleet.storage import parts, store, summary_tables
from canid.analysis.fleet.storage.lock import LockError
from canid.values.errors import OutputError
from tests.fleet import killed_runs, short_logs
from tests.fleet.short_logs import QUICK, REPO, TABLES, fleet_here
from tests.fleet.test_killed import logs, rows

CONTENT = b"LOGG a recording of a drive that nobody can drive again\n" * 100
# all fixed names of a folder, those of earlier versions too
NAMES = (
    *("fleet.lock", "fleet.json", ".fleet.json.new", "parts", "segments", ".tables.complete"),
    *(f"{name}.parquet" for name in TABLES),
    *(f".{name}.{kind}.new" for name in TABLES for kind in ("parquet", "jsonl")),
    *(f"segments/{k:06d}.jsonl" for k in range(1, 8)),
    *(f"parts/{k:06d}" for k in range(1, 8)),
    *(f"parts/.{k:06d}.new" for k in range(1, 8)),
    *("parts/000001-000003", "parts/.000001-000003.new", ".duckdb.tmp", "parts/.duckdb.tmp"),
)


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Thirteen logs; a run of them makes several parts, some of which are merged."""
    monkeypatch.setattr(store, "SEGMENT_OUTCOMES", killed_runs.OUTCOMES_OF_A_PART)
    monkeypatch.setattr(parts, "MAX_PARTS", killed_runs.MAX_PARTS)
    return logs(tmp_path / "logs")


def run(source: Path, folder: Path) -> tuple[str, ...]:
    """One run; what it says of the folder."""
    with store.opened(folder) as opened:
        fleet_run.run(planned([str(source)], vehicle="generic"), opened, Settings(), killed_runs.outcomes)
        opened.note()
        return tuple(opened.notes)


def said(source: Path, folder: Path) -> tuple[bool, str]:
    """One run: whether it came to its end, and what it says."""
    try:
        return True, "\n".join(run(source, folder))
    except OutputError as error:
        return False, str(error)


def held(folder: Path) -> dict[str, bytes]:
    """The files of a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_no_link_is_written_through(source: Path, tmp_path: Path, seed: int) -> None:
    """Any fixed name of the folder as a link of any kind to a recording or its folder, before a first and a later run:
    the recording stays, and the run ends with one line, or with the tables of an undisturbed run.
    """
    rng = random.Random(seed)
    run(source, tmp_path / "calm")
    expected = rows(tmp_path / "calm")
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "000001").mkdir(parents=True)
    for name in ("drive.blf", "000001/outcomes.parquet", "000001.jsonl"):
        (elsewhere / name).write_bytes(CONTENT)
    before = held(elsewhere)
    ended = 0
    for name in ("fleet.lock", *rng.sample(NAMES, 5)):
        for kind in ("symbolic", "hard", "folder"):
            out = tmp_path / f"{name.replace('/', ' ')} {kind}"
            later = rng.random() < 0.5
            if later:
                shutil.copytree(tmp_path / "calm", out)
                (source / "driver 0/new.log").write_bytes(b"99")
            planted = out / name
            if planted.is_dir():
                shutil.rmtree(planted)
            planted.unlink(missing_ok=True)
            planted.parent.mkdir(parents=True, exist_ok=True)
            if kind == "hard":
                os.link(elsewhere / "drive.blf", planted)
            else:
                planted.symlink_to(elsewhere / "drive.blf" if kind == "symbolic" else elsewhere)
            whole, says = said(source, out)
            ended += not whole
            assert whole or "\n" not in says
            if whole:
                found = rows(out)
                if later:  # the outcomes of one more log
                    found = {
                        each: [row for row in found[each] if "new.log" not in str(row)] for each in found
                    }
                for each in ("logs", "drives"):
                    assert found[each] == expected[each], (name, kind, later)
            (source / "driver 0/new.log").unlink(missing_ok=True)
            assert held(elsewhere) == before, (name, kind, later)
    assert ended < 18


@pytest.mark.parametrize("link", [os.link, os.symlink])
def test_the_tables_of_a_report_are_not_written_through_links(
    tmp_path: Path, link: Callable[[Path, Path], None]
) -> None:
    """`fleet report` holds no lock; its names are its own all the same."""
    recording = tmp_path / "drive.blf"
    recording.write_bytes(CONTENT)
    (tmp_path / "out").mkdir()
    for name in ("drivers", "population"):
        for planted in (f".{name}.jsonl.new", f".{name}.parquet.new", f"{name}.parquet"):
            link(recording, tmp_path / "out" / planted)
    summary_tables.written(tmp_path / "out", {"drivers": [], "population": []})
    assert recording.read_bytes() == CONTENT
    assert (tmp_path / "out/drivers.parquet").read_bytes()[:4] == b"PAR1"


@pytest.mark.parametrize("name", ["fleet.lock", ".fleet.json.new", "segments/000002.jsonl"])
def test_the_verb_ends_with_one_line(tmp_path: Path, name: str) -> None:
    """`canid fleet` itself: exit 5, and the last line says what is in the way."""
    recording, out = tmp_path / "drive.blf", tmp_path / "out"
    recording.write_bytes(CONTENT)
    short_logs.write(tmp_path / "logs", 1)
    (out / name).parent.mkdir(parents=True)
    os.link(recording, out / name)
    done = fleet_here(tmp_path / "logs", "-o", out, *QUICK)
    assert recording.read_bytes() == CONTENT
    # in a folder that has no results yet, any other file is another program's
    assert done.returncode == 5
    (line,) = [line for line in done.stderr.splitlines() if str(out) in line]
    assert line == done.stderr.splitlines()[-1]


def test_a_lock_of_another_program_is_not_emptied(tmp_path: Path) -> None:
    """A file of that name that is no lock keeps its content; an empty one, as a kill leaves it, is taken."""
    (tmp_path / "fleet.lock").write_bytes(CONTENT)
    with pytest.raises(OutputError, match="no lock of canid fleet"), store.opened(tmp_path):
        pass
    assert (tmp_path / "fleet.lock").read_bytes() == CONTENT
    (tmp_path / "fleet.lock").write_bytes(b"")
    with store.opened(tmp_path):
        assert (tmp_path / "fleet.lock").read_bytes().startswith(b"process ")


STRAYS = (
    "1 copy",
    "1",
    "000003-000001",
    "0000001",
    "000001 (1)",
    "00001",
    "000000",
    "000001-000001",
    "notes.txt",
)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_strays_among_the_parts_are_left_alone(source: Path, tmp_path: Path) -> None:
    """Names that canid does not write, as folders and as files, empty and full: named once, untouched, no result lost."""
    out = tmp_path / "out"
    run(source, out)
    expected = rows(out)
    part = next(path for path in parts.parts(out))
    for k, name in enumerate(STRAYS):
        if k % 3 == 0:
            (out / "parts" / name).write_bytes(CONTENT)
        else:
            (out / "parts" / name).mkdir()
        if k % 3 == 2:
            shutil.copytree(part, out / "parts" / name, dirs_exist_ok=True)
    (out / "segments/000009.jsonl").write_bytes(b'["a list of names","of the user"]\n')
    (out / "segments/9.jsonl").write_bytes(CONTENT)
    before = {name: content for name, content in held(out).items() if "/" in name}
    says = "\n".join(run(source, out))
    assert before.items() <= held(out).items()
    assert rows(out) == expected
    assert says.count("ignored") == 5
    assert f"{len(STRAYS) + 2 - 5} more" in says


def _emptied(part: Path) -> None:
    for path in part.iterdir():
        path.unlink()


def _without_outcomes(part: Path) -> None:
    (part / "outcomes.parquet").unlink()


def _without_drives(part: Path) -> None:
    (part / "drives.parquet").unlink()


def _cut(part: Path) -> None:
    for path in part.iterdir():
        path.write_bytes(path.read_bytes()[:100])


def _of_other_rows(part: Path) -> None:
    shutil.copy(part / "windows.parquet", part / "drives.parquet")


def _a_file(part: Path) -> None:
    shutil.rmtree(part)
    part.write_bytes(CONTENT)


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize(
    "damage", [_emptied, _without_outcomes, _without_drives, _cut, _of_other_rows, _a_file]
)
def test_only_a_whole_replacement_deletes_a_part(
    tmp_path: Path, source: Path, damage: Callable[[Path], None], seed: int
) -> None:
    """A part that stands for others by its name, and does not hold all their rows, deletes none: the run ends with a line,
    or goes on without it; when it is gone, all results are there without a new analysis.
    """
    out = tmp_path / "out"
    run(source, out)
    expected = rows(out)
    for path in sorted((out / "parts").iterdir()):
        last = path
    first = f"{random.Random(seed).randrange(1, int(last.name[:6]) + 1):06d}"
    cover = out / "parts" / f"{first}-000064"
    shutil.copytree(last, cover)
    damage(cover)
    before = held(out / "parts")
    _, says = said(source, out)
    assert cover.name in says
    assert "\n" not in says
    assert before.items() <= held(out / "parts").items()
    shutil.rmtree(cover) if cover.is_dir() else cover.unlink()
    (source / "driver 0/00.log").unlink()  # whose results could not be computed again
    kept = {name: [row for row in expected[name] if "00.log" not in str(row)] for name in ("logs", "drives")}
    run(source, out)
    found = rows(out)
    assert {name: found[name] for name in kept} == kept


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_whole_replacement_does(tmp_path: Path, source: Path) -> None:
    """As after a kill between the merged part's name and the deletion of the others."""
    out = tmp_path / "out"
    run(source, out)
    expected = rows(out)
    (last,) = sorted((out / "parts").iterdir())[-1:]
    shutil.copytree(last, out / "parts" / f"{last.name[:6]}-000064")
    run(source, out)
    assert not last.exists()
    assert rows(out) == expected


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_results_that_are_gone_are_computed_again(tmp_path: Path, source: Path) -> None:
    """A part that has lost its drives, with no other one: its logs are analysed again, not left without numbers."""
    out = tmp_path / "out"
    run(source, out)
    expected = rows(out)
    for part in parts.parts(out):
        (part / "drives.parquet").unlink()
    for path in out.glob("*.parquet"):
        path.unlink()
    assert "analysed again" in "\n".join(run(source, out))
    assert rows(out) == expected


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_copy_of_a_part_counts_nothing_twice(tmp_path: Path, source: Path) -> None:
    """As a file manager's copy under a name that canid could have given: all tables are the same, after a merge too."""
    out = tmp_path / "out"
    run(source, out)
    expected = rows(out)
    for k, part in enumerate(parts.parts(out)):
        shutil.copytree(part, out / "parts" / f"{40 + k:06d}")
    (out / "logs.parquet").unlink()
    for _ in range(2):
        run(source, out)
        assert rows(out) == expected


FIRST = """
import sys
from pathlib import Path
from canid.values.errors import OutputError
from canid.analysis.fleet.running import run as fleet_run
from canid.analysis.fleet.storage import consolidated, store
from canid.analysis.fleet.job import Settings
from canid.analysis.fleet.planning.plan import planned
from tests.fleet import killed_runs

def outcomes(jobs):
    for k, outcome in enumerate(killed_runs.outcomes(jobs)):
        if k == int(sys.argv[3]):
            print("at work", flush=True)
            sys.stdin.readline()
        yield outcome

store.SEGMENT_OUTCOMES = 5
try:
    with store.opened(sys.argv[2]) as opened:
        fleet_run.run(planned([sys.argv[1]], vehicle="generic"), opened, Settings(), outcomes)
except OutputError as error:
    print(type(error).__name__, error, flush=True)
else:
    print("done", flush=True)
"""


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_removed_lock_is_the_reason_that_is_given(source: Path, tmp_path: Path, seed: int) -> None:
    """`rm fleet.lock` at a drawn outcome of a run, and a second run: it sees the first one and touches nothing, the first
    one writes no table, both say why, and a third run has all that was stored and the right tables.
    """
    run(source, tmp_path / "calm")
    out = tmp_path / "out"
    words = [
        sys.executable,
        "-c",
        FIRST,
        source,
        out,
        str(random.Random(seed).randrange(12)),
    ]  # two of the thirteen logs are the same
    with subprocess.Popen(
        words,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=REPO,
        env=short_logs.environment(),
    ) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == "at work\n"
        (out / "fleet.lock").unlink()
        before = held(out)
        with pytest.raises(
            LockError, match=r"another run works in this folder, whose fleet.lock was removed"
        ):
            run(source, out)
        assert {**held(out), "fleet.lock": b""} == {**before, "fleet.lock": b""}
        says, _ = first.communicate("\n", timeout=short_logs.PATIENCE_S)
    assert says.startswith("LockError")
    assert "fleet.lock was removed while this run worked" in says
    assert not (out / "logs.parquet").exists()
    run(source, out)
    assert rows(out) == rows(tmp_path / "calm")
