"""Progress bar for a long reading, on a terminal only: rich is imported only there."""

from __future__ import annotations

import os
import sys
import time
from typing import Any, TextIO

from canid.values.terminal_text import terminal_text

# redraws per second: readable, and a few per cent of a core
REDRAW_HZ = 5.0


def is_terminal(stream: TextIO) -> bool:
    """Whether the display can be drawn there."""
    return stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def time_left() -> Any:
    """The column of the time that is left: empty until it is known, where rich has "-:--:--"."""
    from rich.progress import Task, TimeRemainingColumn
    from rich.text import Text

    class TimeLeft(TimeRemainingColumn):
        def render(self, task: Task) -> Text:
            return Text("") if task.time_remaining is None else super().render(task)

    return TimeLeft()


class Progress:
    """A progress bar on standard error, as a context manager; nothing where that is not a terminal."""

    def __init__(self, label: str) -> None:
        """Show the bar without an end; `to` gives it one."""
        self._bar: Any = None
        self._drawn = 0.0
        if is_terminal(sys.stderr):
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn
            from rich.progress import Progress as Bar

            columns = (
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                TextColumn("{task.fields[count]}", markup=False),
                time_left(),
            )
            self._bar = Bar(*columns, console=Console(file=sys.stderr), transient=True)
            self._task = self._bar.add_task(terminal_text(label), total=None, count="")
            self._bar.start()

    def __enter__(self) -> Progress:
        """The bar itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def to(self, fraction: float) -> None:
        """Set the fraction that is done, 0 to 1."""
        now = time.monotonic()
        if self._bar is not None and now - self._drawn > 1.0 / REDRAW_HZ:
            self._drawn = now
            self._bar.update(self._task, total=1.0, completed=fraction)

    def count(self, done: int, total: int, remark: str = "") -> None:
        """Set how many of a number are done, with a remark behind them."""
        now = time.monotonic()
        if self._bar is not None and (now - self._drawn > 1.0 / REDRAW_HZ or done == total):
            self._drawn = now
            text = ", ".join(filter(None, (f"{done:,} of {total:,}", terminal_text(remark))))
            self._bar.update(self._task, total=max(total, 1), completed=done, count=text)
