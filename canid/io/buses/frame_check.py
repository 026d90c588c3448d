"""Frame validation: what a CAN or CAN FD bus can carry (ISO 11898-1:2015).

Every received frame of every interface is checked once, in `bus`, before it is used: what no bus can carry is counted
and dropped, so that no writer, view or estimator has to handle it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.io.buses.receivers.received_columns import ReceivedColumns
from canid.io.buses.receivers.received_frame import Received
from canid.values.frame_columns import DLC_BYTES, MAX_EXTENDED_ID, MAX_STANDARD_ID
from canid.values.types import Flag

CLASSIC_LENGTHS = frozenset(range(9))
# the data lengths that the 4-bit DLC of CAN FD can state
FD_LENGTHS = frozenset(DLC_BYTES)
# ns since 1970: October 2096. Every log format holds times up to here, and canid's readers take times up to 2^62 ns.
MAX_STAMP_NS = 4_000_000_000 * 10**9

_NO_LENGTH = frozenset((-1,))
_NO_DATA = frozenset((0,))


class ImpossibleFrameError(ValueError):
    """A message that is no frame, or one that no bus can carry; the next message may be in order."""

    def __init__(self, why: str, ns: int = 0):
        """`ns`: when it was received, ns since 1970; 0 where that is unknown."""
        super().__init__(why)
        self.ns = ns


def _rules() -> dict[int, tuple[int, frozenset[int], frozenset[int]]]:
    """Largest id, data lengths and requested lengths for each combination of flags that a bus can carry."""
    rules = {}
    for flags in range(2 * int(Flag.TX)):
        extended, remote, error = flags & Flag.EXTENDED, flags & Flag.REMOTE, flags & Flag.ERROR
        fd, fd_only = flags & Flag.FD, flags & (Flag.BRS | Flag.ESI)
        if (remote and (error or fd)) or (fd_only and not fd):
            continue
        # the id of an error frame holds the error's class (linux/can/error.h)
        largest = MAX_EXTENDED_ID if extended or error else MAX_STANDARD_ID
        data = _NO_DATA if remote else FD_LENGTHS if fd else CLASSIC_LENGTHS
        rules[flags] = (largest, data, CLASSIC_LENGTHS if remote else _NO_LENGTH)
    return rules


_RULES = _rules()
# the same as arrays: the largest id for each combination of flags, and which lengths it may have
_LARGEST = np.zeros(256, np.uint32)
_POSSIBLE = np.zeros((256, 256), bool)
for _flags, (_largest, _data, _asked) in _RULES.items():
    _LARGEST[_flags] = _largest
    _POSSIBLE[_flags, sorted(_asked if _flags & Flag.REMOTE else _data)] = True


def why_impossible(frame: Received) -> str:
    """Why no bus can carry a frame; "" for one that a bus can carry.

    >>> why_impossible(Received(10**18, 0x123, b"ab", 0)), why_impossible(Received(10**18, 0x123, bytes(9), 8))
    ('', '9 data bytes in a CAN FD frame')
    """
    ns, id_, data, flags, length = frame
    rule = _RULES.get(flags)
    if (
        rule is not None
        and type(id_) is int
        and 0 <= id_ <= rule[0]
        and type(data) is bytes
        and len(data) in rule[1]
        and length in rule[2]
        and type(ns) is int
        and 0 <= ns <= MAX_STAMP_NS
    ):
        return ""
    return _why(frame)


def largest_id(flags: int) -> int:
    """The largest id of a frame with these flags; -1 for flags that no bus can carry.

    >>> largest_id(0), largest_id(int(Flag.EXTENDED)), largest_id(int(Flag.REMOTE | Flag.FD))
    (2047, 536870911, -1)
    """
    return _RULES[flags][0] if flags in _RULES else -1


def possible(columns: ReceivedColumns) -> npt.NDArray[np.bool_]:
    """Which frames a bus can carry: those for which `why_impossible` finds nothing.

    >>> from canid.io.buses.receivers.received_columns import columns_of
    >>> possible(columns_of([Received(10**18, 0x7FF, b"ab", 0), Received(10**18, 0x800, b"ab", 0)])).tolist()
    [True, False]
    """
    ns, id_, flags, length, _ = columns
    in_time = (ns >= 0) & (ns <= MAX_STAMP_NS)
    out: npt.NDArray[np.bool_] = _POSSIBLE[flags, length] & (id_ <= _LARGEST[flags]) & in_time
    return out


def _why(frame: Received) -> str:
    """The sentence for `why_impossible`; numbers that may have thousands of digits are not shown."""
    _, id_, data, flags, length = frame
    rule = _RULES.get(flags)
    if rule is None:
        remote = flags & Flag.REMOTE
        return f"contradictory flags ({'remote' if remote else 'bit-rate switch or error state without FD'})"
    if type(id_) is not int:
        return f"an id of type {type(id_).__name__}"
    if not 0 <= id_ <= rule[0]:
        return f"an id beyond {'29' if rule[0] == MAX_EXTENDED_ID else '11'} bits"
    if type(data) is not bytes:
        return f"data of type {type(data).__name__}"
    if len(data) not in rule[1]:
        kind = "remote" if flags & Flag.REMOTE else "CAN FD" if flags & Flag.FD else "classic"
        return f"{len(data)} data bytes in a {kind} frame"
    if length not in rule[2]:
        return "a data length that no frame can have"
    return "a time stamp that no log can hold"
