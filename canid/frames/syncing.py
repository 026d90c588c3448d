"""The one thread that waits for the disk itself: it syncs the log being written, closes finished ones, looks for both."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

from canid.errors import OutputError
from canid.frames.disk import ChangedError
from canid.frames.whereabouts import Place, Whereabouts
from canid.frames.write import Writer

# s between two checks of whether the file still has its name: noticed within 1 s is promised, and the writing thread
# takes up to 0.15 s to go on elsewhere
CHECK_S = 0.4
# s between two calls of `also`, at most
ALSO_S = 1.0


class Syncing:
    """Takes writers from the writing thread, which does not wait.

    `misplaced(writer, whereabouts, finished)` is called where a file no longer has its name; a finished one that is
    out of reach belongs to the callee then, open. `changed(writer)` is called for a finished one into which somebody
    else has written. `also` is called once a second and after each file, for what else
    may take the disk's time.
    """

    def __init__(
        self,
        also: Callable[[], object],
        misplaced: Callable[[Writer, Whereabouts, bool], object],
        changed: Callable[[Writer], object],
    ):
        self.failed = ""  # why a sync or a close failed
        self._also = also
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
        """Look from now on whether this file keeps its name."""
        self._watched = writer

    def sync(self, writer: Writer) -> None:
        """Have on the disk what was written so far; many calls while one sync lasts become one."""
        self._current = writer
        self._wake.set()

    def finish(self, writer: Writer) -> None:
        """Close a writer, to which nothing more is appended."""
        self._finished.put(writer)
        self._wake.set()

    def end(self) -> None:
        """Finish what was given, and end; returns at once."""
        self._finished.put(None)
        self._wake.set()

    def _run(self) -> None:
        called = checked = time.monotonic()
        while True:
            self._wake.wait(CHECK_S)
            self._wake.clear()
            closed, ended = self._close_finished()
            if closed or time.monotonic() - called >= ALSO_S:
                called = time.monotonic()
                self._also()
            if ended:
                return
            self._sync_current()
            if time.monotonic() - checked >= CHECK_S:
                checked = time.monotonic()
                self._check()

    def _check(self) -> None:
        writer = self._watched
        if writer is None:
            return
        try:
            where = writer.disk.find()
        except ValueError:
            return  # closed meanwhile
        if where.place is not Place.HERE and writer is self._watched:
            self._misplaced(writer, where, False)

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
            if writer.disk.changed:
                writer.abandon()  # the writing thread knows
                continue
            try:
                writer.complete()
            except ChangedError:
                self._changed(writer)
            except OutputError as error:
                self.failed = str(error)
            where = writer.disk.find()
            if where.place is not Place.HERE:
                self._misplaced(writer, where, True)
            if not where.lost:
                writer.abandon()  # it is complete, or cannot be

    def _sync_current(self) -> None:
        writer, self._current = self._current, None
        try:
            if writer is not None:
                writer.sync()
        except OutputError as error:
            self.failed = str(error)
        except ValueError:
            pass  # closed meanwhile: finished, or given up
