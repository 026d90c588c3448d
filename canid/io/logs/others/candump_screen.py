"""Reads candump's output for the screen: ` (1436509052.249713)  can0  123   [8]  11 22 33 44 55 66 77 88`.

Times are those of `-t a` (seconds since 1970), `-t A` (local date and time), `-t z` (since the first frame) or `-t d`
(since the frame before). The last two look alike: where most of the first times are later than the one before them they
count from the first frame, otherwise from the frame before. Understood are `-x` (direction), `-a` (characters), `-c`
(colors), `-i` (bits), `-S` (last byte first) and the explanations of error frames of `-e`.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from canid.io.logs.candump_reader import interfaces
from canid.io.logs.content import COLOR, first_lines
from canid.io.logs.frame_lines import Row, bus_of, checked_id, read
from canid.io.logs.local_time import epoch_ns
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Bad, Line, hex_bytes, remote_length
from canid.values import timestamps
from canid.values.bus_names import bus_numbers
from canid.values.frame_columns import WantedIds
from canid.values.types import Columns, Flag

_LINE = re.compile(
    r"\(([\d :.-]{1,40})\)\s+([!-~]{1,255})\s+(?:(RX|TX)\s(?:[ BE-]{1,5})\s*)?"
    r"([0-9A-F]{3}|[0-9A-F]{8})\s+\[\s?(\d{1,2})\](.*)"
)
_COLOR_BYTES = rb"(?:" + COLOR.pattern.encode() + rb")?"
_NAME = re.compile(
    rb"\([\d :.-]{1,40}\)"
    + _COLOR_BYTES
    + rb"[ \t]+"
    + _COLOR_BYTES
    + rb"[ \t]*([!-~]{1,255})"
    + _COLOR_BYTES
    + rb"[ \t]+(?:[RT]X[ BE-]{1,5}[ \t]+)?[0-9A-F]{3,8}[ \t]+\["
)
# bytes in hexadecimal or as bits; between bytes in reverse order stands a grave accent, as around their characters
_DATA = re.compile(
    r"((?:\s+[0-9A-F]{2}(?:(?:\s+|`)[0-9A-F]{2})*|\s+[01]{8}(?:(?:\s+|`)[01]{8})*)?)(?:\s+'.*'|\s+`.*`)?"
)
# of an error frame, below it
_EXPLANATION = re.compile(r"[a-z-]+(\{.*\})*")
_CLOCK = re.compile(r"(\d{4})-(\d\d)-(\d\d) (\d\d):(\d\d):(\d\d)\.(\d{6,9})")
_SECONDS = re.compile(r"\d{1,20}\.\d{1,9}")
_ERROR_BIT = 0x2000_0000
_OCTET_BITS = 8
# share of the first steps of time that go on, above which times count from the first frame; of two times drawn at random
# every second one is later
_MOSTLY = 0.75


def read_screen(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is one."""
    if not state.buses:
        state.buses.update(bus_numbers(interfaces(path, state.size, _NAME)))
    begin = (_LINE.fullmatch(line.strip()) for line in first_lines(path))
    clock = _Clock(state.zone, [match[1] for match in begin if match])
    if clock.says:
        state.remark(clock.says)

    def take(text: str, line: Line) -> Row | str:
        text = COLOR.sub("", text).strip()
        match = _LINE.fullmatch(text)
        if not match and _EXPLANATION.fullmatch(text):
            return "explanations of error frames"
        if not match:
            raise Bad("it is no line of candump" if line.whole else "the file ends in it")
        stamp, interface, direction, word, length, rest = match.groups()
        number, flags = int(word, 16), int(Flag.TX) if direction == "TX" else 0
        if number & _ERROR_BIT and len(word) == 8:
            id_, flags = number & (_ERROR_BIT - 1), flags | Flag.ERROR
        else:
            id_, wide = checked_id(number, extended=len(word) == 8)
            flags |= wide
        announced = int(length)
        rest = rest.rstrip()
        if rest.strip() == "remote request":
            return Row(
                clock.ns(stamp),
                bus_of(interface, state.buses),
                id_,
                b"",
                flags | Flag.REMOTE,
                remote_length(announced),
            )
        body = rest.removesuffix("ERRORFRAME").rstrip() if flags & Flag.ERROR else rest
        octets = _DATA.fullmatch(f" {body.strip()}" if body else "")
        if octets is None:
            raise Bad("its data are not hexadecimal bytes")
        data = _bytes(octets[1], announced)
        if len(length) == 2:
            flags |= Flag.FD
        elif announced > 8:
            raise Bad("more than 8 data bytes in a classic frame")
        return Row(clock.ns(stamp), bus_of(interface, state.buses), id_, data, int(flags))

    return read(path, state, take, wanted, dated=lambda: clock.dated)


def _bytes(text: str, announced: int) -> bytes:
    """The bytes of a line: hexadecimal, or eight bits each. Raises Bad."""
    words = text.replace("`", " ").split()
    if words and len(words[0]) == _OCTET_BITS:
        words = [f"{int(word, 2):02X}" for word in words]
    return hex_bytes("".join(reversed(words) if "`" in text else words), announced)


class _Clock:
    """What the times of a file count from."""

    def __init__(self, zone: datetime.tzinfo | None, stamps: list[str]) -> None:
        """Judge it by the first of them."""
        self._zone = zone
        first = stamps[0] if stamps else ""
        self._at = 0
        self._relative = False
        self.dated, self.says = True, ""
        if (
            _SECONDS.fullmatch(first)
            and timestamps.from_text(first) < timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S
        ):
            self.dated = False
            ns = [timestamps.from_text(stamp) for stamp in stamps if _SECONDS.fullmatch(stamp)]
            on = sum(later > earlier for earlier, later in pairwise(ns))
            self._relative = on < _MOSTLY * (len(ns) - 1)
            since = "the frame before (candump -t d)" if self._relative else "the first frame (candump -t z)"
            self.says = f"times are read as counted from {since}; the log states no date"

    def ns(self, stamp: str) -> int:
        """The time of a line. Raises Bad."""
        if _SECONDS.fullmatch(stamp):
            ns = timestamps.from_text(stamp)
            if self._relative:
                self._at = ns = self._at + ns
            return ns
        match = _CLOCK.fullmatch(stamp)
        if not match:
            raise Bad("its time is damaged")
        *date, fraction = match.groups()
        try:
            at = epoch_ns(datetime.datetime(*map(int, date)), self._zone)  # type: ignore[arg-type]  # six of them
        except ValueError:
            at = None
        if at is None:
            raise Bad("its time is damaged")
        return at + int(fraction.ljust(9, "0"))
