"""The files of a rotating recording: names that sort, and a ring buffer that deletes the oldest.

`drive.blf` becomes `drive_20261121T185017Z_000001.blf`, ..., with the UTC start of the recording: they sort by
name also across restarts. `drive.series` next to them lists what was written under this name (`ring_list`); a file is
deleted only if it still has the identity in the list (`file_identity`), never through a link.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
import secrets
import shutil
import stat
import threading
import time
from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path

from canid.io.files import file_identity
from canid.io.files.derived_name import short_stem
from canid.io.files.held_folder import HeldFolder
from canid.io.files.new_file import Disk, TakenError
from canid.io.logs.blf.blf_layout import FILE_HEADER_SIZE
from canid.io.logs.formats import log_suffix
from canid.io.logs.log_writer import WRITTEN_SUFFIXES, check_suffix, open_writer
from canid.io.logs.writer import Writer
from canid.io.recording.file_age import elapsed, read_clocks
from canid.io.recording.ring_list import Entry, RingList
from canid.io.recording.rotation import Rotation
from canid.values.errors import OutputError

# A ring by its share of the disk keeps room for this many of its largest file: other files may fill the disk, and the
# one being written and the next one must fit.
_FREE_FILES = 2
# bytes of a name behind the stem, such as -12_20261121T185017Z_000001-restored-12.blf or ….events-12.jsonl
_ENDING_BYTES = 48
# names of files in one event
_MAX_NAMES_SHOWN = 5


class Series:
    """Names the files, remembers them, deletes the oldest. One thread may begin files while another one prunes."""

    def __init__(
        self,
        wanted: Path,
        rotation: Rotation,
        report: Callable[[str, str], object] = lambda what, says: None,
        folder: HeldFolder | None = None,
    ):
        """Find a free name and read its list. Raises OutputError, or ConfigError for an unknown suffix.

        `report(what, says)` takes events; `folder`: of the files; None: what the path of `wanted` leads to.
        """
        check_suffix(wanted)
        self._rotation = rotation
        self._report = report
        self._suffix = wanted.name[len(wanted.name) - len(log_suffix(wanted)) :]
        self.folder = folder or folder_of(wanted)
        stem = wanted.name[: len(wanted.name) - len(self._suffix)]
        self._list = RingList(self.folder, short_stem(stem, _ENDING_BYTES))
        self._stem = self._list.stem
        # names of journals that are written now: they are kept
        self.in_use: Callable[[], Collection[str]] = lambda: ()
        self._without_log: set[str] = set()  # logs that were deleted while their journals were written
        self._session_began = time.monotonic()
        self._began = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        self._number = 0
        self._current: Disk | None = None  # the file that this process writes
        self._open: set[str] = set()  # files that this process has not closed yet
        # of files of this process: their age must not depend on a clock that is corrected in between
        self._opened_at: dict[str, float] = {}  # name -> s, monotonic clock
        self._finished: dict[str, float] = {}
        self._ages_reported = False  # that some are not known
        self._lock = threading.Lock()  # never held during disk access
        self._deleting = threading.Lock()
        name_pattern = _own_names(self._stem)
        for name in [name for name in self._list.entries if not name_pattern.fullmatch(name)]:
            del self._list.entries[name]
        self._complaints = list(self._list.complaints)
        unidentified = [
            name for name in self._list.unidentified if name_pattern.fullmatch(name) and self.folder.has(name)
        ]
        if unidentified:
            self._complaints.append(
                f"{self._list.name} is of an earlier version and does not identify its files: they are kept"
                f" ({_shown(unidentified)})"
            )
        for name in self._list.unidentified:
            self._list.forget(name)
        self._list.unidentified = []

    def open_next(self) -> Writer:
        """Begin the next file. Raises OutputError."""
        self.folder.follow()
        while True:
            self._number += 1
            name = f"{self._stem}_{self._began}_{self._number:06d}{self._suffix}"
            try:
                writer = open_writer(self.folder.path / name, folder=self.folder)
            except TakenError:
                continue
            with self._lock:
                if self._current is not None:
                    self._finished[self._current.path.name] = time.monotonic()
                self._current = writer.disk
                self._open.add(name)
                self._opened_at[name] = time.monotonic()
            writer.disk.closing = partial(self._is_closed, name)
            with contextlib.suppress(OSError):
                identity = file_identity.of_new_file(writer.disk.fileno())
                self._list.note(Entry(name, identity, clocks=read_clocks()))
            return writer

    def own(self, journal: str, fd: int) -> None:
        """Note a journal that was just created and written into: it is deleted with its log."""
        log = journal.split(".events")[0] + self._suffix
        with contextlib.suppress(OSError, ValueError):
            identity = file_identity.with_beginning(file_identity.of_new_file(fd), fd, 0)
            if _own_names(self._stem).fullmatch(journal):
                self._list.note(Entry(journal, identity, log))

    def adopt(self, name: str) -> None:
        """Note a copy of one of our files: it is deleted in its turn."""
        if not _own_names(self._stem).fullmatch(name):
            return
        with contextlib.suppress(OSError):
            fd = self.folder.read(name)
            try:
                identity = file_identity.with_beginning(file_identity.of_new_file(fd), fd, _skip(name))
                identity = file_identity.with_end(identity, fd, os.fstat(fd).st_size)
                self._list.note(Entry(name, identity, clocks=read_clocks()))
            finally:
                os.close(fd)
            self._finished[name] = time.monotonic()

    def prune(self) -> list[Path]:
        """Delete what the ring does not keep, the oldest first, never one being written; returns what was deleted.

        Maintains the list as well. A file that has not the identity in the list is kept, and an event reports it.
        """
        for says in self._complaints:
            self._report("series_list", says)
        self._complaints.clear()
        says = self._list.maintain()
        if says:
            self._report("series_list", says)
        self._note_beginning()
        for log in list(self._without_log):
            self._delete_journals(log)
        return self._deleted() if self._rotation.ring else []

    def close(self) -> None:
        """Close the list."""
        self._list.close()

    # --- the list ---

    def _note_beginning(self) -> None:
        """Note how the current file begins, once that is written: after a kill nothing else identifies it."""
        disk = self._current
        entry = self._list.entries.get(disk.path.name) if disk is not None else None
        # without pread, reading would move the place at which another thread writes
        if disk is None or entry is None or entry.identity.head or not hasattr(os, "pread"):
            return
        with contextlib.suppress(OSError, ValueError):
            identity = file_identity.with_beginning(entry.identity, disk.fileno(), _skip(entry.name))
            if identity.head and self._list.entries.get(entry.name) is entry:
                self._list.note(entry._replace(identity=identity))

    def _is_closed(self, name: str, disk: Disk) -> None:
        """Note what the file is, before its descriptor is closed."""
        now = time.monotonic()
        with self._lock:
            self._open.discard(name)
            recorded = self._finished.get(name, now) - self._opened_at.get(name, now)
        entry = self._list.entries.get(name)
        if entry is None:
            return
        with contextlib.suppress(OSError, ValueError):
            # a recording of a silent bus has a header alone
            skip = _skip(name) if disk.size > _skip(name) else 0
            identity = file_identity.with_beginning(entry.identity, disk.fileno(), skip)
            identity = file_identity.with_end(identity, disk.fileno(), disk.size)
            self._list.note(entry._replace(identity=identity, clocks=read_clocks(), recorded=recorded))

    # --- deleting ---

    def delete_oldest(self) -> Path | None:
        """Delete the oldest file of a ring, whatever its age: the disk is full. None: there is none."""
        if not self._rotation.ring:
            return None
        with self._deleting:
            return next(self._deletions(lambda entry: True), None)

    def _deleted(self) -> list[Path]:
        try:
            usage = shutil.disk_usage(self.folder.path if self.folder.fd is None else self.folder.fd)
        except OSError:
            return []  # the folder is gone: the writer will report
        with self._deleting:
            logs = self._logs()
            sizes = {entry.name: self._size(entry.name) for entry in logs}
            ages = self._ages(logs) if self._rotation.keep_time < math.inf else {}
            limit = self._rotation.keep_share * usage.total  # NaN: no limit
            room = _FREE_FILES * max([self._rotation.size, *sizes.values()])
            used, free = sum(sizes.values()), usage.free

            def is_due(entry: Entry) -> bool:
                nonlocal used, free
                due = used > limit or (limit == limit and free < room)
                due |= ages.get(entry.name, 0.0) > self._rotation.keep_time
                if due:
                    used, free = used - sizes[entry.name], free + sizes[entry.name]
                return due

            return list(self._deletions(is_due))

    def _logs(self) -> list[Entry]:
        """Listed files, the oldest first, but for journals."""
        return [entry for entry in list(self._list.entries.values()) if not entry.log]

    def _deletions(self, is_due: Callable[[Entry], bool]) -> Iterator[Path]:
        """Delete files, the oldest first, up to one that is not due; yields what was deleted."""
        current = self._current.path.name if self._current is not None else ""
        kept: list[str] = []
        try:
            for entry in self._logs():
                with self._lock:
                    written = entry.name == current or entry.name in self._open
                if written:
                    break  # a newer one must not go before it
                if self.folder.has(entry.name) and not is_due(entry):
                    break
                try:
                    why = self._delete(entry)
                except OSError:
                    continue  # it is tried again next time
                self._list.forget(entry.name)
                with self._lock:
                    self._finished.pop(entry.name, None)
                if why:
                    kept.append(f"{entry.name} {why}")
                    continue
                self._delete_journals(entry.name)
                if why is not None:
                    yield self.folder.path / entry.name
        finally:  # also where no more is asked for
            if kept:
                self._report(
                    "file_kept",
                    f"not what {self._list.name} lists, and so never deleted: {_shown(kept)}",
                )

    def _delete_journals(self, log: str) -> None:
        """Delete the journals of a log that is deleted; one that is written now follows later."""
        self._without_log.discard(log)
        for entry in [each for each in list(self._list.entries.values()) if each.log == log]:
            if entry.name in self.in_use():
                self._without_log.add(log)
                continue
            with contextlib.suppress(OSError):
                why = self._delete(entry)
                if why:
                    self._report("file_kept", f"{entry.name} {why}, and so is not deleted with its log")
                self._list.forget(entry.name)

    def _delete(self, entry: Entry) -> str | None:
        """Delete a file if it is what was noted; returns why it is not, or None where there is none. Raises OSError."""
        try:
            fd = self.folder.read(entry.name)
        except FileNotFoundError:
            return None
        except OSError:
            if self._is_regular(entry.name):
                raise
            return "is no regular file"
        try:
            why = file_identity.mismatch(entry.identity, fd)
            return why or self._unlink(entry.name, fd)
        finally:
            os.close(fd)

    def _unlink(self, name: str, fd: int) -> str:
        """Unlink the name of an open file: renamed first, so that no other file can be put in its place."""
        aside = f".{name}.{secrets.token_hex(8)}.old"
        if self.folder.fd is None:  # Windows
            self.folder.unlink(name)
            return ""
        self.folder.rename(name, aside)
        if self.folder.names(aside, os.fstat(fd)):
            self.folder.unlink(aside)
            return ""
        # another program has replaced it: that file gets its name back, unless there is a newer one
        with contextlib.suppress(FileExistsError):
            self.folder.link(aside, name)
            self.folder.unlink(aside)
        return "was replaced in between"

    def _is_regular(self, name: str) -> bool:
        try:
            status = self.folder.status(name)
        except OSError:
            return True  # the reason is another one
        return status is None or stat.S_ISREG(status.st_mode)

    def _size(self, name: str) -> int:
        with contextlib.suppress(OSError):
            status = self.folder.status(name)
            return 0 if status is None else status.st_size
        return 0

    def _ages(self, logs: list[Entry]) -> dict[str, float]:
        """S since each file was finished, at least; `logs`: the oldest first.

        Of this session by the monotonic clock; of earlier ones by clocks that confirm each other (`file_age`), and in any
        case what was recorded since then, because that time has passed.
        """
        now, monotonic = read_clocks(), time.monotonic()
        with self._lock:
            finished = dict(self._finished)
        ages: dict[str, float] = {}
        recorded, least, unknown = monotonic - self._session_began, 0.0, 0
        ended = now  # a file that a killed process left had ended when the next one began
        for entry in reversed(logs):
            if entry.name in finished:
                age = monotonic - finished[entry.name]
            elif entry.name in self._opened_at:
                age = 0.0
            else:
                confirmed = elapsed(entry.clocks if entry.identity.size >= 0 else ended, now)
                unknown += confirmed is None
                age = max(confirmed or 0.0, recorded)
                recorded += entry.recorded
            ended = entry.clocks
            least = ages[entry.name] = max(age, least)  # no younger than those that came later
        if unknown and not self._ages_reported:
            self._ages_reported = True
            self._report(
                "ages_not_known",
                f"the clocks of this computer do not confirm the age of {unknown:,} files of earlier sessions: those are"
                f" deleted once {self._rotation.keep_time:g} s were recorded after them, or the disk needs the room",
            )
        return ages


def folder_of(wanted: Path) -> HeldFolder:
    """Open the folder in which a file shall be created. Raises OutputError.

    >>> str(folder_of(Path("/drive.blf")).path)
    '/'
    """
    try:
        return HeldFolder(wanted.parent)
    except OSError as error:
        raise OutputError(f"cannot create {wanted}: {error.strerror}", error.errno) from None


def _own_names(stem: str) -> re.Pattern[str]:
    """Names that files of this series can have.

    >>> bool(_own_names("x").fullmatch("x_20261121T185017Z_000001.blf"))
    True
    """
    log = rf"(-restored(-\d+)?)?({'|'.join(map(re.escape, WRITTEN_SUFFIXES))})"
    return re.compile(
        rf"{re.escape(stem)}_\d{{8}}T\d{{6}}Z_\d{{6,}}({log}|\.events(-\d+)?\.jsonl)",
        re.ASCII | re.IGNORECASE,
    )


def _skip(name: str) -> int:
    """Bytes at a log's beginning that change while it is written: a .blf's header."""
    return FILE_HEADER_SIZE if name.lower().endswith(".blf") else 0


def _shown(names: list[str]) -> str:
    more = len(names) - _MAX_NAMES_SHOWN
    return ", ".join(names[:_MAX_NAMES_SHOWN]) + (f", and {more:,} more" if more > 0 else "")
