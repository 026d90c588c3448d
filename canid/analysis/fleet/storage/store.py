"""The folder of a fleet: outcomes are appended to a journal, become Parquet files, and are found again by the next run.

    fleet.json       by which the folder is known: version, command, settings, what came of the logs, the tables' columns
    segments/        the journal of outcomes (journal.py)
    parts/           journals turned into Parquet files (parts.py)
    logs.parquet, drives.parquet, ...   the tables of the current plan (consolidated.py, generations.py)

Results are stored by content: under the key of their log's bytes, source and settings, once.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from canid import __version__
from canid.analysis.fleet.job import Outcome, Status
from canid.analysis.fleet.planning.listing import MARK
from canid.analysis.fleet.planning.plan import PlannedLog
from canid.analysis.fleet.storage import generations, journal, lock, parquet_files, parts, typed_rows
from canid.analysis.fleet.storage.columns import TABLES, schema
from canid.analysis.fleet.storage.lock import Lock
from canid.analysis.fleet.storage.outcome_rows import OUTCOMES, Known, identity, known
from canid.io.files import opening
from canid.values.errors import ConfigError, OutputError, system_errors

# grows when a later canid could not read an earlier folder
SCHEMA = 1
# A journal becomes a part after so many outcomes, or bytes: the conversion takes some seconds, and reading a journal of
# 256 MB after a kill as long.
SEGMENT_OUTCOMES = 2_000
SEGMENT_BYTES = 256_000_000


class Store:
    """An open folder; `opened` makes one."""

    def __init__(self, folder: Path, held: Lock, made: Callable[[], object] = lambda: None) -> None:
        """Read what is known; `made` is called after each new part. Raises OutputError."""
        self.folder = folder
        self._made = made
        self.check = held.check  # raises LockError where another run may have begun
        self.by_identity: dict[bytes, Known] = {}
        self.by_key: dict[str, Known] = {}
        journals, self.notes = parts.recovered(folder)  # `notes`: what is in the folder and is not used
        with ExitStack() as ends, system_errors(folder):
            for left in journals:
                ends.callback(left.end)
            for row in parts.outcomes(folder):
                self._know(row)
            for left in journals:
                for block in left.blocks():
                    self._know(block.row)
                parts.sealed(folder, left, self.check)
                left.remove()
        self._forget_without_results()
        self._journal = journal.create(parts.next_segment(folder))

    def _forget_without_results(self) -> None:
        """Forget the outcomes whose rows are in no part: their logs are analysed again."""
        lost = {key for key, outcome in self.by_key.items() if outcome.has_results}
        for key in parts.keys(self.folder):
            lost.discard(key)
        if not lost:
            return
        self.notes.append(
            f"{self.folder}: the results of {len(lost):,} logs are gone; they are analysed again"
        )
        self.by_key = {key: outcome for key, outcome in self.by_key.items() if key not in lost}
        self.by_identity = {
            digest: outcome for digest, outcome in self.by_identity.items() if outcome.key not in lost
        }

    def _know(self, row: Mapping[str, Any]) -> None:
        digest, outcome = known(row)
        self.by_identity[digest] = outcome
        before = self.by_key.get(outcome.key)
        if outcome.key and not (before is not None and before.has_results):
            self.by_key[outcome.key] = outcome

    def add(self, log: PlannedLog, computed: str, outcome: Outcome) -> Known:
        """Store the outcome of one log.

        Args:
            log: the log.
            computed: see `outcome_rows.computed`.
            outcome: of it. Its rows are stored unless its key has results already.

        Raises:
            OutputError: it cannot be written; what was stored before stays.
        """
        digest = identity(log, computed)
        before = self.by_identity.get(digest)
        row = typed_rows.typed(
            {
                "identity": digest.hex(),
                "log": log.log,
                "bytes": log.size,
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
        return self.by_identity[digest]

    def seal(self) -> None:
        """Turn the journal into a part, and begin a new one. Raises OutputError; the journal then stays."""
        self.check()
        before = self._journal
        parts.sealed(self.folder, before, self.check)
        # before the other one is gone: a journal is locked at any time
        self._journal = journal.create(parts.next_segment(self.folder))
        with system_errors(before.path, "deleted"):
            before.remove()
        parts.merged(self.folder, self.check)
        self._made()

    def close(self) -> None:
        """Close the journal; an empty one is deleted. Raises OutputError."""
        self._journal.close()

    def note(self, **values: Any) -> None:
        """Write `fleet.json`. Raises OutputError."""
        note(self.folder, self.check, **values)


@contextmanager
def opened(path: str | Path, made: Callable[[], object] = lambda: None) -> Iterator[Store]:
    """Open the folder of a fleet for one run, or create it.

    Args:
        path: of the folder.
        made: is called after each new part.

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
    with system_errors(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    with lock.held(folder) as held:
        with parquet_files.connected(folder):
            pass  # an installation without DuckDB is noticed before anything is analysed
        if not os.path.exists(folder / MARK):
            note(folder, held.check)
        with system_errors(folder):
            generations.published(folder)
        store = Store(folder, held, made)
        try:
            yield store
        except OutputError:
            held.check()  # where another run works here, that is the reason
            raise
        finally:
            store.close()


def _check(folder: Path) -> None:
    """Refuse a folder that is not a fleet's. Raises OutputError."""
    try:
        names = {*os.listdir(folder)} - {lock.NAME}
        names -= {path.name for path in opening.leftovers(folder / MARK)}
    except FileNotFoundError:
        return
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from None
    if not names:
        return
    try:
        if not os.path.isfile(folder / MARK):
            raise ValueError("not a regular file")
        mark = json.loads((folder / MARK).read_text("utf-8"))
        version = mark["canid_fleet"]
    except (OSError, ValueError, TypeError, KeyError):
        raise OutputError(
            f"{folder}: holds other things than results of canid fleet; name an empty or a new folder with -o"
        ) from None
    if version != SCHEMA:
        raise ConfigError(f"{folder}: was written by canid {mark.get('canid')}; this is {__version__}")


def note(folder: Path, check: Callable[[], object], **values: Any) -> None:
    """Write `fleet.json`: by it the folder is known. Raises OutputError."""
    text = json.dumps({"canid_fleet": SCHEMA, "canid": __version__, **values, "tables": schema()}, indent=1)
    try:
        with opening.replacement(folder / MARK, check) as file:
            file.write(f"{text}\n".encode())
    except OSError as error:
        raise OutputError(f"{folder / MARK}: cannot be written ({error.strerror})") from None
