"""Reads the .csv that python-can's CSVWriter writes; it knows no channel and no direction: all is bus 0.

A line is the header, a frame in every character, or damaged.
"""

from __future__ import annotations

import base64
import binascii
import re
from collections.abc import Iterator
from pathlib import Path

from canid.io.logs.frame_lines import Row, read
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import MAX_TIME_NS, Bad, Line, remote_length
from canid.values import timestamps
from canid.values.frame_columns import MAX_EXTENDED_ID, MAX_STANDARD_ID, WantedIds
from canid.values.types import Columns, Flag

_COLUMN_NAMES = "timestamp,arbitration_id,extended,remote,error,dlc,data"
# as Python writes floats and hexadecimal numbers; int() and float() take more, such as underscores
_TIME_WORD = re.compile(r"\d{1,20}(\.\d{1,20})?(e[+-]?\d{1,3})?")
_ID_WORD = re.compile(r"0x[0-9a-f]{1,8}", re.IGNORECASE)
_DLC = re.compile(r"\d{1,2}")


def read_csv(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is one."""
    numbered = False  # pandas writes the number of each row before it

    def take(text: str, line: Line) -> Row | str:
        nonlocal numbered
        numbered |= text == f",{_COLUMN_NAMES}"
        number, _, rest = text.partition(",")
        return _take(rest if numbered and (not number or number.isdecimal()) else text)

    return read(path, state, take, wanted)


def _take(text: str) -> Row | str:
    if text == _COLUMN_NAMES:
        return "header lines"
    try:
        ns, id_, data, flags, length = _parse(text)
    except (ValueError, OverflowError) as error:
        raise error if isinstance(error, Bad) else Bad(f"it is not {_COLUMN_NAMES}") from None
    return Row(ns, 0, id_, data, flags, length)


def _parse(text: str) -> tuple[int, int, bytes, int, int]:
    stamp, id_, extended, remote, error, dlc, packed = text.split(",")
    if not (_TIME_WORD.fullmatch(stamp) and _ID_WORD.fullmatch(id_) and _DLC.fullmatch(dlc)):
        raise Bad(f"it is not {_COLUMN_NAMES}")
    flags = 0
    for word, flag in ((extended, Flag.EXTENDED), (remote, Flag.REMOTE), (error, Flag.ERROR)):
        if word not in ("0", "1"):
            raise Bad(f"{word!r} is neither 0 nor 1")
        flags |= int(flag) if word == "1" else 0
    try:
        data = base64.b64decode(packed, validate=True)
    except binascii.Error:
        raise Bad("its data are not base64") from None
    announced, number, ns = int(dlc), int(id_, 16), timestamps.from_float(float(stamp))
    if not 0 <= ns <= MAX_TIME_NS:
        raise Bad("its time is damaged")
    if number > (MAX_EXTENDED_ID if flags & (Flag.EXTENDED | Flag.ERROR) else MAX_STANDARD_ID):
        raise Bad(f"{id_[:32]!r} is too large for an id")
    if flags & Flag.REMOTE:
        if data:
            raise Bad("it is a remote frame and has data")
        return ns, number, b"", flags, remote_length(announced)
    if len(data) != announced and not flags & Flag.ERROR:
        raise Bad(f"it announces {announced} data bytes and has {len(data)}")
    # the format has no mark for CAN FD, but its length gives it away
    flags |= int(Flag.FD) if len(data) > 8 else 0
    return ns, number, data, flags, -1
