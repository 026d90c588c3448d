"""The log of a recording: frames and events are appended to one file after the other.

Only the writing thread (`log_writer_thread`) appends. Another thread syncs to the disk itself (`disk_sync`); a file that
is moved, deleted or changed by another program while it is written is handled by `lost_files`.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from canid import frame_columns
from canid.errors import OutputError
from canid.files.new_file import ChangedError
from canid.frame_columns import rows
from canid.logs.log_writer import Writer
from canid.recording.disk_sync import DiskSync
from canid.recording.log_folders import LogFolders
from canid.recording.lost_files import LostFiles
from canid.recording.rotation import MAX_NOTE_TEXT, Rotation, certain_rows, has_room, is_full
from canid.recording.thread_join import join
from canid.types import Columns, Event

# ns that a frame may be stamped before its file's first one; a clock that is set back begins new files no more often
MAX_BACKWARD_NS = 1_000_000_000


class LogFiles:
    """The current file and those before it.

    `report(what, says)` takes events, from any thread; `began(path, zero)` is called where a file begins, with the
    session time of its first frame; `follow(path, zero)` where the recording goes on under another name.
    """

    def __init__(
        self,
        wanted: Path,
        rotation: Rotation | None,
        lead_ns: int,
        report: Callable[[str, str], object],
        began: Callable[[Path, float], object],
        follow: Callable[[Path, float], object],
    ):
        self.report = report
        self.folders = LogFolders(wanted, rotation, report)
        self._rotation = rotation or Rotation()
        self._opened = time.monotonic()
        self._lead_ns = lead_ns
        self._began = began
        self._follow = follow
        self.writer: Writer | None = self.folders.open_first()  # None: closed, or given up
        self.writer.lead_ns = lead_ns
        self.path = self.writer.path
        self.count = 1  # files begun
        self.bytes = self.writer.bytes  # in the current file
        self.failed = ""  # why the recording was given up
        self.lost = ""  # which frames are in no file any more, and why
        self.start_ns: int | None = None  # epoch ns of session time 0
        self._finished_frames = 0  # in files before the current one, less those that were lost
        self._zero: int | None = None  # ns, session time of the file's first frame; None: it has none yet
        self._refused_frames = 0  # that the format cannot hold
        self._fitting = self._taken = (
            0  # frames of the latest call of the writer, and how many of them it took
        )
        self._notes: deque[Event] = deque()
        self._no_room = False  # for the next note: the next frame begins a new file
        self._unsaved: list[Columns] = []  # appended since the last checkpoint, in session time
        self._lock = threading.Lock()
        self._lost_files = LostFiles(self)
        self._sync = DiskSync(self.folders.prune, self._lost_files.displaced, self._lost_files.changed)
        self._sync.watch(self.writer)

    def start(self) -> None:
        """Begin to sync."""
        self._sync.start()

    @property
    def written(self) -> int:
        """Frames appended; once the recording has failed, those that a reader finds in the files."""
        with self._lock:
            return self._finished_frames + (self.writer.frames if self.writer is not None else 0)

    @property
    def zero_s(self) -> float:
        """Session time at which the current file's own time begins."""
        return (self._zero or 0) * 1e-9

    def note(self, event: Event) -> None:
        """Write an event into the log itself, once there is a frame before it. Any thread may."""
        self._notes.append(event)

    def close(self, waiting: Callable[[], object]) -> None:
        """Close, and wait until all is on the disk, however long that takes; see `thread_join.join` for `waiting`."""
        with self._lock:
            last, self.writer = self.writer, None
            self._finished_frames += last.frames if last is not None else 0
        if last is not None:
            self._sync.finish(last)
        self._sync.end()
        join(self._sync.thread, waiting)
        for thread in self._lost_files.restoring:
            join(thread, waiting)
        if last is not None:
            with self._lock:
                self._finished_frames -= last.frames - last.kept
            self.bytes = last.bytes
            if self._sync.failed:
                self.failed = self._sync.failed
                self.report("recording_failed", self.failed)
        self.folders.close()

    # --- the writing thread ---

    def append(self, chunk: Columns) -> None:
        """Append frames to the current file, or to the next one where that is due."""
        ns = np.rint(chunk.t * 1e9).astype(np.int64)
        row = 0
        while row < len(ns) and self.writer is not None:
            try:
                row += self._append_here(rows(chunk, row, len(ns)), ns[row:])
            except OutputError as error:
                row += self._taken
                if isinstance(error, ChangedError):
                    self._lost_files.leave_changed(str(error))
                else:
                    self.fail(str(error))
            except Exception as error:
                # of any kind: what no format can hold must cost no other frame
                row, count = row + self._taken, self._fitting - self._taken
                if count > 1:
                    self._append_apart(rows(chunk, row, row + count))
                else:
                    self._refuse(int(chunk.id[row]), error)
                row += count

    def _append_apart(self, chunk: Columns) -> None:
        """Append frames of which one cannot be written: by halves, until it is alone."""
        half = len(chunk.t) // 2
        self.append(rows(chunk, 0, half))
        self.append(rows(chunk, half, len(chunk.t)))

    def _refuse(self, id_: int, error: Exception) -> None:
        self._refused_frames += 1
        if self._refused_frames & (self._refused_frames - 1) == 0:  # 1, 2, 4, 8, ...: not thousands of lines
            self.report(
                "not_written",
                f"a frame with id {id_} cannot be written: {error} ({self._refused_frames:,} so far)",
            )

    def write_notes(self, *, last: bool = False) -> None:
        """Write the events that wait, where the file has a frame already.

        One that would make a file larger than its limit waits for the next file; not the `last` ones, which are never lost.
        """
        while self._notes and self._zero is not None and self.writer is not None:
            event = self._notes[0]
            if self._rotation.size:
                event = event._replace(says=event.says[:MAX_NOTE_TEXT])
            self._no_room = not last and not has_room(self.writer, self._rotation, event)
            if self._no_room:
                return
            self._notes.popleft()
            try:
                self.writer.note(event._replace(t=max(event.t - self._zero * 1e-9, 0.0)))
            except ChangedError as error:
                self._lost_files.leave_changed(str(error))
            except OutputError as error:
                self.fail(str(error))

    def checkpoint(self) -> None:
        """Make the file complete as it stands in the kernel, and have it synced."""
        if self.writer is None:
            return
        if not self.writer.waiting and self.writer.bytes == self.bytes:
            return  # nothing has come: flash memory wears out by being written
        if self._sync.failed:
            self.fail(self._sync.failed)
            return
        try:
            self.writer.checkpoint(sync=False)
        except ChangedError as error:
            self._lost_files.leave_changed(str(error))
            return
        except OutputError as error:
            self.fail(str(error))
            return
        self._unsaved.clear()
        self.bytes = self.writer.bytes
        self._sync.sync(self.writer)

    def leave_displaced(self) -> None:
        """Go on in another file where the current one was found deleted or out of reach."""
        self._lost_files.leave_displaced()

    def fail(self, why: str) -> None:
        """Give the recording up; reading the buses and estimating go on."""
        writer = self.writer
        if writer is None:
            return
        self._sync.watch(None)
        writer.abandon()
        # all that a full disk did not take was appended and is gone: the file ends at its last whole container or line
        with self._lock:
            self._finished_frames += writer.kept
            self.writer = None
        self.bytes = writer.bytes
        self.failed = why
        self.report("recording_failed", why)

    def _append_here(self, chunk: Columns, ns: npt.NDArray[np.int64]) -> int:
        """Append as many of the frames as certainly belong into one file, one at least; returns how many."""
        self._taken = 0
        self._fitting = len(ns)
        if self._zero is None:
            self._begin(int(ns[0]))
        elif self._next_file_is_due(int(ns[0])):
            self._begin_next_file(int(ns[0]))
        assert self.writer is not None
        self._fitting = self._rows_here(ns, chunk.data.shape[1])
        part = rows(chunk, 0, self._fitting)
        own = (
            part._replace(t=(ns[: self._fitting] - self._zero).astype(np.float64) * 1e-9)
            if self._zero
            else part
        )
        frames = self.writer.frames
        try:
            self.writer.append_columns(own)
        finally:
            self._taken = self.writer.frames - frames
            if self._taken:  # they may be taken, and writing fail
                self._unsaved.append(rows(part, 0, self._taken))
        return self._fitting

    def _rows_here(self, ns: npt.NDArray[np.int64], width: int) -> int:
        """How many frames, the first of which belongs into the current file, follow each other there for certain."""
        assert self.writer is not None
        assert self._zero is not None
        since = ns - self._zero
        elsewhere = since < -MAX_BACKWARD_NS
        if not self._is_old:
            elsewhere[:] = False
        if self.folders.rotates:
            elsewhere |= since >= self._rotation.time * 1e9
        elsewhere[0] = False
        until = int(elsewhere.argmax()) if elsewhere.any() else len(ns)
        return min(until, certain_rows(self.writer, self._rotation, width))

    def _begin(self, ns: int) -> None:
        """The current file's own time begins at session time `ns`."""
        assert self.writer is not None
        assert self.start_ns is not None
        self._zero = ns
        self.writer.start_ns = self.start_ns + ns
        self._began(self.path, ns * 1e-9)

    def _next_file_is_due(self, ns: int) -> bool:
        """Whether the frame at `ns` belongs into a new file."""
        assert self.writer is not None
        assert self._zero is not None
        if ns - self._zero < -MAX_BACKWARD_NS and self._is_old:
            # a clock was set back behind the file's start, and no format has negative times
            return True
        if not self.folders.rotates or not self.writer.frames:
            return False
        if self._no_room:
            return True
        return ns - self._zero >= self._rotation.time * 1e9 or is_full(self.writer, self._rotation)

    @property
    def _is_old(self) -> bool:
        """Whether a clock that is set back may begin another file."""
        return time.monotonic() - self._opened > MAX_BACKWARD_NS * 1e-9

    def _begin_next_file(self, ns: int) -> None:
        """The frame at `ns` begins a new file; all before it is on its way to the disk."""
        assert self.writer is not None
        self.writer.checkpoint(sync=False)
        self.replace(self.folders.open_next(self.path, anywhere=False))
        self._begin(ns)

    # --- for `lost_files` ---

    def replace(self, writer: Writer) -> None:
        """Go on in a new file; the one before is finished."""
        before = self.writer
        assert before is not None
        writer.lead_ns = self._lead_ns
        self._opened = time.monotonic()
        with self._lock:
            self._finished_frames += before.kept
            self.writer = writer
        self._unsaved.clear()
        self.path, self.count, self.bytes = writer.path, self.count + 1, writer.bytes
        self._zero = None
        self._no_room = False
        self._sync.watch(writer)
        self._sync.finish(before)

    def renamed(self, path: Path, zero_s: float) -> None:
        """Note that the recording is now under another name, whose own time begins at `zero_s`."""
        self.path = path
        self._follow(path, zero_s)

    def unsaved_of(self, writer: Writer) -> list[Columns]:
        """Frames that were appended and are not in the file."""
        count = writer.frames - writer.kept
        if not self._unsaved or not count:
            return []
        unsaved = frame_columns.join(self._unsaved)
        return [rows(unsaved, max(len(unsaved.t) - count, 0), len(unsaved.t))]

    def lose(self, frames: int, why: str) -> None:
        """Count frames that are in no file any more."""
        with self._lock:
            self._finished_frames -= frames
        self.lost = why
        self.report("recording_lost", why)
