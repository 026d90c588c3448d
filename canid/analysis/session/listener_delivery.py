"""Delivery of estimates from a listener's threads: to a callback, an asyncio queue, or whoever iterates.

Whoever takes them may be slow, raise, or be gone; nothing of that reaches the threads that receive frames.
"""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from canid.values.types import Estimate

# estimates that wait for a slow reader: four a second, so four minutes
MAX_WAITING_ESTIMATES = 1000

Complain = Callable[[str, BaseException], None]  # (what has failed, of which only the first is reported; why)


class Delivery(Protocol):
    """Takes estimates from the thread of the estimator process; never blocks, never raises."""

    @property
    def dropped(self) -> int:
        """Estimates that nobody took in time."""

    @property
    def failed(self) -> int:
        """Callbacks that raised."""

    def inside(self) -> bool:
        """Whether this is called from within the callback."""

    def put(self, item: Any) -> None:
        """Deliver one."""

    def stop(self, timeout: float) -> None:
        """Nothing more comes: deliver what waits, for at most `timeout` s."""


class Waiting:
    """Estimates that wait for `for estimate in listener`; where nobody reads, the oldest are dropped and counted."""

    def __init__(self) -> None:
        """Begin empty."""
        self.dropped = self.failed = 0
        self._items: deque[Any] = deque()
        self._wake = threading.Condition()
        self._stopped = False

    def inside(self) -> bool:
        """There is no callback."""
        return False

    def put(self, item: Any) -> None:
        """Append one."""
        with self._wake:
            if len(self._items) >= MAX_WAITING_ESTIMATES:
                self._items.popleft()
                self.dropped += 1
            self._items.append(item)
            self._wake.notify()

    def stop(self, timeout: float) -> None:
        """Whoever iterates gets what waits, and then the end."""
        with self._wake:
            self._stopped = True
            self._wake.notify_all()

    def __iter__(self) -> Iterator[Any]:
        """Take them one by one, until the end."""
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._items or self._stopped)
                if not self._items:
                    return
                item = self._items.popleft()
            yield item


class Called:
    """A callback, called in a thread of its own: it may be slow, and what it raises is counted."""

    def __init__(self, callback: Callable[[Estimate], object], complain: Complain) -> None:
        """Start the thread."""
        self._callback, self._complain = callback, complain
        self._waiting = Waiting()
        self.failed = 0
        self._thread = threading.Thread(target=self._run, name="canid-listener-callback", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Estimates for which the callback was too slow."""
        return self._waiting.dropped

    def inside(self) -> bool:
        """Whether this is the callback's thread."""
        return threading.current_thread() is self._thread

    def put(self, item: Any) -> None:
        """Queue one."""
        self._waiting.put(item)

    def stop(self, timeout: float) -> None:
        """Let the callback have what waits; from within the callback, return at once."""
        self._waiting.stop(timeout)
        if not self.inside():
            self._thread.join(timeout)

    def _run(self) -> None:
        for item in self._waiting:
            try:
                self._callback(item)
            except Exception as error:  # of any kind: it is the user's code
                self.failed += 1
                self._complain("the callback", error)


class Queued:
    """An asyncio queue, filled on the thread of its event loop."""

    def __init__(
        self, queue: asyncio.Queue[Estimate], loop: asyncio.AbstractEventLoop, complain: Complain
    ) -> None:
        """Nothing is started: the loop is the user's."""
        self._queue, self._loop, self._complain = queue, loop, complain
        self.dropped = self.failed = 0

    def inside(self) -> bool:
        """There is no callback."""
        return False

    def put(self, item: Any) -> None:
        """Schedule one."""
        try:
            self._loop.call_soon_threadsafe(self._put, item)
        except RuntimeError as error:  # the loop is closed
            self.dropped += 1
            self._complain("the event loop", error)

    def stop(self, timeout: float) -> None:
        """What was scheduled comes as soon as the loop runs."""

    def _put(self, item: Any) -> None:
        try:
            self._queue.put_nowait(item)
        except Exception as error:  # QueueFull; QueueShutDown of Python 3.13
            self.dropped += 1
            self._complain("the asyncio queue", error)
