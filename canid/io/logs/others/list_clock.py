"""Times in lists of frames that are written as a clock shows them, with a date or without."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence

from canid.io.logs.local_time import epoch_ns, offset_of
from canid.io.logs.text_lines import Bad
from canid.values import timestamps

_DAY_NS = 86_400 * timestamps.NS_PER_S
_CLOCK = re.compile(
    r"(?:(\d{4})[-/.](\d\d?)[-/.](\d\d?)[ T_]+|(\d\d?)[./-](\d\d?)[./-](\d{4}),?[ T_]+)?"
    r"(\d\d?):(\d\d?):(\d\d?)(?:[.,:](\d{1,9}))?\s*(?:(Z|[+-]\d\d:?\d\d)|([ap])\.?m\.?)?",
    re.IGNORECASE,
)
# dates whose first two numbers may be the month and the day: with points the day is first
_SLASHED = re.compile(r"(\d\d?)[/-](\d\d?)[/-]\d{4}\D.*")
# lines above the header of a CSS CL1000, CL2000 or CL3000
_CLX = re.compile(r"#\s*(Time|Time format)\s*:\s*(\d{8}T\d{6}|\d)\s*")
# its time formats: how many digits a stamp has (year, month, day, hour, minute, second, ms), and the time in which it
# begins again; of ms alone (0) nobody sees how many seconds a pause takes
_DIGITS = {6: 17, 5: 13, 4: 11, 3: 9, 2: 7, 1: 5}
_PERIOD_NS = {3: _DAY_NS, 2: 3600 * timestamps.NS_PER_S, 1: 60 * timestamps.NS_PER_S}
# the year in which a logger without a clock begins
_NO_CLOCK = 2000


def is_clock(text: str) -> bool:
    """Whether a cell is a time as a clock shows it.

    >>> is_clock("12:04:59.533"), is_clock("2025-03-03 10:00:00,25"), is_clock("3/4/2025 10:00:00 PM"), is_clock("12.5")
    (True, True, True, False)
    """
    return _CLOCK.fullmatch(text) is not None


def month_is_first(texts: Sequence[str]) -> bool | None:
    """Whether the month is before the day in dates such as 8/5/2026; None: they may be either.

    A number above 12 shows it, else the clock of twelve hours, which is that of the USA.

    >>> month_is_first(["3/14/2025 10:00:00"]), month_is_first(["14/3/2025 10:00:00"]), month_is_first(["3/4/2025 10:00:00"])
    (True, False, None)
    """
    dates = [match for text in texts if (match := _SLASHED.fullmatch(text))]
    if any(int(match[1]) > 12 for match in dates) or not dates:
        return False
    return True if any(int(match[2]) > 12 or match[0][-1] in "mM" for match in dates) else None


class Clock:
    """The times of one reading; those without a date begin anew at midnight.

    >>> clock = Clock(datetime.UTC)
    >>> [clock.ns(text) // 10**9 for text in ("23:59:59.5", "00:00:01")], clock.dated
    ([86399, 86401], False)
    """

    def __init__(self, zone: datetime.tzinfo | None, month_first: bool = False) -> None:
        """`zone`: of local times; `month_first`: see `month_is_first`."""
        self._zone = zone
        self._order = (5, 4) if month_first else (4, 5)  # of the day and the month
        self._latest: int | None = None
        self.dated = False

    def ns(self, text: str) -> int:
        """The time of a cell: since 1970, or since midnight of the first day. Raises Bad."""
        match = _CLOCK.fullmatch(text)
        if match is None:
            raise Bad("its time is damaged")
        day_at, month_at = self._order
        year, month, day = (
            int(a or b or 0)
            for a, b in ((match[1], match[6]), (match[2], match[month_at]), (match[3], match[day_at]))
        )
        hour, minute, second = map(int, match.group(7, 8, 9))
        fraction = int((match[10] or "").ljust(9, "0"))
        if match[12]:
            hour = hour % 12 + 12 * (match[12].lower() == "p") if 1 <= hour <= 12 else 24
        if hour > 23 or minute > 59 or second > 59:
            raise Bad("its time is damaged")
        if not year:
            return self._continued(
                ((hour * 60 + minute) * 60 + second) * timestamps.NS_PER_S + fraction, _DAY_NS
            )
        zone = self._zone if match[11] is None else offset_of(match[11])
        self.dated = True
        return _epoch(year, month, day, (hour, minute, second), zone) + fraction

    def _continued(self, ns: int, period: int) -> int:
        """A time that begins again after a period, as the one nearest to the latest."""
        if self._latest is not None:
            ns += (self._latest - ns + period // 2) // period * period
        self._latest = ns
        return ns


class LoggerClock(Clock):
    """The stamps of a CSS CL1000, CL2000 or CL3000: digits from the year, month, day, hour, minute or second to the ms.

    What a stamp leaves out is that of the start in the header, and goes on from there. Local time.

    >>> clock = LoggerClock(["# Time format: 4", "# Time: 20170131T235959"], datetime.UTC)
    >>> [clock.ns(text) - 1485907199 * 10**9 for text in ("31T235959000", "01T000000250")], clock.dated
    ([0, 1250000000], True)
    """

    def __init__(self, head: Sequence[str], zone: datetime.tzinfo | None) -> None:
        """`head`: the lines above the frames."""
        super().__init__(zone)
        said = {match[1]: match[2] for line in head if (match := _CLX.fullmatch(line.strip()))}
        self._form = int(said.get("Time format", "4")[:1])
        at = said.get("Time", "")
        self._start = (_NO_CLOCK, 1, 1)
        if len(at) > 1:
            self._start = (int(at[:4]), int(at[4:6]), int(at[6:8]))
            clock = (int(at[9:11]), int(at[11:13]), int(at[13:15]))
            try:
                self._latest = _epoch(*self._start, clock, zone)
            except Bad:
                self._start = (_NO_CLOCK, 1, 1)
        self.dated = self._start[0] > _NO_CLOCK
        self.refused = "" if self._form in _DIGITS else "its times are ms within a second"

    def ns(self, text: str) -> int:
        """The time of a cell, since 1970. Raises Bad."""
        digits = re.sub(r"\D", "", text)
        if len(digits) != _DIGITS.get(self._form):
            raise Bad("its time is damaged")
        milli = int(digits[-3:]) * 1_000_000
        pairs = [int(digits[k : k + 2]) for k in range(len(digits) - 5, -1, -2)][:5]  # s, min, h, day, month
        second, minute, hour = (*pairs[:3], 0, 0)[:3]
        if hour > 23 or minute > 59 or second > 59:
            raise Bad("its time is damaged")
        if self._form in _PERIOD_NS:
            written = ((hour * 60 + minute) * 60 + second) * timestamps.NS_PER_S + milli
            midnight = _epoch(*self._start, (0, 0, 0), self._zone)
            return self._continued(midnight + written, _PERIOD_NS[self._form])
        year, month = self._start[:2]
        if self._form == 6:
            years_and_months = [(int(digits[:4]), pairs[4])]
        elif self._form == 5:
            years_and_months = [(year + k, pairs[4]) for k in (-1, 0, 1)]
        else:
            months = [12 * year + month - 1 + k for k in (-1, 0, 1)]
            years_and_months = [(each // 12, each % 12 + 1) for each in months]
        day, clock = pairs[3], (hour, minute, second)
        near = []
        for each in years_and_months:
            try:
                near.append((_epoch(*each, day, clock, self._zone), each))
            except Bad:
                continue  # a month has no such day
        if not near:
            raise Bad("its time is damaged")
        latest = self._latest
        ns, (year, month) = min(near, key=lambda at: abs(at[0] - (at[0] if latest is None else latest)))
        self._start = (year, month, day)
        self._latest = ns + milli
        return ns + milli


def _epoch(year: int, month: int, day: int, clock: tuple[int, int, int], zone: datetime.tzinfo | None) -> int:
    """Epoch ns. Raises Bad."""
    try:
        ns = epoch_ns(datetime.datetime(year, month, day, *clock), zone)
    except ValueError:
        ns = None
    if ns is None:
        raise Bad("its time is damaged")
    return ns
