"""Columns that times have besides their own: of dates, and of what is left of a second."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from canid.analysis.tables import time_column
from canid.analysis.tables.column_map import ColumnEntry
from canid.analysis.tables.headings import TIME, heading, role_of
from canid.analysis.tables.resolution import Found
from canid.analysis.tables.source import NO_NUMBER, Source, number
from canid.analysis.tables.times.dates import clock_ns, is_date

# names of columns, as `Heading.name`; a date of something else has a longer one
NAMES = ("date", "gps_date", "utc_date", "local_date", "date_utc", "datum")

# names of columns with the rest of a second, and how many of it are one
_RESTS = {
    1_000: ("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"),
    1_000_000: ("us", "usec", "usecs", "micros", "microsecond", "microseconds"),
    1_000_000_000: ("ns", "nsec", "nsecs", "nanosec", "nanos", "nanosecond", "nanoseconds", "header_stamp_nsecs",
                    "header_stamp_nanosec"),
}  # fmt: skip
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
    places = [place for place, text in enumerate(source.headings) if heading(text).name in NAMES]
    places = [place for place in places if (cells := filled(sample[place])) and all(map(is_date, cells))]
    times = by_role.get(TIME)
    if times is None:
        dated = ColumnEntry.model_validate(source.headings[places[0]]) if places else None
        first = _of_first(source) if dated is None else Found(places[0], dated, None)
        return by_role if first is None else {**by_role, TIME: first}
    if rest := _rest(source, times):
        by_role = {**by_role, TIME: (times := times._replace(rest=rest))}
    if not places:
        return by_role
    of_day = filled(sample[times.place])
    if not of_day or any(clock_ns(cell) is None for cell in of_day):
        return by_role
    return {**by_role, TIME: times._replace(date_place=places[0])}


def _rest(source: Source, times: Found) -> tuple[int, int] | None:
    """The column that counts on within the whole seconds of the times, and how many are a second; None: there is none."""
    sample = source.sample()
    for place, text in enumerate(source.headings):
        size = next((n for n, names in _RESTS.items() if heading(text).name in names), 0)
        cells = sample[place] if size and place != times.place else []
        rests, shown = [number(cell) for cell in cells], sample[times.place]
        rises = [(shown[k] == shown[k - 1], rests[k] >= rests[k - 1]) for k in range(1, len(rests))]
        whole = all(x == round(x) and 0 <= x < size for x in rests) and not any(map(_PART.search, shown))
        # it grows within a second, and begins anew with the next
        if whole and {(True, True), (False, False)} <= {*rises} and (True, False) not in rises:
            return place, size
    return None


def _of_first(source: Source) -> Found | None:
    """The first column, where it states a unit of time, or nothing and holds times, and only advances."""
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


def joined(dates: Sequence[str], times: Sequence[str]) -> list[str]:
    """Dates and times of day as one text each; a date that is written once holds for the rows behind it.

    Example:
        >>> joined(["2026-08-05", ""], ["23:59:59", "00:00:00"])
        ['2026-08-05 23:59:59', '2026-08-05 00:00:00']
    """
    out, latest = [], ""
    for day, time in zip(dates, times, strict=True):
        latest = day.strip() or latest
        out.append(f"{latest} {time.strip()}" if time.strip() else "")
    return out
