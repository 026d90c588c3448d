"""Reads `candump -L` logs: `(1436509052.249713) can0 044#2A366C2BBA`, CAN FD with `##`, remote, error frames.

The names of interfaces become numbers of buses by `values.bus_names`, whichever speaks first: all names are looked for
before the first frame is given. A line is a frame in every character, a comment, a CAN XL frame, or damaged. Usual lines
are parsed as arrays (`candump_columns`), all others one by one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from canid.io.logs import candump_columns
from canid.io.logs.candump_columns import BRS_BIT, ESI_BIT
from canid.io.logs.frame_lines import Row, bus_of, read
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import MAX_TIME_NS, Bad, Line, LineCount, blocks, hex_bytes, remote_length
from canid.values import timestamps
from canid.values.bus_names import MAX_BUSES, bus_numbers
from canid.values.frame_columns import MAX_EXTENDED_ID, MAX_STANDARD_ID, WantedIds
from canid.values.types import Columns, Flag

ERROR_BIT = 0x2000_0000  # of an eight-digit id, as in linux/can.h
# the name of an interface in a line that begins like a frame (Linux allows 15 characters)
_INTERFACE = re.compile(rb"\(\d{1,20}\.\d{1,9}\)[ \t]+([!-~]{1,255})[ \t]+[0-9A-Fa-f]{3,8}#")
_FEW = 16  # names up to which counting is faster
# time, interface, id, what follows "#", direction
_LINE = re.compile(
    r"\((\d{1,20}\.\d{1,9})\)[ \t]+([!-~]+)[ \t]+([0-9A-F]{3}|[0-9A-F]{8})#([!-~]*)(?:[ \t]+([RT]))?",
    re.IGNORECASE,
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


def read_candump(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is a frame.

    `wanted`: frames with other ids may be left out.
    """
    if not state.buses:
        state.buses.update(bus_numbers(interfaces(path, state.size, _INTERFACE)))
    buses = state.buses

    def take(text: str, line: Line) -> Row | str:
        if kind := _other(text):
            return kind
        ns, interface, id_, data, flags, length = _parse(text, line)
        bus = buses.get(interface)
        return Row(ns, bus_of(interface, buses) if bus is None else bus, id_, data, flags, length)

    return read(path, state, take, wanted, fast=lambda block: candump_columns.read(block, buses))


def interfaces(path: Path, size: int, name_of: re.Pattern[bytes]) -> set[str]:
    """The names of all interfaces of a log, as many as there can be buses; nothing else is looked at.

    `name_of`: its group is the name in a line with a frame.
    """
    names: dict[bytes, None] = {}  # in the order in which they speak, which only beyond `MAX_BUSES` matters
    for block in blocks(path, ReadState(size), LineCount()):
        # usual lines of interfaces that are known are counted at the speed of a search
        known = sum(block.data.count(b") " + name + b" ") for name in names) if len(names) <= _FEW else 0
        if known < len(block.ends):
            names.update(dict.fromkeys(name_of.findall(block.data)))
        if len(names) > MAX_BUSES:
            break
    return {name.decode("latin-1") for name in [*names][:MAX_BUSES]}


def _other(text: str) -> str:
    """What kind of line it is, of those that hold no CAN frame; "" for all others."""
    if text.startswith("#"):
        return "comments" if _COMMENT.match(text) else ""
    return "CAN XL frames" if ":" in text and _XL.fullmatch(text) else ""


def _parse(text: str, line: Line) -> tuple[int, str, int, bytes, int, int]:
    match = _LINE.fullmatch(text)
    if not match:
        raise Bad("it is no candump line")
    stamp, interface, name, rest, direction = match.groups()
    if not line.whole and direction is None:
        # nothing announces the length of the data: the rest of a frame may be missing
        raise Bad("the file ends in it")
    ns = timestamps.from_text(stamp)
    if ns > MAX_TIME_NS:
        raise Bad("its time is damaged")
    id_ = int(name, 16)
    flags = int(Flag.TX) if direction in ("T", "t") else 0
    if id_ > (MAX_STANDARD_ID if len(name) == 3 else MAX_EXTENDED_ID | ERROR_BIT):
        raise Bad(f"{name!r} is too large for an id")
    if id_ & ERROR_BIT:
        flags |= Flag.ERROR
        id_ &= ERROR_BIT - 1
    elif len(name) == 8:
        flags |= Flag.EXTENDED
    if rest.startswith("#"):
        match = _FD_DATA.fullmatch(rest)
        if not match:
            raise Bad("its data are not hexadecimal")
        bits = int(match[1], 16)
        flags |= Flag.FD | (Flag.BRS if bits & BRS_BIT else 0) | (Flag.ESI if bits & ESI_BIT else 0)
        data = _octets(match[2])
        if len(data) > 64:
            raise Bad("more than 64 data bytes")
        return ns, interface, id_, data, int(flags), -1
    if rest[:1] in ("R", "r"):
        match = _REMOTE_DATA.fullmatch(rest)
        if not match:
            raise Bad("it is no remote frame")
        return ns, interface, id_, b"", int(flags | Flag.REMOTE), remote_length(int(match[1] or "0"))
    match = _CLASSIC_DATA.fullmatch(rest)
    if not match:
        raise Bad("its data are not hexadecimal")
    data = _octets(match[1])
    if len(data) > 8 or ("_" in rest and len(data) < 8):
        raise Bad(
            "more than 8 data bytes in a classic frame" if len(data) > 8 else "it announces more than 8 bytes"
        )
    return ns, interface, id_, data, int(flags), -1


def _octets(text: str) -> bytes:
    digits = text.replace(".", "")
    return hex_bytes(digits, len(digits) // 2)
