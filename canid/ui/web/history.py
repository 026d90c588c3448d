"""What a client that connects late is given: the session so far, thinned out to bounded memory."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

# samples that are kept as they came: two minutes at 10 Hz
RECENT_SAMPLES = 1200
# estimates of one estimator that are kept as they came: five minutes
RECENT_ESTIMATES = 600
# older rows, at equal intervals that double whenever there are more: a plot has 1,000 to 2,000 pixels
MAX_OLDER = 1500
MAX_EVENTS = 200
# digits of numbers that are only drawn
DIGITS = 5
# what is drawn of a sample, apart from output and inputs
SAMPLE_SIGNALS = ("speed", "gap", "headway", "range_rate", "lateral_offset")
PARAMETERS = ("K", "tau", "dead_time", "tau_plus_dead_time")


class Thinned:
    """Rows in time: the recent ones whole, older ones at equal intervals, in bounded memory.

    Example:
        >>> rows = Thinned(recent=2, older=4)
        >>> for t in range(20): rows.add(float(t), t)
        >>> rows.rows()
        [0, 8, 16, 18, 19]
    """

    def __init__(self, recent: int, older: int = MAX_OLDER) -> None:
        """Keep `recent` rows as they come and at most `older` before them."""
        self._recent: deque[tuple[float, Any]] = deque(maxlen=recent)
        self._older: list[tuple[float, Any]] = []
        self._max_older = older
        self._interval = 0.0  # s

    def add(self, t: float, row: Any) -> None:
        """Take a row."""
        if len(self._recent) == self._recent.maxlen:
            old = self._recent[0]
            if not self._older or self._bucket(old[0]) != self._bucket(self._older[-1][0]):
                self._older.append(old)
        self._recent.append((t, row))
        while len(self._older) >= self._max_older:
            # the first interval: that of the rows themselves
            spacing = (self._older[-1][0] - self._older[0][0]) / (len(self._older) - 1)
            self._interval = 2.0 * max(self._interval, spacing, 1e-9)
            kept: list[tuple[float, Any]] = []
            for old_row in self._older:
                if not kept or self._bucket(old_row[0]) != self._bucket(kept[-1][0]):
                    kept.append(old_row)
            self._older = kept

    def _bucket(self, t: float) -> float:
        return math.floor(t / self._interval) if self._interval else t

    def rows(self) -> list[Any]:
        """All rows that are kept, in order."""
        return [row for _, row in (*self._older, *self._recent)]


class History:
    """The session so far, from the messages of `canid.ui.web.messages`."""

    def __init__(self) -> None:
        """Nothing has come yet."""
        self._start: dict[str, Any] = {}
        self.clear()

    def clear(self) -> None:
        """Forget what a replay that begins anew will give again."""
        self._samples = Thinned(RECENT_SAMPLES)
        self._estimates: dict[str, Thinned] = {}
        self._events: deque[dict[str, Any]] = deque(maxlen=MAX_EVENTS)
        self._latest: dict[str, Any] = {}  # of each kind that is shown as it is
        self._latest_estimates: dict[str, Any] = {}
        self._latest_headline: dict[str, Any] | None = None

    def take(self, message: dict[str, Any]) -> None:
        """Take one message."""
        kind = message["kind"]
        if kind == "start":
            self._start = message
        elif kind == "reset":
            self.clear()
        elif kind == "sample":
            self._samples.add(message["t"], sample_row(message))
            self._latest["sample"] = message
        elif kind == "estimate":
            value = message["value"]
            name = value["estimator"]
            self._latest_estimates[name] = message
            if value["headline"]:
                self._latest_headline = message
            if value["t"] is not None:
                rows = self._estimates.setdefault(name, Thinned(RECENT_ESTIMATES))
                rows.add(value["t"], estimate_row(value))
        elif kind == "event":
            self._events.append(message)
        else:
            self._latest[kind] = message

    def snapshot(self) -> dict[str, Any]:
        """Everything, as one message."""
        return {
            "kind": "snapshot",
            "start": self._start,
            "samples": self._samples.rows(),
            "estimates": {name: rows.rows() for name, rows in self._estimates.items()},
            "latest": [*self._latest.values(), *self._latest_estimates.values()],
            "headline": self._latest_headline,
            "events": list(self._events),
        }


def sample_row(message: dict[str, Any]) -> dict[str, Any]:
    """What is drawn of a sample, with the digits that a drawing needs."""
    signals = message["signals"]
    return {
        "t": message["t"],
        "output": _short(message["output"]),
        "inputs": {name: _short(x) for name, x in message["inputs"].items()},
        "learn": message["learn"],
        "segment": message["segment"],
        "signals": {role: _short(signals[role]) for role in SAMPLE_SIGNALS if role in signals},
    }


def estimate_row(value: dict[str, Any]) -> dict[str, Any]:
    """What is drawn of an estimate: value, low and high of each parameter of each channel."""
    return {
        "t": value["t"],
        "status": value["status"],
        "channels": {
            name: {"status": channel["status"]}
            | {what: [_short(channel[what][end]) for end in ("value", "low", "high")] for what in PARAMETERS}
            for name, channel in value["channels"].items()
        },
    }


def _short(x: float | None) -> float | None:
    return None if x is None else float(f"{x:.{DIGITS}g}")
