"""What is kept of the frames of one message while a log is read: a few numbers, and a sample of frames."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.contents import protection
from canid.analysis.drive.recorded_time import RecordedTime
from canid.analysis.drive.signal_columns import MessageFrames, MessageKey
from canid.values.log_contents import MessageContents
from canid.values.types import NAN

MAX_BYTES = 64
_UNPAUSED = RecordedTime()


class Tally(NamedTuple):
    """The frames of one message so far."""

    frames: int
    first: float  # s
    last: float
    step_sum: float  # s, of the times from frame to frame, without pauses of the whole log
    step_squares: float  # s²
    longest_gap: float  # s
    shortest: int  # bytes
    longest: int
    changes: int
    changed: npt.NDArray[np.uint8]  # (64,) bits that differ from those of the first frame
    first_data: npt.NDArray[np.uint8]  # (64,)
    last_data: npt.NDArray[np.uint8]  # (64,)
    last_length: int
    sample: npt.NDArray[np.uint8]  # (k, bytes) of the first frames, all of one length


def add(tally: Tally | None, frames: MessageFrames, time: RecordedTime = _UNPAUSED) -> Tally:
    """Take the next frames of a message; None: the first ones.

    Args:
        tally: of those before.
        frames: of the message.
        time: in which the log has frames, these included.

    Example:
        >>> data = np.array([[1, 0], [1, 1], [1, 1]], np.uint8)
        >>> tally = add(None, MessageFrames(np.array([0.0, 0.1, 0.2]), np.array([2, 2, 2], np.uint8), data))
        >>> tally.frames, tally.changes, tally.changed[:2].tolist()
        (3, 1, [0, 1])
    """
    t, length, data = frames
    width = data.shape[1]
    if tally is None:
        head = np.zeros(MAX_BYTES, np.uint8)
        head[:width] = data[0]
        tally = Tally(
            0, float(t[0]), float(t[0]), 0.0, 0.0, 0.0, MAX_BYTES, 0, 0,
            np.zeros(MAX_BYTES, np.uint8), head, head, int(length[0]), np.zeros((0, int(length[0])), np.uint8),
        )  # fmt: skip
        before = t[:1]
    else:
        before = np.array([tally.last])
    times = np.concatenate([before, t])
    step = np.diff(time.without_pauses(times))
    changed = tally.changed.copy()
    changed[:width] |= np.bitwise_or.reduce(data ^ tally.first_data[:width], axis=0)
    differs = (data[1:] != data[:-1]).any(axis=1) | (length[1:] != length[:-1])
    differs_first = (data[0] != tally.last_data[:width]).any() or int(length[0]) != tally.last_length
    last_data = np.zeros(MAX_BYTES, np.uint8)
    last_data[:width] = data[-1]
    sample, left = tally.sample, protection.MAX_FRAMES - len(tally.sample)
    if left > 0:
        size = sample.shape[1]
        sample = np.concatenate([sample, data[length == size][:left, :size]])
    return Tally(
        frames=tally.frames + len(t),
        first=min(tally.first, float(t.min())),
        last=float(t[-1]),
        step_sum=tally.step_sum + float(step.sum()),
        step_squares=tally.step_squares + float(np.dot(step, step)),
        longest_gap=max(tally.longest_gap, float(np.diff(times).max())),
        shortest=min(tally.shortest, int(length.min())),
        longest=max(tally.longest, int(length.max())),
        changes=tally.changes + int(differs.sum()) + int(differs_first),
        changed=changed,
        first_data=tally.first_data,
        last_data=last_data,
        last_length=int(length[-1]),
        sample=sample,
    )


def contents(key: MessageKey, tally: Tally, name: str, database: str) -> MessageContents:
    """What a message was."""
    steps = tally.frames - 1
    mean = tally.step_sum / steps if steps else NAN
    variance = max(tally.step_squares / steps - mean**2, 0.0) if steps else NAN
    return MessageContents(
        bus=key.bus,
        id=key.id,
        extended=key.extended,
        name=name,
        database=database,
        frames=tally.frames,
        rate=1.0 / mean if steps and mean > 0.0 else NAN,
        jitter=math.sqrt(variance),
        longest_gap=tally.longest_gap if steps else NAN,
        first=tally.first,
        last=tally.last,
        shortest=tally.shortest,
        longest=tally.longest,
        changes=tally.changes,
        changed=tally.changed,
        fields=protection.fields(tally.sample),
    )
