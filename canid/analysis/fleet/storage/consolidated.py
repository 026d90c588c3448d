"""The tables of a fleet's folder that users read: those of all logs of the plan, and of no others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from canid.analysis.fleet.storage import generations, parquet_files, parts, typed_rows
from canid.analysis.fleet.storage.columns import LOGS, TABLES, Column
from canid.io.files import duckdb_files, opening
from canid.io.files.duckdb_files import Files
from canid.values.errors import system_errors

# columns of a log that stand in `drives` as well
OF_THE_LOG = ("log", "driver", "car", "group_name", "status", "failure", "reason", "duplicate_of")
NAMES = ("logs", *TABLES)
_ORDER = Column("number", "BIGINT")
# bytes of a row of `logs`: paths and one line of reason
_MAX_ROW_BYTES = 16_000_000

# bytes of drives that are sorted into the order of the plan: DuckDB's sort keeps wide rows in memory, and with five times
# this it ends for want of it
_SORTED_BYTES = 250_000_000


def written(folder: Path, logs: Iterable[Mapping[str, Any]], check: Callable[[], object]) -> None:
    """Write `logs.parquet`, `drives.parquet` and the other tables, each whole or not at all.

    Tables that were pooled from all drives (`generations.POOLED`) are deleted where the logs are others now:
    `canid fleet report` writes them anew. Those that are kept by the content of their drives stay.

    `drives` has one row per log: a log that failed has no numbers, nor has a duplicate, whose numbers stand with
    the first log of the same bytes. Where it is small, some 14,000 drives with a diagnosis, it is in the order of the plan.

    Args:
        folder: of the fleet.
        logs: rows of `columns.LOGS`, in the order of the plan.
        check: is called before the first table gets its name; raises where none must.

    Raises:
        OutputError: they cannot be written, such as on a full disk; those of an earlier run stay.
    """
    with (
        system_errors(folder),
        opening.private_folder(folder / "tables") as made,
        parquet_files.connected(folder) as connection,
    ):
        generations.published(folder)
        lines = made / "logs.jsonl"
        numbered = ({_ORDER.name: number, **row} for number, row in enumerate(logs))
        typed_rows.write_lines(lines, numbered, (_ORDER, *LOGS))
        with duckdb_files.opened() as files:
            # results are stored by content: the same logs with the same keys have the same rows
            generation = files.add(lines).sha256()
            source = parquet_files.of_lines(files, lines, (_ORDER, *LOGS), _MAX_ROW_BYTES)
            connection.execute(f"CREATE TEMP TABLE plan AS SELECT * FROM {source}")
        whole = not any(parquet_files.unreadable(connection, folder / f"{name}.parquet") for name in NAMES)
        if whole and generations.current(folder) == generation:
            return
        connection.execute("CREATE TEMP TABLE keys AS SELECT DISTINCT key FROM plan WHERE key IS NOT NULL")
        for name in NAMES:
            with duckdb_files.opened() as files:
                query = _query(files, connection, folder, name)
                notes = generations.notes(generation)
                parquet_files.write(connection, query, made / f"{name}.parquet", notes)
        lines.unlink()
        generations.written(folder, made, check)


def _query(files: Files, connection: Any, folder: Path, table: str) -> str:
    if table == "logs":
        return f"SELECT {_names(LOGS)} FROM plan ORDER BY number"
    columns, present = TABLES[table], parts.parts(folder)
    rows = parts.rows(files, present, table)
    if table != "drives":
        return f"SELECT {_names(columns)} FROM {rows} SEMI JOIN keys USING (key)"
    of_log = ", ".join(f"plan.{parquet_files.name(name)}" for name in OF_THE_LOG)
    numbers = ", ".join(f"found.{parquet_files.name(column.name)}" for column in columns)
    return (
        f"SELECT {of_log}, {numbers} FROM plan LEFT JOIN {rows} AS found "
        "ON found.key = plan.key AND plan.duplicate_of IS NULL"
        + (
            " ORDER BY plan.number"
            if parts.content_bytes(connection, present, table) <= _SORTED_BYTES
            else ""
        )
    )


def _names(columns: Iterable[Column]) -> str:
    return ", ".join(parquet_files.name(column.name) for column in columns)
