"""The sender process as an object: its bus, what it has sent and when."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import time
from array import array
from bisect import bisect_left, bisect_right
from itertools import count
from pathlib import Path

from tests.fixtures.traffic import GROUP

SCRIPT = Path(__file__).with_name("sender.py")
# A port of its own for each sender: python-can's receivers get every group's datagrams of their port.
_PORTS = count(20_000 + os.getpid() * 64 % 40_000)


class Sender:
    """A process that sends frame 0, 1, 2, ...; `end` returns the wall clock before each of them."""

    def __init__(self, folder: Path, rate: float, *, total: int = -1, seed: object = 0, strange: float = 0.0):
        """Name its bus. `total`: frames, -1: until `end`; `strange`: other datagrams per frame."""
        self.port = next(_PORTS)
        self.foreign = 0
        self._begun = 0.0
        self.sent: list[float] = []
        self._path = folder / f"sent.{self.port}"
        self._words = [GROUP, self.port, rate, total, self._path, seed, strange]
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """Arguments of a verb that listens."""
        return ("-i", "udp_multicast", "-c", GROUP, "--bus-kwargs", "hop_limit=0", f"port={self.port}")

    def start(self) -> Sender:
        """Start it, and wait for its first frame."""
        # -P: the script's own folder is no place for modules
        command = [sys.executable, "-P", str(SCRIPT), *map(str, self._words)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )
        assert self._process.stdout is not None
        if self._process.stdout.readline() != b"begun\n":
            raise RuntimeError("the sender did not begin")
        self._begun = time.time()
        return self

    def end(self, *, wait: bool = False) -> Sender:
        """End it, and read when each frame was sent. `wait`: until `total` frames are sent."""
        process = self._process
        if process is None:
            return self
        self._process = None
        assert process.stdin is not None
        assert process.stdout is not None
        if wait:
            process.wait(600.0)
        process.stdin.close()
        process.wait(60.0)
        process.stdout.close()
        data = self._path.read_bytes()
        (self.foreign,) = struct.unpack_from("<q", data)
        self.sent = list(array("d", data[8:]))
        return self

    def wait(self, seconds: float, *, since_now: bool = False) -> None:
        """Wait until so many s after the first frame; `since_now`: from now."""
        time.sleep(max((time.time() if since_now else self._begun) + seconds - time.time(), 0.0))

    def before(self, instant: float) -> int:
        """How many frames were sent before this instant (wall clock)."""
        return bisect_left(self.sent, instant)

    def first_after(self, instant: float) -> int:
        """Number of the first frame that was sent after this instant."""
        return bisect_right(self.sent, instant)

    def __enter__(self) -> Sender:
        return self.start()

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None
