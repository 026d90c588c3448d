"""The list of a series, `drive.series`: the files that were written, so that only those are ever deleted.

One line for each thing that happens to a file: a checksum and a JSON object. It is read line by line; what cannot be
read is skipped, so that a damaged list keeps files longer and deletes no more. It is locked while it is used.
"""

from __future__ import annotations

import contextlib
import json
import os
import stat
import threading
import zlib
from itertools import count
from typing import Any, NamedTuple

from canid.io.files.file_identity import FileIdentity
from canid.io.files.held_folder import HeldFolder
from canid.io.recording.file_age import UNKNOWN, Clocks
from canid.values.errors import OutputError

# bytes that are read of a list: some 50,000 files; files listed beyond that are kept
_MAX_LIST_BYTES = 1 << 26
# A list is rewritten where it has this size, in bytes, and this many times what is still needed.
_MIN_REWRITE_BYTES, _REWRITE_RATIO = 1 << 18, 4
# names that are tried: others are locked by other recordings, or not ours
_MAX_NAMES = 1000
_MODE = 0o600
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_DELETED = "deleted"


class Entry(NamedTuple):
    """One file of the series, or a journal of one."""

    name: str
    identity: FileIdentity
    log: str = ""  # of a journal: the log that it belongs to
    clocks: Clocks = UNKNOWN  # at its end; until then at its beginning
    recorded: float = 0.0  # s from its beginning to its end, monotonic clock

    def line(self) -> bytes:
        """Encode it.

        >>> Entry.decoded(Entry("a.blf", FileIdentity(1, 2, 3)).line()).identity.inode
        3
        """
        more = {"clocks": list(self.clocks), "recorded": self.recorded}
        return _line({"name": self.name, "log": self.log, **self.identity._asdict(), **more})

    @staticmethod
    def decoded(line: bytes) -> Entry | None:
        """Decode a line that `line` encoded; None for any other."""
        fields = _fields(line)
        if fields is None:
            return None
        # earlier versions had neither
        clocks, recorded = _clocks(fields.pop("clocks", None)), fields.pop("recorded", 0.0)
        if set(fields) != {"name", "log", *FileIdentity._fields} or type(recorded) is not float:
            return None
        name, log = fields.pop("name"), fields.pop("log")
        if not (isinstance(name, str) and isinstance(log, str)):
            return None
        types = {key: type(value) for key, value in FileIdentity()._asdict().items()}
        if any(type(value) is not types[key] for key, value in fields.items()):
            return None
        return Entry(name, FileIdentity(**fields), log, clocks, max(recorded, 0.0))


class RingList:
    """The list's file, locked. `entries`: what was written and not deleted, the oldest first; any thread may note."""

    def __init__(self, folder: HeldFolder, stem: str):
        """Open `stem`.series; where another process has locked it, or another user owns it, the next free name: `stem`-2."""
        self.entries: dict[str, Entry] = {}
        self.unidentified: list[str] = []  # names of an earlier version's list, which held nothing but names
        self.complaints: list[str] = []  # what was wrong with the list
        self._lock = threading.Lock()
        self._dirty = False
        self._folder = folder
        self.stem, self.name, self._fd = self._locked(stem)
        self._size = os.fstat(self._fd).st_size
        # where inode numbers do not last, its deletion cannot be detected
        self._findable = folder.names(self.name, os.fstat(self._fd))
        data = _read(self._fd)
        self._read(data)
        needed = sum(len(entry.line()) for entry in self.entries.values())
        if len(data) > max(_MIN_REWRITE_BYTES, _REWRITE_RATIO * needed):
            with contextlib.suppress(OSError):
                self._rewrite(replace=True)

    def note(self, entry: Entry) -> None:
        """Add a file, or what is newly known of one."""
        with self._lock:
            self.entries[entry.name] = entry
            self._append(entry.line())

    def forget(self, name: str) -> None:
        """Note that a file is deleted, or must not be deleted."""
        with self._lock:
            self.entries.pop(name, None)
            self._append(_line({_DELETED: name}))

    def maintain(self) -> str:
        """Sync it; rewrite it where it is gone from its folder. Returns what happened, mostly ""."""
        with self._lock:
            if self._fd < 0:
                return ""
            with contextlib.suppress(OSError):
                if self._dirty:
                    self._dirty = False
                    os.fsync(self._fd)
            if not self._findable or not self._folder.usable:
                return ""
            try:
                listed, named = os.fstat(self._fd), self._folder.status(self.name)
            except OSError:  # not known: EACCES, EIO, ESTALE, ...
                return ""
            if named is None or not os.path.samestat(named, listed) or listed.st_size < self._size:
                return self._replace()
            return ""

    def close(self) -> None:
        """Close it, which unlocks it."""
        with self._lock:
            if self._fd >= 0:
                os.close(self._fd)
            self._fd = -1

    # --- with the lock ---

    def _append(self, line: bytes) -> None:
        if self._fd < 0:
            return
        # a list that cannot be written keeps files longer, and loses none
        with contextlib.suppress(OSError):
            self._size += os.write(self._fd, line)
        self._dirty = True

    def _replace(self) -> str:
        try:
            self._rewrite(replace=False)
        except OSError as error:
            os.close(self._fd)
            self._fd = -1
            return f"{self.name} is gone and cannot be rewritten ({error.strerror}): files of this recording stay"
        return f"{self.name} was deleted, moved or truncated: it is rewritten"

    def _rewrite(self, *, replace: bool) -> None:
        """Write the list without what is not needed any more; `replace`: over the old one."""
        if replace:
            fd, name = self._folder.create_temporary(self.name, append=True, mode=_MODE)
        else:
            fd, name = self._folder.create(self.name, append=True, mode=_MODE), self.name
        try:
            _lock(fd)
            data = b"".join(entry.line() for entry in self.entries.values())
            data += b"".join(b"+" + os.fsencode(name) + b"\n" for name in self.unidentified)
            if os.write(fd, data) != len(data):
                raise OSError(None, "not written whole")
            os.fsync(fd)
            if replace:
                self._folder.rename(name, self.name)
        except OSError:
            os.close(fd)
            with contextlib.suppress(OSError):
                self._folder.unlink(name)
            raise
        os.close(self._fd)
        self._fd, self._size = fd, len(data)

    # --- opening ---

    def _locked(self, stem: str) -> tuple[str, str, int]:
        for number, _ in zip(count(1), range(_MAX_NAMES), strict=False):
            own_stem = stem if number == 1 else f"{stem}-{number}"
            name = f"{own_stem}.series"
            try:
                fd = self._open(name)
            except OSError as error:
                raise OutputError(
                    f"cannot create {self._folder.path / name}: {error.strerror}", error.errno
                ) from None
            if fd < 0:
                continue
            if _lock(fd) and os.fstat(fd).st_nlink:  # without a name: another process has just rewritten it
                return own_stem, name, fd
            os.close(fd)
        raise OutputError(f"cannot create {self._folder.path / stem}.series: no name is free")

    def _open(self, name: str) -> int:
        """Open the list, or create it; -1 and a complaint where it is not ours alone."""
        with contextlib.suppress(FileExistsError):
            return self._folder.create(name, append=True, mode=_MODE)
        try:
            # before it is opened: opening a device can do something
            there = self._folder.status(name)
            why = "" if there is None else _not_ours(there)
            fd = -1 if why else self._folder.existing(name, append=True)
        except OSError as error:
            why, fd = f"cannot be opened ({error.strerror})", -1
        if fd >= 0:
            status = os.fstat(fd)
            why = _not_ours(status)
            if why:
                os.close(fd)
                fd = -1
            elif status.st_mode & _OTHERS_WRITE and hasattr(os, "fchmod"):
                with contextlib.suppress(OSError):
                    os.fchmod(fd, stat.S_IMODE(status.st_mode) & ~_OTHERS_WRITE)
                self.complaints.append(
                    f"{name} could be written by other users, which is no longer permitted"
                )
        if why:
            self.complaints.append(f"{name} {why}: it is not used")
        return fd

    def _read(self, data: bytes) -> None:
        names: dict[str, None] = {}
        damaged = 0
        for line in data.split(b"\n"):
            entry = Entry.decoded(line)
            if entry is not None:
                self.entries[entry.name] = entry
            elif (fields := _fields(line)) is not None:
                self.entries.pop(str(fields.get(_DELETED)), None)
                names.pop(str(fields.get(_DELETED)), None)
            elif line[:1] == b"+":
                names[os.fsdecode(line[1:])] = None
            elif line[:1] == b"-":
                names.pop(os.fsdecode(line[1:]), None)
            else:
                damaged += line != b""
        self.unidentified = list(names)
        if data and not data.endswith(b"\n"):
            self._append(b"\n")  # a killed process left half a line
        if damaged:
            self.complaints.append(
                f"{damaged:,} lines of {self.name} are damaged: the files they list are kept"
            )


def _clocks(values: object) -> Clocks:
    """Readings as they stand in a line; `UNKNOWN` for anything else."""
    types = [str, float, float, float, bool]
    if not isinstance(values, list) or [type(value) for value in values] != types:
        return UNKNOWN
    return Clocks(*values)


def _not_ours(status: os.stat_result) -> str:
    if not stat.S_ISREG(status.st_mode):
        return "is no regular file"
    if status.st_nlink > 1:
        return "has a second name"
    if hasattr(os, "geteuid") and status.st_uid != os.geteuid():
        return "belongs to another user"
    return ""


def _read(fd: int) -> bytes:
    parts: list[bytes] = []
    os.lseek(fd, 0, os.SEEK_SET)
    while sum(map(len, parts)) < _MAX_LIST_BYTES and (part := os.read(fd, 1 << 20)):
        parts.append(part)
    return b"".join(parts)


def _lock(fd: int) -> bool:
    """Lock the file for this process until it is closed; False where another one has it."""
    try:
        import fcntl
    except ImportError:  # Windows: two recordings under one name are up to the user there
        return True
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system without locks
    return True


def _line(fields: dict[str, Any]) -> bytes:
    text = json.dumps(fields).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _fields(line: bytes) -> dict[str, Any] | None:
    """Fields of a line whose checksum is right; None for any other line."""
    checksum, _, text = line.strip().partition(b" ")
    if checksum != b"%08x" % zlib.crc32(text):
        return None
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return fields if isinstance(fields, dict) else None
