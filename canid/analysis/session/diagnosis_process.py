"""The drive so far is diagnosed while it goes on: in a process of its own, with the lowest priority.

`Diagnosing` is the parent's side: the session gives it the samples, which wait packed until a diagnosis is due, and takes
the reports. `main` is the child: it keeps the samples, so that each is sent once, and runs `canid.models.diagnosis`. A child
that dies costs its diagnosis alone: the next one gets all samples again. The report of a whole drive is the one that
`canid diagnose` makes of its log.
"""

from __future__ import annotations

import math
import pickle
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from canid.values.errors import one_line
from canid.values.findings import Report
from canid.values.processes import limits
from canid.values.processes.child import Child, NoAnswerError
from canid.values.processes.child_process import command as child_command
from canid.values.processes.serve import connect
from canid.values.types import Driver, Sample, SignalReport, Trace

# s between two diagnoses
INTERVAL_S = 120.0
# of one core, that they may take on average
CPU_SHARE = 0.1
# samples that are packed together: a minute; unpacked, an hour of them would be 70 MB in a process that records
PACKED = 600
# bytes of memory of its own that the child may have: an hour needs a fifth of it
CHILD_MEMORY_BYTES = 2 * 1024**3
# s after which a diagnosis is taken for hung
LIMIT_S = 1800.0
# diagnoses that fail one after the other before no further one is tried
MAX_FAILURES = 3
# s between two checks of what else ends a wait
POLL_S = 0.1


class DriveSoFar(NamedTuple):
    """One diagnosis."""

    t: float  # s, of the last sample that it rests on
    report: Report


class Diagnosing:
    """Owns the child process and the thread that serves it; `put` and `diagnoses` never wait."""

    def __init__(
        self,
        vehicle: str | Path | Driver,
        *,
        interval_s: float = INTERVAL_S,
        command: Sequence[str] | None = None,
    ) -> None:
        """Nothing is started before the first diagnosis is due.

        Args:
            vehicle: the vehicle file, or its driver.
            interval_s: s between two diagnoses; after a long one more, see `CPU_SHARE`.
            command: of the child; the tests put faulty ones here.
        """
        self._driver = vehicle if isinstance(vehicle, Driver) else str(vehicle)
        self._interval_s = interval_s
        self._command = list(command or child_command("canid.analysis.session.diagnosis_process"))
        self._wake = threading.Condition()
        # since the last part was packed
        self._samples: list[Sample] = []
        self._reports: list[SignalReport] = []
        self._parts: list[bytes] = []
        self._t = -math.inf  # s, of the last sample
        self._asked = self._closing = self._waited_for = False
        self._fresh: list[DriveSoFar] = []
        self._latest: DriveSoFar | None = None
        self._failures = 0
        self.failure = ""  # why no further one is tried
        self._child: Child | None = None
        self._thread = threading.Thread(target=self._run, name="canid-diagnosing", daemon=True)
        self._thread.start()

    def put(self, item: object) -> None:
        """Take an output of the pipeline; what is neither a sample nor a report on the signals is left out."""
        if isinstance(item, Sample):
            with self._wake:
                self._samples.append(item)
                self._t = item.t
                if len(self._samples) >= PACKED:
                    self._pack()
        elif isinstance(item, SignalReport):
            with self._wake:
                self._reports.append(item)

    def ask(self) -> None:
        """Ask for a diagnosis now, or as soon as the one that is being made has ended."""
        with self._wake:
            self._asked = True
            self._wake.notify_all()

    def diagnoses(self) -> list[DriveSoFar]:
        """The diagnoses since the last call."""
        with self._wake:
            fresh, self._fresh = self._fresh, []
        return fresh

    def latest(self) -> DriveSoFar | None:
        """The last diagnosis; None: there is none yet."""
        return self._latest

    def is_whole(self) -> bool:
        """Whether the last diagnosis rests on all samples, or none can follow."""
        last = -math.inf if self._latest is None else self._latest.t
        return bool(self.failure) or last >= self._t

    def finish(self, patience_s: float, stopped: Callable[[], bool] = lambda: False) -> None:
        """Wait for the diagnosis of all samples, at most so many s, or until `stopped()` says so.

        It is begun anew at the ordinary priority: on a busy machine the lowest one gets next to no time.
        """
        deadline = time.monotonic() + patience_s
        with self._wake:
            self._waited_for = True
            if self._child is not None and not self.is_whole():
                self._child.kill()
        self.ask()
        while not self.is_whole() and not stopped() and time.monotonic() < deadline:
            with self._wake:
                self._wake.wait(POLL_S)

    def close(self) -> None:
        """End the child; a second call does nothing."""
        with self._wake:
            self._closing = True
            if self._child is not None:
                self._child.kill()
            self._wake.notify_all()
        self._thread.join()

    # --- the thread ---

    def _pack(self) -> None:
        """With the lock: what has come since the last part, as one."""
        if self._samples or self._reports:
            self._parts.append(pickle.dumps((self._samples, self._reports), protocol=5))
            self._samples, self._reports = [], []

    def _run(self) -> None:
        due, sent, done = time.monotonic() + self._interval_s, 0, -math.inf
        while self._wait(due, done):
            with self._wake:
                self._asked = False
                self._pack()
                parts, t = list(self._parts), self._t
            try:
                if self._child is None:
                    self._start()
                    sent = 0
                report, cpu_s = self._diagnosed(parts[sent:])
            except (NoAnswerError, OSError) as error:
                cpu_s = 0.0
                self._failed(error)
            else:
                sent, done = len(parts), t
                with self._wake:
                    self._failures = 0
                    self._latest = DriveSoFar(t, report)
                    self._fresh.append(self._latest)
                    self._wake.notify_all()
            due = time.monotonic() + max(self._interval_s, cpu_s * (1 / CPU_SHARE - 1))
        if self._child is not None:
            self._child.end()

    def _wait(self, due: float, done: float) -> bool:
        """Wait until a diagnosis is due and there is something new; False: the end."""
        with self._wake:
            while not self._closing and not self.failure:
                left = due - time.monotonic()
                if (self._asked or left <= 0.0) and self._t > done:
                    return True
                self._asked = False  # of the same samples again
                self._wake.wait(left if left > 0.0 else POLL_S)
        return False

    def _start(self) -> None:
        child = Child(self._command)
        limits.limit_data_of(child.pid, CHILD_MEMORY_BYTES)
        if self._waited_for:
            limits.ordinary_priority(child.pid)
        else:
            limits.lowest_priority(child.pid)
        with self._wake:
            self._child = child
            if self._closing:
                child.kill()
        child.write(self._driver)

    def _diagnosed(self, parts: Sequence[bytes]) -> tuple[Report, float]:
        assert self._child is not None
        kind, *answer = self._child.ask(list(parts), LIMIT_S)
        if kind != "report":
            raise NoAnswerError(str(answer[0]), late=False)
        return answer[0], float(answer[1])

    def _failed(self, error: Exception) -> None:
        child, self._child = self._child, None
        begun_anew = (
            child is not None and child.killed and not (isinstance(error, NoAnswerError) and error.late)
        )
        if child is not None:
            child.end()
        with self._wake:
            if begun_anew:
                self._asked = True
            else:
                self._failures += 1
            if self._failures >= MAX_FAILURES:
                self.failure = one_line(error)
            self._wake.notify_all()


def main() -> int:
    """Run as the child: parts of the drive in, a report for each message out, until the input ends."""
    parent = connect()
    from canid.models.diagnosis.diagnose import diagnose
    from canid.models.pipeline.pipeline import DT
    from canid.signals.samples import trace_assembly
    from canid.signals.signal_checks import signal_checks
    from canid.signals.vehicle import read_vehicle

    messages = parent.messages()
    traces: list[Trace] = []
    reports: list[SignalReport] = []
    try:
        driver = next(messages)
        driver = driver if isinstance(driver, Driver) else read_vehicle(driver).driver
        for parts in messages:
            for samples, more in map(pickle.loads, parts):
                traces.append(trace_assembly.trace(samples, driver, DT))
                reports += more
            began = limits.cpu_used_s()
            findings = signal_checks.episodes(reports)
            report = diagnose(trace_assembly.joined(traces)._replace(findings=findings))
            parent.answer(("report", report, limits.cpu_used_s() - began))
    except Exception as error:  # of any kind: the parent says it
        parent.answer(("failed", f"{type(error).__name__}: {one_line(error)}"))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
