"""Reads the .csv that python-can's CSVWriter writes; it knows no channel and no direction: all is bus 0.

A line is the header, a frame in every character, or damaged. Bytes may be hexadecimal, as scripts write them under its
header; columns of their own behind the data are not read.
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
_HEX = re.compile(r"[0-9a-f]+", re.IGNORECASE)


def read_csv(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is one."""
    numbered = False  # pandas writes the number of each row before it
    more = 0  # columns behind those of python-can

    def take(text: str, line: Line) -> Row | str:
        nonlocal numbered, more
        numbered |= text.startswith(f",{_COLUMN_NAMES}")
        number, _, rest = text.partition(",")
        text = rest if numbered and (not number or number.isdecimal()) else text
        if text.startswith(f"{_COLUMN_NAMES},") and not more:
            names = text.removeprefix(f"{_COLUMN_NAMES},")
            more = names.count(",") + 1
            state.remark(f"its columns {names} are not read")
        text = (
            text.rsplit(",", more)[0] if more and text.count(",") == _COLUMN_NAMES.count(",") + more else text
        )
        return _take(text)

    return read(path, state, take, wanted)


def _bytes(packed: str, length: int) -> bytes:
    """Hexadecimal or base64: of 2 or 4 bytes both are equally long, but base64 then ends with =."""
    if len(packed) == 2 * length and _HEX.fullmatch(packed):
        return bytes.fromhex(packed)
    return base64.b64decode(packed, validate=True)


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
    announced, number, ns = int(dlc), int(id_, 16), timestamps.from_float(float(stamp))
    try:
        data = _bytes(packed, announced)
    except binascii.Error:
        raise Bad("its data are neither base64 nor hexadecimal") from None
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
