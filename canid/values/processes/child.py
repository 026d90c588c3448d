"""The parent's side: one child process that is sent pickled messages, answers them, and can be ended at any time.

What must hold: whatever the child does (hang, die, answer nonsense), `ask` raises nothing but `NoAnswerError`; `kill` and
`end` may be called from any thread, in the middle of `ask`.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import threading
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import IO, Any, Self

from canid.values.processes import memory_victim, plain_values

# s that a child which was ended by force may take to be gone
KILL_TIMEOUT_S = 5.0
# s between the end of a child's output and its own, at most
EXIT_S = 1.0
# s between two checks whether it has ended
EXIT_CHECK_S = 0.005


class NoAnswerError(Exception):
    """The child has died, was ended, or its answer is none. `late`: it was ended because it took too long."""

    def __init__(self, why: str, *, late: bool) -> None:
        """Note why."""
        super().__init__(why)
        self.late = late


class EndedError(NoAnswerError):
    """The child has closed its output: it has ended."""


class Child:
    """A child process in a session of its own, where no signal of the terminal reaches it."""

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str] | None = None,
        inherited: Sequence[int] = (),
        answers: Collection[type] | None = None,
    ) -> None:
        """Start it.

        Args:
            command: of `child_process.command`.
            environment: variables; None: those of this process.
            inherited: file descriptors that it gets.
            answers: of a child that parses what strangers wrote (`connect(plain=True)`): the types of its answers, besides
                numbers, texts and arrays (`plain_values`). None: it is trusted, and answers with any type.

        Raises:
            OSError: it cannot be started.
        """
        self.killed = False
        self._answers = answers
        self.peak_bytes = 0  # resident set size of a child that ended by itself; 0: not known
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # standard error may be a pipe that nobody reads: what has happened comes as a message
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env=environment,
            pass_fds=inherited,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self.stdin: IO[bytes] = self._process.stdin
        self.stdout: IO[bytes] = self._process.stdout
        memory_victim.end_before_parent(self.pid)

    def __enter__(self) -> Self:
        """Use it within this context."""
        return self

    def __exit__(self, *_: object) -> None:
        """End it."""
        self.end()

    @property
    def pid(self) -> int:
        """Process id, and that of its group."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def write(self, message: Any) -> None:
        """Send a message, with one system call where it is short. Raises OSError where the child is gone."""
        self.stdin.write(pickle.dumps(message, protocol=5))
        self.stdin.flush()

    def receive(self, limit_s: float | None = None) -> Any:
        """Wait for an answer.

        Args:
            limit_s: after which the child is ended; None: none.

        Raises:
            NoAnswerError: there is none.
        """
        with self._limited(limit_s):
            return self._load()

    def ask(self, message: Any, limit_s: float | None = None) -> Any:
        """Send a message and wait for its answer; see `receive`."""
        with self._limited(limit_s):
            self.write(message)
            return self._load()

    def _load(self) -> Any:
        if self._answers is None:
            return pickle.load(self.stdout)
        return plain_values.load(self.stdout, self._answers)

    @contextmanager
    def _limited(self, limit_s: float | None) -> Iterator[None]:
        late = threading.Event()

        def end() -> None:
            late.set()
            self.kill()

        timer = None if limit_s is None else threading.Timer(limit_s, end)
        if timer is not None:
            timer.daemon = True
            timer.start()
        try:
            yield
        # of any kind: pickle raises whatever there is of bytes that are no message
        except Exception as error:
            kind = EndedError if isinstance(error, EOFError) else NoAnswerError
            raise kind(f"{type(error).__name__}: {error}", late=late.is_set()) from error
        finally:
            if timer is not None:
                timer.cancel()

    def wait(self, timeout_s: float) -> int | None:
        """Wait for its end; returns its exit code, None where it lives on."""
        with suppress(subprocess.TimeoutExpired):
            return self._process.wait(timeout_s)
        return None

    def kill(self) -> None:
        """End it at once, with what it has started itself."""
        self.killed = True
        if self.running and hasattr(os, "killpg"):
            with suppress(OSError):
                os.killpg(self.pid, signal.SIGKILL)
        self._process.kill()

    def end(self, patience_s: float = 0.0) -> int | None:
        """End it, if it does not end by itself within `patience_s`; a second call does nothing.

        Returns:
            its exit code, negative for a signal; None: it is not gone after `KILL_TIMEOUT_S`.
        """
        # one that has died by itself keeps its code: its output ends a little before it does
        self._reap(patience_s)
        self.kill()
        code = self.wait(KILL_TIMEOUT_S)
        for stream in (self.stdin, self.stdout):
            with suppress(OSError, ValueError):
                stream.close()
        return code

    def _reap(self, patience_s: float) -> None:
        deadline = time.monotonic() + patience_s
        # ChildProcessError: another thread has waited for it
        with suppress(ChildProcessError):
            while hasattr(os, "wait4") and self._process.returncode is None:
                pid, status, usage = os.wait4(self.pid, os.WNOHANG)
                if pid:
                    self._process.returncode = os.waitstatus_to_exitcode(status)
                    self.peak_bytes = 1024 * usage.ru_maxrss
                elif time.monotonic() >= deadline:
                    return
                else:
                    time.sleep(EXIT_CHECK_S)


def ending(code: int | None) -> str:
    """How a process ended, in words.

    >>> ending(-9), ending(3)
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
