"""Ctrl-C, kill and a closed terminal as a question that loops ask: stop, and which signal was it."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from canid.cli import streams

# what a terminal, a service manager and a closed ssh session send
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupt:
    """`with Interrupt() as stop:` — `stop()` is true after a signal; the second one ends the process at once."""

    def __init__(self) -> None:
        """Nothing has come yet."""
        self.signal = 0
        self._before: dict[int, object] = {}

    def __call__(self) -> bool:
        """Was there a signal?"""
        return bool(self.signal)

    def __enter__(self) -> Interrupt:
        """Listen for the signals."""
        for number in SIGNALS:
            if number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
                continue  # started by nohup: a terminal that closes shall not end it
            self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        """Leave them as they were."""
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _note(self, number: int, _: FrameType | None) -> None:
        if self.signal:
            os._exit(128 + number)
        self.signal = number

    @property
    def code(self) -> int:
        """The exit code that shells expect of an interrupted program: 130 for Ctrl-C, 143 for SIGTERM."""
        return 128 + self.signal


class Ended(KeyboardInterrupt):
    """SIGTERM or SIGHUP, raised where Ctrl-C would be: files are closed on the way out."""

    def __init__(self, number: int) -> None:
        """Note which signal it was."""
        super().__init__(number)
        self.code = 128 + number


@contextmanager
def ending() -> Iterator[None]:
    """Verbs without a loop that asks `Interrupt` end like this on SIGTERM, SIGHUP and Ctrl-C.

    A signal that whoever started the command has switched off (nohup, a shell's background) stays switched off.
    """

    def end(number: int, _: FrameType | None) -> None:
        streams.hurry()  # what is still said on the way out waits for no reader
        raise KeyboardInterrupt if number == signal.SIGINT else Ended(number)

    if threading.current_thread() is not threading.main_thread():
        yield  # Python lets the main thread alone set handlers
        return
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.signal(number, end) for number in SIGNALS if signal.getsignal(number) in usual}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
