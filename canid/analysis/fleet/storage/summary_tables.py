"""Tables of a whole folder, which its summary writes: `drivers.parquet` and `population.parquet`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from canid.analysis.fleet.storage import generations, lock, parquet_files, typed_rows
from canid.analysis.fleet.storage.columns import SUMMARIES
from canid.io.files import duckdb_files, opening
from canid.values.errors import system_errors


def kept(folder: Path, generation: str, tables: Mapping[str, Iterable[Mapping[str, Any]]]) -> bool:
    """Write tables that were made from a generation, if the folder still holds it and no run works there.

    Returns:
        Whether they were written: under the lock, or not at all.

    Raises:
        OutputError: they cannot be written, such as on a full disk; those of an earlier run stay.
    """
    try:
        with lock.held(folder):
            if generations.current(folder) != generation:
                return False
            written(folder, tables, generation)
            return True
    except lock.LockError:
        return False


def written(folder: Path, tables: Mapping[str, Iterable[Mapping[str, Any]]], generation: str = "") -> None:
    """Write tables of `columns.SUMMARIES`, each whole or not at all.

    Args:
        folder: of the fleet, whose lock is held.
        tables: name -> rows.
        generation: that they were made from; of joint findings none, whose rows have keys of their own.

    Raises:
        OutputError: they cannot be written, such as on a full disk; those of an earlier run stay.
    """
    with (
        system_errors(folder),
        opening.private_folder(folder / "tables") as made,
        parquet_files.connected(folder) as connection,
        duckdb_files.opened() as files,
    ):
        for name, rows in tables.items():
            lines, new = made / f"{name}.jsonl", made / f"{name}.parquet"
            typed_rows.write_lines(lines, rows, SUMMARIES[name])
            source = parquet_files.of_lines(files, lines, SUMMARIES[name])
            notes = generations.notes(generation) if generation else {}
            parquet_files.write(connection, f"SELECT * FROM {source}", new, notes)
        for name in tables:
            os.replace(made / f"{name}.parquet", folder / f"{name}.parquet")
        opening.sync_folder(folder)
