"""How outputs reach the user while they come: a live screen on a terminal, plain lines elsewhere, JSON lines beside."""

from __future__ import annotations

import math
import re
import sys
import time
from collections.abc import Iterable
from typing import Protocol, TextIO

from canid.cli.outputs import TextOutput
from canid.cli.progress import REDRAW, is_terminal
from canid.cli.talk import talk, tell
from canid.types import Estimate, Event, Sample, Screened, Status
from canid.views import as_json, words
from canid.views.screen import BusLine, View, render, update

# s between two plain lines of the same estimator with the same status
LINE_EVERY = 5.0
# the same where nothing is estimated and the sentence stays the same: enough to see that time passes
SAME_EVERY = 30.0
# s between two plain lines of the same trouble
WRONG_EVERY = 10.0


Shown = Sample | Estimate | Screened | Event


class Display(Protocol):
    """Takes what the pipeline puts out."""

    def put(self, item: Shown) -> None:
        """Show one output."""

    def lines(self, lines: Iterable[BusLine], output: str = "") -> None:
        """Show the state of bus and recorder, and name the driver's output."""

    def close(self) -> None:
        """Leave the terminal as it was."""


class Silent:
    """Shows nothing but what happened: the numbers go to standard output as JSON."""

    def put(self, item: Shown) -> None:
        """Say an event, drop the rest."""
        if isinstance(item, Event):
            talk(item.says)

    def lines(self, lines: Iterable[BusLine], output: str = "") -> None:
        """Drop them."""

    def close(self) -> None:
        """Nothing to leave."""


class Plain:
    """One line per change of status, and every few seconds of the log."""

    def __init__(self) -> None:
        """Nothing was said yet."""
        self._said: dict[str, Estimate] = {}
        # sentence without its numbers -> the sentence as it was said last, and when (monotonic clock)
        self._wrong: dict[str, tuple[str, float]] = {}
        self._suspected = ""

    def put(self, item: Shown) -> None:
        """Write a line where something has changed."""
        if isinstance(item, Event):
            talk(item.says)
            self._wrong[_without_numbers(item.says)] = item.says, time.monotonic()
        elif isinstance(item, Estimate):
            before = self._said.get(item.estimator)
            same = before is not None and before.says == item.says and item.status is not Status.OK
            every = SAME_EVERY if same else LINE_EVERY
            if before is None or before.status is not item.status or item.t - before.t >= every - 1e-6:
                self._said[item.estimator] = item
                tell(words.estimate(item))
        elif isinstance(item, Screened) and item.block != self._suspected:
            self._suspected = item.block
            tell(words.screened(item))

    def lines(self, lines: Iterable[BusLine], output: str = "") -> None:
        """Say what is wrong: at once, and every now and then while it lasts and its numbers change."""
        now = time.monotonic()
        for line in lines:
            if not line.wrong:
                continue
            what = _without_numbers(line.says)
            said, at = self._wrong.get(what, ("", -math.inf))
            if line.says != said and now - at >= WRONG_EVERY:
                self._wrong[what] = line.says, now
                talk(line.says)

    def close(self) -> None:
        """Nothing to leave."""


def _without_numbers(says: str) -> str:
    return re.sub(r"[\d.,]+", "#", says)


class Screen:
    """The live screen."""

    def __init__(self, view: View, stream: TextIO) -> None:
        """Draw on the terminal behind `stream`."""
        from rich.console import Console
        from rich.live import Live

        self._view = view
        self._drawn = 0.0
        self._live = Live(render(view), console=Console(file=stream), auto_refresh=False, transient=False)
        self._live.start()

    def put(self, item: Shown) -> None:
        """Take it into the view, and redraw now and then."""
        self._view = update(self._view, item)
        self._redraw()

    def lines(self, lines: Iterable[BusLine], output: str = "") -> None:
        """Show the state of bus and recorder."""
        self._view = self._view._replace(lines=tuple(lines), output=output or self._view.output)
        self._redraw()

    def _redraw(self, *, force: bool = False) -> None:
        now = time.monotonic()
        if force or now - self._drawn >= 1.0 / REDRAW:
            self._drawn = now
            self._live.update(render(self._view), refresh=True)

    def close(self) -> None:
        """Leave the last picture on the terminal."""
        self._redraw(force=True)
        self._live.stop()


def display(view: View, *, json: str | None) -> Display:
    """Choose the display: the screen on a terminal, lines elsewhere; beside JSON on standard output, standard error."""
    stream = sys.stderr if json == "-" else sys.stdout
    if is_terminal(stream):
        return Screen(view, stream)
    return Silent() if json == "-" else Plain()


def write_json(file: TextOutput | None, item: Estimate | Screened) -> None:
    """One estimate, or what the screen says, as one line; the screen has nothing to say before the first misfit."""
    if file is None or (isinstance(item, Screened) and item.since != item.since):
        return
    told = as_json.screened(item) if isinstance(item, Screened) else as_json.estimate(item)
    file.write(as_json.line(told) + "\n")
