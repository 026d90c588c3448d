"""Session time: whatever the clocks in a log do, the time of the samples never goes backwards.

Frames of two buses may be out of order by a few milliseconds: harmless, they keep their times.
A frame from further back is left out of the estimation (never out of the recording); when the source stays
back, its clock was set, and the session goes on from where it was.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array, Columns, Event

# s; buffered interfaces deliver the frames of two buses this far out of order (USB adapters batch up to 50 ms)
MAX_REORDERING_S = 0.1
# frames in a row from the past before the clock is taken to be set back, and not a single time stamp to be damaged
FRAMES_OF_CLOCK_STEP = 50
# s; a jump further ahead than this is a clock that was set, not a pause of the bus
MAX_JUMP_S = 3600.0


class State(NamedTuple):
    """What the next frame's time depends on."""

    latest: float = 0.0  # s, session time of the newest frame
    offset: float = 0.0  # s, added to the source's time
    back: int = 0  # frames in a row that came from the past
    dropped: int = 0  # frames left out of the estimation so far
    worst: float = 0.0  # s, how far back the worst one was


class Timed(NamedTuple):
    """A chunk in session time."""

    frames: Columns  # without those that are left out
    rows: npt.NDArray[np.int64] | None  # (n,) which rows of the chunk they are; None: all of it
    latest: Array  # (n,) s, session time of the newest frame so far
    events: tuple[tuple[int, Event], ...]  # with the row, among `frames`, of the frame that caused it


def init() -> State:
    """Return the state before the first frame."""
    return State()


def back_in_time(state: State) -> str:
    """How many frames came from the past, in words; "": none.

    Example:
        >>> back_in_time(State(dropped=2, worst=3.0)), back_in_time(State(dropped=49))
        ('2 frames go back in time (by up to 3 s) and were left out', '')
    """
    # frames that are left out at a jump ahead are none of the past: its event says what happened
    if not state.worst > 0.0:
        return ""
    return f"{state.dropped} frames go back in time (by up to {state.worst:.3g} s) and were left out"


def step(state: State, chunk: Columns) -> tuple[State, Timed]:
    """Give frames their session time: those of an ordinary clock at once, any others one by one.

    Example:
        >>> none = (np.zeros(2, kind) for kind in ("u2", "u4", "u1", "u1"))
        >>> state, timed = step(init(), Columns(np.array([1.0, 0.95]), *none, np.zeros((2, 8), np.uint8)))
        >>> timed.frames.t.tolist(), timed.latest.tolist(), state.latest
        ([1.0, 0.95], [1.0, 1.0], 1.0)
    """
    t = chunk.t + state.offset
    latest = np.maximum(np.maximum.accumulate(t), state.latest)
    late = np.concatenate([[state.latest], latest[:-1]]) - t
    if not ((late > -MAX_JUMP_S) & (late <= MAX_REORDERING_S)).all():
        return _one_by_one(state, chunk)
    after = state._replace(latest=float(latest[-1]), back=0) if t.size else state
    return after, Timed(chunk if state.offset == 0.0 else chunk._replace(t=t), None, latest, ())


def _one_by_one(state: State, chunk: Columns) -> tuple[State, Timed]:
    rows: list[int] = []
    times: list[float] = []
    latest: list[float] = []
    events: list[tuple[int, Event]] = []
    for row, source_t in enumerate(chunk.t.tolist()):
        state, t, event = _step_frame(state, source_t)
        if event is not None:
            events.append((len(rows), event))
        if t is not None:
            rows.append(row)
            times.append(t)
            latest.append(state.latest)
    kept: npt.NDArray[np.int64] = np.array(rows, dtype=np.int64)
    _, bus, id_, flags, length, data = chunk
    frames = Columns(np.array(times), bus[kept], id_[kept], flags[kept], length[kept], data[kept])
    return state, Timed(frames, kept, np.array(latest), tuple(events))


def _step_frame(state: State, source_t: float) -> tuple[State, float | None, Event | None]:
    """One frame's session time (None: it is left out), and the event of a clock that was set."""
    t = source_t + state.offset
    late = state.latest - t
    if -MAX_JUMP_S < late <= MAX_REORDERING_S:
        return State(max(t, state.latest), state.offset, 0, state.dropped, state.worst), t, None
    if state.back + 1 < FRAMES_OF_CLOCK_STEP:
        worst = max(state.worst, late)
        return State(state.latest, state.offset, state.back + 1, state.dropped + 1, worst), None, None
    says = (
        f"the log's clock is set back by {late:.1f} s at {state.latest:.2f} s"
        if late > 0
        else f"no frame for {-late / 3600.0:.3g} h at {state.latest:.2f} s (a pause, or its clock was set): time goes on "
        f"from there without it, and without the first {FRAMES_OF_CLOCK_STEP - 1} frames behind it"
    )
    event = Event(state.latest, "clock_step", says)
    offset = state.offset + late
    after = State(state.latest, offset, 0, state.dropped, max(state.worst, late))
    return after, source_t + offset, event
