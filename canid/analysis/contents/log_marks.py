"""Marks that a person made while a log was recorded: they stand in the recording's journal."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from canid.io.recording.journal import journal_path

# bytes of a journal that are read: some 100,000 events
MAX_BYTES = 16_000_000
MOST_MARKS = 200


class LogMark(NamedTuple):
    """A mark at a time of a log."""

    t: float  # s since the log's first frame
    says: str


def marks_of(log: str | Path) -> tuple[LogMark, ...]:
    """The first `MOST_MARKS` marks of a log's journal; none where there is no journal."""
    try:
        with journal_path(Path(log)).open("rb") as file:
            lines = file.read(MAX_BYTES).decode("utf-8", "replace").splitlines()
    except OSError:
        return ()
    return marks(lines)


def marks(lines: Iterable[str]) -> tuple[LogMark, ...]:
    """Marks among the events of a journal; lines that are none are passed over.

    Example:
        >>> marks(['{"t": 1.5, "what": "mark", "says": "bend"}', '{"t": 2.0, "what": "bus_lost", "says": ""}', "{"])
        (LogMark(t=1.5, says='bend'),)
    """
    out: list[LogMark] = []
    for line in lines:
        try:
            event = json.loads(line)
            if event["what"] == "mark" and len(out) < MOST_MARKS:
                out.append(LogMark(float(event["t"]), str(event["says"])))
        except (ValueError, TypeError, KeyError, RecursionError):
            continue
    return tuple(out)
