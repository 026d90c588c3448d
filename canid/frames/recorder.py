"""The recorder: one reading thread per bus, one thread that writes, one that waits for the disk.

Nothing that happens further on can cost a frame: readers put frames into a queue without a bound, the writer
appends them to the log and only then passes them on. What was appended reaches the kernel within
`CHECKPOINT`, complete with its header, so a kill costs no more than that; the disk itself is waited for in a
thread of its own.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from struct import error as StructError  # noqa: N812

from canid.errors import BusError, CanidError, OutputError
from canid.frames import bus_load
from canid.frames.bus import ReceiveOnlyBus
from canid.frames.bus_reader import DRAIN, Arrival, BusReader
from canid.frames.journal import Journal
from canid.frames.recorder_stats import BusStats, Stats
from canid.frames.socketcan import meaning
from canid.frames.write import Writer, open_new
from canid.types import Event, Flag, Frame

# s between checkpoints: 250 ms are promised, the rest is for the work itself
CHECKPOINT = 0.2
# s that all buses may be lost before the recorder gives up
ALL_LOST = 5.0
# frames taken at once: bounds the consumer's latency, and the work between two looks at the clock
BATCH = 512
# s that frames are gathered before they are written together: a wake-up for every frame costs ten times the frame
GATHER = 0.005
# s over which rates and loads are told
WINDOW = 1.0
# Several buses do not hand over in the order of their stamps: the file's zero lies this much before the first
# frame, so that one stamped earlier has no negative time.
LEAD_NS = 1_000_000_000
_ERROR = int(Flag.ERROR)

__all__ = ["BusStats", "Consumer", "Recorder", "Stats"]

Consumer = Callable[[Sequence[Frame]], object]


class Recorder:
    """Records buses into a log and passes every frame on, in s since the first frame of any bus.

    `consumer` gets each batch of frames after it was appended to the log. It runs in the writing thread, so
    it must be quick. One that raises is counted and called again with the next batch.
    """

    def __init__(
        self, buses: Sequence[ReceiveOnlyBus], path: str | Path | None, consumer: Consumer | None = None
    ):
        self._wanted = path
        self._consumer = consumer
        self._queue: SimpleQueue[Arrival | None] = SimpleQueue()
        self._stopping = threading.Event()
        self._buses = [
            BusReader(bus, index, self._queue.put, self._stopping, self._tell)
            for index, bus in enumerate(buses)
        ]
        self._writer: Writer | None = None
        self._journal = Journal(None)
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._state = "waiting"
        self._path: Path | None = None
        self._bytes = self._frames = self._written = self._not_passed = 0
        self._rate, self._lag = 0.0, 0.0
        self._first_ns: int | None = None
        self._latest = 0.0
        self._to_sync = threading.Event()
        self._sync_failed = ""
        self._readers: list[threading.Thread] = []
        self._threads: list[threading.Thread] = []

    def start(self) -> Recorder:
        """Create the log and begin.

        Raises OutputError, or ConfigError for an unknown suffix; the buses are closed then.
        """
        if self._wanted is not None:
            try:
                self._writer = open_new(self._wanted)
            except CanidError:
                self._shut()
                raise
            if len(self._buses) > 1:
                self._writer.lead_ns = LEAD_NS
            self._path = self._writer.path
            self._bytes = self._writer.bytes
            self._journal = Journal(self._path)
        self._state = "recording" if self._writer else "listening"
        self._readers = [
            threading.Thread(target=reader.run, name=f"canid-read-{reader.index}", daemon=True)
            for reader in self._buses
        ]
        self._threads = [threading.Thread(target=self._write, name="canid-write", daemon=True)]
        if self._writer:
            self._threads.append(threading.Thread(target=self._sync, name="canid-sync", daemon=True))
        for thread in (*self._threads, *self._readers):
            thread.start()
        return self

    def alive(self) -> bool:
        """Return False once every bus has been lost for `ALL_LOST` s, or after `stop`."""
        if self._stopping.is_set():
            return False
        now = time.monotonic()
        return any(b.lost_at is None or now - b.lost_at < ALL_LOST for b in self._buses)

    def stop(self) -> Stats:
        """Take what the buses still hold, write it, close file and buses: nothing received is lost."""
        self._stopping.set()
        for thread in self._readers:
            thread.join(DRAIN + 1.0)
        self._queue.put(None)
        for thread in self._threads:
            thread.join()
        self._shut()
        return self.stats()

    def journal(self, event: Event) -> None:
        """Write an event beside the log. Any thread may; nothing is raised."""
        self._journal.write(event, self._first_ns)

    def events(self) -> list[Event]:
        """Hand out the recorder's own events since the last call; they stand in the journal already."""
        out = []
        while not self._events.empty():
            out.append(self._events.get())
        return out

    def stats(self) -> Stats:
        """Look at it; any thread may, at any time."""
        buses = tuple(
            BusStats(b.bus.name, b.state, b.frames, b.errors, b.bus.drops, b.load, b.controller)
            for b in self._buses
        )
        return Stats(
            state=self._state,
            path=self._path,
            frames=self._frames,
            written=self._written,
            bytes=self._bytes,
            rate=self._rate,
            errors=sum(b.errors for b in buses),
            drops_bus=sum(b.drops for b in buses),
            drops_estimator=self._not_passed,
            lag=self._lag,
            waiting=self._queue.qsize(),
            start_ns=self._first_ns,
            buses=buses,
        )

    def _shut(self) -> None:
        for each in self._buses:
            try:
                each.bus.shutdown()
            except BusError as error:
                self._tell("bus_close", str(error))

    # --- writing: one thread ---

    def _write(self) -> None:
        checkpoint = window = time.monotonic()
        before = 0
        ended = False
        while not ended:
            batch, ended = self._take(checkpoint + CHECKPOINT - time.monotonic())
            frames = [self._frame(item) for item in batch]
            if frames:
                self._append(frames)
                self._lag = time.monotonic() - batch[0].at
                self._pass_on(frames)
            now = time.monotonic()
            if now - checkpoint >= CHECKPOINT:
                checkpoint = now
                self._checkpoint()
            if now - window >= WINDOW:
                self._rate = (self._frames - before) / (now - window)
                for each in self._buses:
                    each.load, each.busy = each.busy / (now - window), 0.0
                window, before = now, self._frames
        self._close()

    def _take(self, timeout: float) -> tuple[list[Arrival], bool]:
        """Take what waits, up to `BATCH`; True: that was all there will ever be."""
        batch: list[Arrival] = []
        try:
            item = self._queue.get(timeout=max(timeout, 0.0))
            if not self._stopping.is_set():
                time.sleep(GATHER)
            while item is not None:
                batch.append(item)
                if len(batch) == BATCH:
                    return batch, False
                item = self._queue.get_nowait()
        except Empty:
            return batch, False
        return batch, True

    def _frame(self, arrival: Arrival) -> Frame:
        index, _, got = arrival
        if self._first_ns is None:
            self._first_ns = got.ns
            if self._writer is not None:
                self._writer.start_ns = got.ns
        frame = Frame((got.ns - self._first_ns) * 1e-9, index, got.id, got.data, got.flags, got.length)
        each = self._buses[index]
        each.frames += 1
        self._frames += 1
        self._latest = frame.t
        each.busy += bus_load.seconds(frame, each.bus.bitrate, each.bus.data_bitrate)
        if got.flags & _ERROR:
            each.errors += 1
            self._error_frame(each, frame)
        return frame

    def _error_frame(self, each: BusReader, frame: Frame) -> None:
        state = meaning(frame.id, frame.data) if each.bus.interface == "socketcan" else None
        if state is not None and state != each.controller:
            each.controller = state
            self._tell(state, f"{each.bus.name}: the controller reports {state.replace('_', ' ')}")

    def _append(self, frames: list[Frame]) -> None:
        if self._writer is None:
            return
        for frame in frames:
            try:
                self._writer.append(frame)
                self._written += 1
            except (ValueError, StructError) as error:
                # a driver's nonsense, such as 70 data bytes, must not end the recording
                self._tell("not_written", f"a frame with id {frame.id:#x} cannot be written: {error}")
            except OutputError as error:
                self._fail(str(error))
                return

    def _pass_on(self, frames: list[Frame]) -> None:
        if self._consumer is None:
            return
        try:
            self._consumer(frames)
        except Exception as error:  # whatever it is, recording goes on
            if not self._not_passed:
                self._tell("consumer_failed", f"the consumer raised {type(error).__name__}: {error}")
            self._not_passed += len(frames)

    def _checkpoint(self) -> None:
        if self._writer is None:
            return
        if self._sync_failed:
            self._fail(self._sync_failed)
            return
        try:
            self._writer.checkpoint(sync=False)
        except OutputError as error:
            self._fail(str(error))
            return
        self._bytes = self._writer.bytes
        self._to_sync.set()

    def _fail(self, why: str) -> None:
        """Give the file up, keep the live stream."""
        writer, self._writer = self._writer, None
        self._state = f"failed: {why}"
        self._tell("recording_failed", why)
        self._to_sync.set()
        if writer is not None:
            # all that a full disk did not take was appended and is gone: the file ends at its last checkpoint
            self._written = writer.kept
            self._bytes = writer.bytes
            writer.abandon()

    def _close(self) -> None:
        writer, self._writer = self._writer, None
        self._to_sync.set()
        if writer is not None:
            try:
                writer.close()
            except OutputError as error:
                self._state = f"failed: {error}"
                self._tell("recording_failed", str(error))
                return
            self._bytes = writer.bytes
        if not self._state.startswith("failed"):
            self._state = "stopped"

    # --- waiting for the disk: one thread ---

    def _sync(self) -> None:
        while True:
            self._to_sync.wait()
            self._to_sync.clear()
            writer = self._writer
            if writer is None:
                return
            try:
                writer.sync()
            except OutputError as error:
                self._sync_failed = str(error)
            except ValueError:
                return  # closed meanwhile, and closing syncs

    # --- events: any thread ---

    def _tell(self, what: str, says: str) -> None:
        event = Event(self._latest, what, says)
        self._events.put(event)
        self.journal(event)
