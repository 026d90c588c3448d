"""Reads CRTD, the log of OVMS and the format of its network server (OVMS user guide, "CRTD CAN Log Format").

`1524311386.811100 1R11 7E8 03 41 0D 32`: seconds, bus from 1 on (none: 1), R or T and the width of the id, id, data. A
record whose type begins with C holds no frame: CXX a comment, CEV an event, CER an error, CST statistics, CVR a version.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from canid.io.logs.frame_lines import Row, checked_id, read
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Bad, Line
from canid.values import timestamps
from canid.values.frame_columns import WantedIds
from canid.values.types import Columns, Flag

_LINE = re.compile(
    r"(\d{1,12}(?:\.\d{1,9})?)\s+(\d{0,2})([RT])(11|29)\s+([0-9A-F]{1,8})((?:\s+[0-9A-F]{2})*)", re.IGNORECASE
)
_OTHER = re.compile(r"\d{1,12}(?:\.\d{1,9})?\s+\d{0,2}(C[A-Z]{2})(?:\s.*)?", re.IGNORECASE)
_KINDS = {"CXX": "comments", "CEV": "events", "CER": "error counters", "CST": "bus statistics"}
_MAX_BYTES = 64


def read_crtd(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is one."""
    stamped = False

    def take(text: str, line: Line) -> Row | str:
        nonlocal stamped
        if other := _OTHER.fullmatch(text):
            return _KINDS.get(other[1].upper(), "header lines")
        match = _LINE.fullmatch(text)
        if not match:
            raise Bad("it is no line of a CRTD log" if line.whole else "the file ends in it")
        if not line.whole:
            raise Bad("the file ends in it")  # nothing says how many bytes it had
        stamp, bus, way, width, word, rest = match.groups()
        id_, flags = checked_id(int(word, 16), extended=width == "29")
        data = bytes.fromhex(rest)
        if len(data) > _MAX_BYTES:
            raise Bad(f"more than {_MAX_BYTES} data bytes")
        flags |= (Flag.TX if way in "tT" else 0) | (Flag.FD if len(data) > 8 else 0)
        ns = timestamps.from_text(stamp)
        stamped |= ns >= timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S
        return Row(ns, max(int(bus or 1) - 1, 0), id_, data, int(flags))

    return read(path, state, take, wanted, dated=lambda: stamped)
