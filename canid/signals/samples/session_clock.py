"""Session time: whatever the clocks in a log do, the time of the samples never goes backwards.

Frames of two buses may be out of order by a few milliseconds: harmless, they keep their times. A frame from further back,
or from hours ahead, is held until the next ones show what it is. Where they agree with the frames before it, it is left out
of the estimation (never out of the recording). Where they agree with it, none is lost: ahead is a pause; back by the
period of a known counter is its wrap; any other step cuts the drive in two parts, between which nothing is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.signals.samples import clock_wraps
from canid.values.frame_columns import columns_of, frames_of, join, rows, select
from canid.values.types import Array, Columns, Event, Frame

# s; buffered interfaces deliver the frames of two buses this far out of order (USB adapters batch up to 50 ms)
MAX_REORDERING_S = 0.1
# frames in a row that agree before the clock is taken to have stepped, and not a few time stamps to be damaged
FRAMES_OF_CLOCK_STEP = 50
# the same where the step is a known counter's period: stamps are not damaged by just that, several times alike
FRAMES_OF_WRAP = 5
# s; a jump ahead that is shorter is taken as a pause at once
MAX_JUMP_S = 3600.0
# s; a jump ahead that is longer is a clock that was set, from 1970 say: no log is that of a pause of a year
MAX_PAUSE_S = 366 * 86_400.0
# s between two parts of which nothing says how far apart they are: the grid begins anew behind such a pause
# (`sampling_grid.MAX_PAUSE_S`), so that no sample is made of both
CUT_S = 15.0

# s; doubles hold whole nanoseconds up to here, and whole microseconds for 200 years
NANOSECONDS_UP_TO_S = 1e6


class State(NamedTuple):
    """What the next frame's time depends on."""

    latest: float = 0.0  # s, session time of the newest frame
    offset: float = 0.0  # s, added to the source's time
    begun: bool = False  # a frame has come: the first may be of any time, where a log is read from hours on
    held: tuple[Frame, ...] = ()  # frames from the past, or from hours ahead, that are not judged yet
    held_newest: float = 0.0  # s, session time of the newest of them if the clock did not step
    held_since: float = 0.0  # s, session time at which the first of them came
    in_row: int = 0  # frames that were held since the latest one that was not
    frames_since: int = 0  # all frames since the first of them, it included
    dropped: int = 0  # frames of the past that were left out of the estimation so far
    worst: float = 0.0  # s, how far back the worst one was
    ahead: int = 0  # frames from hours ahead that were left out so far
    wrapped: float = 0.0  # s, period of the latest wrap, which is reported; 0: none was
    wraps: float = 0.0  # s, those of all wraps together; part of `offset`


class Timed(NamedTuple):
    """A chunk in session time."""

    frames: Columns  # without those that are left out or held; those that were held before come first
    # (n,) which row of the chunk each is; of one that was held the row that showed what it is. None: all of the chunk
    rows: npt.NDArray[np.int64] | None
    latest: Array  # (n,) s, session time of the newest frame so far
    events: tuple[tuple[int, Event], ...]  # with the row, among `frames`, of the frame that caused it
    # with the row of the chunk from which on a period is added, s; negative: of the chunks before
    wraps: tuple[tuple[int, float], ...] = ()


def init() -> State:
    """Return the state before the first frame."""
    return State()


def back_in_time(state: State) -> str:
    """How many frames have a time that fits nowhere, in words; "": none.

    Example:
        >>> back_in_time(State(dropped=2, worst=3.0)), back_in_time(State(ahead=3))
        ('2 frames go back in time (by up to 3 s) and were left out', '3 frames are hours ahead and were left out')
    """
    # a log may end with frames that are held
    state = _refuted(state, [frame.t for frame in state.held], state.held_since)
    back = f"{state.dropped} frames go back in time (by up to {state.worst:.3g} s)" if state.dropped else ""
    ahead = f"{state.ahead} frames are hours ahead" if state.ahead else ""
    says = "; ".join(filter(None, (back, ahead)))
    return f"{says} and were left out" if says else ""


def session_time(state: State, source_t: Array | float) -> Array:
    """The session time of times of the source, s, as its clock is now.

    Example:
        >>> float(session_time(State(offset=60.0), 0.1))
        60.1
    """
    return (
        np.asarray(source_t) if state.offset == 0.0 else rounded(source_t + state.offset, abs(state.offset))
    )


def rounded(t: Array | float, size: float) -> Array:
    """Times, s, rounded as a log's own times are, so that a grid point at a reading has its very value.

    Args:
        t: sums of times.
        size: s, of the largest that was added.

    Example:
        >>> float(rounded(-4294967.296 + 4294967.4, 4294967.4))
        0.10400000000000001
    """
    ns = 1.0 if size < NANOSECONDS_UP_TO_S else 1000.0
    return np.asarray(np.round(t * (1e9 / ns)) * ns * 1e-9)


def step(state: State, chunk: Columns) -> tuple[State, Timed]:
    """Give frames their session time: those of an ordinary clock at once, any others one by one.

    Example:
        >>> none = (np.zeros(2, kind) for kind in ("u2", "u4", "u1", "u1"))
        >>> state, timed = step(init(), Columns(np.array([1.0, 0.95]), *none, np.zeros((2, 8), np.uint8)))
        >>> timed.frames.t.tolist(), timed.latest.tolist(), state.latest
        ([1.0, 0.95], [1.0, 1.0], 1.0)
    """
    t = session_time(state, chunk.t)
    latest = np.maximum(np.maximum.accumulate(t), state.latest)
    late = np.concatenate([[state.latest], latest[:-1]]) - t
    if state.held or not ((late > -MAX_JUMP_S) & (late <= MAX_REORDERING_S)).all():
        return _one_by_one(state, chunk)
    after = state._replace(latest=float(latest[-1]), begun=True) if t.size else state
    return after, Timed(chunk if state.offset == 0.0 else chunk._replace(t=t), None, latest, ())


def _one_by_one(state: State, chunk: Columns) -> tuple[State, Timed]:
    before = len(state.held)
    pool = join([columns_of(state.held), chunk]) if before else chunk
    source_t = pool.t.tolist()
    held = list(range(before))  # rows of the pool
    source: list[int] = []
    shown_by: list[int] = []
    times: list[float] = []
    latest: list[float] = []
    events: list[tuple[int, Event]] = []
    wraps: list[tuple[int, float]] = []
    for k in range(before, len(source_t)):
        t = float(session_time(state, source_t[k]))
        ordinary = state.latest - t <= MAX_REORDERING_S and (
            state.latest - t > -MAX_JUMP_S or not state.begun
        )
        agrees = -MAX_JUMP_S < state.held_newest - t <= MAX_REORDERING_S
        # frames of the clock before a step may come a little after the first behind it
        late = ordinary and (
            max(t, state.latest) > state.held_since + MAX_REORDERING_S or len(held) >= FRAMES_OF_CLOCK_STEP
        )
        if held and (late or not (ordinary or agrees)):
            state, held = _refuted(state, [source_t[i] for i in held], state.held_since), []
        if ordinary:
            since = state.frames_since + (1 if held else 0)
            state, out = state._replace(in_row=0, frames_since=since), [k]
        else:
            state = _held(state, t, first=not held)
            held.append(k)
            if state.in_row < FRAMES_OF_WRAP:
                continue
            wrap = _wrap(state, source_t[held[0]])
            if wrap is None and state.in_row < FRAMES_OF_CLOCK_STEP:
                continue
            state, event = _stepped(state._replace(in_row=0), source_t[held[0]], wrap)
            events += [(len(source), event)] if event is not None else []
            if wrap is not None:
                wraps.append((k - before + 1 - state.frames_since, wrap.period))
            out, held = held, []
        for i in out:
            state, placed = _placed(state, source_t[i])
            if placed is not None:
                source.append(i)
                shown_by.append(k - before)
                times.append(placed)
                latest.append(state.latest)
    frames = select(pool, np.array(source, np.int64))._replace(t=np.array(times))
    state = state._replace(held=tuple(frames_of(select(pool, np.array(held, np.int64)))))
    out_rows = np.array(shown_by, np.int64)
    return state, Timed(frames, out_rows, np.array(latest), tuple(events), tuple(wraps))


def _held(state: State, t: float, *, first: bool) -> State:
    """The state with one more frame held, whose time would be `t` if the clock did not step."""
    if first:
        return state._replace(held_newest=t, held_since=state.latest, in_row=1, frames_since=1)
    newest, since = max(state.held_newest, t), state.frames_since + 1
    return state._replace(held_newest=newest, in_row=state.in_row + 1, frames_since=since)


def _refuted(state: State, source_t: Sequence[float], latest: float) -> State:
    """The state where frames turn out to have wrong times, which came at `latest`: they are left out, and counted."""
    late = [latest - float(session_time(state, t)) for t in source_t]
    back = [each for each in late if each > 0.0]
    return state._replace(
        dropped=state.dropped + len(back),
        worst=max([state.worst, *back]),
        ahead=state.ahead + len(late) - len(back),
    )


def _placed(state: State, source_t: float) -> tuple[State, float | None]:
    """A frame's session time; None: it is from the past, and left out."""
    t = float(session_time(state, source_t))
    late = state.latest - t
    if late > MAX_REORDERING_S:
        return _refuted(state, [source_t], state.latest), None
    return state._replace(latest=max(t, state.latest), begun=True), t


def _wrap(state: State, source_t: float) -> clock_wraps.Wrap | None:
    """The wrap that a step of the clock to `source_t` is; None: it is none that is known."""
    # frames of the clock before the step may still have come since
    return clock_wraps.wrap_of(state.latest - float(session_time(state, source_t)), 2 * MAX_REORDERING_S)


def _stepped(state: State, source_t: float, wrap: clock_wraps.Wrap | None) -> tuple[State, Event | None]:
    """The state behind a step of the clock to `source_t`, and its event, where it has not been reported."""
    late = state.latest - float(session_time(state, source_t))
    at = f"at {state.latest:.2f} s"
    if -MAX_PAUSE_S <= late <= 0.0:
        says = f"no frame for {-late / 3600.0:.3g} h {at}: a pause, or its clock was set"
        return state, Event(state.latest, "clock_step", says)
    if wrap is not None:
        offset, wraps = state.offset + wrap.period, state.wraps + wrap.period
        after = state._replace(offset=offset, wraps=wraps, wrapped=wrap.period)
        says = f"{wrap.says} {at}: time goes on from there"
        return after, None if wrap.period == state.wrapped else Event(state.latest, "clock_step", says)
    way = f"set back by {late:.1f} s" if late > 0 else f"set ahead by {-late / 86_400.0:.3g} days"
    says = f"the log's clock is {way} {at}: the drive is cut in two there, since nothing says for how long it paused"
    return state._replace(offset=state.offset + late + CUT_S), Event(state.latest, "clock_step", says)


def unwrapped(chunks: Iterable[Columns]) -> Iterator[Columns]:
    """All frames of a log, as they stand in it, in times that go on where its counter wraps.

    Args:
        chunks: of the log.

    Example:
        >>> chunk = columns_of([Frame((10.0 + k) % 60.0 - 10.0, 0, 1, b"") for k in range(200)])  # from 10 s on
        >>> [float(part.t.max()) for part in unwrapped([chunk])]
        [199.0]
    """
    state, waiting = init(), list[Columns]()
    for chunk in chunks:
        before, added = sum(len(part.t) for part in waiting), np.full(1, state.wraps)
        state, timed = step(state, chunk)
        joined = join([*waiting, chunk])
        if timed.wraps:
            steps = np.zeros(len(joined.t))
            steps[[before + row for row, _ in timed.wraps]] = [period for _, period in timed.wraps]
            added = added + np.cumsum(steps)
        times = joined if state.wraps == 0.0 else joined._replace(t=rounded(joined.t + added, state.wraps))
        # what frames are that are held is shown by those of the next chunk
        known = len(joined.t) - (state.frames_since if state.held else 0)
        yield rows(times, 0, known)
        waiting = [rows(joined, known, len(joined.t))]
    yield from (
        part._replace(t=rounded(part.t + state.wraps, state.wraps)) for part in waiting if part.t.size
    )
