"""Reads `candump -L` logs: `(1436509052.249713) can0 044#2A366C2BBA`, CAN FD with `##`, remote, error frames.

Interfaces become buses 0, 1, ... in the order in which they first appear. A line is a frame in every character, a
comment, a CAN XL frame, or damaged.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from canid import timestamps
from canid.logs.reader_state import ReadState
from canid.logs.text_lines import (
    MAX_EXTENDED_ID,
    MAX_TIME_NS,
    Bad,
    Line,
    LineCount,
    hex_bytes,
    lines,
    remote_length,
)
from canid.types import Flag, Frame

ERROR_BIT = 0x2000_0000  # of an eight-digit id, as in linux/can.h
_BRS, _ESI = 1, 2  # linux/can.h: flags of struct canfd_frame
_MAX_STANDARD_ID = 0x7FF
# time, interface, id, what follows "#", direction
_LINE = re.compile(
    r"\((\d{1,20}\.\d{1,9})\)\s+([!-~]+)\s+([0-9A-F]{3}|[0-9A-F]{8})#([!-~]*)(?:\s+([RT]))?", re.IGNORECASE
)
# data, points between bytes or none; "_9" to "_F" behind 8 bytes is the raw DLC, which adds nothing
_CLASSIC_DATA = re.compile(r"((?:[0-9A-F]{2}\.?)*)(?:_[9A-F])?", re.IGNORECASE)
_REMOTE_DATA = re.compile(r"R([0-8]?)(?:_[9A-F])?", re.IGNORECASE)
_FD_DATA = re.compile(r"#([0-9A-F])((?:[0-9A-F]{2}\.?)*)", re.IGNORECASE)
# virtual network and priority, flags, type, acceptance field, data
_XL = re.compile(
    r"\(\d+\.\d+\)\s+[!-~]+\s+[0-9A-F]{5}#[0-9A-F]{2}:[0-9A-F]{2}:[0-9A-F]{8}#[0-9A-F.]*(?:\s+[RT])?",
    re.IGNORECASE,
)
# A comment. One that goes on like a line of the log is a line whose first character is damaged.
_COMMENT = re.compile(r"#(?!\(?\d+\.\d+\))")


def read_candump(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file; raises LogError where no line is one."""
    count = LineCount()
    buses: dict[str, int] = {}
    first: int | None = None
    for line in lines(path, state, count):
        text = line.text.strip()
        if not text:
            continue
        if kind := _other(text):
            count.others[kind] += 1
            continue
        try:
            ns, interface, id_, data, flags, length = _parse(text, line)
        except Bad as error:
            count.miss(line, str(error))
            continue
        if first is None:
            first = ns
            state.start_ns = ns
        count.read += 1
        bus = buses.setdefault(interface, len(buses))
        yield Frame((ns - first) * 1e-9, bus, id_, data, flags, length)
    count.close(path, state)


def _other(text: str) -> str:
    """What kind of line it is, of those that hold no CAN frame; "" for all others."""
    if text.startswith("#"):
        return "comments" if _COMMENT.match(text) else ""
    return "CAN XL frames" if ":" in text and _XL.fullmatch(text) else ""


def _parse(text: str, line: Line) -> tuple[int, str, int, bytes, int, int]:
    found = _LINE.fullmatch(text)
    if not found:
        raise Bad("it is no candump line")
    stamp, interface, name, rest, direction = found.groups()
    if not line.whole and direction is None:
        # nothing announces the length of the data: the rest of a frame may be missing
        raise Bad("the file ends in it")
    ns = timestamps.from_text(stamp)
    if ns > MAX_TIME_NS:
        raise Bad("its time is damaged")
    id_ = int(name, 16)
    flags = int(Flag.TX) if direction in ("T", "t") else 0
    if id_ > (_MAX_STANDARD_ID if len(name) == 3 else MAX_EXTENDED_ID | ERROR_BIT):
        raise Bad(f"{name!r} is too large for an id")
    if id_ & ERROR_BIT:
        flags |= Flag.ERROR
        id_ &= ERROR_BIT - 1
    elif len(name) == 8:
        flags |= Flag.EXTENDED
    if rest.startswith("#"):
        found = _FD_DATA.fullmatch(rest)
        if not found:
            raise Bad("its data are not hexadecimal")
        bits = int(found[1], 16)
        flags |= Flag.FD | (Flag.BRS if bits & _BRS else 0) | (Flag.ESI if bits & _ESI else 0)
        data = _octets(found[2])
        if len(data) > 64:
            raise Bad("more than 64 data bytes")
        return ns, interface, id_, data, int(flags), -1
    if rest[:1] in ("R", "r"):
        found = _REMOTE_DATA.fullmatch(rest)
        if not found:
            raise Bad("it is no remote frame")
        return ns, interface, id_, b"", int(flags | Flag.REMOTE), remote_length(int(found[1] or "0"))
    found = _CLASSIC_DATA.fullmatch(rest)
    if not found:
        raise Bad("its data are not hexadecimal")
    data = _octets(found[1])
    if len(data) > 8 or ("_" in rest and len(data) < 8):
        raise Bad(
            "more than 8 data bytes in a classic frame" if len(data) > 8 else "it announces more than 8 bytes"
        )
    return ns, interface, id_, data, int(flags), -1


def _octets(text: str) -> bytes:
    digits = text.replace(".", "")
    return hex_bytes(digits, len(digits) // 2)
