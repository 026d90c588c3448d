"""Frames on their way from the threads that read the buses to the one that passes them on: bounded, and counted beyond.

That thread waits for nobody. Only a consumer in Python that hangs, or a machine without a free processor, makes frames wait
here; what came beyond the bound is dropped, for memory that ends would end the recording.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from queue import SimpleQueue
from typing import NamedTuple

from canid.io.buses.bus_reader import Arrival

# a minute of a full 1 Mbit/s bus (8,000 frames/s): as many as may wait for the disk
MAX_WAITING_FRAMES = 480_000


class Dropped(NamedTuple):
    """Frames of one bus that were not taken."""

    bus: int
    frames: int
    first_ns: int
    last_ns: int


class Arrivals:
    """The queue; any thread may put."""

    def __init__(self) -> None:
        self._queue: SimpleQueue[Arrival | None] = SimpleQueue()
        self._lock = threading.Lock()
        self._put = 0  # frames, by the readers
        self._got = 0  # frames, by the thread that passes on
        self.dropped = 0  # frames
        self._dropped: list[Dropped] = []

    @property
    def waiting(self) -> int:
        """Frames that were put and not got yet."""
        return self._put - self._got

    def put(self, arrival: Arrival) -> None:
        """Queue frames, or drop them all where too many wait; never waits."""
        n = len(arrival.frames.ns)
        with self._lock:
            if n and self.waiting + n > MAX_WAITING_FRAMES:
                self._drop(arrival, n)
                return
            self._put += n
        self._queue.put(arrival)

    def end(self) -> None:
        """Nothing follows."""
        self._queue.put(None)

    def get(self, timeout: float) -> Arrival | None:
        """The next one; None: the end, also of later calls. Raises queue.Empty."""
        arrival = self._queue.get(timeout=timeout) if timeout else self._queue.get_nowait()
        if arrival is None:
            self._queue.put(None)
        else:
            self._got += len(arrival.frames.ns)
        return arrival

    def dropped_since_the_last_call(self) -> Sequence[Dropped]:
        """What was dropped, one entry for each bus."""
        with self._lock:
            dropped, self._dropped = self._dropped, []
        return dropped

    def _drop(self, arrival: Arrival, n: int) -> None:
        self.dropped += n
        first, last = int(arrival.frames.ns[0]), int(arrival.frames.ns[-1])
        for k, before in enumerate(self._dropped):
            if before.bus == arrival.bus:
                self._dropped[k] = Dropped(before.bus, before.frames + n, before.first_ns, last)
                return
        self._dropped.append(Dropped(arrival.bus, n, first, last))
