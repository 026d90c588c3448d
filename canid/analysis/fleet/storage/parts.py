"""Parts of a fleet's folder: a journal turned into Parquet files, complete or not there.

A journal `segments/000001.jsonl` becomes the folder `parts/000001`: its files are written to a private folder in `parts`,
which is renamed when all are on the disk, and then the journal is deleted. A kill before the rename leaves the journal, one
after it the part; `recovered` deletes what is left over. Many parts are merged into one, `parts/000001-000064`, in the same
way. Nothing is deleted unless each of its rows is found in what replaces it. What has another name, or is no part, is left
alone.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from canid.analysis.fleet.storage import journal, parquet_files
from canid.analysis.fleet.storage.columns import TABLES
from canid.analysis.fleet.storage.journal import Journal
from canid.analysis.fleet.storage.outcome_rows import OUTCOMES
from canid.io.files import duckdb_files, opening
from canid.io.files.duckdb_files import Files
from canid.values.errors import OutputError, system_errors

# A run adds a part, however small: more than these, and reading their files takes longer than merging them.
MAX_PARTS = 64
COLUMNS = {journal.LAST: OUTCOMES, **TABLES}
# files of a folder that are no parts and are named to the user; the rest is counted
_MAX_STRAYS = 5
# column with the number of the part that a row comes from
_PART = "_part"
# what a kill leaves in `parts`; earlier versions left names without a random part
_LEFT = re.compile(r"\.[0-9]{6,9}(-[0-9]{6,9})?\.([0-9a-f]{16}\.)?new")


class Recovered(NamedTuple):
    """What a folder holds when it is opened."""

    journals: list[Journal]  # that are no part yet, in order
    notes: list[str]  # what is there and is not used


def recovered(folder: Path) -> Recovered:
    """Delete what an interrupted run left half done, and find its journals.

    Raises:
        LockError: another run works in the folder.
        OutputError: the folder cannot be written, or parts contradict each other; nothing is deleted then.
    """
    segments, made = folder / "segments", folder / "parts"
    left: list[Journal] = []
    with ExitStack() as ends, system_errors(folder):
        for path in (segments, made):
            path.mkdir(exist_ok=True)
            if not stat.S_ISDIR(os.lstat(path).st_mode):
                raise OutputError(
                    f"{path}: is a link; canid fleet writes into folders of its own only: remove it"
                )
        strays = []
        # before anything is deleted: another run may work here
        for path in sorted(segments.iterdir()):
            ended = journal.left(path) if _range(path, ".jsonl") else None
            if ended is not None:
                left.append(ended)
                ends.callback(ended.end)
            elif not path.name.startswith("."):
                strays.append(path)
        _delete_left(folder)
        present = parts(folder)
        strays += [path for path in sorted(made.iterdir()) if path not in present and path.name[0] != "."]
        _check(folder, present)
        present = _without_covered(folder, present)
        journals = [old for old in left if not _is_part(folder, old, present)]
        ends.pop_all()
    notes = [f"{path}: is no result of canid fleet: ignored" for path in strays[:_MAX_STRAYS]]
    if strays[_MAX_STRAYS:]:
        notes.append(f"{folder}: {len(strays[_MAX_STRAYS:]):,} more files like these")
    return Recovered(journals, notes)


def _delete_left(folder: Path) -> None:
    """Delete temporary names of runs that were killed."""
    names = ("fleet.json", "tables", "duckdb")
    leftovers = [path for name in names for path in opening.leftovers(folder / name)]
    leftovers += [path for path in (folder / "parts").iterdir() if _LEFT.fullmatch(path.name)]
    for path in leftovers:
        if stat.S_ISDIR(os.lstat(path).st_mode):
            shutil.rmtree(path)
        else:
            path.unlink()


def parts(folder: Path) -> list[Path]:
    """The complete parts, in the order in which they were made."""
    ranged = [
        (numbers, path)
        for path in (folder / "parts").iterdir()
        if (numbers := _range(path)) and stat.S_ISDIR(os.lstat(path).st_mode) and _file(path, journal.LAST)
    ]
    return [path for _, path in sorted(ranged)]


def _file(part: Path, table: str) -> Path | None:
    path = part / f"{table}.parquet"
    return path if os.path.isfile(path) and not path.is_symlink() else None


def _range(path: Path, suffix: str = "") -> tuple[int, int] | None:
    """The journals of which a part, or a journal, holds the outcomes: the first and the last; None: no name of one.

    >>> _range(Path("parts/000001-000064")), _range(Path("segments/000003.jsonl"), ".jsonl")
    ((1, 64), (3, 3))
    >>> [_range(Path(name)) for name in ("1", "000001 copy", "000003-000001", "000000", "0000001", "000002-000002")]
    [None, None, None, None, None, None]
    """
    match = re.fullmatch(r"([0-9]{6,9})(?:-([0-9]{6,9}))?" + re.escape(suffix), path.name)
    if match is None:
        return None
    first, last = int(match[1]), int(match[2] or match[1])
    if _name(first, last) + suffix != path.name or not 0 < first <= last or (suffix and first != last):
        return None
    return first, last


def _name(first: int, last: int) -> str:
    return f"{first:06d}" if first == last else f"{first:06d}-{last:06d}"


def covers(part: Path, other: Path | Journal) -> bool:
    """Whether the name of a part says that it holds the outcomes of another part, or of a journal."""
    ranges = _range(part), _range(other.path, ".jsonl") if isinstance(other, Journal) else _range(other)
    return all(ranges) and ranges[0][0] <= ranges[1][0] and ranges[1][1] <= ranges[0][1]  # type: ignore[index]


def next_segment(folder: Path) -> Path:
    """The name of the next journal."""
    segments = folder / "segments"
    used = [_range(path) for path in parts(folder)] + [_range(path, ".jsonl") for path in segments.iterdir()]
    number = max((numbers[1] for numbers in used if numbers), default=0) + 1
    while os.path.lexists(folder / "parts" / _name(number, number)):  # a stray
        number += 1
    return segments / f"{_name(number, number)}.jsonl"


def sealed(folder: Path, segment: Journal, check: Callable[[], object]) -> None:
    """Turn the whole blocks of a journal into a part; the journal stays for its owner to remove.

    Args:
        folder: of the fleet.
        segment: the journal.
        check: is called just before the part gets its name; raises where it must not.

    Raises:
        OutputError: it cannot be written, such as on a full disk.
    """
    if segment.size == 0:
        return
    made = folder / "parts" / segment.path.stem
    with _made(made, check) as staged:
        _write(segment, staged)


def merged(folder: Path, check: Callable[[], object]) -> None:
    """Merge the parts into one where they are many.

    Args:
        folder: of the fleet.
        check: see `sealed`.

    Raises:
        OutputError: it cannot be written, such as on a full disk; the parts stay.
    """
    before = parts(folder)
    ranges = [numbers for path in before if (numbers := _range(path))]
    if len(before) <= MAX_PARTS:
        return
    made = folder / "parts" / _name(ranges[0][0], ranges[-1][1])
    # a stray has the name, or a part holds files of a newer canid, which would be lost
    if os.path.lexists(made) or any(map(_foreign, before)):
        return
    with _made(made, check) as staged:
        with parquet_files.connected(folder) as connection:
            for table in COLUMNS:
                if any(_file(part, table) for part in before):
                    path = staged / f"{table}.parquet"
                    with duckdb_files.opened() as files:
                        parquet_files.write(connection, f"SELECT * FROM {rows(files, before, table)}", path)
        if why := _lacking(staged, before):
            raise OutputError(f"{folder}: its parts cannot be merged: {why}")
    _delete(before)


@contextmanager
def _made(made: Path, check: Callable[[], object]) -> Iterator[Path]:
    """A folder in which a part is written; it gets its name when it is left without an error. Raises OutputError."""
    with system_errors(made):
        with opening.private_folder(made) as staged:
            yield staged
            opening.sync_folder(staged)
            # its name is no secret any more, and others may read it as they may the folder
            staged.chmod(stat.S_IMODE(os.stat(made.parent).st_mode))
            check()
            os.rename(staged, made)
        opening.sync_folder(made.parent)


def _write(segment: Journal, staged: Path) -> None:
    """Write the Parquet files of a journal. Raises OSError, and OutputError where they do not hold all rows."""
    counts = _split(segment, staged)
    with parquet_files.connected(segment.path.parents[1]) as connection:
        for name, count in counts.items():
            lines, path = staged / f"{name}.jsonl", staged / f"{name}.parquet"
            with duckdb_files.opened() as files:
                parquet_files.write(
                    connection, f"SELECT * FROM {parquet_files.of_lines(files, lines, COLUMNS[name])}", path
                )
                written = parquet_files.of_files(files, [path], COLUMNS[name])
                if parquet_files.count(connection, written) != count:
                    raise OutputError(
                        f"{segment.path}: cannot be turned into a part: rows of {name} are missing"
                    )
            lines.unlink()


def _split(segment: Journal, staged: Path) -> dict[str, int]:
    """Write the rows of each table into a file of its own; returns how many the tables have that have some."""
    counts: dict[str, int] = {}
    with ExitStack() as stack:
        files: dict[str, BinaryIO] = {}
        for name, row in segment.rows():
            if name not in COLUMNS:  # of a newer canid
                continue
            if name not in files:
                files[name] = stack.enter_context(opening.create_file(staged / f"{name}.jsonl"))
            files[name].write(row + b"\n")
            counts[name] = counts.get(name, 0) + 1
    return counts


def _check(folder: Path, present: Sequence[Path]) -> None:
    """Raise OutputError where a file of a part cannot be read."""
    with parquet_files.connected(folder) as connection:
        for part in present:
            for table in COLUMNS:
                path = _file(part, table)
                if path is not None and (why := parquet_files.unreadable(connection, path)):
                    raise OutputError(
                        f"{path}: cannot be read ({why}); move {part} out of the folder: {_GO_ON}"
                    )


_GO_ON = "nothing was deleted, and the same command then goes on"


def _without_covered(folder: Path, present: Sequence[Path]) -> list[Path]:
    """Delete the parts of which another one holds all rows; returns those that stay."""
    left = list(present)
    for cover in present:
        covered = [other for other in left if other != cover and covers(cover, other)]
        if not covered or cover not in left:
            continue
        if why := _lacking(cover, covered):
            raise OutputError(
                f"{cover}: stands for other parts, but {why}; move it out of the folder: {_GO_ON}"
            )
        _delete(covered)
        left = [path for path in left if path not in covered]
    for earlier, other in pairwise(left):
        if _range(other)[0] <= _range(earlier)[1]:  # type: ignore[index]
            raise OutputError(
                f"{earlier}: holds some of the journals of {other.name} as well; move one away: {_GO_ON}"
            )
    return left


def _is_part(folder: Path, left: Journal, present: Sequence[Path]) -> bool:
    """Whether a part holds all rows of a journal, which is deleted then. Raises OutputError where it has but some."""
    for part in present:
        if covers(part, left):
            for _ in left.blocks():
                pass
            with opening.private_folder(folder / "tables") as staged:
                _write(left, staged)
                if why := _lacking(part, [staged]):
                    raise OutputError(
                        f"{part}: stands for {left.path}, but {why}; move it out of the folder: {_GO_ON}"
                    )
            left.remove()
            return True
    return False


def _lacking(cover: Path, covered: Sequence[Path]) -> str:
    """What a part does not hold of others; "": it holds all their rows, and can be read."""
    if foreign := next(filter(None, map(_foreign, covered)), None):
        return f"{foreign} is no table"
    with parquet_files.connected(cover.parents[1]) as connection:
        for table, columns in COLUMNS.items():
            with duckdb_files.opened() as files:
                paths = [path] if (path := _file(cover, table)) else []
                among = parquet_files.of_files(files, paths, columns)
                if lost := parquet_files.missing(connection, rows(files, covered, table), among):
                    return f"{lost:,} rows of {table} are not in it"
    return ""


def _foreign(part: Path) -> Path | None:
    """Something in a part that is none of its tables."""
    known = {f"{table}.parquet" for table in COLUMNS}
    return next(
        (path for path in sorted(part.iterdir()) if path.name not in known or not os.path.isfile(path)), None
    )


def _delete(covered: Sequence[Path]) -> None:
    """Delete parts: first all names, so that no kill leaves half a part. Raises OutputError."""
    with system_errors("parts", "deleted"):
        gone = [path.rename(opening.temporary_name(path)) for path in covered]
        for path in gone:
            shutil.rmtree(path)


def outcomes(folder: Path) -> Iterator[dict[str, Any]]:
    """The outcomes of all parts, in their order.

    Raises:
        OutputError: a part cannot be read.
    """
    names = [column.name for column in OUTCOMES]
    for row in _fetched(folder, journal.LAST, names):
        yield dict(zip(names, row, strict=True))


def keys(folder: Path) -> Iterator[str]:
    """The keys for which parts hold a drive. Raises OutputError."""
    for (key,) in _fetched(folder, "drives", ["key"]):
        yield key


def content_bytes(connection: Any, present: Sequence[Path], table: str) -> int:
    """Bytes of a table in parts, without compression."""
    paths = [path for part in present if (path := _file(part, table))]
    if not paths:
        return 0
    with duckdb_files.opened() as files:
        sizes = duckdb_files.parquet_sizes([files.add(path) for path in paths])
        sql = f"SELECT sum(total_uncompressed_size)::BIGINT FROM {sizes}"
        number: int = connection.execute(sql).fetchone()[0] or 0
    return number


def _fetched(folder: Path, table: str, names: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    paths = [path for part in parts(folder) if (path := _file(part, table))]
    if not paths:
        return
    with duckdb_files.opened() as files, parquet_files.connected(folder, "read") as connection:
        chosen = ", ".join(map(parquet_files.name, names))
        connection.execute(f"SELECT {chosen} FROM {parquet_files.of_files(files, paths, COLUMNS[table])}")
        # rows at a time: memory stays that of what is known
        while fetched := connection.fetchmany(10_000):
            yield from fetched


def rows(files: Files, present: Sequence[Path], table: str) -> str:
    """SQL for the rows of a table in parts: the results of a key are those of the first part that holds its drive.

    So a part that somebody has copied counts nothing twice, and one that has lost its drives leaves no rows of theirs.
    """
    if table == journal.LAST:
        paths = [path for part in present if (path := _file(part, table))]
        return parquet_files.of_files(files, paths, OUTCOMES)

    def numbered(name: str, chosen: str) -> str:
        paths = ((number, path) for number, part in enumerate(present) if (path := _file(part, name)))
        columns = COLUMNS[name]
        nothing = f"SELECT {chosen}, 0 AS {_PART} FROM {parquet_files.of_files(files, [], columns)}"
        each = (
            f"SELECT {chosen}, {n} AS {_PART} FROM {parquet_files.of_files(files, [path], columns)}"
            for n, path in paths
        )
        return " UNION ALL ".join((nothing, *each))

    first = f"SELECT key, min({_PART}) AS {_PART} FROM ({numbered('drives', 'key')}) GROUP BY key"
    return (
        f"(SELECT * EXCLUDE ({_PART}) FROM ({numbered(table, '*')}) SEMI JOIN ({first}) USING (key, {_PART}))"
    )
