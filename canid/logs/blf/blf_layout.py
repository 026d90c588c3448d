"""The bytes of a Binary Logging File (.blf): what the reader and the writer agree on.

There is no official specification. Layout as in Toby Lorenz' Vector_BLF and python-can's `can.io.blf`:
a file header, then objects, nearly always wrapped in zlib containers of some 128 kB.
All numbers are little-endian.
"""

from __future__ import annotations

import datetime
from struct import Struct
from typing import NamedTuple

from canid.timestamps import EPOCH_FLOOR_S, NS_PER_S

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
FILE_SIGNATURE = b"LOGG"

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

CAN_MESSAGE, LOG_CONTAINER, CAN_ERROR_EXT, CAN_MESSAGE2, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64 = (
    1,
    10,
    73,
    86,
    100,
    101,
)
# restore point containers: not in the header's count, as Vector_BLF counts
UNCOUNTED_TYPE = 115

# Of frames: header, body, and what newer versions may append; a larger one is damage, and its size must not be
# followed. Of other objects it is only known that their types have numbers from 1 to some 150; 0 is a run of zeros.
_NEWER_FIELDS_BYTES = 16
MAX_OBJECT_BYTES = {
    CAN_MESSAGE: OBJECT_V2_SIZE + CLASSIC.size + _NEWER_FIELDS_BYTES,
    CAN_MESSAGE2: OBJECT_V2_SIZE + CLASSIC.size + _NEWER_FIELDS_BYTES,
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

# bytes that each DLC code announces (ISO 11898-1)
DLC_BYTES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def is_plausible(kind: int, size: int) -> bool:
    """Whether an object of this type can have this size.

    >>> is_plausible(CAN_MESSAGE, 48), is_plausible(CAN_MESSAGE, 4096), is_plausible(65, 4096), is_plausible(1 << 20, 48)
    (True, False, True, False)
    """
    return OBJECT.size <= size <= MAX_OBJECT_BYTES.get(kind, MAX_INFLATED_BYTES) and 0 < kind < MAX_TYPE


class FileHeader(NamedTuple):
    """The fields of the file header that the reader uses."""

    size: int  # bytes of the header itself
    file_size: int
    uncompressed_size: int
    objects: int
    start_ms: int | None  # epoch ms that the objects' times count from


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
    if ns is None or ns < EPOCH_FLOOR_S * NS_PER_S:
        return (0,) * 8
    t = datetime.datetime(1970, 1, 1) + datetime.timedelta(milliseconds=ns // 1_000_000)
    return t.year, t.month, t.isoweekday() % 7, t.day, t.hour, t.minute, t.second, t.microsecond // 1000


def epoch_ms(words: tuple[int, ...]) -> int | None:
    """Epoch ms of a SYSTEMTIME, None where it is no date.

    >>> epoch_ms((2018, 8, 4, 2, 15, 34, 47, 123)), epoch_ms((0,) * 8)
    (1533224087123, None)
    """
    year, month, _, day, hour, minute, second, millisecond = words
    try:
        t = datetime.datetime(year, month, day, hour, minute, second, millisecond * 1000)
    except ValueError:
        return None
    return (t - datetime.datetime(1970, 1, 1)) // datetime.timedelta(milliseconds=1)


def parse_file_header(data: bytes) -> FileHeader:
    """Parse the header from the file's first 72 bytes; the caller checks the signature."""
    words = FILE_HEADER.unpack_from(data)
    return FileHeader(words[1], words[10], words[11], words[12], epoch_ms(words[14:22]))
