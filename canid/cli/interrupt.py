"""Ctrl-C, kill and a closed terminal as a question that loops ask: stop, and which signal was it."""

from __future__ import annotations

import os
import signal
from types import FrameType

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
