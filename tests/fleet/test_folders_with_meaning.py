"""A fleet's results do not depend on the name of their folder, and its neighbours are neither read nor deleted."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.fleet.job import Settings
from canid.analysis.fleet.planning.plan import planned
from canid.analysis.fleet.running import run as fleet_run
from canid.analysis.fleet.storage import consolidated, parts, store
from canid.analysis.fleet.storage.database import opened, rows
from canid.analysis.tables.sources.parquet_source import ParquetSource
from canid.values.errors import ConfigError
from tests.fixtures.odd_names import MEANT, text_of
from tests.fleet import killed_runs
from tests.fleet.short_logs import TABLES
from tests.fleet.test_killed import logs


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of thirteen logs, in three parts, in a folder of a plain name; the logs are next to it."""
    folder = tmp_path_factory.mktemp("fleet")
    logs(folder / "logs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store, "SEGMENT_OUTCOMES", 4)
        run(folder / "logs", folder / "res")
    return folder


def run(source: Path, folder: Path) -> None:
    with store.opened(folder) as of:
        fleet_run.run(planned([str(source)], vehicle="generic"), of, Settings(), killed_runs.outcomes)


def answers(folder: Path) -> dict[str, list[dict[str, Any]]]:
    with opened(folder) as db:
        return {
            name: sorted(rows(db, f"SELECT * FROM {name}"), key=repr)
            for name in TABLES
            if name not in ("drivers", "population")
        }


def held(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


# names that mean most; the slow test has all
FEW = (b"driver=zoe", b"status=failed", b"res[1]")


def same_under(plain: Path, tmp_path: Path, *names: bytes) -> None:
    """Move the results: the answers stay, and a run that knows all logs writes the same tables."""
    folder = tmp_path.joinpath(*map(os.fsdecode, names))
    # a pattern may stand for this one
    neighbour = folder.parent / "res1"
    shutil.copytree(plain / "res", folder)
    shutil.copytree(plain / "res", neighbour, dirs_exist_ok=True)
    (neighbour / "parts/000001/drives.parquet").write_bytes(b"not this one")
    before, expected = held(neighbour), answers(plain / "res")
    assert answers(folder) == expected
    if any(text_of(name) is None for name in names):
        with pytest.raises(ConfigError, match="choose another"):
            run(plain / "logs", folder)
        return
    for table in consolidated.NAMES:
        (folder / f"{table}.parquet").unlink()
    run(plain / "logs", folder)
    assert answers(folder) == expected
    assert held(neighbour) == before


def test_results_are_those_of_a_plain_name(plain: Path, tmp_path: Path) -> None:
    """In a folder that means a column, one that means another, and one that is a pattern for its neighbour."""
    same_under(plain, tmp_path, *FEW)


@pytest.mark.slow("a run of a fleet for each name")
@pytest.mark.parametrize("name", MEANT)
def test_results_are_those_of_a_plain_name_for_all_names(plain: Path, tmp_path: Path, name: bytes) -> None:
    """Each name that means something to DuckDB, to a pattern or to a shell, and those that are no text."""
    same_under(plain, tmp_path, name)


def many_parts(plain: Path, folder: Path, copies: int) -> None:
    """Results with so many parts, of which each holds its own log."""
    (folder / "parts").mkdir(parents=True)
    shutil.copy(plain / "res/fleet.json", folder)
    for number in range(1, copies + 1):
        part = folder / f"parts/{number:06d}"
        shutil.copytree(plain / "res/parts/000001", part)


@pytest.mark.parametrize("number", [3, pytest.param(66, marks=pytest.mark.slow("66 parts are merged"))])
def test_the_neighbour_of_a_bracketed_folder_is_neither_read_nor_deleted(
    plain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """`-o 'res[1]'` next to `res1`, both with more parts than are kept apart: it merges its own outcomes, all of them."""
    if number < parts.MAX_PARTS:
        monkeypatch.setattr(parts, "MAX_PARTS", number - 2)
    ours, other = tmp_path / "res[1]", tmp_path / "res1"
    many_parts(plain, ours, number)
    many_parts(plain, other, number)
    # what only one of them has
    shutil.copytree(plain / "res/parts/000002", other / "parts" / f"{number + 1:06d}")
    shutil.copytree(plain / "res/parts/000003", ours / "parts" / f"{number + 1:06d}")
    before = held(other)
    known = {folder: list(parts.outcomes(folder)) for folder in (ours, other)}
    assert known[ours] != known[other]
    parts.merged(ours, lambda: None)
    assert [path.name for path in parts.parts(ours)] == [f"000001-{number + 1:06d}"]
    assert sorted(map(repr, parts.outcomes(ours))) == sorted(map(repr, known[ours]))
    assert held(other) == before
    assert sorted(map(repr, parts.outcomes(other))) == sorted(map(repr, known[other]))


def test_a_table_has_its_own_columns_in_any_folder(tmp_path: Path) -> None:
    """A drive's table of columns in `accel=0/`: its accelerations, not the folder's."""
    import duckdb

    for name in FEW:
        path = tmp_path / os.fsdecode(name) / "accel=0" / "x.parquet"
        path.parent.mkdir(parents=True)
        plain = tmp_path / "x.parquet"
        with duckdb.connect() as db:
            db.execute(f"COPY (SELECT range * 0.1 AS t, range * 0.5 AS accel FROM range(50)) TO '{plain}'")
        shutil.move(plain, path)
        (block,) = ParquetSource(path).blocks([0, 1], [])
        assert block.numbers[:, 1].tolist() == [k * 0.5 for k in range(50)]
