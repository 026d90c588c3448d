"""Reads `candump -L` logs: `(1436509052.249713) can0 044#2A366C2BBA`, CAN FD with `##`, remote, error frames.

Interfaces become buses 0, 1, ... in the order in which they first appear.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from canid.frames import stamps
from canid.frames.lines import LONGEST_TIME, Bad, Line, Tally, hex_bytes, lines, remote_length
from canid.frames.read_state import ReadState
from canid.types import Flag, Frame

ERROR_BIT = 0x2000_0000  # of an eight-digit id, as in linux/can.h
_BRS, _ESI = 1, 2  # linux/can.h: flags of struct canfd_frame


def read_candump(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file; raises LogError where no line is one."""
    tally = Tally()
    buses: dict[str, int] = {}
    first: int | None = None
    for line in lines(path, state, tally):
        if not line.text.strip() or line.text.startswith("#"):
            continue
        try:
            ns, interface, id_, data, flags, length = _parse(line)
        except ValueError as error:
            tally.miss(line, str(error) if isinstance(error, Bad) else "it is no candump line")
            continue
        if first is None:
            first = ns
            state.start_ns = ns
        tally.read += 1
        bus = buses.setdefault(interface, len(buses))
        yield Frame((ns - first) * 1e-9, bus, id_, data, flags, length)
    state.damage = tally.damage(path)


def _parse(line: Line) -> tuple[int, str, int, bytes, int, int]:
    words = line.text.split()
    directed = len(words) == 4 and words[3] in ("R", "T", "r", "t")
    if not (directed or len(words) == 3):
        raise Bad("it is no candump line")
    if not line.whole and not directed:
        # nothing announces the length of the data: the rest of a frame may be missing
        raise Bad("the file ends in it")
    stamp, interface, frame = words[:3]
    if not (stamp.startswith("(") and stamp.endswith(")")):
        raise Bad("it is no candump line")
    ns = stamps.from_text(stamp[1:-1])
    if not 0 <= ns <= LONGEST_TIME:
        raise Bad("its time is damaged")
    name, _, rest = frame.partition("#")
    if len(name) not in (3, 8) or not _:
        raise Bad("it is no candump line")
    id_ = int(name, 16)
    flags = int(Flag.TX) if directed and words[3] in "Tt" else 0
    if id_ & ERROR_BIT:
        flags |= Flag.ERROR
        id_ &= ERROR_BIT - 1
    elif len(name) == 8:
        flags |= Flag.EXTENDED
    if rest.startswith("#"):
        bits = int(rest[1:2], 16)
        flags |= Flag.FD | (Flag.BRS if bits & _BRS else 0) | (Flag.ESI if bits & _ESI else 0)
        data = hex_bytes(rest[2:].replace(".", ""), len(rest[2:].replace(".", "")) // 2)
        if len(data) > 64:
            raise Bad("more than 64 data bytes")
        return ns, interface, id_, data, int(flags), -1
    rest = rest.partition("_")[0]  # "_9".."_F" behind 8 bytes: the raw DLC, which says nothing more
    if rest[:1] in ("R", "r"):
        return ns, interface, id_, b"", int(flags | Flag.REMOTE), remote_length(int(rest[1:] or "0", 16))
    digits = rest.replace(".", "")
    data = hex_bytes(digits, len(digits) // 2)
    if len(data) > 8:
        raise Bad("more than 8 data bytes in a classic frame")
    return ns, interface, id_, data, int(flags), -1
