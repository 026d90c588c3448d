"""Scale error of the gap: a wrong factor in the DBC, or a wrong unit."""

from __future__ import annotations

from collections.abc import Mapping

from canid.models.effects.effect import Effect, Kind, Parameter, Params, SensorValues
from canid.models.effects.redundancy import WHICH_IS_WRONG, Coefficient, Pattern, Redundancy, Relation, excess
from canid.values.types import Array, Interval


def sense(p: Params, true: SensorValues) -> SensorValues:
    """Return what is measured.

    Example:
        >>> sense((0.1,), SensorValues(0.0, 600.0, 30.0, -2.0, 20.0, 0.0)).gap
        33.0
    """
    return true._replace(gap=true.gap * (1 + p[0]))


def recognise(coefficient: Coefficient) -> Pattern | None:
    """The same ratio as that of a wrong range rate, turned over; the own motion in the range rate is then as it must be."""
    turned = coefficient.sure.high < 0
    ratio = excess(Relation.RANGE_RATE, -1.0 if turned else 1.0)(coefficient)
    if ratio is None:
        return None
    low, high = sorted((abs(coefficient.estimate.low), abs(coefficient.estimate.high)))
    share = Interval(*(1 / max(x, 1e-3) - 1 for x in (abs(coefficient.estimate.value), high, low)))
    return Pattern(ratio.deviation, (share,), 1.0)


def correct(p: Params, signals: Mapping[str, Array]) -> dict[str, Array]:
    """Divide by the scale."""
    return {"gap": signals["gap"] / (1 + p[0])}


EFFECT = Effect(
    id="range_scale",
    says="The gap is too large by a share of {share}, compared with the integral of the range rate (below 0: too small).",
    where="sensing",
    kind=Kind.REDUNDANCY,
    parameters=(Parameter("share", "1", -0.95, 5.0, (), 0.05),),
    needs=("gap", "range_rate", "speed"),
    source="the gap's change is the integral of the range rate, and the own motion enters the range rate with factor -1",
    absorbed="the gain K1 takes it up",
    decides=WHICH_IS_WRONG,
    sense=sense,
    redundancy=Redundancy(Relation.RANGE_RATE, recognise),
    correct=correct,
    findings=("range_rate_scale", "gap_contradicts_range_rate"),
    found_at=((0.1,), (-0.12,)),
    silent_at=((0.005,),),
)
