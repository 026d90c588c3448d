"""The tables of a fleet's folder that users read: those of all logs of the plan, and of no others."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from canid.files import opening
from canid.fleet.storage import parquet_files, parts, typed_rows
from canid.fleet.storage.columns import LOGS, SUMMARIES, TABLES, Column
from canid.values.errors import OutputError

# columns of a log that stand in `drives` as well
OF_THE_LOG = ("log", "driver", "car", "group_name", "status", "failure", "reason", "duplicate_of")
NAMES = ("logs", *TABLES)
# joint findings have keys of their own, of the drives that were diagnosed together
_OF_ALL_DRIVES = tuple(name for name in SUMMARIES if name != "joint_findings")
_ORDER = Column("number", "BIGINT")
# bytes of a row of `logs`: paths and one line of reason
_MAX_ROW_BYTES = 16_000_000

# bytes of drives that are sorted into the order of the plan: DuckDB's sort keeps wide rows in memory, and with five times
# this it ends for want of it
_SORTED_BYTES = 250_000_000


def written(folder: Path, logs: Iterable[Mapping[str, Any]], check: Callable[[], object]) -> None:
    """Write `logs.parquet`, `drives.parquet` and the other tables, each whole or not at all.

    Tables that were computed from all drives together (`columns.SUMMARIES`) are deleted where the drives are others now:
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
    before = folder / "logs.parquet"
    try:
        with opening.private_folder(folder / "tables") as made, parquet_files.connected(folder) as connection:
            lines = made / "logs.jsonl"
            with opening.create_file(lines) as file:
                for number, row in enumerate(logs):
                    numbered = {_ORDER.name: number, **typed_rows.typed(row, LOGS)}
                    file.write(typed_rows.of_line(typed_rows.line("logs", numbered))[1] + b"\n")
            source = parquet_files.of_lines(lines, (_ORDER, *LOGS), _MAX_ROW_BYTES)
            connection.execute(f"CREATE TEMP TABLE plan AS SELECT * FROM {source}")
            present = not any(
                parquet_files.unreadable(connection, folder / f"{name}.parquet") for name in NAMES
            )
            if present and _same(connection, before, _EVERY):
                return  # results are stored by content: the same logs with the same keys have the same rows
            connection.execute(
                "CREATE TEMP TABLE keys AS SELECT DISTINCT key FROM plan WHERE key IS NOT NULL"
            )
            for name in NAMES:
                query = _query(connection, folder, name)
                parquet_files.write(connection, query, made / f"{name}.parquet")
            check()
            if not _same(connection, before, _WITH_RESULTS):
                for name in _OF_ALL_DRIVES:
                    (folder / f"{name}.parquet").unlink(missing_ok=True)
            for name in TABLES:
                os.replace(made / f"{name}.parquet", folder / f"{name}.parquet")
            # `logs` last, when the others are on the disk: by it the next run sees whether they are current
            opening.sync_folder(folder)
            os.replace(made / "logs.parquet", before)
            opening.sync_folder(folder)
    except OSError as error:
        raise OutputError(f"{error.filename or folder}: cannot be written ({error.strerror})") from None


_EVERY = "SELECT {columns} FROM {source}"
_WITH_RESULTS = (
    "SELECT key, driver, car, group_name FROM {source} "
    "WHERE status IN ('ok', 'damaged') AND duplicate_of IS NULL"
)


def _same(connection: Any, before: Path, query: str) -> bool:
    """Whether a query gives the same rows of the plan and of the table that an earlier run has written."""
    if parquet_files.unreadable(connection, before):
        return False
    columns = _names(LOGS)
    old = query.format(columns=columns, source=parquet_files.of_files([before], LOGS))
    new = query.format(columns=columns, source="plan")
    differing = f"(({old} EXCEPT ALL {new}) UNION ALL ({new} EXCEPT ALL {old}))"
    count: int = connection.execute(f"SELECT count(*) FROM {differing}").fetchone()[0]
    return count == 0


def _query(connection: Any, folder: Path, table: str) -> str:
    if table == "logs":
        return f"SELECT {_names(LOGS)} FROM plan ORDER BY number"
    columns, present = TABLES[table], parts.parts(folder)
    rows = parts.rows(present, table)
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
