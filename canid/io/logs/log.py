"""`open_log`: any log file as a stream of frames."""

from __future__ import annotations

import datetime
import importlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from canid.io.logs import content, formats
from canid.io.logs.copies import Copies
from canid.io.logs.input_file import regular_file
from canid.io.logs.local_time import zone_of
from canid.io.logs.reader_state import Note, Read, ReadState, SymbolicLogError
from canid.io.logs.restarts import Restarts
from canid.io.logs.text_lines import MAX_TIME_NS
from canid.values import timestamps
from canid.values.errors import ConfigError, LogError
from canid.values.frame_columns import WantedIds, frames_of, select
from canid.values.shipped_files import located
from canid.values.types import Columns, Damage, Frame


class Named(Protocol):
    """A message of a database."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def id(self) -> int:
        """Its id."""

    @property
    def extended(self) -> bool:
        """Whether that has 29 bits."""


class Log:
    """The frames of one file. Iterate as often as you like: each iteration reads the file again.

    `damage` is known when an iteration is over; `progress` (0..1) is the share of the file that it has read.
    """

    entries = "frames"  # what its file lists
    _is_symbolic = False  # it has names of messages for their ids, see `know`

    def __init__(
        self,
        path: Path,
        read: Read,
        form: formats.Format,
        zone: datetime.tzinfo | None = None,
    ):
        self.path = path
        self.format = form
        self._zone = zone
        self._read = read
        # interface -> bus, where the format has names (candump); see `values.bus_names`
        self.buses: dict[str, int] = {}
        self._names: dict[str, tuple[int, bool]] = {}
        self._begin()

    def _begin(self) -> None:
        """Read the first frame, for the start; that of a symbolic log waits for its database."""
        self._state = self._new_state()
        chunks = self._read(self.path, self._state, None)
        try:
            next(chunks, None)
        except SymbolicLogError:
            self._is_symbolic = True
        chunks.close()  # type: ignore[attr-defined]  # it is a generator: close the file now
        self._first_remarks = tuple(self._state.remarks)
        start = self._state.start_ns
        # as `start_utc`, exactly; None where the log does not state it, or one that is 146 years away or more
        self.start_ns = start if start is not None and abs(start) <= MAX_TIME_NS else None
        self.start_utc = timestamps.epoch_seconds(self.start_ns)
        self._state = self._new_state()

    def _new_state(self, notes: list[Note] | None = None) -> ReadState:
        size = self.path.stat().st_size
        return ReadState(size=size, zone=self._zone, notes=notes, buses=self.buses, names=self._names)

    def know(self, messages: Iterable[Named]) -> None:
        """Give the messages of a database, by which a log with symbolic names in place of ids is read."""
        if self._is_symbolic and (more := {each.name: (each.id, each.extended) for each in messages}):
            self._names.update(more)
            self._begin()

    @property
    def damage(self) -> Damage | None:
        """What could not be read; None before the end of an iteration, or when all was well."""
        return self._state.damage

    @property
    def frames_read(self) -> int:
        """How many CAN frames the latest iteration has read; all of them, whichever ids were asked for."""
        return self._state.frames

    @property
    def events_read(self) -> int:
        """How many events of canid's recorder are between them (.blf, .asc)."""
        return self._state.events

    @property
    def others(self) -> int:
        """How many lines or objects are known to hold no CAN frame: comments, statistics, other buses, ..."""
        return self._state.others

    @property
    def other_kinds(self) -> dict[str, int]:
        """The same, how many of each kind; the most frequent first. The number of kinds is bounded."""
        return dict(self._state.other_kinds.most_common())

    @property
    def others_says(self) -> str:
        r"""The same in one sentence, "" where there are none.

        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "drive.log"
        >>> _ = path.write_text("# a remark\n(1.0) can0 123#11\n(1.1) can0 123#22\n")
        >>> log = open_log(path)
        >>> len(list(log)), log.others_says
        (2, '1 line of no interest: 1 comments')
        """
        if not self.others:
            return ""
        what = ("line" if self.format.is_text else "object") + "s" * (self.others != 1)
        kinds = ", ".join(f"{n} {kind}" for kind, n in self.other_kinds.items())
        return f"{self.others} {what} of no interest: {kinds}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """How the file was understood where it may be read in two ways, a sentence each; all are known with `damage`."""
        return tuple(dict.fromkeys((*self._first_remarks, *self._state.remarks)))

    @property
    def start_says(self) -> str:
        """What the file does not state of its start, "" where that is clear. Known with `damage`."""
        return self._state.start_says

    @property
    def damaged(self) -> int:
        """How many lines (.blf: stretches of bytes) could not be read; the first cause is in `damage`.

        Frames, events, others and damaged lines are all lines of a text log that are not blank; none is counted twice.
        """
        return self._state.damaged

    @property
    def progress(self) -> float:
        """Share of the file that the latest iteration has read."""
        return min(1.0, self._state.done / self._state.size) if self._state.size else 1.0

    def __iter__(self) -> Iterator[Frame]:
        for chunk in self.columns():
            yield from frames_of(chunk)

    def columns(self, ids: Iterable[int] | None = None, notes: list[Note] | None = None) -> Iterator[Columns]:
        """The frames as columns, some thousands at a time: however long the log, memory is bounded.

        The same frames as one by one, many times faster where the format allows (.blf, .asc).
        `ids`: the ids that are wanted; frames with others may be left out.
        `notes`: takes the events that canid's recorder wrote between the frames (.blf, .asc), at the latest with the
        frames that they precede; the caller may empty the list. Their rows count all frames yielded.
        """
        wanted = None if ids is None else WantedIds(ids)
        unjudged: list[Note] | None = None if notes is None else []
        state = self._state = self._new_state(unjudged)
        copies = Copies()
        # of a log without a date all frames are needed, to see where its times begin again
        undated = self.format.is_text and self.entries == "frames" and self.start_ns is None
        restarts = Restarts(state) if undated else None
        try:
            for chunk in self._read(self.path, state, wanted if restarts is None else None):
                kept = copies.step(chunk)
                _hand_over(unjudged, notes, copies)
                yield from _kept([kept] if restarts is None else restarts.step(kept), wanted)
        except OSError as error:
            raise LogError(f"cannot read {self.path}: {error.strerror or error}") from None
        rest = copies.end()
        _hand_over(unjudged, notes, copies)
        if restarts is not None:
            rest = [part for kept in rest for part in restarts.step(kept)] + restarts.end()
        yield from _kept(rest, wanted)
        if copies.count:
            state.frames -= copies.count
            state.other_kinds[f"copies of {self.entries}"] += copies.count
            state.remark(
                f"{copies.count:,} {self.entries} are copies of others, with the same time and data, as of a log that was "
                "appended or merged twice: they are left out"
            )


def _kept(chunks: Iterable[Columns], wanted: WantedIds | None) -> Iterator[Columns]:
    """The frames that are wanted."""
    for chunk in chunks:
        few = chunk if wanted is None else select(chunk, wanted.rows(chunk.id))
        if few.t.size:
            yield few


def _hand_over(unjudged: list[Note] | None, notes: list[Note] | None, copies: Copies) -> None:
    """Give the events on whose frames are judged; of copies they count none."""
    if unjudged is None or notes is None:
        return
    before = copies.count - len(copies.left_out)
    judged = [note for note in unjudged if note.row <= copies.rows]
    del unjudged[: len(judged)]
    notes += [
        note._replace(row=note.row - before - int(np.searchsorted(copies.left_out, note.row)))
        for note in judged
    ]


# how measurements in other files become tables
_AS_TABLE = {
    (".xlsx", ".xls", ".xlsm", ".ods", ".numbers"): ": save the sheet as CSV",
    (
        ".json",
        ".jsonl",
        ".h5",
        ".hdf5",
        ".feather",
        ".arrow",
        ".pkl",
        ".npy",
        ".npz",
        ".mat",
        ".db3",
        ".bag",
    ): (": from Python, canid.from_frame or canid.from_arrays takes the columns"),
}


def _format(path: Path, suffix: str) -> formats.Format:
    """The format by the first lines of a text, otherwise by the suffix. Raises ConfigError, LogError."""
    try:
        form, lines = content.head_of(path)
    except OSError as error:
        raise LogError(f"cannot read {path}: {error.strerror or error}") from None
    if form is not None:
        if form.format is None:
            raise content.refuse(path, form)
        return form.format
    known = formats.format_of(path)
    may_be_table = suffix.removesuffix(".gz") in formats.TABLE_SUFFIXES
    if suffix in formats.TABLES_ALONE or (may_be_table and content.is_table(lines)):
        raise ConfigError(
            f"{path}: is a table of named columns and lists no CAN frames: `canid identify {path.name}` reads it"
        )
    if known is None:
        known_suffixes = ", ".join(formats.read_suffixes())
        tables = ", ".join((*formats.TABLE_SUFFIXES, *formats.TABLES_ALONE))
        remedy = next((way for kinds, way in _AS_TABLE.items() if suffix.removesuffix(".gz") in kinds), "")
        raise ConfigError(
            f"{path}: unknown log format {suffix or '(no suffix)'!r}; known are {known_suffixes}; tables are read as "
            f"{tables}{remedy}"
        )
    return known


def open_log(path: str | os.PathLike[str], *, time_zone: str | None = None) -> Log:
    """Open a log; the suffix names the format (see `formats`). The name of a shipped one is enough.

    `time_zone`: of local times in it, an IANA name, "UTC" or an offset as "+08:00"; None: what CANID_TIME_ZONE names,
    else this machine's (see `local_time`).

    Times are s since the first frame, exact to the nanosecond that the format has; `start_utc` is the epoch
    time of the first frame, NaN where the log does not state it.

    Raises ConfigError for a missing file, an unknown suffix or a missing optional package, LogError where
    there is no log that can be read. A log that is damaged in part is read in part: see `Log.damage`.

    >>> import tempfile
    >>> from canid.io.logs.log_writer import write_log
    >>> path = Path(tempfile.mkdtemp()) / "drive.blf"
    >>> write_log(path, [Frame(0.0, 0, 0x123, b"abc"), Frame(0.5, 1, 0x7, b"")], start_utc=1533224087.0)
    >>> log = open_log(path)
    >>> [(frame.t, frame.bus, hex(frame.id), frame.data) for frame in log]
    [(0.0, 0, '0x123', b'abc'), (0.5, 1, '0x7', b'')]
    >>> log.start_utc, log.damage
    (1533224087.0, None)
    """
    path = located(path)
    zone = zone_of(time_zone)
    status = regular_file(path)
    suffix = formats.log_suffix(path)
    known = _format(path, suffix)
    # a candump log has no header: without frames, as of a silent bus, it is empty
    if status.st_size == 0 and suffix != ".log":
        raise LogError(f"{path} is empty")
    module = importlib.import_module(known.module)
    read: Read = getattr(module, known.reader)
    try:
        return Log(path, read, known, zone)
    except OSError as error:
        raise LogError(f"cannot read {path}: {error.strerror or error}") from None
