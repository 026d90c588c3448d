"""The tables of a fleet's folder that users read: those of all logs of the plan, and of no others."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from canid.errors import OutputError
from canid.fleet import parquet_files, parts, typed_rows
from canid.fleet.columns import LOGS, SUMMARIES, TABLES, Column

# columns of a log that stand in `drives` as well
OF_THE_LOG = ("log", "driver", "car", "group_name", "status", "failure", "reason", "duplicate_of")
NAMES = ("logs", *TABLES)
# joint findings have keys of their own, of the drives that were diagnosed together
_OF_ALL_DRIVES = tuple(name for name in SUMMARIES if name != "joint_findings")
_ORDER = Column("number", "BIGINT")


def written(folder: Path, logs: Iterable[Mapping[str, Any]]) -> None:
    """Write `logs.parquet`, `drives.parquet` and the other tables, each whole or not at all.

    Tables that were computed from all drives together (`columns.SUMMARIES`) are deleted where the drives are others now:
    `canid fleet report` writes them anew. Those that are kept by the content of their drives stay.

    `drives` has one row per log: a log that failed has no numbers, nor has a duplicate, whose numbers stand with
    the first log of the same bytes.

    Args:
        folder: of the fleet.
        logs: rows of `columns.LOGS`, in the order of the plan.

    Raises:
        OutputError: they cannot be written, such as on a full disk; those of an earlier run stay.
    """
    new = {name: folder / f".{name}.parquet.new" for name in NAMES}
    lines, before = folder / ".logs.jsonl.new", folder / "logs.parquet"
    try:
        with lines.open("wb") as file:
            for number, row in enumerate(logs):
                one = {_ORDER.name: number, **typed_rows.typed(row, LOGS)}
                file.write(typed_rows.of_line(typed_rows.line("logs", one))[1] + b"\n")
        with parquet_files.connected(folder) as connection:
            source = parquet_files.of_lines(lines, (_ORDER, *LOGS))
            connection.execute(f"CREATE TEMP TABLE plan AS SELECT * FROM {source}")
            present = all((folder / f"{name}.parquet").exists() for name in NAMES)
            if present and _same(connection, before, _EVERY):
                return  # results are stored by content: the same logs with the same keys have the same rows
            connection.execute(
                "CREATE TEMP TABLE keys AS SELECT DISTINCT key FROM plan WHERE key IS NOT NULL"
            )
            for name in NAMES:
                parquet_files.write(connection, _query(folder, name), new[name])
            if not _same(connection, before, _WITH_RESULTS):
                for name in _OF_ALL_DRIVES:
                    (folder / f"{name}.parquet").unlink(missing_ok=True)
        for name in TABLES:
            os.replace(new[name], folder / f"{name}.parquet")
        # `logs` last, when the others are on the disk: by it the next run sees whether they are current
        parquet_files.sync_folder(folder)
        os.replace(new["logs"], before)
        parquet_files.sync_folder(folder)
    except OSError as error:
        raise OutputError(f"{error.filename or folder}: cannot be written ({error.strerror})") from None
    finally:
        for path in (lines, *new.values()):
            with suppress(OSError):
                path.unlink(missing_ok=True)


_EVERY = "SELECT {columns} FROM {source}"
_WITH_RESULTS = (
    "SELECT key, driver, car, group_name FROM {source} "
    "WHERE status IN ('ok', 'damaged') AND duplicate_of IS NULL"
)


def _same(connection: Any, before: Path, query: str) -> bool:
    """Whether a query gives the same rows of the plan and of the table that an earlier run has written."""
    if not before.exists():
        return False
    columns = _names(LOGS)
    old = query.format(columns=columns, source=parquet_files.of_files([before], LOGS))
    new = query.format(columns=columns, source="plan")
    differing = f"(({old} EXCEPT ALL {new}) UNION ALL ({new} EXCEPT ALL {old}))"
    count: int = connection.execute(f"SELECT count(*) FROM {differing}").fetchone()[0]
    return count == 0


def _query(folder: Path, table: str) -> str:
    if table == "logs":
        return f"SELECT {_names(LOGS)} FROM plan ORDER BY number"
    columns = TABLES[table]
    rows = parquet_files.of_files(parts.files(folder, table), columns)
    if table != "drives":
        return f"SELECT {_names(columns)} FROM {rows} SEMI JOIN keys USING (key)"
    of_log = ", ".join(f"plan.{parquet_files.name(name)}" for name in OF_THE_LOG)
    numbers = ", ".join(f"found.{parquet_files.name(column.name)}" for column in columns)
    return (
        f"SELECT {of_log}, {numbers} FROM plan LEFT JOIN {rows} AS found "
        "ON found.key = plan.key AND plan.duplicate_of IS NULL ORDER BY plan.number"
    )


def _names(columns: Iterable[Column]) -> str:
    return ", ".join(parquet_files.name(column.name) for column in columns)
