"""Writes .asc and candump .log: microseconds, whole lines. A time before the start is written as 0."""

from __future__ import annotations

import datetime
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.errors import OutputError
from canid.files.new_file import ChangedError, Disk
from canid.frame_columns import columns_of
from canid.logs import text_lines_of_columns as lines
from canid.logs.asc.asc_reader import EXACT_START_PREFIX
from canid.logs.blf.blf_layout import FD64_BRS, FD64_EDL, FD64_ESI, dlc_of
from canid.logs.candump_reader import ERROR_BIT
from canid.types import Columns, Event, Flag, Frame

# Lines wait in memory up to this size: few system calls, and never half a line in the file.
_BUFFER_BYTES = 64 * 1024
# Size of the caches of texts that are formatted once for all frames of a message: more ids than a car has.
_MAX_TEXTS = 4096
_ERROR, _FD, _EXTENDED = int(Flag.ERROR), int(Flag.FD), int(Flag.EXTENDED)
_REMOTE, _TX, _BRS, _ESI = int(Flag.REMOTE), int(Flag.TX), int(Flag.BRS), int(Flag.ESI)
_DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTH_NAMES = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


class _Part(NamedTuple):
    """Text that waits to be written."""

    text: bytes
    ends: npt.NDArray[np.int64] | None  # of each frame's line; None: text that is no frame's


class _TextWriter:
    """The file of either format."""

    def __init__(self, path: str | os.PathLike[str], start_ns: int | None = None):
        self.start_ns = start_ns
        self.lead_ns = 0
        self.frames = 0
        self.kept = 0
        self._waiting: list[_Part] = []
        self._length = 0
        self._begun = False
        self._ended = False
        self._middles = lines.TextCache(self._middle, _MAX_TEXTS)
        self._tails = lines.TextCache(self._tail_of, _MAX_TEXTS)
        self.disk = Disk(Path(path))

    @property
    def path(self) -> Path:
        """The file."""
        return self.disk.path

    @property
    def bytes(self) -> int:
        """Bytes in the file so far."""
        return self.disk.size

    @property
    def waiting(self) -> int:
        """Bytes that wait to be written."""
        return self._length

    def append(self, frame: Frame) -> None:
        """Take one frame."""
        self.append_columns(columns_of([frame]))

    def append_columns(self, chunk: Columns) -> None:
        """Take frames. Where writing fails, `frames` says how many were taken."""
        if not len(chunk.t):
            return
        self._begin()
        made = self._lines(chunk)
        self._waiting.append(_Part(made.text, made.ends))
        self._length += len(made.text)
        self.frames += len(made.ends)
        if self._length > _BUFFER_BYTES:
            self._write()

    def checkpoint(self, *, sync: bool = True) -> None:
        """Write the lines that wait; `sync`: down to the disk."""
        self._write()
        if sync:
            self.sync()

    def sync(self) -> None:
        """Sync what was written to the disk itself; another thread may call this at any time."""
        self.disk.sync()

    def complete(self) -> None:
        """Write the end; the file stays open."""
        if not self._ended:
            self._ended = True
            self._begin()
            self._add(self._tail())
        self.checkpoint()

    def close(self) -> None:
        """Write the end and close; a second call does nothing."""
        if self.disk.closed:
            return
        try:
            self.complete()
        finally:
            self.disk.close()

    def abandon(self) -> None:
        """Close without writing any more."""
        self.disk.close()

    def note(self, event: Event) -> None:
        """Write an event between the frames, where the format has comments."""
        self._begin()
        self._add(self._comment(event))

    def _begin(self) -> None:
        if not self._begun:
            self._begun = True
            self._add(self._head())

    def _head(self) -> str:
        return ""

    def _comment(self, event: Event) -> str:
        return ""

    def _tail(self) -> str:
        return ""

    def _lines(self, chunk: Columns) -> lines.Lines:
        raise NotImplementedError

    def _middle(self, key: lines.Key) -> str:
        """Text between time and data: the same for all frames of one message, and so formatted once."""
        raise NotImplementedError

    def _tail_of(self, key: lines.Key) -> str:
        """Text behind the data, with the line's end."""
        raise NotImplementedError

    def _add(self, text: str) -> None:
        """Take text that is no frame's."""
        if text:
            self._waiting.append(_Part(text.encode("ascii"), None))
            self._length += len(text)

    def _write(self) -> None:
        try:
            self.disk.append(b"".join([part.text for part in self._waiting]))
        except ChangedError:
            raise
        except OutputError:
            self._keep_whole()
            raise
        self._forget()
        self.kept = self.frames

    def _keep_whole(self) -> None:
        """Count the lines that a full disk took whole; what it took of the next one is cut off."""
        size = 0
        for text, ends in self._waiting:
            left = self.disk.taken - size
            whole = len(text) if len(text) <= left else 0
            if ends is not None:
                taken = int(np.searchsorted(ends, left, "right"))
                self.kept += taken
                whole = int(ends[taken - 1]) if taken else 0
            size += whole
            if whole < len(text):
                break
        self.disk.keep(size)
        self._forget()

    def _forget(self) -> None:
        self._waiting.clear()
        self._length = 0


def _microseconds(
    t: npt.NDArray[np.float64], zero: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Seconds and the microseconds of the rest; a time before `zero` us is 0."""
    us = np.maximum(np.rint(t * 1e6).astype(np.int64) + zero, 0)
    return us // 1_000_000, us % 1_000_000


class CandumpWriter(_TextWriter):
    """`candump -L` lines; a frame that was sent ends with ` T`, as newer candump versions mark it."""

    def _lines(self, chunk: Columns) -> lines.Lines:
        n = len(chunk.t)
        seconds, us = _microseconds(chunk.t, (self.start_ns or 0) // 1000)
        lengths = chunk.length.astype(np.int64)
        keys, which = lines.keyed(chunk, lengths)
        shown = np.where(chunk.flags & _REMOTE, 0, lengths)
        return lines.joined(
            [
                lines.text(b"(", n),
                lines.number(seconds),
                lines.text(b".", n),
                lines.number(us, digits=6, fill="0"),
                lines.texts(self._middles.of(keys), which),
                lines.hexadecimal(chunk.data, shown, spaced=False),
                lines.texts(self._tails.of(keys), which),
            ]
        )

    def _middle(self, key: lines.Key) -> str:
        bus, id_, flags, length = key
        shown = id_ | ERROR_BIT if flags & _ERROR else id_
        name = f"{shown:08X}" if flags & (_ERROR | _EXTENDED) else f"{shown:03X}"
        if flags & _REMOTE:
            body = f"R{length}" if length > 0 else "R"
        elif flags & _FD:
            bits = (1 if flags & _BRS else 0) | (2 if flags & _ESI else 0)
            body = f"#{bits:X}"
        else:
            body = ""
        return f") can{bus} {name}#{body}"

    def _tail_of(self, key: lines.Key) -> str:
        return " T\n" if key[2] & _TX else "\n"


class AscWriter(_TextWriter):
    """Vector's .asc, hex, absolute times, the date in local time as Vector's tools read it."""

    def _head(self) -> str:
        # whole microseconds, as the times of the frames
        zero = ((self.start_ns or 0) - self.lead_ns) // 1000 * 1000
        at = datetime.datetime.fromtimestamp(zero // 1_000_000_000)
        ms = zero // 1_000_000 % 1000
        date = f"{_DAYS[at.weekday()]} {_MONTH_NAMES[at.month - 1]} {at.day:02d} {at:%H:%M:%S}.{ms:03d} {at.year}"
        exact = f"{EXACT_START_PREFIX}{zero}\n" if self.start_ns is not None else ""
        return (
            f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n{exact}"
            f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n"
        )

    def _comment(self, event: Event) -> str:
        says = " ".join(event.says.split()).encode("ascii", "replace").decode()
        return f"// {event.t + self.lead_ns * 1e-9:.6f} canid {event.what}: {says}\n"

    def _tail(self) -> str:
        return "End TriggerBlock\n"

    def _lines(self, chunk: Columns) -> lines.Lines:
        n = len(chunk.t)
        seconds, us = _microseconds(chunk.t, self.lead_ns // 1000)
        lengths = chunk.length.astype(np.int64)
        keys, which = lines.keyed(chunk, lengths)
        shown = np.where(chunk.flags & (_REMOTE | _ERROR), 0, lengths)
        return lines.joined(
            [
                lines.number(seconds, digits=4, fill=" "),
                lines.text(b".", n),
                lines.number(us, digits=6, fill="0"),
                lines.texts(self._middles.of(keys), which),
                lines.hexadecimal(chunk.data, shown, spaced=True),
                lines.texts(self._tails.of(keys), which),
            ]
        )

    def _middle(self, key: lines.Key) -> str:
        bus, id_, flags, length = key
        if flags & _ERROR:
            return f" {bus + 1}  ErrorFrame"
        name = f"{id_:X}x" if flags & _EXTENDED else f"{id_:X}"
        way = "Tx" if flags & _TX else "Rx"
        if flags & _REMOTE:
            return f" {bus + 1}  {name:<15} {way:<4} r {length:x}"
        if not flags & _FD:
            return f" {bus + 1}  {name:<15} {way:<4} d {length:x} "
        brs, esi = int(bool(flags & _BRS)), int(bool(flags & _ESI))
        return f" CANFD {bus + 1:>3} {way:<4} {name:>8}  {'':>32} {brs} {esi} {dlc_of(length):x} {length:>2} "

    def _tail_of(self, key: lines.Key) -> str:
        flags = key[2]
        if flags & (_ERROR | _REMOTE) or not flags & _FD:
            return "\n"
        bits = FD64_EDL | (FD64_BRS if flags & _BRS else 0) | (FD64_ESI if flags & _ESI else 0)
        return f" {0:>8} {0:>4} {bits:>8X} {0:>8} {0:>8} {0:>8} {0:>8} {0:>8}\n"
