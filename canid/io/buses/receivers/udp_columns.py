"""python-can's udp_multicast frames as columns, many datagrams with one system call."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from canid.io.buses.receivers.datagram_layouts import DatagramReader
from canid.io.buses.receivers.many_messages import ManyMessages, Pace
from canid.io.buses.receivers.received_columns import Many
from canid.io.buses.receivers.udp_multicast import ANCILLARY_BYTES, MAX_DATAGRAM_BYTES, UdpReceiver
from canid.io.buses.timestamp_source import TimestampSource

# datagrams of one call: 60 ms of a full 1 Mbit/s bus
MOST = 512
# bytes of a datagram side by side: a CAN FD frame with all its field names has 250, and what is longer is rare
_NEAR_BYTES = 256


class UdpColumnsReceiver(UdpReceiver):
    """`UdpReceiver` that takes many datagrams with one call."""

    def __init__(self, bus: Any, name: str, count: Callable[[], int]):
        """As `UdpReceiver`."""
        super().__init__(bus, name, count)
        self._messages = ManyMessages(
            self._socket,
            most=MOST,
            octets=_NEAR_BYTES,
            more=MAX_DATAGRAM_BYTES - _NEAR_BYTES,
            ancillary=ANCILLARY_BYTES,
        )
        self._pace = Pace(self._socket)
        self._reader = DatagramReader(self._unpack, MOST)

    def recv_many(self, timeout: float, gather: float) -> Many | None:
        """Wait up to `timeout` s, and up to `gather` s for those that follow; raises BusError where the socket fails."""
        end = time.monotonic() + timeout
        # where the kernel stamps none, they are stamped when they are read: at once
        if timeout and self.clock is TimestampSource.KERNEL:
            self._pace.wait(gather)
        return self._wait.receive(max(end - time.monotonic(), 0.0), self._read_many, lost=self._is_lost)

    def _read_many(self) -> Many:
        try:
            count = self._messages.receive()
        except ValueError as error:
            self._is_lost(error)
        self._pace.received(full=count == self._messages.most)
        ns = self._messages.stamps(count).ns
        if not ns.all():
            self.clock = TimestampSource.HOST
            ns = np.where(ns, ns, time.time_ns())
        octets, lengths = self._messages.octets[:count], self._messages.lengths[:count]
        return self._reader.read(octets, lengths, ns, self._datagram)

    def _datagram(self, row: int) -> bytes:
        messages = self._messages
        length = int(messages.lengths[row])
        near = messages.octets[row, :length].tobytes()
        return near + messages.more[row, : max(length - _NEAR_BYTES, 0)].tobytes()
