"""Triggered recording: between the thread that stamps frames and the thread that writes them.

Frames go into a `PreTriggerBuffer`; another process evaluates the conditions and its answers come later, in another
thread. What is decided goes on to the log in the order in which it came, and with it events at the beginning and the end
of each window. Where nothing is answered for `ANSWER_TIMEOUT_S`, everything is recorded.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from math import inf
from typing import NamedTuple, Protocol

from canid.io.recording.pre_trigger_buffer import (
    MAX_BUFFERED_FRAMES,
    NOT_EVALUATED,
    Begin,
    End,
    PreTriggerBuffer,
    Window,
)
from canid.values.types import Columns, Event

# s that a frame waits for the evaluation of the conditions; the process that evaluates takes 3 s to start on a laptop
# and answers within 0.1 s then
ANSWER_TIMEOUT_S = 10.0
# s that the end of a recording waits for answers; what is not answered then is recorded
LAST_ANSWERS_S = 1.0
# frames that may wait in the log's own queue (`log_writer_thread.MAX_WAITING_FRAMES`) when more are handed to it
MAX_HANDED_FRAMES = 60_000
# s between two readings of the log's queue while the rest is handed over
_HAND_OVER_S = 0.01


class TriggerStats(NamedTuple):
    """What a triggered recording does."""

    state: str  # "armed", "recording", or "recording_all": nothing is evaluated, so everything is recorded
    condition: str  # of the present window; "" while armed
    windows: int  # so far
    buffered: int  # frames in memory


class Log(Protocol):
    """Takes frames and events, in order; `canid.io.recording.log_writer_thread`."""

    @property
    def waiting(self) -> int:
        """Frames that are not written yet."""

    def put(self, frames: Columns, at: float, start_ns: int) -> None:
        """Take frames."""

    def put_event(self, event: Event) -> None:
        """Take an event, between frames."""


class TriggerGate:
    """Any thread may call; nothing waits but `finish`."""

    def __init__(
        self,
        pre: float,
        post: float,
        *,
        evaluating: bool,
        own_events: frozenset[str] = frozenset(),
        says: str = "",
        max_frames: int = MAX_BUFFERED_FRAMES,
    ) -> None:
        """`evaluating`: somebody calls `answered`; `own_events`: of the recorder, that trigger; `says`: what is armed."""
        self.own_events = own_events
        self.says = says
        self._buffer = PreTriggerBuffer(pre, post, evaluating=evaluating, max_frames=max_frames)
        self._lock = threading.Lock()
        self._log: Log | None = None
        self._announce: Callable[[Event], object] = lambda event: None
        self._start_ns = 0
        self._latest = 0.0  # s, stamp of the newest frame
        self._unevaluated = False  # as it was announced
        self.waited = 0.0  # s, for the last answers

    def bind(self, log: Log, announce: Callable[[Event], object]) -> None:
        """Frames go to `log`; `announce` takes events that stand in the log already."""
        self._log, self._announce = log, announce

    def put(self, frames: Columns, at: float, start_ns: int) -> None:
        """Take frames that came at `at` s (monotonic clock); `start_ns`: epoch ns of their t = 0."""
        with self._lock:
            self._start_ns = start_ns
            self._latest = float(frames.t[-1])
            self._buffer.put(frames, at)
            self._pass_on()

    def tick(self) -> None:
        """Let time pass; called some times a second."""
        with self._lock:
            self._pass_on()

    def answered(self, n: int, runs: Iterable[tuple[int, int, str]] | None) -> None:
        """The next `n` frames are evaluated: runs of rows that are true, and why. None: they never will be."""
        with self._lock:
            try:
                if runs is None:
                    self._buffer.unanswered(n)
                else:
                    self._buffer.answered(n, runs)
            except ValueError:  # an answer for frames that have not come: which were meant is unknown
                self._buffer.give_up()
            self._pass_on()

    def give_up(self) -> None:
        """Nothing will be answered any more: everything is recorded from here on."""
        with self._lock:
            self._buffer.give_up()
            self._pass_on()

    def mark(self, t: float, says: str) -> None:
        """A trigger at `t` s of the session."""
        with self._lock:
            self._buffer.mark(t, says)
            self._pass_on()

    def stats(self) -> TriggerStats:
        """What it does now."""
        with self._lock:
            window = self._buffer.current
            if window is None:
                return TriggerStats("armed", "", self._buffer.opened, self._buffer.buffered)
            state = "recording_all" if self._buffer.unevaluated else "recording"
            return TriggerStats(state, window.says, self._buffer.opened, self._buffer.buffered)

    def finish(self, waiting: Callable[[], object] = lambda: None) -> None:
        """No more frames: wait a little for the last answers, then hand over all that is to be recorded.

        That waits for the disk, however long it takes; `waiting` is called meanwhile.
        """
        began = time.monotonic()
        deadline = began + LAST_ANSWERS_S
        while not self._buffer.all_known and time.monotonic() < deadline:
            time.sleep(_HAND_OVER_S)
        self.waited = time.monotonic() - began
        with self._lock:
            if not self._buffer.all_known:
                self._note_unevaluated("the recording ended before the conditions were evaluated")
            self._buffer.end()
        while True:
            with self._lock:
                self._hand_over()
                if not self._buffer.buffered:
                    return
            time.sleep(_HAND_OVER_S)
            waiting()

    # --- with the lock ---

    def _pass_on(self) -> None:
        if self._buffer.decide_older(time.monotonic() - ANSWER_TIMEOUT_S):
            self._note_unevaluated(f"the conditions were not evaluated for {ANSWER_TIMEOUT_S:.0f} s")
        self._hand_over()
        stuck, counted = self._buffer.bound()
        if counted:
            self._note_unevaluated("more frames wait for an evaluation than the buffer holds")
        if stuck or counted:
            self._hand_over(force=stuck)
        if self._buffer.unevaluated:
            self._note_unevaluated("the process that evaluates the conditions has failed")
        elif self._unevaluated:
            self._unevaluated = False
            self._event("trigger_evaluated", "the trigger conditions are evaluated again")

    def _note_unevaluated(self, why: str) -> None:
        if not self._unevaluated:
            self._unevaluated = True
            self._event("trigger_not_evaluated", f"{why}: everything is recorded meanwhile")

    def _event(self, what: str, says: str) -> None:
        self._put_event(Event(self._latest, what, says))

    def _put_event(self, event: Event) -> None:
        if self._log is not None:
            self._log.put_event(event)
        self._announce(event)

    def _hand_over(self, *, force: bool = False) -> None:
        log = self._log
        if log is None:
            return
        room = inf if force else MAX_HANDED_FRAMES - log.waiting
        for item in self._buffer.take(room):
            if isinstance(item, Begin):
                self._put_event(Event(item.window.t, "trigger", _begin_text(item.window)))
                item.window.missing = 0.0
            elif isinstance(item, End):
                self._put_event(Event(item.window.last, "trigger_end", _end_text(item.window)))
            else:
                # it is now that the log may write them: they have not waited for the disk
                log.put(item, time.monotonic(), self._start_ns)


def _begin_text(window: Window) -> str:
    before = window.at - window.start
    text = f"trigger: {window.says}; recorded from {before:g} s before"
    if window.says == NOT_EVALUATED:
        text = f"recorded without a trigger: {window.says}"
    return text + _missing_text(window)


def _end_text(window: Window) -> str:
    length = window.last - window.t
    ended = f"end of the window of the trigger at {window.t:.3f} s ({window.says}), {length:.3f} s after it"
    return ended + _missing_text(window)


def _missing_text(window: Window) -> str:
    return f"; {window.missing:.3f} s of it were not in the buffer any more" if window.missing else ""
