"""DuckDB in memory with one view per table of a fleet folder, all of one generation; it writes no files."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from canid.analysis.fleet.storage import generations, parquet_files, typed_rows
from canid.analysis.fleet.storage.columns import SUMMARIES, TABLES
from canid.analysis.fleet.storage.generations import NEEDED, Tables
from canid.io.files import duckdb_files
from canid.values.errors import ConfigError, DamagedLogError, one_line

# what may be missing: a fleet without a diagnosis has no findings, and one that was interrupted no summary yet
_EMPTY = {name: columns for name, columns in (TABLES | SUMMARIES).items() if name not in NEEDED}
VIEWS = (*NEEDED, *_EMPTY)
# bytes; a sort of all windows of 10,000 h takes less, and a laptop of 8 GB stays usable
MEMORY_BYTES = 2_000_000_000


class Database(NamedTuple):
    """The tables of one generation, and a connection with their views."""

    db: Any  # duckdb.DuckDBPyConnection
    opened: Tables

    def put(self, summaries: Mapping[str, Iterable[Mapping[str, Any]]]) -> None:
        """Answer with these rows for tables of `columns.SUMMARIES`, in memory."""
        for name, made in summaries.items():
            columns = SUMMARIES[name]
            text = json.dumps([typed_rows.typed(row, columns) for row in made])
            types = json.dumps([{column.name: column.type for column in columns}])
            self.db.execute(f"DROP VIEW {name}")
            self.db.execute(
                f"CREATE TABLE {name} AS SELECT each.* FROM (SELECT unnest(from_json(?::JSON, ?)) AS each)",
                [text, types],
            )

    def close_off(self) -> None:
        """Let the connection open these tables and nothing else, and let nobody change that."""
        duckdb_files.allow_only(self.db, list(self.opened.files.values()))

    def replaced(self) -> bool:
        """Whether another run has replaced a table since."""
        return not all(file.has_name() for file in self.opened.files.values())


@contextmanager
def opened(folder: str | Path) -> Iterator[Any]:
    """The connection of `database`: a `duckdb.DuckDBPyConnection` with the views `VIEWS`."""
    with database(folder) as tables:
        yield tables.db


@contextmanager
def database(
    folder: str | Path, memory_bytes: int = MEMORY_BYTES, tables: Sequence[str | Path] = ()
) -> Iterator[Database]:
    """Open the tables of a fleet folder: those of one generation, also while a run replaces them.

    It has no folder for temporary files: what does not fit into the memory is refused.

    Args:
        folder: of `canid fleet -o`.
        memory_bytes: that DuckDB may take.
        tables: those of the user, CSV or Parquet, which are read at once, each under the name of `table_name`.

    Raises:
        ConfigError: it is no such folder, duckdb is missing, or a table of the user cannot be read.
        DamagedLogError: a table is damaged.
    """
    with duckdb_files.opened() as files, duckdb_files.connected(*parquet_files.NEEDS_DUCKDB) as db:
        import duckdb

        generation = generations.opened(db, files, Path(folder))
        for name in VIEWS:
            file = generation.files.get(name)
            source = (
                f"SELECT * FROM {duckdb_files.parquet([file])}"
                if file is not None
                else parquet_files.without_rows(_EMPTY[name])
            )
            try:
                db.execute(f"CREATE VIEW {name} AS {source}")
            except duckdb.Error as error:
                raise DamagedLogError(
                    f"{file.path if file else folder}: cannot be read ({_first_line(error)}); run `canid fleet` on the "
                    "folder again"
                ) from error
        db.execute(f"SET memory_limit = '{memory_bytes}B'")
        for table in tables:
            _add_own(db, str(table))
        # a query that needs more is refused: files that it left would be no part of the folder
        db.execute("SET temp_directory = ''")
        yield Database(db, generation)


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
    try:
        with duckdb_files.opened() as files:
            file = files.add(path)
            is_parquet = file.path.suffix.lower() == ".parquet"
            source = duckdb_files.parquet([file]) if is_parquet else duckdb_files.csv(file)
            db.execute(f"CREATE TABLE {parquet_files.name(name)} AS SELECT * FROM {source}")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except duckdb.Error as error:
        taken = "already exists" in str(error)
        why = f"another file has the name {name}" if taken else f"cannot be read ({_first_line(error)})"
        raise ConfigError(f"{path}: {why}") from None


def rows(db: Any, sql: str, values: Sequence[Any] = ()) -> list[dict[str, Any]]:
    """Rows of a query of canid's own, by column name."""
    done = db.execute(sql, list(values))
    names = [column[0] for column in done.description]
    return [dict(zip(names, row, strict=True)) for row in done.fetchall()]


def _first_line(error: Exception) -> str:
    return one_line(Exception(str(error).partition("\n")[0]))
