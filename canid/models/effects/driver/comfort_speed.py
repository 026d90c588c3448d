"""A comfortable speed above which the driver releases the pedal, whatever the lead does (v0 of the IDM)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import DriveFeatures, Effect, Kind, Parameter, Params, Seen, Share, Value


def act(p: Params, seen: Seen) -> Value:
    """Return −k·max(v − v_c, 0), %.

    Example:
        >>> float(act((2.0, 30.0), Seen(0.0, 600.0, 2.0, -1.0, 60.0, 33.0, 0.0)))
        -6.0
    """
    return -p[0] * np.maximum(seen.speed - p[1], 0.0)


def among_speeds(drive: DriveFeatures) -> tuple[float, ...]:
    """Quantiles of the driven speed, m/s."""
    return tuple(float(x) for x in np.quantile(drive.speed, (0.3, 0.5, 0.7, 0.85)))


EFFECT = Effect(
    id="comfort_speed",
    says="Above {speed} m/s the driver asks for {gain} % less per m/s, whatever the lead does.",
    where="driver",
    kind=Kind.PARAMETRIC,
    # gain from 0 on: nobody presses the pedal more because the car is already fast
    parameters=(
        Parameter("gain", "%/(m/s)", 0.0, 15.0, (1.0,), 1.5),
        Parameter("speed", "m/s", 2.0, 60.0, among_speeds, 0.0, share_of=Share.TOP_SPEED),
    ),
    needs=("speed",),
    source="Treiber, Hennecke & Helbing 2000 (IDM: v0)",
    decides="10 min of following below and above the speed in question",
    wanted_gap=True,
    extra=act,
    found_at=((3.0, 0.7), (5.0, 0.6)),
    silent_at=((0.05, 0.7),),
)
