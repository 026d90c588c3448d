"""One module connects to DuckDB and hands files to it, and no name of a file or folder means anything to it."""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import duckdb
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from canid.io.files import duckdb_files, opening
from canid.values.errors import ConfigError
from tests.fixtures.odd_names import MEANT, names, text_of

CANID = Path(__file__).parents[2] / "canid"
ONLY = "io/files/duckdb_files.py"
# functions and statements of DuckDB's SQL that open a file, and what decides which it may open
OPENS = re.compile(
    r"\b(read_(parquet|csv|csv_auto|json|json_auto|json_objects|ndjson|ndjson_auto|text|blob)|parquet_\w+|sniff_csv)\s*\("
    r"|\bCOPY\b.*\bTO\b|\b(IMPORT|EXPORT) DATABASE\b|\bATTACH\b|\bglob\s*\(|allowed_(paths|directories)",
    re.DOTALL,
)
CONNECTS = re.compile(r"from _?duckdb\b|import (.*, )?(_duckdb\b|duckdb(\.| as ))|duckdb\.\w+\(")
METHODS = {
    *("read_parquet", "read_csv", "read_json", "from_parquet", "from_csv_auto", "write_parquet", "write_csv"),
    *("to_parquet", "to_csv"),
}


def opening_sql(source: str) -> Iterator[str]:
    """What a source says to DuckDB that opens a file: in its strings, docstrings aside, and by its methods."""
    tree = ast.parse(source)
    said = {
        id(node.body[0].value)  # type: ignore[attr-defined]
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        and ast.get_docstring(node, clean=False) is not None
    }
    for node in ast.walk(tree):
        text = ""
        if isinstance(node, ast.JoinedStr):
            text = "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)  # type: ignore[misc]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            text = node.value
        if OPENS.search(text):
            yield text
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr in METHODS
            and ast.unparse(node.func.value) in ("duckdb", "db", "connection", "of.db", "self.db", "cursor")
        ):
            yield ast.unparse(node)


def test_no_other_module_hands_files_to_duckdb() -> None:
    """Read from the source: each mention of a function or statement that opens a file is in one module."""
    found = {
        f"{path.relative_to(CANID)}: {text}"
        for path in sorted(CANID.rglob("*.py"))
        if str(path.relative_to(CANID)) != ONLY and "duckdb" in (source := path.read_text("utf-8")).lower()
        for text in opening_sql(source)
    }
    assert found == set()
    assert len(list(opening_sql((CANID / ONLY).read_text("utf-8")))) > 5


@pytest.mark.parametrize(
    "source",
    [
        "db.execute(f\"SELECT * FROM read_parquet('{path}')\")",
        "sql = 'SELECT * FROM read_csv(' + path + ')'",
        "db.execute(f'COPY ({sql}) TO {path}')",
        "read = 'parquet_metadata (' ",
        "connection.read_parquet(path)",
        "db.execute(\"SET allowed_paths = ['x']\")",
    ],
)
def test_such_a_mention_is_found(source: str) -> None:
    assert list(opening_sql(source))


def connecting(source: str) -> Iterator[str]:
    """How a source makes a connection of its own, or takes the one that all modules of a process share."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import | ast.ImportFrom | ast.Call) and CONNECTS.match(
            text := ast.unparse(node)
        ):
            yield text


def test_no_other_module_connects_to_duckdb() -> None:
    """Read from the source: each connection is made where extensions are turned off."""
    found = {
        f"{path.relative_to(CANID)}: {each}"
        for path in sorted(CANID.rglob("*.py"))
        if str(path.relative_to(CANID)) != ONLY and "duckdb" in (source := path.read_text("utf-8"))
        for each in connecting(source)
    }
    assert found == set()
    assert list(connecting((CANID / ONLY).read_text("utf-8")))


@pytest.mark.parametrize(
    "source",
    [
        "duckdb.connect()",
        "duckdb.sql('SELECT 1')",
        "duckdb.read_csv(path)",
        "from duckdb import connect",
        "import duckdb as d",
        "import _duckdb",
    ],
)
def test_such_a_connection_is_found(source: str) -> None:
    """The test above would fail for each of these."""
    assert list(connecting(source))


@cache
def database() -> duckdb.DuckDBPyConnection:
    """One for all names: to begin takes longer than to read."""
    return duckdb.connect(config={"threads": 1})


def rows(path: Path, sql: str) -> list[tuple[object, ...]]:
    with duckdb_files.opened() as files:
        source = {".parquet": lambda f: duckdb_files.parquet([f]), ".csv": duckdb_files.csv}
        made = source.get(
            path.suffix, lambda f: duckdb_files.json_lines(f, {"K": "DOUBLE", "driver": "VARCHAR"}, 1000)
        )
        return database().execute(f"{sql} FROM {made(files.add(path))}").fetchall()


def write(path: Path) -> None:
    """A table of one row by its suffix."""
    if path.suffix == ".parquet":
        fd = opening.create(path)
        try:
            one = "(SELECT 0.5 AS K, 'anna' AS driver)"
            duckdb_files.write_parquet(database(), one, fd, path, notes={"note": "it's"})
        finally:
            os.close(fd)
    else:
        path.write_text("K,driver\n0.5,anna\n" if path.suffix == ".csv" else '{"K": 0.5, "driver": "anna"}\n')


def neighbours_of(path: Path) -> list[Path]:
    """What a pattern in a path may stand for: names of which a reader must read none."""
    text = str(path)
    return [Path(re.sub(r"\[(.).*?\]", r"\1", text)), Path(text.replace("*", "x").replace("?", "x"))]


@settings(max_examples=10, deadline=None)
@given(names(), names(), st.sampled_from([".parquet", ".csv", ".jsonl"]))
@example(b"driver=zoe", b"K=9", ".parquet")
@example(b"res[1]", b"*", ".parquet")
@example(b"K=9", b"a\\*?[x]", ".csv")
@example(b"\\b", b"K=\xff", ".parquet")
@example(b"x" * 255, b"{K}=%9", ".jsonl")
def test_a_file_gives_its_rows_under_any_name(
    tmp_path_factory: pytest.TempPathFactory, folder: bytes, file: bytes, suffix: str
) -> None:
    """What was written is read, whatever folder and file are called; a neighbour of a similar name is neither read nor
    changed.
    """
    tmp_path = tmp_path_factory.mktemp("names")
    path = tmp_path / os.fsdecode(folder) / (os.fsdecode(file[: 255 - len(suffix)]) + suffix)
    neighbours = {
        other: b"neighbour" for other in neighbours_of(path) if other != path and tmp_path in other.parents
    }
    for other, content in neighbours.items():
        other.parent.mkdir(exist_ok=True)
        other.write_bytes(content)
    path.parent.mkdir(exist_ok=True)
    write(path)
    assert rows(path, "SELECT K, driver") == [(0.5, "anna")]
    assert rows(path, "SELECT *")[0] in ((0.5, "anna"), ("anna", 0.5))
    assert {other: other.read_bytes() for other in neighbours} == neighbours
    assert len([each for each in tmp_path.rglob("*") if each.is_file()]) == 1 + len(neighbours)


@settings(max_examples=10, deadline=None)
@given(names())
@example(b"K=9")
@example(b"res[1]")
@example(b"a\\*")
def test_a_system_without_names_of_descriptors_gives_the_rows_or_one_line(
    tmp_path_factory: pytest.TempPathFactory, folder: bytes
) -> None:
    """There the path is escaped; where DuckDB cannot open it the error names it."""
    path = tmp_path_factory.mktemp("names") / os.fsdecode(folder) / "K=9.parquet"
    path.parent.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(duckdb_files, "DESCRIPTORS", "/nothing")
        if text_of(folder) is None:
            with pytest.raises(ConfigError, match="cannot open a file of this name"):
                write(path)
            return
        write(path)
        if b"\\" in folder and set(b"*?[") & set(folder):
            with pytest.raises(ConfigError, match="cannot open a file of this name"):
                rows(path, "SELECT *")
            return
        assert rows(path, "SELECT K, driver") == [(0.5, "anna")]


def test_a_file_stays_the_one_that_was_opened(tmp_path: Path) -> None:
    """Another one that takes its name while it is open, of the same size and time, is not read; nor is one of an
    earlier file whose descriptor has the same number.
    """
    paths = [tmp_path / f"{k}.parquet" for k in range(2)]
    for k, path in enumerate(paths):
        with duckdb.connect() as db:
            db.execute(f"COPY (SELECT {k} AS K) TO '{path}' (FORMAT parquet)")
        os.utime(path, (1e9, 1e9))
    with duckdb.connect() as db:
        for k in (0, 1, 0, 1):
            with duckdb_files.opened() as files:
                file = files.add(paths[k])
                assert db.execute(f"SELECT * FROM {duckdb_files.parquet([file])}").fetchall() == [(k,)]
        with duckdb_files.opened() as files:
            file = files.add(paths[0])
            os.replace(paths[1], paths[0])
            assert not file.has_name()
            assert db.execute(f"SELECT * FROM {duckdb_files.parquet([file])}").fetchall() == [(0,)]


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    """A folder, a device, a pipe that nobody writes: an error at once, and nothing waits."""
    os.mkfifo(tmp_path / "pipe")
    with duckdb_files.opened() as files:
        for path in (tmp_path, Path("/dev/null"), tmp_path / "pipe"):
            with pytest.raises(OSError, match="not a regular file"):
                files.add(path)


def test_every_meaning_of_a_name_is_drawn() -> None:
    """The names that other tests draw hold each character that DuckDB or a shell takes for something."""
    assert set(b"=*?[]{}'\"%#;\n\\ ") <= set(b"".join(MEANT))
    assert any(name.startswith(b"-") for name in MEANT)
    assert any(text_of(name) is None for name in MEANT)
    assert max(map(len, MEANT)) == 255
