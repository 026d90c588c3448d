"""A column of dates: that of the times, or one besides the times of day."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from canid.analysis.tables import time_column
from canid.analysis.tables.column_map import ColumnEntry
from canid.analysis.tables.headings import TIME, heading, role_of
from canid.analysis.tables.resolution import Found
from canid.analysis.tables.source import NO_NUMBER, Source, number
from canid.analysis.tables.times.dates import clock_ns, is_date

# names of columns, as `Heading.name`; a date of something else has a longer one
NAMES = ("date", "gps_date", "utc_date", "local_date", "date_utc", "datum")


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
    if not places:
        return by_role
    of_day = filled(sample[times.place])
    if not of_day or any(clock_ns(cell) is None for cell in of_day):
        return by_role
    return {**by_role, TIME: times._replace(date_place=places[0])}


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
