"""Which clock stamped: SocketCAN's hardware times where they come, the kernel's where not, and never both."""

from __future__ import annotations

import socket
import struct
from types import SimpleNamespace
from typing import Any

import pytest

from canid.io.buses.receivers import socketcan
from canid.io.buses.receivers.socketcan import SocketcanReceiver, parse
from canid.io.buses.timestamp_source import TimestampSource
from canid.values.types import Flag

SECOND = 1_000_000_000
KERNEL = 1_700_000_000 * SECOND


def stamp(ns: int) -> bytes:
    return struct.pack("=qq", *divmod(ns, SECOND))


def message(kernel: int, hardware: int | None, *, error: bool = False) -> tuple[bytes, Any, int, None]:
    """What recvmsg returns: linux/can.h, struct can_frame; linux/errqueue.h, struct scm_timestamping."""
    data = struct.pack("=IB3x8s", 0x2000_0004 if error else 0x123, 8, bytes(8))
    reported = [(socket.SOL_SOCKET, 35, stamp(kernel))]
    if hardware is not None:
        reported.append((socket.SOL_SOCKET, 37, stamp(kernel) + stamp(0) + stamp(hardware)))
    return data, reported, 0, None


class ScriptedSocket:
    """A CAN socket of a device with hardware stamps, which no test machine has: says what a script says."""

    def __init__(self, script: list[Any]):
        self._script = script
        self.options: list[Any] = []
        self._pair = socket.socketpair()

    def setsockopt(self, *words: Any) -> None:
        self.options.append(words)

    def getsockopt(self, *words: Any) -> int:
        if len(words) == 3:  # SO_MEMINFO, which kernels before 4.12 do not have
            raise OSError
        return 0

    def fileno(self) -> int:
        return self._pair[0].fileno()

    def recvmsg(self, *_: Any) -> Any:
        if not self._script:
            raise BlockingIOError
        return self._script.pop(0)

    def close(self) -> None:
        for each in self._pair:
            each.close()


def received(script: list[Any], *, hardware: bool = True) -> tuple[list[int], TimestampSource, list[Any]]:
    sock = ScriptedSocket(script)
    receiver = SocketcanReceiver(
        SimpleNamespace(shutdown=sock.close, socket=sock, channel="can0"), hardware=hardware
    )
    times = []
    while (got := receiver.recv(0.0)) is not None:
        times.append(got.ns)
    receiver.close()
    return times, receiver.clock, sock.options


def test_hardware_stamps_are_taken_where_they_come() -> None:
    """The device's clock, which counts from its own zero; the kernel was asked for both."""
    script = [message(KERNEL + i, 5 * SECOND + i) for i in range(3)]
    times, clock, options = received(script)
    assert times == [5 * SECOND + i for i in range(3)]
    assert clock is TimestampSource.HARDWARE
    # linux/net_tstamp.h: RX_HARDWARE 4, RX_SOFTWARE 8, SOFTWARE 16, RAW_HARDWARE 64
    assert (socket.SOL_SOCKET, 37, 4 | 8 | 16 | 64) in options


@pytest.mark.parametrize("hardware", [None, 0])
def test_without_them_the_kernel_stamps(hardware: int | None) -> None:
    """A vcan, or a driver that sends zeros."""
    times, clock, _ = received([message(KERNEL + i, hardware) for i in range(3)])
    assert times == [KERNEL + i for i in range(3)]
    assert clock is TimestampSource.KERNEL


def test_they_are_not_asked_for_where_several_buses_share_one_log() -> None:
    times, clock, options = received([message(KERNEL, 5 * SECOND)], hardware=False)
    assert times == [KERNEL]
    assert clock is TimestampSource.KERNEL
    assert 37 not in [words[1] for words in options]


def test_error_frames_without_a_hardware_stamp_stand_on_the_same_clock() -> None:
    """They come from the driver, not from the wire: the difference of the two clocks puts them in their place."""
    script = [message(KERNEL, 5 * SECOND), message(KERNEL + 100, None, error=True)]
    script.append(message(KERNEL + 200, 5 * SECOND + 200))
    times, clock, _ = received(script)
    assert times == [5 * SECOND, 5 * SECOND + 100, 5 * SECOND + 200]
    assert clock is TimestampSource.HARDWARE


def test_the_parsed_frame_keeps_the_kernels_and_the_hardwares_time() -> None:
    parsed = parse(*message(KERNEL, 5 * SECOND, error=True)[:3])
    assert (parsed.frame.ns, parsed.hardware) == (KERNEL, 5 * SECOND)
    assert parsed.frame.flags == Flag.ERROR
    assert socketcan.error_counters(0x204, bytes([0, 0x10, 0, 0, 0, 0, 96, 135])) == (96, 135)
