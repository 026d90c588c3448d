"""Reads frames that are printed with the name of each field: what python-can shows on the screen, and sets made of it.

`Timestamp: 1479121434.850202    ID: 0350    S Rx    DL:  8    05 28 84 66 6d 00 00 a2    Channel: can0` (python-can's
`Message.__str__`; DLC: in older versions). Flags: X 29 bits, S 11, E error, R remote, F or FD CAN FD, BS bit-rate switch,
EI error state. The car-hacking set of HCRL has `000` in their place; there an id of eight digits has 29 bits.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from canid.io.logs.frame_lines import Row, bus_of, checked_id, read
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Bad, Line, LineCount, lines, remote_length
from canid.values import timestamps
from canid.values.bus_names import MAX_BUSES, bus_numbers
from canid.values.frame_columns import WantedIds
from canid.values.types import Columns, Flag

_LINE = re.compile(
    # behind what a logging library writes before it
    r"(?:(?:(?!ID:).){1,120}[\s:])?Timestamp:\s*(\d{1,12}\.\d{1,9})\s+ID:\s*([0-9a-f]{1,8})\s+((?:(?:[XSERF]|FD|BS|EI|Rx|Tx|0{3})\s+)*)DLC?:\s*(\d{1,2})"
    r"((?:\s+[0-9a-f]{2}(?!\S))*)(?:\s+'.{0,64}')?(?:\s+Channel:\s*(\S.{0,254}))?",
    re.IGNORECASE,
)
_CHANNEL = re.compile(r".*\sChannel:\s*(\S.{0,254})", re.IGNORECASE)
_FLAGS = {
    "X": Flag.EXTENDED, "S": Flag.NONE, "E": Flag.ERROR, "R": Flag.REMOTE, "F": Flag.FD, "FD": Flag.FD, "BS": Flag.BRS,
    "EI": Flag.ESI, "RX": Flag.NONE, "TX": Flag.TX, "000": Flag.NONE,
}  # fmt: skip


def read_labelled(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is one."""
    names = set[str]()
    for line in lines(path, ReadState(state.size), LineCount()) if not state.buses else ():
        match = _CHANNEL.fullmatch(line.text.strip())
        if match is not None and len(names) < MAX_BUSES:
            names.add(match[1].strip())
    state.buses.update(bus_numbers(names))
    stamped = False

    def take(text: str, line: Line) -> Row | str:
        nonlocal stamped
        match = _LINE.fullmatch(text)
        if not match:
            raise Bad("it is no frame with named fields" if line.whole else "the file ends in it")
        stamp, word, marks, length, rest, channel = match.groups()
        words = marks.upper().split()
        flags = sum({int(_FLAGS[mark]) for mark in words})
        wide = True if "X" in words or len(word) == 8 else False if "S" in words else None
        announced, data = int(length), bytes.fromhex(rest)
        ns = timestamps.from_text(stamp)
        stamped |= ns >= timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S
        bus = bus_of(channel.strip(), state.buses) if channel else 0
        number = int(word, 16)
        if flags & Flag.ERROR:
            return Row(ns, bus, number & 0x1FFFFFFF, data, flags)
        id_, width = checked_id(number, extended=wide)
        if flags & Flag.REMOTE:
            return Row(ns, bus, id_, b"", flags | int(width), remote_length(announced))
        if len(data) != announced:
            raise Bad(f"it announces {announced} data bytes and has {len(data)}")
        flags |= int(width) | (int(Flag.FD) if announced > 8 else 0)
        return Row(ns, bus, id_, data, flags)

    return read(path, state, take, wanted, dated=lambda: stamped)
