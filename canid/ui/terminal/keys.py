"""Keys of a terminal's keyboard, one at a time, read by a daemon thread; the terminal is restored afterwards.

A process in the background, a closed standard input, a pipe: no keys, and nothing else changes.
"""

from __future__ import annotations

import codecs
import os
import re
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

# s between two checks whether the process is in the foreground, and of what the shell has done to the terminal
CHECK_INTERVAL_S = 0.25
# s within which the rest of an escape sequence of an arrow or function key follows
SEQUENCE_S = 0.02
# bytes that are read at once: a paste, which is no key
READ_BYTES = 4096
NAMED = {"\r": "enter", "\n": "enter", "\x7f": "backspace", "\b": "backspace", "\x1b": "escape"}
# an arrow or function key (ECMA-48 control sequence, or single shift); or any other character
_KEY = re.compile(r"\x1b[\[O][0-?]*[ -/]*[@-~]|.", re.DOTALL)


def parsed(text: str) -> list[str]:
    r"""Keys of what a terminal sends: characters, and enter, backspace, escape; all others are left out.

    Example:
        >>> parsed("aß \n\x1b[A\x1b\x03")
        ['a', 'ß', ' ', 'enter', 'escape']
    """
    keys = _KEY.findall(text)
    return [NAMED.get(key, key) for key in keys if key in NAMED or (len(key) == 1 and key.isprintable())]


def in_foreground(fd: int) -> bool:
    """Whether this process may use the terminal: it is in the foreground, or nobody controls jobs there."""
    try:
        return os.tcgetpgrp(fd) == os.getpgrp()
    except (OSError, AttributeError):  # not the controlling terminal; Windows
        return True


class Keyboard:
    """The keyboard of the terminal on `fd`; `take` is called with each key, in a thread of its own."""

    def __init__(self, take: Callable[[str], object], fd: int = 0) -> None:
        """Nothing is read yet."""
        self._take = take
        self._fd = fd
        self._closing = threading.Event()
        self._closed = False
        # of who sets the terminal: once it is restored, the thread takes it no more. A signal's handler may come between
        self._setting = threading.RLock()
        self._thread: threading.Thread | None = None
        self._wake: tuple[int, int] | None = None  # a pipe: ends the wait for a key
        self._saved: list[Any] | None = None  # the terminal's settings before
        self._ignored_before: Any = None

    def start(self) -> bool:
        """Read keys from now on; False: there is no keyboard."""
        try:
            if not os.isatty(self._fd):
                return False
        except OSError:
            return False
        if sys.platform != "win32":
            import termios

            try:
                self._saved = termios.tcgetattr(self._fd)
            except (termios.error, OSError):
                return False
            self._wake = os.pipe()
            if threading.current_thread() is threading.main_thread():
                # a read in the background fails then, instead of stopping a recording
                self._ignored_before = signal.signal(signal.SIGTTIN, signal.SIG_IGN)
        self._thread = threading.Thread(target=self._run, name="canid-keys", daemon=True)
        self._thread.start()
        return True

    def close(self) -> None:
        """Read no more, and restore the terminal."""
        if self._thread is None or self._closed:
            return
        self._closed = True
        self._closing.set()
        if self._wake is not None:
            os.write(self._wake[1], b"x")
        if self._thread is not threading.current_thread():
            self._thread.join(2.0 * CHECK_INTERVAL_S)
        self.restore()
        if self._wake is not None and not self._thread.is_alive():
            for fd in self._wake:
                os.close(fd)
        if self._ignored_before is not None and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTTIN, self._ignored_before)

    def restore(self) -> None:
        """Read no more, and restore the terminal's settings; what was typed and not read does not go to the shell."""
        self._closing.set()
        if sys.platform != "win32" and self._saved is not None and in_foreground(self._fd):
            import termios

            has_lock = self._setting.acquire(timeout=CHECK_INTERVAL_S)
            with suppress(termios.error, OSError):
                termios.tcflush(self._fd, termios.TCIFLUSH)
                # at once: not after output that a stuck terminal does not take
                termios.tcsetattr(self._fd, termios.TCSANOW, self._saved)
            if has_lock:
                self._setting.release()

    def grab(self) -> None:
        """Give keys singly from this call on, before a picture invites to press them; the process is in the foreground."""
        if self._thread is None or self._closing.is_set():
            return
        with suppress(OSError):  # the terminal has gone
            self._single_keys()

    def _run(self) -> None:
        with suppress(OSError, ValueError):  # the terminal has gone
            if sys.platform == "win32":
                self._run_windows()
            else:
                self._run_posix()

    def _run_posix(self) -> None:
        decoder = codecs.getincrementaldecoder("utf-8")("ignore")
        assert self._wake is not None
        while not self._closing.is_set():
            if not in_foreground(self._fd):
                self._closing.wait(CHECK_INTERVAL_S)
                continue
            self._single_keys()
            ready, _, _ = select.select([self._fd, self._wake[0]], [], [], CHECK_INTERVAL_S)
            if self._fd not in ready or self._closing.is_set():
                continue
            try:
                data = os.read(self._fd, READ_BYTES)
            except OSError:
                if in_foreground(self._fd):
                    return  # the terminal has gone
                continue
            if not data:
                return
            if data.endswith(b"\x1b") and select.select([self._fd], [], [], SEQUENCE_S)[0]:
                data += os.read(self._fd, READ_BYTES)
            for key in parsed(decoder.decode(data)):
                self._take(key)

    def _single_keys(self) -> None:
        """Give keys at once and without echo; again where a shell has changed that while we were stopped."""
        with self._setting:
            if not self._closing.is_set():
                self._set_single_keys()

    def _set_single_keys(self) -> None:
        if sys.platform == "win32":
            return
        import termios

        try:
            now = termios.tcgetattr(self._fd)
            local, control = 3, 6  # of the list of termios
            if not now[local] & termios.ICANON:
                return
            now[local] &= ~(
                termios.ICANON | termios.ECHO | termios.IEXTEN
            )  # the last: Ctrl-Y stops it on BSD
            now[0] &= ~termios.IXON  # Ctrl-S would freeze the picture
            now[control][termios.VMIN], now[control][termios.VTIME] = 1, 0
            # Ctrl-Z would stop a recorder, and lose frames; Ctrl-\ would end it without restoring the terminal
            none = os.fpathconf(self._fd, "PC_VDISABLE").to_bytes(1, "little")
            now[control][termios.VSUSP] = now[control][termios.VQUIT] = none
            termios.tcsetattr(self._fd, termios.TCSANOW, now)
        except termios.error as error:  # which is no OSError
            raise OSError(*error.args) from None

    def _run_windows(self) -> None:
        if sys.platform == "win32":
            import msvcrt

            while not self._closing.is_set():
                if msvcrt.kbhit():
                    for key in parsed(msvcrt.getwch()):
                        self._take(key)
                else:
                    time.sleep(0.05)
