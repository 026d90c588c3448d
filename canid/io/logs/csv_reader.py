"""Reads the .csv that python-can's CSVWriter writes; it knows no channel and no direction: all is bus 0.

A line is the header, a frame in every character, or damaged. Bytes may be hexadecimal, as scripts write them under its
header; columns of their own behind the data are not read.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterator
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
# a row, for its length and its bytes
_HEX_ROW = re.compile(r"(?:[^,]*,){5}(\d{1,2}),([^,]+)")


def read_csv(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is one."""
    numbered = False  # pandas writes the number of each row before it
    more = 0  # columns behind those of python-can
    octets: Callable[[str], bytes] = _base64  # as the first frame with bytes has them
    decided = False

    def take(text: str, line: Line) -> Row | str:
        nonlocal numbered, more, octets, decided
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
        if not decided and (row := _HEX_ROW.fullmatch(text)) and int(row[1]):
            # 2 n hexadecimal digits are never the base64 of n bytes
            decided, octets = True, bytes.fromhex if len(row[2]) == 2 * int(row[1]) else _base64
        return _take(text, octets)

    return read(path, state, take, wanted)


def _base64(text: str) -> bytes:
    return base64.b64decode(text, validate=True)


def _take(text: str, octets: Callable[[str], bytes]) -> Row | str:
    if text == _COLUMN_NAMES:
        return "header lines"
    try:
        ns, id_, data, flags, length = _parse(text, octets)
    except (ValueError, OverflowError) as error:
        raise error if isinstance(error, Bad) else Bad(f"it is not {_COLUMN_NAMES}") from None
    return Row(ns, 0, id_, data, flags, length)


def _parse(text: str, octets: Callable[[str], bytes]) -> tuple[int, int, bytes, int, int]:
    stamp, id_, extended, remote, error, dlc, packed = text.split(",")
    if not (_TIME_WORD.fullmatch(stamp) and _ID_WORD.fullmatch(id_) and _DLC.fullmatch(dlc)):
        raise Bad(f"it is not {_COLUMN_NAMES}")
    flags = 0
    for word, flag in ((extended, Flag.EXTENDED), (remote, Flag.REMOTE), (error, Flag.ERROR)):
        if word not in ("0", "1"):
            raise Bad(f"{word!r} is neither 0 nor 1")
        flags |= int(flag) if word == "1" else 0
    try:
        data = octets(packed)
    except ValueError:  # binascii.Error is one
        raise Bad(f"its data are not {'base64' if octets is _base64 else 'hexadecimal'}") from None
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
