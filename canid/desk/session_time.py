"""`clock.step` for many frames: an ordinary clock's at once, any other one by one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid import clock
from canid.types import Array, Columns, Event, Frame


class Timed(NamedTuple):
    """A chunk in session time."""

    frames: Columns  # without those that `clock` leaves out
    latest: Array  # (n,) s, session time of the newest frame so far
    events: tuple[tuple[int, Event], ...]  # with the row, among `frames`, of the frame that made it


def step(state: clock.State, chunk: Columns) -> tuple[clock.State, Timed]:
    """Give frames their session time; see `clock.step`.

    Example:
        >>> none = (np.zeros(2, kind) for kind in ("u2", "u4", "u1", "u1"))
        >>> state, timed = step(clock.init(), Columns(np.array([1.0, 0.95]), *none, np.zeros((2, 8), np.uint8)))
        >>> timed.frames.t.tolist(), timed.latest.tolist(), state.latest
        ([1.0, 0.95], [1.0, 1.0], 1.0)
    """
    t = chunk.t + state.offset
    latest = np.maximum(np.maximum.accumulate(t), state.latest)
    late = np.concatenate([[state.latest], latest[:-1]]) - t
    if not ((late > -clock.JUMP) & (late <= clock.REORDERED)).all():
        return _one_by_one(state, chunk)
    after = state._replace(latest=float(latest[-1]), back=0) if t.size else state
    return after, Timed(chunk if state.offset == 0.0 else chunk._replace(t=t), latest, ())


def _one_by_one(state: clock.State, chunk: Columns) -> tuple[clock.State, Timed]:
    rows: list[int] = []
    times: list[float] = []
    latest: list[float] = []
    events: list[tuple[int, Event]] = []
    for row, t in enumerate(chunk.t.tolist()):
        # the clock looks at nothing but the time
        state, frame, event = clock.step(state, Frame(t, 0, 0, b""))
        if event is not None:
            events.append((len(rows), event))
        if frame is not None:
            rows.append(row)
            times.append(frame.t)
            latest.append(state.latest)
    kept: npt.NDArray[np.int64] = np.array(rows, dtype=np.int64)
    _, bus, id_, flags, length, data = chunk
    frames = Columns(np.array(times), bus[kept], id_[kept], flags[kept], length[kept], data[kept])
    return state, Timed(frames, np.array(latest), tuple(events))
