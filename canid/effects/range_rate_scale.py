"""The range rate is wrong by a fixed share: a wrong factor in the DBC, or km/h taken for another unit."""

from __future__ import annotations

from canid.effects.cause import Effect, Parameter, Params, Sensed


def sense(p: Params, true: Sensed) -> Sensed:
    """Return what is measured.

    Example:
        >>> sense((0.1,), Sensed(0.0, 600.0, 30.0, -2.0, 20.0, 0.0)).range_rate
        -2.2
    """
    return true._replace(range_rate=true.range_rate * (1 + p[0]))


EFFECT = Effect(
    id="range_rate_scale",
    says="The range rate is {share} too large as a share of what the gap's change says (below 0: too small).",
    where="sensing",
    kind="redundancy",
    parameters=(Parameter("share", "1", -0.95, 5.0, (), 0.05),),
    needs=("gap", "range_rate"),
    source="the gap's change over seconds is the range rate's integral, whoever drives",
    absorbed="the gain K2 takes it up",
    decides="gap and range rate of one radar, while the gap changes",
    sense=sense,
)
