"""No verb's numbers depend on the name of the folder that its files are in, and none touches the folder next to it."""

from __future__ import annotations

import json
import os
import random
import shutil
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.fleet.storage import typed_rows
from canid.io.files import duckdb_files
from canid.ui.cli import main
from canid.values.shipped_files import shipped
from tests.fixtures.odd_names import MEANT, text_of
from tests.fleet import short_logs

PART = ("--vehicle", "generic", "--stop", "20")
JOINED = "SELECT age, driver, log, range_rate_K FROM people JOIN drives USING (driver) ORDER BY log"
# in this order: later ones read what earlier ones have written
COMMANDS = (
    ("simulate", "new.blf", "--minutes", "0.1", "--seed", "3"),
    ("recover", "drive.log", "-o", "copy.blf"),
    ("check", "drive.log", "--vehicle", "generic", "--json", "check.json"),
    ("init", "car.dbc", "-o", "car.toml"),
    ("look", "drive.log", "--dbc", "car.dbc"),
    ("decode", "drive.log", "--dbc", "car.dbc", "--stop", "1", "--csv"),
    ("export", "drive.log", *PART, "--to", "parquet", "-o", "table"),
    ("export", "drive.log", *PART, "--to", "csv", "-o", "table"),
    ("export", "drive.log", *PART, "--to", "mat", "-o", "table.mat"),
    ("identify", "drive.log", *PART, "--json", "identify.json"),
    ("identify", "table.samples.parquet", "--json", "of-parquet.json"),
    ("identify", "table.samples.csv", "--json", "of-csv.json"),
    ("fleet", "drives", "-o", "res", *short_logs.QUICK, "--json", "fleet.json"),
    ("fleet", "query", "res", "SELECT * EXCLUDE (wall_s, cpu_s, peak_bytes) FROM drives ORDER BY log", "--format", "csv"),
    ("fleet", "query", "res", JOINED, "--with", "people.csv", "--format", "csv"),
    ("fleet", "report", "res", "-o", "fleet.html"),
)  # fmt: skip
# what differs between two runs in one folder as well
UNLIKE = {"wall_s", "cpu_s", "peak_bytes", "analysed_utc", "modified_ns", "command", "seconds"}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "drive.log").write_bytes(short_logs.log(3, 40.0))
    short_logs.write(folder / "drives", 2, 20.0)
    shutil.copy(shipped() / "generic.dbc", folder / "car.dbc")
    (folder / "people.csv").write_text("driver,age\ndriver 0,34\ndriver 1,51\n")
    return folder


def did(folder: Path, patch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """What all commands say and write in a folder."""
    patch.chdir(folder)
    found: dict[str, Any] = {}
    for words in COMMANDS:
        code = main([*words])
        out, err = capsys.readouterr()
        assert "Traceback" not in err, words
        said = [] if words[0] == "simulate" else _plain(out, folder).splitlines()
        found[" ".join(words)] = (code, said if words[:2] != ("fleet", "query") else said[1:2])
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and not name.startswith("res/"):
            found[name] = _content(path, folder)
    return found


def _plain(text: str, folder: Path) -> str:
    """A text without the folder's name, in each of the ways in which it may be written."""
    for name in (json.dumps(str(folder))[1:-1], str(folder), typed_rows.text(folder)):
        text = text.replace(name, "HERE")
    return text


def _content(path: Path, folder: Path) -> Any:
    import duckdb

    if path.suffix == ".parquet":
        with duckdb_files.opened() as files, duckdb.connect() as db:
            return db.execute(f"SELECT * FROM {duckdb_files.parquet([files.add(path)])}").fetchall()
    if path.suffix == ".json":
        return _without(json.loads(_plain(path.read_text("utf-8"), folder)))
    if path.suffix in (".html", ".blf", ".mat"):
        return "written"
    return path.read_bytes()


def _without(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without(each) for key, each in value.items() if key not in UNLIKE}
    return [_without(each) for each in value] if isinstance(value, list) else value


@pytest.mark.slow("sixteen commands in each folder")
def test_all_verbs_give_the_numbers_of_a_plain_folder(
    inputs: Path,
    tmp_path: Path,
    seed: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The same commands in `accel=0`, `res[1]` and drawn names, with a neighbour that a pattern would find: the same
    output, files and exit codes, and the neighbour stays as it is.
    """
    shutil.copytree(inputs, tmp_path / "plain")
    expected = did(tmp_path / "plain", monkeypatch, capsys)
    assert {code for code, *_ in (expected[" ".join(words)] for words in COMMANDS)} <= {0, 1, 4}
    text = [name for name in MEANT if text_of(name) is not None]
    for name in (b"accel=0", b"res[1]", *random.Random(seed).sample(text, 2)):
        place = tmp_path / "in"
        folder, neighbour = place / os.fsdecode(name), place / "res1"
        shutil.copytree(inputs, folder)
        shutil.copytree(tmp_path / "plain", neighbour, dirs_exist_ok=True)
        before = {path: path.read_bytes() for path in neighbour.rglob("*") if path.is_file()}
        found = did(folder, monkeypatch, capsys)
        for what, value in expected.items():
            assert found[what] == value, (name, what)
        assert {path: path.read_bytes() for path in neighbour.rglob("*") if path.is_file()} == before
        monkeypatch.chdir(tmp_path)
        shutil.rmtree(place)


@pytest.mark.slow("sixteen commands")
def test_a_folder_whose_name_is_no_text_gives_the_numbers_or_one_line(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Bytes that are no UTF-8, with a column of DuckDB's in them: no other number, and an error is one line."""
    shutil.copytree(inputs, tmp_path / "plain")
    expected = did(tmp_path / "plain", monkeypatch, capsys)
    folder = tmp_path / os.fsdecode(b"a\xff=3")
    shutil.copytree(inputs, folder)
    found = did(folder, monkeypatch, capsys)
    for words in COMMANDS:
        what = " ".join(words)
        assert found[what] == expected[what] or found[what][0] in (2, 5), what
    for name in ("of-parquet.json", "of-csv.json", "identify.json", "table.samples.parquet"):
        assert found[name] == expected[name], name
