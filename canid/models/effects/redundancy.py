"""Redundant measurements: relations between signals that measure the same thing, and what a broken one means."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

from canid.values.types import NAN, Interval


class Relation(Enum):
    """Two measurements of one quantity. The member's value is the name of the check in the report."""

    RANGE_RATE = "range rate against gap"  # coefficient: range rate over the gap's change, 1
    SPEED = "speed against satellites"  # coefficient: speed over speed by GNSS, 1
    RADAR_AGE = (
        "age of the radar's reports"  # coefficient: s by which own motion shows late in the range rate, 0
    )
    RADAR_AGE_DRIFT = "drift of their age"  # coefficient: s by which that age changes over the drive, 0


# What sensors are sold with, and no cause: a Doppler radar's speed is good to 1 %, a wheel's radius changes by 0.5 %
# with load and temperature, a report of a 20 Hz radar is 25 ms old on average
TOLERANCE = {
    Relation.RANGE_RATE: 0.02,
    Relation.SPEED: 0.005,
    Relation.RADAR_AGE: 0.03,
    Relation.RADAR_AGE_DRIFT: 0.05,
}

# what decides between a gap and a range rate of the wrong scale
WHICH_IS_WRONG = (
    "20 min in which the own speed changes by itself, or a second range sensor: that shows whether gap or range rate "
    "is wrong"
)


class Coefficient(NamedTuple):
    """Estimate of a relation's coefficient."""

    estimate: Interval  # 95 %
    sure: Interval  # that which chance leaves with a probability of one in thousands, all tests together
    # 99 % interval of the factor, −1 apart, with which the own motion enters the second signal; NaN: not known
    own: Interval = Interval()


class Pattern(NamedTuple):
    """What a coefficient means for an effect."""

    deviation: float  # of the coefficient from where it would be without the effect
    parameters: tuple[Interval, ...] = ()  # of the effect
    # the factor of the own motion that it would leave: of effects that mean the same coefficient, the one whose factor is
    # found is the cause; NaN: there is no such effect
    own: float = NAN


class Redundancy(NamedTuple):
    """How an effect shows in a relation."""

    # in none: nothing else measures the same
    relation: Relation | None
    # what the coefficient means; None: not this effect
    recognise: Callable[[Coefficient], Pattern | None] | None = None


def shifted(iv: Interval, by: float) -> Interval:
    """Shift an interval.

    Example:
        >>> shifted(Interval(1.5, 1.25, 1.75), -1.0)
        Interval(value=0.5, low=0.25, high=0.75)
    """
    return Interval(iv.value + by, iv.low + by, iv.high + by)


def excess(relation: Relation, nominal: float) -> Callable[[Coefficient], Pattern | None]:
    """Make a test: is the coefficient surely further from its nominal value than sensors are sold with?

    Example:
        >>> coefficient = Coefficient(Interval(1.1, 1.09, 1.11), Interval(1.1, 1.08, 1.12))
        >>> excess(Relation.RANGE_RATE, 1.0)(coefficient).parameters[0].low.__round__(2)
        0.09
    """
    tolerance = TOLERANCE[relation]

    def recognise(coefficient: Coefficient) -> Pattern | None:
        sure = coefficient.sure
        if not (sure.low > nominal + tolerance or sure.high < nominal - tolerance):
            return None
        return Pattern(sure.value - nominal, (shifted(coefficient.estimate, -nominal),))

    return recognise
