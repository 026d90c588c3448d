"""A log that a generator wrote, and what a reader has to find in it: the interface of all generators.

A module of a format, `FORMAT_files.py`, has one function `draw(rng) -> Written`. It is written from the format's page
`docs/formats/FORMAT.md`, shares no code with canid, and draws the frames first and then how they are written.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import NamedTuple


class WrittenFrame(NamedTuple):
    """One CAN frame, as a reader must give it."""

    ns: int  # since the log's first frame; the first one has 0
    bus: int  # 0, 1, ...
    id: int
    extended: bool  # 29-bit id
    data: bytes = b""  # of a remote frame: none
    marks: frozenset[str] = frozenset()  # of MARKS
    sent: bool = False  # direction: sent by the device that recorded
    asked: int = -1  # bytes that a remote frame asks for; -1: it is none


# of a frame that is not a classic data frame
MARKS = ("fd", "brs", "esi", "remote", "error")


class Counts(NamedTuple):
    """Lines (binary formats: objects) of each class but frames."""

    events: int = 0  # of canid's recorder
    others: int = 0  # of no interest: they are known to hold no CAN frame
    damaged: int = 0  # text formats: lines; .blf: stretches of bytes


class Written(NamedTuple):
    """A log and what is in it."""

    content: bytes
    suffix: str  # ".asc"
    frames: tuple[WrittenFrame, ...]
    counts: Counts
    properties: tuple[str, ...] = ()  # how it is written, a few words each: rows of the benchmark's table
    start_ns: int | None = None  # epoch ns of the first frame; None: the log does not state it
    zone: str = "UTC"  # IANA name of the time zone that the reader is given for local times


Draw = Callable[[random.Random], Written]
