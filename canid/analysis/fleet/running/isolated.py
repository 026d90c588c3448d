"""The analysis of logs in a child process with limits: a log that hangs, eats memory or crashes costs itself alone.

A child analyses one log after another, so that its start is paid once. One that was ended or has died is replaced. The child
is `canid.analysis.fleet.running.analysis_process`, which may neither connect nor write outside of its scratch folder; what
it needs of a storage is fetched by another one, `canid.analysis.fleet.one_log.fetch_process`, which is started where a log
is in a storage.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Collection
from typing import Any

from canid.analysis.fleet.failed import NO_MEMORY
from canid.analysis.fleet.job import Failure, Job, Outcome, Source, Status
from canid.analysis.fleet.running.scratch import Scratch
from canid.values.errors import one_line
from canid.values.processes import child_process
from canid.values.processes.child import EXIT_S, EndedError, NoAnswerError, ending
from canid.values.processes.child import Child as ChildProcess

# what the child answers: it can begin; a log is to be fetched; an outcome
READY, FETCH, DONE = "ready", "fetch", "done"
# a child that holds more than this share of the memory it may have, with no log in hand, is replaced
MAX_IDLE_SHARE = 0.5
# with which a child ends that has no memory left to say so: ENOMEM
MEMORY_EXIT_CODE = 12
# s that a child may take to import its mathematics: 2 s on a laptop, 60 s on an emulated machine
START_TIMEOUT_S = 180.0
# how C++ code ends that gets no memory, and with which code glibc's loader ends a process that has none for a thread's data,
# once it held this share of what it may: what it asked for is not counted
_OF_SHORT_MEMORY = (*(-int(number) for number in (signal.SIGSEGV, signal.SIGABRT)), 127)
MIN_PEAK_SHARE = 0.5
_NONSENSE = "ended in the middle of its answer, or answered nonsense"
# Dask sets it in its workers: malloc then gives the memory of each array back to the system, and takes it again, for 17 %
# more CPU time of an analysis. A child's memory has a limit of its own
_GIVE_BACK = "MALLOC_TRIM_THRESHOLD_"


class Child:
    """Owns one child process, started when it is first needed. Of one thread, apart from `close`."""

    def __init__(self) -> None:
        """The child is started when it is first needed."""
        self._running: ChildProcess | None = None
        self._fetching: ChildProcess | None = None
        self._scratch: Scratch | None = None
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
            outcome, idle_bytes = self._asked(running, job, key, source)
        except NoAnswerError as error:
            code = self._stop(EXIT_S)
            if error.late:
                return failed(job, Failure.TIMEOUT, f"it took more than {settings.timeout_s:g} s")
            short = code in _OF_SHORT_MEMORY and running.peak_bytes > MIN_PEAK_SHARE * settings.memory_bytes
            if code == MEMORY_EXIT_CODE or short:
                return failed(job, Failure.MEMORY, NO_MEMORY)
            ended = isinstance(error, EndedError) or code != -getattr(signal, "SIGKILL", 0)
            return failed(job, Failure.CRASHED, f"its process {ending(code) if ended else _NONSENSE}")
        self._sent.add(key)
        if (
            running.killed
            or outcome.failure is Failure.MEMORY
            or idle_bytes > MAX_IDLE_SHARE * settings.memory_bytes
        ):
            self._stop()
        return outcome

    def _asked(self, running: ChildProcess, job: Job, key: str, source: Source) -> tuple[Outcome, int]:
        """The child's outcome, and the bytes that it holds; fetches on the way what it asks for. Raises NoAnswerError."""
        end = time.monotonic() + job.settings.timeout_s
        logs = {each.log: each for each in (job.together or (job,))}
        request: Any = (job, key, None if key in self._sent else source)
        while True:
            answer = running.ask(request, max(end - time.monotonic(), 0.0))
            match answer:
                case (str(kind), str(log)) if kind == FETCH and log in logs:
                    request = self._fetch(
                        logs[log], job.settings.memory_bytes, max(end - time.monotonic(), 0.0)
                    )
                case (str(kind), tuple(fields), int(idle_bytes)) if kind == DONE:
                    return _outcome(job, fields), idle_bytes
                case _:
                    raise NoAnswerError(_NONSENSE, late=False)

    def _fetch(self, job: Job, memory_bytes: int, limit_s: float) -> tuple[str, str, str]:
        """What `fetch_process` answers of a log. Raises NoAnswerError where it takes too long."""
        with self._lock:
            if self._closed:
                return "", Failure.CRASHED.value, "the run was ended"
            try:
                if self._fetching is None:
                    self._fetching = self._child("canid.analysis.fleet.one_log.fetch_process", ())
            except OSError as error:
                reason = f"no process can be started to fetch it ({one_line(error)})"
                return "", Failure.CRASHED.value, reason
            fetching = self._fetching
        try:
            path, failure, reason = fetching.ask((job.log, job.size, job.modified_ns, memory_bytes), limit_s)
        except NoAnswerError as error:
            code = fetching.end(EXIT_S)
            with self._lock:
                self._fetching = None
            if error.late:
                raise
            return "", Failure.CRASHED.value, f"the process that fetches it {ending(code)}"
        return str(path), str(failure), str(reason)

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
        self._scratch = Scratch()
        self._sent = set()
        return self._child("canid.analysis.fleet.running.analysis_process", (Status, Failure))

    def _child(self, module: str, answers: Collection[type]) -> ChildProcess:
        return ChildProcess(
            child_process.command(module, str(os.getpid()), self._scratch.path if self._scratch else ""),
            {name: value for name, value in os.environ.items() if name != _GIVE_BACK},
            answers=answers,
        )

    def _stop(self, patience_s: float = 0.0) -> int | None:
        """End the child, if it has not ended by itself within `patience_s`; its exit code."""
        with self._lock:
            running, self._running = self._running, None
            fetching, self._fetching = self._fetching, None
            scratch, self._scratch = self._scratch, None
        code = None if running is None else running.end(patience_s)
        if fetching is not None:
            fetching.end()
        if scratch is not None:
            scratch.remove()
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


def _outcome(job: Job, fields: tuple[Any, ...]) -> Outcome:
    """The outcome of a log by what a process answers that is not believed: nothing of it names another log.

    Raises:
        NoAnswerError: it is none.
    """
    match fields:
        case (_, str(key), Status() as status, Failure() as failure, str(reason), dict(tables)):
            if all(
                isinstance(rows, list) and all(isinstance(row, dict) for row in rows)
                for rows in tables.values()
            ):
                return Outcome(job.log, key, status, failure, reason, tables)
    raise NoAnswerError(_NONSENSE, late=False)


def failed(job: Job, failure: Failure, reason: str) -> Outcome:
    """The outcome of a log that has no results."""
    return Outcome(job.log, "", Status.FAILED, failure, reason, {})
