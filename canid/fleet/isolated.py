"""The analysis of logs in a child process with limits: a log that hangs, eats memory or crashes costs itself alone.

A child analyses one log after another, so that its start is paid once. One that was ended or has died is replaced. The child
is `canid.fleet.analysis_process`.
"""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from canid import child_process
from canid.errors import one_line
from canid.fleet.failed import NO_MEMORY
from canid.fleet.job import Failure, Job, Outcome, Source, Status

# a child that holds more than this share of the memory it may have, with no log in hand, is replaced
MAX_IDLE_SHARE = 0.5
# with which a child ends that has no memory left to say so: ENOMEM
MEMORY_EXIT_CODE = 12
# s that a child may take to import its mathematics: 2 s on a laptop, 60 s on an emulated machine
START_TIMEOUT_S = 180.0
# s between the end of a child's output and its own, at most
EXIT_S = 1.0
# s between two checks whether it has ended
EXIT_CHECK_S = 0.005
# how C++ code ends that gets no memory, once it held this share of what it may: what it asked for is not counted
_OF_SHORT_MEMORY = tuple(-int(number) for number in (signal.SIGSEGV, signal.SIGABRT))
MIN_PEAK_SHARE = 0.5
# s that a child which was ended by force may take to be gone
KILL_TIMEOUT_S = 5.0
# Dask sets it in its workers: malloc then gives the memory of each array back to the system, and takes it again, for 17 %
# more CPU time of an analysis. A child's memory has a limit of its own
_GIVE_BACK = "MALLOC_TRIM_THRESHOLD_"


class Child:
    """Owns one child process, started when it is first needed. Of one thread, apart from `close`."""

    def __init__(self) -> None:
        """The child is started when it is first needed."""
        self._running: subprocess.Popen[bytes] | None = None
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
        child, why = self._ready()
        if child is None:
            return failed(job, Failure.CRASHED, f"no process can be started to analyse it ({why})")
        limit = job.settings.timeout_s
        answer, ended = _within(limit, child, lambda: self._asked(child, job, source))
        if answer is None:
            code, peak_bytes = self._stop(EXIT_S)
            if ended:
                return failed(job, Failure.TIMEOUT, f"it took more than {limit:g} s")
            short = code in _OF_SHORT_MEMORY and peak_bytes > MIN_PEAK_SHARE * job.settings.memory_bytes
            if code == MEMORY_EXIT_CODE or short:
                return failed(job, Failure.MEMORY, NO_MEMORY)
            return failed(job, Failure.CRASHED, f"its process {_ending(code)}")
        outcome, idle_bytes = Outcome(*answer[0]), answer[1]
        if (
            ended
            or outcome.failure is Failure.MEMORY
            or idle_bytes > MAX_IDLE_SHARE * job.settings.memory_bytes
        ):
            self._stop()
        return outcome

    def close(self) -> None:
        """End the child at once, from whatever thread; nothing is started after it."""
        with self._lock:
            self._closed = True
            running = self._running
        if running is not None:
            _kill(running)
        self._stop()

    def _ready(self) -> tuple[subprocess.Popen[bytes] | None, str]:
        """The child, started and ready where there was none; or None, and why."""
        with self._lock:
            if self._closed:
                return None, "the run was ended"
            if self._running is not None:
                return self._running, ""
            try:
                child = self._started()
            except OSError as error:
                return None, one_line(error)
        stdout = child.stdout
        assert stdout is not None
        answer, ended = _within(START_TIMEOUT_S, child, lambda: pickle.load(stdout))
        if answer is None:
            ending = _ending(self._stop(EXIT_S)[0])
            return None, f"it did not start within {START_TIMEOUT_S:g} s" if ended else f"it {ending}"
        return child, ""

    def _started(self) -> subprocess.Popen[bytes]:
        self._scratch = tempfile.mkdtemp(prefix="canid-fleet-")
        self._sent = set()
        self._running = subprocess.Popen(
            child_process.command("canid.fleet.analysis_process", str(os.getpid()), self._scratch),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            # a Ctrl-C in the terminal is for the parent to answer
            start_new_session=True,
            env={name: value for name, value in os.environ.items() if name != _GIVE_BACK},
        )
        _first_for_the_oom_killer(self._running.pid)
        return self._running

    def _asked(self, child: subprocess.Popen[bytes], job: Job, source: Source) -> Any:
        assert child.stdin is not None
        assert child.stdout is not None
        of = f"{job.source} {source.fingerprint}"
        message: Any = (job, of, None if of in self._sent else source)
        pickle.dump(message, child.stdin, protocol=5)
        child.stdin.flush()
        self._sent.add(of)
        return pickle.load(child.stdout)

    def _stop(self, patience_s: float = 0.0) -> tuple[int | None, int]:
        """End the child, if it has not ended by itself within `patience_s`; its exit code and its peak memory in bytes."""
        with self._lock:
            running, self._running = self._running, None
            scratch, self._scratch = self._scratch, ""
        peak_bytes = 0
        if running is not None:
            # one that has died by itself keeps its code: its output ends a little before it does
            peak_bytes = _reaped(running, patience_s)
            _kill(running)
            for stream in (running.stdin, running.stdout):
                if stream is not None:
                    with suppress(OSError, ValueError):
                        stream.close()
            with suppress(subprocess.TimeoutExpired):
                running.wait(KILL_TIMEOUT_S)
        if scratch:
            shutil.rmtree(scratch, ignore_errors=True)
        return (None if running is None else running.returncode), peak_bytes


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


def _ending(code: int | None) -> str:
    """How a process ended, in words.

    >>> _ending(-9), _ending(3)
    ('was ended by SIGKILL: where memory is short the system does that', 'ended with code 3')
    """
    if code is None:
        return "does not answer"
    if code >= 0:
        return f"ended with code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    why = ": where memory is short the system does that" if name == "SIGKILL" else ""
    return f"was ended by {name}{why}"


def _reaped(child: subprocess.Popen[bytes], patience_s: float) -> int:
    """Wait for the end of a child; returns its peak resident set size, 0 where it lives on or nothing is known."""
    if not hasattr(os, "wait4"):
        return 0
    deadline = time.monotonic() + patience_s
    # another thread may have waited for it
    with suppress(ChildProcessError):
        while child.returncode is None:
            pid, status, usage = os.wait4(child.pid, os.WNOHANG)
            if pid:
                child.returncode = os.waitstatus_to_exitcode(status)
                return 1024 * usage.ru_maxrss
            if time.monotonic() >= deadline:
                break
            time.sleep(EXIT_CHECK_S)
    return 0


# what a pipe raises whose process has died, and what pickle may raise of half an answer
_NO_ANSWER = (
    OSError,
    EOFError,
    pickle.PickleError,
    ValueError,
    TypeError,
    AttributeError,
    ImportError,
    IndexError,
)


def _within(limit_s: float, child: subprocess.Popen[bytes], ask: Callable[[], Any]) -> tuple[Any, bool]:
    """An answer of a child; None where it died, or was ended because it took longer, which the second value says."""
    ended = threading.Event()

    def end() -> None:
        ended.set()
        _kill(child)

    watch = threading.Timer(limit_s, end)
    watch.daemon = True
    watch.start()
    try:
        return ask(), ended.is_set()
    except _NO_ANSWER:
        return None, ended.is_set()
    finally:
        watch.cancel()


def _kill(child: subprocess.Popen[bytes]) -> None:
    """End a child, and what it has started itself."""
    if child.poll() is None and hasattr(os, "killpg"):
        with suppress(OSError):
            os.killpg(child.pid, signal.SIGKILL)
    child.kill()


def _first_for_the_oom_killer(pid: int) -> None:
    """Where memory runs out, the system shall end the child, not its parent."""
    with suppress(OSError):
        Path(f"/proc/{pid}/oom_score_adj").write_text("500", encoding="ascii")
