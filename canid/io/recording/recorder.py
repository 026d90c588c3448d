"""The recorder: one reading thread per bus, one that passes frames on, and the log's own threads.

Readers put frames into a queue (`arrivals`: a minute of a full bus); from there they go to the log first and then to the
consumer. The log has threads of its own (`log_writer_thread`): a disk that stalls delays neither the buses nor
the estimates.

Each attribute is written by one thread alone, by assignment; the others only read it:

- the caller's thread (`start`, `stop`): `_log`, `_state`, `_readers`;
- `canid-pass` (`_pass_frames`): `_frames`, `_not_passed`, `_not_understood`, `_rate`, `_lag`, `_first_ns`, `_latest`,
  `_latest_at`;
- `canid-read-N`: the attributes of its own `BusReader`; its frames come through `_arrivals`;
- any thread: `_events`, `_stopping` and the journal, which are safe for that.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue

import numpy as np

from canid.io.buses.bus import ReceiveOnlyBus
from canid.io.buses.bus_reader import Arrival, BusReader
from canid.io.buses.draining import MAX_DRAIN_S
from canid.io.buses.receivers.many_messages import GATHER_S
from canid.io.buses.receivers.socketcan import error_counters, meaning, overflowed
from canid.io.buses.timestamp_source import TimestampSource
from canid.io.files.held_folder import HeldFolder
from canid.io.recording import bus_load
from canid.io.recording.arrivals import Arrivals
from canid.io.recording.clock_events import ClockEvents, against_this_computer
from canid.io.recording.controls import Mark
from canid.io.recording.journal import Journal
from canid.io.recording.log_writer_thread import CHECKPOINT_S, LogWriterThread
from canid.io.recording.recorder_stats import BusStats, Stats
from canid.io.recording.rotation import Rotation
from canid.io.recording.thread_join import PROGRESS_S, join
from canid.io.recording.trigger_gate import TriggerGate, TriggerStats
from canid.values import frame_columns
from canid.values.bus_names import of_open_buses
from canid.values.errors import BusError, CanidError
from canid.values.types import Array, Columns, Event, Flag

# s that all buses may be lost before the recorder gives up
ALL_LOST_TIMEOUT_S = 5.0
# frames taken at once: bounds the consumer's latency, and the work between two readings of the clock
BATCH_FRAMES = 4096
# s that frames of several buses are gathered before they are passed on together, in the order of their stamps; those of
# one bus come together already
BATCH_WAIT_S = 0.01
# s that the passing thread waits before it checks its own clock again
QUEUE_TIMEOUT_S = 0.2
# s over which rates and loads are averaged
RATE_WINDOW_S = 1.0
# interfaces whose error frames are Linux' own (linux/can/error.h)
LINUX_ERRORS = ("socketcan", "socketcand", "gs_usb")
_ERROR = int(Flag.ERROR)

__all__ = ["BusStats", "Consumer", "Recorder", "Stats"]

Consumer = Callable[[Columns], object]


class Recorder:
    """Records buses into a log and passes every frame on, in s since the first frame of any bus.

    `consumer` is called with each batch of frames after it was handed to the log. It must be fast: while it runs,
    nothing more goes to the log. Frames for which it raises are counted; it is called again with the next batch.
    `rotation`: go on in new files; None: one file. `gate`: record what is around triggers only; None: everything.
    `prompt`: somebody waits for what the consumer makes of the frames.
    """

    def __init__(
        self,
        buses: Sequence[ReceiveOnlyBus],
        path: str | Path | None,
        consumer: Consumer | None = None,
        rotation: Rotation | None = None,
        gate: TriggerGate | None = None,
        *,
        prompt: bool = True,
    ):
        self._wanted = path
        self._gate = gate
        self._rotation = rotation
        self._consumer = consumer
        self._arrivals = Arrivals()
        self._stopping = threading.Event()
        # where only the disk waits for the frames of one bus, as long as between two checkpoints
        waited_for = len(buses) > 1 or (consumer is not None and prompt)
        self._gather = GATHER_S if waited_for else CHECKPOINT_S
        numbers = of_open_buses([bus.channel for bus in buses])
        self._buses = [
            BusReader(bus, index, self._arrivals.put, self._stopping, self._report, self._gather, number)
            for index, (bus, number) in enumerate(zip(buses, numbers, strict=True))
        ]
        self._clocks = ClockEvents(self._buses, self._report)
        self._log: LogWriterThread | None = None
        self._journal = Journal(None, self._report)
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._state = "waiting"
        self._frames = self._not_passed = self._not_understood = 0
        self._rate, self._lag = 0.0, 0.0
        self._first_ns: int | None = None
        self._latest = 0.0  # s of the drive, of the latest frame
        self._latest_at = math.inf  # s, monotonic clock: when it was received
        self._readers: list[threading.Thread] = []
        self._passing = threading.Thread(target=self._pass_frames, name="canid-pass", daemon=True)

    def start(self) -> Recorder:
        """Create the log and begin.

        Raises OutputError, or ConfigError for an unknown suffix; the buses are closed then.
        """
        if self._wanted is not None:
            try:
                self._log = LogWriterThread(
                    Path(self._wanted),
                    self._rotation,
                    self._report,
                    self._file_begins,
                    self._journal.follow,
                )
                self._journal.created = self._log.files.folders.own_journal
                self._log.files.folders.keep_journals(self._journal.in_use)
            except CanidError:
                self._shut()
                raise
            self._journal.follow(self._log.files.path, 0.0, self._log.files.folder)
            self._log.start()
            if self._gate is not None:
                self._gate.bind(self._log, self._announce)
                self._report("trigger_armed", self._gate.says)
        self._state = "recording" if self._log else "listening"
        self._readers = [
            threading.Thread(target=reader.run, name=f"canid-read-{reader.index}", daemon=True)
            for reader in self._buses
        ]
        for thread in (self._passing, *self._readers):
            thread.start()
        return self

    def alive(self) -> bool:
        """Return False once every bus has been lost for `ALL_LOST_TIMEOUT_S` s, or after `stop`."""
        if self._stopping.is_set():
            return False
        now = time.monotonic()
        return any(b.lost_at is None or now - b.lost_at < ALL_LOST_TIMEOUT_S for b in self._buses)

    def stop(self, progress: Callable[[Stats], object] = lambda stats: None) -> Stats:
        """Drain the buses, write everything, close file and buses: nothing received is lost.

        That waits for the disk, however long it takes. `progress` gets the state a few times a second, in
        this thread; what it raises ends the waiting, and a signal's handler may end the process.
        """

        def waiting() -> None:
            progress(self.stats())

        self._state = "stopping"
        self._stopping.set()
        deadline = time.monotonic() + MAX_DRAIN_S + 1.0
        for thread in self._readers:
            while thread.is_alive() and time.monotonic() < deadline:
                thread.join(PROGRESS_S)
                waiting()
        self._arrivals.end()
        join(self._passing, waiting)
        self._report_drops()
        self._clocks.since_the_last_call()
        if self._log is not None:
            if self._gate is not None:
                self._gate.finish(waiting)
            self._log.close(waiting)
        self._state = "stopped"
        self._shut()
        self._journal.close()
        return self.stats()

    def journal(self, event: Event) -> None:
        """Write an event to the journal next to the log. Any thread may; nothing is raised."""
        self._journal.write(event, self._first_ns)

    def mark(self, mark: Mark) -> None:
        """Write a person's mark into the log and the journal, at the time of the drive at which it was made."""
        text = f": {mark.text}" if mark.text else ""
        # the frames of its time may not have been read yet
        t = max(self._latest + min(mark.at - self._latest_at, self._gather), 0.0)
        self._report("mark", f"mark{text}", t=t)
        if self._gate is not None:
            self._gate.mark(t, f"mark{text}")

    def events(self) -> list[Event]:
        """The recorder's own events since the last call; they are in the journal already."""
        out = []
        while not self._events.empty():
            out.append(self._events.get())
        return out

    def stats(self) -> Stats:
        """The present state; any thread may call this at any time."""
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
        trigger = self._gate.stats() if self._gate is not None and log else None
        return Stats(
            state=self._state_text(trigger),
            path=log.files.path if log else None,
            frames=self._frames,
            written=log.files.written if log else 0,
            bytes=log.files.bytes if log else 0,
            rate=self._rate,
            errors=sum(b.errors for b in buses),
            drops_bus=sum(b.drops for b in buses),
            drops_estimator=self._not_passed,
            lag=max(self._lag, log.lag if log else 0.0),
            waiting=self._in_queue() + (log.waiting if log else 0),
            start_ns=self._first_ns,
            buses=buses,
            files=log.files.count if log else 0,
            drops_disk=self._arrivals.dropped + (log.dropped if log else 0),
            events_unwritten=self._journal.failed,
            trigger=trigger,
            hidden=log.files.hidden if log else "",
        )

    def _in_queue(self) -> int:
        received = sum(each.received for each in self._buses)
        return max(received - self._frames - self._not_understood - self._arrivals.dropped, 0)

    def _state_text(self, trigger: TriggerStats | None) -> str:
        log = self._log
        if log is not None and log.files.failed:
            return f"failed: {log.files.failed}"
        if log is not None and log.files.lost and self._state == "stopped":
            return f"failed: {log.files.lost}"  # the recording itself went on
        if trigger is not None and self._state == "recording":
            return f"recording (trigger: {trigger.condition})" if trigger.condition else "armed"
        return self._state

    def _shut(self) -> None:
        for each in self._buses:
            try:
                each.bus.shutdown()
            except BusError as error:
                self._report("bus_close", str(error))

    # --- passing on: one thread ---

    def _pass_frames(self) -> None:
        window = time.monotonic()
        before = 0
        ended = False
        while not ended:
            batch, ended = self._take(QUEUE_TIMEOUT_S)
            frames = self._stamped(batch)
            if frames is not None:
                if self._log is not None and self._first_ns is not None:
                    (self._gate or self._log).put(frames, batch[0].at, self._first_ns)
                self._lag = time.monotonic() - batch[0].at
                self._pass_on(frames)
            elif self._gate is not None:
                self._gate.tick()
            now = time.monotonic()
            if now - window >= RATE_WINDOW_S:
                self._rate = (self._frames - before) / (now - window)
                for each in self._buses:
                    each.load, each.busy = each.busy / (now - window), 0.0
                window, before = now, self._frames
                self._report_drops()
                self._clocks.since_the_last_call()

    def _take(self, timeout: float) -> tuple[list[Arrival], bool]:
        """Take what is in the queue, up to `BATCH_FRAMES`; True: these are the last ones."""
        batch: list[Arrival] = []
        n = 0
        try:
            # before Python 3.13 a signal may make this wait last until the next frame: of no harm in this thread
            item = self._arrivals.get(timeout)
            if len(self._buses) > 1 and not self._stopping.is_set():
                time.sleep(BATCH_WAIT_S)
            while item is not None:
                batch.append(item)
                n += len(item.frames.ns)
                if n >= BATCH_FRAMES:
                    return batch, False
                item = self._arrivals.get(0.0)
        except Empty:
            return batch, False
        return batch, True

    def _stamped(self, batch: list[Arrival]) -> Columns | None:
        """The frames in session time, those of several buses in the order of their stamps; None: there are none."""
        parts: list[Columns] = []
        for item in batch:
            try:
                parts.append(self._part(item))
            except Exception as error:  # invalid frames of a back end must cost no others
                self._not_understood += len(item.frames.ns)
                name = self._buses[item.bus].bus.name
                self._report("not_understood", f"{name}: frames cannot be understood: {error}")
        if not parts:
            return None
        chunk = frame_columns.join(parts)
        if any(item.bus != batch[0].bus for item in batch):
            # each bus keeps its own order, whatever its stamps: a frame's place is that of its bus's latest stamp so far
            place = np.empty(len(chunk.t))
            for index in {item.bus for item in batch}:
                of_bus = chunk.bus == self._buses[index].number
                place[of_bus] = np.maximum.accumulate(chunk.t[of_bus])
            chunk = frame_columns.select(chunk, np.argsort(place, kind="stable"))
        self._latest, self._latest_at = float(chunk.t[-1]), batch[-1].at
        return chunk

    def _part(self, arrival: Arrival) -> Columns:
        index, (ns, id_, flags, length, data) = arrival.bus, arrival.frames
        if self._first_ns is None:
            self._first_ns = int(ns[0])
        each = self._buses[index]
        bus = np.full(len(ns), each.number, np.uint16)
        t: Array = np.multiply(ns - self._first_ns, 1e-9)
        part = Columns(t, bus, id_, flags, length, data)
        each.busy += bus_load.seconds(part, each.bus.bitrate, each.bus.data_bitrate)
        self._latest = float(part.t[-1])
        self._clocks.received(arrival)
        clock = each.bus.clock
        if clock not in (each.clock, TimestampSource.UNKNOWN):
            each.clock = clock
            self._note_clock(each, float(part.t[0]), against_this_computer(int(ns[0]), arrival.at))
        each.frames += len(ns)
        self._frames += len(ns)
        if np.bitwise_or.reduce(flags) & _ERROR:
            for row in np.flatnonzero(flags & _ERROR).tolist():
                each.errors += 1
                self._error_frame(each, int(id_[row]), data[row, : length[row]].tobytes())
        return part

    def _error_frame(self, each: BusReader, id_: int, data: bytes) -> None:
        if each.bus.interface in LINUX_ERRORS:
            each.counters = error_counters(id_, data) or each.counters
            each.controller_is(meaning(id_, data) or "")
            each.overflows += overflowed(id_, data)

    def _note_clock(self, each: BusReader, t: float, offset: str = "") -> None:
        """Note in the log which clock stamps its frames."""
        if self._log is not None and each.clock is not TimestampSource.UNKNOWN:
            says = f"{each.bus.name}: times are stamped by {each.clock.value}{offset}"
            self._log.files.note(Event(t, "stamp_clock", says))

    def _file_begins(self, path: Path, zero: float, folder: HeldFolder) -> None:
        self._journal.follow(path, zero, folder)
        if zero:  # the first one gets it with the first frame of each bus
            for each in self._buses:
                self._note_clock(each, zero)

    def _pass_on(self, frames: Columns) -> None:
        if self._consumer is None:
            return
        try:
            self._consumer(frames)
        except Exception as error:  # of any kind: recording goes on
            if not self._not_passed:
                self._report("consumer_failed", f"the consumer raised {type(error).__name__}: {error}")
            self._not_passed += len(frames.t)
            if self._gate is not None:
                self._gate.give_up()  # which frames were evaluated is not known any more

    def _report_drops(self) -> None:
        """Report what the kernel has dropped since the last call."""
        for each in self._buses:
            drops = each.bus.drops
            if drops > each.drops_reported:
                self._report(
                    "frames_dropped",
                    f"{each.bus.name}: {drops - each.drops_reported:,} frames were dropped before canid could read them"
                    f" ({drops:,} in all)",
                )
                each.drops_reported = drops
            if each.overflows > each.overflows_reported:
                times = each.overflows - each.overflows_reported
                self._report(
                    "rx_overflow",
                    f"{each.bus.name}: the controller's own receive buffer overflowed ({times:,} error frames,"
                    f" {each.overflows:,} in all); the frames that were lost there are not counted",
                )
                each.overflows_reported = each.overflows

        for bus, count, first_ns, last_ns in self._arrivals.dropped_since_the_last_call():
            zero = first_ns if self._first_ns is None else self._first_ns
            first, last = (1e-9 * (ns - zero) for ns in (first_ns, last_ns))
            self._report(
                "frames_not_recorded",
                f"{self._buses[bus].bus.name}: {count:,} frames from {first:.6f} s to {last:.6f} s are not in the log: the"
                " computer was too busy, or a consumer of frames took too long",
            )

    # --- events: any thread ---

    def _report(self, what: str, says: str, t: float | None = None) -> None:
        event = Event(self._latest if t is None else t, what, says)
        self._announce(event)
        if self._log is not None:
            self._log.files.note(event)
        if self._gate is not None and what in self._gate.own_events:
            self._gate.mark(event.t, f"event {what}")

    def _announce(self, event: Event) -> None:
        self._events.put(event)
        self.journal(event)
