"""Scale error of the range rate: a wrong factor in the DBC, or a wrong unit."""

from __future__ import annotations

from collections.abc import Mapping

from canid.models.effects.effect import Effect, Kind, Parameter, Params, SensorValues
from canid.models.effects.redundancy import WHICH_IS_WRONG, Coefficient, Pattern, Redundancy, Relation, excess
from canid.values.types import Array, Interval


def sense(p: Params, true: SensorValues) -> SensorValues:
    """Return what is measured.

    Example:
        >>> sense((0.1,), SensorValues(0.0, 600.0, 30.0, -2.0, 20.0, 0.0)).range_rate
        -2.2
    """
    return true._replace(range_rate=true.range_rate * (1 + p[0]))


def recognise(coefficient: Coefficient) -> Pattern | None:
    """A scale is what the ratio's size leaves unexplained, whatever its sign."""
    if coefficient.sure.high >= 0:
        same = excess(Relation.RANGE_RATE, 1.0)(coefficient)
        return same and same._replace(own=coefficient.estimate.value)
    turned = excess(Relation.RANGE_RATE, -1.0)(coefficient)
    if turned is None:
        return None
    (share,) = turned.parameters
    share = Interval(-share.value, -share.high, -share.low)
    return Pattern(turned.deviation, (share,), -coefficient.estimate.value)


def correct(p: Params, signals: Mapping[str, Array]) -> dict[str, Array]:
    """Divide by the scale."""
    return {"range_rate": signals["range_rate"] / (1 + p[0])}


EFFECT = Effect(
    id="range_rate_scale",
    says="The range rate is too large by a share of {share}, compared with the gap's rate of change (below 0: too small).",
    where="sensing",
    kind=Kind.REDUNDANCY,
    parameters=(Parameter("share", "1", -0.95, 5.0, (), 0.05),),
    needs=("gap", "range_rate"),
    source="the gap's change is the integral of the range rate, whoever drives",
    absorbed="the gain K2 takes it up",
    decides=WHICH_IS_WRONG,
    sense=sense,
    redundancy=Redundancy(Relation.RANGE_RATE, recognise),
    correct=correct,
    findings=("range_rate_scale", "gap_contradicts_range_rate"),
    found_at=((0.1,), (-0.12,)),
    silent_at=((0.005,),),
)
