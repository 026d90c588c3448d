"""An open bus that can only be received from, whatever the interface."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from canid.io.buses import listen_only
from canid.io.buses.device_watch import DeviceWatch
from canid.io.buses.frame_check import MAX_STAMP_NS, ImpossibleFrameError, possible, why_impossible
from canid.io.buses.listen_only import ListenOnly
from canid.io.buses.receivers.many_messages import GATHER_S
from canid.io.buses.receivers.received_columns import (
    Many,
    ManyReceiver,
    ReceivedColumns,
    columns_of,
    frames_of,
    select,
)
from canid.io.buses.receivers.received_frame import Received, Receiver
from canid.io.buses.timestamp_source import TimestampSource
from canid.values import timestamps
from canid.values.bus_names import of_open_buses
from canid.values.errors import BusError, one_line
from canid.values.types import NAN, Flag

_EXTENDED, _FD = int(Flag.EXTENDED), int(Flag.FD)

# s after the first frame of an interface without a call for many that those that follow are waited for
SINGLE_GATHER_S = 0.003
# frames that are gathered at most
MAX_GATHERED = 512

Filters = Sequence[Mapping[str, Any]]


def _waits(timeout: float) -> Iterator[float]:
    """How long each call may wait: `timeout` s, and after one without a frame of use until as long again has passed."""
    yield timeout
    left, end = timeout, time.monotonic() + timeout
    while left > 0:
        yield left
        left = end - time.monotonic()


class Opened(NamedTuple):
    """A bus that was opened."""

    receiver: Receiver
    listen_only: ListenOnly
    waiting: Callable[[], int] | None = None  # how many frames wait to be read; None: unknown


class ReceiveOnlyBus:
    """A bus that can be received from; it has no method that sends.

    Every frame passes `frame_check` here: what no bus can carry is counted in `impossible` and dropped.
    """

    def __init__(
        self,
        opener: Callable[[], Opened],
        *,
        interface: str,
        channel: str,
        bitrate: float = NAN,
        data_bitrate: float = NAN,
        filtered: bool = False,
        filters: Filters = (),
        hide_fd: bool = False,
        configured_by: tuple[str, ...] = (),
        device: DeviceWatch | None = None,
    ):
        """`filters`, `hide_fd`: applied here; `filtered`: by python-can, in software perhaps.

        `device`: the network device of a SocketCAN bus.
        """
        self.interface = interface
        self.channel = channel
        self.name = f"{interface} {channel}".strip()
        self.bitrate = bitrate  # bit/s, NaN: unknown
        self.data_bitrate = data_bitrate
        self.filtered = filtered  # software filters may make recv(0) return None with frames left
        self.configured_by = (
            configured_by  # files and environment variables, as in `BusConfiguration.sources`
        )
        self.impossible = 0  # messages that no bus can carry, left out
        self.impossible_why = ""  # the latest of them
        self.hidden = 0  # frames that filters left out
        self.passed_over_ns = 0  # when the latest of both was received, ns since 1970; 0: unknown
        self._filters = [(int(f["can_id"]), int(f["can_mask"]), f.get("extended")) for f in filters]
        self._hides = bool(filters) or hide_fd
        self._hide_fd = hide_fd
        self._opener = opener
        self._device = device
        self._receiver: Receiver | None
        self._receiver, self.listen_only, self._waiting = opener()
        self._news = [("listen_only", self.listen_only.says)] if self.listen_only.warns else []
        self._offset: int | None = None
        self._fault: BusError | None = None  # came after frames that were gathered
        self._lost_drops = 0

    def recv(self, timeout: float) -> Received | None:
        """Wait up to `timeout` s for a frame, its time in ns since 1970; None: none came. Raises BusError.

        With a timeout of 0 one message is taken, and None may also mean that it was left out. Stamps of an interface
        that counts from a zero of its own (since boot, say) are set against the host's clock once, at the first frame.
        """
        receiver = self._receiver
        if receiver is None:
            raise BusError(f"{self.name} is closed")
        for left in _waits(timeout):
            try:
                got = receiver.recv(left)
                if got is None:
                    return None
                why = why_impossible(got)
                if not why:
                    if self._offset != 0:
                        got = self._since_1970(got)
                    if not self._hides or not self._hidden(got):
                        return got
                    self.hidden += 1
                    self.passed_over_ns = got.ns
                else:
                    self._left_out(why, got.ns if type(got.ns) is int and self._offset == 0 else 0)
            except ImpossibleFrameError as error:
                self._left_out(str(error), error.ns)
        return None

    def recv_many(self, timeout: float, gather: float = GATHER_S) -> ReceivedColumns | None:
        """Wait up to `timeout` s for frames, and up to `gather` s for those that follow; otherwise as `recv`."""
        receiver = self._receiver
        # by its attribute: isinstance() with a protocol evaluates all others, and that of the drops is a query
        if not hasattr(receiver, "recv_many"):
            return self._gathered(timeout)
        many_receiver = cast(ManyReceiver, receiver)
        for left in _waits(timeout):
            many = many_receiver.recv_many(left, gather)
            if many is None:
                return None
            frames = self._checked(many)
            if len(frames.ns):
                return frames
        return None

    def _gathered(self, timeout: float) -> ReceivedColumns | None:
        """Frames of a receiver that takes one after the other, for `GATHER_S` at most: asking for one may take long."""
        fault, self._fault = self._fault, None
        if fault is not None:
            raise fault
        got = self.recv(timeout)
        if got is None:
            return None
        frames = [got]
        begin = now = time.monotonic()
        until = begin + SINGLE_GATHER_S if timeout else 0.0
        try:
            while len(frames) < MAX_GATHERED and now - begin < GATHER_S:
                got = self.recv(max(until - now, 0.0))
                now = time.monotonic()
                if got is None:
                    break
                frames.append(got)
        except BusError as error:
            self._fault = error
        return columns_of(frames)

    def _checked(self, many: Many) -> ReceivedColumns:
        """The frames that a bus can carry and that no filter hides, at times since 1970."""
        frames = many.frames
        for why, ns in many.impossible:
            self._left_out(why, ns)
        if not many.checked and not (good := possible(frames)).all():
            for got in frames_of(select(frames, ~good)):
                self._left_out(why_impossible(got), got.ns if self._offset == 0 else 0)
            frames = select(frames, good)
        if self._offset != 0 and len(frames.ns):
            frames = self._all_since_1970(frames)
        if self._hides and len(frames.ns):
            hidden = self._hidden_rows(frames)
            if hidden.any():
                self.hidden += int(hidden.sum())
                self.passed_over_ns = int(frames.ns[hidden][-1])
                frames = select(frames, ~hidden)
        return frames

    def _all_since_1970(self, frames: ReceivedColumns) -> ReceivedColumns:
        first = next(frames_of(select(frames, slice(0, 1))))
        self._since_1970(first)
        assert self._offset is not None
        ns = frames.ns + self._offset
        good = (ns >= 0) & (ns <= MAX_STAMP_NS)
        for _ in range(len(ns) - int(good.sum())):
            self._left_out("a time stamp that no log can hold", 0)
        return select(frames._replace(ns=ns), good)

    def _hidden_rows(self, frames: ReceivedColumns) -> npt.NDArray[np.bool_]:
        """Which frames filters drop; as `_hidden`."""
        fd = (frames.flags & _FD) != 0
        hidden = fd if self._hide_fd else np.zeros(len(fd), bool)
        if self._filters:
            extended = (frames.flags & _EXTENDED) != 0
            let_through = np.zeros(len(fd), bool)
            ids = frames.id.astype(np.int64)
            for id_, mask, wants_extended in self._filters:
                match = (ids ^ id_) & mask == 0
                let_through |= match if wants_extended is None else match & (extended == bool(wants_extended))
            hidden = hidden | ~let_through
        return hidden

    def _since_1970(self, got: Received) -> Received:
        """Set a stamp of the interface's own against the host's clock. Raises ImpossibleFrameError."""
        if self._offset is None:
            epoch = got.ns >= timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S
            self._offset = 0 if epoch else time.time_ns() - got.ns
        ns = got.ns + self._offset
        if not 0 <= ns <= MAX_STAMP_NS:
            raise ImpossibleFrameError("a time stamp that no log can hold")
        return got._replace(ns=ns)

    @property
    def offset_ns(self) -> int:
        """Ns that are added to stamps of the interface's own that do not count from 1970; 0: none, or no frame yet."""
        return self._offset or 0

    def _hidden(self, got: Received) -> bool:
        """Whether filters drop a frame, as `can.BusABC.set_filters` defines it."""
        if self._hide_fd and got.flags & _FD:
            return True
        extended = bool(got.flags & _EXTENDED)
        return bool(self._filters) and not any(
            (wants_extended is None or bool(wants_extended) == extended) and not (id_ ^ got.id) & mask
            for id_, mask, wants_extended in self._filters
        )

    def _left_out(self, why: str, ns: int) -> None:
        self.impossible += 1
        self.impossible_why = why
        self.passed_over_ns = ns

    @property
    def left_out(self) -> int:
        """Messages that were taken and not handed on: impossible or hidden."""
        return self.impossible + self.hidden

    def waiting(self) -> int | None:
        """How many frames wait to be read; None where that is unknown."""
        return self._waiting() if self._waiting else None

    @property
    def state(self) -> str:
        """The word "open" or "closed"."""
        return "closed" if self._receiver is None else "open"

    @property
    def clock(self) -> TimestampSource:
        """Which clock stamps the frames; unknown before the first one."""
        return self._receiver.clock if self._receiver else TimestampSource.UNKNOWN

    def controller(self) -> str:
        """The controller's state as the driver reports it, as in `BusStats`; "" where it does not."""
        return self._receiver.controller() if self._receiver else ""

    @property
    def drops(self) -> int:
        """Frames that the kernel dropped because they were read too late; 0 where the interface does not count them."""
        return self._lost_drops + (self._receiver.drops if self._receiver else 0)

    def shutdown(self) -> None:
        """Close; a second call does nothing."""
        if self._device is not None:
            self._device.close()
        self._close()

    def _close(self) -> None:
        receiver, self._receiver = self._receiver, None
        if receiver is not None:
            self._lost_drops += receiver.drops
            try:
                receiver.close()
            except Exception as error:
                raise BusError(f"{self.name} could not be closed: {one_line(error)}") from None

    def resumed(self) -> bool:
        """Whether the open socket receives again by itself: SocketCAN, and its device is up again.

        The socket has kept what came since then. Raises BusError while that device is down: no other one is used instead.
        """
        return self._device is not None and self._receiver is not None and self._device.resumed()

    @property
    def holds_socket(self) -> bool:
        """Whether a lost bus still has its socket: its device may only be down."""
        return self._device is not None and self._receiver is not None

    def news(self) -> list[tuple[str, str]]:
        """Changes of the device since the last call, as (what, says) of events: name, mode, bit rate.

        The first call reports a bus that may take part: one that is not known to listen only.
        """
        news_here, self._news = self._news, []
        if self._device is None:
            return news_here
        news, device = self._device.news(), self._device.device
        if news and device is not None:
            self.channel, self.name = device.name, f"{self.interface} {device.name}"
            self.bitrate = device.bitrate
            self.listen_only = listen_only.of_device(device.name, device)
        return news_here + news

    def reopen(self) -> None:
        """Receive again after the bus was lost. Raises BusError."""
        if self.resumed():
            return
        with contextlib.suppress(BusError):  # it is lost: an error at closing is not news
            self._close()
        self._offset = self._fault = None
        before = self.listen_only
        self._receiver, self.listen_only, self._waiting = self._opener()
        # `DeviceWatch` reports the changes of a SocketCAN device
        if self._device is None and self.listen_only != before:
            self._news.append(("listen_only_changed", self.listen_only.says))


def interfaces(buses: Sequence[ReceiveOnlyBus]) -> dict[str, int]:
    """The number of each open bus by its channel, as `values.bus_names` has it for logs."""
    channels = [bus.channel for bus in buses]
    return dict(zip(channels, of_open_buses(channels), strict=True))
