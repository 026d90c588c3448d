"""What readings show besides the samples that are made of them: the signal checks take it."""

from __future__ import annotations

from canid.signals.samples.limited_values import Limited
from canid.signals.samples.out_of_range import OutOfRange
from canid.signals.samples.reading_spans import ReadingSpan
from canid.signals.samples.stamps import StampIntervals

ReadingFact = StampIntervals | OutOfRange | ReadingSpan | Limited
