"""Both gains are others after some moment: another regime (hidden Markov and Gipps regimes)."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Effect, Parameter, Params, Seen, Value


def act(p: Params, seen: Seen) -> Value:
    """Return the factor on both answers: 1 before `time`, 1 − share after it.

    Example:
        >>> act((0.25, 100.0), Seen(np.array([0.0, 200.0]), 600.0, 2.0, -1.0, 60.0, 30.0, 0.0))
        array([1.  , 0.75])
    """
    # within one sample of a fit's grid the factor goes from one to the other: a fit needs a slope in `time`
    return 1.0 - p[0] * np.clip((seen.t - p[1]) / RAMP + 0.5, 0.0, 1.0)


# s; half a second is as sudden as a log at 10 Hz can show
RAMP = 0.5

EFFECT = Effect(
    id="gain_change",
    says="From {time} s on both gains are lower by {share} of what they were.",
    where="driver",
    kind="curve",
    parameters=(
        Parameter("share", "1", -3.0, 0.95, (0.25, -0.25), 0.25),
        Parameter("time", "s", 0.0, 1e6, (), 0.0, moment=True),
    ),
    needs=(),
    source="regimes: Gipps 1981; hidden Markov driver models",
    decides="a longer drive; a change in its middle looks like a drift",
    centred=True,
    gain=act,
    planted=((0.4, 0.3), (-0.5, 0.6)),
)
