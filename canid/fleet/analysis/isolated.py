"""The analysis of logs in a child process with limits: a log that hangs, eats memory or crashes costs itself alone.

A child analyses one log after another, so that its start is paid once. One that was ended or has died is replaced. The child
is `canid.fleet.analysis.analysis_process`.
"""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import threading

from canid.fleet.analysis.failed import NO_MEMORY
from canid.fleet.analysis.job import Failure, Job, Outcome, Source, Status
from canid.processes import child_process
from canid.processes.child import EXIT_S, NoAnswerError, ending
from canid.processes.child import Child as ChildProcess
from canid.values.errors import one_line

# a child that holds more than this share of the memory it may have, with no log in hand, is replaced
MAX_IDLE_SHARE = 0.5
# with which a child ends that has no memory left to say so: ENOMEM
MEMORY_EXIT_CODE = 12
# s that a child may take to import its mathematics: 2 s on a laptop, 60 s on an emulated machine
START_TIMEOUT_S = 180.0
# how C++ code ends that gets no memory, once it held this share of what it may: what it asked for is not counted
_OF_SHORT_MEMORY = tuple(-int(number) for number in (signal.SIGSEGV, signal.SIGABRT))
MIN_PEAK_SHARE = 0.5
# Dask sets it in its workers: malloc then gives the memory of each array back to the system, and takes it again, for 17 %
# more CPU time of an analysis. A child's memory has a limit of its own
_GIVE_BACK = "MALLOC_TRIM_THRESHOLD_"


class Child:
    """Owns one child process, started when it is first needed. Of one thread, apart from `close`."""

    def __init__(self) -> None:
        """The child is started when it is first needed."""
        self._running: ChildProcess | None = None
        self._scratch = ""
        self._sent: set[str] = set()  # sources that this child has
        self._lock = threading.Lock()
        self._closed = False

    @property
    def pid(self) -> int | None:
        """Of the child; None: there is none just now."""
        running = self._running
        return None if running is None else running.pid

    def analyse(self, job: Job, source: Source) -> Outcome:
        """Analyse one log in the child; see `analysis.analyse`.

        Args:
            job: the log, its settings and its limits.
            source: how it is decoded; sent once to each child.

        Returns:
            the outcome; `timeout`, `memory` or `crashed` where the child was ended or has died.
        """
        running, why = self._ready()
        if running is None:
            return failed(job, Failure.CRASHED, f"no process can be started to analyse it ({why})")
        settings = job.settings
        key = f"{job.source} {source.fingerprint}"
        try:
            answer, idle_bytes = running.ask(
                (job, key, None if key in self._sent else source), settings.timeout_s
            )
        except NoAnswerError as error:
            code = self._stop(EXIT_S)
            if error.late:
                return failed(job, Failure.TIMEOUT, f"it took more than {settings.timeout_s:g} s")
            short = code in _OF_SHORT_MEMORY and running.peak_bytes > MIN_PEAK_SHARE * settings.memory_bytes
            if code == MEMORY_EXIT_CODE or short:
                return failed(job, Failure.MEMORY, NO_MEMORY)
            return failed(job, Failure.CRASHED, f"its process {ending(code)}")
        self._sent.add(key)
        outcome, idle_share = Outcome(*answer), idle_bytes / settings.memory_bytes
        if running.killed or outcome.failure is Failure.MEMORY or idle_share > MAX_IDLE_SHARE:
            self._stop()
        return outcome

    def close(self) -> None:
        """End the child at once, from whatever thread; nothing is started after it."""
        with self._lock:
            self._closed = True
        self._stop()

    def _ready(self) -> tuple[ChildProcess | None, str]:
        """The child, started and ready where there was none; or None, and why."""
        with self._lock:
            if self._closed:
                return None, "the run was ended"
            if self._running is not None:
                return self._running, ""
            try:
                running = self._running = self._started()
            except OSError as error:
                return None, one_line(error)
        try:
            running.receive(START_TIMEOUT_S)
        except NoAnswerError as error:
            code = self._stop(EXIT_S)
            late = f"it did not start within {START_TIMEOUT_S:g} s"
            return None, late if error.late else f"it {ending(code)}"
        return running, ""

    def _started(self) -> ChildProcess:
        self._scratch = tempfile.mkdtemp(prefix="canid-fleet-")
        self._sent = set()
        return ChildProcess(
            child_process.command("canid.fleet.analysis.analysis_process", str(os.getpid()), self._scratch),
            {name: value for name, value in os.environ.items() if name != _GIVE_BACK},
        )

    def _stop(self, patience_s: float = 0.0) -> int | None:
        """End the child, if it has not ended by itself within `patience_s`; its exit code."""
        with self._lock:
            running, self._running = self._running, None
            scratch, self._scratch = self._scratch, ""
        code = None if running is None else running.end(patience_s)
        if scratch:
            shutil.rmtree(scratch, ignore_errors=True)
        return code


class Children:
    """A child for each thread that asks."""

    def __init__(self) -> None:
        """No child is started before a thread asks."""
        self._of_thread = threading.local()
        self._all: list[Child] = []
        self._lock = threading.Lock()
        self._closed = False

    def analyse(self, job: Job, source: Source) -> Outcome:
        """Analyse one log in this thread's child; see `Child.analyse`."""
        child: Child | None = getattr(self._of_thread, "child", None)
        if child is None:
            child = self._of_thread.child = Child()
            with self._lock:
                self._all.append(child)
                closed = self._closed
            if closed:
                child.close()
        return child.analyse(job, source)

    @property
    def closed(self) -> bool:
        """Whether they were ended: a log that was in hand then has no outcome of its own."""
        return self._closed

    def close(self) -> None:
        """End all children at once."""
        with self._lock:
            self._closed = True
            children = list(self._all)
        for child in children:
            child.close()


def failed(job: Job, failure: Failure, reason: str) -> Outcome:
    """The outcome of a log that has no results."""
    return Outcome(job.log, "", Status.FAILED, failure, reason, {})
