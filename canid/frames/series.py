"""The files of one recording that goes on in new files: names that sort, and a list of what may be deleted.

`drive.blf` becomes `drive_20261121T185017Z_000001.blf`, ..., with the UTC start of the recording: they sort by
name also across restarts. `drive.series` beside them lists what was written under this name; only that is ever
deleted. It is locked while it is used, so that two recordings never share one list.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import threading
import time
from itertools import count
from pathlib import Path
from typing import BinaryIO

from canid.errors import OutputError
from canid.frames.disk import TakenError
from canid.frames.journal import journal_path
from canid.frames.log import log_suffix
from canid.frames.rotation import Rotation
from canid.frames.write import Writer, check_suffix, open_writer

_WRITTEN, _DELETED = "+", "-"


class Series:
    """Names the files, remembers them, deletes the oldest. One thread may begin files while another one prunes."""

    def __init__(self, wanted: Path, rotation: Rotation):
        """Find a free name and read its list. Raises OutputError, or ConfigError for an unknown suffix."""
        check_suffix(wanted)
        self._rotation = rotation
        self._suffix = wanted.name[len(wanted.name) - len(log_suffix(wanted)) :]
        self._stem = wanted.name[: len(wanted.name) - len(self._suffix)]
        self._folder = wanted.parent
        self._began = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        self._number = 0
        self._list, self._stem = _locked_list(self._folder, self._stem)
        self._files = _listed(self._list, f"{self._stem}_")
        self._current = ""  # the file that this process writes
        # of files that this process has finished: a clock that is set right meanwhile makes none of them old
        self._finished: dict[str, float] = {}  # name -> s, monotonic clock
        self._lock = threading.Lock()  # never held while the disk works

    def open_next(self) -> Writer:
        """Begin the next file. Raises OutputError."""
        while True:
            self._number += 1
            name = f"{self._stem}_{self._began}_{self._number:06d}{self._suffix}"
            try:
                writer = open_writer(self._folder / name)
            except TakenError:
                continue
            self._note(_WRITTEN, name)
            with self._lock:
                if self._current:
                    self._finished[self._current] = time.monotonic()
                self._current = name
                self._files.append(name)
            return writer

    def prune(self) -> list[Path]:
        """Delete what the ring does not keep, the oldest first, never the newest; returns what was deleted."""
        if not self._rotation.ring:
            return []
        with self._lock:
            old, newest = self._files[:-1], self._files[-1:]
        sizes = {name: _size(self._folder / name) for name in (*old, *newest)}
        used = sum(sizes.values())
        try:
            room = self._rotation.keep_share * shutil.disk_usage(self._folder).total  # NaN: no limit
        except OSError:
            return []  # the folder is gone: the writer will tell
        deleted = []
        for name in old:
            if not (used > room or self._age(name) > self._rotation.keep_time):
                break
            try:
                _delete(self._folder / name)
            except OSError:
                continue  # it is tried again at the next look
            with self._lock:
                self._files.remove(name)
                self._finished.pop(name, None)
            self._note(_DELETED, name)
            used -= sizes[name]
            deleted.append(self._folder / name)
        return deleted

    def close(self) -> None:
        """Let go of the list."""
        self._list.close()

    def _age(self, name: str) -> float:
        """S since it was finished."""
        finished = self._finished.get(name)
        if finished is not None:
            return time.monotonic() - finished
        try:
            return time.time() - (self._folder / name).stat().st_mtime
        except OSError:
            return 0.0

    def _note(self, what: str, name: str) -> None:
        # a list that cannot be written keeps files longer, and loses none
        with contextlib.suppress(OSError):
            self._list.write(f"{what}{name}\n".encode())


def _locked_list(folder: Path, stem: str) -> tuple[BinaryIO, str]:
    """Open the list, locked; where another process has it: that of the next free name, stem-2, ..."""
    for number in count(1):
        name = stem if number == 1 else f"{stem}-{number}"
        path = folder / f"{name}.series"
        try:
            file: BinaryIO = open(path, "a+b", buffering=0)  # noqa: SIM115
        except OSError as error:
            raise OutputError(f"cannot create {path}: {error.strerror}") from None
        if _lock(file):
            return file, name
        file.close()
    raise AssertionError("unreachable")


def _lock(file: BinaryIO) -> bool:
    """Lock the file for this process until it is closed; False where another one has it."""
    try:
        import fcntl
    except ImportError:  # Windows: two recordings under one name are up to the user there
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system without locks
    return True


def _listed(file: BinaryIO, prefix: str) -> list[str]:
    """Names that were written and not deleted, the oldest first; what cannot be one of ours is passed over."""
    file.seek(0)
    names: dict[str, None] = {}
    for line in file.read().decode(errors="replace").splitlines():
        what, name = line[:1], line[1:]
        if what == _WRITTEN and name.startswith(prefix) and os.path.basename(name) == name:
            names[name] = None
        elif what == _DELETED:
            names.pop(name, None)
    return list(names)


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _delete(path: Path) -> None:
    """Delete a log and the journal beside it."""
    path.unlink(missing_ok=True)
    journal_path(path).unlink(missing_ok=True)
