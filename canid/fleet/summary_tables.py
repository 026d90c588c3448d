"""Tables of a whole folder, which its summary writes: `drivers.parquet` and `population.parquet`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from canid.errors import OutputError
from canid.fleet import parquet_files, typed_rows
from canid.fleet.columns import SUMMARIES, Column


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
    parquet_files.sync_folder(folder)


def _written(folder: Path, name: str, columns: Sequence[Column], rows: Iterable[Mapping[str, Any]]) -> None:
    new, lines = folder / f".{name}.parquet.new", folder / f".{name}.jsonl.new"
    try:
        with lines.open("wb") as file:
            for row in rows:
                file.write(
                    typed_rows.of_line(typed_rows.line(name, typed_rows.typed(row, columns)))[1] + b"\n"
                )
        with parquet_files.connected(folder) as connection:
            parquet_files.write(connection, f"SELECT * FROM {parquet_files.of_lines(lines, columns)}", new)
        os.replace(new, folder / f"{name}.parquet")
    except OSError as error:
        raise OutputError(f"{error.filename or folder}: cannot be written ({error.strerror})") from None
    finally:
        for path in (lines, new):
            with suppress(OSError):
                path.unlink(missing_ok=True)
