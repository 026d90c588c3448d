"""The folder of a fleet: outcomes are appended to a journal, become Parquet files, and are found again by the next run.

    fleet.json       by which the folder is known: version, command, settings, what came of the logs
    segments/        the journal of outcomes (journal.py)
    parts/           journals turned into Parquet files (parts.py)
    logs.parquet, drives.parquet, ...   the tables of the current plan (consolidated.py)

Results are stored by content: under the key of their log's bytes, source and settings, once.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from canid import __version__
from canid.errors import ConfigError, OutputError
from canid.fleet import journal, lock, parquet_files, parts, typed_rows
from canid.fleet.columns import TABLES
from canid.fleet.job import Outcome, Status
from canid.fleet.journal import Journal
from canid.fleet.listing import MARK
from canid.fleet.outcome_rows import OUTCOMES, Known, identity, known
from canid.fleet.plan import PlannedLog

# grows when a later canid could not read an earlier folder
SCHEMA = 1
# A journal becomes a part after so many outcomes, or bytes: the conversion takes some seconds, and reading a journal of
# 256 MB after a kill as long.
SEGMENT_OUTCOMES = 2_000
SEGMENT_BYTES = 256_000_000


class Store:
    """An open folder; `opened` makes one."""

    def __init__(self, folder: Path) -> None:
        """Read what is known. Raises OutputError."""
        self.folder = folder
        self.by_identity: dict[bytes, Known] = {}
        self.by_key: dict[str, Known] = {}
        left = parts.recovered(folder)
        for row in parts.outcomes(folder):
            self._know(row)
        ends = {path: self._know_journal(path) for path in left}
        # one journal at most is left, but for those of a run that could not write parts
        for path in left[:-1]:
            parts.sealed(folder, path, ends[path])
        path = left[-1] if left else parts.next_segment(folder)
        self._journal = Journal(path, ends.get(path, 0))

    def _know(self, row: Mapping[str, Any]) -> None:
        of, one = known(row)
        self.by_identity[of] = one
        before = self.by_key.get(one.key)
        if one.key and not (before is not None and before.has_results):
            self.by_key[one.key] = one

    def _know_journal(self, path: Path) -> int:
        end = 0
        for block in journal.blocks(path):
            self._know(block.row)
            end = block.end
        return end

    def add(self, one: PlannedLog, computed: str, outcome: Outcome) -> Known:
        """Store the outcome of one log.

        Args:
            one: the log.
            computed: see `outcome_rows.computed`.
            outcome: of it. Its rows are stored unless its key has results already.

        Raises:
            OutputError: it cannot be written; what was stored before stays.
        """
        of = identity(one, computed)
        before = self.by_identity.get(of)
        row = typed_rows.typed(
            {
                "identity": of.hex(),
                "log": one.log,
                "bytes": one.size,
                "key": outcome.key,
                "status": outcome.status.value,
                "failure": outcome.failure.value,
                "reason": outcome.reason,
                "analysed_utc": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
                "attempts": 1 + (before.attempts if before is not None else 0),
            },
            OUTCOMES,
        )
        stored = self.by_key.get(outcome.key)
        rows: list[bytes] = []
        if outcome.status is not Status.FAILED and not (stored is not None and stored.has_results):
            for name, columns in TABLES.items():
                for each in outcome.tables.get(name, ()):
                    made = typed_rows.typed({**each, "key": outcome.key}, columns)
                    rows.append(typed_rows.line(name, made))
        self._journal.append(rows, row)
        self._know(row)
        if self._journal.outcomes >= SEGMENT_OUTCOMES or self._journal.size >= SEGMENT_BYTES:
            self.seal()
        return self.by_identity[of]

    def seal(self) -> None:
        """Turn the journal into a part, and begin a new one. Raises OutputError; the journal then stays."""
        self._journal.close()
        parts.sealed(self.folder, self._journal.path, self._journal.size)
        parts.merged(self.folder)
        self._journal = Journal(parts.next_segment(self.folder), 0)

    def close(self) -> None:
        """Close the journal; an empty one is deleted. Raises OutputError."""
        self._journal.close()
        if self._journal.size == 0:
            with suppress(OSError):
                self._journal.path.unlink()

    def note(self, **values: Any) -> None:
        """Write `fleet.json`. Raises OutputError."""
        note(self.folder, **values)


@contextmanager
def opened(path: str | Path) -> Iterator[Store]:
    """Open the folder of a fleet for one run, or create it.

    Raises:
        ConfigError: DuckDB is not installed.
        OutputError: the folder holds other things, another run writes into it, or it cannot be written.

    Example:
        >>> import tempfile
        >>> with opened(Path(tempfile.mkdtemp()) / "fleet") as store:
        ...     store.note()
        ...     sorted(file.name for file in store.folder.iterdir())
        ['fleet.json', 'fleet.lock', 'parts', 'segments']
    """
    folder = Path(path)
    if typed_rows.text(folder) != str(folder):
        raise ConfigError(f"{folder}: DuckDB cannot open files in a folder of this name; choose another one")
    _check(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made ({error.strerror})") from None
    with lock.held(folder):
        with parquet_files.connected(folder):
            pass  # an installation without DuckDB is noticed before anything is analysed
        if not (folder / MARK).exists():
            note(folder)
        store = Store(folder)
        try:
            yield store
        finally:
            store.close()


def _check(folder: Path) -> None:
    """Refuse a folder that is not a fleet's. Raises OutputError."""
    try:
        names = set(os.listdir(folder)) - {lock.NAME, f".{MARK}.new"}
    except FileNotFoundError:
        return
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from None
    if not names:
        return
    try:
        found = json.loads((folder / MARK).read_text("utf-8"))
        version = found["canid_fleet"]
    except (OSError, ValueError, TypeError, KeyError):
        raise OutputError(
            f"{folder}: holds other things than results of canid fleet; name an empty or a new folder with -o"
        ) from None
    if version != SCHEMA:
        raise ConfigError(f"{folder}: was written by canid {found.get('canid')}; this is {__version__}")


def note(folder: Path, **values: Any) -> None:
    """Write `fleet.json`: by it the folder is known. Raises OutputError."""
    new = folder / f".{MARK}.new"
    text = json.dumps({"canid_fleet": SCHEMA, "canid": __version__, **values}, indent=1)
    try:
        with new.open("w", encoding="utf-8") as file:
            file.write(text + "\n")
            file.flush()
            os.fsync(file.fileno())
        os.replace(new, folder / MARK)
        parquet_files.sync_folder(folder)
    except OSError as error:
        with suppress(OSError):
            new.unlink()
        raise OutputError(f"{folder / MARK}: cannot be written ({error.strerror})") from None
