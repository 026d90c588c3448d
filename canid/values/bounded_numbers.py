"""Numbers of the command line, for argparse: each kind has its bounds, so that what no code can take is one line.

Python waits no longer than 292 years, an operating system counts no more than 2^63 bytes; a number beyond these bounds is a
slip, or a stranger's.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable

# s; a hundred years: each timer of Python and of the operating system takes it
MAX_S = 100 * 365.25 * 86_400.0
# bytes; 10^15: each limit of DuckDB and of the operating system takes it
MAX_BYTES = 10**15
# more processes than any machine has cores are a slip
MAX_PROCESSES = 10_000
# bit/s; of CAN XL, the fastest
MAX_BIT_RATE = 20_000_000
# what each reader of JSON has exactly
MAX_SEED = 2**53
# times as fast as driven: a drive of an hour takes from some milliseconds to a year
SPEEDS = (1e-4, 1e6)


def number(what: str, low: float, high: float) -> Callable[[str], float]:
    """The type of an option that takes a finite number between two bounds.

    Args:
        what: is read, with an example, for the error.
        low: the least.
        high: the most.

    Example:
        >>> number("a share (such as 0.5)", 0.0, 1.0)("0.25")
        0.25
    """

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        return _checked(value, text, what, low, high)

    return read


def whole(what: str, low: int, high: int) -> Callable[[str], int]:
    """The type of an option that takes a whole number between two bounds, as `number`.

    Example:
        >>> whole("a number of drivers", 1, 100)("12")
        12
    """

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f'"{text}" is not {what}') from None
        _checked(value, text, what, low, high)
        return value

    return read


def _checked(value: float, text: str, what: str, low: float, high: float) -> float:
    if low <= value <= high:
        return value
    # an infinity is a number outside of the bounds, NaN is none
    bounds = "" if value != value else f": at least {low:,.10g}, at most {high:,.10g}"
    raise argparse.ArgumentTypeError(f'"{text}" is not {what}{bounds}')


def _with_unit(text: str, units: dict[str, float], what: str, high: float, ignored: str = "") -> float:
    """A number above 0 with a unit."""
    match = re.fullmatch(r"\s*([0-9.]+)\s*([a-z%]*)\s*", text.lower(), re.ASCII)
    try:
        if match is None:
            raise ValueError
        value = float(match[1]) * units[match[2].removesuffix(ignored) if ignored else match[2]]
    except (ValueError, KeyError):
        value = math.nan
    if value > high:
        return _checked(value, text, what, 0.0, high)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f'"{text}" is not {what}')
    return value


seconds = number("a time in seconds (such as 12.5)", 0.0, MAX_S)
processes = whole("a number of processes", 1, MAX_PROCESSES)
bit_rate = whole("a bit rate in bit/s (such as 500000)", 1, MAX_BIT_RATE)
seed = whole("a seed (a whole number such as 1)", 0, MAX_SEED)


def size(text: str) -> int:
    """A size in bytes.

    Example:
        >>> size("500k"), size("2 GB"), size("10000")
        (500000, 2000000000, 10000)
    """
    units = {"": 1, "k": 1e3, "m": 1e6, "g": 1e9, "t": 1e12}
    return math.ceil(_with_unit(text, units, "a size (such as 100M)", MAX_BYTES, "b"))


def span(text: str) -> float:
    """A time above 0 in s.

    Example:
        >>> span("10min"), span("1.5h"), span("30")
        (600.0, 5400.0, 30.0)
    """
    units = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
    return _with_unit(text, units, "a time (such as 10min)", MAX_S)


def share(text: str) -> float:
    """A share of the disk.

    Example:
        >>> share("50%"), share("0.5 %")
        (0.5, 0.005)
    """
    value = _with_unit(text, {"": 0.01, "%": 0.01}, "a share (such as 50%)", math.inf)
    if value > 1.0:
        raise argparse.ArgumentTypeError(f'"{text}" is more than the whole disk')
    return value


def speed(text: str) -> float:
    """A replay speed: a factor, or max.

    Example:
        >>> speed("10"), speed("max")
        (10.0, inf)
    """
    return math.inf if text == "max" else number("a speed (a factor such as 1 or 10, or max)", *SPEEDS)(text)


def numbers(what: str, low: float, high: float) -> Callable[[str], tuple[float, ...]]:
    """The type of an option that takes numbers between two bounds, with commas.

    Example:
        >>> numbers("a list of times in minutes (such as 1,10)", 0.01, 60.0)("1,10")
        (1.0, 10.0)
    """
    read = number(what, low, high)
    return lambda text: tuple(map(read, text.split(",")))
