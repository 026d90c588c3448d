"""The column of times: seconds since the first row, whatever it counts in, and its start as UTC."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.tables.source import EMPTY, NO_NUMBER
from canid.analysis.tables.times import dates, row_clock
from canid.signals.samples.clock_wraps import MAX_STEP_S
from canid.values.errors import ConfigError
from canid.values.timestamps import NS_PER_S
from canid.values.types import NAN, Array

# s of one unit
UNITS = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "μs": 1e-6,
    "ns": 1e-9,
    "cs": 1e-2,
    "min": 60.0,
    "h": 3600.0,
    "d": 86_400.0,
}
_NAMES = {"sec": "s", "second": "s", "seconds": "s", "msec": "ms", "millis": "ms", "milliseconds": "ms",
          "usec": "us", "microseconds": "us", "nsec": "ns", "nanoseconds": "ns", "minutes": "min", "hours": "h",
          "days": "d", "с": "s", "сек": "s", "sn": "s", "秒": "s", "мс": "ms", "micros": "us", "nanos": "ns"}  # fmt: skip
# numbers from which on a time counts from 1970, by its unit; 2001 in s is 1e9, and no drive lasts 30 years
_EPOCH_FROM = 1e9
# a time whose steps are longer than this is taken to count in ms: nothing is identified from a value every 5 s
_LONG_STEP = 5.0
# a time with such steps, that spans less than 1, counts in days, as in spreadsheets: they are 10 ms and 4 s of a day, and
# nothing is identified from less than a second
_STEPS_OF_DAYS = 1.1e-7, 5e-5
# date numbers of spreadsheets (days since 30 December 1899) and of MATLAB: those of 1950 and 2100, and of 1970
_DATE_NUMBERS = ((18_264.0, 73_051.0, 25_569.0), (712_224.0, 767_011.0, 719_529.0))
# s; a first row later than this is taken to be the first, so that --start and --stop count from it
_LATE_START_S = 1.0
# counts of 100 ns as programs of Windows write them: FILETIME since 1601, .NET's since year 1; 1997 to 2059, and ns of
# 1973 and 1990: (least, most, s from their zero to 1970)
_TICKS = (
    (12_500 * 10**13, 14_500 * 10**13, 11_644_473_600),
    (63_000 * 10**13, 65_000 * 10**13, 62_135_596_800),
)
# s; LabVIEW counts from 1904: a later time than this, which is 2030 then, and 2096 from 1970, and what lies between both
_SINCE_1904 = 3.4e9, 2_082_844_800
_INTEGER = re.compile(r"-?\d{1,19}")
_TICK = re.compile(r"(\d{1,4}(?:\.\d{1,4})?)? ?([^\W\d]{1,12})")
# a zone at the end of a date
_ZONE = re.compile(
    r".*(?:Z|UTC|GMT|\d ?[A-Z]{2,4}T|MSK|MES?Z|:\d\d(?:[.,]\d+)? ?(?:UTC|GMT)?[+-]\d\d?(?::?\d\d)?)\)?(?:\[.{1,40}\])?"
)
# a date and a time of day in digits alone
_DIGITS = re.compile(
    r"(?P<date>(?:19|20)\d\d(?:0[1-9]|1[0-2])(?:[0-2]\d|3[01]))[_T -]?(?P<time>(?:[01]\d|2[0-3])[0-5]\d[0-6]\d)"
    r"(?:[.,]?(?P<part>(?<=[.,])\d+|\d{3}|\d{6}))?(?P<zone>Z?)"
)
# a leap second: the clock shows a second more
_LEAP = re.compile(r"\d\d:59:60(?!\d)")
# doubles hold whole numbers exactly up to here
EXACT = 2.0**53


class Times(NamedTuple):
    """Times of the rows."""

    t: Array  # (n,) s; NaN: the row has no time
    start_ns: int | None  # epoch of t = 0; None: not known
    note: str  # what was taken for granted, a sentence; "": nothing
    zero: float = 0.0  # s, what the clock shows at t = 0
    local: bool = False  # a time of day without a zone


def is_text(sample: Sequence[str]) -> bool:
    """Whether the cells are dates, clock times, or whole numbers too large for doubles.

    Example:
        >>> is_text(["0.0", "0.1"]), is_text(["2018-08-02T15:34:47Z"]), is_text(["1533224087000000000"])
        (False, True, True)
        >>> is_text(["20260502_080500"]), is_text(["20260502080500.125"]), is_text(["20260502080500125"])
        (True, True, True)
    """
    for cell in sample:
        if cell:
            try:
                return bool(_DIGITS.fullmatch(cell)) or not abs(float(cell)) < EXACT
            except ValueError:
                return True
    return False


def unit_name(text: str) -> str | None:
    """The unit of a time, as `UNITS` has it; None: it is none.

    Example:
        >>> unit_name("Milliseconds"), unit_name("epoch s"), unit_name("m/s")
        ('ms', 's', None)
    """
    plain = text.strip().lower().replace("epoch", "").replace("unix", "").replace("since start", "").strip()
    plain = _NAMES.get(plain, plain)
    return plain if seconds_of(plain) else None


def seconds_of(unit: str) -> float:
    """The s of a unit, or of several as a clock's tick; 0: it is none.

    Example:
        >>> seconds_of("min"), seconds_of("10us"), seconds_of("0.1 ms"), seconds_of("2 x")
        (60.0, 1e-05, 0.0001, 0.0)
    """
    match = _TICK.fullmatch(unit)
    return (
        round(float(match[1] or 1.0) * UNITS.get(_NAMES.get(match[2], match[2]), 0.0), 15) if match else 0.0
    )


def of_numbers(values: Array, unit: str | None, name: str, rate: float | None = None) -> Times:
    """Times of a column of numbers.

    Args:
        values: (n,).
        unit: one of `UNITS`; None: judged from the numbers.
        name: of the column, for messages.
        rate: rows, or frames, per s that the column counts; replaces the unit.

    Raises:
        ConfigError: the unit cannot be judged.

    Example:
        >>> of_numbers(np.array([1533224087100.0, 1533224087200.0]), None, "time").t.round(6)
        array([0. , 0.1])
    """
    t = np.where((values == EMPTY) | (values == NO_NUMBER) | ~np.isfinite(values), np.nan, values)
    if not np.isfinite(t).any():
        raise ConfigError(f"{name}: holds no time in any row")
    first = float(t[np.isfinite(t)][0])
    if rate is not None:
        return _since(t, first, 1.0 / rate, None, "")
    note = ""
    if unit is None and (of_day := _of_digits(t)) is not None:
        t, first, note = of_day, float(of_day[np.isfinite(of_day)][0]), f"{name}: times of day as hhmmss"
        unit = "s"
    elif unit is None:
        unit, note = _judged(t, name)
    factor = seconds_of(unit)
    since_1970 = first * factor
    if unit == "d":
        # any other number of days has no date
        zero = next((zero for least, most, zero in _DATE_NUMBERS if least < first < most), first)
        since_1970 = (first - zero) * factor
    if unit == "s" and since_1970 >= _SINCE_1904[0]:
        since_1970 -= _SINCE_1904[1]
    epoch = round(since_1970 * 1e9) if since_1970 >= (_EPOCH_FROM if unit != "d" else 1.0) else None
    return _since(t, first, factor, epoch, note)


def _of_digits(t: Array) -> Array | None:
    """Seconds of times of day as hhmmss.s, which jump by 40 at each full minute; None: they are none.

    Example:
        >>> _of_digits(np.array([85959.5, 90000.0])).tolist(), _of_digits(np.array([59.5, 60.0]))
        ([32399.5, 32400.0], None)
    """
    known = t[np.isfinite(t)]
    if (
        known.min() < 0.0
        or known.max() >= 240_000.0
        or (known % 100 >= 60.0).any()
        or (known % 1e4 >= 6e3).any()
    ):
        return None
    of_day = t // 1e4 * 3600.0 + t // 100 % 100 * 60.0 + t % 100
    steps, shown = np.diff(of_day[np.isfinite(t)]), np.diff(known)
    at_minute = (shown >= 40.0) & (steps >= 0.0) & (steps <= MAX_STEP_S)
    return of_day if at_minute.any() else None


def _since(t: Array, first: float, factor: float, epoch: int | None, note: str) -> Times:
    zero = 0.0 if 0.0 <= first * factor <= _LATE_START_S else first
    # whole nanoseconds, as a log's
    with np.errstate(over="ignore"):
        return Times(np.round((t - zero) * (factor * 1e9)) * 1e-9, epoch, note, zero * factor)


def judged_unit(values: Array) -> str:
    """The unit that numbers in any order show.

    Example:
        >>> judged_unit(np.array([1533224087200.0, 1533224087100.0]))
        'ms'
    """
    return _judged(np.sort(values), "")[0]


def later(times: Times, rows: npt.NDArray[np.int64]) -> Times:
    """Times of some of the rows, in order, which begin where the first of them does.

    Example:
        >>> later(Times(np.array([0.0, 1.0, 2.0]), 10**18, ""), np.array([1, 2]))
        Times(t=array([0., 1.]), start_ns=1000000001000000000, note='', zero=1.0, local=False)
    """
    t = times.t[rows]
    start = None if times.start_ns is None else times.start_ns + round(1e9 * float(t[0]))
    zero = times.zero + float(t[0])
    return times._replace(t=np.round((t - t[0]) * 1e9) * 1e-9, start_ns=start, zero=zero)


def with_rest(times: Times, rest: Array, size: int) -> Times:
    """Times of whole seconds with the rest of each, of which `size` are a second.

    Example:
        >>> with_rest(Times(np.array([0.0, 0.0, 1.0]), None, ""), np.array([500.0, 900.0, 300.0]), 1000).t
        array([0. , 0.4, 0.8])
    """
    t = times.t + rest / size
    first = next(iter(t[np.isfinite(t)].tolist()), 0.0)
    start = None if times.start_ns is None else times.start_ns + round(1e9 * first)
    return times._replace(t=np.round((t - first) * 1e9) * 1e-9, start_ns=start, zero=times.zero + first)


def _judged(t: Array, name: str) -> tuple[str, str]:
    """The unit that the numbers show, and a note where that was judged."""
    known = t[np.isfinite(t)]
    size = float(np.median(np.abs(known)))
    for unit in ("ns", "us", "ms", "s"):
        if size * UNITS[unit] >= _EPOCH_FROM:
            return unit, ""
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    state = f"state the unit as {name.rpartition(': ')[2]} [s] where that is wrong"
    if _STEPS_OF_DAYS[0] < step < _STEPS_OF_DAYS[1] and np.ptp(known) < 1.0:
        return "d", f"{name}: steps of {step:.3g}: taken as days; {state}"
    if step > 1e6:
        return "ns", f"{name}: steps of {step:g}: taken as nanoseconds"
    if step > 1e3 * _LONG_STEP:
        return "us", f"{name}: steps of {step:g}: taken as microseconds; {state}"
    if step > _LONG_STEP:
        return "ms", f"{name}: steps of {step:g}: taken as milliseconds; {state}"
    return "s", ""


def of_texts(texts: Sequence[str], unit: str | None, name: str) -> Times:
    """Times of a column of dates, clock times or large whole numbers.

    Raises:
        ConfigError: they are none of these.

    Example:
        >>> of_texts(["2018-08-02T15:34:47+00:00", "2018-08-02T15:34:47.250Z"], None, "time").t.tolist()
        [0.0, 0.25]
    """
    texts = dates.with_zeros(texts)
    first = next((text.strip() for text in texts if text.strip()), "")
    note = ""
    if _INTEGER.fullmatch(first) and not _DIGITS.fullmatch(first):
        ns = _large(texts, unit)
    else:
        ns = [_ns(text.strip()) for text in texts]
        others = [k for k, text in enumerate(texts) if ns[k] is None and text.strip()]
        written = dates.of_texts([texts[k] for k in others])
        for k, stamp in zip(others, written.ns, strict=True):
            ns[k] = stamp
        note = f"{name}: {written.note}" if written.note else ""
    known: npt.NDArray[np.bool_] = np.array([stamp is not None for stamp in ns], bool)
    if not known.any():
        raise ConfigError(
            f'{name}: "{first[:40]}" is no time; write seconds, or dates as 2018-08-02T15:34:47.123Z (ISO 8601)'
        )
    if leap := _behind_leap_second(texts, ns):
        ns[leap:] = [None if stamp is None else stamp + NS_PER_S for stamp in ns[leap:]]
        note = "; ".join(
            filter(None, (note, f"{name}: a leap second: the rows behind 23:59:60 are 1 s later"))
        )
    zero = next(stamp for stamp in ns if stamp is not None)
    clock = zero < 1e18 and dates.clock_ns(first) is not None
    t = np.array([NAN if stamp is None else (stamp - zero) * 1e-9 for stamp in ns])
    if clock:
        going = row_clock.over_midnight(t[known], zero * 1e-9)
        t[known] = np.round(going.t * 1e9) * 1e-9
        note = "; ".join(filter(None, (note, f"{name}: {going.says}" if going.says else "")))
    local = not _INTEGER.fullmatch(first) and _ZONE.fullmatch(first) is None
    return Times(t, None if clock or zero < 1e18 else zero, note, zero * 1e-9, local)


def _behind_leap_second(texts: Sequence[str], ns: Sequence[int | None]) -> int:
    """The first row behind a leap second, in which the clock shows the same second again; 0: there is none.

    Example:
        >>> _behind_leap_second(["23:59:60.9", "00:00:00.0"], [900_000_000, 0])
        1
    """
    last = next((k for k in reversed(range(len(texts))) if _LEAP.search(texts[k])), -1)
    behind = next((k for k in range(last + 1, len(texts)) if ns[k] is not None), 0) if last >= 0 else 0
    before, after = ns[last], ns[behind]
    if not behind or before is None or after is None:
        return 0
    # of clock times midnight is between
    return behind if 0 < (before - after) % (86_400 * NS_PER_S) <= NS_PER_S else 0


def _large(texts: Sequence[str], unit: str | None) -> list[int | None]:
    values = [int(text) if _INTEGER.fullmatch(text := raw.strip()) else None for raw in texts]
    size = abs(next(value for value in values if value is not None))
    if unit is None:
        for least, most, zero in _TICKS:
            if least <= size <= most:
                return [None if value is None else value * 100 - zero * 10**9 for value in values]
        unit = next((u for u in ("s", "ms", "us", "ns") if size * UNITS[u] < 1e11), "ns")
    factor = round(seconds_of(unit) * 1e9)
    return [None if value is None else value * factor for value in values]


def _ns(text: str) -> int | None:
    """Nanoseconds since 1970, or of a clock time since midnight."""
    of_day = dates.clock_ns(text)
    if of_day is not None:
        return of_day
    if digits := _DIGITS.fullmatch(text):
        text = f"{digits['date']}T{digits['time']}.{digits['part'] or '0'}{digits['zone']}"
    text = text.replace(" UTC", "Z").replace("/", "-")
    try:
        stamp = datetime.fromisoformat(text)
    except ValueError:
        return None
    if stamp.tzinfo is None:
        stamp = stamp.replace(tzinfo=UTC)
    whole = stamp.replace(microsecond=0)
    # of nine digits; behind a form that is not known here Python has six
    fraction = re.search(r"[.,](\d{1,9})\d*\s*(?:Z|[+-][\d:]+)?$", text)
    nanos = int(fraction[1].ljust(9, "0")) if fraction is not None else stamp.microsecond * 1000
    return int(whole.timestamp()) * 1_000_000_000 + nanos
