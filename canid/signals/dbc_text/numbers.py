"""Numbers of a DBC as people and tools write them: .5, 1E-007, decimal commas."""

from __future__ import annotations

import math
import re

_NUMBER = r"[-+]?(?:\d{1,40}\.?\d{0,40}|\.\d{1,40})(?:[eE][-+]?\d{1,4})?"
_WHOLE = re.compile(_NUMBER)
# as the format's own grammar has them
_PLAIN = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_COMMA = re.compile(r"[-+]?\d{1,40},\d{1,40}(?:[eE][-+]?\d{1,4})?")


def number(text: str) -> float | None:
    """A number; None where the text is none, or has a decimal comma.

    Example:
        >>> number(".5"), number("1E-007"), number("5."), number("0,5"), number("km")
        (0.5, 1e-07, 5.0, None, None)
    """
    return _finite(float(text)) if _WHOLE.fullmatch(text) else None


def with_comma(text: str) -> float | None:
    """A number with a decimal point or a decimal comma."""
    return _finite(float(text.replace(",", "."))) if _COMMA.fullmatch(text) else number(text)


def _finite(value: float) -> float | None:
    """None for a number that no float holds, as 1e999."""
    return value if math.isfinite(value) else None


def is_plain(text: str) -> bool:
    """Whether the format's own grammar has such a number."""
    return _PLAIN.fullmatch(text) is not None


def pair(text: str) -> tuple[float, float] | None:
    """Factor and offset, from what stands between the parentheses; None where it has several meanings, or none.

    A factor of 0 makes every value the same: where a decimal comma divides "0,1,0", only "0,1" and "0" is meant.

    Example:
        >>> pair("0.1, -40"), pair("0,1,0"), pair("0,25,-40,5"), pair("0,1;2"), pair("1,5,0")
        ((0.1, -40.0), (0.1, 0.0), (0.25, -40.5), (0.1, 2.0), None)
    """
    parts = [part.strip() for part in text.split(";")]
    if len(parts) == 2:
        return _both(with_comma(parts[0]), with_comma(parts[1]))
    parts = [part.strip() for part in text.split(",")]
    if len(parts) == 2:
        return _both(number(parts[0]), number(parts[1]))
    if len(parts) == 4:
        return _both(with_comma(f"{parts[0]},{parts[1]}"), with_comma(f"{parts[2]},{parts[3]}"))
    if len(parts) != 3:
        return None
    readings = (
        _both(with_comma(f"{parts[0]},{parts[1]}"), number(parts[2])),
        _both(number(parts[0]), with_comma(f"{parts[1]},{parts[2]}")),
    )
    possible = [reading for reading in readings if reading is not None and reading[0] != 0.0]
    return possible[0] if len(possible) == 1 else None


def _both(first: float | None, second: float | None) -> tuple[float, float] | None:
    return None if first is None or second is None else (first, second)
