"""The log of a recording: frames and events are appended to one file after the other.

Only the writing thread (`log_writer_thread`) appends. Another thread syncs to the disk itself (`disk_sync`); a file that
is moved, deleted or changed by another program while it is written is handled by `lost_files`, one that cannot be
written by `write_errors`.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from canid.io.files.held_folder import HeldFolder
from canid.io.files.new_file import ChangedError
from canid.io.logs.writer import Writer
from canid.io.recording.disk_sync import DiskSync
from canid.io.recording.log_folders import LogFolders
from canid.io.recording.lost_files import LostFiles, covered
from canid.io.recording.rotation import MAX_NOTE_TEXT, Rotation, certain_rows, has_room, is_full
from canid.io.recording.running_time import RunningTime
from canid.io.recording.thread_join import join
from canid.io.recording.write_errors import WriteErrors
from canid.values import frame_columns
from canid.values.errors import OutputError
from canid.values.frame_columns import rows
from canid.values.types import Columns, Event

# path of a log, session time of its own zero in s, its folder
Follow = Callable[[Path, float, HeldFolder], object]

_Ns = npt.NDArray[np.int64]

# ns from a file's own zero to its first frame: frames of several buses, and those of a clock that is corrected, do not come
# in the order of their stamps, and no format has times before its zero. What is stamped earlier begins a new file.
LEAD_NS = 1_000_000_000
# Each such file has twice the room of the one before, so that a clock that runs backwards begins some dozens, not one a
# second; this is more than any clock's range.
_MAX_LEAD_NS = 1 << 62
# A file ends by time at last after so many times its length: a clock may stand still, or run backwards.
_MAX_REAL_RATIO = 2.0


class LogFiles:
    """The current file and those before it.

    `report(what, says)` takes events, from any thread; `began(path, zero, folder)` is called where a file begins, with the
    session time of its first frame; `follow(path, zero, folder)` where the recording goes on under another name.
    """

    def __init__(
        self,
        wanted: Path,
        rotation: Rotation | None,
        report: Callable[[str, str], object],
        began: Follow,
        follow: Follow,
    ):
        self.report = report
        self.folders = LogFolders(wanted, rotation, report)
        self._rotation = rotation or Rotation()
        self._lead_ns = LEAD_NS
        self._began = began
        self._follow = follow
        self.writer: Writer | None = self.folders.open_first()  # None: closed, or no file can be written
        self.path = self._path_before = self.writer.path
        self.folder = self._folder_before = self.writer.disk.folder
        self.count = 1  # files begun
        self.bytes = self.writer.bytes  # in the current file
        self.lost = ""  # which frames are in no file any more, and why
        self.hidden = ""  # at the end: why the file is not seen under its path
        self.start_ns: int | None = None  # epoch ns of session time 0
        self._finished_frames = 0  # in files before the current one, less those that were lost
        self._zero: int | None = None  # ns, session time of the file's first frame; None: it has none yet
        self._running = RunningTime()
        self._began_at = 0  # ns, running time at which the file began
        self._began_real = 0.0  # s, monotonic clock
        self._refused_frames = 0  # that the format cannot hold
        # frames of the latest call of the writer, and how many of them it took; of the latest chunk, how many are done
        self._fitting = self._taken = self._row = 0
        self._notes: deque[Event] = deque()
        self._no_room = False  # for the next note: the next frame begins a new file
        self._unsaved: list[Columns] = []  # appended since the last checkpoint, in session time
        self._lock = threading.Lock()
        self._closed = False
        self._lost_files = LostFiles(self)
        self.errors = WriteErrors(self)
        self._sync = DiskSync(self.folders.prune, self._lost_files.displaced, self._lost_files.changed)
        self._sync.watch(self.writer)

    def start(self) -> None:
        """Begin to sync."""
        self._sync.start()

    @property
    def failed(self) -> str:
        """Why nothing can be written now or, at the end, which errors there were; "": none."""
        if self._closed or not self.errors.says:
            return self.errors.says
        return f"{self.errors.says}; frames wait in memory" if self.writer is None else ""

    @property
    def written(self) -> int:
        """Frames appended; of a file that has ended, those that a reader finds in it."""
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
            self._closed = True
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
        for _, error in self._sync.failures():
            self.errors.note(error)
        self.hidden = covered(self.folder)
        self.folders.close()

    # --- the writing thread ---

    def append(self, chunk: Columns) -> None:
        """Append frames to the current file, or to the next one where that is due; what no file takes is held."""
        if self.writer is None:
            self.errors.held.append(chunk)
            return
        try:
            self.append_rows(chunk)
        except ChangedError as error:
            rest = self.rest_of(chunk)
            self._lost_files.leave_changed(str(error))
            for part in rest:
                self.append(part)
        except OutputError as error:
            self.errors.leave(error, *self.rest_of(chunk))

    def append_rows(self, chunk: Columns) -> None:
        """The same; raises OutputError where a file fails, and `rest_of` gives what was not taken."""
        ns = np.rint(chunk.t * 1e9).astype(np.int64)
        running = self._running.of(ns, chunk.bus)
        self._row, most = 0, len(ns)
        while self._row < len(ns):
            k = slice(self._row, self._row + most)
            try:
                self._row += self._append_here(rows(chunk, k.start, min(k.stop, len(ns))), ns[k], running[k])
                most = min(2 * most, len(ns))
            except OutputError:
                self._row += self._taken
                raise
            except Exception as error:
                # of any kind: what no format can hold must cost no other frame; by halves, until it is alone
                self._row += self._taken
                if self._fitting > 1:
                    most = self._fitting // 2
                else:
                    self._refuse(int(chunk.id[self._row]), error)
                    self._row, most = self._row + 1, len(ns)

    def rest_of(self, chunk: Columns) -> list[Columns]:
        """What `append_rows` did not take of a chunk."""
        return [rows(chunk, self._row, len(chunk.t))] if self._row < len(chunk.t) else []

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
            file_time = max(event.t - self._zero * 1e-9, self.writer.earliest_ns * 1e-9)
            try:
                self.writer.note(event._replace(t=file_time))
            except ChangedError as error:
                self._lost_files.leave_changed(str(error))
            except OutputError as error:
                self.errors.leave(error)

    def checkpoint(self) -> None:
        """Make the file complete as it stands in the kernel, and have it synced."""
        for writer, error in self._sync.failures():
            if writer is self.writer:
                self.errors.leave(error)
            else:
                self.errors.note(error)
        if self.writer is None:
            return
        if not self.writer.waiting and self.writer.bytes == self.bytes:
            return  # nothing has come: flash memory wears out by being written
        try:
            self.write_out()
        except ChangedError as error:
            self._lost_files.leave_changed(str(error))
        except OutputError as error:
            self.errors.leave(error)

    def write_out(self) -> None:
        """The same; raises OutputError."""
        assert self.writer is not None
        self.writer.checkpoint(sync=False)
        self._unsaved.clear()
        self.bytes = self.writer.bytes
        self._sync.sync(self.writer)

    def leave_displaced(self) -> None:
        """Go on in another file where the current one was found deleted or out of reach."""
        self._lost_files.leave_displaced()

    def _append_here(self, chunk: Columns, ns: _Ns, running: _Ns) -> int:
        """Append as many of the frames as certainly belong into one file, one at least; returns how many."""
        self._taken = 0
        self._fitting = len(ns)
        if self._zero is not None and self._next_file_is_due(int(ns[0]), int(running[0])):
            assert self.writer is not None
            self.writer.checkpoint(sync=False)  # all before it is on its way to the disk
            self.replace(self.folders.open_next(anywhere=False))
        if self._zero is None:
            self._begin(int(ns[0]), int(running[0]), int(ns.min()))
        assert self.writer is not None
        self._fitting = self._rows_here(ns, running, chunk.data.shape[1])
        part = rows(chunk, 0, self._fitting)
        in_file_time = (
            part._replace(t=(ns[: self._fitting] - self._zero).astype(np.float64) * 1e-9)
            if self._zero
            else part
        )
        frames = self.writer.frames
        try:
            self.writer.append_columns(in_file_time)
        finally:
            self._taken = self.writer.frames - frames
            if self._taken:  # they may be taken, and writing fail
                self._unsaved.append(rows(part, 0, self._taken))
        return self._fitting

    def _rows_here(self, ns: _Ns, running: _Ns, width: int) -> int:
        """How many frames, the first of which belongs into the current file, follow each other there for certain."""
        assert self.writer is not None
        assert self._zero is not None
        elsewhere = ns - self._zero < self.writer.earliest_ns
        if self.folders.rotates:
            elsewhere |= running - self._began_at >= self._rotation.time * 1e9
        elsewhere[0] = False
        until = int(elsewhere.argmax()) if elsewhere.any() else len(ns)
        return min(until, certain_rows(self.writer, self._rotation, width))

    def _begin(self, ns: int, running: int, earliest: int) -> None:
        """The current file begins with the frame at session time `ns`; `earliest`: of those that came with it."""
        assert self.writer is not None
        assert self.start_ns is not None
        self._zero, self._began_at, self._began_real = ns, running, time.monotonic()
        # as the clock of another bus may stamp now
        earliest = min(earliest, running - self._running.furthest_behind)
        self.writer.lead_ns = max(self._lead_ns, ns - earliest + LEAD_NS)
        self.writer.start_ns = self.start_ns + ns
        self._began(self.path, ns * 1e-9, self.folder)

    def _next_file_is_due(self, ns: int, running: int) -> bool:
        """Whether the frame at `ns` belongs into a new file."""
        assert self.writer is not None
        assert self._zero is not None
        if ns - self._zero < self.writer.earliest_ns:
            self._lead_ns = min(2 * self._lead_ns, _MAX_LEAD_NS)
            return True
        if not self.folders.rotates or not self.writer.frames:
            return False
        if self._no_room:
            return True
        length = self._rotation.time
        return (
            running - self._began_at >= length * 1e9
            or time.monotonic() - self._began_real > _MAX_REAL_RATIO * length
            or is_full(self.writer, self._rotation)
        )

    # --- for `lost_files` and `write_errors` ---

    def end_broken(self, writer: Writer) -> None:
        """The file cannot be written any more: it ends where it is whole; one that holds nothing is deleted."""
        writer.disk.broken = True
        self._sync.watch(None)
        with self._lock:
            self._finished_frames += writer.kept
            self.writer = None
            if not writer.kept:
                self.path, self.folder, self.count = self._path_before, self._folder_before, self.count - 1
        self._unsaved.clear()
        self.bytes = writer.bytes
        if not writer.kept:
            self._follow(self.path, self.zero_s, self.folder)
        self._sync.finish(writer)

    def replace(self, writer: Writer) -> None:
        """Go on in a new file; the one before is finished."""
        before = self.writer
        with self._lock:
            self._finished_frames += before.kept if before is not None else 0
            self.writer = writer
        self._unsaved.clear()
        self._path_before, self._folder_before = self.path, self.folder
        self.path, self.folder = writer.path, writer.disk.folder
        self.count, self.bytes = self.count + 1, writer.bytes
        self._zero = None
        self._no_room = False
        self._sync.watch(writer)
        if before is not None:
            self._sync.finish(before)

    def renamed(self, path: Path, zero_s: float, folder: HeldFolder) -> None:
        """Note that the recording is now under another name, whose own time begins at `zero_s`."""
        self.path, self.folder = path, folder
        self._follow(path, zero_s, folder)

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
