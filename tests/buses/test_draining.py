"""The end of reading on interfaces in this process: what waits at the stop is taken, and a bus that goes on is left."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from canid.io.buses import python_can
from canid.io.buses.bus_opener import open_bus
from canid.io.buses.bus_reader import Arrival, BusReader
from canid.io.buses.draining import MAX_UNKNOWN_S, Stop
from canid.io.buses.receivers.received_columns import frames_of
from canid.io.buses.receivers.received_frame import Received
from canid.io.buses.timestamp_source import TimestampSource
from tests.fixtures.back_end import registered

# s; reading ends about a second after the stop
PATIENCE = 300.0


def stop_at_once(bus: Any) -> tuple[list[Arrival], list[tuple[str, str]]]:
    """Read a bus that was stopped before its first frame was read."""
    got: list[Arrival] = []
    events: list[tuple[str, str]] = []
    stopping = threading.Event()
    stopping.set()
    BusReader(bus, 0, got.append, stopping, lambda what, says: events.append((what, says))).run()
    return got, events


def frames_in(got: list[Arrival]) -> list[Received]:
    return [frame for each in got for frame in frames_of(each.frames)]


@pytest.mark.slow("many messages through real sockets")
@pytest.mark.parametrize("filtered", [False, True])
def test_virtual_hands_over_what_its_queue_held(request: pytest.FixtureRequest, filtered: bool) -> None:
    """280,000 frames wait, a thread goes on sending: exactly those, or those of them that a filter lets through."""
    can = python_can.load()
    name = request.node.name
    filters = [{"can_id": 0x0, "can_mask": 0x1}] if filtered else None
    bus = open_bus({"interface": "virtual", "channel": name, "can_filters": filters})
    (queue,) = can.interfaces.virtual.channels[name]
    for i in range(280_000):
        queue.put(can.Message(1_790_000_000 + i * 1e-4, i % 2048, False, data=i.to_bytes(4, "big")))
    going = threading.Event()

    def go_on() -> None:
        message = can.Message(1_790_000_100, 0x7FE, False, data=b"late")
        while not going.wait(0.0001):
            queue.put(message)

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        got, events = stop_at_once(bus)
    finally:
        going.set()
        thread.join()
    frames = frames_in(got)
    numbers = [int.from_bytes(frame.data, "big") for frame in frames if frame.data != b"late"]
    assert numbers == list(range(0, 280_000, 2 if filtered else 1))
    # those that were put between the burst and the stop
    assert len(frames) - len(numbers) < 10_000
    assert [what for what, _ in events] == []
    bus.shutdown()


@pytest.fixture
def endless() -> Iterator[Any]:
    """A plug-in whose frames never end: first some that waited, then new ones as fast as they are read."""
    can = python_can.load()

    class EndlessBus(can.BusABC):  # type: ignore[misc, name-defined]
        waiting = 5_000

        def __init__(self, channel: str = "", **more: Any):
            self.channel_info, self.count = "endless", 0
            super().__init__(channel, **more)

        def _recv_internal(self, timeout: float | None) -> tuple[Any, bool]:
            self.count += 1
            stamp = 1_790_000_000.0 if self.count <= self.waiting else time.time()
            return can.Message(stamp, 1, False, data=self.count.to_bytes(4, "big")), True

        def send(self, msg: Any, timeout: float | None = None) -> None:
            raise AssertionError("sent")

    with registered("endless", EndlessBus):
        yield EndlessBus


def test_an_unknown_interface_ends_after_a_second(endless: Any) -> None:
    """What waited is taken, then about a second of the rest, and the log says that more was left."""
    bus = open_bus({"interface": "endless", "channel": "x"})
    began = time.monotonic()
    got, events = stop_at_once(bus)
    took = time.monotonic() - began
    frames = frames_in(got)
    assert [int.from_bytes(frame.data, "big") for frame in frames] == list(range(1, len(frames) + 1))
    assert len(frames) > endless.waiting
    assert MAX_UNKNOWN_S <= took < PATIENCE
    assert [what for what, _ in events if what != "listen_only"] == ["left_unread"]
    bus.shutdown()


def fake(interface: str, clock: TimestampSource) -> Any:
    return SimpleNamespace(interface=interface, clock=clock)


def is_before(stop: Stop, ns: int) -> bool | None:
    """Whether a frame with this stamp was received before the stop; None: unknown."""
    first, unknown = stop.first_after(np.array([ns]))
    return None if unknown else first == 1


def test_the_hosts_clock_tells_what_came_before_the_stop() -> None:
    """Kernel stamps: before, after; one that this clock cannot have made shows nothing."""
    for interface in ("socketcan", "udp_multicast"):
        stop = Stop(fake(interface, TimestampSource.KERNEL), None)
        assert is_before(stop, stop.at_ns - 10**9) is True
        assert is_before(stop, stop.at_ns + 1) is False
        assert is_before(stop, stop.at_ns + 3600 * 10**9) is None
        assert is_before(stop, 0) is None
    assert is_before(Stop(fake("udp_multicast", TimestampSource.HOST), 0.0), time.time_ns()) is None


def test_a_devices_clock_tells_by_its_largest_lead() -> None:
    """A device a week ahead, whose quickest frame so far arrived at once: only what is certainly later ends reading."""
    lead = 7 * 86400e9
    for interface, clock in (("kvaser", TimestampSource.DRIVER), ("socketcan", TimestampSource.HARDWARE)):
        stop = Stop(fake(interface, clock), lead)
        time.sleep(0.4)
        at = stop.at * 1e9 + lead
        assert is_before(stop, int(at - 1e9)) is True
        assert is_before(stop, int(at + 0.05e9)) is True  # may have been received before
        assert is_before(stop, int(at + 0.3e9)) is False
        assert is_before(stop, int(at + 3600e9)) is None  # its clock was set
    # stamps made when a frame is read, or by a sender, show nothing
    for interface, clock in (
        ("slcan", TimestampSource.DRIVER),
        ("endless", TimestampSource.DRIVER),
        ("kvaser", TimestampSource.HOST),
        ("virtual", TimestampSource.SENDER),
    ):
        assert is_before(Stop(fake(interface, clock), lead), time.time_ns()) is None
    assert is_before(Stop(fake("kvaser", TimestampSource.DRIVER), None), time.time_ns()) is None
