"""Session time: whatever the clocks in a log do, time never goes backwards for anything behind this file.

Frames of two buses may swap places by a few milliseconds: harmless, they keep their times.
A frame from further back is left out of the estimation (never out of the recording); when the source stays
back, its clock was set, and the session goes on from where it was.
"""

from __future__ import annotations

from typing import NamedTuple

from canid.types import Event, Frame

# s; buffered interfaces deliver the frames of two buses this far out of order (USB adapters batch up to 50 ms)
REORDERED = 0.1
# frames in a row from the past before we believe that the clock was set back, and not that one stamp was damaged
BELIEVE = 50
# s; a jump further ahead than this is a clock that was set, not a pause of the bus
JUMP = 3600.0


class State(NamedTuple):
    """What the next frame's time depends on."""

    latest: float = 0.0  # s, session time of the newest frame
    offset: float = 0.0  # s, added to the source's time
    back: int = 0  # frames in a row that came from the past
    dropped: int = 0  # frames left out of the estimation so far
    worst: float = 0.0  # s, how far back the worst one was


def init() -> State:
    """Return the state before the first frame."""
    return State()


def step(state: State, frame: Frame) -> tuple[State, Frame | None, Event | None]:
    """Give a frame its session time.

    Returns:
        the next state, the frame (None: leave it out) and what the user should know.

    Example:
        >>> state, frame, event = step(State(latest=10.0), Frame(4.0, 0, 1, b""))
        >>> frame, state.dropped
        (None, 1)
    """
    t = frame.t + state.offset
    late = state.latest - t
    if -JUMP < late <= REORDERED:
        calm = State(max(t, state.latest), state.offset, 0, state.dropped, state.worst)
        return calm, frame if state.offset == 0.0 else frame._replace(t=t), None
    if state.back + 1 < BELIEVE:
        worst = max(state.worst, late)
        return State(state.latest, state.offset, state.back + 1, state.dropped + 1, worst), None, None
    set_by = f"back by {late:.1f} s" if late > 0 else f"ahead by {-late:.0f} s"
    event = Event(state.latest, "clock_step", f"the log's clock is set {set_by} at {state.latest:.2f} s")
    offset = state.offset + late
    after = State(state.latest, offset, 0, state.dropped, max(state.worst, late))
    return after, frame._replace(t=frame.t + offset), event
