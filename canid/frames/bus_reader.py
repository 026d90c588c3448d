"""The thread that reads one bus into a queue, through its loss and return, to the last frame at the end."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import NamedTuple

from canid.errors import BusError
from canid.frames.bus import ReceiveOnlyBus
from canid.frames.clock_watch import ClockWatch
from canid.frames.draining import LIMIT_S, drain
from canid.frames.received import Received
from canid.frames.stamp_clock import StampClock
from canid.types import NAN

# s that a reader waits for a frame before it looks whether it should stop
POLL = 0.1
# s between two looks at what the driver says of the controller
LOOK = 0.5
# s that the end of reading may take at most, for whoever waits for it
DRAIN = LIMIT_S
# s between attempts to open a lost bus again: within 2 s it is back
RETRY = 1.0
# s between two questions whether a SocketCAN device that is down is up again: the gap that is told is exact to this
ASK_DEVICE_S = 0.1
# how many times as many impossible messages as were told last are worth another word
GROWTH = 10


class Arrival(NamedTuple):
    """A frame in the queue."""

    bus: int
    at: float  # s, monotonic clock
    frame: Received


class BusReader:
    """Reads one bus until told to stop, and keeps what is known of it."""

    def __init__(
        self,
        bus: ReceiveOnlyBus,
        index: int,
        put: Callable[[Arrival], object],
        stopping: threading.Event,
        tell: Callable[[str, str], object],
    ):
        """`put` takes each frame, `tell(what, says)` each event."""
        self.bus = bus
        self.index = index
        self._put = put
        self._stopping = stopping
        self._tell = tell
        self.state = "open"
        self.lost_at: float | None = None  # s, monotonic clock
        # kept by the passing thread
        self.frames = self.errors = 0
        self.drops_told = 0
        self._impossible_told = 0
        self.overflows = self.overflows_told = 0  # error frames: the controller's own buffer overflowed
        self.clock = StampClock.UNKNOWN
        self.watch = ClockWatch()
        self.busy = 0.0  # s on the bus since the window began
        self.load = NAN
        self.controller = ""  # by either thread: error frames tell, or the driver does
        self.counters: tuple[int, int] | None = None  # TEC, REC

    def run(self) -> None:
        """Read; the body of the thread."""
        self._look()  # before the first frame: error frames tell what comes later
        now = looked = time.monotonic()
        while not self._stopping.is_set():
            if now - looked >= LOOK:
                looked = now
                self._look()
            try:
                got = self.bus.recv(POLL)
                now = time.monotonic()
            except Exception as error:  # a reader must never die in silence
                self._lose(error)
                continue
            if got is not None:
                self._put(Arrival(self.index, now, got))
        self._look()
        if self.lost_at is None:
            self._drain()
        self._tell_impossible(1)

    def _look(self) -> None:
        """Tell what the device and its driver say."""
        for what, says in self.bus.news():
            self._tell(what, says)
        self._tell_impossible(GROWTH * self._impossible_told or 1)
        self.controller_is(self.bus.controller())

    def controller_is(self, state: str) -> None:
        """Tell a controller's state that is new; "" says nothing. canid restarts no controller."""
        before = self.controller or "error_active"
        self.controller = state or self.controller
        if state in ("", before):
            return
        says = f"{self.bus.name}: the controller reports {state.replace('_', ' ')}"
        if state == "bus_off":
            says += "; it stays off until somebody restarts it"
        self._tell(state, says)

    def _lose(self, error: Exception) -> None:
        """Say so, and try to open it again until it is back or the recorder stops."""
        why = str(error) or type(error).__name__
        self.state, self.lost_at = f"lost: {why}", time.monotonic()
        self._tell("bus_lost", why)
        while not self._stopping.wait(ASK_DEVICE_S if self.bus.holds_socket else RETRY):
            try:
                self.bus.reopen()
            except Exception as again:
                self.state = f"lost: {again}"
                self._look()
                continue
            self._back(self.lost_at)
            return
        # the end: opening may take long, but what a socket has received since then is there to be read
        with contextlib.suppress(BusError):
            if self.bus.resumed():
                self._back(self.lost_at)

    def _back(self, lost_at: float) -> None:
        away = time.monotonic() - lost_at
        self.state, self.lost_at = "open", None
        self.watch.forget()
        self._look()
        self._tell("bus_back", f"{self.bus.name} is back; nothing was received for {away:.1f} s")

    def _drain(self) -> None:
        def put(got: Received) -> None:
            self._put(Arrival(self.index, time.monotonic(), got))

        try:
            left = drain(self.bus, self.watch.lead_ns, put)
        except Exception as error:
            self._tell("bus_lost", str(error))
            return
        if left:
            self._tell("left_unread", left)

    def _tell_impossible(self, least: int) -> None:
        """Tell how many messages were left out, if there are `least` or more and it was not told yet."""
        count = self.bus.impossible
        if count < least or count == self._impossible_told:
            return
        self._impossible_told = count
        what = "1 message" if count == 1 else f"{count:,} messages"
        says = (
            f"{self.bus.name}: {what} left out that no bus can carry; the latest: {self.bus.impossible_why}"
        )
        self._tell("impossible_frames", says)
