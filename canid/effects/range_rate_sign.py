"""The range rate has the other sign: some radars call closing positive."""

from __future__ import annotations

from canid.effects.cause import Effect, Params, Sensed


def sense(p: Params, true: Sensed) -> Sensed:
    """Return what is measured.

    Example:
        >>> sense((), Sensed(0.0, 600.0, 30.0, -2.0, 20.0, 0.0)).range_rate
        2.0
    """
    return true._replace(range_rate=-true.range_rate)


EFFECT = Effect(
    id="range_rate_sign",
    says="The range rate has the wrong sign: the gap closes where it says opening (scale = -1 in the vehicle file).",
    where="sensing",
    kind="redundancy",
    parameters=(),
    needs=("gap", "range_rate"),
    source="radars differ in what they call positive; Grover's own text defines V_F - V_L and reports K2 > 0",
    decides="gap and range rate of one radar, while the gap changes",
    sense=sense,
)
