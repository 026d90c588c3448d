"""Numbered frames at a rate over udp_multicast, and when each of them was sent."""

from __future__ import annotations

import os
import threading
import time
from bisect import bisect_right
from typing import Any

from canid.frames import python_can

# A group for each process that tries something out: two may run at a time. Hop limit 0: no packet leaves the machine.
_PID = os.getpid()
GROUP = f"239.75.{_PID // 254 % 254 + 1}.{_PID % 254 + 1}"
BUS = {"interface": "udp_multicast", "channel": GROUP, "hop_limit": 0}
WORDS = ("-i", "udp_multicast", "-c", GROUP, "--bus-kwargs", "hop_limit=0")
# s between two handfuls: some 1 kHz, as gateways do
PAUSE = 0.001


class Traffic:
    """A thread that sends frame 0, 1, 2, ... at `rate` frames/s; `sent[i]` is the wall clock before frame i left."""

    def __init__(self, rate: float, total: int = -1):
        """`total`: frames, then it ends by itself; rate inf: as fast as the bus takes them."""
        self._rate = rate
        self._total = total
        self.sent: list[float] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> Traffic:
        """Begin."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """End, and wait for it."""
        self._stopping.set()
        self._thread.join()

    def join(self) -> None:
        """Wait until all are sent."""
        self._thread.join()

    def wait(self, seconds: float) -> None:
        """Wait until so many s after the first frame."""
        while not self.sent:
            time.sleep(PAUSE)
        time.sleep(max(self.sent[0] + seconds - time.time(), 0.0))

    def before(self, moment: float) -> int:
        """How many frames were sent before this moment (wall clock)."""
        return bisect_right(self.sent, moment)

    def _run(self) -> None:
        can = python_can.load()
        bus: Any = can.Bus(**BUS)
        began = time.monotonic()
        try:
            while not self._stopping.is_set() and len(self.sent) != self._total:
                due = (
                    (time.monotonic() - began) * self._rate
                    if self._rate < float("inf")
                    else len(self.sent) + 50
                )
                while len(self.sent) < due and len(self.sent) != self._total:
                    i = len(self.sent)
                    message = can.Message(arbitration_id=i % 2048, data=number(i), is_extended_id=False)
                    self.sent.append(time.time())
                    bus.send(message)
                time.sleep(PAUSE)
        finally:
            bus.shutdown()


def number(i: int) -> bytes:
    """The payload of frame i: its number, and bytes that compress no better than a car's.

    >>> int.from_bytes(number(70000)[:4], "big")
    70000
    """
    return i.to_bytes(4, "big") + (i * 2654435761 & 0xFFFFFFFF).to_bytes(4, "big")
