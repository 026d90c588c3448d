"""What a log contains, as `canid look` shows it: data types."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import NAN, Array


class BusContents(NamedTuple):
    """One bus."""

    bus: int
    frames: int  # of all kinds
    rate: float  # 1/s, without pauses of the whole log, as `bits_per_s`
    bits_per_s: float  # without stuff bits and retransmissions: a lower bound of what the bus carried
    errors: int  # error frames
    remote: int  # remote frames
    fd: int  # CAN FD frames


class Field(NamedTuple):
    """A counter or a checksum that the frames show by themselves."""

    kind: str  # "counter", "checksum"
    start: int  # bit, as a DBC counts it for Intel signals
    length: int  # bits
    says: str  # "counts up by 1", "CRC-8, polynomial 0x1D"


class MessageContents(NamedTuple):
    """The frames of one id on one bus."""

    bus: int
    id: int
    extended: bool
    name: str  # of the message in the DBC files, "" where none names it
    database: str  # the file that names it
    frames: int
    rate: float  # 1/s, between the first and the last frame, without pauses of the whole log
    jitter: float  # s, standard deviation of the time from frame to frame
    longest_gap: float  # s
    first: float  # s of the log
    last: float  # s
    shortest: int  # bytes
    longest: int  # bytes
    changes: int  # frames whose data are not those of the frame before
    changed: npt.NDArray[np.uint8]  # (64,) the bits of each byte that have changed
    fields: tuple[Field, ...]


class SignalContents(NamedTuple):
    """One signal of a DBC file, over the whole log; numbers are physical, in the file's own unit."""

    bus: int
    id: int
    message: str
    signal: str
    unit: str
    readings: int
    low: float  # of the values; entries of the value table are none, unless the signal has no other
    high: float
    mean: float
    last: float
    changes: int  # readings that are not equal to the one before
    low_text: str  # their texts in the value table, "" where they have none
    high_text: str
    last_text: str
    entries: Mapping[str, int]  # text of the value table -> readings
    no_values: (
        int  # readings without a value: an entry of the value table, not available, or the frame is too short
    )
    is_state: bool  # every value is an entry of the value table
    protects: str  # "counter", "checksum", "selector": of the message, not a quantity; else ""
    course: Array  # (n,) means over time, from the start to the end of what was read; NaN: nothing came


class Database(NamedTuple):
    """A DBC file, and where it fits."""

    file: str
    buses: tuple[int, ...]  # on which it is used
    bound: bool  # the command line says so
    messages: int  # in the file
    found: int  # of them in the log


class LogContents(NamedTuple):
    """A log at first sight."""

    start: float  # s, of the first frame that was read
    stop: float  # s, of the last one
    frames: int
    buses: tuple[BusContents, ...]
    messages: tuple[MessageContents, ...]
    signals: tuple[SignalContents, ...]
    databases: tuple[Database, ...] = ()
    ids: int = 0  # that came with data, on all buses together; messages may be some of them
    frames_left_out: int = 0  # of ids beyond the number that is kept
    signals_left_out: int = 0  # beyond the number that is kept
    paused: float = 0.0  # s between the first frame and the last one in which none came

    @property
    def duration(self) -> float:
        """Between the first frame and the last one, s; NaN: no frame."""
        return self.stop - self.start if self.frames else NAN
