"""Requests of a person at a session or replay: stop, mark, diagnosis, signals, pause, speed, seek; from any thread."""

from __future__ import annotations

import threading
import time
from typing import NamedTuple

# marks that may wait; more than that in a twentieth of a second is no person
MAX_WAITING_MARKS = 100
# characters of a mark's text
MAX_MARK_TEXT = 200
# s for which a request for the table of signals holds; a page that shows it asks every 2 s
SIGNALS_HOLD_S = 5.0


class Mark(NamedTuple):
    """A mark at a time of the drive."""

    text: str  # "": none was given
    at: float  # monotonic clock, s


class Playback(NamedTuple):
    """How a replay plays."""

    paused: bool = False
    speed: float = float("inf")  # factor of real time


class Controls:
    """What was asked for and not yet done; the loop of the session or the replay polls it.

    Example:
        >>> controls = Controls()
        >>> controls.mark("overtaking")
        >>> [mark.text for mark in controls.take_marks()], controls.take_marks()
        (['overtaking'], [])
        >>> controls.seek(12.0)
        >>> controls.take_seek(), controls.take_seek()
        (12.0, None)
    """

    def __init__(self, speed: float = float("inf")) -> None:
        """Nothing is asked for yet."""
        self._lock = threading.Lock()
        self._marks: list[Mark] = []
        self._seek: float | None = None
        self._stop = self._diagnose = False
        self._signals_until = 0.0  # monotonic clock, s
        self.playback = Playback(speed=speed)

    @property
    def stop_requested(self) -> bool:
        """Whether the end was asked for."""
        return self._stop

    def stop(self) -> None:
        """Ask for a clean end."""
        self._stop = True

    def diagnose(self) -> None:
        """Ask for a diagnosis of the drive so far."""
        self._diagnose = True

    def take_diagnose(self) -> bool:
        """Whether one was asked for since the last call."""
        asked, self._diagnose = self._diagnose, False
        return asked

    def show_signals(self) -> None:
        """Ask for the table of signals, for `SIGNALS_HOLD_S`."""
        self._signals_until = time.monotonic() + SIGNALS_HOLD_S

    @property
    def signals_shown(self) -> bool:
        """Whether a page shows the table of signals."""
        return time.monotonic() < self._signals_until

    def mark(self, text: str = "") -> None:
        """Mark this time; what exceeds `MAX_WAITING_MARKS` or `MAX_MARK_TEXT` is left out."""
        with self._lock:
            if len(self._marks) < MAX_WAITING_MARKS:
                self._marks.append(Mark(" ".join(text.split())[:MAX_MARK_TEXT], time.monotonic()))

    def take_marks(self) -> list[Mark]:
        """The marks since the last call."""
        with self._lock:
            marks, self._marks = self._marks, []
        return marks

    def pause(self, paused: bool) -> None:
        """Pause a replay, or go on."""
        with self._lock:
            self.playback = self.playback._replace(paused=paused)

    def set_speed(self, speed: float) -> None:
        """Set the speed of a replay: a factor of real time above 0; infinite is as fast as it goes.

        Raises ValueError for any other number.
        """
        if not speed > 0.0:
            raise ValueError(f"speed must be above 0, not {speed}")
        with self._lock:
            self.playback = self.playback._replace(speed=speed)

    def seek(self, t: float) -> None:
        """Ask a replay to go on at `t` s of the log; the latest request counts. Raises ValueError where t is no time."""
        if not 0.0 <= t < float("inf"):
            raise ValueError(f"t must be a time of the log in s, not {t}")
        with self._lock:
            self._seek = t

    def take_seek(self) -> float | None:
        """Where to go on, s; None: nothing was asked for since the last call."""
        with self._lock:
            t, self._seek = self._seek, None
        return t
