"""Date lines of an .asc, as docs/formats/asc.md lists them: languages, clocks, code pages."""

from __future__ import annotations

import datetime
import random
from collections.abc import Callable
from typing import NamedTuple
from zoneinfo import ZoneInfo

EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_MONTHS = {
    "en": "Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec",
    "de": "Jan Feb Mrz Apr Mai Jun Jul Aug Sep Okt Nov Dez",
    "fr": "janv. févr. mars avr. mai juin juil. août sept. oct. nov. déc.",
    "es": "ene feb mar abr may jun jul ago sep oct nov dic",
    "it": "gen feb mar apr mag giu lug ago set ott nov dic",
    "pt": "jan fev mar abr mai jun jul ago set out nov dez",
    "ru": "янв фев мар апр май июн июл авг сен окт ноя дек",
}
_DAYS = {
    "en": "Mon Tue Wed Thu Fri Sat Sun",
    "de": "Mo Di Mi Don Fre Sam Son",
    "fr": "lun. mar. mer. jeu. ven. sam. dim.",
    "es": "lun mar mié jue vie sáb dom",
    "it": "lun mar mer gio ven sab dom",
    "pt": "seg ter qua qui sex sáb dom",
    "ru": "Пн Вт Ср Чт Пт Сб Вс",
    "zh": "周一 周二 周三 周四 周五 周六 周日",
    "ja": "月 火 水 木 金 土 日",
    "ko": "월 화 수 목 금 토 일",
}
_CODE_PAGES = {"de": "cp1252", "fr": "cp1252", "es": "cp1252", "pt": "cp1252", "ru": "cp1251", "zh": "gbk", "ja": "cp932",
               "ko": "cp949"}  # fmt: skip
_HALVES = {"zh": ("上午", "下午"), "ja": ("午前", "午後"), "ko": ("오전", "오후"), "en": ("am", "pm")}


class Date(NamedTuple):
    """A date as it stands in the file."""

    text: bytes
    ns: int | None  # epoch ns that it states; None: it states none
    style: str


def local(rng: random.Random) -> datetime.datetime:
    """A local time in whole ms, away from the night in which clocks are changed."""
    day = datetime.datetime(2001, 1, 1) + datetime.timedelta(days=rng.randrange(12_000))
    return day + datetime.timedelta(milliseconds=rng.randrange(4 * 3_600_000, 24 * 3_600_000))


def epoch_ns(at: datetime.datetime, zone: str) -> int:
    """Epoch ns of a local time."""
    return (at.replace(tzinfo=ZoneInfo(zone)) - EPOCH) // datetime.timedelta(microseconds=1) * 1000


def draw(rng: random.Random, at: datetime.datetime, zone: str) -> Date:
    """Write a local time down in one of the styles."""
    style, make = rng.choice(_STYLES)
    text, stated, encoding = make(rng, at)
    return Date(text.encode(encoding), epoch_ns(stated, zone) if stated else None, style)


_Made = tuple[str, datetime.datetime | None, str]


def _clock(rng: random.Random, at: datetime.datetime, hour: int) -> tuple[str, datetime.datetime]:
    """The time of day up to its fraction, and what it states."""
    how = rng.choice(("ms", "none", "one digit", "comma", "us"))
    whole = at.replace(microsecond=0)
    if how == "none":
        return f"{hour:02}:{at:%M:%S}", whole
    if how == "one digit":
        return f"{hour}:{at.minute}:{at.second}", whole
    if how == "us":
        return f"{hour:02}:{at:%M:%S}.{at.microsecond:06}", at
    return f"{hour:02}:{at:%M:%S}{',' if how == 'comma' else '.'}{at.microsecond // 1000:03}", at


def _western(rng: random.Random, at: datetime.datetime) -> _Made:
    language = rng.choice(sorted(_MONTHS))
    month, day = _MONTHS[language].split()[at.month - 1], _DAYS[language].split()[at.weekday()]
    clock, stated = _clock(rng, at, at.hour)
    encoding = rng.choice(("utf-8", _CODE_PAGES.get(language, "utf-8")))
    return f"{day} {month} {at.day} {clock} {at.year}", stated, encoding


def _halves(rng: random.Random, at: datetime.datetime) -> _Made:
    """Twelve hours, the marker behind the time, with a blank or glued."""
    clock, stated = _clock(rng, at, at.hour % 12 or 12)
    half = rng.choice(("am pm", "AM PM", "a.m. p.m.")).split()[at.hour >= 12]
    blank = rng.choice((" ", ""))
    month, day = _MONTHS["en"].split()[at.month - 1], _DAYS["en"].split()[at.weekday()]
    if rng.random() < 0.3:
        return f"{at.day} {month} {at.year} {clock}{blank}{half}", stated, "ascii"
    return f"{day} {month} {at.day} {clock}{blank}{half} {at.year}", stated, "ascii"


def _eastern(rng: random.Random, at: datetime.datetime) -> _Made:
    language = rng.choice(("zh", "ja", "ko"))
    day = _DAYS[language].split()[at.weekday()]
    month = {
        "zh": f"{at.month}月",
        "ja": rng.choice((f"{at.month}月", f"{at.month}")),
        "ko": f"{at.month}월",
    }[language]
    encoding = rng.choice(("utf-8", _CODE_PAGES[language]))
    if rng.random() < 0.5:
        clock, stated = _clock(rng, at, at.hour)
        return f"{day} {month} {at.day} {clock} {at.year}", stated, encoding
    clock, stated = _clock(rng, at, at.hour % 12 or 12)
    half = _HALVES[language][at.hour >= 12]
    if rng.random() < 0.3:
        year, of_day = {"zh": ("年", "日"), "ja": ("年", "日"), "ko": ("년 ", "일")}[language]
        mark = "월 " if language == "ko" else "月"
        return f"{at.year}{year}{at.month}{mark}{at.day}{of_day} {half} {clock}", stated, encoding
    return f"{day} {month} {at.day} {clock} {half} {at.year}", stated, encoding


def _numbers(rng: random.Random, at: datetime.datetime) -> _Made:
    clock, stated = _clock(rng, at, at.hour)
    form = rng.choice(("%Y-%m-%d {}", "%Y-%m-%dT{}", "%d.%m.%Y {}", "%Y/%m/%d {}"))
    return at.strftime(form).format(clock), stated, "ascii"


def _unknown(rng: random.Random, at: datetime.datetime) -> _Made:
    """What states no start: an unknown language, an order that nobody can know, no date at all."""
    if rng.random() < 0.3 and at.day <= 12 and at.day != at.month:
        return f"{at.day}/{at.month}/{at.year} {at:%H:%M:%S}", None, "ascii"
    text = rng.choice(
        ("Xyz Qqq 3 10:00:00.000 2025", "quinta-feira, dois", "unknown", "Mon Mar 3 25:00:00.000 2025")
    )
    return text, None, "ascii"


_STYLES: tuple[tuple[str, Callable[[random.Random, datetime.datetime], _Made]], ...] = (
    ("date: western", _western),
    ("date: western", _western),
    ("date: am and pm", _halves),
    ("date: zh, ja, ko", _eastern),
    ("date: numbers", _numbers),
    ("date: not stated", _unknown),
)
