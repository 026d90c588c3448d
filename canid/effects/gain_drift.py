"""Both gains change steadily: fatigue (Pilutti & Ulsoy 1999; Chen & Ulsoy 2001 cut two hours into 120 parts for it)."""

from __future__ import annotations

from canid.effects.cause import Effect, Parameter, Params, Seen, Value


def act(p: Params, seen: Seen) -> Value:
    """Return the factor on both answers: 1 in the middle of the drive.

    Example:
        >>> float(act((0.4,), Seen(600.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0)))
        1.2
    """
    return 1.0 + p[0] * (seen.t / seen.drive - 0.5)


EFFECT = Effect(
    id="gain_drift",
    says="Both gains change steadily, by {rate} of their mean over the drive.",
    where="driver",
    kind="curve",
    parameters=(Parameter("rate", "1", -1.9, 1.9, (0.3, -0.3), 0.3),),
    needs=(),
    source="Pilutti & Ulsoy 1999; Chen & Ulsoy 2001",
    decides="a longer drive; a change away from its middle is not a drift",
    centred=True,
    gain=act,
    planted=((-0.6,), (0.6,)),
)
