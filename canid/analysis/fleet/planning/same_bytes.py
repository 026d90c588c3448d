"""Logs with the same bytes: only those are hashed whose size another log has, and whose beginning and end as well."""

from __future__ import annotations

import hashlib
import os
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import NamedTuple

# bytes of the beginning and of the end that are compared first
_ENDS_BYTES = 4096


class File(NamedTuple):
    """A local file that is to be analysed."""

    path: str
    size: int  # bytes
    number: int  # by which the caller knows it


def hashes(
    files: Sequence[File], stored: Collection[int], progress: Callable[[float], None] = lambda _: None
) -> Iterator[tuple[int, str]]:
    """SHA-256 of the files that may have the bytes of another one.

    Args:
        files: to be compared.
        stored: sizes of logs whose results are stored.
        progress: is called with the share of the bytes that is done.

    Yields:
        number and hash. A file that cannot be read has none: its analysis says why.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> folder = Path(tempfile.mkdtemp())
        >>> files = []
        >>> for number, content in enumerate((b"one", b"two", b"one", b"three")):
        ...     path = folder / f"{number}.blf"
        ...     _ = path.write_bytes(content)
        ...     files.append(File(str(path), len(content), number))
        >>> [number for number, _ in hashes(files, ())]
        [0, 2]
    """
    often = Counter(file.size for file in files)
    known = frozenset(stored)
    groups: defaultdict[tuple[int, bytes], list[File]] = defaultdict(list)
    for file in files:
        # empty files are all the same, and cost nothing
        if file.size > 0 and (file.size in known or often[file.size] > 1):
            groups[file.size, b"" if file.size in known else _ends(file)].append(file)
    chosen = [
        file for (size, _), group in groups.items() if size in known or len(group) > 1 for file in group
    ]
    total, done = sum(file.size for file in chosen) or 1, 0
    for file in chosen:
        made = _sha256(file.path)
        done += file.size
        progress(done / total)
        if made:
            yield file.number, made


def _ends(listed: File) -> bytes:
    """Hash of the beginning and the end; of a file that cannot be read, of its name."""
    try:
        with open(listed.path, "rb") as file:
            begin = file.read(_ENDS_BYTES)
            file.seek(max(listed.size - _ENDS_BYTES, 0))
            return hashlib.blake2b(begin + file.read(_ENDS_BYTES), digest_size=16).digest()
    except OSError:
        return hashlib.blake2b(os.fsencode(listed.path), digest_size=16).digest()


def _sha256(path: str) -> str:
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""
