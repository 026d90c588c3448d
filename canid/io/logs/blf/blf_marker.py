"""Events in a .blf: global markers, as users of CANoe and CANalyzer set them by hand (Vector_BLF, GlobalMarker)."""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_layout import Data
from canid.values.types import Event

GLOBAL_MARKER = 96
# commented event type, foreground and background color, relocatable; lengths of group, marker and description
_MARKER = Struct("<LLL3xBLLL12x")
_BLACK, _AMBER = 0x000000, 0x00BFFF  # Windows' order of colors: 0x00BBGGRR
_GROUP = b"canid"


def marker(event: Event, stamp: int) -> bytes:
    """Encode one event. `stamp`: ns since the file's start.

    >>> data = marker(Event(1.5, "bus_lost", "can0 is lost"), 1_500_000_000)
    >>> len(data) % 4, b"bus_lost" in data, b"can0 is lost" in data
    (0, True, True)
    """
    name, says = event.what.encode(), event.says.encode("utf-8", "replace")
    # objects are padded by `size % 4` bytes, which not every reader expects: make the padding empty
    says += b" " * (-(len(_GROUP) + len(name) + len(says)) % 4)
    body = _MARKER.pack(0, _BLACK, _AMBER, 0, len(_GROUP), len(name), len(says)) + _GROUP + name + says
    size = blf.OBJECT_V1_SIZE + len(body)
    head = blf.OBJECT.pack(blf.SIGNATURE, blf.OBJECT_V1_SIZE, 1, size, GLOBAL_MARKER)
    return head + blf.STAMP.pack(blf.ONE_NANOSECOND, 0, 0, stamp) + body


class MarkerEvent(NamedTuple):
    """An event that canid wrote."""

    stamp: int  # ns since the file's start
    what: str
    says: str


def decode(data: Data, begin: int, size: int) -> MarkerEvent | None:
    """Decode the marker of `size` bytes at `begin`; None where another program wrote it, or it is damaged.

    >>> item = marker(Event(1.5, "bus_lost", "can0 is lost"), 20)
    >>> decode(item, 0, len(item))
    MarkerEvent(stamp=20, what='bus_lost', says='can0 is lost')
    """
    end, body = begin + size, begin + blf.OBJECT_V1_SIZE
    _, header_size, version, _, _ = blf.OBJECT.unpack_from(data, begin)
    if version != 1 or header_size != blf.OBJECT_V1_SIZE or body + _MARKER.size > end:
        return None
    group, name, description = _MARKER.unpack_from(data, body)[4:]
    at = body + _MARKER.size
    if at + group + name + description > end or data[at : at + group] != _GROUP:
        return None
    at += group
    unit, _, _, stamp = blf.STAMP.unpack_from(data, begin + blf.OBJECT.size)
    what, says = data[at : at + name], data[at + name : at + name + description]
    stamp -= (stamp >> 63) << 64  # canid 0.2.0 wrote negative ones, as of frames
    return MarkerEvent(
        stamp * (10_000 if unit == blf.TEN_MICROSECONDS else 1),
        what.decode("utf-8", "replace"),
        says.decode("utf-8", "replace").rstrip(" "),
    )
