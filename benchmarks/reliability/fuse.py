"""A file system in this process: the Linux kernel's FUSE protocol, as much of it as a recorder and a reader need.

Structures and numbers from linux/fuse.h (protocol 7.31). No library: `/dev/fuse` and mount(2), so it needs root (or a
user namespace with /dev/fuse). Requests are answered one after the other, as one slow disk would. No page cache:
each write(2) of a program arrives here.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import stat
import threading
import time
from pathlib import Path
from struct import Struct
from typing import Protocol

_IN = Struct("<IIQQIIIHH")  # length, opcode, unique, node, uid, gid, pid, extensions, padding
_OUT = Struct("<IiQ")
_ATTR = Struct("<6Q3I7I")
_ENTRY = Struct("<4Q2I")
_WRITE = Struct("<QQIIQII")
_READ = Struct("<QQIIQII")
_SETATTR = Struct("<IIQQQQQQIIIIIIII")
_SIZE = 1 << 3  # of SETATTR: the size is meant
_DIRECT = 1  # of OPEN: past the page cache
_BIG_WRITES, _MAX_PAGES = 1 << 5, 1 << 22
_MAX_WRITE = 128 * 1024
ROOT = 1

LOOKUP, FORGET, GETATTR, SETATTR, UNLINK, RENAME, LINK, OPEN, READ, WRITE = 1, 2, 3, 4, 10, 12, 13, 14, 15, 16
STATFS, RELEASE, FSYNC, FLUSH, INIT, OPENDIR, READDIR, RELEASEDIR, FSYNCDIR = (
    17,
    18,
    20,
    25,
    26,
    27,
    28,
    29,
    30,
)
ACCESS, CREATE, INTERRUPT, DESTROY, BATCH_FORGET, RENAME2 = 34, 35, 36, 38, 42, 45
_SILENT = (FORGET, BATCH_FORGET, INTERRUPT)


class Files(Protocol):
    """One flat folder of files. Every method may raise OSError with its errno."""

    def find(self, name: str) -> int:
        """The file of this name, as a number from 2 on."""

    def names(self) -> list[tuple[str, int]]:
        """All names."""

    def create(self, name: str) -> int:
        """A new file."""

    def size(self, file: int) -> int:
        """Its bytes."""

    def truncate(self, file: int, size: int) -> None:
        """Set its size."""

    def read(self, file: int, at: int, size: int) -> bytes:
        """Bytes of it."""

    def write(self, file: int, at: int, data: bytes) -> int:
        """Write into it; returns how many bytes were taken."""

    def unlink(self, name: str) -> None:
        """Take the name away."""

    def link(self, file: int, name: str) -> None:
        """Give it one more name."""

    def rename(self, name: str, to: str) -> None:
        """Give it another name."""

    def sync(self, file: int) -> None:
        """What fsync or fdatasync asks of a file, or of the folder (`ROOT`)."""

    def blocks(self) -> tuple[int, int]:
        """Blocks of 512 bytes in all, and free ones."""


def available() -> bool:
    """Whether this process may mount such a file system."""
    return os.access("/dev/fuse", os.R_OK | os.W_OK) and hasattr(os, "geteuid") and os.geteuid() == 0


class Mounted:
    """`with Mounted(files, folder):` — the files appear in the folder until the end."""

    def __init__(self, files: Files, folder: Path):
        self._files = files
        self._folder = folder
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._device = -1
        self._thread = threading.Thread(target=self._serve, name="fuse", daemon=True)

    def __enter__(self) -> Mounted:
        self._device = os.open("/dev/fuse", os.O_RDWR)
        options = f"fd={self._device},rootmode=40000,user_id={os.getuid()},group_id={os.getgid()},allow_other"
        where = os.fsencode(self._folder)
        if self._libc.mount(b"canid", where, b"fuse", 0, options.encode()):
            code = ctypes.get_errno()
            os.close(self._device)
            raise OSError(code, os.strerror(code), str(self._folder))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        for _ in range(50):  # a program that was killed lets go a instant later
            if self._libc.umount2(os.fsencode(self._folder), 0) == 0:
                break
            time.sleep(0.02)
        else:
            self._libc.umount2(os.fsencode(self._folder), 2)  # MNT_DETACH
        self._thread.join(5.0)
        os.close(self._device)

    def _serve(self) -> None:
        while True:
            try:
                request = os.read(self._device, _MAX_WRITE + 4096)
            except OSError as error:
                if error.errno in (errno.ENOENT, errno.EINTR):
                    continue  # the request was taken back
                return  # ENODEV: unmounted
            _, code, unique, node, *_ = _IN.unpack_from(request)
            if code in _SILENT:
                continue
            try:
                answer, failed = self._answer(code, node, request[_IN.size :]), 0
            except OSError as error:
                answer, failed = b"", -(error.errno or errno.EIO)
            with contextlib.suppress(OSError):  # who asked is gone
                os.write(self._device, _OUT.pack(_OUT.size + len(answer), failed, unique) + answer)

    def _answer(self, code: int, node: int, body: bytes) -> bytes:
        files = self._files
        if code == INIT:
            flags = _BIG_WRITES | _MAX_PAGES
            return Struct("<4I2H2I2HII6I").pack(
                7, 31, 0, flags, 12, 10, _MAX_WRITE, 1, _MAX_WRITE // 4096, 0, 0, 0, *([0] * 6)
            )
        if code == LOOKUP:
            return self._entry(files.find(_name(body)))
        if code == GETATTR:
            return Struct("<QII").pack(0, 0, 0) + self._attributes(node)
        if code == SETATTR:
            valid, _, _, size, *_ = _SETATTR.unpack_from(body)
            if valid & _SIZE:
                files.truncate(node, size)
            return Struct("<QII").pack(0, 0, 0) + self._attributes(node)
        if code == CREATE:
            return self._entry(files.create(_name(body[16:]))) + Struct("<QII").pack(0, _DIRECT, 0)
        if code in (OPEN, OPENDIR):
            return Struct("<QII").pack(0, _DIRECT, 0)
        if code == READ:
            _, at, size, *_ = _READ.unpack_from(body)
            return files.read(node, at, size)
        if code == WRITE:
            _, at, size, *_ = _WRITE.unpack_from(body)
            return Struct("<II").pack(files.write(node, at, body[_WRITE.size : _WRITE.size + size]), 0)
        if code == READDIR:
            _, at, size, *_ = _READ.unpack_from(body)
            return self._listing(at, size)
        if code == UNLINK:
            files.unlink(_name(body))
            return b""
        if code == LINK:
            (old,) = Struct("<Q").unpack_from(body)
            files.link(old, _name(body[8:]))
            return self._entry(old)
        if code in (RENAME, RENAME2):
            old, new = body[16 if code == RENAME2 else 8 :].split(b"\0")[:2]
            files.rename(os.fsdecode(old), os.fsdecode(new))
            return b""
        if code in (FSYNC, FSYNCDIR):
            files.sync(node)
            return b""
        if code == STATFS:
            total, free = files.blocks()
            return Struct("<5Q4I6I").pack(total, free, free, 1000, 1000, 512, 255, 512, 0, *([0] * 6))
        if code in (FLUSH, RELEASE, RELEASEDIR, DESTROY):
            return b""
        raise OSError(errno.ENOSYS, "not needed")

    def _attributes(self, node: int) -> bytes:
        folder = node == ROOT
        size = 0 if folder else self._files.size(node)
        mode = (stat.S_IFDIR | 0o755) if folder else (stat.S_IFREG | 0o644)
        now = int(time.time())
        return _ATTR.pack(
            node, size, -(-size // 512), now, now, now, 0, 0, 0, mode, 2 if folder else 1, 0, 0, 0, 4096, 0
        )

    def _entry(self, node: int) -> bytes:
        return _ENTRY.pack(node, 0, 0, 0, 0, 0) + self._attributes(node)

    def _listing(self, at: int, size_limit: int) -> bytes:
        out = b""
        for index, (name, node) in list(enumerate(self._files.names(), 1))[at:]:
            raw = os.fsencode(name)
            item = Struct("<QQII").pack(node, index, len(raw), stat.S_IFREG >> 12) + raw
            item += b"\0" * (-len(item) % 8)
            if len(out) + len(item) > size_limit:
                break
            out += item
        return out


def _name(body: bytes) -> str:
    return os.fsdecode(body.split(b"\0", 1)[0])
