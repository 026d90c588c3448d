"""A controller drives and the foot is off the pedal: no human is there to be identified (openpilot: `cruiseState`)."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Drive, Effect
from canid.effects.runs import runs
from canid.findings import Flags

# %; one step of an 8-bit pedal sensor: at or below it the foot may be off
OFF = 0.5
# s; where no bus signal says so, the foot must be off this long: longer than a coast between two answers
LONG = 5.0
# s; an engine's and a torque converter's push outlast the foot by some 1.5 s
OUTLAST = 1.5
# m/s² that a car without foot on the pedal gains over 1 s only where something else presses it: a road that falls
# by 6 % gives 0.6 less 0.2 of rolling and drag
PUSHED = 0.5


def recognise(drive: Drive) -> Flags:
    """Where a controller drives, (n,): as the bus says, or where it does not, as a car shows that speeds up by itself.

    Example:
        >>> signals = {"pedal": np.zeros(4), "cruise_active": np.array([0.0, 1.0, 1.0, np.nan])}
        >>> recognise(Drive(np.arange(4) * 0.1, 0.1, signals, np.zeros(4), True))
        array([False,  True,  True, False])
    """
    n, signals = drive.t.size, drive.signals
    out = np.zeros(n, dtype=bool)
    if not drive.person:
        return (
            out  # the output is the controller's own, or the car's: who drives is the vehicle file's matter
        )
    if "cruise_active" in signals:
        active: Flags = np.nan_to_num(signals["cruise_active"]) > 0.5
        return active
    pedal, speed = signals.get("pedal"), signals.get("speed")
    if pedal is None or speed is None:
        return out
    second = max(round(1.0 / drive.dt), 1)
    for first, stop in runs(pedal <= OFF):
        if (stop - first) * drive.dt < LONG:
            continue
        own = speed[first + round(OUTLAST / drive.dt) : stop]
        if own.size > second and np.nanmax(own[second:] - own[:-second], initial=-np.inf) > PUSHED:
            out[first:stop] = True
    return out


EFFECT = Effect(
    id="cruise_control",
    says="Cruise control drives.",
    where="driver",
    kind="mask",
    parameters=(),
    needs=("pedal",),
    source="data/rav4: 51 of 60 s; openpilot's lagd waits 2 s after a person takes over",
    mask=recognise,
    recovery=2.0,
)
