"""Identity of a file: device, inode, size, and hashes of its beginning and end."""

from __future__ import annotations

import hashlib
import os
import stat
from typing import NamedTuple

# bytes of the beginning and of the end that are hashed
HASHED_SIZE = 4096
# File systems whose inode numbers do not outlast a file's closing or a mount; there only content and size identify a file.
_PASSING_INODES = ("vfat", "msdos", "exfat", "ntfs", "fuseblk", "cifs", "smb3", "9p")
_MOUNTS = "/proc/self/mountinfo"


class FileIdentity(NamedTuple):
    """What is known of one file; -1 and "" where it is not (yet) known."""

    device: int = -1
    filesystem: int = 0  # statvfs' id: stays where a disk gets another device number; 0: not known
    inode: int = -1  # 0: not compared on this file system
    size: int = -1  # once it was closed
    skip: int = 0  # bytes at the beginning that change while it is written
    length: int = 0  # bytes of `head`
    head: str = ""  # SHA-256 of `length` bytes from `skip` on
    tail: str = ""  # SHA-256 of the end of `size` bytes, at most `HASHED_SIZE` of them


def of_new_file(fd: int) -> FileIdentity:
    """Identity of a file that was just created. Raises OSError."""
    status = os.fstat(fd)
    inode = 0 if _passing_inodes(status.st_dev) else status.st_ino
    return FileIdentity(status.st_dev, _filesystem(fd), inode)


def with_beginning(identity: FileIdentity, fd: int, skip: int) -> FileIdentity:
    """The identity with the hash of what follows byte `skip` by now. Raises OSError."""
    data = _read_at(fd, HASHED_SIZE, skip)
    return identity._replace(skip=skip, length=len(data), head=_sha256(data)) if data else identity


def with_end(identity: FileIdentity, fd: int, size: int) -> FileIdentity:
    """The identity with the size of the closed file and the hash of its end. Raises OSError."""
    start = max(size - HASHED_SIZE, 0)
    return identity._replace(size=size, tail=_sha256(_read_at(fd, size - start, start)))


def mismatch(identity: FileIdentity, fd: int) -> str:
    """Why an open file is not the one that was noted; "" where it is.

    >>> import tempfile
    >>> with tempfile.TemporaryFile() as file:
    ...     _ = file.write(b"frames"), file.flush()
    ...     noted = with_end(with_beginning(of_new_file(file.fileno()), file.fileno(), 0), file.fileno(), 6)
    ...     same = mismatch(noted, file.fileno())
    ...     _ = file.write(b"more"), file.flush()
    ...     same, mismatch(noted, file.fileno())
    ('', 'has another size')
    """
    status = os.fstat(fd)
    if not stat.S_ISREG(status.st_mode):
        return "is no regular file"
    if identity.inode < 0 or not identity.head:
        return "was not noted well enough to be recognised"
    filesystem = _filesystem(fd)
    if status.st_dev != identity.device and not (filesystem and filesystem == identity.filesystem):
        return "is on another device"
    if identity.inode and status.st_ino != identity.inode:
        return "is another file (inode)"
    if identity.size >= 0 and status.st_size != identity.size:
        return "has another size"
    if not identity.inode and identity.size < 0:
        return "was not noted well enough to be recognised"
    if _sha256(_read_at(fd, identity.length, identity.skip)) != identity.head:
        return "has another beginning"
    if identity.size >= 0 and with_end(identity, fd, identity.size).tail != identity.tail:
        return "has another end"
    return ""


def _read_at(fd: int, count: int, at: int) -> bytes:
    if hasattr(os, "pread"):
        return os.pread(fd, count, at)
    os.lseek(fd, at, os.SEEK_SET)  # Windows
    return os.read(fd, count)


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _filesystem(fd: int) -> int:
    try:
        return os.fstatvfs(fd).f_fsid
    except (OSError, AttributeError):
        return 0


def _passing_inodes(device: int) -> bool:
    """Whether a device's file system generates its inode numbers; False where that is unknown."""
    try:
        number = f"{os.major(device)}:{os.minor(device)}"
        with open(_MOUNTS, encoding="utf-8", errors="replace") as mounts:
            for line in mounts:
                fields, _, after = line.partition(" - ")
                if fields.split()[2] == number:
                    kind = after.split()[0]
                    return kind in _PASSING_INODES or kind.startswith("fuse.")
    except (OSError, IndexError, AttributeError):
        pass
    return False
