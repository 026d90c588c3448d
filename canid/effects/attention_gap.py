"""The driver looks away and holds the pedal (Boer 2001)."""

from __future__ import annotations

from canid.effects.cause import Effect, Parameter, Params


def init(p: Params, first: float) -> float:
    """Begin with the first demand."""
    return first


def hold(state: float, demand: float, *, away: bool) -> tuple[float, float]:
    """Return the pedal: held while he looks away.

    Example:
        >>> hold(10.0, 14.0, away=True), hold(10.0, 14.0, away=False)
        ((10.0, 10.0), (14.0, 14.0))
    """
    y = state if away else demand
    return y, y


EFFECT = Effect(
    id="attention_gap",
    says="The driver holds the pedal for {duration} s at a time, {per_minute} times per minute: he looks away.",
    where="driver",
    kind="episodes",
    parameters=(
        Parameter("per_minute", "1/min", 0.0, 20.0, (), 1.0),
        Parameter("duration", "s", 1.0, 10.0, (), 3.0),
    ),
    needs=(),
    source="Boer 2001; glances off the road: Klauer et al. 2006",
    decides="10 min of following behind a lead whose speed changes",
    planted=((1.0, 3.0), (1.5, 4.0)),
)
