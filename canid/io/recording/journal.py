"""Events of a recording, one JSON object per line: `drive.blf` has `drive.events.jsonl`."""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import NamedTuple

from canid.io.files import derived_name, file_location
from canid.io.files.held_folder import HeldFolder
from canid.io.logs.formats import log_suffix
from canid.values import timestamps
from canid.values.types import Event

# s that ending waits for a journal that is not written
PATIENCE_S = 1.0
# s between two checks of whether the file is still there
FILE_CHECK_S = 0.4
# names that are tried where a file of another program has the journal's own
_MAX_NAMES = 100
# bytes of events that wait for a disk that takes none
_MAX_CARRIED_BYTES = 1 << 20
# Every line of a journal begins so; nothing is appended to a file that begins otherwise.
_BEGINNING = b'{"t": '


def journal_path(log: Path) -> Path:
    """Name the journal of a log.

    >>> journal_path(Path("a/drive-2.blf")).name
    'drive-2.events.jsonl'
    """
    suffix = log_suffix(log)
    return derived_name.sibling(log, log.name[: len(log.name) - len(suffix)], ".events.jsonl")


class Target(NamedTuple):
    """The file that events of a time belong into."""

    path: Path
    folder: HeldFolder | None  # in which its name is; None: what its path leads to


class Journal:
    """Appends events; the file begins with the first one. Any thread may write; nothing is ever raised.

    A thread of its own writes it, so that it may fail or block at any time. A file that is deleted before
    `close` comes back whole. Where another file has its name, the journal is `drive.events-2.jsonl`, ...
    """

    def __init__(
        self,
        log: Path | None,
        report: Callable[[str, str], object] = lambda what, says: None,
    ):
        """`log`: whose events they are; None: events go nowhere. `report(what, says)` takes those of the journal itself."""
        self.path = None if log is None else journal_path(log)
        self._report = report
        # called in the writing thread with every file that is new: folder, name and descriptor
        self.created: Callable[[HeldFolder, str, int], object] = lambda folder, name, fd: None
        self._zero = 0.0  # s, session time at which the log's own time begins
        self._lock = threading.Lock()
        self._folder: HeldFolder | None = None  # of `path`
        # lines; without one: the file is left for this one, and nothing is written yet; None: the end
        self._lines: SimpleQueue[tuple[Target, bytes | None] | None] = SimpleQueue()
        self._given = 0  # lines put into the queue
        self._done = 0  # lines that were written, or could not be
        self._failed = 0
        self._thread: threading.Thread | None = None
        self._closed = False
        self._blocked = False  # the wait for it was given up
        # the writing thread's own
        self._wanted: Target | None = None  # the name that the open file should have
        self._fd = -1
        self._size = 0
        self._path = Path()
        self._held: HeldFolder | None = None  # of the open file
        self._resumed: list[
            tuple[HeldFolder, str]
        ] = []  # where it was last, for events that come after `close`
        self._findable = True
        self._new = False  # created, and nothing written yet
        self._carried = b""  # lines of a file that was deleted, or that the disk did not take
        self._checked = threading.Event()  # set: the file was checked since `close`

    @property
    def failed(self) -> int:
        """Events that are not in the file; once the journal is closed, also those whose wait was given up."""
        carried = self._carried.count(b"\n") if self._closed else 0
        return self._failed + carried + (self._given - self._done if self._blocked else 0)

    def follow(self, log: Path, zero: float, folder: HeldFolder | None = None) -> None:
        """The recording goes on in this log, whose own time begins at `zero` s; `folder`: of the log."""
        with self._lock:
            self.path, self._zero, self._folder = journal_path(log), zero, folder
            if self._thread is not None:
                self._lines.put((Target(self.path, folder), None))

    def in_use(self) -> frozenset[str]:
        """Names of the files into which events come now or next."""
        with self._lock:
            wanted = () if self.path is None else (self.path.name,)
        return frozenset((*wanted, self._path.name) if self._fd >= 0 else wanted)

    def write(self, event: Event, start_ns: int | None) -> None:
        """Append an event. `start_ns`: epoch ns of its t = 0."""
        utc = None if start_ns is None else timestamps.epoch_seconds(start_ns + round(event.t * 1e9))
        with self._lock:
            if self.path is None:
                return
            fields = {"t": event.t - self._zero, "utc": utc, "what": event.what, "says": event.says}
            # a lone surrogate (an undecodable byte of a file name) has no UTF-8
            line = (json.dumps(fields, ensure_ascii=False) + "\n").encode("utf-8", "backslashreplace")
            self._given += 1
            self._lines.put((Target(self.path, self._folder), line))
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="canid-journal", daemon=True)
                self._thread.start()
            closed = self._closed
            if closed:
                self._lines.put(None)
        if closed and threading.current_thread() is not self._thread:
            self._wait()

    def close(self) -> None:
        """Wait until the events so far are written, at most `PATIENCE_S`; the thread ends.

        Later events are waited for as well.
        """
        with self._lock:
            self._closed = True
            if self._thread is None:
                return
            self._lines.put(None)
        self._wait()

    def _wait(self) -> None:
        end = time.monotonic() + PATIENCE_S
        while self._done < self._given or not self._checked.is_set():
            if self._blocked or time.monotonic() > end:
                self._blocked = True
                return
            time.sleep(0.005)
        self._blocked = False

    # --- writing: one thread ---

    def _run(self) -> None:
        while True:
            try:
                item = self._lines.get(timeout=FILE_CHECK_S)
            except Empty:
                self._check()
                continue
            if item is None:
                self._check()
                self._leave()
                with self._lock:
                    ends = self._lines.empty()
                    if ends:
                        self._thread = None
                    self._checked.set()
                if ends:
                    return
                continue
            wanted, line = item
            if line is None:
                self._turn_to(wanted)
                continue
            try:
                self._append(wanted, line)
            except (OSError, ValueError):
                self._carry(line)
            finally:
                self._done += 1

    def _turn_to(self, wanted: Target) -> None:
        """Leave a file for another one: a log that is finished may be deleted, and its journal with it."""
        if wanted != self._wanted:
            self._leave()
            self._wanted = wanted
            self._resumed = []

    def _append(self, wanted: Target, line: bytes) -> None:
        self._turn_to(wanted)
        if self._fd < 0:
            self._open(wanted)
        else:
            self._check()
        self._put_carried()
        self._put(line)
        if self._new:
            self._new = False
            assert self._held is not None
            self.created(self._held, self._path.name, self._fd)

    def _carry(self, line: bytes) -> None:
        """Keep a line that the disk did not take: it is tried again with the next one, and once a while."""
        if len(self._carried) + len(line) > _MAX_CARRIED_BYTES:
            self._failed += 1
        else:
            self._carried += line

    def _put_carried(self) -> None:
        if self._carried:
            self._put(self._carried)
            self._carried = b""

    def _put(self, data: bytes) -> None:
        """Append whole lines: what a full disk took in part is cut off."""
        done = 0
        try:
            while done < len(data):
                done += os.write(self._fd, data[done:])
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._fd, self._size)
            raise
        self._size += done

    def _open(self, wanted: Target) -> None:
        folder = wanted.folder or HeldFolder(wanted.path.parent)
        if not folder.usable:
            raise OSError(f"{folder.path} is gone")
        resumed = [(held, name) for held, name in self._resumed if held.usable and held.has(name)]
        for held, name in [*resumed, *((folder, path.name) for path in _candidates(wanted.path))]:
            opened = _open_own(held, name)
            if opened is None:
                continue
            self._fd, new = opened
            self._size = os.fstat(self._fd).st_size
            self._path, self._held = held.path / name, held
            self._new = new
            # where inode numbers do not last, its deletion cannot be detected
            self._findable = held.names(name, os.fstat(self._fd))
            self._resumed = [(held, name)]
            if not new and not _ends_with_newline(self._fd, self._size):
                self._put(b"\n")  # a killed process left half a line
            self._put_carried()
            if name != wanted.path.name and (held, name) not in resumed:
                self._report(
                    "journal_elsewhere",
                    f"{wanted.path.name} is another program's file: events are written to {name}",
                )
            return
        raise OSError("no name is free")

    def _check(self) -> None:
        """Rewrite the file where it was deleted; follow it where it was moved."""
        try:
            if self._fd < 0:
                if self._carried and self._wanted is not None:
                    self._open(self._wanted)
                return
            self._put_carried()
            if not self._findable:
                return
            assert self._held is not None
            where = file_location.find(self._fd, self._path, self._held)
            if where.place is file_location.Place.MOVED:
                if not self._held.names(where.path.name, os.fstat(self._fd)):
                    self._held = HeldFolder(where.path.parent)
                self._path = where.path
                self._resumed = [(self._held, where.path.name)]
            if where.lost:
                self._rewrite(where.place.value)
            elif os.fstat(self._fd).st_size < self._size:
                self._size = os.fstat(self._fd).st_size
                self._failed += 1
                says = f"{self._path.name} was truncated by another program: events before this one are lost"
                self._report("journal_truncated", says)
        except OSError:
            pass  # what is carried is tried again, and counted

    def _rewrite(self, why: str) -> None:
        assert self._wanted is not None
        self._resumed = []
        name, old = self._path.name, self._fd
        self._fd = -1
        try:
            self._carried = os.pread(old, self._size, 0) + self._carried
        finally:
            os.close(old)
        self._open(self._wanted)
        self._report("journal_restored", f"{name} {why}: its events are in {self._path}")

    def _leave(self) -> None:
        """Close the file: the journal has ended, or the recording goes on with another one."""
        if self._fd >= 0:
            self._check()
        if self._fd >= 0:
            with contextlib.suppress(OSError):
                os.close(self._fd)
            self._fd = -1


def _candidates(wanted: Path) -> list[Path]:
    """Names for the journal, the best first.

    >>> [path.name for path in _candidates(Path("drive.events.jsonl"))][:2]
    ['drive.events.jsonl', 'drive.events-2.jsonl']
    """
    stem = wanted.name.removesuffix(".jsonl")
    return [
        wanted if number == 1 else derived_name.sibling(wanted, stem, f"-{number}.jsonl")
        for number, _ in zip(count(1), range(_MAX_NAMES), strict=False)
    ]


def _open_own(folder: HeldFolder, name: str) -> tuple[int, bool] | None:
    """Open a new file (True), or one that begins like a journal (False); None: it is another program's."""
    try:
        return folder.create(name, append=True), True
    except FileExistsError:
        pass
    try:
        fd = folder.existing(name, append=True)
    except OSError:
        return None
    try:
        if os.read(fd, len(_BEGINNING)) == _BEGINNING:
            return fd, False
    except OSError:
        pass
    os.close(fd)
    return None


def _ends_with_newline(fd: int, size: int) -> bool:
    os.lseek(fd, max(size - 1, 0), os.SEEK_SET)
    return os.read(fd, 1) in (b"\n", b"")
