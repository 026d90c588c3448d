"""A log for a proposal: which buses carry a DBC's messages, and its signals on one raster of 0.1 s."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.drive.recorded_time import RecordedTime
from canid.analysis.drive.signal_columns import (
    MessageFrames,
    MessageKey,
    SignalColumn,
    decode,
    frames_by_message,
)
from canid.analysis.proposal.name_score import Candidate
from canid.io.logs import Log
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import Dbc
from canid.signals.vehicle.j1939 import PROTOCOL, pgn_of
from canid.signals.vehicle.transport_protocol import groups_of
from canid.values.errors import LogError
from canid.values.types import Array
from canid.values.window import Window

# s; the raster of the estimators
STEP_S = 0.1
# s of the log that are read: half an hour shows every role that a drive has
LONGEST_S = 1800.0
# s after which a value that was not repeated is not known; slow messages come once a second
_HOLD_S = 2.5
# frames with which a message counts as present
_MIN_FRAMES = 5


class LogColumns(NamedTuple):
    """The frames of a log by message, and where each DBC's messages are."""

    frames: dict[MessageKey, MessageFrames]
    buses: tuple[int, ...]
    by_id: dict[tuple[int, bool], list[MessageKey]]
    file_bus: tuple[int | None, ...]  # of each DBC: the bus that carries most of it; None: none does
    t: Array  # (n,) s, the raster
    kept: dict[tuple[str, str, int, bool], tuple[SignalColumn, Array] | None]  # decoded before
    time: RecordedTime = RecordedTime()  # in which frames came


def read(log: Log, files: Sequence[Dbc], progress: Callable[[float], None] | None = None) -> LogColumns:
    """Read a log.

    Raises:
        LogError: it cannot be read, or holds no frames.
    """
    messages = [message for file in files for message in file.messages.values()]
    log.know(messages)
    groups = groups_of(messages)
    frames = frames_by_message(log, within=Window(stop=LONGEST_S), progress=progress, groups=groups)
    if not log.frames_read:
        raise LogError(f"{log.path} holds no frames")
    frames = {
        key: message_frames for key, message_frames in frames.items() if len(message_frames.t) >= _MIN_FRAMES
    }
    by_id: dict[tuple[int, bool], list[MessageKey]] = {}
    for key in frames:
        by_id.setdefault((key.id, key.extended), []).append(key)
        if key.extended:
            by_id.setdefault((-1 - pgn_of(key.id), True), []).append(key)
    times = [message_frames.t for message_frames in frames.values()]
    time = RecordedTime().after(np.sort(np.concatenate([[], *times])))
    start, end = (time.first, time.last) if times else (0.0, 0.0)
    columns = LogColumns(
        frames,
        tuple(sorted({key.bus for key in frames})),
        by_id,
        (),
        np.arange(start, end + STEP_S / 2, STEP_S),
        {},
        time,
    )
    return columns._replace(file_bus=tuple(_bus_of(file, columns) for file in files))


def keys_of(message: Message, columns: LogColumns) -> list[MessageKey]:
    """The messages of the log that a DBC's message describes, by id and length."""
    keys = columns.by_id.get((message.id, message.extended), [])
    if message.protocol == PROTOCOL:
        keys = columns.by_id.get((-1 - pgn_of(message.id), True), [])
    return [key for key in keys if _long_enough(message, columns.frames[key])]


def _long_enough(message: Message, frames: MessageFrames) -> bool:
    """Another message of this id on another bus usually has another length; missing trailing bytes are common."""
    longest = int(frames.length.max())
    if longest >= message.length:
        return longest <= message.length or longest - message.length <= 1 or message.length < 8
    # the signals decide where the frame is shorter than the DBC says
    return longest * 2 >= message.length


def _bus_of(file: Dbc, columns: LogColumns) -> int | None:
    counts: dict[int, int] = {}
    for message in file.messages.values():
        for key in keys_of(message, columns):
            exact = int(columns.frames[key].length.max()) == message.length
            counts[key.bus] = counts.get(key.bus, 0) + (2 if exact else 1)
    return max(counts, key=lambda bus: (counts[bus], -bus)) if counts else None


def bus_of(candidate: Candidate, columns: LogColumns) -> int | None:
    """The bus on which a candidate's message is; None: not in the log."""
    buses = [key.bus for key in keys_of(candidate.message, columns)]
    if not buses:
        return None
    usual = columns.file_bus[candidate.file]
    return usual if usual in buses else buses[0]


def column(
    message: Message, signal: Signal, bus: int, columns: LogColumns, *, texts_are_values: bool = False
) -> tuple[SignalColumn, Array] | None:
    """A signal as it came, and on the raster (NaN: not measured); None where the log does not carry it.

    `texts_are_values`: it is a state, such as a gear, whose numbers have texts.
    """
    key = (message.name, signal.name, bus, texts_are_values)
    if key not in columns.kept:
        columns.kept[key] = _column(message, signal, bus, columns, texts_are_values)
    return columns.kept[key]


def _column(
    message: Message, signal: Signal, bus: int, columns: LogColumns, texts_are_values: bool
) -> tuple[SignalColumn, Array] | None:
    keys = [key for key in keys_of(message, columns) if key.bus == bus]
    came = decode(message, signal, columns.frames[keys[0]]) if keys else None
    if came is None or len(came.t) < _MIN_FRAMES:
        return None
    value = came.value.copy()
    for number, text in signal.meanings.items():
        if not texts_are_values and signal.length > 3 and not text[:1].isdigit() and not text.startswith("-"):
            value[value == number] = np.nan
    index = np.searchsorted(came.t, columns.t + 1e-6, side="right") - 1
    held = value[np.maximum(index, 0)]
    held[(index < 0) | (columns.t - came.t[np.maximum(index, 0)] > _HOLD_S)] = np.nan
    return came._replace(value=value), held
