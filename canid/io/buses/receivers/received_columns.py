"""Received frames as columns, and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from canid.io.buses.receivers.received_frame import Received, Receiver
from canid.values.frame_columns import octets_of
from canid.values.types import Flag

_REMOTE = int(Flag.REMOTE)


class ReceivedColumns(NamedTuple):
    """Frames as they came from a bus: one row is one frame. Apart from the time as `types.Columns`."""

    ns: npt.NDArray[np.int64]  # (n,) ns since 1970, or since a zero of the interface's own
    id: npt.NDArray[np.uint32]  # (n,)
    flags: npt.NDArray[np.uint8]  # (n,) of `Flag`
    length: npt.NDArray[np.uint8]  # (n,) bytes; of a remote frame: that it asks for
    data: npt.NDArray[np.uint8]  # (n, 8), or (n, 64) where one of them is longer than 8


class Many(NamedTuple):
    """The result of one call that receives many messages."""

    frames: ReceivedColumns
    # messages that are no frames: why, and when in ns (0: unknown)
    impossible: Sequence[tuple[str, int]] = ()
    checked: bool = False  # it is known that a bus can carry all of them


class ManyReceiver(Receiver, Protocol):
    """A receiver that takes many messages with one call."""

    def recv_many(self, timeout: float, gather: float) -> Many | None:
        """Wait up to `timeout` s for messages, and up to `gather` s for those that follow; None: none came.

        Raises BusError.
        """


def columns_of(frames: Sequence[Received]) -> ReceivedColumns:
    """Make columns of frames that a bus can carry.

    >>> columns_of([Received(5, 0x123, b"ab", 0), Received(6, 0x124, b"", _REMOTE, 4)]).length.tolist()
    [2, 4]
    """
    return ReceivedColumns(
        np.array([frame.ns for frame in frames], np.int64),
        np.array([frame.id for frame in frames], np.uint32),
        np.array([frame.flags for frame in frames], np.uint8),
        np.array([max(f.length, 0) if f.flags & _REMOTE else len(f.data) for f in frames], np.uint8),
        octets_of([frame.data for frame in frames]),
    )


def frames_of(columns: ReceivedColumns) -> Iterator[Received]:
    """Make frames of columns.

    >>> frames = [Received(5, 0x123, b"ab", 0), Received(6, 0x124, b"", _REMOTE, 4)]
    >>> list(frames_of(columns_of(frames))) == frames
    True
    """
    width = columns.data.shape[1]
    octets = columns.data.tobytes()
    lists = (column.tolist() for column in columns[:4])
    for row, (ns, id_, flags, length) in enumerate(zip(*lists, strict=True)):
        if flags & _REMOTE:
            yield Received(ns, id_, b"", flags, length)
        else:
            yield Received(ns, id_, octets[row * width : row * width + length], flags)


def select(columns: ReceivedColumns, wanted: slice | npt.NDArray[Any]) -> ReceivedColumns:
    """Keep some rows.

    >>> select(columns_of([Received(k, k, b"", 0) for k in range(9)]), slice(3, 5)).ns.tolist()
    [3, 4]
    """
    ns, id_, flags, length, data = columns
    return ReceivedColumns(ns[wanted], id_[wanted], flags[wanted], length[wanted], data[wanted])
