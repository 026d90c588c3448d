"""Writes .asc and candump .log: microseconds, whole lines."""

from __future__ import annotations

import datetime
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.files.held_folder import HeldFolder
from canid.io.files.new_file import ChangedError, Disk
from canid.io.logs import text_lines_of_columns as lines
from canid.io.logs.asc.asc_reader import ERROR_DATA_PREFIX, EXACT_START_PREFIX
from canid.io.logs.blf.blf_layout import FD64_BRS, FD64_EDL, FD64_ESI, dlc_of
from canid.io.logs.candump_reader import ERROR_BIT
from canid.io.logs.own_times import check_own_times
from canid.io.logs.writer import Writer
from canid.values import timestamps
from canid.values.errors import OutputError
from canid.values.types import Columns, Event, Flag

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


class _TextWriter(Writer):
    """The file of either format."""

    def __init__(
        self, path: str | os.PathLike[str], start_ns: int | None = None, folder: HeldFolder | None = None
    ):
        super().__init__(start_ns)
        self._parts: list[_Part] = []
        self._begun = False
        self._ended = False
        self._middles = lines.TextCache(self._middle, _MAX_TEXTS)
        self._tails = lines.TextCache(self._tail_of, _MAX_TEXTS)
        self.disk = Disk(Path(path), folder=folder)

    def append_columns(self, chunk: Columns) -> None:
        """Take frames. Where writing fails, `frames` says how many were taken."""
        if not len(chunk.t):
            return
        self._begin()
        made = self._lines(chunk)
        self._parts.append(_Part(made.text, made.ends))
        self.waiting += len(made.text)
        self.frames += len(made.ends)
        if self.waiting > _BUFFER_BYTES:
            self._write()

    def complete(self) -> None:
        """Write the end; the file stays open."""
        if not self._ended:
            self._ended = True
            self._begin()
            self._add(self._tail())
        super().complete()

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
            self._parts.append(_Part(text.encode("ascii"), None))
            self.waiting += len(text)

    def _write(self) -> None:
        try:
            self.disk.append(b"".join([part.text for part in self._parts]))
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
        for text, ends in self._parts:
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
        self._parts.clear()
        self.waiting = 0


def _microseconds(
    t: npt.NDArray[np.float64], zero_ns: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Seconds since `zero_ns` and the microseconds of the rest. Raises ValueError for a time before it."""
    us, ns = np.divmod(np.rint(t * 1e9).astype(np.int64) - zero_ns, 1000)
    us += (ns > 500) | ((ns == 500) & (us % 2 == 1))
    check_own_times(us)
    return us // 1_000_000, us % 1_000_000


class CandumpWriter(_TextWriter):
    """`candump -L` lines; a frame that was sent ends with ` T`, as newer candump versions mark it."""

    @property
    def earliest_ns(self) -> int:
        """The earliest t that the file holds, ns: its times count from 1970."""
        return -self.lead_ns if self.start_ns is None else -self.start_ns

    def _lines(self, chunk: Columns) -> lines.Lines:
        n = len(chunk.t)
        seconds, us = _microseconds(chunk.t, self.earliest_ns)
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
        zero, _ = timestamps.log_zero(self.start_ns, self.lead_ns)
        at = datetime.datetime.fromtimestamp(zero // 1_000_000_000)
        ms = zero // 1_000_000 % 1000
        date = f"{_DAYS[at.weekday()]} {_MONTH_NAMES[at.month - 1]} {at.day:02d} {at:%H:%M:%S}.{ms:03d} {at.year}"
        exact = f"{EXACT_START_PREFIX}{zero}\n" if self.start_ns is not None else ""
        return (
            f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n{exact}"
            f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n"
        )

    def _comment(self, event: Event) -> str:
        check_own_times(np.array([round(event.t * 1e9) - self.earliest_ns]))
        says = " ".join(event.says.split()).encode("ascii", "replace").decode()
        return f"// {event.t - self.earliest_ns * 1e-9:.6f} canid {event.what}: {says}\n"

    def _tail(self) -> str:
        return "End TriggerBlock\n"

    def _lines(self, chunk: Columns) -> lines.Lines:
        n = len(chunk.t)
        seconds, us = _microseconds(chunk.t, self.earliest_ns)
        lengths = chunk.length.astype(np.int64)
        keys, which = lines.keyed(chunk, lengths)
        error = (chunk.flags & _ERROR) != 0
        there = np.where(chunk.flags & _REMOTE, 0, lengths)
        return lines.joined(
            [
                *self._error_data(chunk, np.where(error, np.minimum(there, 8), 0)),
                lines.number(seconds, digits=4, fill=" "),
                lines.text(b".", n),
                lines.number(us, digits=6, fill="0"),
                lines.texts(self._middles.of(keys), which),
                lines.hexadecimal(chunk.data, np.where(error, 0, there), spaced=True),
                lines.texts(self._tails.of(keys), which),
            ]
        )

    @staticmethod
    def _error_data(chunk: Columns, lengths: npt.NDArray[np.int64]) -> list[lines.Block]:
        """The data of error frames, for which their lines have no place, in comments before them."""
        if not lengths.any():
            return []
        which = (lengths > 0).astype(np.int64)
        data = lines.hexadecimal(chunk.data, lengths, spaced=True)
        return [lines.texts(["", ERROR_DATA_PREFIX], which), data, lines.texts(["", "\n"], which)]

    def _middle(self, key: lines.Key) -> str:
        bus, id_, flags, length = key
        if flags & _ERROR:
            if not (id_ or length or flags & _EXTENDED):
                return f" {bus + 1}  ErrorFrame"
            # Vector's fields; flags of zero: the codes and the position are not known
            name = f"{id_}{'x' if flags & _EXTENDED else ''}"
            codes = f"Flags = 0x0 CodeExt = 0x0 Code = 0x0 ID = {name} DLC = {length}"
            return f" {bus + 1}  ErrorFrame {codes} Position = 0 Length = 0"
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
