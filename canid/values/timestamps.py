"""Conversion of time stamps to whole nanoseconds: differences of epoch floats are not exact."""

from __future__ import annotations

import math

from canid.values.types import NAN

NS_PER_S = 1_000_000_000

# s; 1 January 1990, the limit that python-can uses too: earlier stamps count from another zero (boot, measurement
# start), not from 1970
EPOCH_FLOOR_S = 631_152_000


def from_float(stamp: float) -> int:
    """Nanoseconds of a float time stamp in s.

    A float of today's epoch resolves 0.24 µs, so there the digits beyond the microsecond are noise
    and are rounded away; a small stamp keeps its nanoseconds.

    >>> from_float(1533224087.123457), from_float(0.25)
    (1533224087123457000, 250000000)
    """
    if stamp < EPOCH_FLOOR_S:
        return round(stamp * 1e9)
    return round(stamp * 1e6) * 1000


def from_text(text: str) -> int:
    """Nanoseconds of a decimal number with a point or a comma; digits beyond the ninth are cut off.

    Raises ValueError where it is not one.

    >>> from_text("12.5"), from_text("0,000001"), from_text("-1.25")
    (12500000000, 1000, -1250000000)
    """
    whole, _, fraction = text.replace(",", ".").partition(".")
    if not (whole.lstrip("-").isdecimal() and (fraction.isdecimal() or not fraction)):
        raise ValueError(f"{text!r} is not a time in seconds")
    ns = int(whole.lstrip("-")) * NS_PER_S + int(fraction[:9].ljust(9, "0"))
    return -ns if whole.startswith("-") else ns


def epoch_seconds(ns: int | None) -> float:
    """Epoch ns as the nearest float of seconds (±0.12 µs today); NaN where it is None or no epoch time.

    >>> epoch_seconds(1533224087123456789), epoch_seconds(None)
    (1533224087.1234567, nan)
    """
    if ns is None or ns < EPOCH_FLOOR_S * NS_PER_S:
        return NAN
    return ns / NS_PER_S  # of two ints: rounded once


def log_zero(start_ns: int | None, lead_ns: int) -> tuple[int, int]:
    """The zero from which a log's own times count, at least `lead_ns` before `start_ns`, and the own time of `start_ns`.

    The zero has whole milliseconds, which is what the headers of .blf and .asc hold: header and own times together are
    exact. It is 1970 for what is stamped before 1990, so that stamps that count from another zero stand in the log as
    they came. None: an unknown start, whose zero is not known either.

    >>> log_zero(1533224087_123_456_789, 10**9)
    (1533224086123000000, 1000456789)
    >>> log_zero(12_000_000_000, 10**9), log_zero(None, 10**9)
    ((0, 12000000000), (0, 1000000000))
    """
    if start_ns is None:
        return 0, lead_ns
    zero = (start_ns - lead_ns) // 1_000_000 * 1_000_000
    if zero < EPOCH_FLOOR_S * NS_PER_S:
        zero = 0
    return zero, start_ns - zero


def epoch_ns(seconds: float) -> int | None:
    """Make a UTC start epoch ns, rounded to whole microseconds; None where it is NaN.

    >>> epoch_ns(1533224087.5), epoch_ns(float("nan"))
    (1533224087500000000, None)
    """
    return None if math.isnan(seconds) else round(seconds * 1e6) * 1000
