"""Wrong sign of the range rate: some radars call closing positive."""

from __future__ import annotations

from collections.abc import Mapping

from canid.models.effects.effect import Effect, Kind, Params, SensorValues
from canid.models.effects.redundancy import Coefficient, Pattern, Redundancy, Relation
from canid.values.types import Array


def sense(p: Params, true: SensorValues) -> SensorValues:
    """Return what is measured.

    Example:
        >>> sense((), SensorValues(0.0, 600.0, 30.0, -2.0, 20.0, 0.0)).range_rate
        2.0
    """
    return true._replace(range_rate=-true.range_rate)


def recognise(coefficient: Coefficient) -> Pattern | None:
    """The ratio is surely negative."""
    return Pattern(coefficient.sure.value) if coefficient.sure.high < 0 else None


def correct(p: Params, signals: Mapping[str, Array]) -> dict[str, Array]:
    """Turn the sign."""
    return {"range_rate": -signals["range_rate"]}


EFFECT = Effect(
    id="range_rate_sign",
    says="The range rate has the wrong sign: it says opening while the gap closes (scale = -1 in the vehicle file).",
    where="sensing",
    kind=Kind.REDUNDANCY,
    parameters=(),
    needs=("gap", "range_rate"),
    source="radars differ in what they call positive; Grover's own text defines V_F - V_L and reports K2 > 0",
    decides="gap and range rate of one radar, while the gap changes",
    sense=sense,
    redundancy=Redundancy(Relation.RANGE_RATE, recognise),
    correct=correct,
    findings=("range_rate_sign", "range_rate_scale", "gap_contradicts_range_rate"),
    found_at=((),),
)
