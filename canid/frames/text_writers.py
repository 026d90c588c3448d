"""Writes .asc and candump .log: microseconds, whole lines. A time before the start is written as 0."""

from __future__ import annotations

import datetime
import os
from pathlib import Path

from canid.frames.asc_reader import EXACT_START
from canid.frames.blf_layout import FD64_BRS, FD64_EDL, FD64_ESI, dlc_of
from canid.frames.candump_reader import ERROR_BIT
from canid.frames.disk import Disk
from canid.types import Event, Flag, Frame

# Lines wait in memory up to this size: few system calls, and never half a line in the file.
_WAITING = 64 * 1024
_DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


class _TextWriter:
    """What both formats share: the file."""

    def __init__(self, path: str | os.PathLike[str], start_ns: int | None = None, *, overwrite: bool = False):
        self.path = Path(path)
        self.start_ns = start_ns
        self.lead_ns = 0
        self.frames = 0
        self.kept = 0
        self._waiting: list[str] = []
        self._length = 0
        self._begun = False
        self._disk = Disk(self.path, overwrite=overwrite)

    @property
    def bytes(self) -> int:
        """Bytes in the file so far."""
        return self._disk.size

    @property
    def waiting(self) -> int:
        """Bytes that wait to be written."""
        return self._length

    def append(self, frame: Frame) -> None:
        """Take one frame."""
        self._begin()
        self._add(self._line(frame))
        self.frames += 1
        if self._length > _WAITING:
            self._write()

    def checkpoint(self, *, sync: bool = True) -> None:
        """Write the lines that wait; `sync`: down to the disk."""
        self._write()
        if sync:
            self.sync()

    def sync(self) -> None:
        """Have what was written on the disk itself; another thread may call this meanwhile."""
        self._disk.sync()

    def close(self) -> None:
        """Write the end and close; a second call does nothing."""
        if self._disk.closed:
            return
        try:
            self._begin()
            self._add(self._tail())
            self.checkpoint()
        finally:
            self._disk.close()

    def abandon(self) -> None:
        """Close without writing any more."""
        self._disk.close()

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

    def _add(self, text: str) -> None:
        self._waiting.append(text)
        self._length += len(text)

    def _write(self) -> None:
        self._disk.append("".join(self._waiting).encode("ascii"))
        self._waiting.clear()
        self._length = 0
        self.kept = self.frames


class CandumpWriter(_TextWriter):
    """`candump -L` lines; a frame that was sent ends with ` T`, as newer candump versions mark it."""

    def _line(self, frame: Frame) -> str:
        t, bus, id_, data, flags, length = frame
        us = max((self.start_ns or 0) // 1000 + round(t * 1e6), 0)
        long = flags & (Flag.ERROR | Flag.EXTENDED)
        shown = id_ | ERROR_BIT if flags & Flag.ERROR else id_
        name = f"{shown:08X}" if long else f"{shown:03X}"
        if flags & Flag.REMOTE:
            body = f"R{length}" if length > 0 else "R"
        elif flags & Flag.FD:
            bits = (1 if flags & Flag.BRS else 0) | (2 if flags & Flag.ESI else 0)
            body = f"#{bits:X}{data.hex().upper()}"
        else:
            body = data.hex().upper()
        sent = " T" if flags & Flag.TX else ""
        return f"({us // 1_000_000}.{us % 1_000_000:06d}) can{bus} {name}#{body}{sent}\n"


class AscWriter(_TextWriter):
    """Vector's .asc, hex, absolute times, the date in local time as Vector's tools read it."""

    def _head(self) -> str:
        # whole microseconds, as the times of the frames
        zero = ((self.start_ns or 0) - self.lead_ns) // 1000 * 1000
        at = datetime.datetime.fromtimestamp(zero // 1_000_000_000)
        ms = zero // 1_000_000 % 1000
        date = f"{_DAYS[at.weekday()]} {_MONTHS[at.month - 1]} {at.day:02d} {at:%H:%M:%S}.{ms:03d} {at.year}"
        exact = f"{EXACT_START}{zero}\n" if self.start_ns is not None else ""
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
        us = max(round(t * 1e6) + self.lead_ns // 1000, 0)
        stamp = f"{us // 1_000_000:4d}.{us % 1_000_000:06d}"
        if flags & Flag.ERROR:
            return f"{stamp} {bus + 1}  ErrorFrame\n"
        name = f"{id_:X}x" if flags & Flag.EXTENDED else f"{id_:X}"
        way = "Tx" if flags & Flag.TX else "Rx"
        octets = data.hex(" ").upper()
        if flags & Flag.REMOTE:
            return f"{stamp} {bus + 1}  {name:<15} {way:<4} r {max(length, 0):x}\n"
        if not flags & Flag.FD:
            return f"{stamp} {bus + 1}  {name:<15} {way:<4} d {len(data):x} {octets}\n"
        brs, esi = int(bool(flags & Flag.BRS)), int(bool(flags & Flag.ESI))
        bits = FD64_EDL | (FD64_BRS if brs else 0) | (FD64_ESI if esi else 0)
        return (
            f"{stamp} CANFD {bus + 1:>3} {way:<4} {name:>8}  {'':>32} {brs} {esi} {dlc_of(len(data)):x}"
            f" {len(data):>2} {octets} {0:>8} {0:>4} {bits:>8X} {0:>8} {0:>8} {0:>8} {0:>8} {0:>8}\n"
        )
