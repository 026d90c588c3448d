"""Reads logs of BusMaster: `21:25:14:7460 Rx 1 0x123 s 8 11 22 33 44 55 66 77 88` below lines between `***`.

`***HEX***` or `***DEC***` is the base of ids and data. Times are the time of day (SYSTEM MODE), since the start of the
session (ABSOLUTE MODE) or since the frame before (RELATIVE MODE); the date is that of START DATE AND TIME, day first, in
local time. A file may hold several sessions.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator
from pathlib import Path

from canid.io.logs.frame_lines import Row, checked_id, read
from canid.io.logs.local_time import epoch_ns
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Bad, Line, remote_length
from canid.values import timestamps
from canid.values.frame_columns import WantedIds
from canid.values.types import Columns, Flag

_HEADER = re.compile(r"\*\*\*.*")
_START = re.compile(
    r"\*\*\*START DATE AND TIME (\d+):(\d+):(\d+) (\d+):(\d+):(\d+):(\d+)\*\*\*\s*", re.IGNORECASE
)
_PROTOCOL = re.compile(r"\*\*\*PROTOCOL (\w+)\*\*\*", re.IGNORECASE)
_LINE = re.compile(
    r"(\d{1,4}):(\d\d?):(\d\d?):(\d{1,9})\s+(Rx|Tx)\s+(\d{1,3})\s+(?:0x)?([0-9A-F]{1,10})\s+([sx])(r?)(-?fd)?\s+(\d{1,3})((?:\s+[0-9A-F]{1,3})*)",
    re.IGNORECASE,
)
_ERROR = re.compile(r"\d{1,4}:\d\d?:\d\d?:\d{1,9}\s+(?:(?:Rx|Tx)\s+)?(?:\d{1,3}\s+)?ERR.*", re.IGNORECASE)
_DAY_NS = 86_400 * timestamps.NS_PER_S


def read_busmaster(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is one."""
    session = _Session(state.zone)
    return read(path, state, session.take, wanted, dated=lambda: session.dated)


class _Session:
    """The logging session that the lines belong to."""

    def __init__(self, zone: datetime.tzinfo | None) -> None:
        self._zone = zone
        self.dated = False
        self._base = 16
        self._mode = "SYSTEM"
        self._protocol = "CAN"
        self._start = 0  # ns, epoch; of midnight of its day and of the session
        self._midnight = 0
        self._now = 0  # ns of the latest frame, as in the file

    def take(self, text: str, line: Line) -> Row | str:
        """The frame of a line. Raises Bad."""
        if _HEADER.fullmatch(text):
            return self._header(text)
        if self._protocol != "CAN":
            return f"lines of {self._protocol[:16]}"
        if _ERROR.fullmatch(text):
            return "error frames"
        match = _LINE.fullmatch(text)
        if not match:
            raise Bad("it is no line of a BusMaster log" if line.whole else "the file ends in it")
        hour, minute, second, fraction, way, channel, word, width, remote, fd, length, rest = match.groups()
        if int(minute) > 59 or int(second) > 59 or not 1 <= int(channel) <= 255:
            raise Bad("its time or its channel is damaged")
        try:
            id_, flags = checked_id(int(word, self._base), extended=width in "xX")
            octets = [int(octet, self._base) for octet in rest.split()]
            announced = int(length)
            if remote:
                if octets:
                    raise Bad("it is a remote frame and has data")
                announced = remote_length(announced)
            elif len(octets) != announced or announced > (64 if fd else 8):
                raise Bad(f"it announces {announced} data bytes and has {len(octets)}")
            data = bytes(octets)
        except Bad:
            raise
        except ValueError:
            raise Bad("its numbers are not those of its base") from None
        flags |= (
            (Flag.TX if way in ("Tx", "tx", "TX") else 0)
            | (Flag.REMOTE if remote else 0)
            | (Flag.FD if fd else 0)
        )
        seconds = (int(hour) * 60 + int(minute)) * 60 + int(second)
        ns = self._ns(seconds * timestamps.NS_PER_S + int(fraction.ljust(9, "0")))
        return Row(ns, int(channel) - 1, id_, data, int(flags), announced if remote else -1)

    def _ns(self, written: int) -> int:
        if self._mode == "RELATIVE":
            self._now += written
            return self._start + self._now
        if self._mode == "ABSOLUTE":
            return self._start + written
        # time of day: it begins anew at midnight
        days = (self._now - written + _DAY_NS // 2) // _DAY_NS
        self._now = written + max(days, 0) * _DAY_NS
        return self._midnight + self._now

    def _header(self, text: str) -> str:
        words = text.strip("* ").upper()
        if match := _START.fullmatch(text):
            day, month, year, hour, minute, second, milli = map(int, match.groups())
            try:
                at = datetime.datetime(year, month, day, hour, minute, second)
            except ValueError:
                raise Bad("its date is damaged") from None
            begin, midnight = (
                epoch_ns(at, self._zone),
                epoch_ns(at.replace(hour=0, minute=0, second=0), self._zone),
            )
            if begin is None or midnight is None:
                raise Bad("its date is damaged")
            self.dated = True
            self._start = begin + milli * 1_000_000
            self._midnight = midnight
            # of the time of day: where the session begins, so that midnight is noticed
            self._now = self._start - self._midnight if self._mode == "SYSTEM" else 0
        elif words in ("HEX", "DEC"):
            self._base = 16 if words == "HEX" else 10
        elif words in ("SYSTEM MODE", "ABSOLUTE MODE", "RELATIVE MODE"):
            self._mode = words.split()[0]
            self._now = self._start - self._midnight if self._mode == "SYSTEM" else 0
        elif match := _PROTOCOL.search(text):
            self._protocol = match[1].upper()
        return "header lines"
