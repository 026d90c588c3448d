"""The one thread that waits for the disk itself: it syncs the log that is being written, and closes finished ones."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

from canid.errors import OutputError
from canid.frames.write import Writer

# s between two calls of `also`, at most
LOOK = 1.0


class Syncing:
    """Takes writers from the writing thread, which does not wait."""

    def __init__(self, also: Callable[[], object]):
        """`also`: called in this thread once a second and after each file, for what else may take the disk's time."""
        self.failed = ""  # why a sync or a close failed
        self._also = also
        self._current: Writer | None = None
        self._finished: SimpleQueue[Writer | None] = SimpleQueue()
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name="canid-sync", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def sync(self, writer: Writer) -> None:
        """Have on the disk what was written so far; many calls while one sync lasts become one."""
        self._current = writer
        self._wake.set()

    def finish(self, writer: Writer) -> None:
        """Close a writer, to which nothing more is appended."""
        self._finished.put(writer)
        self._wake.set()

    def close(self) -> None:
        """Finish what was given, and end."""
        self._finished.put(None)
        self._wake.set()
        self._thread.join()

    def _run(self) -> None:
        looked = time.monotonic()
        while True:
            self._wake.wait(LOOK)
            self._wake.clear()
            closed, ended = self._close_finished()
            if closed or time.monotonic() - looked >= LOOK:
                looked = time.monotonic()
                self._also()
            if ended:
                return
            self._sync_current()

    def _close_finished(self) -> tuple[int, bool]:
        """How many were closed; True: that was all there will ever be."""
        closed = 0
        while True:
            try:
                writer = self._finished.get_nowait()
            except Empty:
                return closed, False
            if writer is None:
                return closed, True
            closed += 1
            try:
                writer.close()
            except OutputError as error:
                self.failed = str(error)

    def _sync_current(self) -> None:
        writer, self._current = self._current, None
        try:
            if writer is not None:
                writer.sync()
        except OutputError as error:
            self.failed = str(error)
        except ValueError:
            pass  # closed meanwhile: finished, or given up
