"""SocketCAN's frames as columns, many with one system call."""

from __future__ import annotations

import socket
import time
from typing import Any

import numpy as np
import numpy.typing as npt

from canid.io.buses.device_watch import DeviceWatch
from canid.io.buses.receivers.many_messages import ManyMessages, Pace
from canid.io.buses.receivers.received_columns import Many, ReceivedColumns, select
from canid.io.buses.receivers.socketcan import (
    ANCILLARY_BYTES,
    BRS,
    CAN_MTU,
    CANFD_MTU,
    EFF,
    ERR,
    ESI,
    RTR,
    SocketcanReceiver,
    meaning,
)
from canid.io.buses.timestamp_source import TimestampSource
from canid.values.frame_columns import CLASSIC_BYTES, FD_BYTES
from canid.values.types import Flag

# frames of one call: 50 ms of a full 1 Mbit/s bus, and of what waits in the kernel at once 0.2 MB
MOST = 1024
_HEADER_BYTES = CAN_MTU - CLASSIC_BYTES
_EFF_MASK, _SFF_MASK = 0x1FFF_FFFF, 0x7FF
# bits of the flags in a message (BRS, ESI) as those of `Flag`
_FD_FLAGS = np.array(
    [Flag.FD | (Flag.BRS if bits & BRS else 0) | (Flag.ESI if bits & ESI else 0) for bits in range(256)],
    np.uint8,
)


def parse_many(
    octets: npt.NDArray[np.uint8],
    lengths: npt.NDArray[Any],
    message_flags: npt.NDArray[Any],
    ns: npt.NDArray[np.int64],
) -> ReceivedColumns:
    """Messages of the socket as columns, as `socketcan.parse` has them one by one.

    Args:
        octets: (n, 72) messages.
        lengths: (n,) bytes of each, 16 or 72.
        message_flags: (n,) of recvmmsg.
        ns: (n,) when each was received.
    """
    word = np.ascontiguousarray(octets[:, :4]).view(np.uint32).reshape(len(octets))
    error, remote, extended = (word & ERR) != 0, (word & RTR) != 0, (word & EFF) != 0
    fd = lengths == CANFD_MTU
    room = np.where(fd, FD_BYTES, CLASSIC_BYTES)
    remote &= ~error
    length = np.where(remote, octets[:, 4], np.minimum(octets[:, 4], room)).astype(np.uint8)
    flags = np.where(fd, _FD_FLAGS[octets[:, 5]], np.uint8(0))
    flags[remote] |= int(Flag.REMOTE)
    flags[extended] |= int(Flag.EXTENDED)
    flags[error] = int(Flag.ERROR)
    # the kernel marks frames that this machine sent
    flags[(message_flags & socket.MSG_DONTROUTE) != 0] |= int(Flag.TX)
    shown = np.where(remote, 0, length)
    width = FD_BYTES if len(shown) and shown.max() > CLASSIC_BYTES else CLASSIC_BYTES
    data = octets[:, _HEADER_BYTES : _HEADER_BYTES + width] * (np.arange(width) < shown[:, None])
    id_ = word & np.where(error | extended, np.uint32(_EFF_MASK), np.uint32(_SFF_MASK))
    return ReceivedColumns(ns, id_, flags, length, data)


class SocketcanColumnsReceiver(SocketcanReceiver):
    """`SocketcanReceiver` that takes many frames with one call."""

    def __init__(self, bus: Any, *, hardware: bool = False, device: DeviceWatch | None = None):
        """As `SocketcanReceiver`."""
        super().__init__(bus, hardware=hardware, device=device)
        self._messages = ManyMessages(self._socket, most=MOST, octets=CANFD_MTU, ancillary=ANCILLARY_BYTES)
        self._pace = Pace(self._socket)

    def recv_many(self, timeout: float, gather: float) -> Many | None:
        """Wait up to `timeout` s, and up to `gather` s for those that follow; raises BusError where the device is down."""
        end = time.monotonic() + timeout
        if timeout:
            self._pace.wait(gather)
        left = max(end - time.monotonic(), 0.0)
        return self._wait.receive(left, self._read_many, empty=self._is_empty, lost=self._is_lost)

    def _read_many(self) -> Many:
        while True:
            count = self._messages.receive()
            self._pace.received(full=count == self._messages.most)
            frames = self._frames(count)
            if len(frames.ns):
                return Many(frames)

    def _frames(self, count: int) -> ReceivedColumns:
        messages = self._messages
        stamps = messages.stamps(count)
        if not self._meminfo:
            self._count(stamps.drops)
        lengths = messages.lengths[:count]
        frames = parse_many(messages.octets[:count], lengths, messages.flags[:count], stamps.ns)
        if self.clock is not TimestampSource.KERNEL:
            frames = frames._replace(ns=self._chosen_stamps(frames, stamps.hardware))
        known = (lengths == CAN_MTU) | (lengths == CANFD_MTU)
        if not known.all():  # CAN XL: not supported
            frames = select(frames, known)
        if self._device is not None:
            for row in np.flatnonzero(frames.flags & int(Flag.ERROR)).tolist():
                state = meaning(int(frames.id[row]), frames.data[row, : frames.length[row]].tobytes())
                if state:
                    self._device.error_frame(state)
        return frames

    def _chosen_stamps(
        self, frames: ReceivedColumns, given: npt.NDArray[np.int64] | None
    ) -> npt.NDArray[np.int64]:
        """Choose the clock at the first frame that is no error frame, for all that follow; as `_stamped`."""
        n = len(frames.ns)
        hardware = given if given is not None and self._hardware else np.zeros(n, np.int64)
        ordinary = np.flatnonzero((frames.flags & int(Flag.ERROR)) == 0)
        kernel_from = n
        if self.clock is TimestampSource.UNKNOWN and ordinary.size:
            first = int(ordinary[0])
            self.clock = TimestampSource.HARDWARE if hardware[first] else TimestampSource.KERNEL
            if self.clock is TimestampSource.KERNEL:
                kernel_from = first + 1
        # the device's clock before the kernel's, as of the latest frame that has both
        latest = np.maximum.accumulate(np.where(hardware[:kernel_from] != 0, np.arange(kernel_from), -1))
        ahead = np.where(latest >= 0, (hardware - frames.ns)[latest], self._ahead)
        if kernel_from:
            self._ahead = int(ahead[-1])
        ns = frames.ns.copy()
        ns[:kernel_from] = np.where(
            hardware[:kernel_from] != 0, hardware[:kernel_from], ns[:kernel_from] + ahead
        )
        return ns
