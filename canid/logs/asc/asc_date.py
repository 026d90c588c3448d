"""The date line of an .asc: local time, in the language of the Windows that Vector's tool ran on."""

from __future__ import annotations

import contextlib
import datetime
import re

# The first three letters of the months, lower case, without accents: English, German, French,
# Spanish, Italian, Portuguese, Dutch, Swedish. Four letters where three are ambiguous (juin, juillet).
_MONTHS = {
    name: number
    for number, names in enumerate(
        (
            "jan ene gen janv",
            "feb fev fevr",
            "mar mrz maa mars",
            "apr avr abr avri",
            "may mai mag mei maj",
            "jun giu juin",
            "jul lug juil",
            "aug aou ago aout",
            "sep set sept",
            "oct okt ott out",
            "nov",
            "dec dez dic",
        ),
        1,
    )
    for name in names.split()
}
_ACCENTS = str.maketrans("äáàâéèêëíîóôöúûüç", "aaaaeeeeiiooouuuc")
_CLOCK_TIME = re.compile(r"(\d{1,2}):(\d\d):(\d\d)(?:[.,](\d+))?")
_NUMERIC = re.compile(r"\b(\d{1,2})\.(\d{1,2})\.(\d{4})\b")
_YEAR = re.compile(r"\b((?:19|20)\d\d)\b")
_DAY = re.compile(r"\b(\d{1,2})\b")
_AFTERNOON = re.compile(r"\b(pm|p\.m\.|nachm)")
_MORNING = re.compile(r"\b(am|a\.m\.|vorm)")


def local_ns(text: str) -> int | None:
    """Epoch ns of a date line, read in this machine's time zone; None where it cannot be read.

    >>> at = local_ns("Thu Aug 2 15:34:47.250 2018")
    >>> local_ns("Don Aug 2 03:34:47.250 pm 2018") == at == local_ns("jeu. août 2 15:34:47,250 2018")
    True
    >>> local_ns("quinta-feira, dois") is None
    True
    """
    # lines come byte by byte, and this one may hold letters of more than one byte
    with contextlib.suppress(UnicodeEncodeError, UnicodeDecodeError):
        text = text.encode("latin-1").decode("utf-8")
    text = text.lower().translate(_ACCENTS)
    clock = _CLOCK_TIME.search(text)
    if clock is None:
        return None
    hour, minute, second = (int(word) for word in clock.groups()[:3])
    if _AFTERNOON.search(text):
        hour = hour % 12 + 12
    elif _MORNING.search(text):
        hour %= 12
    fraction = clock[4] or "0"
    # up to three digits are milliseconds, and python-can leaves out their leading zeros
    micro = int(fraction) * 1000 if len(fraction) <= 3 else int(fraction[:6].ljust(6, "0"))
    date = _date(text[: clock.start()] + " " + text[clock.end() :])
    if date is None:
        return None
    try:
        at = datetime.datetime(*date, hour, minute, second, micro).astimezone()
    except (ValueError, OverflowError, OSError):
        return None
    epoch = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
    return (at - epoch) // datetime.timedelta(microseconds=1) * 1000


def _date(text: str) -> tuple[int, int, int] | None:
    if numeric := _NUMERIC.search(text):
        day, month, year = numeric.groups()
        return int(year), int(month), int(day)
    year_word, day_word = _YEAR.search(text), _DAY.search(text)
    # the weekday may look like a month ("mar." is Tuesday in French): the last word that fits is the month
    months = [
        number
        for word in re.findall(r"[a-z]+", text)
        if (number := _MONTHS.get(word[:4]) or _MONTHS.get(word[:3]))
    ]
    if not (year_word and day_word and months):
        return None
    return int(year_word[1]), months[-1], int(day_word[1])
