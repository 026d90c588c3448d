"""Displays of a running session: the live view on a terminal, plain lines elsewhere, and JSON lines."""

from __future__ import annotations

import math
import re
import sys
import time
from collections.abc import Iterable
from typing import Any, Protocol, TextIO

from canid.cli.output.messages import info, print_line
from canid.cli.output.outputs import TextOutput
from canid.cli.output.progress import REDRAW_HZ, is_terminal
from canid.types import Estimate, Event, MonitorReport, Sample, SignalReport, Status
from canid.views import estimate_text, json_values, signal_text
from canid.views.live_view import HealthLine, View, render, update

# s of the log between two plain lines of the same estimator with the same status
LINE_INTERVAL_S = 5.0
# the same where nothing is estimated and the sentence stays the same: enough to see that time passes
SAME_LINE_INTERVAL_S = 30.0
# s between two plain lines of the same trouble
TROUBLE_INTERVAL_S = 10.0


Item = Sample | Estimate | MonitorReport | SignalReport | Event


class Observer(Protocol):
    """Takes the outputs of the pipeline while they come: a display, the live page, a stream of UDP packets."""

    def put(self, item: Item) -> None:
        """Show one output."""

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Show the state of buses, recorder and estimators; `output` is the role of the driver's output."""

    def status(self, values: dict[str, Any]) -> None:
        """Take numbers on the session (`live_session.to_json`) or on the replay, a few times a second."""

    def close(self) -> None:
        """End: leave the terminal as it was, close sockets."""


class EventsOnly:
    """Events on standard error; the estimates go to standard output as JSON."""

    def put(self, item: Item) -> None:
        """Report an event, drop everything else."""
        if isinstance(item, Event):
            info(item.says)

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Drop them."""

    def status(self, values: dict[str, Any]) -> None:
        """Drop them."""

    def close(self) -> None:
        """Nothing to restore."""


class PlainLines:
    """One line per change of status, and one every few seconds of the log."""

    def __init__(self) -> None:
        """Nothing is shown yet."""
        self._shown: dict[str, Estimate] = {}
        # text without its numbers -> the text as it was last, and when (monotonic clock)
        self._trouble: dict[str, tuple[str, float]] = {}
        self._suspected = ""

    def put(self, item: Item) -> None:
        """Write a line where something has changed."""
        if isinstance(item, Event):
            info(item.says)
            self._trouble[_without_numbers(item.says)] = item.says, time.monotonic()
        elif isinstance(item, Estimate):
            before = self._shown.get(item.estimator)
            same = before is not None and before.says == item.says and item.status is not Status.OK
            interval = SAME_LINE_INTERVAL_S if same else LINE_INTERVAL_S
            if before is None or before.status is not item.status or item.t - before.t >= interval - 1e-6:
                self._shown[item.estimator] = item
                print_line(estimate_text.estimate(item))
        elif isinstance(item, MonitorReport) and item.block != self._suspected:
            self._suspected = item.block
            print_line(estimate_text.monitor_report(item))
        elif isinstance(item, SignalReport):
            for line in signal_text.report(item):
                print_line(line)

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Report what is wrong: at once, and every few seconds while it lasts and its numbers change."""
        now = time.monotonic()
        for line in lines:
            if not line.wrong:
                continue
            key = _without_numbers(line.text)
            last, at = self._trouble.get(key, ("", -math.inf))
            if line.text != last and now - at >= TROUBLE_INTERVAL_S:
                self._trouble[key] = line.text, now
                info(line.text)

    def status(self, values: dict[str, Any]) -> None:
        """Drop them."""

    def close(self) -> None:
        """Nothing to restore."""


def _without_numbers(text: str) -> str:
    return re.sub(r"[\d.,]+", "#", text)


class LiveDisplay:
    """The live view on a terminal."""

    def __init__(self, view: View, stream: TextIO) -> None:
        """Draw on the terminal behind `stream`."""
        from rich.console import Console
        from rich.live import Live

        self._view = view
        self._drawn = 0.0
        self._live = Live(render(view), console=Console(file=stream), auto_refresh=False, transient=False)
        self._live.start()

    def put(self, item: Item) -> None:
        """Take it into the view, and redraw at `REDRAW_HZ`."""
        self._view = update(self._view, item)
        self._redraw()

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Show the state of buses, recorder and estimators."""
        self._view = self._view._replace(lines=tuple(lines), output=output or self._view.output)
        self._redraw()

    def status(self, values: dict[str, Any]) -> None:
        """Drop them."""

    def _redraw(self, *, force: bool = False) -> None:
        now = time.monotonic()
        if force or now - self._drawn >= 1.0 / REDRAW_HZ:
            self._drawn = now
            self._live.update(render(self._view), refresh=True)

    def close(self) -> None:
        """Leave the last picture on the terminal."""
        self._redraw(force=True)
        self._live.stop()


def display(view: View, *, json: str | None) -> Observer:
    """The live view on a terminal, plain lines elsewhere; where JSON takes standard output, on standard error."""
    stream = sys.stderr if json == "-" else sys.stdout
    if is_terminal(stream):
        return LiveDisplay(view, stream)
    return EventsOnly() if json == "-" else PlainLines()


def write_json(file: TextOutput | None, item: Estimate | MonitorReport | SignalReport) -> None:
    """Write an estimate or a report as one line; the monitor has none before the first misfit."""
    if file is None or (isinstance(item, MonitorReport) and item.since != item.since):
        return
    if isinstance(item, SignalReport):
        value = json_values.signal_report(item)
    elif isinstance(item, MonitorReport):
        value = json_values.monitor_report(item)
    else:
        value = json_values.estimate(item)
    file.write(json_values.line(value) + "\n")
