"""A CAN adapter on a serial line, played by the test: the kernel's own slcan driver is at the other end of a pty.

The driver (Linux 6.0 and later) keeps the controller's state like any other (can-dev): what the adapter says of it
comes out as error frames with counters and is shown by `ip`. The adapter's protocol: Lawicel's SLCAN (`t`, `S`, `O`,
`L`, `C`), states `s` + state + REC + TEC and errors `e` + count + kinds as in linux/drivers/net/can/slcan.
"""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import termios
import threading
import time
import tty
from collections.abc import Iterable

from tests.bus.network import ip, queued, shown

N_SLCAN = 17  # linux/tty.h
SIOCGIFNAME = 0x8910
# s for the driver to take up a line; it needs some ms
PATIENCE_S = 300.0


class Adapter:
    """The adapter and its network device, which is up and listens only once this is made."""

    def __init__(self, bitrate: int = 500_000, mode: str = "listen-only on"):
        self._wire, self._line = pty.openpty()
        tty.setraw(self._line)
        os.set_blocking(self._wire, False)
        fcntl.ioctl(self._line, termios.TIOCSETD, struct.pack("i", N_SLCAN))
        answer = fcntl.ioctl(self._line, SIOCGIFNAME, bytes(16))
        self.name = answer.split(b"\0")[0].decode()
        self.commands = b""  # what the driver sent to the adapter
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()
        ip("set", self.name, "type", "can", "bitrate", str(bitrate), *mode.split())
        ip("set", self.name, "up")

    def _read(self) -> None:
        while True:
            select.select([self._wire], [], [])
            try:
                self.commands += os.read(self._wire, 4096)
            except BlockingIOError:
                continue
            except OSError:
                return  # the other end is closed

    def frames(self, numbers: Iterable[int]) -> None:
        """Frames from the bus that carry their numbers, as in `network.counted`; ends when the driver has passed them on."""
        before, count = self._received(), 0
        for i in numbers:
            self._write(f"t{0x100 + i % 16:03X}8{i:016X}\r")
            count += 1
        end = time.monotonic() + PATIENCE_S
        while self._received() < before + count or queued():
            assert time.monotonic() < end, f"{self.name} has received {self._received() - before} of {count}"
            time.sleep(0.01)

    def _received(self) -> int:
        return int(shown(self.name)["stats64"]["rx"]["packets"])

    def state(self, letter: str, tec: int, rec: int) -> None:
        """The controller is now error active `a`, warning `w`, passive `p`, or bus-off `b`; `ip` shows it."""
        self._write(f"s{letter}{rec:03d}{tec:03d}\r")
        word = {"a": "ERROR-ACTIVE", "w": "ERROR-WARNING", "p": "ERROR-PASSIVE", "b": "BUS-OFF"}[letter]
        end = time.monotonic() + PATIENCE_S
        while self.shown_state() != word:
            assert time.monotonic() < end, f"{self.name} is {self.shown_state()}, not {word}"
            time.sleep(0.01)

    def overflow(self) -> None:
        """The controller's receive buffer overflowed."""
        self._write("e1o\r")

    def shown_state(self) -> str:
        """The state that the kernel shows."""
        return str(shown(self.name)["linkinfo"]["info_data"]["state"])

    def _write(self, line: str) -> None:
        data = line.encode()
        end = time.monotonic() + PATIENCE_S
        while data:
            try:
                data = data[os.write(self._wire, data) :]
            except BlockingIOError:
                # 64 kB wait for the driver, which wakes no writer when it has taken them: a write that waits would do so
                # for ever
                assert time.monotonic() < end, f"{self.name} takes nothing"
                time.sleep(0.01)

    def close(self) -> None:
        """Unplug: the kernel removes the device. What the driver has not taken by then is lost on the line."""
        os.close(self._line)
        self._reading.join(PATIENCE_S)
        os.close(self._wire)
