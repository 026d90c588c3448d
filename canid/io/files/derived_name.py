"""Names derived from another file's name: of a long one only the beginning, so that the file can be created."""

from __future__ import annotations

import os
import zlib
from pathlib import Path

# bytes of a file's name, the limit of ext4, XFS, btrfs, APFS and NTFS alike: NAME_MAX of limits.h
MAX_NAME_BYTES = 255
# what stands in a name for what was left out of it
_MARK = "~{:08x}"
_MARK_BYTES = 9


def derived(stem: str, ending: str) -> str:
    """`stem` and `ending` as a name that a file can have.

    Of a stem that is too long the beginning is kept, whole characters, and a checksum of it all: the same stem gives the
    same name, and two that begin alike have two names.

    >>> derived("drive", ".events.jsonl"), len(derived("d" * 251, ".events.jsonl"))
    ('drive.events.jsonl', 255)
    """
    return short_stem(stem, len(os.fsencode(ending))) + ending


def short_stem(stem: str, room: int) -> str:
    """A stem that leaves `room` bytes of a name for endings; see `derived`.

    >>> short_stem("drive", 40), len(short_stem("d" * 251, 40))
    ('drive', 215)
    """
    left = MAX_NAME_BYTES - room
    if len(os.fsencode(stem)) <= left:
        return stem
    kept = stem[: left - _MARK_BYTES]
    while len(os.fsencode(kept)) > left - _MARK_BYTES:
        kept = kept[:-1]
    return kept + _MARK.format(zlib.crc32(os.fsencode(stem)))


def sibling(path: Path, stem: str, ending: str) -> Path:
    """A path in the folder of `path`, its name derived.

    >>> sibling(Path("a/x.blf"), "x", ".events.jsonl").as_posix()
    'a/x.events.jsonl'
    """
    return path.with_name(derived(stem, ending))
