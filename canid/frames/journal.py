"""Events beside a log, one JSON object per line: `drive.blf` has `drive.events.jsonl`."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from queue import SimpleQueue

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
    """Appends events; the file begins with the first one. Any thread may write; nothing is ever raised.

    Nobody waits for the disk: a thread of its own writes, until `close`; what comes later is written at once.
    """

    def __init__(self, log: Path | None):
        """`log`: the log it stands beside; None: events go nowhere."""
        self.path = None if log is None else journal_path(log)
        self.failed = 0  # events that could not be written
        self._zero = 0.0  # s, session time at which the log's own time begins
        self._lock = threading.Lock()
        self._lines: SimpleQueue[tuple[Path, str] | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._closed = False

    def follow(self, log: Path, zero: float) -> None:
        """The recording goes on in this log, whose own time begins at `zero` s."""
        with self._lock:
            self.path, self._zero = journal_path(log), zero

    def write(self, event: Event, start_ns: int | None) -> None:
        """Append an event. `start_ns`: epoch ns of its t = 0."""
        utc = None if start_ns is None else stamps.epoch_seconds(start_ns + round(event.t * 1e9))
        with self._lock:
            if self.path is None:
                return
            told = {"t": event.t - self._zero, "utc": utc, "what": event.what, "says": event.says}
            line = json.dumps(told, ensure_ascii=False)
            if self._closed:
                self._append(self.path, line)
                return
            self._lines.put((self.path, line))
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="canid-journal", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Have written what was given so far."""
        with self._lock:
            self._closed = True
            self._lines.put(None)
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while (item := self._lines.get()) is not None:
            self._append(*item)

    def _append(self, path: Path, line: str) -> None:
        try:
            # opened each time: events are rare, and come after the recorder's end as well
            with open(path, "a", encoding="utf-8") as file:
                file.write(line + "\n")
        except (OSError, ValueError):
            self.failed += 1
