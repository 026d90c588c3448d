"""State of reading a log: filled in by a reader, shown by `Log`.

Every line or object of a log is counted in one class, and in one only: a CAN frame, a recorder's event, known to hold
no CAN frame, or damaged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import tzinfo
from pathlib import Path
from typing import NamedTuple

from canid.values.errors import ConfigError
from canid.values.frame_columns import WantedIds
from canid.values.types import Columns, Damage, Event

# of a file that was joined of hundreds
_MAX_REMARKS = 20


class SymbolicLogError(ConfigError):
    """A log has names of messages for their ids, and no database is known that has these."""


class Note(NamedTuple):
    """An event that a recorder wrote between the frames."""

    row: int  # how many frames stand before it
    event: Event  # its time counts from the first frame, as theirs


@dataclass
class ReadState:
    """One reading of one log."""

    size: int = 0  # bytes of the file
    zone: tzinfo | None = None  # of local times; None: this machine's
    done: int = 0  # bytes read so far
    unpacked: int = 0  # progress within the unpacked data: changes wherever work goes on
    # interface -> bus, of formats that name them; a reader that has to look for them does so once a log
    buses: dict[str, int] = field(default_factory=dict)
    # of symbolic messages (.asc), each with its id and whether that has 29 bits; none: the log has ids
    names: dict[str, tuple[int, bool]] = field(default_factory=dict)
    start_ns: int | None = None  # epoch ns of the first frame, known before it is yielded
    damage: Damage | None = None  # known when the reading is over
    # events so far, where they are wanted: the owner of the list may empty it
    notes: list[Note] | None = None
    frames: int = 0  # CAN frames that were read, wanted or not
    events: int = 0  # events of canid's recorder
    # lines or objects that are known to hold no CAN frame: how many of each kind; kinds are of a closed list
    other_kinds: Counter[str] = field(default_factory=Counter)
    damaged: int = 0  # lines, objects or stretches of bytes that could not be read
    start_says: str = ""  # what the file does not state of its start
    remarks: list[str] = field(default_factory=list)  # how the file was read, where that is a decision

    def remark(self, says: str) -> None:
        """Note a decision of the reader, once; the first twenty are kept."""
        if says not in self.remarks and len(self.remarks) < _MAX_REMARKS:
            self.remarks.append(says)

    @property
    def others(self) -> int:
        """Lines or objects that are known to hold no CAN frame."""
        return self.other_kinds.total()


# A reader of one format; of frames with ids that are not wanted (None: all are) some may be left out. Raises LogError where
# nothing at all can be read.
Read = Callable[[Path, ReadState, WantedIds | None], Iterator[Columns]]
