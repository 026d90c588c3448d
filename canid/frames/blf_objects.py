"""The inner layer of a .blf: from a payload to frames.

Every size is checked before it is believed. An object of an unknown type is counted and passed over.
A time of 2^63 ns or more is a negative one: so `blf_writer` keeps frames that a clock set back put before
the first.
"""

from __future__ import annotations

from typing import NamedTuple

from canid.frames import blf_layout as blf
from canid.frames.blf_containers import LIMIT, PADDING
from canid.types import Flag, Frame

_CLASSIC, _ERROR, _FD, _FD64 = blf.CLASSIC, blf.ERROR_EXT, blf.FD, blf.FD64
# plain ints: arithmetic on an IntFlag costs a microsecond
_EXTENDED, _REMOTE, _ERROR_FLAG, _TX = (int(f) for f in (Flag.EXTENDED, Flag.REMOTE, Flag.ERROR, Flag.TX))
_FD_FLAG, _BRS, _ESI = (int(f) for f in (Flag.FD, Flag.BRS, Flag.ESI))
_HEADER_SIZE = {1: blf.OBJECT_V1_SIZE, 2: blf.OBJECT_V2_SIZE}
_BODY_SIZE = {
    blf.CAN_MESSAGE: _CLASSIC.size,
    blf.CAN_MESSAGE2: _CLASSIC.size,
    blf.CAN_ERROR_EXT: _ERROR.size,
    blf.CAN_FD_MESSAGE: _FD.size,
    blf.CAN_FD_MESSAGE_64: _FD64.size,
}


class Broken(Exception):  # noqa: N818  (a finding inside this package, not an error that a user sees)
    """The payload is not a row of objects."""


class Walked(NamedTuple):
    """What a payload held."""

    frames: list[Frame]
    objects: int  # frames and objects of other types
    rest: int  # where the unfinished last object begins
    first: int | None  # ns of the log's first frame, once there was one


def first_object(data: bytes) -> int:
    """After damage: where the first whole-looking object begins, -1 if none does.

    Its header must be plausible and, if it ends in these data, another object must follow.
    """
    found = data.find(blf.SIGNATURE)
    while found >= 0 and found + blf.OBJECT.size <= len(data):
        _, header_size, version, size, _ = blf.OBJECT.unpack_from(data, found)
        end = found + size
        if _HEADER_SIZE.get(version) == header_size <= size <= LIMIT and (
            end + PADDING >= len(data) or data.find(blf.SIGNATURE, end, end + PADDING) >= 0
        ):
            return found
        found = data.find(blf.SIGNATURE, found + 1)
    return -1


def walk(data: bytes, position: int, first: int | None) -> Walked:
    """All whole objects of `data` from byte `position`.

    `first`: ns that times are relative to, None if no frame came yet. Raises Broken.
    """
    frames: list[Frame] = []
    append = frames.append
    new = tuple.__new__  # a NamedTuple's own __new__ costs twice as much, and there are millions
    unpack_object, unpack_stamp, unpack_classic = (
        blf.OBJECT.unpack_from,
        blf.STAMP.unpack_from,
        _CLASSIC.unpack_from,
    )
    objects = 0
    total = len(data)
    while True:
        begin = data.find(blf.SIGNATURE, position, position + PADDING)
        if begin < 0:
            # too little is left to tell padding from the beginning of an object
            if position + PADDING > total:
                break
            raise Broken("no object begins where one should")
        position = begin
        if position + blf.OBJECT.size > total:
            break
        _, header_size, version, size, kind = unpack_object(data, position)
        if size < blf.OBJECT.size or size > LIMIT:
            raise Broken(f"an object claims a size of {size} bytes")
        end = position + size
        if end > total:
            break
        objects += 1
        if kind in _BODY_SIZE:
            at = position + _HEADER_SIZE.get(version, size)
            if at + _BODY_SIZE[kind] > end or header_size > size:
                raise Broken("an object is too short for what it holds")
            unit, _, _, ns = unpack_stamp(data, position + 16)
            if ns >= 1 << 63:
                ns -= 1 << 64
            if unit == blf.TEN_MICROSECONDS:
                ns *= 10_000
            if first is None:
                first = ns
            t = (ns - first) * 1e-9
            if kind == blf.CAN_MESSAGE or kind == blf.CAN_MESSAGE2:
                channel, how, dlc, word, payload = unpack_classic(data, at)
                flags = _EXTENDED if word & blf.ID_EXTENDED else 0
                length = -1
                if dlc < 8:
                    payload = payload[:dlc]
                if how & blf.TX:
                    flags |= _TX
                if how & blf.REMOTE:
                    flags |= _REMOTE
                    payload, length = b"", dlc
                append(
                    new(Frame, (t, channel - 1 if channel else 0, word & blf.ID_MASK, payload, flags, length))
                )
            else:
                append(_seldom(data, at, position, size, kind, t))
        position = end
    return Walked(frames, objects, position, first)


def _seldom(data: bytes, at: int, begin: int, size: int, kind: int, t: float) -> Frame:
    """Decode a CAN FD or an error frame; `begin`, `size`: of its object, `at`: where its body begins."""
    if kind == blf.CAN_ERROR_EXT:
        channel, _, _, _, _, dlc, _, word, _, payload = _ERROR.unpack_from(data, at)
        return _frame(t, channel, word, payload[:dlc], _ERROR_FLAG)
    flags = 0
    if kind == blf.CAN_FD_MESSAGE:
        channel, how, dlc, word, _, _, fd, valid, payload = _FD.unpack_from(data, at)
        if valid > 64:
            raise Broken(f"a CAN FD frame claims {valid} bytes")
        payload = payload[:valid]
        sent, remote = how & blf.TX, how & blf.REMOTE
        is_fd, brs, esi = fd & blf.FD_EDL, fd & blf.FD_BRS, fd & blf.FD_ESI
    else:
        channel, dlc, valid, _, word, _, fd, _, _, _, _, _, sent, extended_at, _ = _FD64.unpack_from(data, at)
        body = at + _FD64.size
        room = (begin + extended_at if extended_at else begin + size) - body
        if valid > 64 or room < 0 or body + room > begin + size:
            raise Broken("a CAN FD frame's sizes do not agree")
        # CANoe logs fewer bytes than are valid where the rest is zero
        payload = data[body : body + min(valid, room)].ljust(valid, b"\0")
        remote = fd & blf.FD64_REMOTE
        is_fd, brs, esi = fd & blf.FD64_EDL, fd & blf.FD64_BRS, fd & blf.FD64_ESI
    flags |= _TX if sent else 0
    flags |= _FD_FLAG if is_fd else 0
    flags |= _BRS if brs else 0
    flags |= _ESI if esi else 0
    if remote:
        return _frame(t, channel, word, b"", flags | _REMOTE, blf.DLC_BYTES[min(dlc, 15)])
    return _frame(t, channel, word, payload, flags)


def _frame(t: float, channel: int, word: int, data: bytes, flags: int, length: int = -1) -> Frame:
    if word & blf.ID_EXTENDED:
        flags |= _EXTENDED
    return Frame(t, channel - 1 if channel else 0, word & blf.ID_MASK, data, flags, length)
