"""When a recording goes on in a new file, and how long the old ones are kept."""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

from canid.io.logs.writer import Writer
from canid.values.errors import ConfigError
from canid.values.frame_columns import CLASSIC_BYTES
from canid.values.types import Event

# bytes; a BLF's header and its first container must fit, and more
MIN_FILE_BYTES = 10_000
# s; a checkpoint must fit
MIN_FILE_TIME_S = 1.0
# A file is full at this share of its size: beyond it, finding out what compression saves costs a container each time.
_FULL_SHARE = 0.95
# bytes that a container's own header, padding, the longest line of a text log (330: CAN FD in .asc) and its last one add
_MARGIN_BYTES = 512
# bytes of a frame at most, uncompressed, of up to 8 and of up to 64 data bytes: as an object of a .blf or a line of an .asc
_ROW_BYTES, _FD_ROW_BYTES = 200, 330
# bytes of a note, apart from its text
_NOTE_BYTES = 160
# characters of a note's text in a file of limited size; the journal has it whole
MAX_NOTE_TEXT = 1000


class Rotation(NamedTuple):
    """Limits of one file, and of all files of one recording together (a ring: the oldest goes first)."""

    size: int = 0  # bytes of one file; 0: no limit
    time: float = math.inf  # s of one file
    keep_time: float = math.inf  # s that a finished file is kept
    keep_share: float = math.nan  # of the disk that all files together may take; NaN: no limit

    @property
    def ring(self) -> bool:
        """Whether old files are deleted."""
        return self.keep_time < math.inf or self.keep_share == self.keep_share


def checked(rotation: Rotation) -> Rotation | None:
    """The rotation, None where nothing is limited; raises ConfigError for limits that are too small or incomplete.

    >>> checked(Rotation()) is None, checked(Rotation(time=60.0)).ring
    (True, False)
    """
    if rotation.size and rotation.size < MIN_FILE_BYTES:
        raise ConfigError(f"files of {rotation.size} bytes are too small: {MIN_FILE_BYTES} is the least")
    if rotation.time < MIN_FILE_TIME_S:
        raise ConfigError(f"files of {rotation.time:g} s are too short: {MIN_FILE_TIME_S:g} s is the least")
    if rotation.size or rotation.time < math.inf:
        return rotation
    if rotation.ring:
        raise ConfigError(
            "a ring deletes whole files: give --file-size or --file-time, at which a new one begins"
        )
    return None


def has_room(writer: Writer, rotation: Rotation, event: Event) -> bool:
    """Whether an event fits into the file without making it larger than its limit."""
    size = len(event.says.encode("utf-8", "replace")) + len(event.what) + _NOTE_BYTES
    return not rotation.size or writer.bytes + writer.waiting + size + _MARGIN_BYTES < rotation.size


def is_full(writer: Writer, rotation: Rotation) -> bool:
    """Whether the next frame belongs into a new file by size; may write a container to find out.

    What waits is counted uncompressed, so no file ever becomes larger than its limit.
    """
    if not rotation.size or writer.bytes + writer.waiting + _MARGIN_BYTES < rotation.size:
        return False
    writer.checkpoint(sync=False)
    return writer.bytes > _FULL_SHARE * rotation.size


def certain_rows(writer: Writer, rotation: Rotation, width: int) -> int:
    """How many frames may be appended, after one that belongs into the file, until `is_full` has to be asked again.

    `width`: bytes of data that the longest of them may have.
    """
    if not rotation.size:
        return sys.maxsize
    left = rotation.size - writer.bytes - writer.waiting - _MARGIN_BYTES
    return 1 + max(left - 1, 0) // (_ROW_BYTES if width <= CLASSIC_BYTES else _FD_ROW_BYTES)
