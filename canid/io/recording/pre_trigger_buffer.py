"""Ring buffer of a triggered recording: frames wait in it until it is decided whether a window contains them.

A window reaches from `pre` s before the first frame for which a condition is true until `post` s after the last one;
windows that overlap are one. A frame's time is here the newest stamp so far, without steps of the clock: it never goes
back, so a window is a stretch of frames as they came. A frame is discarded only when every condition is evaluated for
all frames up to `pre` s after it; what cannot be evaluated counts as true.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from math import inf
from typing import NamedTuple

import numpy as np

from canid.values import frame_columns
from canid.values.types import Array, Columns

# frames in the buffer: 60 s before the trigger and 30 s without an evaluation at 8,000 frames/s, a full 1 Mbit/s bus;
# 30 MB (40 bytes a frame, 96 with the 64 data bytes of CAN FD)
MAX_BUFFERED_FRAMES = 720_000
# s that frames stay longer than `pre`, for a mark that is taken up late
MARK_MARGIN_S = 2.0
# s that a mark may be ahead of the newest frame: frames of its time may not have been read yet
MARK_AHEAD_S = 0.2
# s after a restart of the evaluation that count as true: the values of slow signals are not known again yet, see
# `vehicle.roles.SATELLITE_MAX_AGE_S`
SETTLE_S = 2.5
# s; a stamp further ahead than the time that has passed, or further back, is a step of its clock
MAX_AHEAD_S, MAX_BACK_S = 5.0, 1.0

NOT_EVALUATED = "conditions not evaluated"


class Window:
    """A stretch that is recorded."""

    def __init__(self, start: float, end: float, at: float, t: float, says: str) -> None:
        self.start = start  # s, of the buffer's time
        self.end = end  # s, so far
        self.at = at  # s, of the trigger
        self.t = t  # s, stamp of the trigger's frame
        self.says = says  # which condition
        self.announced = False
        self.missing = 0.0  # s before the trigger that were not in the buffer any more
        self.last = t  # s, stamp of the last frame that was given out


class Batch(NamedTuple):
    """Frames that came together."""

    first: int  # number of the first frame
    times: Array  # s, ascending
    frames: Columns
    at: float  # s, monotonic clock, when they came


class Begin(NamedTuple):
    """The trigger of a window, between the frames before and from it on."""

    window: Window


class End(NamedTuple):
    """The end of a window, after its last frame."""

    window: Window


Item = Columns | Begin | End


class PreTriggerBuffer:
    """Not thread-safe; `canid.io.recording.trigger_gate` has the lock.

    Example:
        >>> buffer = PreTriggerBuffer(pre=1.0, post=0.5)
        >>> from canid.values.types import Frame
        >>> chunk = frame_columns.columns_of([Frame(0.5 * k, 0, k, b"") for k in range(10)])
        >>> buffer.put(chunk, at=0.0)
        >>> buffer.answered(6, [(4, 5, "brake")])
        >>> [item.id.tolist() for item in buffer.take() if isinstance(item, Columns)]
        [[2, 3], [4, 5]]
    """

    def __init__(
        self, pre: float, post: float, *, evaluating: bool = True, max_frames: int = MAX_BUFFERED_FRAMES
    ) -> None:
        """`evaluating`: frames are answered for; False: marks alone trigger."""
        self._pre, self._post = pre, post
        self._evaluating = evaluating
        self._max_frames = max_frames
        self._ring: deque[Batch] = deque()
        self._unanswered: deque[Batch] = deque()  # those with frames from `_known` on
        self._offset = 0.0  # s, from a stamp to the buffer's time: steps of the clock
        self._put_at = 0.0
        self._number = 0  # frames that came
        self._answers = 0  # frames that were answered for
        self._known = 0  # frames whose truth is decided, by an answer or without one
        self._known_time = -inf  # s, of the newest of them
        self._true_stop = -1  # the frame after the last one that was true
        self._true_time = -inf  # s, of the last one that was true
        self._settled = -inf  # s; what comes until then counts as true
        self._discarded = -inf  # s, the newest frame that was discarded
        self._windows: list[Window] = []
        self.latest = -inf  # s, the newest frame
        self.buffered = 0  # frames
        self.opened = 0  # windows
        self.unevaluated = False  # the newest decided frames count as true without an answer

    @property
    def all_known(self) -> bool:
        """Whether the truth of every frame is decided."""
        return self._known == self._number

    @property
    def current(self) -> Window | None:
        """The window that the newest frame is in."""
        return next((w for w in self._windows if w.start <= self.latest <= w.end), None)

    def put(self, frames: Columns, at: float) -> None:
        """Take frames that came at `at` s of the monotonic clock."""
        n = len(frames.t)
        if not n:
            return
        batch = Batch(self._number, self._times(frames.t, at), frames, at)
        self._number += n
        self.buffered += n
        self._ring.append(batch)
        self._unanswered.append(batch)
        if not self._evaluating:
            self._decide(self._number)

    def answered(self, n: int, runs: Iterable[tuple[int, int, str]]) -> None:
        """The next `n` frames are evaluated; runs of rows [start, stop) among them are true, and why."""
        base, self._answers = self._answers, self._answers + n
        if self._answers <= self._known:
            return  # it was decided without this answer
        if self._time_of(max(base, self._known)) <= self._settled:
            until = _right(self._times_from(self._known), self._settled)
            self._true(self._known, min(self._known + until, self._answers), NOT_EVALUATED)
        else:
            self.unevaluated = False
        for start, stop, says in runs:
            self._true(base + start, base + stop, says)
        self._decide(self._answers)

    def unanswered(self, n: int) -> None:
        """The next `n` frames will never be evaluated: they count as true, and so does what comes just after them."""
        self._answers += n
        self._count_as_true(self._answers)
        if n:
            self._settled = max(self._settled, self._known_time + SETTLE_S)

    def give_up(self) -> None:
        """Nothing more will be answered: every frame counts as true."""
        self._count_as_true(self._number)
        self._settled = inf

    def decide_older(self, at: float) -> bool:
        """What came before `at` s (monotonic clock) and is not answered for counts as true; whether there was any."""
        some = False
        while self._unanswered and self._unanswered[0].at < at:
            self._count_as_true(self._unanswered[0].first + len(self._unanswered[0].times))
            some = True
        if self._settled == inf:
            self._count_as_true(self._number)
        return some

    def mark(self, t: float, says: str) -> None:
        """A trigger at stamp `t` s, whatever the conditions say."""
        at = min(t + self._offset, self.latest + MARK_AHEAD_S) if self.latest > -inf else 0.0
        self._open(at, at, t, says)

    def end(self) -> None:
        """No more frames: what is not decided counts as true."""
        self._count_as_true(self._number)
        self._known_time = inf

    def take(self, most: float = inf) -> list[Item]:
        """Give out what is decided to be recorded, in order, `most` frames or a batch more; discard what is not."""
        out: list[Item] = []
        while most > 0:
            window = self._windows[0] if self._windows else None
            if not self._ring:
                if window is None or self._known_time - self._pre <= window.end:
                    break
                self._close(window, out)
                continue
            times = self._ring[0].times
            if window is None:
                self._discard(_left(times, self._known_time - self._pre - MARK_MARGIN_S))
                if self._ring and self._ring[0].times is times:
                    break
            elif times[0] < window.start:
                # until the window begins, an earlier one may still: by what is not known yet, or by a late mark
                known = self._known_time - self._pre
                self._discard(_left(times, window.start if known >= window.start else known - MARK_MARGIN_S))
                if self._ring and self._ring[0].times is times:
                    break
            elif times[0] <= window.end:
                most -= self._give(window, _right(times, window.end), out)
            elif self._known_time - self._pre > window.end:
                self._close(window, out)
            else:
                break
        return out

    def bound(self) -> tuple[bool, bool]:
        """Keep the buffer within its size: what is unknown counts as true, what is known is discarded earlier.

        Returns:
            whether frames must be given out although the log has no room; whether any counted as true.
        """
        counted = False
        while self.buffered > self._max_frames:
            head = self._ring[0]
            window = next((w for w in self._windows if w.end >= head.times[0]), None)
            if window is not None and window.start <= head.times[0]:
                return True, counted
            if head.first >= self._known:
                self._count_as_true(head.first + len(head.times))
                counted = True
            else:
                outside = _left(head.times, window.start) if window is not None else len(head.times)
                self._discard(min(outside, self._known - head.first))
        return False, counted

    # --- time ---

    def _times(self, stamps: Array, at: float) -> Array:
        if self.latest == -inf:
            self.latest, self._put_at = float(stamps[0]), at
        passed, self._put_at = max(at - self._put_at, 0.0), at
        most, least = self.latest + passed + MAX_AHEAD_S, self.latest - MAX_BACK_S
        if stamps.max() + self._offset > most or stamps.min() + self._offset < least:
            return self._stepped(stamps.tolist(), passed)
        times = np.maximum(np.maximum.accumulate(stamps + self._offset), self.latest)
        self.latest = float(times[-1])
        return times

    def _stepped(self, stamps: list[float], passed: float) -> Array:
        """The same, frame by frame, where a clock has stepped."""
        times = []
        for t in stamps:
            ahead = t + self._offset - self.latest
            if not -MAX_BACK_S <= ahead <= passed + MAX_AHEAD_S:
                self._offset = self.latest + passed - t
            self.latest = max(self.latest, t + self._offset)
            times.append(self.latest)
            passed = 0.0
        return np.array(times)

    def _times_from(self, number: int) -> Array:
        """Times of the frames from `number` on that wait for their answer."""
        return np.concatenate(
            [b.times[max(number - b.first, 0) :] for b in self._unanswered] or [np.empty(0)]
        )

    def _batch_of(self, number: int) -> Batch:
        for batch in self._unanswered:
            if number < batch.first + len(batch.times):
                return batch
        raise ValueError(f"frame {number} has not come")

    def _time_of(self, number: int) -> float:
        batch = self._batch_of(number)
        return float(batch.times[number - batch.first])

    # --- truth ---

    def _true(self, start: int, stop: int, says: str) -> None:
        """Frames [start, stop) are true."""
        start = max(start, self._known)
        if start >= stop:
            return
        batch = self._batch_of(start)
        row = start - batch.first
        # it was true up to here: the same window goes on, however long ago that frame was
        first = self._true_time if start <= self._true_stop else float(batch.times[row])
        if stop > self._true_stop:
            self._true_stop, self._true_time = stop, self._time_of(stop - 1)
        self._open(first, self._true_time, float(batch.frames.t[row]), says)

    def _count_as_true(self, stop: int) -> None:
        if stop > self._known:
            self._true(self._known, stop, NOT_EVALUATED)
            self.unevaluated = True
            self._decide(stop)

    def _decide(self, stop: int) -> None:
        """The truth of the frames before `stop` is known."""
        if stop <= self._known:
            return
        self._known_time = self._time_of(stop - 1)
        self._known = stop
        while self._unanswered and self._unanswered[0].first + len(self._unanswered[0].times) <= stop:
            self._unanswered.popleft()

    def _open(self, first: float, last: float, t: float, says: str) -> None:
        """A window around [first, last], or a longer one where there is one already."""
        start, end = first - self._pre, last + self._post
        touching = [w for w in self._windows if w.start <= end and start <= w.end]
        if touching:
            window = touching[0]
            if start < window.start:
                self._note_missing(window, start)
            window.start = min(start, window.start)
            window.end = max(end, *(w.end for w in touching))
            for other in touching[1:]:
                self._windows.remove(other)
                self.opened -= 1
            return
        window = Window(start, end, first, t, says)
        self._note_missing(window, start)
        self._windows.append(window)
        self._windows.sort(key=lambda w: w.start)
        self.opened += 1

    def _note_missing(self, window: Window, start: float) -> None:
        if self._discarded >= start:
            window.missing = max(window.missing, self._discarded - start)

    # --- the ring ---

    def _discard(self, count: int) -> None:
        if count:
            self._discarded = float(self._ring[0].times[count - 1])
            self._pass(count)

    def _pass(self, count: int) -> Columns:
        """Take frames off the oldest batch."""
        first, times, frames, at = self._ring.popleft()
        n = len(times)
        self.buffered -= count
        if count < n:
            rest = frame_columns.rows(frames, count, n)
            self._ring.appendleft(Batch(first + count, times[count:], rest, at))
        return frame_columns.rows(frames, 0, count)

    def _give(self, window: Window, count: int, out: list[Item]) -> int:
        before = 0 if window.announced else _left(self._ring[0].times[:count], window.at)
        frames = self._pass(count)
        window.last = float(frames.t[-1])
        if window.announced or before == count:
            out.append(frames)
            return count
        window.announced = True
        if before:
            out.append(frame_columns.rows(frames, 0, before))
        out += [Begin(window), frame_columns.rows(frames, before, count)]
        return count

    def _close(self, window: Window, out: list[Item]) -> None:
        if not window.announced:
            out.append(Begin(window))
        out.append(End(window))
        self._windows.remove(window)


def _left(times: Array, at: float) -> int:
    return int(np.searchsorted(times, at, "left"))


def _right(times: Array, at: float) -> int:
    return int(np.searchsorted(times, at, "right"))
