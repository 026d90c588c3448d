"""Lines of styled text of a bounded width: what the terminal view is drawn with.

A style is some of the words bold, dim, reverse, red, green, yellow, cyan, magenta. Text of any origin is escaped here.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

from canid.values.terminal_text import terminal_text

# characters of one column, which nearly all are: Latin, Greek, Cyrillic, arrows, mathematics, blocks, braille. Combining
# marks among them count as one: that only shortens a line
_NARROW = re.compile(r"[\x20-\u02ff\u0370-\u10ff\u2010-\u2319\u2500-\u25fc\u2717\u275a\u2800-\u28ff]*")


# characters of a sentence that are shown: a mark has 200
MAX_WRAPPED = 600


class Span(NamedTuple):
    """Text in one style."""

    text: str
    style: str = ""


Line = tuple[Span, ...]


def cells(text: str) -> int:
    """Columns that a text takes on a terminal.

    Example:
        >>> cells("τ 0.4"), cells("前車"), cells("é")
        (5, 4, 1)
    """
    return len(text) if _NARROW.fullmatch(text) else sum(map(_cell, text))


@lru_cache(4096)
def _cell(character: str) -> int:
    if _NARROW.fullmatch(character):
        return 1
    if unicodedata.category(character) in ("Mn", "Me"):
        return 0
    return 2 if unicodedata.east_asian_width(character) in ("W", "F") else 1


def width(line: Line) -> int:
    """Columns of a line."""
    return sum(cells(span.text) for span in line)


def cut(text: str, columns: int) -> str:
    """The beginning of a text that takes at most so many columns."""
    if cells(text) <= columns:
        return text
    taken = 0
    for at, character in enumerate(text):
        taken += _cell(character)
        if taken > columns:
            return text[:at]
    return text


def shortened(text: str, columns: int) -> str:
    """A name of at most so many columns: of a longer one its beginning and its end, which holds its number and suffix.

    Example:
        >>> shortened("drive.blf", 12), shortened("a_drive_on_the_motorway_007.blf", 16)
        ('drive.blf', 'a_drive…_007.blf')
    """
    text = terminal_text(text)
    if cells(text) <= columns:
        return text
    tail = cut(text[::-1], max(columns // 2, 1))[::-1]
    return cut(text, max(columns - cells(tail) - 1, 0)) + "…" + tail


def fitted(line: Line, columns: int, *, fill: bool = False) -> Line:
    """The line in at most so many columns, escaped; `fill`: padded to that in the style of its last span."""
    out: list[Span] = []
    left = columns
    for text, style in line:
        shown = cut(terminal_text(text), left)
        left -= cells(shown)
        out.append(Span(shown, style))
    if fill and out and left > 0:
        out.append(Span(" " * left, out[-1].style))
    return tuple(out)


def wrapped(text: str, style: str, columns: int, first: str = "", indent: str = "  ") -> list[Line]:
    """A sentence in lines of at most so many columns, broken between words; continued lines are indented.

    Example:
        >>> [line[0].text for line in wrapped("drive with varying speed", "", 14)]
        ['drive with', '  varying', '  speed']
    """
    columns = max(columns, 1)  # a window can have fewer than the picture: even then it must end
    lines: list[str] = []
    now = first
    # drawn ten times a second: a text may be without end, such as a name in a file
    for word in terminal_text(text[:MAX_WRAPPED]).split(" "):
        longer = now + word if now in (first, indent) else f"{now} {word}"
        if cells(longer) <= columns or now == indent == "":
            now = longer
        else:
            if now.strip():
                lines.append(now)
                now = indent
            now += word
        while cells(now) > columns:  # a word that is longer than a line
            start = cut(now, columns) or now[:1]
            lines.append(start)
            now = indent + now[len(start) :] if len(indent) < columns // 2 else now[len(start) :]
    if now.strip():
        lines.append(now)
    return [(Span(line, style),) for line in lines]


def packed(items: Iterable[Line], columns: int, indent: int = 2, gap: int = 2) -> list[Line]:
    """Items side by side, on as many lines as they need; an item that is longer than a line is cut.

    Example:
        >>> two = packed([(Span("K 4.41 [3.58, 5.21]"),), (Span("τ 0.42 s"),)], 24)
        >>> ["".join(span.text for span in line) for line in two]
        ['K 4.41 [3.58, 5.21]', '  τ 0.42 s']
    """
    lines: list[Line] = []
    now: Line = ()
    for item in items:
        if not item:
            continue
        escaped = tuple(Span(terminal_text(text), style) for text, style in item)
        longer = (*now, Span(" " * gap), *escaped) if now else escaped
        if now and width(longer) > columns:
            lines.append(now)
            longer = (Span(" " * indent), *escaped)
        now = longer
    return [fitted(line, columns) for line in (*lines, now) if line]
