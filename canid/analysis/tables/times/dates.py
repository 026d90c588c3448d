"""Dates and times of day as people's programs write them: 05-Aug-2026, 05.08.2026, 08/05/2026 6:57 PM.

Which of two numbers is the month is judged from all cells of a column together, and said.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

from canid.io.logs.asc.asc_date_words import MONTHS
from canid.io.logs.local_time import offset_of
from canid.values.timestamps import NS_PER_S

_TIME = r"(?P<h>\d{1,3}):(?P<m>\d{1,2})(?::(?P<s>\d{1,2}(?:[.,]\d+)?))?(?:\ ?(?P<half>[ap])\.?m\.?)?"
_DATE = r"""(?:[^\W\d_]{2,9}\.?,?\ )?(?:
    (?P<year>\d{4})(?P<dash>[-/.])(?P<month>\d{1,2})(?P=dash)(?P<day>\d{1,2})
    | (?P<first>\d{1,2})(?P<mark>[-/.\ ])(?P<second>\d{1,2}|[^\W\d_]{3,9}\.?)(?P=mark)(?P<short>\d{4}|\d\d)
    | (?P<name>[^\W\d_]{3,9})\.?\ (?P<named>\d{1,2}),?\ (?P<long>\d{4})
    )"""
# CEST and other names say no offset: as without a zone
_ZONE = r"(?:\ ?(?P<zone>(?:UTC|GMT)?[+-]\d\d:?\d\d|UTC|GMT|Z|[A-Z]{2,4}T))?"
# as spreadsheets show times of less than an hour, and lap timers: minutes, seconds and a fraction
_MINUTES = re.compile(r"(?P<m>\d{1,4}):(?P<s>[0-5]\d[.,]\d+)")
_CLOCK = re.compile(_TIME, re.VERBOSE | re.IGNORECASE)
_WRITTEN = re.compile(rf"{_DATE}(?:(?:T|,?\ ){_TIME}{_ZONE})?", re.VERBOSE | re.IGNORECASE)
# written as the others are before it is read: ctime's "Wed Aug 05 18:57:03 GMT+02:00 2026", 2026年8月5日, 18:57:03:125
_USUAL = (
    (
        re.compile(r"(?:\w{3},? )?(\w{3}) {1,2}(\d{1,2}) (\d\d:\d\d:[\d.,]{2,12})( [^\d ]\S{0,9})? (\d{4})"),
        r"\1 \2 \5 \3\4",
    ),
    (re.compile(r"(\d{4})年(\d{1,2})月(\d{1,2})日"), r"\1-\2-\3"),
    (re.compile(r"(:\d\d:\d\d):(\d{3})\b"), r"\1.\2"),
)
# a time since a start, as pandas and Python write it
_SINCE = re.compile(r"\+?(\d{1,5}) days?,? (.+)")
_DAY_NS = 86_400 * NS_PER_S
_EPOCH = date(1970, 1, 1).toordinal()


class Dates(NamedTuple):
    """Dates of the cells of a column."""

    ns: list[int | None]  # (n,) since 1970; None: the cell holds none
    note: str  # which number was taken as the month, where both may be; "": no need to say


def of_texts(texts: Sequence[str]) -> Dates:
    """Read dates with or without times of day; without a zone they are taken as UTC.

    Example:
        >>> dates = of_texts(["08/05/2026 11:59 PM", "08/06/2026 12:00 AM"])
        >>> (dates.ns[1] - dates.ns[0]) / 1e9, dates.note
        (60.0, 'dates as "08/05/2026 11:59 PM": month first, as otherwise the rows would be 31 days apart')
        >>> of_texts(["05-Aug-2026 18:57:03.125", "n/a"]).ns
        [1785956223125000000, None]
        >>> [ns / 1e9 for ns in of_texts(["Wed Aug 05 18:57:03 GMT+02:00 2026", "2026年8月5日 18:57:03:125"]).ns]
        [1785949023.0, 1785956223.125]
    """
    cells = [_WRITTEN.fullmatch(_usual(text)) for text in texts]
    day_first, month_first = ([_ns(cell, day_first=each) for cell in cells] for each in (True, False))
    example = next(
        (text.strip() for text, a, b in zip(texts, day_first, month_first, strict=True) if a != b), None
    )
    if example is None:
        return Dates(day_first, "")
    says = f'dates as "{example}":'
    for chosen, other, name in ((day_first, month_first, "day"), (month_first, day_first, "month")):
        if chosen.count(None) < other.count(None):
            shown = next(k for k in range(len(texts)) if chosen[k] is not None and other[k] is None)
            return Dates(chosen, f'{says} {name} first, as "{texts[shown].strip()}" shows')
    for chosen, other, name in ((day_first, month_first, "day"), (month_first, day_first, "month")):
        if _span(chosen) < _span(other):
            days = (_span(other) - _span(chosen)) // _DAY_NS + 1
            return Dates(chosen, f"{says} {name} first, as otherwise the rows would be {days} days apart")
    # with points the day is first; the clock of twelve hours is that of the USA
    american = "." not in example.split()[0] and example.lower().rstrip(".").endswith("m")
    name = "month" if american else "day"
    return Dates(
        month_first if american else day_first,
        f"{says} {name} taken to be first, which no row shows; times since the first row do not depend on it",
    )


def _usual(text: str) -> str:
    """A date or time of day in a usual form."""
    text = text.strip()
    for form, usual in _USUAL:
        text = form.sub(usual, text)
    return text


def is_date(text: str) -> bool:
    """Whether a text is a date, with a time of day or without.

    Example:
        >>> is_date("05.08.2026"), is_date("Aug 5, 2026 18:57"), is_date("18:57")
        (True, True, False)
    """
    return of_texts([text]).ns[0] is not None


def _span(ns: Sequence[int | None]) -> int:
    known = [each for each in ns if each is not None]
    return max(known) - min(known)


def _ns(cell: re.Match[str] | None, *, day_first: bool) -> int | None:
    if cell is None:
        return None
    if cell["year"] is not None:
        year, month, day = (int(cell[name]) for name in ("year", "month", "day"))
    elif cell["name"] is not None:
        year, month, day = int(cell["long"]), _month(cell["name"]), int(cell["named"])
    else:
        year = int(cell["short"]) + (2000 if len(cell["short"]) == 2 else 0)
        first, second = cell["first"], cell["second"]
        if not second.isdecimal():
            month, day = _month(second), int(first)
        else:
            month, day = (int(second), int(first)) if day_first else (int(first), int(second))
    try:
        days = date(year, month, day).toordinal() - _EPOCH
    except ValueError:
        return None
    of_day = 0 if cell["h"] is None else _of_day(cell)
    if of_day is None:
        return None
    offset = offset_of(cell["zone"]) if cell["zone"] else None
    east = 0 if offset is None else round(offset.utcoffset(None).total_seconds())
    return days * _DAY_NS + of_day - east * NS_PER_S


def _month(name: str) -> int:
    """The number of a month; 0: it is none."""
    plain = name.lower().rstrip(".")
    return MONTHS.get(plain) or MONTHS.get(plain[:4]) or MONTHS.get(plain[:3]) or 0


def clock_ns(text: str) -> int | None:
    """Nanoseconds since midnight of a time of day without a date, or of minutes and seconds; None: it is none.

    Example:
        >>> clock_ns("00:00:01.5"), clock_ns("12:00 AM"), clock_ns("12:30"), clock_ns("12:30.5")
        (1500000000, 0, None, 750500000000)
        >>> clock_ns("1 days 00:00:00.100000"), clock_ns("00:00:01:500")
        (86400100000000, 1500000000)
    """
    if since := _SINCE.fullmatch(text):
        of_day = clock_ns(since[2])
        return None if of_day is None else int(since[1]) * _DAY_NS + of_day
    text = _usual(text)
    if minutes := _MINUTES.fullmatch(text):
        return round((int(minutes["m"]) * 60 + float(minutes["s"].replace(",", "."))) * 1e9)
    match = _CLOCK.fullmatch(text)
    # without seconds and half of the day it may be minutes and seconds
    return _of_day(match) if match is not None and (match["s"] or match["half"]) else None


def _of_day(match: re.Match[str]) -> int | None:
    """Nanoseconds since midnight of a time of day; None: there is no such one of twelve hours."""
    hour = int(match["h"])
    if match["half"] is not None:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + 12 * (match["half"].lower() == "p")
    return round((hour * 3600 + int(match["m"]) * 60 + float((match["s"] or "0").replace(",", "."))) * 1e9)
