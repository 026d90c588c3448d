"""What readings show besides the samples that are made of them: the signal checks take it."""

from __future__ import annotations

from typing import NamedTuple

from canid.signals.samples.out_of_range import OutOfRange
from canid.signals.samples.reading_spans import ReadingSpan
from canid.signals.samples.stamps import StampIntervals


class Limited(NamedTuple):
    """A signal is limited."""

    role: str
    age: float  # s, since it was at its limit for the first time
    low: float  # in the role's unit; -inf: not limited on this side
    high: float


ReadingFact = StampIntervals | OutOfRange | ReadingSpan | Limited
