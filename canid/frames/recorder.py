"""The recorder: one reading thread per bus, one that passes frames on, and the log's own threads.

Nothing that happens further on can cost a frame: readers put frames into a queue without a bound; from there they
go to the log first and then to whoever looks at them. The log has threads of its own (`log_thread`): a disk that
stalls delays neither the buses nor the estimates.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue

from canid.errors import BusError, CanidError
from canid.frames import bus_load
from canid.frames.bus import ReceiveOnlyBus
from canid.frames.bus_reader import DRAIN, Arrival, BusReader
from canid.frames.journal import Journal
from canid.frames.log_thread import PROGRESS_S, LogThread, join
from canid.frames.recorder_stats import BusStats, Stats
from canid.frames.rotation import Rotation
from canid.frames.socketcan import error_counters, meaning, overflowed
from canid.frames.stamp_clock import StampClock
from canid.types import Event, Flag, Frame

# s that all buses may be lost before the recorder gives up
ALL_LOST = 5.0
# frames taken at once: bounds the consumer's latency, and the work between two looks at the clock
BATCH = 512
# s that frames are gathered before they are passed on together: a wake-up for every frame costs ten times the frame
GATHER = 0.005
# s that the passing thread waits before it looks at its own clock again
TURN = 0.2
# s over which rates and loads are told
WINDOW = 1.0
# Several buses do not hand over in the order of their stamps, nor need frames around a seam: the file's zero lies this
# much before the first frame, so that one stamped earlier has no negative time.
LEAD_NS = 1_000_000_000
# interfaces whose error frames are Linux' own (linux/can/error.h)
LINUX_ERRORS = ("socketcan", "socketcand", "gs_usb")
_ERROR = int(Flag.ERROR)

__all__ = ["BusStats", "Consumer", "Recorder", "Stats"]

Consumer = Callable[[Sequence[Frame]], object]


class Recorder:
    """Records buses into a log and passes every frame on, in s since the first frame of any bus.

    `consumer` gets each batch of frames after it was handed to the log. It must be quick: while it runs, nothing
    more goes to the log. One that raises is counted and called again with the next batch. `rotation`: go on in
    new files; None: one file.
    """

    def __init__(
        self,
        buses: Sequence[ReceiveOnlyBus],
        path: str | Path | None,
        consumer: Consumer | None = None,
        rotation: Rotation | None = None,
    ):
        self._wanted = path
        self._rotation = rotation
        self._consumer = consumer
        self._queue: SimpleQueue[Arrival | None] = SimpleQueue()
        self._stopping = threading.Event()
        self._buses = [
            BusReader(bus, index, self._queue.put, self._stopping, self._tell)
            for index, bus in enumerate(buses)
        ]
        self._log: LogThread | None = None
        self._journal = Journal(None, self._tell)
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._state = "waiting"
        self._frames = self._not_passed = 0
        self._rate, self._lag = 0.0, 0.0
        self._first_ns: int | None = None
        self._latest = 0.0
        self._readers: list[threading.Thread] = []
        self._passing = threading.Thread(target=self._pass, name="canid-pass", daemon=True)

    def start(self) -> Recorder:
        """Create the log and begin.

        Raises OutputError, or ConfigError for an unknown suffix; the buses are closed then.
        """
        if self._wanted is not None:
            lead = LEAD_NS if len(self._buses) > 1 or self._rotation else 0
            try:
                self._log = LogThread(
                    Path(self._wanted),
                    self._rotation,
                    lead,
                    self._tell,
                    self._file_begins,
                    self._journal.follow,
                )
                self._journal.created = self._log.journal_created
            except CanidError:
                self._shut()
                raise
            self._journal.follow(self._log.path, 0.0)
            self._log.start()
        self._state = "recording" if self._log else "listening"
        self._readers = [
            threading.Thread(target=reader.run, name=f"canid-read-{reader.index}", daemon=True)
            for reader in self._buses
        ]
        for thread in (self._passing, *self._readers):
            thread.start()
        return self

    def alive(self) -> bool:
        """Return False once every bus has been lost for `ALL_LOST` s, or after `stop`."""
        if self._stopping.is_set():
            return False
        now = time.monotonic()
        return any(b.lost_at is None or now - b.lost_at < ALL_LOST for b in self._buses)

    def stop(self, progress: Callable[[Stats], object] = lambda stats: None) -> Stats:
        """Take what the buses still hold, write it, close file and buses: nothing received is lost.

        That waits for the disk, however long it takes. `progress` gets the state a few times a second meanwhile, in
        this thread; what it raises ends the waiting, and a signal's handler may end the process.
        """

        def waiting() -> None:
            progress(self.stats())

        self._state = "stopping"
        self._stopping.set()
        deadline = time.monotonic() + DRAIN + 1.0
        for thread in self._readers:
            while thread.is_alive() and time.monotonic() < deadline:
                thread.join(PROGRESS_S)
                waiting()
        self._queue.put(None)
        join(self._passing, waiting)
        self._drops()
        if self._log is not None:
            self._log.close(waiting)
        self._state = "stopped"
        self._shut()
        self._journal.close()
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
            BusStats(
                b.bus.name,
                b.state,
                b.frames,
                b.errors,
                b.bus.drops,
                b.load,
                b.controller,
                b.clock.name.lower(),
                tec=b.counters[0] if b.counters else None,
                rec=b.counters[1] if b.counters else None,
                impossible=b.bus.impossible,
            )
            for b in self._buses
        )
        log = self._log
        return Stats(
            state=self._state_told(),
            path=log.path if log else None,
            frames=self._frames,
            written=log.written if log else 0,
            bytes=log.bytes if log else 0,
            rate=self._rate,
            errors=sum(b.errors for b in buses),
            drops_bus=sum(b.drops for b in buses),
            drops_estimator=self._not_passed,
            lag=max(self._lag, log.lag if log else 0.0),
            waiting=self._queue.qsize() + (log.waiting if log else 0),
            start_ns=self._first_ns,
            buses=buses,
            files=log.files if log else 0,
            drops_disk=log.dropped if log else 0,
            events_unwritten=self._journal.failed,
        )

    def _state_told(self) -> str:
        log = self._log
        if log is not None and log.failed:
            return f"failed: {log.failed}"
        if log is not None and log.lost and self._state == "stopped":
            return f"failed: {log.lost}"  # the recording itself went on
        return self._state

    def _shut(self) -> None:
        for each in self._buses:
            try:
                each.bus.shutdown()
            except BusError as error:
                self._tell("bus_close", str(error))

    # --- passing on: one thread ---

    def _pass(self) -> None:
        window = time.monotonic()
        before = 0
        ended = False
        while not ended:
            batch, ended = self._take(TURN)
            frames = self._stamped(batch)
            if frames:
                if self._log is not None and self._first_ns is not None:
                    self._log.put(frames, batch[0].at, self._first_ns)
                self._lag = time.monotonic() - batch[0].at
                self._pass_on(frames)
            now = time.monotonic()
            if now - window >= WINDOW:
                self._rate = (self._frames - before) / (now - window)
                for each in self._buses:
                    each.load, each.busy = each.busy / (now - window), 0.0
                window, before = now, self._frames
                self._drops()

    def _take(self, timeout: float) -> tuple[list[Arrival], bool]:
        """Take what waits, up to `BATCH`; True: that was all there will ever be."""
        batch: list[Arrival] = []
        try:
            # before Python 3.13 a signal may make this wait last until the next frame: of no harm in this thread
            item = self._queue.get(timeout=timeout)
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

    def _stamped(self, batch: list[Arrival]) -> list[Frame]:
        frames = []
        for item in batch:
            try:
                frames.append(self._frame(item))
            except Exception as error:  # a back end's nonsense must cost no other frame
                name = self._buses[item.bus].bus.name
                self._tell("not_understood", f"{name}: a frame cannot be understood: {error}")
        return frames

    def _frame(self, arrival: Arrival) -> Frame:
        index, got = arrival.bus, arrival.frame
        if self._first_ns is None:
            self._first_ns = got.ns
        frame = Frame((got.ns - self._first_ns) * 1e-9, index, got.id, got.data, got.flags, got.length)
        each = self._buses[index]
        each.busy += bus_load.seconds(frame, each.bus.bitrate, each.bus.data_bitrate)
        self._latest = frame.t
        self._look_at_clock(each, got.ns, arrival.at)
        each.frames += 1
        self._frames += 1
        if got.flags & _ERROR:
            each.errors += 1
            self._error_frame(each, frame)
        return frame

    def _error_frame(self, each: BusReader, frame: Frame) -> None:
        if each.bus.interface in LINUX_ERRORS:
            each.counters = error_counters(frame.id, frame.data) or each.counters
            each.controller_is(meaning(frame.id, frame.data) or "")
            each.overflows += overflowed(frame.id, frame.data)

    def _look_at_clock(self, each: BusReader, ns: int, at: float) -> None:
        step = each.watch.look(ns, at)
        if step:
            says = f"{each.bus.name}: the clock that stamps the frames stepped by {step:+.2f} s"
            self._tell("clock_step", says)
        clock = each.bus.clock
        if clock not in (each.clock, StampClock.UNKNOWN):
            each.clock = clock
            self._note_clock(each, self._latest)

    def _note_clock(self, each: BusReader, t: float) -> None:
        """The log says whose times it holds."""
        if self._log is not None and each.clock is not StampClock.UNKNOWN:
            says = f"{each.bus.name}: times are stamped by {each.clock.value}"
            self._log.note(Event(t, "stamp_clock", says))

    def _file_begins(self, path: Path, zero: float) -> None:
        self._journal.follow(path, zero)
        if zero:  # the first one gets it with the first frame of each bus
            for each in self._buses:
                self._note_clock(each, zero)

    def _pass_on(self, frames: list[Frame]) -> None:
        if self._consumer is None:
            return
        try:
            self._consumer(frames)
        except Exception as error:  # whatever it is, recording goes on
            if not self._not_passed:
                self._tell("consumer_failed", f"the consumer raised {type(error).__name__}: {error}")
            self._not_passed += len(frames)

    def _drops(self) -> None:
        """Tell what the kernel has dropped since the last look."""
        for each in self._buses:
            drops = each.bus.drops
            if drops > each.drops_told:
                self._tell(
                    "frames_dropped",
                    f"{each.bus.name}: {drops - each.drops_told:,} frames were dropped before canid could read them"
                    f" ({drops:,} in all)",
                )
                each.drops_told = drops
            if each.overflows > each.overflows_told:
                times = each.overflows - each.overflows_told
                self._tell(
                    "rx_overflow",
                    f"{each.bus.name}: the controller's own receive buffer overflowed ({times:,} error frames,"
                    f" {each.overflows:,} in all); nobody counts the frames that were lost there",
                )
                each.overflows_told = each.overflows

    # --- events: any thread ---

    def _tell(self, what: str, says: str) -> None:
        event = Event(self._latest, what, says)
        self._events.put(event)
        self.journal(event)
        if self._log is not None:
            self._log.note(event)
