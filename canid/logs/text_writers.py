"""Writes .asc and candump .log: microseconds, whole lines. A time before the start is written as 0."""

from __future__ import annotations

import datetime
import os
from pathlib import Path

from canid.errors import OutputError
from canid.files.new_file import ChangedError, Disk
from canid.logs.asc.asc_reader import EXACT_START_PREFIX
from canid.logs.blf.blf_layout import FD64_BRS, FD64_EDL, FD64_ESI, dlc_of
from canid.logs.candump_reader import ERROR_BIT
from canid.types import Event, Flag, Frame

# Lines wait in memory up to this size: few system calls, and never half a line in the file.
_BUFFER_BYTES = 64 * 1024
# Size of the cache of texts that are formatted once for all frames of a message: more ids than a car has.
_MAX_MIDDLES = 4096
# plain numbers: an operation on an enumeration takes a third of a microsecond, and a line has five of them
_ERROR, _FD, _EXTENDED = int(Flag.ERROR), int(Flag.FD), int(Flag.EXTENDED)
_REMOTE, _TX, _BRS, _ESI = int(Flag.REMOTE), int(Flag.TX), int(Flag.BRS), int(Flag.ESI)
_DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTH_NAMES = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


class _TextWriter:
    """The file of either format."""

    def __init__(self, path: str | os.PathLike[str], start_ns: int | None = None):
        self.start_ns = start_ns
        self.lead_ns = 0
        self.frames = 0
        self.kept = 0
        self._waiting: list[str] = []
        self._others: set[int] = set()  # indices in `_waiting` that are no frames
        self._length = 0
        self._begun = False
        self._ended = False
        self._middles: dict[tuple[int, int, int, int], str] = {}
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
        if not self._begun:
            self._begin()
        line = self._line(frame)
        self._waiting.append(line)
        self._length += len(line)
        self.frames += 1
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

    def _line(self, frame: Frame) -> str:
        raise NotImplementedError

    def _middle(self, bus: int, id_: int, flags: int, length: int) -> str:
        """Text between time and data: the same for all frames of one message, and so formatted once."""
        key = (bus, id_, flags, length)
        text = self._middles.get(key)
        if text is None:
            if len(self._middles) >= _MAX_MIDDLES:
                self._middles.clear()
            text = self._middles[key] = self._format_middle(*key)
        return text

    def _format_middle(self, bus: int, id_: int, flags: int, length: int) -> str:
        raise NotImplementedError

    def _add(self, text: str) -> None:
        """Take text that is no frame's."""
        self._others.add(len(self._waiting))
        self._waiting.append(text)
        self._length += len(text)

    def _write(self) -> None:
        try:
            self.disk.append("".join(self._waiting).encode("ascii"))
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
        for index, text in enumerate(self._waiting):
            if size + len(text) > self.disk.taken:
                break
            size += len(text)
            self.kept += index not in self._others
        self.disk.keep(size)
        self._forget()

    def _forget(self) -> None:
        self._waiting.clear()
        self._others.clear()
        self._length = 0


class CandumpWriter(_TextWriter):
    """`candump -L` lines; a frame that was sent ends with ` T`, as newer candump versions mark it."""

    def _line(self, frame: Frame) -> str:
        t, bus, id_, data, flags, length = frame
        us = (self.start_ns or 0) // 1000 + round(t * 1e6)
        seconds, us = divmod(us if us > 0 else 0, 1_000_000)
        middle = self._middle(bus, id_, flags, length)
        octets = "" if flags & _REMOTE else data.hex().upper()
        return f"({seconds}.{us:06d}{middle}{octets}{' T' if flags & _TX else ''}\n"

    def _format_middle(self, bus: int, id_: int, flags: int, length: int) -> str:
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

    def _line(self, frame: Frame) -> str:
        t, bus, id_, data, flags, length = frame
        us = round(t * 1e6) + self.lead_ns // 1000
        seconds, us = divmod(us if us > 0 else 0, 1_000_000)
        stamp = f"{seconds:4d}.{us:06d}"
        if flags & _ERROR:
            return f"{stamp} {bus + 1}  ErrorFrame\n"
        if flags & _REMOTE:
            return f"{stamp}{self._middle(bus, id_, flags, max(length, 0))}\n"
        middle = self._middle(bus, id_, flags, len(data))
        if not flags & _FD:
            return f"{stamp}{middle}{data.hex(' ').upper()}\n"
        bits = FD64_EDL | (FD64_BRS if flags & _BRS else 0) | (FD64_ESI if flags & _ESI else 0)
        return f"{stamp}{middle}{data.hex(' ').upper()} {0:>8} {0:>4} {bits:>8X} {0:>8} {0:>8} {0:>8} {0:>8} {0:>8}\n"

    def _format_middle(self, bus: int, id_: int, flags: int, length: int) -> str:
        name = f"{id_:X}x" if flags & _EXTENDED else f"{id_:X}"
        way = "Tx" if flags & _TX else "Rx"
        if flags & _REMOTE:
            return f" {bus + 1}  {name:<15} {way:<4} r {length:x}"
        if not flags & _FD:
            return f" {bus + 1}  {name:<15} {way:<4} d {length:x} "
        brs, esi = int(bool(flags & _BRS)), int(bool(flags & _ESI))
        return f" CANFD {bus + 1:>3} {way:<4} {name:>8}  {'':>32} {brs} {esi} {dlc_of(length):x} {length:>2} "
