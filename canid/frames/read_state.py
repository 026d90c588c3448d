"""What is known of a log while it is read: filled in by a reader, looked at by `Log`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from canid.frames.columns import Wanted
from canid.types import Columns, Damage, Event, Frame


class Note(NamedTuple):
    """An event that a recorder wrote between the frames."""

    row: int  # how many frames stand before it
    event: Event  # its time counts from the first frame, as theirs


@dataclass
class ReadState:
    """One reading of one log."""

    size: int = 0  # bytes of the file
    done: int = 0  # bytes read so far
    unpacked: int = 0  # how far within what these hold unpacked: grows wherever work goes on
    start_ns: int | None = None  # epoch ns of the first frame, known before it is yielded
    damage: Damage | None = None  # known when the reading is over
    # events so far, where they are wanted: whoever gave the list may take them out
    notes: list[Note] | None = None
    others: int = 0  # objects that are neither frames nor such events


# A reader of one format. Raises LogError where nothing at all can be read.
Read = Callable[[Path, ReadState], Iterator[Frame]]
# The same, as columns; of frames with ids that are not wanted (None: all are) some may be left out.
ReadColumns = Callable[[Path, ReadState, Wanted | None], Iterator[Columns]]
