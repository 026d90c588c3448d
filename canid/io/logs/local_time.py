"""Local times in logs, and the one rule by which they become UTC.

A log that states its start as local time without a zone (.asc, .trc, .blf of Vector's tools) is read in the zone that
is named by `--time-zone` (`open_log(time_zone=...)`, the variable CANID_TIME_ZONE), or else in this machine's.
"""

from __future__ import annotations

import contextlib
import datetime
import os
import re
import zoneinfo
from collections.abc import Iterator

from canid.values.errors import ConfigError

VARIABLE = "CANID_TIME_ZONE"
_OFFSET = re.compile(r"(?:UTC|GMT)?([+-])(\d{1,2}):?(\d\d)?", re.IGNORECASE)
# names that stand for one offset: RFC 5322, 4.3, and Europe; CST, IST and BST are those of several countries
_NAMES = {
    "EST": -5, "EDT": -4, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7, "WET": 0, "WEST": 1, "CET": 1, "CEST": 2,
    "MEZ": 1, "MESZ": 2, "EET": 2, "EEST": 3, "MSK": 3, "JST": 9, "KST": 9, "UTC": 0, "GMT": 0, "Z": 0,
}  # fmt: skip
_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
# of a file whose bytes do not say whether its start is local time or UTC
UNSTATED = (
    "the file does not state the zone of its start: taken as UTC, as canid and python-can write it; "
    "--time-zone names another"
)
# the same, where one is named
NAMED = (
    "the file does not state the zone of its start: taken as in the zone that is named; canid up to 0.2 and python-can "
    "write UTC: --time-zone UTC"
)


def offset_of(text: str) -> datetime.timezone | None:
    """The zone of an offset to UTC in hours and minutes, or of a name that has one; None: it is none, or of a day and more.

    >>> str(offset_of("+08:00")), str(offset_of("-0330")), offset_of("+25:00"), offset_of("Europe/Berlin")
    ('UTC+08:00', 'UTC-03:30', None, None)
    >>> str(offset_of("CEST")), offset_of("CST")
    ('UTC+02:00', None)
    """
    match = _OFFSET.fullmatch(text)
    if (hours := _NAMES.get(text.upper())) is not None:
        return datetime.timezone(datetime.timedelta(hours=hours))
    if match is None:
        return None
    minutes = int(match[2]) * 60 + int(match[3] or 0)
    if minutes >= 24 * 60 or int(match[3] or 0) >= 60:
        return None
    return datetime.timezone(datetime.timedelta(minutes=minutes if match[1] == "+" else -minutes))


def zone_of(name: str | None) -> datetime.tzinfo | None:
    """The zone that is named, by the argument or by CANID_TIME_ZONE; None: this machine's.

    Raises ConfigError for a name that no zone has.

    >>> zone_of("+08:00"), zone_of("UTC") is datetime.UTC, zone_of("Europe/Berlin")
    (datetime.timezone(datetime.timedelta(seconds=28800)), True, zoneinfo.ZoneInfo(key='Europe/Berlin'))
    """
    name = (os.environ.get(VARIABLE, "") if name is None else name).strip()
    if not name:
        return None
    if name.upper() in ("UTC", "Z", "GMT"):
        return datetime.UTC
    if (offset := offset_of(name)) is not None:
        return offset
    try:
        return zoneinfo.ZoneInfo(name)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        pass
    raise ConfigError(
        f"--time-zone: {name!r} is no time zone: name one as Europe/Berlin, UTC or an offset as +08:00"
    )


@contextlib.contextmanager
def named(name: str) -> Iterator[None]:
    """Read all logs in this zone meanwhile, in child processes too. Raises ConfigError.

    >>> with named("+08:00"):
    ...     zone_of(None)
    datetime.timezone(datetime.timedelta(seconds=28800))
    """
    zone_of(name)
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = name
    try:
        yield
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before


def epoch_ns(local: datetime.datetime, zone: datetime.tzinfo | None) -> int | None:
    """Epoch ns of a local time with whole microseconds; None where it is no time in that zone.

    Args:
        local: without a zone.
        zone: of `zone_of`; None: this machine's.

    >>> epoch_ns(datetime.datetime(2025, 3, 3, 13), zone_of("Asia/Shanghai"))
    1740978000000000000
    """
    try:
        at = local.astimezone() if zone is None else local.replace(tzinfo=zone)
        return (at - _EPOCH) // datetime.timedelta(microseconds=1) * 1000
    except (ValueError, OverflowError, OSError):
        return None
