"""The thread that reads one bus into a queue, reopens a lost bus, and drains the bus at the end."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import NamedTuple

from canid.io.buses.bus import ReceiveOnlyBus
from canid.io.buses.clock_watch import ClockWatch
from canid.io.buses.draining import drain
from canid.io.buses.receivers.many_messages import GATHER_S
from canid.io.buses.receivers.received_columns import ReceivedColumns
from canid.io.buses.timestamp_source import TimestampSource
from canid.values.errors import BusError
from canid.values.types import NAN

# s that a reader waits for a frame before it checks whether to stop
RECEIVE_TIMEOUT_S = 0.1
# s between two queries of the controller's state
CONTROLLER_POLL_S = 0.5
# s between attempts to open a lost bus again: within 2 s it is back
REOPEN_INTERVAL_S = 1.0
# s between two queries whether a SocketCAN device that is down is up again: the reported gap is exact to this
DEVICE_POLL_S = 0.1
# growth of the number of impossible messages that is worth another event
REPORT_GROWTH = 10


class Arrival(NamedTuple):
    """Frames in the queue that were received together."""

    bus: int
    at: float  # s, monotonic clock
    frames: ReceivedColumns


class BusReader:
    """Reads one bus until `stopping` is set, and keeps its state."""

    def __init__(
        self,
        bus: ReceiveOnlyBus,
        index: int,
        put: Callable[[Arrival], object],
        stopping: threading.Event,
        report: Callable[[str, str], object],
        gather: float = GATHER_S,
        number: int = 0,
    ):
        """`put` takes frames that came together within `gather` s, `report(what, says)` each event.

        `index`: its place among the session's readers; `number`: of the bus, in frames and files.
        """
        self.bus = bus
        self.index = index
        self.number = number
        self._put = put
        self._stopping = stopping
        self._report = report
        self._gather = gather
        self.state = "open"
        self.lost_at: float | None = None  # s, monotonic clock
        self.received = 0  # frames
        # kept by the passing thread
        self.frames = self.errors = 0
        self.drops_reported = 0
        self._impossible_reported = 0
        self.overflows = self.overflows_reported = 0  # error frames: the controller's own buffer overflowed
        self.clock = TimestampSource.UNKNOWN
        self.watch = ClockWatch()
        self.busy = 0.0  # s on the bus since the window began
        self.load = NAN
        self.controller = ""  # set by either thread: from error frames or from the driver
        self.counters: tuple[int, int] | None = None  # TEC, REC

    def run(self) -> None:
        """Read; the body of the thread."""
        self._report_changes()  # before the first frame: later changes come as error frames
        now = checked = time.monotonic()
        while not self._stopping.is_set():
            if now - checked >= CONTROLLER_POLL_S:
                checked = now
                self._report_changes()
            try:
                got = self.bus.recv_many(RECEIVE_TIMEOUT_S, self._gather)
                now = time.monotonic()
            except Exception as error:  # a reader must never die in silence
                self._lose(error)
                continue
            if got is not None:
                self._pass(got, now)
        self._report_changes()
        if self.lost_at is None:
            self._drain()
        self._report_impossible(1)

    def _pass(self, frames: ReceivedColumns, at: float) -> None:
        self.received += len(frames.ns)
        self._put(Arrival(self.index, at, frames))

    def _report_changes(self) -> None:
        """Report changes of the device and of the controller's state."""
        for what, says in self.bus.news():
            self._report(what, says)
        self._report_impossible(REPORT_GROWTH * self._impossible_reported or 1)
        self.controller_is(self.bus.controller())

    def controller_is(self, state: str) -> None:
        """Report a new state of the controller; "" is unknown. canid restarts no controller."""
        before = self.controller or "error_active"
        self.controller = state or self.controller
        if state in ("", before):
            return
        says = f"{self.bus.name}: the controller reports {state.replace('_', ' ')}"
        if state == "bus_off":
            says += "; it stays off until it is restarted"
        self._report(state, says)

    def _lose(self, error: Exception) -> None:
        """Report the loss, and try to open the bus again until it is back or the recorder stops."""
        why = str(error) or type(error).__name__
        self.state, self.lost_at = f"lost: {why}", time.monotonic()
        self._report("bus_lost", why)
        while not self._stopping.wait(DEVICE_POLL_S if self.bus.holds_socket else REOPEN_INTERVAL_S):
            try:
                self.bus.reopen()
            except Exception as again:
                self.state = f"lost: {again}"
                self._report_changes()
                continue
            self._back(self.lost_at)
            return
        # at the end: opening may take long, but what a socket has received since then can be read
        with contextlib.suppress(BusError):
            if self.bus.resumed():
                self._back(self.lost_at)

    def _back(self, lost_at: float) -> None:
        away = time.monotonic() - lost_at
        self.state, self.lost_at = "open", None
        self.watch.forget()
        self._report_changes()
        self._report("bus_back", f"{self.bus.name} is back; nothing was received for {away:.1f} s")

    def _drain(self) -> None:
        def put(got: ReceivedColumns) -> None:
            self._pass(got, time.monotonic())

        try:
            left = drain(self.bus, self.watch.lead_ns, put)
        except Exception as error:
            self._report("bus_lost", str(error))
            return
        if left:
            self._report("left_unread", left)

    def _report_impossible(self, least: int) -> None:
        """Report how many messages were dropped, if there are `least` or more and that was not reported yet."""
        count = self.bus.impossible
        if count < least or count == self._impossible_reported:
            return
        self._impossible_reported = count
        what = "1 message" if count == 1 else f"{count:,} messages"
        says = (
            f"{self.bus.name}: {what} left out that no bus can carry; the latest: {self.bus.impossible_why}"
        )
        self._report("impossible_frames", says)
