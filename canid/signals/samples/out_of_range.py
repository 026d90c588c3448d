"""Readings that are left out because they are out of their signal's range: of each second a few different ones are kept."""

from __future__ import annotations

from typing import NamedTuple

# different readings of one block: with five it is a scale, with two codes for "no value"
MAX_KEPT = 8


class OutOfRange(NamedTuple):
    """A reading that is left out because it is out of its signal's range."""

    role: str
    t: float  # s
    value: float  # in the role's unit


def added(kept: tuple[OutOfRange, ...], came: OutOfRange) -> tuple[OutOfRange, ...]:
    """The different readings so far, with one more: `MAX_KEPT` at most, the highest among them.

    Example:
        >>> kept: tuple[OutOfRange, ...] = ()
        >>> for k in range(100):
        ...     kept = added(kept, OutOfRange("pedal", 0.0, 110.0 + k // 2))
        >>> len(kept), kept[-1].value
        (8, 159.0)
    """
    if any(each.value == came.value and each.role == came.role for each in kept):
        return kept
    if len(kept) < MAX_KEPT:
        return (*kept, came)
    return (*kept[:-1], came) if came.value > max(each.value for each in kept) else kept
