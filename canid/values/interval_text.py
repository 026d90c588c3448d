"""A number with its 95 % interval as text, with the decimals that the interval supports."""

from __future__ import annotations

import math

# decimals that a reader can still take in, however narrow the interval
MAX_DECIMALS = 6
# in the place of an unknown number
DASH = "–"


def decimals(low: float, high: float) -> int:
    """Decimals that the width of an interval supports: two significant digits of its half.

    Example:
        >>> decimals(0.28, 0.41), decimals(24.0, 37.0)
        (2, 0)
    """
    width = high - low
    if not (math.isfinite(width) and width > 0.0):
        return 2
    return min(max(1 - math.floor(math.log10(width)), 0), MAX_DECIMALS)


def interval_text(value: float, low: float, high: float, places: int | None = None) -> str:
    """Value and interval; a dash where there is no estimate.

    Args:
        value: of the estimate.
        low: end of its interval.
        high: end of its interval.
        places: decimals; None: as many as the width of the interval supports.

    Example:
        >>> interval_text(0.3412, 0.281, 0.409), interval_text(2.0, float("nan"), float("nan"))
        ('0.34 [0.28, 0.41]', '2.00 [–, –]')
        >>> interval_text(6.0, -0.3, 11.0)  # no "-0"
        '6 [0, 11]'
    """
    if not math.isfinite(value):
        return DASH
    digits = decimals(low, high) if places is None else places
    ends = (f"{x:z.{digits}f}" if math.isfinite(x) else DASH for x in (low, high))
    return f"{value:z.{digits}f} [{', '.join(ends)}]"
