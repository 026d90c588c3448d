"""Standard output and standard error that cannot block or end a command.

Each may be closed, full, a pipe whose reader has gone, or a frozen terminal, even before the first line. `installed`
therefore replaces `sys.stdout` and `sys.stderr` by a `Stream` each, for everything in the process that writes there,
libraries included.
"""

from __future__ import annotations

import errno
import io
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from canid.ui.terminal.detached_writer import DetachedWriter

# bytes that a pipe takes at once without blocking when poll reports it writable (POSIX: at least 512, Linux 4096)
PIPE_CHUNK_BYTES = 4096
# s to wait for a stream that takes nothing, after a signal
HURRY_S = 0.2
# bytes that may wait for a terminal: some ten pictures of the live view; older ones are useless
TERMINAL_LIMIT_BYTES = 64 * 1024
# bytes that may wait for a pipe or a file: an hour of JSON lines
PIPE_LIMIT_BYTES = 16 * 1024 * 1024
# pieces of text that are kept while a view covers the screen
MAX_HELD_PIECES = 1000
# s in total that the end of a command waits for readers that do not read. 2 s are promised from a signal to the end;
# with those of the estimators (canid.analysis.session.session.FINISH_S) and of --json
# (canid.ui.cli.live_session.JSON_PATIENCE_S): 1.7 s
STREAM_PATIENCE_S = 0.4


class Stream(io.TextIOBase):
    """A text stream on a file descriptor, unbuffered.

    Attached, it writes at once and waits for its reader, as other programs do. Detached, a thread writes, and nothing
    waits for it. `strict`: an attached write that fails raises; otherwise `lost` reports it.
    """

    def __init__(self, fd: int, encoding: str | None, *, strict: bool, absent: bool):
        """Write to `fd`. `strict`: an attached write raises OSError; `absent`: the descriptor was closed."""
        self._fd = fd
        self._encoding = encoding or "utf-8"
        self._strict = strict
        self._absent = absent
        self._error: OSError | None = None
        self._detached: DetachedWriter | None = None
        self._held: list[str] | None = None  # lines that are kept while a view covers the screen
        self._show_held: Callable[[str], object] = str
        self.hurry = False  # a signal has asked for the end: wait no longer than `HURRY_S`

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Encoding of the text; characters that it does not have are escaped."""
        return self._encoding

    @property
    def error(self) -> OSError | None:
        """Why something was not written."""
        return self._error or (self._detached.error if self._detached else None)

    @property
    def lost(self) -> str:
        """Why something was lost without an exception; "": nothing was lost."""
        if self._strict and self._detached is None:
            return ""
        if self.error is not None:
            return self.error.strerror or str(self.error)
        return "its reader does not read" if self._detached is not None and self._detached.lost else ""

    def writable(self) -> bool:
        """Always True."""
        return True

    def fileno(self) -> int:
        """The file descriptor."""
        return self._fd

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return not self._absent and os.isatty(self._fd)

    def detach_writes(self) -> None:
        """From now on a thread writes, and nothing waits for it."""
        if self._detached is None:
            limit = TERMINAL_LIMIT_BYTES if self.isatty() else PIPE_LIMIT_BYTES
            self._detached = DetachedWriter(self._put, limit, f"canid-fd-{self._fd}")

    def write(self, text: str) -> int:
        """Write text; raises OSError only where attached and strict."""
        held = self._held  # another thread may release it
        if held is not None:
            if len(held) < MAX_HELD_PIECES:
                held.append(text)
            if text.strip():
                self._show_held(text.strip())
            return len(text)
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

    def draw(self, text: str, *, keep: bool) -> None:
        """Write a picture of the whole screen, or with `keep` a control sequence; also while messages are held.

        Where a thread writes, a picture that still waits is replaced by a newer one: a slow terminal gets the newest.
        """
        data = text.encode(self._encoding, "replace")
        if self._detached is not None:
            self._detached.put(data, replaceable=not keep)
        else:
            self.write_bytes(data)

    def hold(self, show: Callable[[str], object]) -> None:
        """Keep what is written until `release`; `show` gets each piece of text."""
        self._held, self._show_held = [], show

    def release(self) -> None:
        """Write what was kept."""
        held, self._held = self._held or [], None
        for text in held:
            self.write(text)

    def finish(self, timeout: float) -> None:
        """Wait up to `timeout` s for what the thread still has to write."""
        if self._detached is not None:
            self._detached.close(timeout)

    def _put(self, data: bytes) -> None:
        if self._absent:
            raise OSError(errno.EBADF, "it is closed")
        done, view = 0, memoryview(data)
        while done < len(data):
            self._wait()
            try:
                done += os.write(self._fd, view[done : done + PIPE_CHUNK_BYTES])
            except BlockingIOError:  # another process made the descriptor non-blocking
                continue

    def _wait(self) -> None:
        """Wait until the descriptor is writable. Raises OSError when a signal has asked for the end."""
        if not hasattr(select, "poll"):
            return  # Windows
        poll = select.poll()
        poll.register(self._fd, select.POLLOUT)
        while not poll.poll(HURRY_S * 1000):
            if self.hurry:
                raise OSError(errno.EAGAIN, "its reader does not read")


def reserve_standard_descriptors() -> list[int]:
    """Open the null device on each of descriptors 0, 1, 2 that is closed; returns which were.

    Otherwise the next file that is opened (such as a recording) gets that number, and everything that this process or a
    child writes to standard output or standard error goes into it.
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
    """Replace the process's own standard streams by `Stream`s; none where they were replaced already.

    On exit, what waits is written; at most `STREAM_PATIENCE_S` s are waited for it in all, and the process's own streams
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
        end = time.monotonic() + STREAM_PATIENCE_S
        for stream in streams:
            stream.finish(max(end - time.monotonic(), 0.0))
        sys.stdout, sys.stderr = before


def detach() -> bool:
    """From now on no write to standard output or standard error blocks or raises; False: they are not `Stream`s."""
    streams = [stream for stream in (sys.stdout, sys.stderr) if isinstance(stream, Stream)]
    for stream in streams:
        stream.detach_writes()
    return bool(streams)


def standard_output_error() -> OSError | None:
    """Why nothing more reaches standard output; None: no error is known."""
    return sys.stdout.error if isinstance(sys.stdout, Stream) else None


def hurry() -> None:
    """A signal has asked for the end: no write waits longer than `HURRY_S` s."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, Stream):
            stream.hurry = True
