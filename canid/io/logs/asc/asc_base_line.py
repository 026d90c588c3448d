"""The base line of an .asc: in which base numbers are written, and whether times count from the start or the last line."""

from __future__ import annotations

import re
from typing import NamedTuple

_BASES = {"hex": 16, "hexadecimal": 16, "dec": 10, "decimal": 10}
_TIMES = {"absolute": False, "relative": True}
_BEGINS = re.compile(r"\W{0,8}base(?![^\W_])", re.IGNORECASE)
_WORD = re.compile(r"[a-z]{1,16}", re.IGNORECASE)


class BaseLine(NamedTuple):
    """What a base line says."""

    base: int  # 16 or 10
    relative: bool


def parse(text: str) -> BaseLine | None:
    """Take a line for what it says, whatever other words it has and in whichever order; None where it is no base line.

    Raises ValueError for one that cannot be read: with another base all numbers would be others.

    >>> parse("base dec  timestamps absolute no internal events logged")
    BaseLine(base=10, relative=False)
    >>> parse("timestamps = relative, base = HEX"), parse("internal events logged")
    (BaseLine(base=16, relative=True), None)
    """
    if text.startswith(("//", ";")):
        return None
    words = [word.lower() for word in _WORD.findall(text)]
    bases = {_BASES[word] for word in words if word in _BASES}
    times = {_TIMES[word] for word in words if word in _TIMES}
    timed = "timestamps" in words or "timestamp" in words
    if not _BEGINS.match(text) and not ("base" in words and bases) and not (timed and (times or bases)):
        return None
    if len(bases) != 1:
        raise ValueError("it says neither hex nor dec" if not bases else "it says both hex and dec")
    if len(times) > 1 or (timed and not times):
        raise ValueError("it does not say whether times are absolute or relative")
    return BaseLine(bases.pop(), bool(times) and times.pop())
