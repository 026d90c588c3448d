"""Generations of a fleet's tables: each carries the hash of what it was made from, and a reader has those of one run.

A run writes its tables into `.tables.RANDOM.new`, which is renamed to `.tables.complete` when all are on the disk: from then
on they count. Then each is renamed into the folder, `logs` last. A reader opens each table there first and in the folder
then, where a rename takes it. It has a generation whole where all of them carry the same hash; after a kill too, since the
next run goes on with the renames. What was pooled from a generation (`columns.SUMMARIES`) carries its hash, and is not read
with another one. The hash is of the content: neither times nor the order of writing decide.
"""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from canid.analysis.fleet.planning.listing import MARK
from canid.analysis.fleet.storage.columns import SUMMARIES, TABLES
from canid.analysis.fleet.storage.parquet_files import NEEDS_DUCKDB
from canid.io.files import duckdb_files, opening
from canid.io.files.duckdb_files import Files, OpenFile
from canid.values.errors import ConfigError, DamagedLogError, one_line

# the text of a Parquet file that names the generation
NOTE = "canid_generation"
# complete tables that have not got their names in the folder yet
PENDING = ".tables.complete"
NEEDED = ("logs", "drives")
# of a run, in the order in which a reader opens them: one that has `logs` and `drives` finds the others of theirs
OF_A_RUN = (*NEEDED, *(name for name in TABLES if name not in NEEDED))
# pooled from all drives; joint findings have keys of their own, of the drives that were diagnosed together
POOLED = tuple(name for name in SUMMARIES if name != "joint_findings")
# s; renames take some milliseconds, on a slow disk more
_PATIENCE_S, _WAIT_S = 10.0, 0.02


class Tables(NamedTuple):
    """The tables of one generation, open; one that is missing has no rows yet."""

    generation: str
    files: Mapping[str, OpenFile]

    def has_pooled(self) -> bool:
        """Whether what is pooled was pooled from these tables."""
        return all(name in self.files for name in POOLED)


def opened(db: Any, files: Files, folder: Path) -> Tables:
    """Open the tables of one generation; those that a run replaces meanwhile stay what they were.

    Args:
        db: a connection of DuckDB.
        files: that the tables are added to.
        folder: of the fleet.

    Raises:
        ConfigError: it is no folder of canid fleet.
        DamagedLogError: a table cannot be read, or those of one generation are not all there.
    """
    until = time.monotonic() + _PATIENCE_S
    while True:
        tables = _once(db, files, folder)
        if tables is not None:
            return tables
        files.close()
        if time.monotonic() > until:
            raise DamagedLogError(
                f"{folder}: its tables are of several runs of canid fleet; run `canid fleet` on the folder again"
            )
        time.sleep(_WAIT_S)


def is_folder(folder: str | Path) -> bool:
    """Has canid fleet written the tables of a folder?

    Example:
        >>> is_folder("replay_logs")
        False
    """
    places = (Path(folder) / PENDING, Path(folder))
    return all(any(os.path.isfile(place / f"{name}.parquet") for place in places) for name in NEEDED)


def not_a_folder(folder: str | Path) -> ConfigError:
    """The error for a folder without the tables: of none, or of a run that has not ended."""
    if os.path.isfile(Path(folder) / MARK):
        return ConfigError(
            f"{folder}: has no tables yet: canid fleet is at work there, or was interrupted; run its command again, which "
            f"goes on where it was ({MARK} holds it)"
        )
    return ConfigError(
        f"{folder}: is no folder of canid fleet (logs.parquet and drives.parquet are missing); "
        "`canid fleet LOGS... -o DIR` writes one"
    )


def current(folder: Path) -> str:
    """The generation that a folder holds now; "": none that is whole. Takes no time for what is being written."""
    with duckdb_files.connected(*NEEDS_DUCKDB) as db, duckdb_files.opened() as files:
        try:
            tables = _once(db, files, folder)
        except (ConfigError, DamagedLogError):
            return ""
        return "" if tables is None else tables.generation


def are_whole(folder: Path, made: Path) -> bool:
    """Whether tables of another folder are, with those of this one that they do not replace, of one generation."""
    with duckdb_files.connected(*NEEDS_DUCKDB) as db, duckdb_files.opened() as files:
        try:
            return _once(db, files, folder, made) is not None
        except (ConfigError, DamagedLogError):
            return False


def _once(db: Any, files: Files, folder: Path, made: Path | None = None) -> Tables | None:
    """Open the tables that are there, those of another folder first; None: they are of several generations."""
    tables: dict[str, OpenFile] = {}
    try:
        for name in (*OF_A_RUN, *SUMMARIES):
            file = _file(files, folder, made or folder / PENDING, name)
            if file is not None:
                tables[name] = file
        if not all(name in tables for name in NEEDED):
            raise not_a_folder(folder)
        noted = _noted(db, tables)
        run = {noted.get(name, "") for name in OF_A_RUN if name in tables}
        if len(run) != 1:
            return None
        (generation,) = run
        # an earlier canid noted none
        generation = generation or f"{tables['logs'].sha256()} {tables['drives'].sha256()}"
    except OSError as error:
        raise _damaged(error.filename or folder, str(error.strerror)) from None
    other = [name for name in POOLED if noted.get(name) != generation]
    return Tables(generation, {name: file for name, file in tables.items() if name not in other})


def _file(files: Files, folder: Path, newest: Path, name: str) -> OpenFile | None:
    for place in (folder,) if newest.is_symlink() else (newest, folder):
        with suppress(FileNotFoundError, NotADirectoryError):
            return files.add(place / f"{name}.parquet")
    return None


def _noted(db: Any, tables: Mapping[str, OpenFile]) -> dict[str, str]:
    """The generations that tables name. Raises DamagedLogError where one cannot be read."""
    import duckdb

    out = {}
    for name, file in tables.items():
        query = f"SELECT value FROM {duckdb_files.parquet_notes([file])} WHERE key = ?"
        try:
            rows = db.execute(query, [NOTE.encode()]).fetchall()
        except duckdb.Error as error:
            raise _damaged(file.path, one_line(Exception(str(error).partition("\n")[0]))) from None
        if rows:
            out[name] = bytes(rows[0][0]).decode("utf-8", "replace")
    return out


def _damaged(path: str | Path, why: str) -> DamagedLogError:
    return DamagedLogError(f"{path}: cannot be read ({why}); run `canid fleet` on the folder again")


def notes(generation: str) -> dict[str, str]:
    """What a table of a generation carries."""
    return {NOTE: generation}


def written(folder: Path, made: Path, check: Callable[[], object]) -> None:
    """Make tables that are complete, in a private folder, those of the fleet.

    Args:
        folder: of the fleet, whose lock is held.
        made: the private folder; its Parquet files are on the disk.
        check: is called before they count; raises where they must not.

    Raises:
        OSError: they cannot be renamed.
    """
    opening.sync_folder(made)
    # its name is no secret any more, and others may read it as they may the folder
    made.chmod(stat.S_IMODE(os.stat(folder).st_mode))
    check()
    os.rename(made, folder / PENDING)
    opening.sync_folder(folder)
    published(folder)


def published(folder: Path) -> None:
    """Give the tables that count their names in the folder, whose lock is held; also after a kill. Raises OSError."""
    pending = folder / PENDING
    try:
        if not stat.S_ISDIR(os.lstat(pending).st_mode):
            return
    except FileNotFoundError:
        return
    # what was pooled from others is of no use to whom reads the files themselves
    if any(os.path.lexists(pending / f"{name}.parquet") for name in TABLES):
        for name in POOLED:
            if not os.path.lexists(pending / f"{name}.parquet"):
                (folder / f"{name}.parquet").unlink(missing_ok=True)
    # `logs` last, when the others are on the disk: by it the next run sees whether they are current
    for name in (*TABLES, *SUMMARIES, "logs"):
        with suppress(FileNotFoundError):
            os.replace(pending / f"{name}.parquet", folder / f"{name}.parquet")
    opening.sync_folder(folder)
    with suppress(OSError):  # a stranger's file in it
        pending.rmdir()
