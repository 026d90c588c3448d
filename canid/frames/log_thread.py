"""Writing the log in a thread of its own, for which nobody waits; `syncing` is another, for the disk itself.

What is put here reaches the kernel within `CHECKPOINT`, complete with its header, so that a kill costs no more.
A disk that does not keep up makes frames wait in memory, up to `ROOM`; what is beyond that is dropped, counted,
and told in the log itself.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from struct import error as StructError  # noqa: N812

from canid.errors import OutputError
from canid.frames.rotation import Rotation, full
from canid.frames.series import Series
from canid.frames.syncing import Syncing
from canid.frames.write import Writer, open_new
from canid.types import Event, Frame

# s between checkpoints: 250 ms are promised, the rest is for the work itself and a machine that is busy
CHECKPOINT = 0.15
# Frames that may wait for a disk that stalls: a minute of a full 1 Mbit/s bus (8,000 frames/s), some 120 MB.
ROOM = 480_000
# ns that a frame may be stamped before its file's first one; not more often than this does a clock begin a new file
EARLIEST = 1_000_000_000


class LogThread:
    """Owns the file, or the files one after the other.

    `tell(what, says)` takes events, from any thread; `began(path, zero)` is called where a file begins, with the
    session time of its first frame.
    """

    def __init__(
        self,
        wanted: Path,
        rotation: Rotation | None,
        lead_ns: int,
        tell: Callable[[str, str], object],
        began: Callable[[Path, float], object],
    ):
        self._wanted = wanted
        self._rotation = rotation or Rotation()
        self._opened = time.monotonic()
        self._lead_ns = lead_ns
        self._tell = tell
        self._began = began
        self._series = Series(wanted, rotation) if rotation else None
        self._writer: Writer | None = self._series.open_next() if self._series else open_new(wanted)
        self._writer.lead_ns = lead_ns
        self.path = self._writer.path
        self.files = 1
        self.dropped = 0  # frames for which there was no room
        self.bytes = self._writer.bytes  # in the current file
        self.failed = ""  # why the file was given up
        self.written = 0  # frames appended; once the recording has failed, those that are in the files
        self._start_ns: int | None = None  # epoch ns of session time 0
        self._zero: int | None = None  # ns, session time of the file's first frame; None: it has none yet
        # with the time of arrival, monotonic clock
        self._waiting: deque[tuple[float, Sequence[Frame]]] = deque()
        self._count = 0  # frames in `_waiting`, and those in hand
        self._in_hand: float | None = None  # arrival of the oldest one that is being written
        self._late = 0.0
        self._dropping: list[Frame] = []  # the first and the last one of those dropped in a row
        self._dropped_in_row = 0
        self._notes: deque[Event] = deque()
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._syncing = Syncing(self._prune)
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

    def close(self) -> None:
        """Write what waits, close, and wait until it is on the disk."""
        if self._dropping:
            self._dropped_so_far()
        self._ending.set()
        self._thread.join()
        last = self._writer
        if last is not None:
            self._syncing.finish(last)
        self._syncing.close()
        if last is not None:
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
                self._take()
                self._checkpoint()
            except Exception as error:  # of any kind: a recording must never end in silence
                self._fail(f"{type(error).__name__}: {error}")
        self._note_all()

    def _take(self) -> None:
        """Append what waits now."""
        late = 0.0
        for _ in range(len(self._waiting)):
            with self._lock:
                self._in_hand, frames = self._waiting.popleft()
            self._note_all()
            for frame in frames:
                self._append(frame)
            with self._lock:
                self._count -= len(frames)
            late = max(late, time.monotonic() - self._in_hand)
        self._in_hand = None
        self._late = late

    def _append(self, frame: Frame) -> None:
        if self._writer is None:
            return
        try:
            ns = round(frame.t * 1e9)
            if self._zero is None:
                self._begin(ns)
            elif self._due(ns):
                self._next_file(ns)
            if self._zero:
                frame = frame._replace(t=(ns - self._zero) * 1e-9)
            self._writer.append(frame)
            self.written += 1
        except (ValueError, StructError) as error:
            # a driver's nonsense, such as 70 data bytes, must not end the recording
            self._tell("not_written", f"a frame with id {frame.id:#x} cannot be written: {error}")
        except OutputError as error:
            self._fail(str(error))

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
        before = self._writer
        assert before is not None
        before.checkpoint(sync=False)
        self._writer = self._series.open_next() if self._series else open_new(self._wanted)
        self._opened = time.monotonic()
        self._writer.lead_ns = self._lead_ns
        self.path, self.files = self._writer.path, self.files + 1
        self._syncing.finish(before)
        self._begin(ns)

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
        except OutputError as error:
            self._fail(str(error))
            return
        self.bytes = self._writer.bytes
        self._syncing.sync(self._writer)

    def _prune(self) -> None:
        for path in self._series.prune() if self._series else ():
            self._tell("file_deleted", f"the ring is full: {path.name} is deleted")

    def _fail(self, why: str) -> None:
        """Give the file up; the live stream does not even notice."""
        writer, self._writer = self._writer, None
        if writer is None:
            return
        # all that a full disk did not take was appended and is gone: the file ends at its last whole container
        self.written -= writer.frames - writer.kept
        self.bytes = writer.bytes
        self.failed = why
        writer.abandon()
        self._tell("recording_failed", why)
