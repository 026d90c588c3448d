"""The bytes of a Binary Logging File (.blf): what the reader and the writer agree on.

There is no official specification. Layout as in Toby Lorenz' Vector_BLF and python-can's `can.io.blf`:
a file header, then objects, nearly always wrapped in zlib containers of some 128 kB.
All numbers are little-endian.
"""

from __future__ import annotations

import datetime
from enum import Enum
from struct import Struct
from typing import NamedTuple

from canid.values.frame_columns import DLC_BYTES

# The usual container holds 128 kB; 128 times that is no container but damage or a zip bomb.
MAX_INFLATED_BYTES = 16 * 1024 * 1024
# Contents of a container: zlib returns the one, libdeflate the other.
Data = bytes | bytearray
# Objects are padded by at most 3 bytes; search a little further, as python-can and Vector's library do.
MAX_PADDING_BYTES = 8

# signature, header size, application id and version (3), format version (4), file size, uncompressed size,
# object count, objects read, start (SYSTEMTIME), stop (SYSTEMTIME)
FILE_HEADER = Struct("<4sL8BQQLL8H8H")
FILE_HEADER_SIZE = 144
# every known writer's header has 144 bytes; others are accepted up to this
MAX_FILE_HEADER_SIZE = 4096
FILE_SIGNATURE = b"LOGG"
# In the header's reserved bytes: canid wrote it, and its start is UTC. The format has no place for a zone: Vector's tools
# write local time; python-can, and canid up to 0.2, UTC, both with these bytes in the place of the application's version.
UTC_MARK, UTC_MARK_AT = b"canid: UTC", 128
PYTHON_CAN = bytes((5, 0, 0, 0, 2, 6, 8, 1))
_APPLICATION_AT = 8

# signature, header size, header version, object size, object type
OBJECT = Struct("<4sHHLL")
SIGNATURE = b"LOBJ"
# flags (unit of the time), client, object version, time; version 2 headers are 8 bytes longer
STAMP = Struct("<LHHQ")
OBJECT_V1_SIZE = OBJECT.size + STAMP.size
OBJECT_V2_SIZE = OBJECT_V1_SIZE + 8
TEN_MICROSECONDS, ONE_NANOSECOND = 1, 2

# compression method, size of the data when uncompressed
CONTAINER = Struct("<H6xL4x")
CONTAINER_HEAD_SIZE = OBJECT.size + CONTAINER.size
STORED, DEFLATED = 0, 2

# channel, flags, dlc, id, data
CLASSIC = Struct("<HBBL8s")
# channel, flags, dlc, id, frame length, bit count, FD flags, valid bytes, data
FD = Struct("<HBBLLBBB5x64s")
# channel, dlc, valid bytes, tx count, id, frame length, flags, arbitration and data bit rate, offsets of BRS
# and CRC delimiter, bit count, direction, offset of the extended data, crc; the data follow
FD64 = Struct("<BBBBLLLLLLLHBBL")
# channel, length, flags, ecc, position, dlc, frame length, id, flags, data
ERROR_EXT = Struct("<HHLBBBxLLH2x8s")

CAN_MESSAGE, LOG_CONTAINER, CAN_MESSAGE2, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64 = 1, 10, 86, 100, 101
# error frames: with a channel alone, with what was on the bus, of a CAN FD channel
CAN_ERROR, CAN_ERROR_EXT, CAN_FD_ERROR_64 = 2, 73, 104
ERRORS = (CAN_ERROR, CAN_ERROR_EXT, CAN_FD_ERROR_64)
# bytes behind the header of `CAN_ERROR`, and before the data of `CAN_FD_ERROR_64`
CAN_ERROR_BYTES, CAN_FD_ERROR_64_BYTES = 8, 44
# restore point containers: not in the header's count, as Vector_BLF counts
UNCOUNTED_TYPE = 115

# Of frames: header, body, and what newer versions may append; a larger one is damage, and its size must not be
# followed. Of other objects it is only known that their types have numbers from 1 to some 150; 0 is a run of zeros.
_NEWER_FIELDS_BYTES = 16
MAX_OBJECT_BYTES = {
    CAN_MESSAGE: OBJECT_V2_SIZE + CLASSIC.size + _NEWER_FIELDS_BYTES,
    CAN_MESSAGE2: OBJECT_V2_SIZE + CLASSIC.size + _NEWER_FIELDS_BYTES,
    CAN_ERROR: OBJECT_V2_SIZE + CAN_ERROR_BYTES,
    CAN_FD_ERROR_64: OBJECT_V2_SIZE + CAN_FD_ERROR_64_BYTES + 64 + 255,
    CAN_ERROR_EXT: OBJECT_V2_SIZE + ERROR_EXT.size + _NEWER_FIELDS_BYTES,
    CAN_FD_MESSAGE: OBJECT_V2_SIZE + FD.size + _NEWER_FIELDS_BYTES,
    CAN_FD_MESSAGE_64: OBJECT_V2_SIZE + FD64.size + 64 + 255,  # the extended data begin at a byte's offset
}
MAX_TYPE = 1024

ID_MASK = 0x1FFFFFFF
ID_EXTENDED = 0x80000000
TX, REMOTE = 0x01, 0x80  # flags of CLASSIC and FD
FD_EDL, FD_BRS, FD_ESI = 1, 2, 4  # FD flags of FD
FD64_REMOTE, FD64_EDL, FD64_BRS, FD64_ESI = 0x10, 0x1000, 0x2000, 0x4000
# A transmit request is no frame on the bus: by the direction, or by a flag of FD64.
DIRECTION_MASK, REQUEST, FD64_REQUEST = 0x0F, 2, 0x80


def is_plausible(kind: int, size: int) -> bool:
    """Whether an object of this type can have this size.

    >>> is_plausible(CAN_MESSAGE, 48), is_plausible(CAN_MESSAGE, 4096), is_plausible(65, 4096), is_plausible(1 << 20, 48)
    (True, False, True, False)
    """
    return OBJECT.size <= size <= MAX_OBJECT_BYTES.get(kind, MAX_INFLATED_BYTES) and 0 < kind < MAX_TYPE


class Clock(Enum):
    """The zone of a header's start."""

    UTC = "UTC"
    LOCAL = "local time"
    UNSTATED = "UTC or local time"


class FileHeader(NamedTuple):
    """The fields of the file header that the reader uses."""

    size: int  # bytes of the header itself
    file_size: int
    uncompressed_size: int
    objects: int
    start: datetime.datetime | None  # that the objects' times count from, whole ms, without a zone
    clock: Clock


def dlc_of(length: int) -> int:
    """Find the smallest DLC code that announces at least `length` bytes.

    >>> dlc_of(8), dlc_of(9), dlc_of(64)
    (8, 9, 15)
    """
    return next(code for code, announced in enumerate(DLC_BYTES) if announced >= length)


def system_time(ns: int | None) -> tuple[int, ...]:
    """Epoch ns as the eight words of a SYSTEMTIME, UTC, milliseconds rounded down; zeros where unknown.

    >>> system_time(1533224087_123_456_789)
    (2018, 8, 4, 2, 15, 34, 47, 123)
    """
    if ns is None:
        return (0,) * 8
    t = datetime.datetime(1970, 1, 1) + datetime.timedelta(milliseconds=ns // 1_000_000)
    return t.year, t.month, t.isoweekday() % 7, t.day, t.hour, t.minute, t.second, t.microsecond // 1000


def date(words: tuple[int, ...]) -> datetime.datetime | None:
    """A SYSTEMTIME, None where it is no date.

    >>> date((2018, 8, 4, 2, 15, 34, 47, 123)), date((0,) * 8)
    (datetime.datetime(2018, 8, 2, 15, 34, 47, 123000), None)
    """
    year, month, _, day, hour, minute, second, millisecond = words
    try:
        return datetime.datetime(year, month, day, hour, minute, second, millisecond * 1000)
    except ValueError:
        return None


def parse_file_header(data: bytes) -> FileHeader:
    """Parse the header from the file's first 144 bytes, 72 at least; the caller checks the signature."""
    words = FILE_HEADER.unpack_from(data)
    clock = Clock.LOCAL
    if data.startswith(UTC_MARK, UTC_MARK_AT):
        clock = Clock.UTC
    elif data.startswith(PYTHON_CAN, _APPLICATION_AT):
        clock = Clock.UNSTATED
    return FileHeader(words[1], words[10], words[11], words[12], date(words[14:22]), clock)


def joined_header(data: bytes) -> FileHeader | None:
    """The header of a further file that begins with `data`, 144 bytes; None where it is none.

    >>> joined_header(FILE_SIGNATURE + bytes(140)) is None
    True
    """
    if len(data) < FILE_HEADER.size or not data.startswith(FILE_SIGNATURE):
        return None
    header = parse_file_header(data)
    return header if FILE_HEADER.size <= header.size <= MAX_FILE_HEADER_SIZE else None
