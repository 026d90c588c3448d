"""What an attacker puts at a process's standard streams: pipes, terminals and devices that fail, block or go away."""

from __future__ import annotations

import os
import pty
import termios
from collections.abc import Callable
from contextlib import ExitStack, suppress

# what surely loses whatever is written to it, and what may take all of it
LOSING = ("closed", "/dev/full", "pipe without reader", "pipe full", "non-blocking pipe full")
LEAVING = ("reader leaves", "terminal goes away")
PATIENT = ("terminal without reader", "terminal stopped by Ctrl-S", "reader stops reading")
HARMLESS = ("/dev/null", "file")
KINDS = (*LOSING, *LEAVING, *PATIENT, *HARMLESS)


class Ends:
    """The writing ends that a process is given; `act` does what comes later."""

    def __init__(self, stack: ExitStack):
        """`stack` closes all that is left."""
        self._stack = stack
        self._later: list[Callable[[], None]] = []

    def end(self, kind: str, path: str) -> int | None:
        """Open one; None: it is to be closed by the shell. `path`: of the file that "file" is."""
        if kind == "closed":
            return None
        if kind in ("/dev/full", "/dev/null"):
            return self._kept(os.open(kind, os.O_WRONLY))
        if kind == "file":
            return self._kept(os.open(path, os.O_WRONLY | os.O_CREAT))
        if "terminal" in kind:
            reader, writer = pty.openpty()
            self._kept(reader)
            if "Ctrl-S" in kind:
                self._later.append(lambda: self._try(os.write, reader, b"\x13"))
            elif "goes away" in kind:
                self._later.append(lambda: self._try(os.close, reader))
            return self._kept(writer)
        reader, writer = os.pipe()
        self._kept(reader)
        if kind == "pipe without reader":
            os.close(reader)
        elif kind == "reader leaves":
            self._later.append(lambda: self._try(os.close, reader))
        else:
            self._fill(writer)
            if kind == "reader stops reading":  # it has taken something before
                os.read(reader, 20_000)
            os.set_blocking(writer, kind != "non-blocking pipe full")
        return self._kept(writer)

    def act(self) -> None:
        """The reader leaves, the terminal goes away or is stopped."""
        for act in self._later:
            act()
        self._later.clear()

    def _fill(self, writer: int) -> None:
        os.set_blocking(writer, False)
        with suppress(BlockingIOError):
            while True:
                os.write(writer, b"x" * 4096)

    def _try(self, act: Callable[..., object], *args: object) -> None:
        with suppress(OSError, termios.error):
            act(*args)

    def _kept(self, fd: int) -> int:
        def close() -> None:
            # what was closed by an act must not be closed again: its number may be another's by then
            with suppress(OSError):
                if os.fstat(fd).st_ino == inode:
                    os.close(fd)

        inode = os.fstat(fd).st_ino
        self._stack.callback(close)
        return fd
