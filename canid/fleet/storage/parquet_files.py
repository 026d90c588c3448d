"""Parquet files of DuckDB: written under a temporary name, synced, and renamed when they are whole."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from canid.files import opening
from canid.fleet.storage.columns import Column
from canid.values.errors import ConfigError, OutputError, one_line

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
    try:
        import duckdb
    except ImportError:
        raise ConfigError("canid fleet needs DuckDB: pip install 'canid[fleet]'") from None
    # of a name that nobody can have taken before
    temporary = opening.temporary_name(folder / "duckdb")
    config: dict[str, str | bool | int | float | list[str]] = {
        "memory_limit": f"{MEMORY_BYTES // 1_000_000}MB",
        "temp_directory": str(temporary),
        # each thread buffers row groups of its own; the cores are the workers'
        "threads": 1,
        # a group of rows is written when it is large: with the order kept, only when it has its number of rows
        "preserve_insertion_order": False,
    }
    connection = duckdb.connect(config=config)
    try:
        yield connection
    except duckdb.Error as error:
        raise OutputError(f"{folder}: tables cannot be {doing} ({one_line(error)})") from None
    finally:
        connection.close()
        with suppress(OSError):
            temporary.rmdir()


def quoted(text: str | Path) -> str:
    """A text as SQL has it.

    Example:
        >>> quoted("it's")
        "'it''s'"
    """
    return "'" + str(text).replace("'", "''") + "'"


def name(text: str) -> str:
    """A name as SQL has it.

    Example:
        >>> name("where")
        '"where"'
    """
    return '"' + text.replace('"', '""') + '"'


def of_lines(path: Path, columns: Sequence[Column], max_row_bytes: int = MAX_ROW_BYTES) -> str:
    """SQL for the rows of a file with a JSON object a line; DuckDB takes twice the bytes of the largest row at once."""
    types = ", ".join(f"{quoted(column.name)}: {quoted(column.type)}" for column in columns)
    return (
        f"read_json({quoted(path)}, format = 'newline_delimited', columns = {{{types}}}, "
        f"maximum_object_size = {max_row_bytes})"
    )


def of_files(paths: Sequence[Path], columns: Sequence[Column]) -> str:
    """SQL for the rows of Parquet files; a column that an older file has not is NULL."""
    typed = ", ".join(f"NULL::{column.type} AS {name(column.name)}" for column in columns)
    nothing = f"SELECT {typed} WHERE false"
    if not paths:
        return f"({nothing})"
    files = ", ".join(map(quoted, paths))
    chosen = ", ".join(name(column.name) for column in columns)
    every = f"SELECT * FROM read_parquet([{files}], union_by_name = true)"
    return f"(SELECT {chosen} FROM ({nothing} UNION ALL BY NAME {every}))"


def write(connection: Any, sql: str, path: Path) -> None:
    """Write what a query gives as a Parquet file into a private folder (`opening.private_folder`), and sync it."""
    connection.execute(
        f"COPY ({sql}) TO {quoted(path)} (FORMAT parquet, COMPRESSION zstd, ROW_GROUP_SIZE_BYTES {ROW_GROUP_BYTES})"
    )
    opening.sync(path)


def unreadable(connection: Any, path: Path) -> str:
    """Why a file is no Parquet file that can be read; "": it is one, as far as its beginning and its end say."""
    import duckdb

    try:
        if not stat.S_ISREG(os.lstat(path).st_mode):
            return "not a regular file"
        connection.execute(f"SELECT count(*) FROM read_parquet({quoted(path)})").fetchone()
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
