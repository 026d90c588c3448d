"""The thread that writes the log: a bounded queue of frames, emptied into `LogFiles` at every checkpoint.

The threads that put frames never wait for it. A frame reaches the kernel within `CHECKPOINT_S`, in a file that is
complete with its header, so that a kill costs no more. While a disk does not keep up, or takes no file, up to
`MAX_WAITING_FRAMES` wait in memory; what is beyond that is dropped, counted, and noted in the log itself.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from canid.io.recording.log_files import Follow, LogFiles
from canid.io.recording.rotation import Rotation
from canid.io.recording.thread_join import join
from canid.values import frame_columns
from canid.values.frame_columns import rows
from canid.values.types import Columns, Event

# s between checkpoints: 250 ms are promised, the rest is for the work itself and a machine that is busy
CHECKPOINT_S = 0.15
# the same for frames that were gathered for half of that or longer before they were put, and for those put up to so long
# behind them: more than one call of the system can return
GATHERED_CHECKPOINT_S = 0.03
GATHERED_S = 0.05
# Frames that may wait for a disk that stalls: a minute of a full 1 Mbit/s bus (8,000 frames/s), 12 MB (40 MB of CAN FD).
MAX_WAITING_FRAMES = 480_000
# Frames between two readings of the clock while the queue is emptied, from and to: a late checkpoint must not wait for all
# of it, and a writer that is fast costs less per frame the more it gets.
FRAMES_PER_TURN, MAX_FRAMES_PER_TURN = 256, 4096
# trials to write what waits at the end, of a disk that fails now and then
_LAST_TRIES = 5


class LogWriterThread:
    """Queue and thread of one recording; `files` are what it writes. The callbacks are those of `LogFiles`."""

    def __init__(
        self,
        wanted: Path,
        rotation: Rotation | None,
        report: Callable[[str, str], object],
        began: Follow,
        follow: Follow = lambda path, zero, folder: None,
    ):
        self.files = LogFiles(wanted, rotation, report, began, follow)
        self.dropped = 0  # frames that were not queued because too many waited
        self._report = report
        # with the time of arrival, monotonic clock
        self._queue: deque[tuple[float, Columns | Event]] = deque()
        self._waiting = 0  # frames in `_queue`, and those being written
        self._oldest: float | None = None  # arrival of the oldest frame that is being written
        self._late = 0.0
        self._turn = FRAMES_PER_TURN
        self._dropping: list[float] = []  # s, times of the first and the last one of those dropped in a row
        self._dropped_in_row = 0
        self._lock = threading.Lock()
        self._filled = threading.Event()  # there is something to write
        # s, monotonic clock: when the latest frames came, and the latest of those that were gathered
        self._put_at = self._gathered_at = -math.inf
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="canid-write", daemon=True)

    def start(self) -> None:
        """Begin."""
        self.files.start()
        self._thread.start()

    def put(self, chunk: Columns, at: float, start_ns: int) -> None:
        """Queue frames that arrived at `at` (monotonic clock); never waits. `start_ns`: epoch ns of their t = 0."""
        n = len(chunk.t)
        if at - self._put_at > CHECKPOINT_S / 2:
            self._gathered_at = at
        self._put_at = at
        with self._lock:
            self.files.start_ns = start_ns
            room = min(max(MAX_WAITING_FRAMES - self.waiting, 0), n)
            if room:
                self._queue.append((at, chunk if room == n else rows(chunk, 0, room)))
                self._waiting += room
                self._filled.set()
        if room and self._dropping:
            self._report_dropped()
        if room < n:
            self._drop(chunk.t[room:].tolist())

    def put_event(self, event: Event) -> None:
        """Queue an event of the log itself, to stand between the frames before and after it; never waits."""
        with self._lock:
            self._queue.append((time.monotonic(), event))

    @property
    def waiting(self) -> int:
        """Frames that were put and not written yet."""
        return self._waiting + self.files.errors.waiting

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
        self._filled.set()
        join(self._thread, waiting)
        self.files.close(waiting)

    # --- the caller's thread ---

    def _drop(self, times: list[float]) -> None:
        if not self._dropping:
            self._report(
                "disk_too_slow",
                f"the disk has taken nothing for {self.lag:.0f} s: frames are dropped from here on",
            )
            self._dropping = [times[0], times[0]]
        self._dropping[1] = times[-1]
        self.dropped += len(times)
        self._dropped_in_row += len(times)

    def _report_dropped(self) -> None:
        first, last = self._dropping
        self._report(
            "frames_not_recorded",
            f"{self._dropped_in_row:,} frames from {first:.6f} s to {last:.6f} s are not in the log: "
            f"{self.files.errors.says or 'the disk was too slow'}",
        )
        self._dropping, self._dropped_in_row = [], 0

    # --- the writing thread ---

    def _run(self) -> None:
        due = time.monotonic()
        ending = False
        while not ending:
            self._filled.wait(CHECKPOINT_S)
            now = time.monotonic()
            pause = GATHERED_CHECKPOINT_S if now - self._gathered_at < GATHERED_S else CHECKPOINT_S
            due = max(due + pause, now)
            ending = self._ending.wait(due - now)
            self._filled.clear()
            try:
                due = self._write(due)
            except Exception as error:  # of any kind: a recording must never end in silence
                self._lose_taken(error)
        for _ in range(_LAST_TRIES):
            if not self.waiting or not self.files.errors.resume(at_once=True):
                break
            self._write(due)
        self.files.write_notes(last=True)
        self._drop_rest()

    def _write(self, due: float) -> float:
        self.files.leave_displaced()
        if self.files.errors.resume():
            due = self._write_queue(due)
            self.files.checkpoint()
        return due

    def _lose_taken(self, error: Exception) -> None:
        """What was being written when canid itself failed is lost, and counted."""
        with self._lock:
            taken = self._waiting - sum(len(item.t) for _, item in self._queue if not isinstance(item, Event))
            self._waiting -= taken
        self.dropped += taken
        self.files.errors.leave(error)

    def _drop_rest(self) -> None:
        """The end has come, and no file takes what waits."""
        held = self.files.errors.held
        with self._lock:
            held += [item for _, item in self._queue if not isinstance(item, Event)]
            self._queue.clear()
            self._waiting = 0
        if held:
            rest = frame_columns.join(held)
            held.clear()
            self._drop(rest.t.tolist())
            self._report_dropped()

    def _write_queue(self, due: float) -> float:
        """Append what waits now, with checkpoints where that takes long; returns when the last one was due."""
        late = 0.0
        left = len(self._queue)
        while left and self.files.writer is not None:
            taken, chunk = self._take(left)
            left -= taken
            self.files.write_notes()
            if isinstance(chunk, Event):
                self.files.note(chunk)
                self.files.write_notes()
                continue
            begin, n = 0, len(chunk.t)
            while begin < n:
                end = min(begin + self._turn, n)
                began = time.monotonic()
                self.files.append(rows(chunk, begin, end))
                now = time.monotonic()
                self._adapt(now - began, end - begin)
                if now - due > CHECKPOINT_S:
                    self.files.checkpoint()
                    due = time.monotonic()
                with self._lock:
                    self._waiting -= end - begin
                begin = end
            assert self._oldest is not None
            late = max(late, time.monotonic() - self._oldest)
        self._oldest = None
        self._late = late
        return due

    def _adapt(self, took: float, count: int) -> None:
        """Let a turn take no more than a share of the time between two checkpoints."""
        if took > CHECKPOINT_S / 4:
            self._turn = max(self._turn // 2, FRAMES_PER_TURN)
        elif count == self._turn and took < CHECKPOINT_S / 20:
            self._turn = min(2 * self._turn, MAX_FRAMES_PER_TURN)

    def _take(self, most: int) -> tuple[int, Columns | Event]:
        """Take an event, or frames that follow each other, from up to `most` entries; returns how many it were."""
        parts: list[Columns] = []
        n = 0
        with self._lock:
            while len(parts) < most and n < MAX_FRAMES_PER_TURN:
                at, item = self._queue[0]
                if isinstance(item, Event):
                    if parts:
                        break
                    self._queue.popleft()
                    return 1, item
                if not parts:
                    self._oldest = at
                self._queue.popleft()
                parts.append(item)
                n += len(item.t)
        return len(parts), frame_columns.join(parts)
