"""Reads PEAK's .trc, versions 1.0 to 2.1 ("PEAK CAN TRC File Format", PEAK-System, 2020).

A line is a CAN frame in every column, a comment, a record of another type (hardware status, error frame, error
counters, event), or damaged.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from canid import timestamps
from canid.logs.blf.blf_layout import DLC_BYTES
from canid.logs.reader_state import ReadState
from canid.logs.text_lines import MAX_EXTENDED_ID, MAX_TIME_NS, Bad, Line, LineCount, lines, remote_length
from canid.types import Flag, Frame

# day 0 of ;$STARTTIME
_DAY_0 = datetime.datetime(1899, 12, 30, tzinfo=datetime.UTC)
_MAX_STANDARD_ID = 0x7FF
_DEFAULT_COLUMNS = {"2.0": "N,O,T,I,d,l,D", "2.1": "N,O,T,B,I,d,R,L,D"}
# the columns of a line with a CAN frame
_COLUMNS = {
    "N": r"(?:\d+)",
    "O": r"(?P<time>-?\d+(?:\.\d+)?)",
    "T": r"(?P<type>DT|FD|FB|FE|BI|RR)",
    "B": r"(?P<bus>\d{1,3})",
    "I": r"(?P<id>[0-9A-Fa-f]{7,8}|[0-9A-Fa-f]{4})",
    "d": r"(?P<way>Rx|Tx)",
    "R": r"(?:-|[0-9A-F]{1,2})",
    "L": r"(?P<dlc>\d{1,2})",
    "l": r"(?P<length>\d{1,2})",
    "D": r"(?P<data>.*)",
}
# and of one of another type, which has no id
_OTHER_COLUMNS = _COLUMNS | {
    "T": r"(?P<type>ST|EC|ER)", "I": r"-?", "R": r"-?", "L": r"\d*", "l": r"\d*", "B": r"\d{1,3}",
    "D": r"(?:(?:[0-9A-F]{2})(?:\s+[0-9A-F]{2})*)?",
}  # fmt: skip
_VERSION_1 = {
    # number, time, [bus], [type], id, [reserved], length, data
    "1.0": r"\d+\)\s+(?P<time>-?\d+(?:\.\d+)?)\s+{id}\s+{dlc}(?:\s+{data})?",
    "1.1": r"\d+\)\s+(?P<time>-?\d+(?:\.\d+)?)\s+{way}\s+{id}\s+{dlc}(?:\s+{data})?",
    "1.2": r"\d+\)\s+(?P<time>-?\d+(?:\.\d+)?)\s+{bus}\s+{way}\s+{id}\s+{dlc}(?:\s+{data})?",
    "1.3": r"\d+\)\s+(?P<time>-?\d+(?:\.\d+)?)\s+{bus}\s+{way}\s+{id}\s+{reserved}\s+{dlc}(?:\s+{data})?",
}
_FIELDS = {
    "id": _COLUMNS["I"], "dlc": _COLUMNS["L"], "way": _COLUMNS["d"], "bus": _COLUMNS["B"], "data": _COLUMNS["D"],
    "reserved": _COLUMNS["R"],
}  # fmt: skip
# warnings have this id, or this type; error frames this type, or this word after the length
_WARNING = re.compile(
    r"\d+\)\s+-?[\d.]+(?:\s+\d{1,3})?\s+(?:Warng\s+)?FFFFFFFF\s+(?:-\s+)?4\s+(?:[0-9A-F]{2}\s+){4}[-A-Za-z ]*"
)
_ERROR = re.compile(
    r"\d+\)\s+-?[\d.]+(?:\s+\d{1,3})?\s+(?:Error\s+[0-9A-F]{4,8}\s+(?:-\s+)?\d|[0-9A-F]{4,8}\s+\d\s+ERROR)(?:\s+[0-9A-F]{2})*"
)
_EVENT_RECORD = re.compile(r"\d+\s+-?[\d.]+\s+EV\b.*")
_KINDS = {"ST": "hardware status", "EC": "error counters", "ER": "error frames"}
_OCTETS = re.compile(r"(?:[0-9A-F]{2}(?:\s+[0-9A-F]{2})*)?", re.IGNORECASE)


class _Record(NamedTuple):
    """A frame as written in its line."""

    time: float  # ms
    bus: int
    id: int
    data: bytes
    flags: int
    length: int


def read_trc(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file; raises LogError where no line is one."""
    count = LineCount()
    form = _Form()
    first: int | None = None
    for line in lines(path, state, count):
        # one blank between words: so no pattern backtracks over blanks
        text = " ".join(line.text.split())
        if not text:
            continue
        try:
            if text.startswith(";"):
                count.others[form.comment(text)] += 1
                continue
            if kind := form.other(text):
                count.others[kind] += 1
                continue
            record = form.record(text, line)
            ns = timestamps.from_float(record.time / 1000 + form.start)
            if abs(ns) > MAX_TIME_NS:
                raise Bad("its time is damaged")
        except Bad as error:
            count.miss(line, str(error))
            continue
        if first is None:
            first = ns
            state.start_ns = ns
        count.read += 1
        t = (ns - first) * 1e-9
        yield Frame(t, record.bus, record.id, record.data, record.flags, record.length)
    count.close(path, state)


class _Form:
    """The form of the lines that follow, as the header states it."""

    def __init__(self) -> None:
        """Without a header it is version 1.0."""
        self.start = 0.0  # s, epoch time that times count from
        self._version = "1.0"
        self._columns = ""
        self._compile()

    def comment(self, text: str) -> str:
        """Take a line that begins with a semicolon: its kind. Raises Bad."""
        if text.startswith(";$"):
            key, _, value = text[2:].partition("=")
            value = value.strip()
            if key == "FILEVERSION" and (value in _VERSION_1 or value in _DEFAULT_COLUMNS):
                self._version = value
            elif key == "STARTTIME" and re.fullmatch(r"\d{1,6}(?:\.\d{1,20})?", value):
                self.start = (_DAY_0 + datetime.timedelta(days=float(value))).timestamp()
            elif key == "COLUMNS" and re.fullmatch(r"[NOTBIdRLlD](?:,[NOTBIdRLlD])*", value):
                self._columns = value
            else:
                raise Bad("it is no line of a header that is known")
            self._compile()
            return "header lines"
        # a record's first character may be damaged (a digit of its number too), or the line feed before it
        if self._frame.search(text) or self._frame.fullmatch(f"0{text[1:]}"):
            raise Bad("a record stands in a comment")
        return "comments"

    def _compile(self) -> None:
        if self._version in _VERSION_1:
            pattern = _VERSION_1[self._version]
            for name, field in _FIELDS.items():
                pattern = pattern.replace(f"{{{name}}}", field)
            self._frame, self._other = re.compile(pattern, re.IGNORECASE), None
            return
        columns = (self._columns or _DEFAULT_COLUMNS[self._version]).split(",")
        if len(set(columns)) < len(columns):
            raise Bad("it names a column twice")
        if not {"O", "T", "I", "d"} <= {*columns} or not {"l", "L"} & {*columns}:
            raise Bad("it lacks a column that every frame has")
        self._frame = re.compile(r"\s*".join(_COLUMNS[c] + (r"(?!\S)" if c != "D" else "") for c in columns))
        blank = {"B", "I", "R", "L", "l", "d"}  # columns that may be empty in a record of another type
        self._other = re.compile(
            r"\s*".join(f"(?:{_OTHER_COLUMNS[c]}(?!\\S))" + "?" * (c in blank) for c in columns)
        )

    def other(self, text: str) -> str:
        """The kind of a record that is known to hold no data frame; "" for all others."""
        if self._other is None:
            if _WARNING.fullmatch(text):
                return "warnings"
            return "error frames" if _ERROR.fullmatch(text) else ""
        if _EVENT_RECORD.fullmatch(text):
            return "" if self._frame.search(text) else "events"
        found = self._other.fullmatch(text)
        return _KINDS[found["type"]] if found else ""

    def record(self, text: str, line: Line) -> _Record:
        """The frame in a line. Raises Bad."""
        found = self._frame.fullmatch(text)
        if not found:
            raise Bad("its columns are not those of a frame" if line.whole else "the file ends in it")
        part = found.groupdict("")
        kind = part.get("type", "")
        id_ = int(part["id"], 16)
        extended = len(part["id"]) > 4
        if id_ > (MAX_EXTENDED_ID if extended else _MAX_STANDARD_ID):
            raise Bad(f"{part['id']!r} is too large for an id")
        flags = int(Flag.EXTENDED) if extended else 0
        flags |= int(Flag.TX) if part.get("way", "Rx").lower() == "tx" else 0
        if kind in ("FD", "FB", "FE", "BI"):
            flags |= int(Flag.FD)
            flags |= int(Flag.BRS) if kind in ("FB", "FE") else 0
            flags |= int(Flag.ESI) if kind in ("FE", "BI") else 0
        announced = self._announced(part, flags)
        bus = max(int(part.get("bus") or 1) - 1, 0)
        time, words = float(part["time"]), part.get("data", "")
        if kind == "RR" or (not kind and words.upper() == "RTR"):
            if kind and words:
                raise Bad("it is a remote frame and has data")
            return _Record(time, bus, id_, b"", flags | int(Flag.REMOTE), remote_length(announced))
        if not _OCTETS.fullmatch(words):
            raise Bad("its data are not hexadecimal bytes")
        data = bytes.fromhex(words)
        if len(data) != announced:
            raise Bad(
                f"it announces {announced} data bytes and has {len(data)}"
                if line.whole
                else "the file ends in it"
            )
        return _Record(time, bus, id_, data, flags, -1)

    @staticmethod
    def _announced(part: dict[str, str], flags: int) -> int:
        """Bytes that a frame announces, by its length or its DLC."""
        if part.get("length"):
            length = int(part["length"])
            if length not in DLC_BYTES or (length > 8 and not flags & Flag.FD):
                raise Bad(f"a frame cannot have {length} data bytes")
            return length
        dlc = int(part["dlc"])
        if dlc > 15:
            raise Bad(f"{dlc} is no DLC")
        return DLC_BYTES[dlc] if flags & Flag.FD else min(dlc, 8)
