"""Gear change: the pedal is released for the clutch, not for the traffic."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, MaskInput, Params
from canid.values.findings import Flags
from canid.values.runs import runs
from canid.values.types import Array

# %; one step of an 8-bit pedal sensor: at or below it the pedal may be released
RELEASED_PERCENT = 0.5
# s; duration of a gear change in manual gearboxes: 0.4 to 1 s, and the sensor's lag
MIN_SHIFT_S, MAX_SHIFT_S = 0.25, 1.5
# s in which the pedal is released, and pressed again
RELEASE_S, PRESS_S = 0.4, 0.7
# %, depth of the dip: several times the pedal's noise within half a second
MIN_DEPTH_PERCENT = 5.0
# share of its level before by which the pedal's level after may differ
MAX_DIFFERENCE = 0.4
# s between the release of the pedal and the gearbox's report of the new gear
REPORT_DELAY_S = 1.0
# relative change of the engine's revolutions per metre: more than this from gear to gear (the smallest steps of car
# gearboxes are 1.2), while tyre slip and rounding stay below
MIN_RATIO_STEP = 0.1


def recognise(drive: MaskInput) -> Flags:
    """Where the pedal is released for a change of gear, (n,).

    By the clutch, where it is measured. Otherwise the pedal must fall to 0 and come back to its level within the time
    that a gear change takes, and the gear or the ratio of engine speed to road speed must change with it; where neither
    is measured the dip alone decides, and must be deeper.

    Example:
        >>> pedal = np.r_[np.full(20, 15.0), 7.0, np.zeros(6), 8.0, np.full(20, 15.0)]
        >>> signals = {"pedal": pedal, "gear": np.r_[np.full(24, 3.0), np.full(24, 4.0)]}
        >>> flags = recognise(MaskInput(np.arange(48) * 0.1, 0.1, signals, np.zeros(48), True))
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
    for first, stop in runs(pedal <= RELEASED_PERCENT):
        if not MIN_SHIFT_S <= (stop - first) * dt <= MAX_SHIFT_S:
            continue
        fall, rise = round(RELEASE_S / dt), round(PRESS_S / dt)
        before = pedal[max(first - fall - round(0.3 / dt), 0) : first]
        after = pedal[stop : stop + rise + round(0.3 / dt)]
        if min(before.size, after.size) < 3:
            continue
        high, back = float(np.nanmax(before)), float(np.nanmax(after))
        deep = MIN_DEPTH_PERCENT if changed is not None else 1.6 * MIN_DEPTH_PERCENT
        if not (min(high, back) >= deep and abs(back - high) <= MAX_DIFFERENCE * high):
            continue
        near = round(REPORT_DELAY_S / dt)
        if changed is not None and not changed[max(first - near, 0) : stop + near].any():
            continue
        # the edges belong to it as well: from the last sample at its height before, to the first one after
        left = first - int(np.argmax(before[::-1] >= (1 - MAX_DIFFERENCE / 2) * high))
        right = stop + int(np.argmax(after >= (1 - MAX_DIFFERENCE / 2) * back))
        out[left:right] = True
    return out


def _pressed(clutch: Flags, pedal: Array, dt: float) -> Flags:
    """The clutch's stretches, with the pedal's fall before and its rise after."""
    out = np.zeros_like(clutch)
    fall, rise = round(RELEASE_S / dt), round(PRESS_S / dt)
    for first, stop in runs(clutch):
        left, right = first, stop
        # the pedal is released before the clutch closes its switch
        while left > max(first - fall, 0) and pedal[left - 1] < pedal[max(left - 2, 0)] - RELEASED_PERCENT:
            left -= 1
        while right < min(stop + rise, pedal.size - 1) and pedal[right] > pedal[right - 1] + RELEASED_PERCENT:
            right += 1
        out[left:right] = True
    return out


def _changed(drive: MaskInput) -> Flags | None:
    """Where the gear has changed, (n,); None where it is not measured."""
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
    k = max(round(REPORT_DELAY_S / drive.dt), 1)
    out[k:-k] = np.abs(ratio[2 * k :] / ratio[: -2 * k] - 1.0) > MIN_RATIO_STEP
    return out


def imitate(columns: dict[str, Array], at: slice, p: Params) -> None:
    """Release the pedal and press the clutch."""
    columns["pedal"][at] = 0.0
    columns["clutch"][at] = 1.0


EFFECT = Effect(
    id="gear_shift",
    says="The driver releases the pedal to change gear.",
    where="driver",
    kind=Kind.MASK,
    parameters=(),
    needs=("pedal",),
    source="manual gearboxes: dips of the pedal of 0.4 to 1 s",
    mask=recognise,
    recovery=0.5,  # s; the pedal returns to the demand
    imitate=imitate,
    found_at=((0.8,),),
)
