"""Standard output and standard error that can cost a command nothing but what was written to them.

Both may be closed, full, a pipe whose reader has gone, or a terminal that is frozen, from before the first line. The
real file descriptors are therefore never handed to `print`: `installed` puts a `Stream` in the place of `sys.stdout`
and `sys.stderr`, so that this holds for everything in the process that writes there, libraries included.
"""

from __future__ import annotations

import errno
import io
import os
import select
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from canid.cli.detached_writer import DetachedWriter

# bytes that a pipe takes in one piece without blocking once poll says that it takes any (POSIX: at least 512, Linux 4096)
PIECE = 4096
# s that a stream which takes nothing is waited for once a signal has asked for the end
HURRY = 0.2
# bytes that may wait for a terminal: some ten pictures of the live view; older ones are of no use to anybody
TERMINAL_LIMIT = 64 * 1024
# bytes that may wait for a pipe or a file: an hour of JSON lines
PIPE_LIMIT = 16 * 1024 * 1024
# s in all that the end of a command waits for readers that do not read. 2 s are promised from a signal to the end:
# with what the estimators (canid.session.FINISH_S) and --json (canid.cli.sessions.PATIENCE) have it makes 1.7 s
PATIENCE = 0.4


class Stream(io.TextIOBase):
    """A text stream on a file descriptor, unbuffered.

    Attached, it writes at once and waits for its reader, as other programs do. Detached, it hands its text to a thread
    and never waits. `strict`: an attached write that fails raises; else `lost` tells it.
    """

    def __init__(self, fd: int, encoding: str | None, *, strict: bool, absent: bool):
        """Write to `fd`. `strict`: an attached write raises OSError; `absent`: the descriptor was closed."""
        self._fd = fd
        self._encoding = encoding or "utf-8"
        self._strict = strict
        self._absent = absent
        self._error: OSError | None = None
        self._detached: DetachedWriter | None = None
        self.hurry = False  # a signal has asked for the end: wait no longer than `HURRY`

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Of the text; what it has no characters for is written as an escape."""
        return self._encoding

    @property
    def error(self) -> OSError | None:
        """Why something was not written."""
        return self._error or (self._detached.error if self._detached else None)

    @property
    def lost(self) -> str:
        """Why something was lost without an exception; "": nothing was."""
        if self._strict and self._detached is None:
            return ""
        if self.error is not None:
            return self.error.strerror or str(self.error)
        return "its reader does not read" if self._detached is not None and self._detached.lost else ""

    def writable(self) -> bool:
        """It is."""
        return True

    def fileno(self) -> int:
        """The file descriptor."""
        return self._fd

    def isatty(self) -> bool:
        """Is it a terminal?"""
        return not self._absent and os.isatty(self._fd)

    def detach_writes(self) -> None:
        """From now on a thread writes, and nobody waits for it."""
        if self._detached is None:
            limit = TERMINAL_LIMIT if self.isatty() else PIPE_LIMIT
            self._detached = DetachedWriter(self._put, limit, f"canid-fd-{self._fd}")

    def write(self, text: str) -> int:
        """Write text; raises OSError only where attached and strict."""
        self.write_bytes(text.encode(self._encoding, "backslashreplace"))
        return len(text)

    def write_bytes(self, data: bytes) -> None:
        """Write bytes, as `write` does."""
        if self._detached is not None:
            self._detached.put(data)
        elif self._error is None or self._strict:
            try:
                self._put(data)
            except OSError as error:
                self._error = error
                if self._strict:
                    raise

    def finish(self, timeout: float) -> None:
        """Wait up to `timeout` s for what a thread still has to write."""
        if self._detached is not None:
            self._detached.close(timeout)

    def _put(self, data: bytes) -> None:
        if self._absent:
            raise OSError(errno.EBADF, "it is closed")
        done, view = 0, memoryview(data)
        while done < len(data):
            self._wait()
            try:
                done += os.write(self._fd, view[done : done + PIECE])
            except BlockingIOError:  # somebody has made the descriptor non-blocking
                continue

    def _wait(self) -> None:
        """Wait until the descriptor takes something; raises OSError in a hurry."""
        if not hasattr(select, "poll"):
            return  # Windows
        poll = select.poll()
        poll.register(self._fd, select.POLLOUT)
        while not poll.poll(HURRY * 1000):
            if self.hurry:
                raise OSError(errno.EAGAIN, "its reader does not read")


def reserve_standard_descriptors() -> list[int]:
    """Put the null device in the place of each of descriptors 0, 1, 2 that is closed; returns which were.

    Else the next file that is opened (a recording, say) gets that number, and whatever writes to standard output or
    standard error, in this process or a child, writes into it.
    """
    closed = []
    for fd in (0, 1, 2):
        try:
            os.fstat(fd)
        except OSError:
            closed.append(fd)
            # the lowest free number is this one
            opened = os.open(os.devnull, os.O_RDONLY if fd == 0 else os.O_WRONLY)
            os.set_inheritable(opened, True)
    return closed


@contextmanager
def installed() -> Iterator[list[Stream]]:
    """Put `Stream`s in the place of the process's own standard streams; where they were replaced already, none.

    On the way out what waits is written, at most `PATIENCE` s are waited for it in all, and the process's own streams
    stand again.
    """
    if sys.stdout is not sys.__stdout__ or sys.stderr is not sys.__stderr__:
        yield []  # a test, or a program that uses canid as a library
        return
    closed = reserve_standard_descriptors()
    before: tuple[Any, Any] = sys.stdout, sys.stderr
    streams = [
        Stream(1, getattr(before[0], "encoding", None), strict=True, absent=1 in closed),
        Stream(2, getattr(before[1], "encoding", None), strict=False, absent=2 in closed),
    ]
    sys.stdout, sys.stderr = streams
    if hasattr(signal, "SIGTTOU"):
        # a terminal that stops background programs which write to it must not stop a recording
        signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    try:
        yield streams
    finally:
        end = time.monotonic() + PATIENCE
        for stream in streams:
            stream.finish(max(end - time.monotonic(), 0.0))
        sys.stdout, sys.stderr = before


def detach() -> bool:
    """From now on no write to standard output or standard error blocks or raises; False: they are not canid's own."""
    own = [stream for stream in (sys.stdout, sys.stderr) if isinstance(stream, Stream)]
    for stream in own:
        stream.detach_writes()
    return bool(own)


def standard_output_error() -> OSError | None:
    """Why nothing more reaches standard output; None: it does, as far as is known."""
    return sys.stdout.error if isinstance(sys.stdout, Stream) else None


def hurry() -> None:
    """A signal has asked for the end: no write waits longer than `HURRY` s."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, Stream):
            stream.hurry = True
