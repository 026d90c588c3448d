"""DuckDB in memory with one view per table of a fleet folder; it reads these files and nothing else, and writes none."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from canid.fleet.storage.columns import (
    DRIVERS,
    EVENTS,
    FINDINGS,
    JOINT_FINDINGS,
    POPULATION,
    POWER,
    WINDOWS,
    Column,
)
from canid.values.errors import ConfigError, DamagedLogError, one_line

# what may be missing: a fleet without a diagnosis has no findings, and one that was interrupted no summary yet
_EMPTY: dict[str, Sequence[Column]] = {
    "windows": WINDOWS,
    "events": EVENTS,
    "findings": FINDINGS,
    "power": POWER,
    "drivers": DRIVERS,
    "population": POPULATION,
    "joint_findings": JOINT_FINDINGS,
}
NEEDED = ("logs", "drives")
VIEWS = (*NEEDED, *_EMPTY)
# bytes; a sort of all windows of 10,000 h takes less, and a laptop of 8 GB stays usable
MEMORY_BYTES = 2_000_000_000


def is_folder(path: str | Path) -> bool:
    """Is it a folder that `canid fleet` has written?

    Example:
        >>> is_folder("replay_logs")
        False
    """
    return all(os.path.isfile(Path(path) / f"{name}.parquet") for name in NEEDED)


def not_a_folder(path: str | Path) -> ConfigError:
    """The error for a folder without the tables."""
    return ConfigError(
        f"{path}: is no folder of canid fleet (logs.parquet and drives.parquet are missing); "
        "`canid fleet LOGS... -o DIR` writes one"
    )


@contextmanager
def opened(
    folder: str | Path, memory_bytes: int = MEMORY_BYTES, tables: Sequence[str | Path] = ()
) -> Iterator[Any]:
    """Open the tables of a fleet folder.

    Once the views are there, DuckDB may open these files only, its settings are locked, and it has no folder for temporary
    files: what does not fit into the memory is refused.

    Args:
        folder: of `canid fleet -o`.
        memory_bytes: that DuckDB may take.
        tables: those of the user, CSV or Parquet, which are read at once, each under the name of `table_name`.

    Yields:
        A connection (`duckdb.DuckDBPyConnection`) with the views `VIEWS`.

    Raises:
        ConfigError: it is no such folder, duckdb is missing, or a table of the user cannot be read.
        DamagedLogError: a table is damaged.
    """
    try:
        import duckdb
    except ImportError as error:
        raise ConfigError("fleet: needs duckdb: pip install 'canid[fleet]'") from error
    if not is_folder(folder):
        raise not_a_folder(folder)
    with duckdb.connect() as db:
        allowed = []
        for name in VIEWS:
            path = str((Path(folder) / f"{name}.parquet").resolve())
            if os.path.isfile(path):
                allowed.append(path)
                source = f"SELECT * FROM read_parquet({literal(path)})"
            else:
                source = _without_rows(_EMPTY[name])
            try:
                db.execute(f"CREATE VIEW {name} AS {source}")
            except duckdb.Error as error:
                raise DamagedLogError(
                    f"{path}: cannot be read ({_first_line(error)}); run `canid fleet` on the folder again"
                ) from error
        db.execute(f"SET memory_limit = '{memory_bytes}B'")
        for table in tables:
            _add_own(db, str(table))
        # a query that needs more is refused: files that it left would be no part of the folder
        db.execute("SET temp_directory = ''")
        db.execute(f"SET allowed_paths = [{', '.join(map(literal, allowed))}]")
        db.execute("SET enable_external_access = false")
        db.execute("SET lock_configuration = true")
        yield db


def table_name(path: str | Path) -> str:
    """The name under which a table of the user is found: that of its file.

    Example:
        >>> table_name("own/people.csv"), table_name("my people.2026.csv"), table_name("2026.csv")
        ('people', 'my_people_2026', '_2026')
    """
    name = re.sub(r"\W", "_", Path(path).stem)
    return f"_{name}" if name[:1].isdigit() else name


def _add_own(db: Any, path: str) -> None:
    """Read a table of the user. Raises ConfigError."""
    import duckdb

    name = table_name(path)
    if name.lower() in VIEWS:
        raise ConfigError(f"{path}: {name} is a table of the fleet; give the file another name")
    if not os.path.isfile(path):
        raise ConfigError(f"{path}: no such file")
    read = "read_parquet" if Path(path).suffix.lower() == ".parquet" else "read_csv"
    try:
        db.execute(f'CREATE TABLE "{name}" AS SELECT * FROM {read}([{literal(_plain(path))}])')
    except duckdb.Error as error:
        taken = "already exists" in str(error)
        why = f"another file has the name {name}" if taken else f"cannot be read ({_first_line(error)})"
        raise ConfigError(f"{path}: {why}") from None


def _plain(path: str) -> str:
    """A path as DuckDB takes it for itself: its *, ? and [ are wildcards elsewhere.

    >>> _plain("a[1]*.csv")
    'a[[]1][*].csv'
    """
    return re.sub(r"([*?[])", r"[\1]", path)


def rows(db: Any, sql: str, values: Sequence[Any] = ()) -> list[dict[str, Any]]:
    """Rows of a query of canid's own, by column name."""
    done = db.execute(sql, list(values))
    names = [column[0] for column in done.description]
    return [dict(zip(names, row, strict=True)) for row in done.fetchall()]


def literal(text: str) -> str:
    """A string of SQL.

    Raises:
        ConfigError: DuckDB cannot name such a file.

    Example:
        >>> literal("it's")
        "'it''s'"
    """
    if text.encode("utf-8", "ignore").decode() != text:  # bytes of a file name that are no text
        raise ConfigError(f"{text!r}: DuckDB cannot open a file of this name; rename the folder")
    return "'" + text.replace("'", "''") + "'"


def _without_rows(columns: Sequence[Column]) -> str:
    return "SELECT " + ", ".join(f'NULL::{c.type} AS "{c.name}"' for c in columns) + " WHERE false"


def _first_line(error: Exception) -> str:
    return one_line(Exception(str(error).partition("\n")[0]))
