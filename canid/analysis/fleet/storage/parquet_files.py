"""Parquet files of a fleet: written by DuckDB into a folder of their own, and synced; what they hold, and what they lack."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from canid.analysis.fleet.storage.columns import Column
from canid.io.files import duckdb_files, opening
from canid.io.files.duckdb_files import Files
from canid.values.errors import OutputError, one_line

# for `duckdb_files.connected`: who needs it, and what installs it
NEEDS_DUCKDB = ("canid fleet", "fleet")
# bytes that DuckDB may take beyond what Python holds; more goes to temporary files
MEMORY_BYTES = 1_000_000_000
# bytes after which a group of rows is written, whatever its rows: what is not written yet is in memory several times over
ROW_GROUP_BYTES = 32_000_000
# bytes of one row: JSON of a long drive is 3 MB
MAX_ROW_BYTES = 256_000_000


@contextmanager
def connected(folder: Path, doing: str = "written") -> Iterator[Any]:
    """A connection of DuckDB in memory, with its temporary files in a folder.

    Raises:
        ConfigError: DuckDB is not installed.
        OutputError: what is done with it fails, such as on a full disk.
    """
    # of a name that nobody can have taken before
    temporary = opening.temporary_name(folder / "duckdb")
    connection = duckdb_files.connected(
        *NEEDS_DUCKDB,
        memory_limit=f"{MEMORY_BYTES // 1_000_000}MB",
        temp_directory=str(temporary),
        # each thread buffers row groups of its own; the cores are the workers'
        threads=1,
        # a group of rows is written when it is large: with the order kept, only when it has its number of rows
        preserve_insertion_order=False,
    )
    import duckdb

    try:
        yield connection
    except duckdb.Error as error:
        raise OutputError(f"{folder}: tables cannot be {doing} ({one_line(error)})") from None
    except OSError as error:
        raise OutputError(f"{error.filename or folder}: cannot be {doing} ({error.strerror})") from None
    finally:
        connection.close()
        with suppress(OSError):
            temporary.rmdir()


def name(text: str) -> str:
    """A name as SQL has it.

    Example:
        >>> name("where")
        '"where"'
    """
    return '"' + text.replace('"', '""') + '"'


def of_lines(files: Files, path: Path, columns: Sequence[Column], max_row_bytes: int = MAX_ROW_BYTES) -> str:
    """SQL for the rows of a file with a JSON object a line."""
    types = {column.name: column.type for column in columns}
    return duckdb_files.json_lines(files.add(path), types, max_row_bytes)


def without_rows(columns: Sequence[Column]) -> str:
    """A query for a table without rows.

    Example:
        >>> without_rows([Column("t", "DOUBLE")])
        'SELECT NULL::DOUBLE AS "t" WHERE false'
    """
    return f"SELECT {', '.join(f'NULL::{c.type} AS {name(c.name)}' for c in columns)} WHERE false"


def of_files(files: Files, paths: Sequence[Path], columns: Sequence[Column]) -> str:
    """SQL for the rows of Parquet files; a column that an older file has not is NULL."""
    nothing = without_rows(columns)
    if not paths:
        return f"({nothing})"
    chosen = ", ".join(name(column.name) for column in columns)
    every = f"SELECT * FROM {duckdb_files.parquet([files.add(path) for path in paths], union_by_name=True)}"
    return f"(SELECT {chosen} FROM ({nothing} UNION ALL BY NAME {every}))"


def write(connection: Any, sql: str, path: Path, notes: Mapping[str, str] | None = None) -> None:
    """Write what a query gives as a new Parquet file, with texts that it carries, and sync it. Raises OSError."""
    fd = opening.create(path)
    try:
        duckdb_files.write_parquet(
            connection, f"({sql})", fd, path, notes=notes, row_group_bytes=ROW_GROUP_BYTES
        )
        os.fsync(fd)
    finally:
        os.close(fd)


def unreadable(connection: Any, path: Path) -> str:
    """Why a file is no Parquet file that can be read; "": it is one, as far as its beginning and its end say."""
    import duckdb

    try:
        if not stat.S_ISREG(os.lstat(path).st_mode):
            return "not a regular file"
        with duckdb_files.opened() as files:
            connection.execute(f"SELECT count(*) FROM {duckdb_files.parquet([files.add(path)])}").fetchone()
    except OSError as error:
        return str(error.strerror)
    except duckdb.Error as error:
        return one_line(error)
    return ""


def count(connection: Any, rows: str) -> int:
    """How many rows a source has."""
    number: int = connection.execute(f"SELECT count(*) FROM {rows}").fetchone()[0]
    return number


def missing(connection: Any, rows: str, among: str) -> int:
    """How many rows of one source another one with the same columns has not: by hashes of 64 bits, each row counted."""
    return count(
        connection,
        f"(SELECT hash(one) FROM {rows} AS one EXCEPT ALL SELECT hash(other) FROM {among} AS other)",
    )
