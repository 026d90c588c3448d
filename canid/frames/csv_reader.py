"""Reads the .csv that python-can's CSVWriter writes; it knows no channel and no direction: all is bus 0."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterator
from pathlib import Path

from canid.frames import stamps
from canid.frames.lines import LARGEST_ID, LONGEST_TIME, Bad, Tally, lines, remote_length
from canid.frames.read_state import ReadState
from canid.types import Flag, Frame

_HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"


def read_csv(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file; raises LogError where no line is one."""
    tally = Tally()
    first: int | None = None
    for line in lines(path, state, tally):
        text = line.text.strip()
        if not text or (line.number == 1 and text.endswith(_HEADER)):
            continue
        try:
            ns, id_, data, flags, length = _parse(text)
        except (ValueError, OverflowError) as error:
            tally.miss(line, str(error) if isinstance(error, Bad) else f"it is not {_HEADER}")
            continue
        if first is None:
            first = ns
            state.start_ns = ns
        tally.read += 1
        yield Frame((ns - first) * 1e-9, 0, id_, data, flags, length)
    state.damage = tally.damage(path)


def _parse(text: str) -> tuple[int, int, bytes, int, int]:
    stamp, id_, extended, remote, error, dlc, packed = text.split(",")
    flags = 0
    for word, flag in ((extended, Flag.EXTENDED), (remote, Flag.REMOTE), (error, Flag.ERROR)):
        if word not in ("0", "1"):
            raise Bad(f"{word!r} is neither 0 nor 1")
        flags |= int(flag) if word == "1" else 0
    try:
        data = base64.b64decode(packed, validate=True)
    except binascii.Error:
        raise Bad("its data are not base64") from None
    announced, number, ns = int(dlc), int(id_, 16), stamps.from_float(float(stamp))
    if not 0 <= ns <= LONGEST_TIME:
        raise Bad("its time is damaged")
    if not 0 <= number <= LARGEST_ID:
        raise Bad(f"{id_[:32]!r} is too large for an id")
    if flags & Flag.REMOTE:
        return ns, number, b"", flags, remote_length(announced)
    if len(data) != announced and not flags & Flag.ERROR:
        raise Bad(f"it announces {announced} data bytes and has {len(data)}")
    # the format has no mark for CAN FD, but its length gives it away
    flags |= int(Flag.FD) if len(data) > 8 else 0
    return ns, number, data, flags, -1
