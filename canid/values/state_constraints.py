"""Constraints on the numbers of a saved state, as metadata of their annotations (PEP 593).

A state that is restored from a file is refused where it breaks one of them (models/saving/validity.py):

    class Noise(NamedTuple):
        power: Annotated[float, POSITIVE]
        recent: Annotated[float, NOT_NEGATIVE]
"""

from __future__ import annotations

from enum import Enum


class Constraint(Enum):
    """What every number of a field fulfils, in arrays, tuples and nested states as well."""

    FINITE = "finite"
    NOT_NEGATIVE = "not negative"  # NaN passes
    POSITIVE = "positive"
    TIME = "no later than the last sample"  # s; NaN passes: it has not happened


FINITE = Constraint.FINITE
NOT_NEGATIVE = Constraint.NOT_NEGATIVE
POSITIVE = Constraint.POSITIVE
TIME = Constraint.TIME
