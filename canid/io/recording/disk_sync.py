"""The thread that waits for the disk: it syncs the current log, closes finished ones and checks that they are in place."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

from canid.io.files.file_location import Place, Whereabouts
from canid.io.files.new_file import ChangedError
from canid.io.logs.writer import Writer
from canid.values.errors import OutputError

# s between two checks of whether the file still has its name: noticed within 1 s is promised, and the writing thread
# takes up to 0.15 s to go on elsewhere
FILE_CHECK_S = 0.4
# s between two calls of `maintain`, at most
MAINTENANCE_S = 1.0


class DiskSync:
    """Takes writers from the writing thread, which does not wait.

    `misplaced(writer, whereabouts, finished)` is called where a file no longer has its name; a finished one that is
    out of reach is handed to the callee, open. `changed(writer)` is called for a finished one into which another
    program has written. `maintain` is called once a second and after each file, for other work that waits for the disk.
    """

    def __init__(
        self,
        maintain: Callable[[], object],
        misplaced: Callable[[Writer, Whereabouts, bool], object],
        changed: Callable[[Writer], object],
    ):
        self._failures: SimpleQueue[tuple[Writer, OutputError]] = SimpleQueue()
        self._maintain = maintain
        self._misplaced = misplaced
        self._changed = changed
        self._watched: Writer | None = None
        self._current: Writer | None = None
        self._finished: SimpleQueue[Writer | None] = SimpleQueue()
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name="canid-sync", daemon=True)

    @property
    def thread(self) -> threading.Thread:
        """The thread; it ends some time after `end`."""
        return self._thread

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def watch(self, writer: Writer | None) -> None:
        """Check from now on whether this file keeps its name."""
        self._watched = writer

    def sync(self, writer: Writer) -> None:
        """Sync what was written so far; calls during a sync are merged into one."""
        self._current = writer
        self._wake.set()

    def finish(self, writer: Writer) -> None:
        """Close a writer to which nothing more is appended."""
        self._finished.put(writer)
        self._wake.set()

    def failures(self) -> list[tuple[Writer, OutputError]]:
        """The syncs and closings that failed since the last call."""
        return [self._failures.get() for _ in range(self._failures.qsize())]

    def end(self) -> None:
        """Finish the queue, and end; returns at once."""
        self._finished.put(None)
        self._wake.set()

    def _run(self) -> None:
        called = checked = time.monotonic()
        while True:
            self._wake.wait(FILE_CHECK_S)
            self._wake.clear()
            closed, ended = self._close_finished()
            if closed or time.monotonic() - called >= MAINTENANCE_S:
                called = time.monotonic()
                self._maintain()
            if ended:
                return
            self._sync_current()
            if time.monotonic() - checked >= FILE_CHECK_S:
                checked = time.monotonic()
                self._check()

    def _check(self) -> None:
        writer = self._watched
        if writer is None:
            return
        try:
            where = writer.disk.find()
        except ValueError:
            return  # closed in between
        if where.place is not Place.HERE and writer is self._watched:
            self._misplaced(writer, where, False)

    def _close_finished(self) -> tuple[int, bool]:
        """How many were closed; True: these were the last ones."""
        closed = 0
        while True:
            try:
                writer = self._finished.get_nowait()
            except Empty:
                return closed, False
            if writer is None:
                return closed, True
            closed += 1
            if writer.disk.changed:
                writer.abandon()  # the writing thread has reported it
                continue
            if not writer.disk.broken:
                self._complete(writer)
            elif not writer.kept:
                writer.disk.remove()
                continue
            where = writer.disk.find()
            if where.place is not Place.HERE:
                self._misplaced(writer, where, True)
            if not where.lost:
                writer.abandon()  # it is complete, or cannot be

    def _complete(self, writer: Writer) -> None:
        try:
            writer.complete()
        except ChangedError:
            self._changed(writer)
        except OutputError as error:
            self._failures.put((writer, error))

    def _sync_current(self) -> None:
        writer, self._current = self._current, None
        if writer is None or writer.disk.broken:
            return
        try:
            writer.sync()
        except OutputError as error:
            self._failures.put((writer, error))
        except ValueError:
            pass  # closed in between: finished
