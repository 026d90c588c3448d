"""DuckDB of canid neither fetches nor loads an extension, whatever a file is called or a question asks."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import duckdb
import pytest

from canid.analysis.export import parquet_table
from canid.analysis.fleet.storage import database, parquet_files
from canid.analysis.tables.sources.parquet_source import ParquetSource
from canid.io.files import duckdb_files
from canid.ui.cli import main
from tests.fixtures.fleet_folder import made

# what DuckDB would fetch an extension for, or its author: of an address, another program's file, a setting
ASKS = (
    "SELECT * FROM read_parquet('{server}/x.parquet')",
    "SELECT * FROM '{server}/x.csv'",
    "SELECT * FROM read_xlsx('a.xlsx')",
    "SELECT * FROM sqlite_scan('a', 'b')",
    "SET s3_region = 'x'",
)


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, list[str]]]:
    """The address of a server on loopback, which is the proxy of every other server too, and what it was asked for; in a
    home without extensions.
    """
    requests: list[str] = []

    class Refuses(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            requests.append(f"{self.command} {self.path}")
            self.send_error(404)

        do_HEAD = do_CONNECT = do_POST = do_GET  # noqa: N815

        def log_message(self, format: str, *args: object) -> None:
            pass

    home = tmp_path / "home"
    home.mkdir()
    with ThreadingHTTPServer(("127.0.0.1", 0), Refuses) as server:
        at = f"http://127.0.0.1:{server.server_port}"
        for name in ("HTTP_PROXY", "HTTPS_PROXY", "http_proxy", "https_proxy"):
            monkeypatch.setenv(name, at)
        monkeypatch.setenv("HOME", str(home))
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield at, requests
        finally:
            server.shutdown()
            thread.join()
    assert requests == []
    assert list(home.iterdir()) == []


@contextmanager
def of_a_table(folder: Path) -> Iterator[Any]:
    path = folder / "a.parquet"
    with duckdb.connect() as db:
        db.execute(f"COPY (SELECT 1 AS t) TO '{path}' (FORMAT parquet)")
    with ParquetSource(path)._connect() as db:
        yield db


@contextmanager
def of_an_export(folder: Path) -> Iterator[Any]:
    with parquet_table.opened() as write:
        yield write.args[0]  # type: ignore[attr-defined]


def of_a_fleet(folder: Path) -> AbstractContextManager[Any]:
    return database.opened(made(folder, seed=1, drivers=1, drives=1).folder)


@pytest.mark.parametrize("opened", [of_a_table, of_an_export, of_a_fleet, parquet_files.connected])
def test_no_connection_asks_for_an_extension(
    opened: Callable[[Path], AbstractContextManager[Any]], tmp_path: Path, asked: tuple[str, list[str]]
) -> None:
    """Of each way in which canid opens DuckDB: what needs an extension is an error, without a request or a file."""
    folder = tmp_path / "folder"
    folder.mkdir()
    with opened(folder) as db:
        for sql in ASKS:
            with pytest.raises(duckdb.Error):
                db.execute(sql.format(server=asked[0]))
        (kept,) = db.execute("SELECT current_setting('autoload_known_extensions')").fetchall()
        assert kept == (False,)
        # what canid's own SQL needs is within
        assert db.execute("SELECT '[1]'::JSON, now() AT TIME ZONE 'UTC'").fetchone()
    assert asked[1] == []


@pytest.mark.parametrize("descriptors", [duckdb_files.DESCRIPTORS, "/nothing"])
def test_a_file_that_is_called_as_an_address_is_a_file(
    descriptors: str,
    tmp_path: Path,
    asked: tuple[str, list[str]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A table in a folder `http:` by its relative path, on a system without names of descriptors too: nobody is asked."""
    monkeypatch.setattr(duckdb_files, "DESCRIPTORS", descriptors)
    fleet = made(tmp_path / "fleet", seed=1, drivers=1, drives=2)
    monkeypatch.chdir(tmp_path)
    schemes = ("http", "https", "s3", "hf")
    urls = [f"{scheme}://{asked[0].partition('://')[2]}/{scheme}x.csv" for scheme in schemes]
    for url in urls:
        Path(url).parent.mkdir(parents=True)
        Path(url).write_text("driver,age\ndriver 000,34\n", encoding="utf-8")
    sql = f"SELECT age FROM {' JOIN '.join(f'{scheme}x USING (driver, age)' for scheme in schemes)}"
    sql = sql.replace(" USING (driver, age)", "", 1)
    own = [word for url in urls for word in ("--with", url)]
    assert main(["fleet", "query", str(fleet.folder), sql, *own, "--format", "csv"]) == 0
    assert capsys.readouterr().out.split() == ["age", "34"]


def test_a_question_that_needs_an_extension_is_one_line(
    tmp_path: Path, asked: tuple[str, list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2; nothing is asked for, and the line names the extension."""
    fleet = made(tmp_path / "fleet", seed=1, drivers=1, drives=1)
    assert main(["fleet", "query", str(fleet.folder), "SELECT * FROM sqlite_scan('a', 'b')"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "sqlite_scanner" in line
    assert "install" not in line.lower()
