"""What a check of the signals is: a state and a step over blocks, and a verdict that stands or does not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from canid.signals.signal_checks.blocks import Block


class Found(NamedTuple):
    """What a check says now."""

    name: str  # of the fault
    roles: tuple[str, ...]  # that may be wrong
    since: float  # s, since when
    says: str  # what, with numbers and their uncertainty
    remedy: str  # what to do
    delays_only: bool = False  # gains hold nevertheless


class Check(NamedTuple):
    """One check of the signals."""

    name: str
    init: Callable[[], Any]
    # state, block -> state, and what stands now; None: nothing does
    step: Callable[[Any, Block], tuple[Any, Found | None]]


# a factor between two units that are confused -> which
UNIT_FACTORS = {
    3.6: "km/h declared as m/s",
    2.23694: "mph declared as m/s",
    1.60934: "km/h declared as mph",
    3.28084: "feet declared as metres",
    1.94384: "kn declared as m/s",
    1.852: "km/h declared as kn",
    1 / 3.6: "m/s declared as km/h",
    1 / 2.23694: "m/s declared as mph",
    1 / 1.60934: "mph declared as km/h",
    1 / 3.28084: "metres declared as feet",
    1 / 1.94384: "m/s declared as kn",
    1 / 1.852: "kn declared as km/h",
}
# share by which a ratio may miss the factor of two units and still be called that: wheels and radars are good to 5 %
UNIT_TOLERANCE = 0.08


def unit_of(ratio: float, low: float = float("nan"), high: float = float("nan")) -> str:
    """Name the confusion of units that a ratio means; "": none.

    Args:
        ratio: measured over right.
        low: lower end of its interval; a factor inside the interval counts as well.
        high: its upper end.

    Example:
        >>> unit_of(3.55), unit_of(1.3), unit_of(2.0, 1.7, 2.4)
        ('km/h declared as m/s', '', 'mph declared as m/s')
    """
    near = [
        ("kn" in says.split(), abs(ratio / factor - 1.0), says)  # GNSS receivers alone give knots
        for factor, says in UNIT_FACTORS.items()
        if abs(ratio / factor - 1.0) < UNIT_TOLERANCE or low <= factor <= high
    ]
    return min(near)[2] if near else ""
