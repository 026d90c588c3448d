"""What a method says of a drive, canid's or another: the common noun of the table."""

from __future__ import annotations

from typing import NamedTuple

# what an answer may say; "unexplained" and "not_enough_data" only canid can
ADEQUATE, NAMED, UNEXPLAINED, BROKE = "adequate", "named", "unexplained", "broke"


class Answer(NamedTuple):
    """What one method said of one drive."""

    sets: tuple[tuple[str, ...], ...]  # one per cause, strongest first: the name and then its rivals
    says: str
    seconds: float  # of CPU
    why: str = ""  # why it broke
