"""`canid fleet query` answers from the tables of a folder, and can neither write nor read anything else."""

from __future__ import annotations

import argparse
import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.fleet.answers import data_quality
from canid.analysis.fleet.storage import generations, summary_tables
from canid.analysis.fleet.storage.columns import DRIVERS
from canid.analysis.fleet.storage.database import opened
from canid.analysis.fleet.storage.queries import QUERIES
from canid.ui.cli import Parser
from canid.ui.cli.commands import fleet_query
from canid.ui.terminal.spans import cells
from canid.ui.views.query_table import text
from canid.values.errors import ConfigError, LogError
from tests.fixtures.fleet_folder import COLUMNS, Planted, made, table, write

HOSTILE = "evil\x1b[2J\n'); DROP TABLE drives; -- =1+1 \u202e 前車"


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Planted:
    of = made(tmp_path_factory.mktemp("fleet") / "it's *[x] ü", seed=4, drivers=3, drives=3)
    # as a summary leaves them: nothing has to be pooled for these tests
    pooled = {
        "drivers": [{"driver": "driver 001", "range_rate_K": 0.5}],
        "population": [{"parameter": "range_rate_K"}],
    }
    summary_tables.written(of.folder, pooled, generations.current(of.folder))
    return of


def args(*words: str | Path) -> argparse.Namespace:
    parser = Parser(prog="canid fleet query")
    fleet_query.arguments(parser)
    return parser.parse_args([str(word) for word in words])


def ask(*words: str | Path) -> int:
    return fleet_query.run(args(*words))


def refused(*words: str | Path) -> str:
    with pytest.raises(ConfigError) as caught:
        ask(*words)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("name", [query.name for query in QUERIES])
def test_every_ready_question_runs(
    planted: Planted, name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Also on a folder of failed logs alone; nothing is wider than 80 columns."""
    only_failed = tmp_path / "failed"
    write(only_failed, [row for row in planted.rows if row["status"] == "failed"])
    for folder in (planted.folder, only_failed):
        assert ask(folder, name) == 0
        assert max((cells(line) for line in capsys.readouterr().out.splitlines()), default=0) <= 80


def test_answers_are_those_of_the_tables(planted: Planted, capsys: pytest.CaptureFixture[str]) -> None:
    """Counts by hand; CSV and JSON have all digits and all rows."""
    sql = "SELECT driver, count(*) AS n, max(range_rate_K) AS K FROM drives GROUP BY driver ORDER BY driver"
    ask(planted.folder, sql, "--format", "json")
    found = json.loads(capsys.readouterr().out)
    ask(planted.folder, sql, "--format", "csv")
    table = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    for driver in planted.drivers:
        own = [row["range_rate_K"] for row in planted.rows if row.get("driver") == driver]
        (one,) = [row for row in found if row["driver"] == driver]
        assert one == {"driver": driver, "n": len(own), "K": max(own)}
        assert next(float(row["K"]) for row in table if row["driver"] == driver) == max(own)
    assert next(row for row in found if row["driver"] == "broken")["K"] is None
    ask(planted.folder, "SELECT * FROM range(2500)", "--format", "csv")
    assert len(capsys.readouterr().out.splitlines()) == 2501
    ask(planted.folder, "SELECT * FROM range(2500)")
    out, err = capsys.readouterr()
    assert len(out.splitlines()) == 101
    assert "--format csv" in err
    ask(planted.folder, "SELECT 1 AS a WHERE false", "--format", "json")
    assert json.loads(capsys.readouterr().out) == []


def test_a_reason_is_that_of_the_log_that_is_its_example(
    tmp_path: Path, seed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of several logs that failed alike, each with words of its own: in the query and on the page."""
    rng = np.random.default_rng(seed)
    of = made(tmp_path / "fleet", seed=seed, drivers=3, drives=3)
    first = next(row for row in of.rows if row["status"] == "failed")
    said = {f"/logs/{k}.blf": f"{number} bytes early" for k, number in enumerate(rng.permutation(20))}
    rows = [first | {"log": log, "failure": "not_a_log", "reason": reason} for log, reason in said.items()]
    write(of.folder, [row for row in of.rows if row["status"] != "failed"] + rows)
    ask(of.folder, "failed", "--format", "json")
    (answer,) = json.loads(capsys.readouterr().out)
    assert (answer["logs"], answer["reason"]) == (20, said[answer["example"]])
    with opened(of.folder) as db:
        (counted,) = data_quality.failures(db)
    assert (counted.number, counted.says) == (20, said[counted.examples[0]])


@pytest.mark.parametrize(
    "sql",
    [
        "COPY drives TO '{folder}/drives.parquet' (USE_TMP_FILE false)",
        "COPY (SELECT 1) TO '{outside}/x.csv'",
        "EXPLAIN ANALYZE COPY drives TO '{folder}/drives.parquet' (USE_TMP_FILE false)",
        "SELECT 1; COPY drives TO '{folder}/drives.parquet' (USE_TMP_FILE false)",
        "EXPORT DATABASE '{outside}'",
        "ATTACH '{outside}/x.db'",
        "SET enable_external_access = true",
        "RESET lock_configuration",
        "PRAGMA enable_object_cache",
        "INSTALL httpfs",
        "CREATE TABLE x AS SELECT 1",
        "SELECT * FROM read_text('{outside}/secret.txt')",
        "SELECT * FROM '{outside}/secret.csv'",
        "SELECT * FROM read_csv('{outside}/secret.csv')",
        "SELECT * FROM glob('{outside}/*')",
        "SELECT * FROM read_parquet('{folder}/../*.parquet')",
        "",
        ";",
        "SELECT nothing FROM drives",
        "SELECT FROM WHERE",
    ],
)
def test_a_query_can_read_and_write_nothing_else(planted: Planted, tmp_path: Path, sql: str) -> None:
    """One line and exit code 2; the folder is byte for byte the same, and no file appears anywhere."""
    for name in ("secret.txt", "secret.csv"):
        (tmp_path / name).write_text("a,b\n1,2\n")
    (planted.folder.parent / "other.parquet").write_bytes(b"PAR1")
    before = {p: p.read_bytes() for folder in (planted.folder, tmp_path) for p in folder.rglob("*")}
    quoted = str(planted.folder).replace("'", "''")
    refused(planted.folder, sql.format(folder=quoted, outside=tmp_path))
    after = {p: p.read_bytes() for folder in (planted.folder, tmp_path) for p in folder.rglob("*")}
    assert after == before


def test_a_query_that_needs_more_memory_than_it_may_take_is_refused(
    planted: Planted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It leaves no temporary file, and the line says what to do."""
    monkeypatch.chdir(tmp_path)
    said = refused(
        planted.folder, "SELECT list(random()::VARCHAR || range) FROM range(20000000)", "--memory", "50M"
    )
    assert "--memory" in said
    assert list(tmp_path.iterdir()) == []


def test_mistakes_are_named(planted: Planted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert '"key"' in refused(planted.folder, "SELECT keyy FROM drives")
    assert "joint_findings" in refused(planted.folder, "SELECT * FROM nothing_like_it")
    assert 'did you mean "drivers"?' in refused(planted.folder, "drvers")
    assert "is no folder of canid fleet" in refused(tmp_path, "drivers")
    monkeypatch.chdir(tmp_path)
    assert "is no folder of canid fleet" in refused("drivers")
    assert "DIR" in refused("a", "b", "c")
    interrupted = tmp_path / "interrupted"
    interrupted.mkdir()
    (interrupted / "fleet.json").write_text(
        '{"canid_fleet": 1, "command": "canid fleet logs -o interrupted"}'
    )
    assert "has no tables yet" in refused(interrupted, "drivers")
    assert "is no folder" not in refused(interrupted, "drivers")
    damaged = tmp_path / "damaged"
    write(damaged, planted.rows)
    (damaged / "drives.parquet").write_bytes((damaged / "drives.parquet").read_bytes()[:1000])
    with pytest.raises(LogError, match="canid fleet"):
        ask(damaged, "drives")


def test_the_folder_may_be_named_in_several_ways(
    planted: Planted, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = []
    ask(planted.folder, "failed")
    said.append(capsys.readouterr().out)
    ask("failed", "-o", planted.folder)
    said.append(capsys.readouterr().out)
    monkeypatch.chdir(planted.folder)
    ask("failed")
    said.append(capsys.readouterr().out)
    ask(planted.folder, "--memory", "500M", "failed")
    said.append(capsys.readouterr().out)
    assert said[0] == said[1] == said[2] == said[3] != ""
    ask("--list")
    listed = capsys.readouterr().out
    assert all(query.name in listed for query in QUERIES)


def test_hostile_names_stay_text(
    planted: Planted, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Names of logs and drivers that would move a cursor, end a string of SQL or a line."""
    folder = tmp_path / "fleet"
    write(folder, [{**planted.rows[0], "log": HOSTILE, "driver": HOSTILE}])
    ask(folder, "drives")
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert "\u202e" not in out
    ask(folder, "SELECT log, driver FROM drives", "--format", "json")
    assert json.loads(capsys.readouterr().out) == [{"log": HOSTILE, "driver": HOSTILE}]
    ask(folder, "SELECT log, driver FROM drives", "--format", "csv")
    assert list(csv.reader(io.StringIO(capsys.readouterr().out)))[1] == [HOSTILE, HOSTILE]


def test_every_column_of_the_tables_is_shown_within_80_columns(
    planted: Planted, capsys: pytest.CaptureFixture[str]
) -> None:
    """SELECT * of a hundred columns: no line is longer, no value is lost, and columns without any are named once."""
    ask(planted.folder, "SELECT * FROM drives LIMIT 2")
    out, err = capsys.readouterr()
    assert max(map(cells, out.splitlines())) <= 80
    (left_out,) = (line for line in err.splitlines() if "left out" in line)
    empty = set(left_out.partition("left out: ")[2].split(", "))
    assert {"traffic_json", "lateral_offset_K"} <= empty
    folded = {
        c.name.removesuffix("_low").removesuffix("_high") for c in COLUMNS["drives"] if c.name not in empty
    }
    assert [name for name in folded if name not in "".join(out.split())] == []


@pytest.mark.parametrize("width", [20, 40, 80])
def test_no_line_is_wider_than_the_screen(width: int) -> None:
    names = ["name", "x" * 90, "K", "K_low", "K_high", "lone_low", "n"]
    rows = [
        ("word " * 30, "y" * 90, 0.5, 0.4, 0.6, 1.0, 3),
        (None, None, None, None, None, None, None),
        ("前" * 50, True, 1e-7, 0.0, 1.0, float("nan"), 10**9),
    ]
    lines = text(names, rows, width)
    assert max(map(cells, lines)) <= width
    assert "".join(lines).count("前") >= 50
    assert text([], [], width) == []


def test_a_summary_that_is_missing_is_an_empty_table(
    planted: Planted, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder without findings and windows answers as well."""
    folder = tmp_path / "fleet"
    write(folder, planted.rows[-1:])
    for name in ("findings", "windows", "events", "power"):
        (folder / f"{name}.parquet").unlink()
    ask(folder, "SELECT count(*) AS n FROM findings JOIN windows USING (key) JOIN drivers ON true")
    assert capsys.readouterr().out.split() == ["n", "0"]
    table(folder / "findings.parquet", COLUMNS["findings"], [{"key": planted.rows[0]["key"], "effect": "x"}])
    ask(folder, "SELECT effect FROM findings")
    assert capsys.readouterr().out.split() == ["effect", "x"]


def test_own_tables_are_joined(planted: Planted, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By the name of the file: numbers of the fleet next to what only the user knows."""
    people = tmp_path / "people [1] of 2026.csv"
    people.write_text("driver,age\ndriver 000,34\ndriver 001,51\n", encoding="utf-8")
    sql = "SELECT driver, age, count(*) AS n FROM drives JOIN people__1__of_2026 USING (driver) GROUP BY ALL ORDER BY 1"
    assert ask(planted.folder, sql, "--with", people, "--format", "json") == 0
    assert json.loads(capsys.readouterr().out) == [
        {"driver": "driver 000", "age": 34, "n": 3},
        {"driver": "driver 001", "age": 51, "n": 3},
    ]
    trips = tmp_path / "trips.parquet"
    table(trips, DRIVERS[:1], [{"driver": "driver 002"}])
    ask(
        planted.folder,
        "SELECT count(*) FROM trips SEMI JOIN drives USING (driver)",
        "--with",
        trips,
        "--format",
        "csv",
    )
    assert capsys.readouterr().out.splitlines()[1] == "1"


def test_own_tables_that_cannot_be_used_are_one_line(planted: Planted, tmp_path: Path) -> None:
    """Missing, a folder, a name of the fleet's, twice the same name, no table at all; and nothing else becomes readable."""
    people, other = tmp_path / "people.csv", tmp_path / "other"
    other.mkdir()
    for path in (people, other / "people.csv", tmp_path / "drives.csv", tmp_path / "secret.csv"):
        path.write_text("driver\nanna\n", encoding="utf-8")
    (tmp_path / "broken.parquet").write_bytes(b"no table")
    count = "SELECT count(*) FROM drives"
    assert "no such file" in refused(planted.folder, count, "--with", tmp_path / "none.csv")
    assert "no such file" in refused(planted.folder, count, "--with", other)
    assert "another name" in refused(planted.folder, count, "--with", tmp_path / "drives.csv")
    twice = ("--with", people, "--with", other / "people.csv")
    assert "another file has the name people" in refused(planted.folder, count, *twice)
    assert "cannot be read" in refused(planted.folder, count, "--with", tmp_path / "broken.parquet")
    secret = f"SELECT * FROM read_csv('{tmp_path / 'secret.csv'}')"
    assert "fleet query:" in refused(planted.folder, secret, "--with", people)
