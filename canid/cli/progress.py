"""How far a long reading is, on a terminal; it loads the screen's package only there."""

from __future__ import annotations

import os
import sys
import time
from typing import Any, TextIO

from canid.views.terminal_text import terminal_text

# redraws per second: readable, and a few per cent of a core
REDRAW = 5.0


def is_terminal(stream: TextIO) -> bool:
    """Can a screen be drawn there?"""
    return stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


class Progress:
    """A progress bar on a terminal, nothing elsewhere."""

    def __init__(self, label: str) -> None:
        """Start it: it only says that something goes on, until `to` says how far."""
        self._bar: Any = None
        self._drawn = 0.0
        if is_terminal(sys.stderr):
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
            from rich.progress import Progress as Bar

            columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
            self._bar = Bar(*columns, console=Console(file=sys.stderr), transient=True)
            self._task = self._bar.add_task(terminal_text(label), total=None)
            self._bar.start()

    def to(self, fraction: float) -> None:
        """Set it."""
        now = time.monotonic()
        if self._bar is not None and now - self._drawn > 1.0 / REDRAW:
            self._drawn = now
            self._bar.update(self._task, total=1.0, completed=fraction)

    def close(self) -> None:
        """Take it away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
