"""The date line of an .asc: local time, in the words of the Windows that Vector's tool ran on.

A date is read only where every word of it is known, but for the weekday in its first place: a word that is not known
might be the half of the day or the month, and a wrong start is worse than none.
"""

from __future__ import annotations

import contextlib
import datetime
import re
import unicodedata

from canid.io.logs import local_time
from canid.io.logs.asc.asc_date_words import AFTERNOON, EMPTY_WORDS, MONTHS, MORNING

# code pages of Windows that a line may be in which is not UTF-8: western, Central European, Cyrillic, Turkish,
# Chinese, Japanese, Korean, Chinese of Taiwan
_CODE_PAGES = ("cp1252", "cp1250", "cp1251", "cp1254", "gbk", "cp932", "cp949", "big5")
_CLOCK_TIME = re.compile(r"(?<!\d)(\d{1,2}):(\d{1,2}):(\d{1,2})(?:[.,:](\d{1,9}))?(?!\d)")
_OFFSET = re.compile(r"\s?(z|[+-]\d\d:?\d\d)(?![\w:])")
_YEAR_FIRST = re.compile(
    r"(?<!\d)((?:19|20)\d\d)\s?[-/.年년]\s?(\d{1,2})\s?[-/.月월]\s?(\d{1,2})(?!\d)\.?\s?[日일]?"
)
_YEAR_LAST = re.compile(r"(?<!\d)(\d{1,2})\s?([-/.])\s?(\d{1,2})\s?\2\s?((?:19|20)\d\d)(?!\d)")
_YEAR = re.compile(r"(?<![\d.,])((?:19|20)\d\d)(?!\d)\s?[年년]?")
_MONTH_MARK = re.compile(r"(?<!\d)(\d{1,2})\s?[月월](?!\w)")
_DAY = re.compile(r"(?<!\d)(\d{1,2})(?:st|nd|rd|th|er|[日일]|º|\.)?(?!\w)")
# weekdays of languages whose month is a number: it precedes the day
_MONTH_FIRST = re.compile(r"^(?:周|星期|週|[月火水木金土日](?!\w)|[월화수목금토일](?!\w)|\w曜)")
_WORD = re.compile(r"[^\W\d_]+")
# half of the day with points between its letters
_POINTED = re.compile(r"(?<![^\W\d_])([ap])\s?\.\s?m\b\.?")


def local_ns(text: str, zone: datetime.tzinfo | None = None) -> int | None:
    """Epoch ns of a date line; None where it cannot be read.

    Args:
        text: what follows "date", its bytes as Latin-1.
        zone: of local times; None: this machine's.

    >>> at = local_ns("Thu Aug 2 15:34:47.250 2018")
    >>> local_ns("Don Aug 2 03:34:47.250 pm 2018") == at == local_ns("jeu. août 2 15:34:47,250 2018")
    True
    >>> local_ns("2 Aug 2018 3:34:47pm", datetime.UTC), local_ns("quinta-feira, dois") is None
    (1533224087000000000, True)
    """
    dates = {parsed for decoded in _decoded(text) if (parsed := _parsed(decoded)) is not None}
    if len(dates) != 1:
        return None
    at, fraction_ns, offset = dates.pop()
    ns = local_time.epoch_ns(at, zone if offset is None else offset)
    return None if ns is None else ns + fraction_ns


def _decoded(text: str) -> list[str]:
    """What the line may say: in UTF-8 where it is that, else in each code page that has its bytes."""
    octets = text.encode("latin-1", "replace")
    with contextlib.suppress(UnicodeDecodeError):
        return [octets.decode("utf-8")]
    out = []
    for name in _CODE_PAGES:
        with contextlib.suppress(UnicodeDecodeError):
            out.append(octets.decode(name))
    return out


_Parsed = tuple[datetime.datetime, int, datetime.timezone | None]


def _plain(text: str) -> str:
    """Lower case, without the accents of western letters."""
    return "".join(
        unicodedata.normalize("NFD", c)[0] if "À" <= c <= "ɏ" else c
        for c in unicodedata.normalize("NFC", text.lower())
    ).replace("ı", "i")


def _parsed(text: str) -> _Parsed | None:
    """Local time in whole seconds, the ns of its fraction, and the offset to UTC where it states one."""
    text = _POINTED.sub(r" \1m ", _plain(text).replace("\xa0", " ").replace("\u202f", " "))
    clock = _CLOCK_TIME.search(text)
    if clock is None:
        return None
    before, behind = text[: clock.start()], text[clock.end() :]
    offset = None
    if stated := _OFFSET.match(behind):
        offset, behind = local_time.offset_of(stated[1]), behind[stated.end() :]
        if offset is None:
            return None
    # a "T" between the date and the time
    before = re.sub(r"(?<=\d)t$", " ", before)
    date = _date(f"{before} {behind}")
    if date is None:
        return None
    (year, month, day), rest = date
    words = _WORD.findall(rest)
    halves = {w in AFTERNOON for w in words if w in AFTERNOON or w in MORNING}
    # the first word may be any weekday; others are known
    first = _WORD.match(rest.lstrip(" ,."))
    unknown = [w for w in words if w not in AFTERNOON | MORNING | EMPTY_WORDS]
    if unknown and first and unknown[0] == first[0] and before.lstrip(" ,.").startswith(first[0]):
        unknown = unknown[1:]
    hour = _hour(int(clock[1]), halves)
    if hour is None or unknown or re.search(r"\d", rest):
        return None
    with contextlib.suppress(ValueError):
        return (
            datetime.datetime(year, month, day, hour, int(clock[2]), int(clock[3])),
            _fraction(clock[4]),
            offset,
        )
    return None


def _hour(hour: int, halves: set[bool]) -> int | None:
    """The hour of 24; None where the half of the day contradicts it."""
    if not halves:
        return hour
    if len(halves) > 1 or (hour > 12 and halves == {False}):
        return None
    return hour if hour > 12 else hour % 12 + 12 * halves.pop()


def _fraction(digits: str | None) -> int:
    """Ns of a fraction; up to three digits are milliseconds, and python-can leaves out their leading zeros."""
    if not digits:
        return 0
    return int(digits) * 1_000_000 if len(digits) <= 3 else int(digits.ljust(9, "0"))


def _date(text: str) -> tuple[tuple[int, int, int], str] | None:
    """Year, month and day, and the text without them."""
    if match := _YEAR_FIRST.search(text):
        return (int(match[1]), int(match[2]), int(match[3])), _without(text, match)
    if match := _YEAR_LAST.search(text):
        day, month = int(match[1]), int(match[3])
        # with points the day is first, else nobody knows which, but for a number that is no month
        if match[2] != "." and month > 12:
            day, month = month, day
        elif match[2] != "." and day <= 12 and day != month:
            return None
        return (int(match[4]), month, day), _without(text, match)
    if not (year := _YEAR.search(text)):
        return None
    rest = _without(text, year)
    if mark := _MONTH_MARK.search(rest):
        month, rest = int(mark[1]), _without(rest, mark)
    elif named := _named_month(rest):
        month, rest = named
    elif _MONTH_FIRST.match(rest.strip()) and (number := re.search(r"(?<!\d)\d{1,2}(?!\d)", rest)):
        month, rest = int(number[0]), _without(rest, number)
    else:
        return None
    day_found = _DAY.search(rest)
    return ((int(year[1]), month, int(day_found[1])), _without(rest, day_found)) if day_found else None


def _named_month(text: str) -> tuple[int, str] | None:
    """The month by its name, and the text without it."""
    # the weekday may look like a month ("mar." is Tuesday in French): the last word that fits is the month
    for word in reversed(list(_WORD.finditer(text))):
        if word[0] in AFTERNOON | MORNING | EMPTY_WORDS:
            continue
        if number := MONTHS.get(word[0]) or MONTHS.get(word[0][:4]) or MONTHS.get(word[0][:3]):
            return number, _without(text, word)
    return None


def _without(text: str, match: re.Match[str]) -> str:
    return f"{text[: match.start()]} {text[match.end() :]}"
