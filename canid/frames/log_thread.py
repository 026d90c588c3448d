"""Writing the log in a thread of its own, for which nobody waits; `syncing` is another, for the disk itself.

What is put here reaches the kernel within `CHECKPOINT`, complete with its header, so that a kill costs no more.
A disk that does not keep up makes frames wait in memory, up to `ROOM`; what is beyond that is dropped, counted,
and told in the log itself. A file that is deleted, moved or changed by somebody else while it is written is told as an
event; the recording goes on, and what can still be read of the file is kept.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from canid.errors import OutputError
from canid.frames.disk import ChangedError
from canid.frames.restoring import Restored, restore
from canid.frames.rotation import Rotation, full
from canid.frames.series import Series
from canid.frames.syncing import Syncing
from canid.frames.whereabouts import Whereabouts
from canid.frames.write import Writer, open_new
from canid.types import Event, Frame

# s between checkpoints: 250 ms are promised, the rest is for the work itself and a machine that is busy
CHECKPOINT = 0.15
# Frames that may wait for a disk that stalls: a minute of a full 1 Mbit/s bus (8,000 frames/s), some 120 MB.
ROOM = 480_000
# ns that a frame may be stamped before its file's first one; not more often than this does a clock begin a new file
EARLIEST = 1_000_000_000
# Frames between two looks at the clock while what waits is written: a late checkpoint must not wait for all of it
TURN = 256
# s between two calls of the progress while `close` waits
PROGRESS_S = 0.2


class LogThread:
    """Owns the file, or the files one after the other.

    `tell(what, says)` takes events, from any thread; `began(path, zero)` is called where a file begins, with the
    session time of its first frame; `follow(path, zero)` where the recording goes on under another name.
    """

    def __init__(
        self,
        wanted: Path,
        rotation: Rotation | None,
        lead_ns: int,
        tell: Callable[[str, str], object],
        began: Callable[[Path, float], object],
        follow: Callable[[Path, float], object] = lambda path, zero: None,
    ):
        self._wanted = wanted
        # found out now: later the process' own folder may be gone
        self._above = Path(os.path.abspath(wanted)).parent.parents
        self._rotation = rotation or Rotation()
        self._opened = time.monotonic()
        self._lead_ns = lead_ns
        self._tell = tell
        self._began = began
        self._follow = follow
        self._series = Series(wanted, rotation, tell) if rotation else None
        self._writer: Writer | None = _first_of(self._series) if self._series else open_new(wanted)
        self._writer.lead_ns = lead_ns
        self.path = self._writer.path
        self.files = 1
        self.dropped = 0  # frames for which there was no room
        self.bytes = self._writer.bytes  # in the current file
        self.failed = ""  # why the file was given up
        self.lost = ""  # what is in no file any more, and why
        self._finished_frames = 0  # in files before the current one, less those that were lost
        self._start_ns: int | None = None  # epoch ns of session time 0
        self._zero: int | None = None  # ns, session time of the file's first frame; None: it has none yet
        # with the time of arrival, monotonic clock
        self._waiting: deque[tuple[float, Sequence[Frame]]] = deque()
        self._count = 0  # frames in `_waiting`, and those in hand
        self._in_hand: float | None = None  # arrival of the oldest one that is being written
        self._late = 0.0
        self._dropping: list[Frame] = []  # the first and the last one of those dropped in a row
        self._dropped_in_row = 0
        self._refused = 0  # frames that the format cannot hold
        self._notes: deque[Event] = deque()
        self._unsaved: list[Frame] = []  # appended since the last checkpoint, in session time
        self._misplaced: tuple[Writer, Whereabouts] | None = None  # what the syncing thread has found out
        self._restoring: list[threading.Thread] = []
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._syncing = Syncing(self._tend, self._is_misplaced, self._is_changed)
        self._syncing.watch(self._writer)
        self._thread = threading.Thread(target=self._write, name="canid-write", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._syncing.start()
        self._thread.start()

    def put(self, frames: Sequence[Frame], at: float, start_ns: int) -> None:
        """Take frames that arrived at `at` (monotonic clock); never waits. `start_ns`: epoch ns of their t = 0."""
        if self.failed:
            return
        with self._lock:
            self._start_ns = start_ns
            took = frames[: max(ROOM - self._count, 0)]
            if took:
                self._waiting.append((at, took))
                self._count += len(took)
        if took and self._dropping:
            self._dropped_so_far()
        if len(took) < len(frames):
            self._drop(frames[len(took) :])

    def note(self, event: Event) -> None:
        """Write an event into the log itself, once there is a frame before it."""
        self._notes.append(event)

    @property
    def waiting(self) -> int:
        """Frames that were put and not written yet."""
        return self._count

    @property
    def lag(self) -> float:
        """S from a frame's arrival to its writing: the latest that was written, or the oldest that waits now."""
        oldest = self._in_hand
        if oldest is None:
            with self._lock:
                oldest = self._waiting[0][0] if self._waiting else None
        return max(self._late, time.monotonic() - oldest if oldest is not None else 0.0)

    @property
    def written(self) -> int:
        """Frames appended; once the recording has failed, those that a reader finds in the files."""
        with self._lock:
            return self._finished_frames + (self._writer.frames if self._writer is not None else 0)

    def close(self, waiting: Callable[[], object] = lambda: None) -> None:
        """Write what waits, close, and wait until it is on the disk, however long the disk takes.

        `waiting` is called a few times a second meanwhile; what it raises ends the waiting.
        """
        if self._dropping:
            self._dropped_so_far()
        self._ending.set()
        join(self._thread, waiting)
        with self._lock:
            last, self._writer = self._writer, None
            self._finished_frames += last.frames if last is not None else 0
        if last is not None:
            self._syncing.finish(last)
        self._syncing.end()
        join(self._syncing.thread, waiting)
        for thread in self._restoring:
            join(thread, waiting)
        if last is not None:
            with self._lock:
                self._finished_frames -= last.frames - last.kept
            self.bytes = last.bytes
            if self._syncing.failed:
                self.failed = self._syncing.failed
                self._tell("recording_failed", self.failed)
        if self._series is not None:
            self._series.close()

    # --- the caller's thread ---

    def _drop(self, frames: Sequence[Frame]) -> None:
        if not self._dropping:
            self._tell(
                "disk_too_slow",
                f"the disk takes nothing for {self.lag:.0f} s: frames are dropped from here on",
            )
            self._dropping = [frames[0], frames[0]]
        self._dropping[1] = frames[-1]
        self.dropped += len(frames)
        self._dropped_in_row += len(frames)

    def _dropped_so_far(self) -> None:
        first, last = self._dropping
        self._tell(
            "frames_not_recorded",
            f"{self._dropped_in_row:,} frames from {first.t:.6f} s to {last.t:.6f} s are not in the log: "
            "the disk was too slow",
        )
        self._dropping, self._dropped_in_row = [], 0

    # --- writing: one thread ---

    def _write(self) -> None:
        due = time.monotonic()
        ending = False
        while not ending:
            due = max(due + CHECKPOINT, time.monotonic())
            ending = self._ending.wait(due - time.monotonic())
            try:
                self._go_on_elsewhere()
                due = self._take(due)
                self._checkpoint()
            except Exception as error:  # of any kind: a recording must never end in silence
                self._fail(f"{type(error).__name__}: {error}")
        self._note_all()

    def _take(self, due: float) -> float:
        """Append what waits now, with checkpoints where that takes long; returns when the last one was due."""
        late = 0.0
        for _ in range(len(self._waiting)):
            with self._lock:
                self._in_hand, frames = self._waiting.popleft()
            self._note_all()
            for begin in range(0, len(frames), TURN):
                for frame in frames[begin : begin + TURN]:
                    self._append(frame)
                if time.monotonic() - due > CHECKPOINT:
                    self._checkpoint()
                    due = time.monotonic()
            with self._lock:
                self._count -= len(frames)
            late = max(late, time.monotonic() - self._in_hand)
        self._in_hand = None
        self._late = late
        return due

    def _append(self, frame: Frame) -> None:
        if self._writer is None:
            return
        try:
            self._append_here(frame)
        except ChangedError as error:
            self._leave_changed(str(error), frame)
        except OutputError as error:
            self._fail(str(error))
        except Exception as error:
            # of any kind: what no format can hold must cost no other frame
            self._refused += 1
            if self._refused & (self._refused - 1) == 0:  # 1, 2, 4, 8, ...: nobody reads thousands of lines
                self._tell(
                    "not_written",
                    f"a frame with id {frame.id!r:.20} cannot be written: {error} ({self._refused:,} so far)",
                )

    def _append_here(self, frame: Frame) -> None:
        ns = round(frame.t * 1e9)
        if self._zero is None:
            self._begin(ns)
        elif self._due(ns):
            self._next_file(ns)
        assert self._writer is not None
        own = frame._replace(t=(ns - self._zero) * 1e-9) if self._zero else frame
        frames = self._writer.frames
        try:
            self._writer.append(own)
        finally:
            if self._writer.frames > frames:  # it may be taken, and writing fail
                self._unsaved.append(frame)

    def _due(self, ns: int) -> bool:
        """Whether this frame belongs into a new file."""
        assert self._writer is not None
        assert self._zero is not None
        if ns - self._zero < -EARLIEST and time.monotonic() - self._opened > EARLIEST * 1e-9:
            # a clock was set back behind the file's start, and no format has negative times
            return True
        if self._series is None or not self._writer.frames:
            return False
        return ns - self._zero >= self._rotation.time * 1e9 or full(self._writer, self._rotation)

    def _next_file(self, ns: int) -> None:
        """The frame at `ns` begins a new file; what is before it is on its way to the disk."""
        assert self._writer is not None
        self._writer.checkpoint(sync=False)
        self._replace_writer(self._open_next(anywhere=False))
        self._begin(ns)

    def _replace_writer(self, writer: Writer) -> None:
        """Go on in a new file; the one before is finished."""
        before = self._writer
        assert before is not None
        writer.lead_ns = self._lead_ns
        self._opened = time.monotonic()
        with self._lock:
            self._finished_frames += before.kept
            self._writer = writer
        self._unsaved.clear()
        self.path, self.files, self.bytes = writer.path, self.files + 1, writer.bytes
        self._zero = None
        self._syncing.watch(writer)
        self._syncing.finish(before)

    def _open_next(self, *, anywhere: bool) -> Writer:
        """Open the next file; where its folder is gone (or `anywhere`: cannot be written), in the nearest one above."""
        first: OutputError | None = None
        for folder in self._folders():
            try:
                return self._open_in(folder)
            except OutputError as error:
                first = first or error
                if not anywhere and folder.is_dir():
                    break
        assert first is not None
        raise first

    def _folders(self) -> Iterator[Path]:
        yield self._wanted.parent
        if self.path.parent != self._wanted.parent:
            yield self.path.parent
        yield from self._above

    def _open_in(self, folder: Path) -> Writer:
        if self._series is None:
            here = folder == self._wanted.parent
            return open_new(folder / self._wanted.name, 2 if here else 1)
        if folder == self._wanted.parent:
            return self._series.open_next()
        series = Series(folder / self._wanted.name, self._rotation, self._tell)
        writer = _first_of(series)
        before, self._series = self._series, series
        before.close()
        return writer

    def _begin(self, ns: int) -> None:
        """The current file's own time begins at session time `ns`."""
        assert self._writer is not None
        assert self._start_ns is not None
        self._zero = ns
        self._writer.start_ns = self._start_ns + ns
        self._began(self.path, ns * 1e-9)

    def _note_all(self) -> None:
        while self._notes and self._zero is not None and self._writer is not None:
            event = self._notes.popleft()
            try:
                self._writer.note(event._replace(t=max(event.t - self._zero * 1e-9, 0.0)))
            except ChangedError as error:
                self._leave_changed(str(error))
            except OutputError as error:
                self._fail(str(error))

    def _checkpoint(self) -> None:
        if self._writer is None:
            return
        if not self._writer.waiting and self._writer.bytes == self.bytes:
            return  # nothing has come: flash memory wears out by being written
        if self._syncing.failed:
            self._fail(self._syncing.failed)
            return
        try:
            self._writer.checkpoint(sync=False)
        except ChangedError as error:
            self._leave_changed(str(error))
            return
        except OutputError as error:
            self._fail(str(error))
            return
        self._unsaved.clear()
        self.bytes = self._writer.bytes
        self._syncing.sync(self._writer)

    def _fail(self, why: str) -> None:
        """Give the file up; the live stream does not even notice."""
        writer = self._writer
        if writer is None:
            return
        self._syncing.watch(None)
        writer.abandon()
        # all that a full disk did not take was appended and is gone: the file ends at its last whole container or line
        with self._lock:
            self._finished_frames += writer.kept
            self._writer = None
        self.bytes = writer.bytes
        self.failed = why
        self._tell("recording_failed", why)

    # --- a file that is not where it was ---

    def _is_misplaced(self, writer: Writer, where: Whereabouts, finished: bool) -> None:
        """The syncing thread has found this out; the file being written is the writing thread's."""
        if not finished:
            self._misplaced = writer, where
        elif where.lost:
            if writer.kept or self.path == where.path:
                self._restore(writer, where)
            else:
                writer.disk.close()
        else:
            self._has_moved(writer, where.path)

    def _go_on_elsewhere(self) -> None:
        """Follow the file where it was moved; go on in a new one where it is out of reach."""
        found, self._misplaced = self._misplaced, None
        if found is None or found[0] is not self._writer:
            return
        writer, where = found
        if not where.lost:
            self._has_moved(writer, where.path)
            return
        try:
            writer.checkpoint(sync=False)  # into the file that has no name: it is copied from there
            unsaved = []
        except OutputError:
            unsaved = self._unsaved_of(writer)
        self._leave(
            f"{where.path.name} {where.place.value} while it was being written",
            f"recording_{where.place.name.lower()}",  # recording_deleted, recording_hidden
            unsaved,
        )
        if self.failed:
            self._lose(
                writer.kept,
                f"{where.path.name} {where.place.value}, and no folder takes a copy of its frames",
            )

    def _unsaved_of(self, writer: Writer) -> list[Frame]:
        """Frames that were appended and are not in the file."""
        return self._unsaved[max(len(self._unsaved) - (writer.frames - writer.kept), 0) :]

    def _has_moved(self, writer: Writer, path: Path) -> None:
        before = writer.path
        writer.disk.moved(path)
        # a finished one may have been moved as well
        if writer is self._writer or self.path == before:
            self.path = path
            self._follow(path, (self._zero or 0) * 1e-9)
        goes_on = "the recording goes on there" if writer is self._writer else "it is complete there"
        self._tell("recording_moved", f"{before} was moved to {path} while it was being written: {goes_on}")

    def _leave_changed(self, why: str, frame: Frame | None = None) -> None:
        """Somebody has truncated the file, or written into it: leave it as it is and go on in a new one."""
        writer = self._writer
        if writer is None:
            return
        unsaved = self._unsaved_of(writer)
        taken = bool(unsaved) and unsaved[-1] is frame
        self._leave(why, "recording_changed", unsaved if taken or frame is None else [*unsaved, frame])
        if writer.kept:
            self._lose_changed(writer)

    def _leave(self, why: str, what: str, unsaved: list[Frame]) -> None:
        """Go on in a new file, which begins with the frames that did not reach the one before."""
        unsaved = list(unsaved)
        try:
            writer = self._open_next(anywhere=True)
        except OutputError as error:
            self._fail(f"{why}, and {error}")
            return
        zero = (self._zero or 0) * 1e-9
        self._replace_writer(writer)
        self._follow(self.path, zero)
        self._tell(what, f"{why}: the recording goes on in {self.path}")
        for frame in unsaved:
            self._append(frame)

    # --- the journal's thread ---

    def journal_created(self, path: Path, fd: int) -> None:
        """Note a new journal: it is deleted with its log."""
        if self._series is not None:
            self._series.own(path, fd)

    # --- the syncing thread, and those that copy ---

    def _tend(self) -> None:
        for path in self._series.prune() if self._series else ():
            self._tell("file_deleted", f"the ring is full: {path.name} is deleted")

    def _restore(self, writer: Writer, where: Whereabouts) -> None:
        """Copy a finished file that no name leads to; closes it. A thread of its own: it may have many GB."""

        def copy() -> None:
            self._is_restored(writer, where, restore(writer.disk, where.path, self._folders()))
            writer.disk.close()

        thread = threading.Thread(target=copy, name="canid-restore", daemon=True)
        self._restoring.append(thread)
        thread.start()

    def _is_restored(self, writer: Writer, where: Whereabouts, restored: Restored) -> None:
        frames, name = writer.kept, where.path.name
        if restored.path is None:
            says = (
                f"{name} {where.place.value}, and its {frames:,} frames could not be copied: {restored.why}"
            )
            self._lose(frames, says)
            return
        if self._series is not None:
            self._series.adopt(restored.path)
        if self.path == where.path:  # the last one: it was found out at the end
            self.path = restored.path
            self._follow(self.path, (self._zero or 0) * 1e-9)
        self._tell(
            "recording_restored", f"{name} {where.place.value}: its {frames:,} frames are in {restored.path}"
        )

    def _is_changed(self, writer: Writer) -> None:
        """Nobody knew before it was finished."""
        self._tell("recording_changed", writer.disk.changed)
        self._lose_changed(writer)

    def _lose_changed(self, writer: Writer) -> None:
        says = f"{writer.path.name} was changed by another program: what it held, {writer.kept:,} frames, may be damaged"
        self._lose(writer.kept, says)

    def _lose(self, frames: int, why: str) -> None:
        with self._lock:
            self._finished_frames -= frames
        self.lost = why
        self._tell("recording_lost", why)


def _first_of(series: Series) -> Writer:
    """Begin the first file; a series without one holds no list."""
    try:
        return series.open_next()
    except OutputError:
        series.close()
        raise


def join(thread: threading.Thread, waiting: Callable[[], object]) -> None:
    """Wait for a thread. In turns: a signal's handler runs between them."""
    while thread.is_alive():
        thread.join(PROGRESS_S)
        if thread.is_alive():
            waiting()
