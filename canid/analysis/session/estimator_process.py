"""The live loop: the estimators in a process of their own, where they may raise, hang or die, and cost no frame.

`Estimating` is the parent's side, used by `canid.analysis.session.session`; `main` is the child: it runs
`canid.models.pipeline.pipeline`. Frames go to the child over its standard input as columns, every `CHUNK_S`; outputs come
back over its standard output, both pickled. The child is restarted when it dies or does not answer; what it had in hand is
lost for the estimates, never for the recording, and is counted. What it knows it hands over now and then; the next child
goes on from there.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from canid.signals.triggers.trigger import Trigger
from canid.values.errors import CanidError
from canid.values.frame_columns import join, rows
from canid.values.processes import limits
from canid.values.processes.child import Child, EndedError
from canid.values.processes.child_process import command as child_command
from canid.values.processes.serve import Connection, connect
from canid.values.types import Columns, Event

if TYPE_CHECKING:
    from canid.analysis.contents.signal_tables import SignalTables
    from canid.signals.vehicle import Vehicle
    from canid.values.signal_table import SignalTable

# frames waiting for a child that starts or lags: 25 s of a full 500 kbit/s bus, 3 MB (8 MB of CAN FD)
MAX_WAITING_FRAMES = 100_000
# s between two chunks of frames, at least: a chunk costs 1 to 2 ms however few frames it has, and samples are 0.3 to
# 0.6 s old by design. 0.05 s costs less at low rates, but brings the slowest 1 % of estimates past 0.1 s at 8,000
# frames/s (`python -m benchmarks live`)
CHUNK_S = 0.03
# frames of a chunk at most: 50 ms at 8,000 frames/s. Where so many wait, the next chunk follows at once
MAX_CHUNK_FRAMES = 400
# s without an answer to frames that were sent, before the child is taken for hung; a refit takes 10 ms on a laptop,
# and 200 frames with several refits more than 5 s on an emulated machine
ANSWER_TIMEOUT_S = 20.0
# s that a child may take to import its mathematics: 3 s on a laptop, 60 s on an emulated machine
START_TIMEOUT_S = 180.0
# s between restarts of a child that keeps dying: the last one is repeated
RESTART_DELAYS_S = (0.0, 1.0, 2.0, 5.0, 10.0)
# bytes of memory of its own that a child may have: four times what it needs; what takes more has no end
CHILD_MEMORY_BYTES = 1024**3
# s that a thread may take to see that its child was ended by force
KILL_TIMEOUT_S = 1.0
# s between two checks for a child that hangs
HANG_CHECK_S = 0.2
# s between two tables of signals: a person reads no faster
TABLE_INTERVAL_S = 1.0
# of one core, that the tables may take on average; of a car with more signals they come less often
TABLE_CPU_SHARE = 0.02
# the message that asks for one
ASK_TABLE = "table"


# of rows [start, stop), and the text of the condition
Run = tuple[int, int, str]
OnTruth = Callable[[int, Sequence[Run] | None], object]


class Counts(NamedTuple):
    """What became of the frames that were offered."""

    offered: int
    done: int
    dropped: int  # there was no room, or the child died with them
    restarts: int
    ready: bool


class Estimating:
    """Owns the child process and the three threads that serve it."""

    def __init__(
        self,
        vehicle: str,
        on_output: Callable[[float, Any], None],
        command: Sequence[str] | None = None,
        state: bytes | None = None,
        trigger: Trigger | None = None,
        on_truth: OnTruth | None = None,
        interfaces: Mapping[str, int] = MappingProxyType({}),
        module: str = "canid.analysis.session.estimator_process",
        *,
        tables: bool = False,
    ) -> None:
        """Start the child.

        Args:
            vehicle: path of the vehicle file.
            on_output: called, from a thread, with the time of the frame that completed it and each Sample,
                Estimate, Screened and Event.
            command: of the child; the tests put faulty ones here.
            state: that was saved before, to go on from.
            trigger: whose conditions the child evaluates for every frame.
            on_truth: called with a number of frames, in the order in which they were offered, and the runs of them for
                which a trigger condition is true; None: they will never be evaluated.
            interfaces: names -> numbers of the buses, for a vehicle file that names them.
            module: that the child runs; `canid.analysis.session.trigger_process` evaluates the conditions alone.
            tables: tables of all signals may be asked for.
        """
        self.state = state  # the newest one
        more = json.dumps({"trigger": trigger, "interfaces": dict(interfaces), "tables": tables})
        self._command = list(command or child_command(module, vehicle, more))
        self._on_output = on_output
        self._on_truth = on_truth
        self._order: deque[list[int]] = (
            deque()
        )  # frames offered and not answered for: [kept 1 or dropped 0, how many]
        self._waiting: deque[Columns] = deque()
        self._held = 0  # frames in it
        self._wake = threading.Condition()
        self._offered = self._sent = self._done = self._dropped = self._lost = self._restarts = 0
        self._closing = self._finished = self._ended = False
        self._ready = False
        self._latest = 0.0  # s, session time of the newest frame
        self._answered = time.monotonic()
        self.counters: dict[str, int] = {}
        self.missing: list[str] = []
        self.output = self.scale = ""
        self._tables, self._table_asked, self._table_due = tables, False, 0.0
        self._table: SignalTable | None = None
        self._child: Child | None = None
        self._thread = threading.Thread(target=self._supervise, name="canid-estimating", daemon=True)
        self._thread.start()

    def put(self, chunk: Columns) -> None:
        """Offer frames; never blocks. Without room the new ones are dropped, and counted."""
        n = len(chunk.t)
        if not n:
            return
        with self._wake:
            taken = min(max(MAX_WAITING_FRAMES - self._held, 0), n)
            self._offered += n
            self._latest = float(chunk.t[-1])
            self._dropped += n - taken
            if taken:
                self._waiting.append(chunk if taken == n else rows(chunk, 0, taken))
                self._held += taken
            if self._on_truth is not None:
                self._offer(1, taken)
                self._offer(0, n - taken)
                self._pass_dropped()
            self._wake.notify()

    def _take(self, most: int) -> Columns | None:
        """Take up to `most` of the frames that wait, with the lock; None: there are none."""
        parts: list[Columns] = []
        while self._waiting and most:
            chunk = self._waiting.popleft()
            n = min(len(chunk.t), most)
            if n < len(chunk.t):
                self._waiting.appendleft(rows(chunk, n, len(chunk.t)))
            parts.append(rows(chunk, 0, n))
            most -= n
            self._held -= n
        return join(parts) if parts else None

    def ask_table(self) -> None:
        """Ask for a table of all signals; too soon after the last one this does nothing."""
        if self._tables and time.monotonic() >= self._table_due:
            with self._wake:
                self._table_due = time.monotonic() + TABLE_INTERVAL_S
                self._table_asked = True
                self._wake.notify()

    def take_table(self) -> SignalTable | None:
        """The newest table, where it was not taken before."""
        table, self._table = self._table, None
        return table

    def counts(self) -> Counts:
        """Return the counts so far."""
        return Counts(
            self._offered, self._done - self._lost, self._dropped + self._lost, self._restarts, self._ready
        )

    def close(self, timeout: float) -> bool:
        """Let the child finish what was offered, at most `timeout` s, then end it. Returns False where it was ended.

        What it did not get to is counted as dropped. A second call does nothing.
        """
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(timeout)
        clean = not self._thread.is_alive()
        if not clean:
            self._ended = True
            if self._child is not None:
                self._child.kill()
            self._thread.join(KILL_TIMEOUT_S)
        return clean

    # --- truth of the trigger conditions, with the lock ---

    def _offer(self, kept: int, n: int) -> None:
        if self._order and self._order[-1][0] == kept:
            self._order[-1][1] += n
        elif n:
            self._order.append([kept, n])

    def _pass_dropped(self) -> None:
        while self._on_truth is not None and self._order and not self._order[0][0]:
            self._on_truth(self._order.popleft()[1], None)

    def _pass_truth(self, n: int, runs: Sequence[Run] | None) -> None:
        """Pass on what is known of the next `n` frames that were sent; those dropped in between were not evaluated."""
        if self._on_truth is None:
            return
        with self._wake:
            begin = 0
            while begin < n and self._order:
                part = min(n - begin, self._order[0][1])
                end = begin + part
                inside = runs and [
                    (max(a, begin) - begin, min(b, end) - begin, says)
                    for a, b, says in runs
                    if a < end and b > begin
                ]
                self._on_truth(part, inside)
                begin = end
                self._order[0][1] -= part
                if not self._order[0][1]:
                    self._order.popleft()
                self._pass_dropped()

    # --- the threads ---

    def _supervise(self) -> None:
        while True:
            given = self.state
            try:
                self._run_child(given)
            except OSError as error:  # no memory for a process, say
                self._why = error.strerror or str(error)
            if self._finished:
                return
            if self.state is given:
                # it may be this state that has ended the child: no other one shall begin with it
                self.state = None
            lost = self._sent - self._done
            self._lost += lost
            self._done = self._sent
            self._pass_truth(lost, None)
            if self._closing:
                # there is no time for another child: what still waits is missing in the estimates as well
                with self._wake:
                    while (rest := self._take(self._held)) is not None:
                        self._dropped += len(rest.t)
                if not self._ended:
                    self._on_output(
                        self._latest, Event(self._latest, "estimator_ended", f"the estimator: {self._why}")
                    )
                return
            wait = RESTART_DELAYS_S[min(self._restarts, len(RESTART_DELAYS_S) - 1)]
            self._restarts += 1
            says = f"the estimator is restarted ({self._why}); {lost} frames are missing in the estimates"
            self._on_output(self._latest, Event(self._latest, "estimator_restarted", says))
            with self._wake:
                self._wake.wait_for(lambda: self._closing, wait)

    def _run_child(self, state: bytes | None) -> None:
        self._why = "it ended"
        self._ready = False
        self._answered = time.monotonic()
        self._child = child = Child(self._command)
        limits.limit_data_of(child.pid, CHILD_MEMORY_BYTES)
        limits.ordinary_priority(child.pid)
        feeder = threading.Thread(target=self._feed, args=(child, state), daemon=True)
        watcher = threading.Thread(target=self._watch, args=(child,), daemon=True)
        feeder.start()
        watcher.start()
        try:
            self._collect(child)
        finally:
            child.kill()
            with self._wake:
                self._wake.notify_all()
            feeder.join()
            watcher.join()
            child.end()

    def _collect(self, child: Child) -> None:
        while True:
            try:
                kind, payload = child.receive()
                if kind == "out":
                    done, outputs, counters, missing, *truth = payload
                    runs, answered = _runs(truth), max(min(done, self._sent - self._done), 0)
                    self.counters, self.missing = dict(counters), list(missing)
                    self._done += done
                    self._pass_truth(answered, runs)
                    for t, item in outputs:
                        self._on_output(t, item)
                elif kind == "state":
                    self.state = bytes(payload)
                elif kind == "table":
                    self._table = payload
                    due = self._table_due - TABLE_INTERVAL_S + payload.cpu_s / TABLE_CPU_SHARE
                    self._table_due = max(self._table_due, due)
                elif kind == "event":
                    # the child does not know what time it is before it has seen a frame
                    self._on_output(self._latest, payload._replace(t=self._latest))
            except EndedError:
                return
            except Exception:  # of any kind: it may be no message, or one of another kind
                self._why = "it answers nonsense"
                return
            self._answered = time.monotonic()
            if kind == "ready":
                self._ready, self.output = True, payload or ""
            elif kind == "scale":
                self.scale = payload
            elif kind == "failed":
                self._why = payload
            elif kind == "end":
                self._finished = True

    def _feed(self, child: Child, state: bytes | None) -> None:
        sent_at = -CHUNK_S
        try:
            if state is not None:
                child.write(state)
            while child.running:
                with self._wake:
                    self._wake.wait_for(
                        lambda: self._waiting or self._closing or self._table_asked or not child.running,
                        timeout=1.0,
                    )
                if self._held < MAX_CHUNK_FRAMES and not self._closing:
                    time.sleep(max(sent_at + CHUNK_S - time.monotonic(), 0.0))
                with self._wake:
                    chunk = self._take(MAX_CHUNK_FRAMES)
                    end = self._closing and chunk is None
                    table_asked, self._table_asked = self._table_asked, False
                if chunk is not None:
                    sent_at = time.monotonic()
                    if self._sent == self._done:
                        # nothing was outstanding: the wait for an answer begins now
                        self._answered = sent_at
                    self._sent += len(chunk.t)
                    child.write(tuple(chunk))
                if table_asked:
                    child.write(ASK_TABLE)
                if end:
                    break
        except OSError:
            pass  # the child is gone: the collector sees it too
        finally:
            with suppress(OSError):
                child.stdin.close()

    def _watch(self, child: Child) -> None:
        while child.running:
            time.sleep(HANG_CHECK_S)
            silent = time.monotonic() - self._answered
            outstanding = self._sent > self._done
            if (self._ready and outstanding and silent > ANSWER_TIMEOUT_S) or (
                not self._ready and silent > START_TIMEOUT_S
            ):
                self._why = f"no answer for {silent:.0f} s"
                child.kill()
                return


def _runs(truth: Sequence[Any]) -> list[Run] | None:
    """The runs in a child's answer; None: it evaluates nothing."""
    if not truth or truth[0] is None:
        return None
    return [(int(start), int(stop), str(says)) for start, stop, says in truth[0]]


# (arguments, the parent, to whom answers go as (kind, payload))
Work = Callable[[list[str], Connection], None]


def main() -> int:
    """Run as the child: frames in, outputs out, until the input ends."""
    return serve(_estimate)


def serve(work: Work) -> int:
    """Run as a child: `work` answers what comes over standard input; what it raises is the last answer."""
    parent = connect()
    try:
        work(sys.argv[1:], parent)
    except Exception as error:
        import traceback

        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{os.path.basename(where.filename)}, line {where.lineno}"
        parent.answer(("failed", f"{type(error).__name__}: {error} ({place})"))
        return 1
    return 0


class Asked(NamedTuple):
    """What the parent asks for."""

    vehicle: Vehicle  # on the buses of the session
    trigger: Trigger | None
    tables: SignalTables | None


def asked(arguments: Sequence[str]) -> Asked:
    """What the parent's arguments ask for."""
    from canid.signals.vehicle import on_buses
    from canid.signals.vehicle.vehicle_file import with_databases

    name, *more = arguments
    settings = json.loads(more[0]) if more else {"trigger": None, "interfaces": {}, "tables": False}
    trigger = settings["trigger"]
    if trigger is not None:
        conditions, pre, post = trigger
        trigger = Trigger(tuple(conditions), pre, post)
    vehicle, databases = with_databases(name)
    tables = None
    if settings["tables"]:
        from canid.analysis.contents.signal_tables import SignalTables

        tables = SignalTables(vehicle, databases, settings["interfaces"])
    return Asked(on_buses(vehicle, settings["interfaces"]), trigger, tables)


def _estimate(arguments: list[str], parent: Connection) -> None:
    """Chunks of frames, or a saved state, from the parent through the pipeline, until it ends."""
    from canid.models.pipeline import pipeline
    from canid.models.saving.saved_state import SAVE_INTERVAL_S, resume, saver
    from canid.signals.signal_checks.output_scale import before_a_drive
    from canid.signals.triggers.evaluation import watch
    from canid.signals.vehicle import missing

    vehicle, trigger, tables = asked(arguments)
    running = pipeline.build(vehicle)
    saving = saver(vehicle, running)
    state = running.init()
    watching = watch(trigger, vehicle) if trigger is not None else None
    parent.answer(("scale", before_a_drive(vehicle.driver.full_scale)))
    parent.answer(("ready", vehicle.driver.output))

    def hand_over() -> None:
        known = pipeline.known(state)
        try:
            if known is not None:
                parent.answer(("state", saving.save(known, time.time())))
        except CanidError as error:
            parent.answer(("event", Event(0.0, "state_not_saved", str(error))))

    due = time.monotonic() + SAVE_INTERVAL_S
    for message in parent.messages():
        if isinstance(message, bytes):
            state, event = resume(running, saving, message, time.time())
            parent.answer(("event", event))
            continue
        if message == ASK_TABLE:
            if tables is not None:
                parent.answer(("table", tables.table()))
            continue
        chunk = Columns(*message)
        state, out = running.step(state, chunk)
        runs, never = watching.step(chunk, out) if watching is not None else (None, [])
        decoding = state.sampler.decoding
        outputs = [(float(chunk.t[row]), item) for row, item in out]
        lacking = missing(vehicle, decoding)
        lacking += [line for line in never if line not in lacking]
        answer = (len(chunk.t), outputs, dict(decoding.counters), lacking, runs)
        parent.answer(("out", answer))
        if tables is not None:
            tables.take(chunk)
        if time.monotonic() >= due:
            due = time.monotonic() + SAVE_INTERVAL_S
            hand_over()
    hand_over()
    parent.answer(("end", None))


if __name__ == "__main__":
    sys.exit(main())
