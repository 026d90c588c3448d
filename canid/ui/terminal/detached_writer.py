"""A writer thread for an output that may fail, block or be absent: nothing waits for it."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable


class DetachedWriter:
    """A bounded queue in front of a function that writes bytes and may block forever or raise OSError.

    `put` never blocks and never raises. Items are written whole and in order; while the queue is full and after the
    first error they are dropped and counted.
    """

    def __init__(self, write: Callable[[bytes], object], limit: int, name: str):
        """Start the thread.

        Args:
            write: writes all bytes of an item; called from the thread.
            limit: bytes that may wait in the queue.
            name: of the thread.
        """
        self.lost = 0  # items
        self.error: OSError | None = None
        self._write = write
        self._limit = limit
        self._items: deque[tuple[bytes, bool]] = deque()  # (data, replaceable)
        self._waiting = 0  # bytes, including the item being written
        self._closing = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, data: bytes, *, replaceable: bool = False) -> None:
        """Queue an item; a replaceable one takes the place of those before it, which then are not lost."""
        with self._changed:
            if replaceable:
                kept = deque(item for item in self._items if not item[1])
                self._waiting -= _size(self._items) - _size(kept)
                self._items = kept
            # an item larger than the whole queue is taken if nothing else waits
            if self.error or self._closing or (self._waiting and self._waiting + len(data) > self._limit):
                self.lost += 1
                return
            self._items.append((data, replaceable))
            self._waiting += len(data)
            self._changed.notify_all()

    def close(self, timeout: float) -> bool:
        """Refuse further items and wait up to `timeout` s for the queue; the rest is lost. True: all was written."""
        end = time.monotonic() + timeout
        with self._changed:
            self._closing = True
            self._changed.notify_all()
            while self._waiting and not self.error and (left := end - time.monotonic()) > 0:
                self._changed.wait(left)
            self.lost += len(self._items) + (self._waiting > _size(self._items))
            self._items.clear()
            return not self.lost and not self.error

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._items or self._closing)
                if not self._items:
                    return
                item, _ = self._items.popleft()
            error = None
            try:
                self._write(item)
            except OSError as failed:
                error = failed
            with self._changed:
                self._waiting -= len(item)
                if error is not None:
                    self.error = error
                    self.lost += 1 + len(self._items)
                    self._items.clear()
                    self._waiting = 0
                self._changed.notify_all()
                if error is not None:
                    return


def _size(items: Iterable[tuple[bytes, bool]]) -> int:
    return sum(len(data) for data, _ in items)
