"""Events beside a log, one JSON object per line: `drive.blf` has `drive.events.jsonl`."""

from __future__ import annotations

import json
import threading
from pathlib import Path

from canid.frames import stamps
from canid.frames.log import log_suffix
from canid.types import Event


def journal_path(log: Path) -> Path:
    """Name the journal of a log.

    >>> journal_path(Path("a/drive-2.blf")).name
    'drive-2.events.jsonl'
    """
    suffix = log_suffix(log)
    return log.with_name(log.name[: len(log.name) - len(suffix)] + ".events.jsonl")


class Journal:
    """Appends events; the file begins with the first one. Any thread may write; nothing is ever raised."""

    def __init__(self, log: Path | None):
        """`log`: the log it stands beside; None: events go nowhere."""
        self.path = None if log is None else journal_path(log)
        self.failed = 0  # events that could not be written
        self._lock = threading.Lock()

    def write(self, event: Event, start_ns: int | None) -> None:
        """Append an event. `start_ns`: epoch ns of its t = 0."""
        if self.path is None:
            return
        utc = None if start_ns is None else stamps.epoch_seconds(start_ns + round(event.t * 1e9))
        line = json.dumps(
            {"t": event.t, "utc": utc, "what": event.what, "says": event.says}, ensure_ascii=False
        )
        with self._lock:
            try:
                # opened each time: events are rare, and come after the recorder's end as well
                with open(self.path, "a", encoding="utf-8") as file:
                    file.write(line + "\n")
            except (OSError, ValueError):
                self.failed += 1
