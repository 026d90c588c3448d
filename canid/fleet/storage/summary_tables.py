"""Tables of a whole folder, which its summary writes: `drivers.parquet` and `population.parquet`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from canid.files import opening
from canid.fleet.storage import parquet_files, typed_rows
from canid.fleet.storage.columns import SUMMARIES, Column
from canid.values.errors import OutputError


def written(folder: Path, tables: Mapping[str, Iterable[Mapping[str, Any]]]) -> None:
    """Write tables of `columns.SUMMARIES`, each whole or not at all.

    Args:
        folder: of the fleet.
        tables: name -> rows.

    Raises:
        OutputError: they cannot be written, such as on a full disk; those of an earlier run stay.
    """
    for name, rows in tables.items():
        _written(folder, name, SUMMARIES[name], rows)
    opening.sync_folder(folder)


def _written(folder: Path, name: str, columns: Sequence[Column], rows: Iterable[Mapping[str, Any]]) -> None:
    try:
        with opening.private_folder(folder / "tables") as made:
            lines, new = made / f"{name}.jsonl", made / f"{name}.parquet"
            with opening.create_file(lines) as file:
                for row in rows:
                    file.write(
                        typed_rows.of_line(typed_rows.line(name, typed_rows.typed(row, columns)))[1] + b"\n"
                    )
            with parquet_files.connected(folder) as connection:
                parquet_files.write(
                    connection, f"SELECT * FROM {parquet_files.of_lines(lines, columns)}", new
                )
            os.replace(new, folder / f"{name}.parquet")
    except OSError as error:
        raise OutputError(f"{error.filename or folder}: cannot be written ({error.strerror})") from None
