"""Displays of a running session: which one is used, plain lines, and JSON lines; the live view is `live_display`."""

from __future__ import annotations

import math
import re
import sys
import time
from collections.abc import Iterable
from typing import Any, Protocol

from canid.io.recording.controls import Controls
from canid.ui.cli.output.live_display import LiveDisplay as LiveDisplay
from canid.ui.cli.output.outputs import TextOutput
from canid.ui.terminal.messages import info, print_line
from canid.ui.terminal.progress import is_terminal
from canid.ui.views import signal_text
from canid.ui.views.terminal_view.state import HealthLine, View
from canid.ui.views.terminal_view.state import Item as Item
from canid.values.text import estimate_text, json_values
from canid.values.types import Estimate, Event, MonitorReport, Sample, SignalReport

# s of the log between two plain lines of the same estimator with the same status
LINE_INTERVAL_S = 60.0
# s between two plain lines of the same trouble
TROUBLE_INTERVAL_S = 10.0


class Observer(Protocol):
    """Takes the outputs of the pipeline while they come: a display, the live page, a stream of UDP packets."""

    def put(self, item: Item) -> None:
        """Show one output."""

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Show the state of buses, recorder and estimators; `output` is the role of the driver's output."""

    def status(self, values: dict[str, Any]) -> None:
        """Take numbers on the session (`live_session.Recorded`) or on the replay, a few times a second."""

    def close(self) -> None:
        """End: leave the terminal as it was, close sockets."""


class Unshown:
    """What the displays below leave out."""

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Drop them."""

    def status(self, values: dict[str, Any]) -> None:
        """Drop them."""

    def close(self) -> None:
        """Nothing to restore."""


class EventsOnly(Unshown):
    """Events on standard error; the estimates go to standard output as JSON."""

    def put(self, item: Item) -> None:
        """Report an event, drop everything else."""
        if isinstance(item, Event):
            info(item.says)


class JsonLines(Unshown):
    """Estimates and reports as one line of JSON each."""

    def __init__(self, file: TextOutput | None) -> None:
        """Write to this file; None: nowhere."""
        self._file = file

    def put(self, item: Item) -> None:
        """Write an estimate or a report; the monitor has none before the first misfit."""
        if self._file is None or isinstance(item, Sample | Event):
            return
        if isinstance(item, MonitorReport) and item.since != item.since:
            return
        line = json_values.MonitorLine(item.t, item) if isinstance(item, MonitorReport) else item
        self._file.write(json_values.document("replay", line) + "\n")


class PlainLines(Unshown):
    """One line per change of status, and one a minute of the log."""

    def __init__(self, output: str = "") -> None:
        """Nothing is shown yet; `output`: role of the driver's output, for the unit of K."""
        self._output = output
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
            if (
                before is None
                or before.status is not item.status
                or item.t - before.t >= LINE_INTERVAL_S - 1e-6
            ):
                self._shown[item.estimator] = item
                print_line(estimate_text.estimate(item, self._output))
        elif isinstance(item, MonitorReport) and item.block != self._suspected:
            self._suspected = item.block
            print_line(estimate_text.monitor_report(item))
        elif isinstance(item, SignalReport):
            for line in signal_text.report(item):
                print_line(line)

    def lines(self, lines: Iterable[HealthLine], output: str = "") -> None:
        """Report what is wrong: at once, and every few seconds while it lasts and its numbers change."""
        self._output = output or self._output
        now = time.monotonic()
        for line in lines:
            if not line.wrong:
                continue
            key = _without_numbers(line.text)
            last, at = self._trouble.get(key, ("", -math.inf))
            if line.text != last and now - at >= TROUBLE_INTERVAL_S:
                self._trouble[key] = line.text, now
                info(line.text)


def _without_numbers(text: str) -> str:
    return re.sub(r"[\d.,]+", "#", text)


def display(view: View, *, json: str | None, controls: Controls | None = None) -> Observer:
    """The live view on a terminal, plain lines elsewhere; where JSON takes standard output, on standard error.

    `controls`: what the keys of the live view act on.
    """
    stream = sys.stderr if json == "-" else sys.stdout
    if is_terminal(stream):
        return LiveDisplay(view, stream, controls)
    return EventsOnly() if json == "-" else PlainLines(view.output)
