"""Receiving from SocketCAN: kernel time stamps in whole ns, the kernel's count of drops, a large buffer.

python-can opens and configures the socket (`SocketcanBus.socket`); its own receive loop rounds the time to a
float and never queries drops. Structures and numbers from linux/can.h, linux/can/error.h and
asm-generic/socket.h.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import threading
from struct import Struct
from typing import Any, NamedTuple

from canid.io.buses.device_watch import DeviceWatch
from canid.io.buses.receivers.device_drops import DeviceDrops
from canid.io.buses.receivers.received_frame import Received
from canid.io.buses.socket_wait import SocketWait
from canid.io.buses.timestamp_source import TimestampSource
from canid.values.errors import BusError
from canid.values.types import Flag

# id, length (of a classic frame with raw DLC the data have 8 bytes), flags, two bytes unused; the data follow
_FRAME_HEADER = Struct("=IBB2x")
CAN_MTU, CANFD_MTU = 16, 72
EFF, RTR, ERR = 0x8000_0000, 0x4000_0000, 0x2000_0000
BRS, ESI = 1, 2

# asm-generic/socket.h; Python's socket module has none of them
SO_RXQ_OVFL, SO_RCVBUFFORCE = 40, 33
SO_TIMESTAMPNS, SO_TIMESTAMPNS_NEW = 35, 64
# since Linux 4.12; linux/sock_diag.h: SK_MEMINFO_DROPS is the ninth of its numbers
SO_MEMINFO, _MEMINFO = 55, Struct("=32x I")
_TIMESPEC_64, _TIMESPEC_32 = Struct("=qq"), Struct("=ll")
_COUNT = Struct("=I")
# linux/net_tstamp.h; the message holds three times: software, one that is not used any more, raw hardware
SO_TIMESTAMPING, SO_TIMESTAMPING_NEW = 37, 65
_RX_HARDWARE, _RX_SOFTWARE, _SOFTWARE, _RAW_HARDWARE = 1 << 2, 1 << 3, 1 << 4, 1 << 6
ANCILLARY_BYTES = (
    socket.CMSG_SPACE(_TIMESPEC_64.size)
    + socket.CMSG_SPACE(3 * _TIMESPEC_64.size)
    + socket.CMSG_SPACE(_COUNT.size)
)

# 2 s of a full 1 Mbit/s bus (8,000 frames/s), each some 900 bytes of kernel memory, and as much again.
RECEIVE_BUFFER_BYTES = 32 * 1024 * 1024

# linux/can/error.h: classes in the id of an error frame, details in data[1], counters in data[6] and data[7]
_ERROR_FLAG = int(Flag.ERROR)
_ERROR_CONTROLLER, _ERROR_BUS_OFF, _ERROR_RESTARTED, _ERROR_COUNTERS = 0x04, 0x40, 0x100, 0x200
_RX_OVERFLOW = 0x01
# receiver's and transmitter's bit of each state, the gravest first: a frame may hold several
_CONTROLLER = {0x30: "error_passive", 0x0C: "error_warning", 0x40: "error_active"}


# reports of a lost device, of which none says that nothing waits: more come from a socket that is broken alone
_MOST_REPORTS = 8


class Parsed(NamedTuple):
    """A message of the socket: the frame, stamped by the kernel, and its ancillary data."""

    frame: Received
    drops: int | None  # the kernel's count
    hardware: int = 0  # ns of the device's own clock; 0: not given


def parse(data: bytes, ancillary: list[tuple[int, int, bytes]], message_flags: int) -> Parsed:
    """One result of `recvmsg` as a frame. Raises ValueError where it is none.

    >>> data = _FRAME_HEADER.pack(0x123, 2, 0) + b"ab" + bytes(6)
    >>> stamp = (socket.SOL_SOCKET, SO_TIMESTAMPNS, _TIMESPEC_64.pack(1_600_000_000, 5))
    >>> parse(data, [stamp], 0).frame
    Received(ns=1600000000000000005, id=291, data=b'ab', flags=0, length=-1)
    """
    if len(data) not in (CAN_MTU, CANFD_MTU):
        raise ValueError(f"{len(data)} bytes are no CAN frame")
    word, length, bits = _FRAME_HEADER.unpack_from(data)
    ns, hardware, drops = 0, 0, None
    for level, kind, value in ancillary:
        if level != socket.SOL_SOCKET:
            continue
        if kind in (SO_TIMESTAMPNS, SO_TIMESTAMPNS_NEW):
            ns = timespec_ns(value)
        elif kind in (SO_TIMESTAMPING, SO_TIMESTAMPING_NEW):
            hardware = timespec_ns(value[2 * len(value) // 3 :])
        elif kind == SO_RXQ_OVFL:
            (drops,) = _COUNT.unpack_from(value)
    payload = data[_FRAME_HEADER.size : _FRAME_HEADER.size + length]
    asked = -1
    # the kernel marks frames that this machine sent
    flags = int(Flag.TX) if message_flags & socket.MSG_DONTROUTE else 0
    if word & ERR:
        return Parsed(Received(ns, word & 0x1FFF_FFFF, payload, flags | int(Flag.ERROR)), drops, hardware)
    if len(data) == CANFD_MTU:
        flags |= int(Flag.FD)
        flags |= int(Flag.BRS) if bits & BRS else 0
        flags |= int(Flag.ESI) if bits & ESI else 0
    if word & RTR:
        flags |= int(Flag.REMOTE)
        payload, asked = b"", length
    if word & EFF:
        extended = flags | int(Flag.EXTENDED)
        return Parsed(Received(ns, word & 0x1FFF_FFFF, payload, extended, asked), drops, hardware)
    return Parsed(Received(ns, word & 0x7FF, payload, flags, asked), drops, hardware)


def timespec_ns(value: bytes) -> int:
    """Ns of a struct timespec, of 64 or 32 bits."""
    timespec = _TIMESPEC_64 if len(value) >= _TIMESPEC_64.size else _TIMESPEC_32
    seconds, rest = timespec.unpack_from(value)
    return int(seconds) * 1_000_000_000 + int(rest)


def meaning(error_id: int, data: bytes) -> str | None:
    """The controller's state that an error frame announces (linux/can/error.h), None where it announces none.

    >>> meaning(0x40, bytes(8)), meaning(0x04, bytes([0, 0x20])), meaning(0x08, bytes(8))
    ('bus_off', 'error_passive', None)
    """
    if error_id & _ERROR_BUS_OFF:
        return "bus_off"
    if error_id & _ERROR_RESTARTED:
        return "error_active"
    if error_id & _ERROR_CONTROLLER and len(data) > 1:
        return next((name for bit, name in _CONTROLLER.items() if data[1] & bit), None)
    return None


def overflowed(error_id: int, data: bytes) -> bool:
    """Whether an error frame says that the controller's receive buffer overflowed: it has lost frames.

    >>> overflowed(0x04, bytes([0, 0x01])), overflowed(0x04, bytes([0, 0x20]))
    (True, False)
    """
    return bool(error_id & _ERROR_CONTROLLER and len(data) > 1 and data[1] & _RX_OVERFLOW)


def error_counters(error_id: int, data: bytes) -> tuple[int, int] | None:
    """The controller's transmit and receive error counters (TEC, REC), None where an error frame does not hold them.

    Drivers before Linux 6.0 do not mark them; there a controller's frame with counters other than 0 is accepted.

    >>> error_counters(0x200, bytes(6) + bytes([128, 96])), error_counters(0x08, bytes(8))
    ((128, 96), None)
    """
    if len(data) < 8:
        return None
    value = error_id & _ERROR_COUNTERS or (error_id & _ERROR_CONTROLLER and (data[6] or data[7]))
    return (data[6], data[7]) if value else None


class SocketcanReceiver:
    """Receives from the socket of python-can's SocketcanBus.

    `hardware`: stamp with the device's clock where it gives one. Whether it does shows at the first frame; frames
    without such a stamp (error frames) are then shifted to the same clock by the difference of the two.
    """

    def __init__(self, bus: Any, *, hardware: bool = False, device: DeviceWatch | None = None):
        self._close = bus.shutdown
        self._socket: socket.socket = bus.socket
        self._channel = str(bus.channel)
        self._device = device
        self.clock = TimestampSource.UNKNOWN
        self._hardware = hardware
        self._ahead = 0  # ns, the device's clock before the kernel's
        self._drops = self._before_socket = 0
        self._drops_seen = 0  # the kernel's own count, of 32 bits
        self._counting = threading.Lock()  # any thread may query
        self._fault: BusError | None = None
        self._reports = 0  # of the device's loss, since nothing waited
        self._meminfo = dropped(self._socket) is not None
        configure(self._socket, ask_for_drops=not self._meminfo)
        if hardware:
            ask_for_hardware_stamps(self._socket)
        # binding to a device that is down succeeds; SO_ERROR holds the error
        code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            self._close()
            up = f"sudo ip link set {self._channel} up"
            raise BusError(f"{self._name}: {os.strerror(code)}; bring it up: {up} (type can bitrate 500000)")
        if device is not None:
            device.opened(self._channel)
        self._device_drops = DeviceDrops(self._device_name)
        self._wait = SocketWait(self._socket)

    @property
    def _name(self) -> str:
        return f"socketcan {self._device_name}"

    @property
    def _device_name(self) -> str:
        return self._device.name if self._device else self._channel

    @property
    def drops(self) -> int:
        """Frames that the kernel dropped at this socket, and before it, until now; of a closed one: until the last query."""
        with self._counting:
            if self._meminfo:
                self._count(dropped(self._socket))
            if self._socket.fileno() >= 0:
                self._before_socket = self._device_drops.count(self._device_name)
            return self._drops + self._before_socket

    def _count(self, kernel: int | None) -> None:
        if kernel is not None:
            self._drops += increase(self._drops_seen, kernel)
            self._drops_seen = kernel

    def recv(self, timeout: float) -> Received | None:
        """Wait up to `timeout` s; raises BusError where the device is down or gone."""
        return self._wait.receive(timeout, self._read, empty=self._is_empty, lost=self._is_lost)

    def _read(self) -> Received:
        while True:
            data, ancillary, flags, _ = self._socket.recvmsg(CANFD_MTU, ANCILLARY_BYTES, socket.MSG_DONTWAIT)
            try:
                parsed = parse(data, ancillary, flags)
            except ValueError:
                continue  # CAN XL: not supported
            if not self._meminfo:
                self._count(parsed.drops)
            frame = parsed.frame
            if frame.flags & _ERROR_FLAG and self._device is not None:
                state = meaning(frame.id, frame.data)
                if state:
                    self._device.error_frame(state)
            if self.clock is not TimestampSource.KERNEL:
                return self._stamped(parsed)
            return frame

    def _is_empty(self) -> None:
        """Nothing waits; raises BusError where the device was found to be down before what waited was read."""
        fault, self._fault, self._reports = self._fault, None, 0
        if fault is not None:
            raise fault from None
        if self._device is not None:
            self._device.drained()

    def _is_lost(self, error: OSError) -> None:
        """The device is down or gone. The kernel reports this before the frames that it still holds: these come first.

        A device that is removed is reported twice, down and gone: the second time perhaps before its frames were read. A
        socket that does nothing but report has no frames: raises BusError.
        """
        fault = BusError(f"{self._name} is lost ({error.strerror}): is the device up and plugged in?")
        if error.errno != errno.ENETDOWN and self._device is not None:
            self._device.unbound()
        self._reports += 1
        if self._reports >= _MOST_REPORTS:
            self._fault, self._reports = None, 0
            raise fault from None
        self._fault = fault

    def controller(self) -> str:
        """The controller's state where the device reports it and error frames do not; see `DeviceWatch.controller`."""
        return self._device.controller() if self._device else ""

    def _stamped(self, parsed: Parsed) -> Received:
        """Choose the clock at the first frame that is no error frame, for all that follow."""
        frame, hardware = parsed.frame, parsed.hardware if self._hardware else 0
        if hardware:
            self._ahead = hardware - frame.ns
        if self.clock is TimestampSource.UNKNOWN and not frame.flags & Flag.ERROR:
            self.clock = TimestampSource.HARDWARE if hardware else TimestampSource.KERNEL
        return frame._replace(ns=hardware or frame.ns + self._ahead)

    def close(self) -> None:
        """Close the socket."""
        self._close()


def ask_for_hardware_stamps(sock: socket.socket) -> None:
    """Request the device's stamps in addition to the kernel's; vcan and many devices have none."""
    wanted = _RX_HARDWARE | _RX_SOFTWARE | _SOFTWARE | _RAW_HARDWARE
    with contextlib.suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, wanted)


def dropped(sock: socket.socket) -> int | None:
    """The kernel's count of what it dropped at a socket, of 32 bits, exact at any time (SO_MEMINFO).

    SO_RXQ_OVFL gives it with the next frame only, as of when that frame was queued: drops after the last frame are
    never counted. None: this kernel does not have it (before Linux 4.12), or the socket is closed.

    >>> with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
    ...     dropped(sock)
    0
    """
    try:
        value = sock.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, _MEMINFO.size)
    except OSError:
        return None
    return int(_MEMINFO.unpack(value)[0]) if len(value) == _MEMINFO.size else None


def increase(before: int, after: int) -> int:
    """By how much a counter of 32 bits has grown, which wraps round.

    >>> increase(5, 12), increase(0xFFFF_FFFE, 3)
    (7, 5)
    """
    return (after - before) & 0xFFFF_FFFF


def configure(sock: socket.socket, *, ask_for_drops: bool = True) -> None:
    """Request the drop count with each frame and a large buffer; what the system refuses is left as it is."""
    if ask_for_drops:
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
    try:
        sock.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER_BYTES)  # needs CAP_NET_ADMIN
    except OSError:
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
