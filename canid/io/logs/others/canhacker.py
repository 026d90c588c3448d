"""Reads the .trc of CanHacker: `11,201   0F1   4   34 01 00 40`: seconds, id, length, data, and perhaps a comment.

Ids of three digits have 11 bits, others 29. Seconds count up to 60 and begin again.
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
from canid.values.types import Columns

_HEADER = re.compile(r"(Time\s+ID\s+DLC\b.*|.*CANHACKER.*)", re.IGNORECASE)
_LINE = re.compile(
    r"(\d{1,12})[.,](\d{1,9})\s+([0-9A-F]{3,8})\s+([0-8])((?:\s+[0-9A-F]{2}(?!\S))*)(?:\s.*)?", re.IGNORECASE
)
_MINUTE_NS = 60 * timestamps.NS_PER_S


def read_canhacker(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is one."""
    minutes = latest = 0

    def take(text: str, line: Line) -> Row | str:
        nonlocal minutes, latest
        if _HEADER.fullmatch(text):
            return "header lines"
        match = _LINE.fullmatch(text)
        if not match:
            raise Bad("it is no line of CanHacker" if line.whole else "the file ends in it")
        whole, fraction, word, length, rest = match.groups()
        octets = rest.split()
        announced = int(length)
        if len(octets) < announced:
            raise Bad(f"it announces {announced} data bytes and has {len(octets)}")
        id_, flags = checked_id(int(word, 16), extended=len(word) > 3)
        ns = int(whole) * timestamps.NS_PER_S + int(fraction.ljust(9, "0"))
        if ns + _MINUTE_NS // 2 < latest:
            minutes += 1
        latest = ns
        # a comment may begin like a byte
        return Row(minutes * _MINUTE_NS + ns, 0, id_, bytes.fromhex("".join(octets[:announced])), flags)

    return read(path, state, take, wanted, dated=lambda: False)
