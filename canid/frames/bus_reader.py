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
from canid.frames.received import Received
from canid.frames.stamp_clock import StampClock
from canid.types import NAN

# s that a reader waits for a frame before it looks whether it should stop
POLL = 0.1
# s between two looks at what the driver says of the controller
LOOK = 0.5
# s between attempts to open a lost bus again: within 2 s it is back
RETRY = 1.0
# s that emptying a bus may take at the end: 60,000 frames take one on a laptop, 20 on an emulated machine
DRAIN = 60.0
# interfaces whose stamps are the host's own clock: a device's runs ahead or behind, and a log that is replayed onto a
# virtual bus brings its own, so that a stamp says nothing of whether a frame came before the stop
HOST_CLOCK = ("socketcan",)


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

    def _look(self) -> None:
        """Tell what the device and its driver say."""
        for what, says in self.bus.news():
            self._tell(what, says)
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
        while not self._stopping.wait(RETRY):
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
        until_ns, until = time.time_ns(), time.monotonic() + DRAIN
        # software filters answer None for a frame that they hide: ask again, with time to look further
        wait = 0.01 if self.bus.filtered else 0.0
        empty = 0
        while empty < 3 and time.monotonic() < until:
            try:
                got = self.bus.recv(wait)
            except Exception as error:
                self._tell("bus_lost", str(error))
                return
            if got is None:
                empty += 1
                continue
            empty = 0
            self._put(Arrival(self.index, time.monotonic(), got))
            host = self.bus.interface in HOST_CLOCK and self.bus.clock is StampClock.KERNEL
            if host and got.ns > until_ns:
                return  # it came after the stop
        if empty < 3:
            self._tell("left_unread", f"{self.bus.name}: frames that came before the stop were left unread")
