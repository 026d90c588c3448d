"""A disk that stalls, fills up, breaks, or loses its power: what was not synced is thrown away.

What a power cut leaves, by POSIX: of a file, what its last completed fsync or fdatasync covered; of a folder, the names
that its last fsync covered. What was written later may be there, in part, or not at all, sector by sector.
"""

from __future__ import annotations

import errno
import os
import random
import threading
import time
from pathlib import Path

from benchmarks.reliability.fuse import ROOT

# bytes that a disk writes whole or not at all
SECTOR = 512


class _File:
    def __init__(self) -> None:
        self.data = bytearray()
        self.synced = b""
        self.later: list[tuple[int, bytes]] = []  # writes since


class FaultyDisk:
    """The files of one folder, in memory; see `fuse.Files`. Knobs may be turned while it is used."""

    def __init__(self, stall: float = 0.0, capacity: int = 1 << 30):
        """`stall`: s that every sync takes; `capacity`: bytes, then the disk is full."""
        self.stall = stall
        self.stuck = threading.Event()  # set: no write comes back until it is cleared
        self.failure = 0  # errno of every write and sync; 0: none
        self.capacity = capacity
        self.syncs = 0
        self._files: dict[int, _File] = {}
        self._names: dict[str, int] = {}
        self._names_synced: dict[str, int] = {}
        self._next = ROOT + 1
        self._cut = False
        self._lock = threading.Lock()

    # --- a power cut ---

    def cut(self) -> None:
        """The power is gone: nothing that is written or synced from now on counts."""
        with self._lock:
            self._cut = True

    def leave(self, folder: Path, rng: random.Random | None = None) -> None:
        """Put what the cut has left into a folder. `rng`: chooses which of the later writes came through, in sectors.

        Without it nothing that was not synced is there.
        """
        names = dict(self._names_synced)
        if rng is not None:
            names |= {name: file for name, file in self._names.items() if rng.random() < 0.5}
        for name, number in names.items():
            file_ = self._files[number]
            left = bytearray(file_.synced)
            for at, data in file_.later if rng is not None else ():
                for begin in range(at - at % SECTOR, at + len(data), SECTOR):
                    low, high = max(begin, at), min(begin + SECTOR, at + len(data))
                    if rng is not None and rng.random() < 0.5:
                        # a sector that came through beyond the end leaves zeros before it
                        left.extend(b"\0" * (high - len(left)))
                        left[low:high] = data[low - at : high - at]
            (folder / name).write_bytes(left)

    # --- fuse.Files ---

    def find(self, name: str) -> int:
        """Its number; ENOENT where it is not there."""
        if name not in self._names:
            raise OSError(errno.ENOENT, name)
        return self._names[name]

    def names(self) -> list[tuple[str, int]]:
        """All of them."""
        return list(self._names.items())

    def create(self, name: str) -> int:
        """An empty one."""
        self._check()
        number, self._next = self._next, self._next + 1
        self._files[number] = _File()
        self._names[name] = number
        return number

    def size(self, file: int) -> int:
        """Bytes, as programs see them."""
        return len(self._files[file].data)

    def truncate(self, file: int, size: int) -> None:
        """Set the size; it counts as synced with the next sync."""
        data = self._files[file].data
        if size < len(data):
            del data[size:]
        data.extend(b"\0" * (size - len(data)))

    def read(self, file: int, at: int, size: int) -> bytes:
        """As programs see it."""
        return bytes(self._files[file].data[at : at + size])

    def write(self, file: int, at: int, data: bytes) -> int:
        """Take what fits, unless it is stuck or fails."""
        while self.stuck.is_set():
            time.sleep(0.01)
        self._check()
        whole = self._files[file].data
        free = self.capacity - sum(len(each.data) for each in self._files.values()) + max(len(whole) - at, 0)
        if free <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        data = data[:free]
        with self._lock:
            whole.extend(b"\0" * (at + len(data) - len(whole)))
            whole[at : at + len(data)] = data
            if not self._cut:
                self._files[file].later.append((at, data))
        return len(data)

    def unlink(self, name: str) -> None:
        """Take a name away."""
        del self._names[name]

    def link(self, file: int, name: str) -> None:
        """One more name."""
        if name in self._names:
            raise OSError(errno.EEXIST, name)
        self._names[name] = file

    def rename(self, name: str, to: str) -> None:
        """Another name."""
        self._names[to] = self._names.pop(name)

    def sync(self, file: int) -> None:
        """After `stall` s, what was written before the call is safe."""
        self._check()
        names = dict(self._names)
        data, count = (
            (bytes(self._files[file].data), len(self._files[file].later)) if file != ROOT else (b"", 0)
        )
        time.sleep(self.stall)
        with self._lock:
            if self._cut:
                return
            self.syncs += 1
            if file == ROOT:
                self._names_synced = names
            else:
                self._files[file].synced = data
                del self._files[file].later[:count]

    def blocks(self) -> tuple[int, int]:
        """Of 512 bytes."""
        used = sum(len(each.data) for each in self._files.values())
        return self.capacity // 512, max(self.capacity - used, 0) // 512

    def _check(self) -> None:
        if self.failure:
            raise OSError(self.failure, os.strerror(self.failure))
