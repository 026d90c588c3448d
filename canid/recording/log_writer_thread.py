"""The thread that writes the log: a bounded queue of frames, emptied into `LogFiles` at every checkpoint.

The threads that put frames never wait for it. A frame reaches the kernel within `CHECKPOINT_S`, in a file that is
complete with its header, so that a kill costs no more. While a disk does not keep up, up to `MAX_WAITING_FRAMES` wait
in memory; what is beyond that is dropped, counted, and noted in the log itself.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

from canid.recording.log_files import LogFiles
from canid.recording.rotation import Rotation
from canid.recording.thread_join import join
from canid.types import Event, Frame

# s between checkpoints: 250 ms are promised, the rest is for the work itself and a machine that is busy
CHECKPOINT_S = 0.15
# Frames that may wait for a disk that stalls: a minute of a full 1 Mbit/s bus (8,000 frames/s), some 120 MB.
MAX_WAITING_FRAMES = 480_000
# Frames between two readings of the clock while the queue is emptied: a late checkpoint must not wait for all of it
FRAMES_PER_TURN = 256


class LogWriterThread:
    """Queue and thread of one recording; `files` are what it writes. The callbacks are those of `LogFiles`."""

    def __init__(
        self,
        wanted: Path,
        rotation: Rotation | None,
        lead_ns: int,
        report: Callable[[str, str], object],
        began: Callable[[Path, float], object],
        follow: Callable[[Path, float], object] = lambda path, zero: None,
    ):
        self.files = LogFiles(wanted, rotation, lead_ns, report, began, follow)
        self.dropped = 0  # frames that were not queued because too many waited
        self._report = report
        # with the time of arrival, monotonic clock
        self._queue: deque[tuple[float, Sequence[Frame] | Event]] = deque()
        self._waiting = 0  # frames in `_queue`, and those being written
        self._oldest: float | None = None  # arrival of the oldest frame that is being written
        self._late = 0.0
        self._dropping: list[Frame] = []  # the first and the last one of those dropped in a row
        self._dropped_in_row = 0
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="canid-write", daemon=True)

    def start(self) -> None:
        """Begin."""
        self.files.start()
        self._thread.start()

    def put(self, frames: Sequence[Frame], at: float, start_ns: int) -> None:
        """Queue frames that arrived at `at` (monotonic clock); never waits. `start_ns`: epoch ns of their t = 0."""
        if self.files.failed:
            return
        with self._lock:
            self.files.start_ns = start_ns
            taken = frames[: max(MAX_WAITING_FRAMES - self._waiting, 0)]
            if taken:
                self._queue.append((at, taken))
                self._waiting += len(taken)
        if taken and self._dropping:
            self._report_dropped()
        if len(taken) < len(frames):
            self._drop(frames[len(taken) :])

    def put_event(self, event: Event) -> None:
        """Queue an event of the log itself, to stand between the frames before and after it; never waits."""
        with self._lock:
            self._queue.append((time.monotonic(), event))

    @property
    def waiting(self) -> int:
        """Frames that were put and not written yet."""
        return self._waiting

    @property
    def lag(self) -> float:
        """S from a frame's arrival to its writing: the latest that was written, or the oldest that waits now."""
        oldest = self._oldest
        if oldest is None:
            with self._lock:
                oldest = self._queue[0][0] if self._queue else None
        return max(self._late, time.monotonic() - oldest if oldest is not None else 0.0)

    def close(self, waiting: Callable[[], object] = lambda: None) -> None:
        """Write the queue, close, and wait until all is on the disk, however long the disk takes.

        `waiting` is called a few times a second; what it raises ends the waiting.
        """
        if self._dropping:
            self._report_dropped()
        self._ending.set()
        join(self._thread, waiting)
        self.files.close(waiting)

    # --- the caller's thread ---

    def _drop(self, frames: Sequence[Frame]) -> None:
        if not self._dropping:
            self._report(
                "disk_too_slow",
                f"the disk takes nothing for {self.lag:.0f} s: frames are dropped from here on",
            )
            self._dropping = [frames[0], frames[0]]
        self._dropping[1] = frames[-1]
        self.dropped += len(frames)
        self._dropped_in_row += len(frames)

    def _report_dropped(self) -> None:
        first, last = self._dropping
        self._report(
            "frames_not_recorded",
            f"{self._dropped_in_row:,} frames from {first.t:.6f} s to {last.t:.6f} s are not in the log: "
            "the disk was too slow",
        )
        self._dropping, self._dropped_in_row = [], 0

    # --- the writing thread ---

    def _run(self) -> None:
        due = time.monotonic()
        ending = False
        while not ending:
            due = max(due + CHECKPOINT_S, time.monotonic())
            ending = self._ending.wait(due - time.monotonic())
            try:
                self.files.leave_displaced()
                due = self._write_queue(due)
                self.files.checkpoint()
            except Exception as error:  # of any kind: a recording must never end in silence
                self.files.fail(f"{type(error).__name__}: {error}")
        self.files.write_notes(last=True)

    def _write_queue(self, due: float) -> float:
        """Append what waits now, with checkpoints where that takes long; returns when the last one was due."""
        late = 0.0
        for _ in range(len(self._queue)):
            with self._lock:
                self._oldest, frames = self._queue.popleft()
            if isinstance(frames, Event):
                self.files.note(frames)
            self.files.write_notes()
            if isinstance(frames, Event):
                continue
            for begin in range(0, len(frames), FRAMES_PER_TURN):
                for frame in frames[begin : begin + FRAMES_PER_TURN]:
                    self.files.append(frame)
                if time.monotonic() - due > CHECKPOINT_S:
                    self.files.checkpoint()
                    due = time.monotonic()
            with self._lock:
                self._waiting -= len(frames)
            late = max(late, time.monotonic() - self._oldest)
        self._oldest = None
        self._late = late
        return due
