"""Dates and times of day as people's programs write them: 05-Aug-2026, 05.08.2026, 08/05/2026 6:57 PM.

Which of two numbers is the month is judged from all cells of a column together, and said.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from datetime import date, datetime
from itertools import pairwise
from typing import NamedTuple

from canid.io.logs.asc.asc_date_words import MONTHS
from canid.io.logs.local_time import offset_of
from canid.values.timestamps import NS_PER_S

_TIME = r"(?P<h>\d{1,3}):(?P<m>\d{1,2})(?::(?P<s>\d{1,2}(?:[.,]\d+)?))?(?:\ ?(?P<half>[ap])\.?\ ?m\.?)?"
_DATE = r"""(?:[^\W\d_]{2,9}\.?,?\ )?(?:
    (?P<year>\d{4})(?P<dash>[-/.])(?P<month>\d{1,2})(?P=dash)(?P<day>\d{1,2})
    | (?P<first>\d{1,2})(?P<mark>[-/.\ ])(?P<second>\d{1,2}|[^\W\d_]{3,9}\.?)(?P=mark)(?P<short>\d{4}|\d\d)
    | (?P<name>[^\W\d_]{3,9})\.?\ (?P<named>\d{1,2}),?\ (?P<long>\d{4})
    )"""
# a name may say no offset, see `offset_of`; an offset may have the name of its place behind it (java.time)
_ZONE = r"(?:\ ?\(?(?P<zone>(?:UTC|GMT)?[+-]\d\d?(?::?\d\d)?|UTC|GMT|Z|[A-Z]{2,4}T|MES?Z|MSK)\)?(?:\[[\w/+-]{1,40}\])?)?"
# as spreadsheets show times of less than an hour, and lap timers: minutes, seconds and a fraction
_MINUTES = re.compile(r"(?P<m>\d{1,4}):(?P<s>[0-5]\d[.,]\d+)")
_CLOCK = re.compile(_TIME, re.VERBOSE | re.IGNORECASE)
_WRITTEN = re.compile(rf"{_DATE}(?:(?:T|,?\ ){_TIME}{_ZONE})?", re.VERBOSE | re.IGNORECASE)
# written as the others are before it is read: ctime's "Wed Aug 05 18:57:03 GMT+02:00 2026", 2026年8月5日, 18:57:03:125
_USUAL: tuple[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]], ...] = (
    (
        re.compile(r"(?:\w{3},? )?(\w{3}) {1,2}(\d{1,2}) (\d\d:\d\d:[\d.,]{2,12})( [^\d ]\S{0,9})? (\d{4})"),
        r"\1 \2 \5 \3\4",
    ),
    # SAS, and servers' logs: 09MAR2026:08:15:04, 09/Mar/2026:08:15:04
    (re.compile(r"^(\d\d)(/?)([^\W\d_]{3})\2(\d{4}):(?=\d\d:)"), r"\1-\3-\4 "),
    (re.compile(r"(\d{4})[年년] ?(\d{1,2})[月월] ?(\d{1,2})[日일]"), r"\1-\2-\3"),
    (re.compile(r"(\d{1,2})[時时시] ?(\d{1,2})[分분] ?(\d{1,2}(?:\.\d+)?)[秒초]"), r"\1:\2:\3"),
    (re.compile(r"^(\d{4})\. ?(\d{1,2})\. ?(\d{1,2})\. (?=\d)"), r"\1.\2.\3 "),
    (re.compile(r"^(\d{1,3}:[0-5]\d):(\d{3})$"), r"\1.\2"),
    # an ordinal date (ISO 8601), as 2026-217, 2026217T08:15 and, of telemetry, 2026:217:08:15:04
    (
        re.compile(
            r"^([12]\d{3})(?:-?(?=\d{3}[T ])|-(?=\d{3}$)|:(?=\d{3}:))(00[1-9]|0[1-9]\d|[12]\d\d|3[0-5]\d|36[0-6])(?:[T :]|$)"
        ),
        lambda match: f"{datetime.strptime(match[1] + match[2], '%Y%j'):%Y-%m-%d} ",
    ),
    (re.compile(r"(:\d\d?:\d\d?):(\d{3})\b"), r"\1.\2"),
)
# hours, minutes, seconds, and a number that may be of milliseconds; times at which it must go back as a fraction
_MILLISECONDS = re.compile(r"(?P<rest>.*:\d{1,2}:\d{1,2})(?P<mark>[.:,])(?P<ms>\d{1,3})")
_MIN_BACK = 3
_MAX_PICTURES = 60
# a time since a start, as pandas and Python write it, or the day of an unstated year, 068:08:15:04
_SINCE = re.compile(r"\+?(\d{1,5}(?= day)|\d{3}(?=[:/]\d\d:\d\d:\d\d))(?: days?,? |[:/])(.+)")
_DAY_NS = 86_400 * NS_PER_S
_EPOCH = date(1970, 1, 1).toordinal()
# which of its three numbers may be first
_ORDERS = ("day", "month", "year")
# of several years that a date may have, one of these is taken: few buses had a radar before, and none of the later ones
# has come yet. A fixed end and no clock: the same file is read alike for ever
_USUAL_YEARS = 2010, 2030


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
    zone = next((cell["zone"] for cell in cells if cell and cell["zone"]), "")
    unknown = (
        ""
        if not zone or offset_of(zone)
        else f'which offset the zone "{zone}" has is not known: taken as UTC'
    )
    readings = {order: [_ns(cell, order) for cell in cells] for order in _ORDERS}
    readings = {
        order: ns for order, ns in readings.items() if order == "day" or ns != readings["day"]
    }  # of four digits the year is at one end
    first = next((k for k, read in enumerate(zip(*readings.values(), strict=True)) if len({*read}) > 1), None)
    if first is None:
        return Dates(readings["day"], unknown)
    example = texts[first].strip()
    holes = {order: ns.count(None) for order, ns in readings.items()}
    possible = [order for order in readings if holes[order] == min(holes.values())]
    spans = {order: _span(readings[order]) for order in possible}
    left = [order for order in possible if spans[order] == min(spans.values())]
    # with points the day is first; the clock of twelve hours is that of the USA
    american = "." not in example.split()[0] and example.lower().rstrip(".").endswith("m")
    left.sort(key=lambda order: (not _in_usual_years(readings[order][first]), american and order == "day"))
    taken, *others = left
    ns, says = readings[taken], f'dates as "{example}": {taken}'
    if others:
        other = ", ".join(f"{order} first: {_day(readings[order][first])}" for order in others)
        says += (
            f" taken to be first, which no row shows ({other}); times since the first row do not depend on it"
        )
    elif len(possible) > 1:
        days = (sorted(spans.values())[1] - spans[taken]) // _DAY_NS + 1
        says += f" first, as otherwise the rows would be {days} days apart"
    else:
        rest = [ns for order, ns in readings.items() if order != taken]
        shown = [k for k in range(len(texts)) if ns[k] is not None and all(read[k] is None for read in rest)]
        says += (
            f' first, as "{texts[shown[0]].strip()}" shows' if shown else " first, as all rows together show"
        )
    return Dates(ns, "; ".join(filter(None, (says, unknown))))


def with_zeros(texts: Sequence[str]) -> Sequence[str]:
    """Times whose milliseconds are written without leading zeros, with them: 3.20 is 3.020 where it precedes 3.100.

    Example:
        >>> with_zeros(["8:00:3:90", "8:00:3:100"]), with_zeros(["8:00:03:05", "8:00:03:95"])
        (['8:00:3:090', '8:00:3:100'], ['8:00:03.05', '8:00:03.95'])
    """
    cells = [_MILLISECONDS.fullmatch(text.strip()) for text in texts]
    lengths = {len(cell["ms"]) for cell in cells if cell}
    if lengths == {2} and any(int(cell["ms"]) >= _MAX_PICTURES for cell in cells if cell):
        # hundredths, since no camera takes so many pictures a second
        return [
            f"{cell['rest']}.{cell['ms']}" if cell and cell["mark"] == ":" else text
            for cell, text in zip(cells, texts, strict=True)
        ]
    if len(lengths) < 2:
        return texts
    pairs = [(a["ms"], b["ms"]) for a, b in pairwise(cells) if a and b and a["rest"] == b["rest"]]
    back = sum(float(f".{a}") > float(f".{b}") for a, b in pairs)
    # behind a colon no fraction stands; numbers of two digits there count pictures
    colon = all(cell["mark"] == ":" for cell in cells if cell) and any(
        len(cell["ms"]) == 3 for cell in cells if cell
    )
    if (back < _MIN_BACK and not colon) or any(int(a) > int(b) for a, b in pairs):
        return texts
    return [
        f"{cell['rest']}{cell['mark']}{cell['ms']:0>3}" if cell else text
        for cell, text in zip(cells, texts, strict=True)
    ]


def _in_usual_years(ns: int | None) -> bool:
    return ns is not None and _USUAL_YEARS[0] <= int(_day(ns)[:4]) <= _USUAL_YEARS[1]


def _day(ns: int | None) -> str:
    return "none" if ns is None else date.fromordinal(_EPOCH + ns // _DAY_NS).isoformat()


def _usual(text: str) -> str:
    """A date or time of day in a usual form."""
    text = text.strip()
    for form, usual in _USUAL:
        text = form.sub(usual, text)
    return text.rstrip()


def is_date(text: str) -> bool:
    """Whether a text is a date, with a time of day or without.

    Example:
        >>> is_date("05.08.2026"), is_date("Aug 5, 2026 18:57"), is_date("18:57"), is_date("2026-217"), is_date("2026-367")
        (True, True, False, True, False)
    """
    return of_texts([text]).ns[0] is not None


def _span(ns: Sequence[int | None]) -> int:
    known = [each for each in ns if each is not None]
    return max(known) - min(known)


def _ns(cell: re.Match[str] | None, order: str) -> int | None:
    """Nanoseconds since 1970 of a date whose first number is the day, the month or the year, where it may be either."""
    if cell is None:
        return None
    if cell["year"] is not None:
        year, month, day = (int(cell[name]) for name in ("year", "month", "day"))
    elif cell["name"] is not None:
        year, month, day = int(cell["long"]), _month(cell["name"]), int(cell["named"])
    else:
        first, second, last = cell["first"], cell["second"], cell["short"]
        if order == "year" and len(first) == len(last) == 2:
            first, last = last, first
        elif order == "month" and second.isdecimal():
            first, second = second, first
        year, day = int(last) + (2000 if len(last) == 2 else 0), int(first)
        month = int(second) if second.isdecimal() else _month(second)
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
