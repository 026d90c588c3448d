"""Columns that times have besides their own: of dates, years to minutes, GPS weeks, and of what is left of a second."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy as np

from canid.analysis.tables import time_column
from canid.analysis.tables.column_map import ColumnEntry
from canid.analysis.tables.headings import TIME, heading, role_of
from canid.analysis.tables.resolution import Found
from canid.analysis.tables.source import NO_NUMBER, Source, clean, number
from canid.analysis.tables.times.dates import clock_ns, is_date
from canid.values.timestamps import NS_PER_S

# names of columns, as `Heading.name`; a date of something else has a longer one
NAMES = ("date", "gps_date", "utc_date", "local_date", "date_utc", "datum")

# names of columns with the rest of a second, and how many of it are one
_RESTS = {
    1_000: ("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"),
    1_000_000: ("us", "usec", "usecs", "micros", "microsecond", "microseconds"),
    1_000_000_000: ("ns", "nsec", "nsecs", "nanosec", "nanos", "nanosecond", "nanoseconds"),
}  # fmt: skip
# names of columns with a part of the clock, as `_part_names`, the largest values that they have; in the order of the clock
_PARTS = {
    "year": (("year", "years", "yyyy"), 2100), "month": (("month", "months"), 12), "day": (("day", "days"), 31),
    "hour": (("hour", "hours", "hh", "std"), 24), "minute": (("minute", "minutes", "min", "mins"), 59),
}  # fmt: skip
_SECONDS = (("second", "seconds", "sec", "secs", "ss", "sek"), 60)
_BY_UNIT = {"h": "hour", "min": "minute", "s": "second"}  # of columns of times
# of hours up to twelve
_HALVES = {"am_pm", "ampm"}
# of GPS: weeks, and the time within them, in s, or in ms where it is above the s of a week
_WEEK = (("week", "week_number", "wn"), 9999)
_OF_WEEK = ("tow", "time_of_week", "sow", "i_tow", "itow", "seconds", "seconds_of_week")
_WEEK_S, _GPS_ZERO_S = 604_800, 315_964_800  # s, from 1970 to 6 January 1980
# weeks from which on UTC is so many s behind GPS (IERS Bulletin C); receivers with ten bits count to 1,023 and begin anew
_LEAPS, _MIN_WEEK = ((1930, 18), (1851, 17), (1695, 16), (1512, 15), (1356, 14), (0, 13)), 1024
# a part of a second, of a number or of a time of day
_PART = re.compile(r"(?:^|:)\d+[.,]\d*[1-9]")


def with_dates(source: Source, by_role: Mapping[str, Found]) -> Mapping[str, Found]:
    """The columns, the times among them with their dates.

    Args:
        source: of the table.
        by_role: its columns.

    Returns:
        the same where no column holds dates, or the times need none.
    """
    sample = source.sample()
    named = [place for place, text in enumerate(source.headings) if heading(text).name in NAMES]
    places = [place for place in named if (cells := filled(sample[place])) and all(map(is_date, cells))]
    times = by_role.get(TIME)
    if clock := _of_parts(source, times, places):
        rest = _rest(source, clock)
        return {**by_role, TIME: clock if rest is None else clock._replace(rest=rest)}
    if times is None:
        dated = ColumnEntry.model_validate(source.headings[places[0]]) if places else None
        first = _of_first(source, named) if dated is None else Found(places[0], dated, None)
        return by_role if first is None else {**by_role, TIME: first}
    if rest := _rest(source, times):
        by_role = {**by_role, TIME: (times := times._replace(rest=rest))}
    if not places:
        return by_role
    of_day = filled(sample[times.place])
    if not of_day or any(clock_ns(cell) is None for cell in of_day):
        return by_role
    return {**by_role, TIME: times._replace(parts=(("date", places[0]),))}


def _of_parts(source: Source, times: Found | None, dates: Sequence[int]) -> Found | None:
    """Times whose seconds have minutes, hours and dates, or GPS weeks, in columns of their own; None: they have none."""
    sample, heads = source.sample(), [heading(text) for text in source.headings]
    names = [re.sub(r"^(utc|gps|local)_", "", head.name) for head in heads]
    by_unit = [_BY_UNIT.get(head.unit or "") if role_of(head) == TIME else None for head in heads]
    if {"minute", "second"} <= {*by_unit}:
        names = [part or name for part, name in zip(by_unit, names, strict=True)]

    def place_of(known: tuple[str, ...], most: float, whole: bool = True) -> int:
        for place, name in enumerate(names):
            cells = [number(cell) for cell in sample[place]] if name in known else []
            if cells and all(0 <= x <= most and (x == round(x) or not whole) for x in cells):
                return place
        return -1

    places = {part: place_of(*known) for part, known in _PARTS.items()}
    seconds, week = place_of(*_SECONDS, False), place_of(*_WEEK)
    if week >= 0 and places["minute"] < 0:
        seconds, places = place_of(_OF_WEEK, 1000.0 * _WEEK_S, False), {"week": week}
    elif min(places["minute"], seconds) < 0 or not _within_minutes(source, seconds):
        return None
    if seconds < 0 or (times is not None and times.place != seconds and by_unit[seconds] is None):
        return None
    dated = min(places.get(part, -1) for part in ("year", "month", "day")) >= 0 and not _HALVES & {*names}
    parts = [
        (part, k) for part, k in places.items() if k >= 0 and (dated or part in ("hour", "minute", "week"))
    ]
    if dates and not dated and "week" not in places and not _HALVES & {*names}:
        parts = [("date", dates[0]), *parts]
    return Found(
        seconds, ColumnEntry.model_validate(heads[seconds].text), heads[seconds].unit, parts=tuple(parts)
    )


def _rest(source: Source, times: Found) -> tuple[int, int] | None:
    """The column that counts on within the whole seconds of the times, and how many are a second; None: there is none."""
    sample = source.sample()
    for place, text in enumerate(source.headings):
        head = heading(text)
        name = (head.unit if role_of(head) == TIME else None) or head.name.rpartition("header_stamp_")[2]
        size = next((n for n, names in _RESTS.items() if name in names), 0)
        cells = sample[place] if size and place != times.place else []
        rests, shown = [number(cell) for cell in cells], sample[times.place]
        rises = [(shown[k] == shown[k - 1], rests[k] >= rests[k - 1]) for k in range(1, len(rests))]
        whole = all(0 <= x < size and x == round(x) for x in rests) and not any(map(_PART.search, shown))
        # it grows within a second, and begins anew with the next
        if whole and {(True, True), (False, False)} <= {*rises} and (True, False) not in rises:
            return place, size
    return None


def _of_first(source: Source, named: Sequence[int]) -> Found | None:
    """The first column, where it states a unit of time, or nothing and holds times, and only advances.

    `named`: as dates, which are numbers in spreadsheets.
    """
    for place in named:
        numbers = [number(cell) for cell in filled(source.sample()[place])]
        if numbers and NO_NUMBER < numbers[0] < numbers[-1] and numbers == sorted(numbers):
            return Found(place, ColumnEntry.model_validate(source.headings[place]), "d")
    head, cells = heading(source.headings[0]), filled(source.sample()[0])
    if role_of(head) is not None or len({*cells}) < 2:
        return None
    if head.unit is not None and time_column.unit_name(head.unit) is not None:
        numbers = [number(cell) for cell in cells]
        if min(numbers) > NO_NUMBER and numbers == sorted(numbers):
            return Found(0, ColumnEntry.model_validate(head.text), head.unit)
    if not head.text.strip() and all(is_date(cell) or clock_ns(cell) is not None for cell in cells):
        return Found(0, ColumnEntry.model_validate("the column without a name"), None)
    return None


def filled(cells: Sequence[str]) -> list[str]:
    """The cells that are not empty, without spaces at their ends."""
    return [text for cell in cells if (text := cell.strip())]


def _within_minutes(source: Source, place: int) -> bool:
    """Whether no number of a column is above 60: seconds that count on have no minutes."""
    blocks = source.blocks([place], [])
    return all(float(np.nanmax(clean(block.numbers[:, 0]), initial=0.0)) <= _SECONDS[1] for block in blocks)


def joined(parts: Sequence[str], columns: Sequence[Sequence[str]], times: Sequence[str]) -> list[str]:
    """Times as one text each, with what stands before them; a date that is written once holds for the rows behind it.

    Args:
        parts: what the columns hold: "date", "year" to "minute", or "week".
        columns: their cells.
        times: of day, seconds, or of the GPS week.

    Example:
        >>> joined(["date"], [["2026-08-05", ""]], ["23:59:59", "00:00:00"])
        ['2026-08-05 23:59:59', '2026-08-05 00:00:00']
        >>> joined(["hour", "minute"], [["9", "10"], ["59", "0"]], ["59.5", "0"])
        ['09:59:59.5', '10:00:00']
        >>> joined(["week"], [["2304"]], ["381618.5"])  # ns; 2024-03-07T10:00:00.5Z
        ['1709805600500000000']
    """
    out, latest = [], ""
    # under a decimal comma
    times = [
        time.strip().replace(",", ".") if len(parts) > 1 or "week" in parts else time.strip()
        for time in times
    ]
    in_ms = max((number(time) for time in times), default=0.0) > _WEEK_S
    for *before, time in zip(*columns, times, strict=True):
        cells = dict(zip(parts, before, strict=True))
        latest = cells.pop("date", "").strip() or latest
        numbers = {part: number(cell) for part, cell in cells.items()}
        if cells:
            numbers["second"] = number(time)
        if not time or not all(x >= 0.0 and math.isfinite(x) for x in numbers.values()):
            out.append("-" if time else "")
        elif "week" in cells:
            week, of_week = int(numbers["week"]), Decimal(time) * (1 if in_ms else 1000)
            zero = _GPS_ZERO_S - next(s for first, s in _LEAPS if week >= first) if week >= _MIN_WEEK else 0
            out.append(str((week * _WEEK_S + zero) * NS_PER_S + int(of_week * 1_000_000)))
        else:
            if cells:
                time = time if numbers["second"] >= 10.0 else f"0{time}"
                time = f"{numbers.get('hour', 0.0):02.0f}:{numbers['minute']:02.0f}:{time}"
            day = "{year:04.0f}-{month:02.0f}-{day:02.0f}".format(**numbers) if "day" in cells else latest
            out.append(f"{day} {time}".strip())
    return out


def of_gps(start_ns: int | None) -> str:
    """How GPS weeks were understood, by the start that they gave.

    Example:
        >>> of_gps(None), of_gps(1_709_805_600 * 10**9)
        ('GPS weeks below 1024 state no date', 'GPS time; UTC is taken as 18 s behind it')
    """
    if start_ns is None:
        return f"GPS weeks below {_MIN_WEEK} state no date"
    week = (start_ns // NS_PER_S - _GPS_ZERO_S) // _WEEK_S
    return f"GPS time; UTC is taken as {next(s for first, s in _LEAPS if week >= first)} s behind it"
