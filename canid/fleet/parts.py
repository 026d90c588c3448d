"""Parts of a fleet's folder: a journal turned into Parquet files, complete or not there.

A journal `segments/000001.jsonl` becomes the folder `parts/000001`: its files are written to `parts/.000001.new`, which is
renamed when all are on the disk, and then the journal is deleted. A kill before the rename leaves the journal, one after it
the part; `recovered` deletes what is left over.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, BinaryIO

from canid.errors import OutputError
from canid.fleet import journal, parquet_files
from canid.fleet.columns import TABLES
from canid.fleet.outcome_rows import OUTCOMES

COLUMNS = {journal.LAST: OUTCOMES, **TABLES}


def recovered(folder: Path) -> list[Path]:
    """Delete what an interrupted run left half done; returns the journals that are no part yet, in order.

    Raises:
        OutputError: the folder cannot be written.
    """
    segments, made = folder / "segments", folder / "parts"
    try:
        segments.mkdir(exist_ok=True)
        made.mkdir(exist_ok=True)
        for staged in made.glob(".*.new"):
            shutil.rmtree(staged)
        left = []
        for path in sorted(segments.glob("[0-9]*.jsonl")):
            if (made / path.stem).exists():
                path.unlink()
            else:
                left.append(path)
    except OSError as error:
        raise OutputError(f"{error.filename or folder}: cannot be written ({error.strerror})") from None
    return left


def parts(folder: Path) -> list[Path]:
    """The complete parts, in the order in which they were made."""
    return sorted((folder / "parts").glob("[0-9]*"))


def next_segment(folder: Path) -> Path:
    """The name of the next journal."""
    used = [int(path.stem) for path in (*parts(folder), *(folder / "segments").glob("[0-9]*.jsonl"))]
    return folder / "segments" / f"{max(used, default=0) + 1:06d}.jsonl"


def sealed(folder: Path, segment: Path, end: int) -> None:
    """Turn a journal, up to a byte, into a part.

    Raises:
        OutputError: it cannot be written, such as on a full disk; the journal stays.
    """
    if end == 0:
        segment.unlink(missing_ok=True)
        return
    staged, made = folder / "parts" / f".{segment.stem}.new", folder / "parts" / segment.stem
    try:
        staged.mkdir()
        names = _split(segment, end, staged)
        with parquet_files.connected(staged) as connection:
            for name in names:
                lines = staged / f"{name}.jsonl"
                rows = parquet_files.of_lines(lines, COLUMNS[name])
                parquet_files.write(connection, f"SELECT * FROM {rows}", staged / f"{name}.parquet")
                lines.unlink()
        parquet_files.sync_folder(staged)
        os.rename(staged, made)
        parquet_files.sync_folder(made.parent)
        segment.unlink()
    except OSError as error:
        raise OutputError(f"{error.filename or made}: cannot be written ({error.strerror})") from None
    finally:
        if staged.exists():
            with suppress(OSError):
                shutil.rmtree(staged)


def _split(segment: Path, end: int, staged: Path) -> list[str]:
    """Write the rows of each table into a file of its own; returns the tables that have some."""
    with ExitStack() as stack:
        files: dict[str, BinaryIO] = {}
        for name, row in journal.rows(segment, end):
            if name not in COLUMNS:  # of a newer canid
                continue
            if name not in files:
                files[name] = stack.enter_context((staged / f"{name}.jsonl").open("xb"))
            files[name].write(row + b"\n")
        return list(files)


def outcomes(folder: Path) -> Iterator[dict[str, Any]]:
    """The outcomes of all parts, in their order.

    Raises:
        OutputError: a part cannot be read.
    """
    files = [part / f"{journal.LAST}.parquet" for part in parts(folder)]
    if not files:
        return
    with parquet_files.connected(folder) as connection:
        connection.execute(f"SELECT * FROM {parquet_files.of_files(files, OUTCOMES)}")
        names = [column.name for column in OUTCOMES]
        # rows at a time: memory stays that of what is known
        while rows := connection.fetchmany(10_000):
            for row in rows:
                yield dict(zip(names, row, strict=True))


def files(folder: Path, table: str) -> list[Path]:
    """The files of a table in all parts."""
    return [path for part in parts(folder) if (path := part / f"{table}.parquet").exists()]
