"""Step change of both gains at one time: another regime (Gipps 1981; hidden Markov driver models)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import DriveFeatures, Effect, Kind, Parameter, Params, Seen, Share, Value
from canid.models.effects.operating_point import GAINS


def act(p: Params, seen: Seen) -> Value:
    """Return the factor on both answers: 1 before `time`, 1 − share after it.

    Example:
        >>> act((0.25, 100.0), Seen(np.array([0.0, 200.0]), 600.0, 2.0, -1.0, 60.0, 30.0, 0.0))
        array([1.  , 0.75])
    """
    # a ramp of some samples instead of a step: a fit needs a derivative with respect to `time`
    return 1.0 - p[0] * np.clip((seen.t - p[1]) / RAMP_S + 0.5, 0.0, 1.0)


# s; half a second is as sudden as a log at 10 Hz can show
RAMP_S = 0.5


def along(drive: DriveFeatures) -> tuple[float, ...]:
    """Times along the drive, s."""
    return tuple(float(x) for x in np.linspace(0.1, 0.9, 9) * drive.duration)


EFFECT = Effect(
    id="gain_change",
    says="From {time} s on, both gains are lower by a share of {share} (below 0: higher).",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(
        Parameter("share", "1", -3.0, 0.95, (0.25, -0.25), 0.25),
        Parameter("time", "s", 0.0, 1e6, along, 0.0, change_point=True, share_of=Share.DURATION),
    ),
    needs=(),
    source="regimes: Gipps 1981; hidden Markov driver models",
    decides="a longer drive; a change in its middle is similar to a drift",
    shows_desired_headway=True,
    timeless=GAINS,
    gain=act,
    found_at=((0.4, 0.3), (-0.5, 0.6)),
    silent_at=((0.02, 0.4),),
)
