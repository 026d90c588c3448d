"""Reads PEAK's .trc through python-can, which knows its versions 1.0 to 2.1; a bad line is passed over."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

from canid.frames import messages, python_can, stamps
from canid.frames.blf_layout import DLC_BYTES
from canid.frames.lines import LARGEST_ID, LONGEST_TIME, Line, Tally, lines
from canid.frames.read_state import ReadState
from canid.types import Frame

# lines of a header, of some twenty, that are kept: more is damage
_HEADER = 100
# columns of a frame, in the version that has the fewest: number, time, id, length
_FEWEST = 4
# A line that ends like this lacks nothing but its line feed: a data byte's both digits (python-can counts the bytes
# against the length), or a remote frame with the one digit of its length.
_COMPLETE = re.compile(r"(\s[0-9A-Fa-f]{2}|\sRTR|\sRR\s.*\s\d)\s*$")
# Lines of other things than frames, in any version; of all others one that yields no frame is damaged.
_OTHERS = {"FFFFFFFF", "Warng", "Error", "ST", "ER", "EC", "EV"}


def read_trc(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file; raises LogError where no line is one."""
    tally = Tally()
    first: int | None = None
    feed = _Feed(lines(path, state, tally), tally)
    for message in _messages(feed, tally):
        feed.open = False
        ns = stamps.from_float(message.timestamp)
        why = _wrong(message, ns)
        if why and feed.last is not None:
            tally.miss(feed.last, why)
            continue
        if first is None:
            first = ns
            state.start_ns = ns
        tally.read += 1
        # PEAK counts buses from 1
        yield messages.frame_of(message, max(int(message.channel) - 1, 0), first)
    state.damage = tally.damage(path)


def _wrong(message: Any, ns: int) -> str:
    """What is wrong with a message that python-can has made; "" where nothing is."""
    if not (message.arbitration_id <= LARGEST_ID and 0 <= message.dlc <= 64):
        return "its id or its length is too large"
    announced = DLC_BYTES[min(message.dlc, 15)] if message.is_fd else min(message.dlc, 8)
    if not message.is_remote_frame and len(message.data) != announced:
        return f"it announces {announced} data bytes and has {len(message.data)}"
    return "its time is damaged" if abs(ns) > LONGEST_TIME else ""


def _messages(feed: _Feed, tally: Tally) -> Iterator[Any]:
    while not feed.over:
        try:
            # A reader that has raised is spent: a new one gets the header again, then the remaining lines.
            yield from python_can.load().TRCReader(feed)
        except (ValueError, IndexError, KeyError, TypeError, NotImplementedError, OverflowError) as error:
            if feed.last is None:
                return
            feed.open = False
            tally.miss(feed.last, str(error))
            if feed.last.text.startswith(";"):
                return  # the header itself is bad: no reader will get beyond it


class _Feed:
    """The file that python-can reads from: header, then the lines not given out yet."""

    mode = "r"

    def __init__(self, source: Iterator[Line], tally: Tally):
        self._source = source
        self._tally = tally
        self._header: list[Line] = []
        self.last: Line | None = None
        self.open = False  # nothing has come of the last line yet
        self.over = False

    def __iter__(self) -> Iterator[str]:
        again = len(self._header)
        for k, line in enumerate(chain(tuple(self._header), self._source)):
            self._settle()
            if line.text.startswith(";"):
                if k >= again and len(self._header) < _HEADER:
                    self._header.append(line)
            elif not (line.whole or _COMPLETE.search(line.text)):
                self._tally.miss(line, "the file ends in it")
                continue
            self.last = line
            self.open = not line.text.startswith(";") and bool(line.text.strip())
            if self.open and len(line.text.split(maxsplit=_FEWEST)) < _FEWEST:
                continue  # python-can would warn of each of them
            yield line.text + "\n"
        self._settle()
        self.over = True

    def _settle(self) -> None:
        """Count the last line as damaged if python-can's reader has passed it over without a word."""
        if self.open and self.last is not None and not _OTHERS.intersection(self.last.text.split()):
            self._tally.miss(self.last, "its columns are not those of a frame")
        self.open = False

    def close(self) -> None:
        """Nothing: the file belongs to `lines`."""
