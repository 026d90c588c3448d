"""Parts of a fleet's folder: a journal turned into Parquet files, complete or not there.

A journal `segments/000001.jsonl` becomes the folder `parts/000001`: its files are written to `parts/.000001.new`, which is
renamed when all are on the disk, and then the journal is deleted. A kill before the rename leaves the journal, one after it
the part; `recovered` deletes what is left over. Many parts are merged into one, `parts/000001-000064`, in the same way: once
it is there, the parts that it covers do not count.
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

# A run adds a part, however small: more than these, and reading their files takes longer than merging them.
MAX_PARTS = 64
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
        present = [*made.glob("[0-9]*")]
        for path in present:
            if any(_covers(other, path) for other in present if other != path):
                shutil.rmtree(path)
        left = []
        for path in sorted(segments.glob("[0-9]*.jsonl")):
            if any(_covers(other, path) for other in present):
                path.unlink()
            else:
                left.append(path)
    except OSError as error:
        raise OutputError(f"{error.filename or folder}: cannot be written ({error.strerror})") from None
    return left


def parts(folder: Path) -> list[Path]:
    """The complete parts, in the order in which they were made."""
    return sorted((folder / "parts").glob("[0-9]*"))


def _range(path: Path) -> tuple[int, int]:
    """The journals of which a part, or a journal, holds the outcomes: the first and the last.

    >>> _range(Path("parts/000001-000064")), _range(Path("segments/000003.jsonl"))
    ((1, 64), (3, 3))
    """
    first, _, last = path.stem.partition("-")
    return int(first), int(last or first)


def _covers(part: Path, other: Path) -> bool:
    (first, last), (low, high) = _range(part), _range(other)
    return first <= low and high <= last


def next_segment(folder: Path) -> Path:
    """The name of the next journal."""
    used = [_range(path)[1] for path in (*parts(folder), *(folder / "segments").glob("[0-9]*.jsonl"))]
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


def merged(folder: Path) -> None:
    """Merge the parts into one where they are many.

    Raises:
        OutputError: it cannot be written, such as on a full disk; the parts stay.
    """
    before = parts(folder)
    if len(before) <= MAX_PARTS:
        return
    name = f"{_range(before[0])[0]:06d}-{_range(before[-1])[1]:06d}"
    staged, made = folder / "parts" / f".{name}.new", folder / "parts" / name
    try:
        staged.mkdir()
        with parquet_files.connected(staged) as connection:
            for table, columns in COLUMNS.items():
                if of := files(folder, table):
                    rows = parquet_files.of_files(of, columns)
                    parquet_files.write(connection, f"SELECT * FROM {rows}", staged / f"{table}.parquet")
        parquet_files.sync_folder(staged)
        os.rename(staged, made)
        parquet_files.sync_folder(made.parent)
        for path in before:
            shutil.rmtree(path)
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
