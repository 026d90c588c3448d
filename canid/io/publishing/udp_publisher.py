"""The thread of --publish: takes items from a bounded queue and sends them, whatever becomes of them.

Who puts items in never waits: what has no room is dropped and counted. The socket does not block; a host that is
unreachable or refuses costs nothing but its datagrams.
"""

from __future__ import annotations

import socket
import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from canid.io.publishing import datagrams, udp_address
from canid.io.publishing.datagrams import Item
from canid.io.publishing.udp_address import Destination

# items that may wait: 10 samples and 4 estimates a second come live, so this is ten minutes of a name server that
# does not answer; of a replay at full speed, ten minutes of the log
MAX_WAITING_ITEMS = 10_000
# s that the end waits for what is still in the queue
CLOSE_TIMEOUT_S = 0.3


class UdpPublisher:
    """An observer of a session or a replay (`ui.cli.output.display.Observer`)."""

    def __init__(
        self,
        destination: Destination,
        report: Callable[[str], object] = lambda says: None,
        start_ns: int | None = None,
    ) -> None:
        """Begin to publish.

        Args:
            destination: from `udp_address.parse`.
            report: takes a sentence where nothing can be sent; from the publishing thread.
            start_ns: epoch ns of session time 0; None: comes with `status`.
        """
        self.sent = self.dropped = self.failed = (
            0  # datagrams; items without room; datagrams that were refused
        )
        self._destination = destination
        self._report = report
        self._start_ns = start_ns
        self._t = 0.0  # s, of the newest item
        self._queue: deque[tuple[float, int, Item | dict[str, Any]]] = deque()
        self._wake = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="canid-publish", daemon=True)
        self._thread.start()

    def put(self, item: Item) -> None:
        """Publish an item."""
        self._t = item.t
        self._queue_up(item.t, item)

    def lines(self, lines: Iterable[object], output: str = "") -> None:
        """Texts for a person are not published."""

    def status(self, values: dict[str, Any]) -> None:
        """Publish the state of recorder and buses, or of a replay."""
        start = values.get("start_ns")
        self._start_ns = start if isinstance(start, int) else self._start_ns
        t = self._t or values.get("t") or values.get("elapsed") or 0.0
        self._queue_up(float(t), {"health": _numbers(values)})

    def close(self) -> None:
        """Send what waits, at most `CLOSE_TIMEOUT_S` long, and end."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(CLOSE_TIMEOUT_S)
        left = len(self._queue) + self.dropped
        if left:
            self._report(f"--publish {self._destination.url}: {left:,} items were not sent")

    def _queue_up(self, t: float, item: Item | dict[str, Any]) -> None:
        if self._start_ns is None:
            return  # before the first frame there is no time
        with self._wake:
            if len(self._queue) >= MAX_WAITING_ITEMS:
                self.dropped += 1
                return
            self._queue.append((t, self._start_ns, item))
            self._wake.notify()

    # --- the thread ---

    def _run(self) -> None:
        try:
            family, address = udp_address.resolve(self._destination)
            with socket.socket(family, socket.SOCK_DGRAM) as out:
                out.setblocking(False)
                self._send_all(out, address)
        except (OSError, UnicodeError) as error:  # the latter: a name that cannot be one
            why = (error.strerror if isinstance(error, OSError) else None) or error
            self._report(f"--publish {self._destination.url}: {why}; nothing is published")

    def _send_all(self, out: socket.socket, address: Any) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._queue or self._closing)
                if not self._queue:
                    return
                t, start_ns, item = self._queue.popleft()
            try:
                values = item if isinstance(item, dict) else datagrams.values_of(item)
                encoded = datagrams.datagrams(start_ns * 1e-9 + t, t, values)
            except (
                Exception
            ) as error:  # of any kind, such as a time that is no number: the others are published
                self._failed(error)
                continue
            for data in encoded:
                self._send(out, address, data)

    def _send(self, out: socket.socket, address: Any, data: bytes) -> None:
        try:
            out.sendto(data, address)
            self.sent += 1
        except OSError as error:
            self._failed(error.strerror or error)

    def _failed(self, why: object) -> None:
        self.failed += 1
        if self.failed == 1:
            self._report(f"--publish {self._destination.url}: a datagram was not sent ({why})")


def _numbers(values: dict[str, Any]) -> dict[str, Any]:
    """Numbers and short texts of a status; the list of buses by number.

    >>> _numbers({"frames": 3, "path": "a.blf", "buses": [{"load": 0.5, "name": "can0"}]})
    {'frames': 3, 'path': 'a.blf', 'buses': {'0': {'load': 0.5, 'name': 'can0'}}}
    """
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            out[key] = _numbers(value)
        elif isinstance(value, list | tuple):
            out[key] = _numbers({str(k): part for k, part in enumerate(value)})
        elif isinstance(value, bool):
            out[key] = int(value)
        elif value is not None:
            out[key] = value
    return out
