"""The foot leaves the pedal for a moment to change gear: the clutch asks for it, not the traffic."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Drive, Effect
from canid.effects.runs import runs
from canid.findings import Flags
from canid.types import Array

# %; one step of an 8-bit pedal sensor: at or below it the foot may be off
OFF = 0.5
# s; a change of gear takes so long (manual gearboxes; reference range .4 to 1 s, with the lag of the sensor's foot)
SHORTEST, LONGEST = 0.25, 1.5
# s in which the foot leaves the pedal, and comes back
FALL, RISE = 0.4, 0.7
# % that the pedal loses and gets back: several times what a foot errs by within half a second
DEEP = 5.0
# the pedal comes back to where it was within so much of itself
SAME = 0.4
# s between the foot's leaving and the gearbox's report of the new gear
NEAR = 1.0
# of its usual value: the engine's revolutions per metre change by more than this from gear to gear (smallest steps of
# car gearboxes 1.2), while tyre slip and rounding stay below
STEP = 0.1


def recognise(drive: Drive) -> Flags:
    """Where the foot is off the pedal for a change of gear, (n,).

    The clutch says it, where it is measured. Else the pedal must fall to 0 and come back to where it was, all within
    the time that a change of gear takes, and the gear or the ratio of engine speed to road speed must change with it;
    where neither is measured the shape alone decides, and must be clearer.

    Example:
        >>> pedal = np.r_[np.full(20, 15.0), 7.0, np.zeros(6), 8.0, np.full(20, 15.0)]
        >>> signals = {"pedal": pedal, "gear": np.r_[np.full(24, 3.0), np.full(24, 4.0)]}
        >>> flags = recognise(Drive(np.arange(48) * 0.1, 0.1, signals, np.zeros(48), True))
        >>> int(np.argmax(flags)), int(flags.sum())
        (20, 8)
    """
    n, dt, signals = drive.t.size, drive.dt, drive.signals
    out = np.zeros(n, dtype=bool)
    if "pedal" not in signals or not drive.person:
        return out
    if "clutch" in signals:
        return _pressed(np.nan_to_num(signals["clutch"]) > 0.5, signals["pedal"], dt)
    pedal = signals["pedal"]
    changed = _changed(drive)
    for first, stop in runs(pedal <= OFF):
        if not SHORTEST <= (stop - first) * dt <= LONGEST:
            continue
        fall, rise = round(FALL / dt), round(RISE / dt)
        before = pedal[max(first - fall - round(0.3 / dt), 0) : first]
        after = pedal[stop : stop + rise + round(0.3 / dt)]
        if min(before.size, after.size) < 3:
            continue
        high, back = float(np.nanmax(before)), float(np.nanmax(after))
        deep = DEEP if changed is not None else 1.6 * DEEP
        if not (min(high, back) >= deep and abs(back - high) <= SAME * high):
            continue
        near = round(NEAR / dt)
        if changed is not None and not changed[max(first - near, 0) : stop + near].any():
            continue
        # the edges belong to it as well: from the last sample at its height before, to the first one after
        left = first - int(np.argmax(before[::-1] >= (1 - SAME / 2) * high))
        right = stop + int(np.argmax(after >= (1 - SAME / 2) * back))
        out[left:right] = True
    return out


def _pressed(clutch: Flags, pedal: Array, dt: float) -> Flags:
    """The clutch's stretches, with the foot's way down before and up after."""
    out = np.zeros_like(clutch)
    fall, rise = round(FALL / dt), round(RISE / dt)
    for first, stop in runs(clutch):
        left, right = first, stop
        # the foot begins to leave before the clutch closes its switch
        while left > max(first - fall, 0) and pedal[left - 1] < pedal[max(left - 2, 0)] - OFF:
            left -= 1
        while right < min(stop + rise, pedal.size - 1) and pedal[right] > pedal[right - 1] + OFF:
            right += 1
        out[left:right] = True
    return out


def _changed(drive: Drive) -> Flags | None:
    """Where another gear is in, (n,); None where nobody measures it."""
    signals = drive.signals
    out = np.zeros(drive.t.size, dtype=bool)
    if "gear" in signals and np.isfinite(signals["gear"]).any():
        out[1:] = np.abs(np.diff(np.nan_to_num(signals["gear"]))) > 0.5
        return out
    if not {"engine_speed", "speed"} <= signals.keys():
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(signals["speed"] > 2.0, signals["engine_speed"] / signals["speed"], np.nan)
    # engaged before and after: the ratio stands still on both sides of the step
    k = max(round(NEAR / drive.dt), 1)
    out[k:-k] = np.abs(ratio[2 * k :] / ratio[: -2 * k] - 1.0) > STEP
    return out


EFFECT = Effect(
    id="gear_shift",
    says="The foot leaves the pedal to change gear.",
    where="driver",
    kind="mask",
    parameters=(),
    needs=("pedal",),
    source="manual gearboxes; pulses of .4 to 1 s",
    mask=recognise,
    recovery=0.5,  # s; the pedal goes back to where the answer wants it
)
