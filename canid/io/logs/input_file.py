"""What a path that is to be read names: a regular file, or why it is none."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from canid.values.errors import ConfigError, LogError
from canid.values.processes.kernel_files import of_the_kernel

# what downloads leave instead of the file, and what holds it: first bytes in lower case, and what to do
_OTHERS = (
    (
        b"version https://git-lfs",
        "is a pointer of Git LFS, not the file itself: fetch it with `git lfs pull`",
    ),
    (b"<!doctype html", "is a page of a web server, not the file itself: download it anew"),
    (b"<html", "is a page of a web server, not the file itself: download it anew"),
    (b"%pdf-", "is a PDF: export the numbers as .csv"),
    (b"pk\x03\x04", "is a ZIP archive, or a workbook: unpack it, or save it as .csv"),
    (b"\xfd7zxz\x00", "is compressed by xz: unpack it, or compress it by gzip, which is read"),
    (b"\x28\xb5\x2f\xfd", "is compressed by zstd: unpack it, or compress it by gzip, which is read"),
    (b"bzh91ay&sy", "is compressed by bzip2: unpack it, or compress it by gzip, which is read"),
    (b"matlab 5.0", "is a MATLAB file: write its columns as .csv, by writetable"),
    (b"\x89hdf\r\n\x1a\n", "is an HDF5 file (.h5, MATLAB 7.3): write its columns as .csv or .parquet"),
    (b"7z\xbc\xaf\x27\x1c", "is a 7-Zip archive: unpack it"),
)


def regular_file(path: Path) -> os.stat_result:
    """The state of a file that can be read as a log or a table; a pipe would be waited for, a device never ends.

    Raises ConfigError where nothing is there, LogError where it is no file.

    >>> regular_file(Path("/nowhere/drive.blf"))
    Traceback (most recent call last):
    canid.values.errors.ConfigError: no such log: /nowhere/drive.blf
    """
    try:
        status = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise ConfigError(f"no such log: {path}") from None
    except (OSError, ValueError) as error:
        raise LogError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from None
    if stat.S_ISDIR(status.st_mode):
        raise LogError(f"{path} is a folder: name a log file in it")
    if not stat.S_ISREG(status.st_mode) or of_the_kernel(status):
        raise LogError(f"{path} is no file but a device or a pipe: name a log file")
    for begin, says in _OTHERS if (first := _begin(path)) else ():
        if first.startswith(begin):
            raise LogError(f"{path} {says}")
    return status


def _begin(path: Path) -> bytes:
    """The first bytes of a file, in lower case; none where it cannot be read, which whoever reads it says."""
    try:
        with path.open("rb") as file:
            return file.read(64).lstrip().lower()
    except OSError:
        return b""


def is_regular(path: Path) -> bool:
    """Whether a path names what `regular_file` takes: before a file is looked into to learn what it is.

    >>> is_regular(Path("/nowhere/drive.blf"))
    False
    """
    try:
        regular_file(path)
    except (ConfigError, LogError):
        return False
    return True
