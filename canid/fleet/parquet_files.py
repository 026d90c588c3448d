"""Parquet files of DuckDB: written under a temporary name, synced, and renamed when they are whole."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from canid.errors import ConfigError, OutputError, one_line
from canid.fleet.columns import Column

# bytes that DuckDB may take beyond what Python holds; more goes to temporary files
MEMORY_BYTES = 1_000_000_000
# bytes of one row: JSON of a long drive is 3 MB
MAX_ROW_BYTES = 256_000_000


@contextmanager
def connected(folder: Path) -> Iterator[Any]:
    """A connection of DuckDB in memory, with its temporary files in a folder.

    Raises:
        ConfigError: DuckDB is not installed.
        OutputError: what is done with it fails, such as on a full disk.
    """
    try:
        import duckdb
    except ImportError:
        raise ConfigError("canid fleet needs DuckDB: pip install 'canid[fleet]'") from None
    config: dict[str, str | bool | int | float | list[str]] = {
        "memory_limit": f"{MEMORY_BYTES // 1_000_000}MB",
        "temp_directory": str(folder / ".duckdb.tmp"),
        # each thread buffers row groups of its own; the cores are the workers'
        "threads": 1,
    }
    connection = duckdb.connect(config=config)
    try:
        yield connection
    except duckdb.Error as error:
        raise OutputError(f"{folder}: tables cannot be written ({one_line(error)})") from None
    finally:
        connection.close()
        with suppress(OSError):
            (folder / ".duckdb.tmp").rmdir()


def quoted(text: str | Path) -> str:
    """A text as SQL has it.

    Example:
        >>> quoted("it's")
        "'it''s'"
    """
    return "'" + str(text).replace("'", "''") + "'"


def name(of: str) -> str:
    """A name as SQL has it.

    Example:
        >>> name("where")
        '"where"'
    """
    return '"' + of.replace('"', '""') + '"'


def of_lines(path: Path, columns: Sequence[Column]) -> str:
    """SQL for the rows of a file with a JSON object a line."""
    types = ", ".join(f"{quoted(column.name)}: {quoted(column.type)}" for column in columns)
    return (
        f"read_json({quoted(path)}, format = 'newline_delimited', columns = {{{types}}}, "
        f"maximum_object_size = {MAX_ROW_BYTES})"
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
    """Write what a query gives as a Parquet file, and sync it."""
    connection.execute(f"COPY ({sql}) TO {quoted(path)} (FORMAT parquet, COMPRESSION zstd)")
    fd = os.open(path, os.O_RDWR)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def sync_folder(folder: Path) -> None:
    """Sync the names of a folder, where the system can open one."""
    with suppress(OSError):
        fd = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)
