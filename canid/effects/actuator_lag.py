"""Something between pedal and engine is late as well: a second lag."""

from __future__ import annotations

from canid.effects.cause import Car, CarSeen, Effect, Parameter, Params, Value


def lag(p: Params, seen: CarSeen) -> Value:
    """Return the further lag, s.

    Example:
        >>> lag((0.2,), None)
        0.2
    """
    return p[0]


EFFECT = Effect(
    id="actuator_lag",
    says="A second lag of {tau} s lies between pedal and pull.",
    where="vehicle",
    kind="curve",
    parameters=(Parameter("tau", "s", 0.0, 3.0, (0.2,), 0.2),),
    needs=("pedal",),
    source="throttle actuator, gearbox, driveline",
    rivals=("turbo_lag",),  # a charger that no load on the drive spins up is late throughout
    absorbed="of two lags in series the fit has both, but not which is whose: only what no car has is blamed",
    decides="quick steps of the pedal, from low and from high load",
    car=Car(lag=lag),
    planted=((0.4,), (0.6,)),
)
