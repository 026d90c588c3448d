"""Response to the lead's acceleration: brake lights, anticipation (Kesting & Treiber 2008)."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Screening, Seen, Value


def act(p: Params, seen: Seen) -> Value:
    """Return K3·(lead acceleration), %.

    Example:
        >>> act((4.0,), Seen(0.0, 600.0, 2.0, -1.0, 60.0, 33.0, -1.5))
        -6.0
    """
    return p[0] * seen.lead_accel


EFFECT = Effect(
    id="lead_acceleration",
    says="The driver also responds to the lead's acceleration, with {gain} output units per m/s².",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("gain", "output/(m/s²)", -30.0, 30.0, (1.0, -1.0), 2.0),),
    needs=("range_rate", "speed"),
    source="Kesting & Treiber 2008; GM models with lead acceleration",
    absorbed="a shorter dead time and a larger K2 do nearly the same below 0.3 Hz",
    decides="a lead that brakes and accelerates briskly, for 30 min",
    screening=Screening.NONE,  # along its direction nothing is left of what a dead time has taken up
    shortens_dead_time=True,
    extra=act,
    found_at=((6.0,), (10.0,)),
    silent_at=((0.1,),),
)
