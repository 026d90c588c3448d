"""Cruise control drives and the pedal is released: there is no driver to be identified (openpilot: `cruiseState`)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, MaskInput, Params
from canid.values.findings import Flags
from canid.values.runs import runs
from canid.values.types import Array

# %; one step of an 8-bit pedal sensor: at or below it the pedal may be released
RELEASED_PERCENT = 0.5
# s; without a signal of the bus, the pedal must be released for so long: longer than a coast between two answers
MIN_RELEASE_S = 5.0
# s; engine and torque converter push for some 1.5 s after the pedal is released
OVERRUN_S = 1.5
# m/s gained over 1 s with the pedal released: only something else pushes the car like this; a road that falls by 6 %
# gives 0.6 less 0.2 of rolling and drag
MIN_PUSH = 0.5


def recognise(drive: MaskInput) -> Flags:
    """Where cruise control drives, (n,): by its signal, or without one where the car accelerates by itself.

    Example:
        >>> signals = {"pedal": np.zeros(4), "cruise_active": np.array([0.0, 1.0, 1.0, np.nan])}
        >>> recognise(MaskInput(np.arange(4) * 0.1, 0.1, signals, np.zeros(4), True))
        array([False,  True,  True, False])
    """
    n, signals = drive.t.size, drive.signals
    out = np.zeros(n, dtype=bool)
    if not drive.person:
        # the output is the controller's own, or the car's: the vehicle file says whose
        return out
    if "cruise_active" in signals:
        active: Flags = np.nan_to_num(signals["cruise_active"]) > 0.5
        return active
    pedal, speed = signals.get("pedal"), signals.get("speed")
    if pedal is None or speed is None:
        return out
    second = max(round(1.0 / drive.dt), 1)
    for first, stop in runs(pedal <= RELEASED_PERCENT):
        if (stop - first) * drive.dt < MIN_RELEASE_S:
            continue
        speed_released = speed[first + round(OVERRUN_S / drive.dt) : stop]
        if (
            speed_released.size > second
            and np.nanmax(speed_released[second:] - speed_released[:-second], initial=-np.inf) > MIN_PUSH
        ):
            out[first:stop] = True
    return out


def imitate(columns: dict[str, Array], at: slice, p: Params) -> None:
    """Release the pedal while the controller is active."""
    columns["pedal"][at] = 0.0
    columns["cruise_active"][at] = 1.0


EFFECT = Effect(
    id="cruise_control",
    says="Cruise control is driving.",
    where="driver",
    kind=Kind.MASK,
    parameters=(),
    needs=("pedal",),
    source="openpilot: cruiseState, and its lagd waits 2 s after a person takes over; a public RAV4 log is 51 of 60 s of it",
    mask=recognise,
    recovery=2.0,  # s, as openpilot's lagd
    imitate=imitate,
    found_at=((20.0,),),
)
