"""What readings show besides the samples that are made of them: the signal checks take it."""

from __future__ import annotations

from typing import NamedTuple

from canid.signals.samples.reading_spans import ReadingSpan
from canid.signals.samples.stamps import StampIntervals

# different readings of one block: with five it is a scale, with two codes for "no value"
MAX_KEPT = 8


class OutOfRange(NamedTuple):
    """A reading that is left out because it is out of its signal's range."""

    role: str
    t: float  # s
    value: float  # in the role's unit


def added(kept: tuple[OutOfRange, ...], came: OutOfRange) -> tuple[OutOfRange, ...]:
    """The different readings so far, with one more: `MAX_KEPT` at most, the highest among them.

    Example:
        >>> kept: tuple[OutOfRange, ...] = ()
        >>> for k in range(100):
        ...     kept = added(kept, OutOfRange("pedal", 0.0, 110.0 + k // 2))
        >>> len(kept), kept[-1].value
        (8, 159.0)
    """
    if any(each.value == came.value and each.role == came.role for each in kept):
        return kept
    if len(kept) < MAX_KEPT:
        return (*kept, came)
    return (*kept[:-1], came) if came.value > max(each.value for each in kept) else kept


class Limited(NamedTuple):
    """A signal is limited."""

    role: str
    age: float  # s, since it was at its limit for the first time
    low: float  # in the role's unit; -inf: not limited on this side
    high: float


ReadingFact = StampIntervals | OutOfRange | ReadingSpan | Limited
