"""The end of reading: what a bus received before the stop is taken, and what comes after the stop ends it.

A bus that goes on sending never becomes empty. Whether a frame came before the stop is decided by its time stamp, where
that is a time of receipt; where it is not, reading ends a second after the stop.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from canid.io.buses.bus import MAX_GATHERED, ReceiveOnlyBus
from canid.io.buses.receivers.received_columns import ReceivedColumns, columns_of, select
from canid.io.buses.receivers.received_frame import Received
from canid.io.buses.timestamp_source import TimestampSource

# s in all: what the kernel holds at most (280,000 frames in 32 MB) takes 10 s on a laptop, 100 s on an emulated machine
MAX_DRAIN_S = 120.0
# s after the stop that a bus is read whose stamps are not times of receipt; serial adapters hold some 4 kB, a
# driver's queue of 32,768 frames takes half of it
MAX_UNKNOWN_S = 1.0
# s; a stamp later than now by more than this is not from the clock that it is compared with
_IMPLAUSIBLE_S = 0.5
# s by which frames may be delayed less than the quickest one so far: a turn of the USB bus and the drift of a clock
_MARGIN_S = 0.1
# Interfaces whose stamps are the host's own clock at receipt.
_HOST_CLOCK = ("socketcan", "udp_multicast")
# Interfaces whose stamps are made at receipt, by the device or its driver (python-can 4.6). Not among them: iscan,
# robotell and slcan, which stamp when they are read; seeedstudio, serial, usb2can and plug-ins, where it is unknown.
_STAMPED_AT_RECEIPT = (
    *(
        "canalystii",
        "cantact",
        "etas",
        "gs_usb",
        "ixxat",
        "kvaser",
        "neousys",
        "neovi",
        "nican",
        "nixnet",
        "pcan",
    ),
    *("socketcan", "socketcand", "systec", "vector"),
)
# consecutive empty answers after which nothing is left: a driver may give one while it hands over
_EMPTY_ANSWERS = 3


class Stop:
    """The time of the stop, and whether a frame was received before it."""

    def __init__(self, bus: ReceiveOnlyBus, lead_ns: float | None):
        """`lead_ns`: the largest lead of a stamp before its arrival on the monotonic clock; None: unknown."""
        self.at = time.monotonic()
        self.at_ns = time.time_ns()
        self._host = bus.interface in _HOST_CLOCK and bus.clock is TimestampSource.KERNEL
        stamped = (
            bus.clock in (TimestampSource.DRIVER, TimestampSource.HARDWARE)
            and bus.interface in _STAMPED_AT_RECEIPT
        )
        self._lead_ns = lead_ns if stamped else None

    def first_after(self, ns: npt.NDArray[np.int64]) -> tuple[int, bool]:
        """The first frame that was certainly received after the stop (n: none), and whether the one before is unknown."""
        later = self._later(ns)
        after = later > 0
        first = int(after.argmax()) if after.any() else len(ns)
        return first, bool(first and np.isnan(later[first - 1]))

    def _later(self, ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """S from the stop to the receipt of each frame, as far as the stamps show it; NaN: unknown."""
        since = time.monotonic() - self.at
        if self._host:
            later = (ns - self.at_ns) * 1e-9
        elif self._lead_ns is not None:
            # no frame arrives before it was received: this is the earliest time of its receipt
            later = (ns - self._lead_ns) * 1e-9 - self.at - _MARGIN_S
        else:
            return np.full(len(ns), np.nan)
        return np.where((ns == 0) | (later > since + _IMPLAUSIBLE_S), np.nan, later)


def drain(bus: ReceiveOnlyBus, lead_ns: float | None, put: Callable[[ReceivedColumns], object]) -> str:
    """Take what was received before now. Returns "" or a sentence on what may be left unread. Raises BusError."""
    waiting = bus.waiting()
    if waiting is not None:
        _drain_queue(bus, waiting, put)
        return ""
    stop = Stop(bus, lead_ns)
    # software filters of python-can answer None for a frame that they hide: ask again, with time to go on
    wait = 0.01 if bus.filtered else 0.0
    empty = 0
    while empty < _EMPTY_ANSWERS:
        left_out = bus.left_out
        got = bus.recv_many(wait)
        if got is None and bus.left_out == left_out:
            empty += 1
            continue
        empty = 0
        stamps = np.array([bus.passed_over_ns]) if got is None else got.ns
        first, unknown = stop.first_after(stamps)
        if got is not None and first:
            put(got if first == len(got.ns) else select(got, slice(0, first)))
        if first < len(stamps):
            return ""
        since = time.monotonic() - stop.at
        if unknown and since > MAX_UNKNOWN_S:
            return (
                f"{bus.name}: frames still came {MAX_UNKNOWN_S:g} s after the stop, and their time stamps do not show"
                " which of them came before it; reading ended here"
            )
        if since > MAX_DRAIN_S:
            return f"{bus.name}: frames that came before the stop were left unread after {MAX_DRAIN_S:g} s"
    return ""


def _drain_queue(bus: ReceiveOnlyBus, waiting: int, put: Callable[[ReceivedColumns], object]) -> None:
    """Take so many messages, of a bus that knows how many it holds."""
    frames: list[Received] = []
    try:
        for _ in range(waiting):
            got = bus.recv(0.0)
            if got is not None:
                frames.append(got)
            if len(frames) == MAX_GATHERED:
                put(columns_of(frames))
                frames = []
    finally:
        if frames:
            put(columns_of(frames))
