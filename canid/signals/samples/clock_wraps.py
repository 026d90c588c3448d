"""Clocks that begin anew: the periods after which counters and times of day do so, and how they are named."""

from __future__ import annotations

from typing import NamedTuple

# s; a step back that is shorter than a period by no more than this is the clock's beginning anew: two values of the
# slowest poll, 1 Hz. What is silent for longer at that very instant cannot be distinguished from a clock that was set.
MAX_STEP_S = 2.0


class Wrap(NamedTuple):
    """A clock that begins anew."""

    period: float  # s
    says: str
    begins: float = 0.0  # s, what it shows where it begins anew


TWELVE_HOURS = Wrap(43_200.0, "the clock of twelve hours goes on from 12:59:59 to 1:00", 3600.0)
MIDNIGHT = Wrap(86_400.0, "the time of day goes over midnight")
# none is within MAX_STEP_S of another
WRAPS = (
    Wrap(60.0, "the clock of 60 s (slcan) begins anew"),
    Wrap(65.536, "the counter of 16 bits in ms wraps"),
    Wrap(3600.0, "the clock is set back by an hour (end of summer time) or begins anew each hour"),
    Wrap(4294.967296, "the counter of 32 bits in µs wraps"),
    Wrap(16_777.216, "the counter of 24 bits in ms wraps"),
    TWELVE_HOURS,
    MIDNIGHT,
    Wrap(604_800.0, "the time of the GPS week begins anew"),
    Wrap(4_294_967.296, "the counter of 32 bits in ms wraps"),
)


def wrap_of(back: float, margin: float) -> Wrap | None:
    """The wrap that a step back is; None: it is none that is known.

    Args:
        back: s, from the newest time before the step to the first behind it.
        margin: s, by which frames may be out of order.

    Example:
        >>> wrap_of(59.95, 0.1).period, wrap_of(1234.5, 0.1)
        (60.0, None)
    """
    return next((wrap for wrap in WRAPS if -margin <= wrap.period - back <= MAX_STEP_S), None)
