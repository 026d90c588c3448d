"""Columns of the vehicle's block: pedal, speed and acceleration, and which samples are usable."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.driver.driver_data import braking, filled
from canid.models.diagnosis.fitting.likelihood import Output
from canid.models.diagnosis.masks import extended
from canid.models.diagnosis.sensing.kinematics import SLOPE_SPAN_S, slope
from canid.values.findings import Flags
from canid.values.output_role import output_role
from canid.values.types import Array, Trace

# m/s; below it clutch and converter slip
SLIP_SPEED = 3.0
# s; after the brake its pressure and the engine's overrun have gone, and after any hole the lags have
AFTER_BRAKE_S, LAG_SETTLING_S = 1.0, 1.5
# m of road over which its slope is averaged; crests are hundreds of metres long, satellites' noise is white
SLOPE_AVERAGING_M = 40.0
# m of road between whose ends a slope is taken from the altitude: its noise of 0.4 m becomes 0.4 %
ALTITUDE_BASE_M = 150.0
# s without a speed, after which the road is another one
NEW_ROAD_S = 10.0
# s; a shorter log does not identify a car
MIN_DRIVE_S = 40.0
# m/s² and %; less than sensors' steps: nothing is asked for, or nothing answers
STILL_ACCEL, STILL_PEDAL = 0.01, 0.2
# %; a slope that stands out less from its own noise is none
LEVEL_SLOPE_PERCENT = 0.15


class VehicleSeen(NamedTuple):
    """Columns (n,) of one drive; holes filled."""

    t: Array  # s since the drive's first sample
    pedal: Array  # %
    speed: Array  # m/s
    slope: Array  # mean 0, standard deviation 1; 0 where nobody measures it
    gear: Array


class VehicleData(NamedTuple):
    """Columns (n,) of one drive on its grid."""

    seen: VehicleSeen
    output: Output  # m/s²
    signal: str  # role that the acceleration comes from
    slope_sd: float  # %, of the measured slope; NaN: nobody measures it
    geared: bool  # is the gear known?

    def as_measured(self, accel: Array) -> Array:
        """Pass an acceleration (n,) through the filter that the measured one has passed: none, or the slope of a speed.

        The slope over half a second has zeros at 2.9 and 5 Hz. Taken of the measured speed alone it makes a car late, and
        the noise model divides by next to nothing there. Taken of both it cancels: the noise is what is left between them.
        """
        if self.signal == "accel":
            return accel
        dt = self.output.dt
        # straight between samples, as the pedal is taken to be
        gained = np.cumsum(0.5 * dt * (accel[1:] + accel[:-1]))
        return slope(np.concatenate([[0.0], gained]), dt)


def prepare(trace: Trace, usable: Flags) -> VehicleData | str:
    """Lay out the columns, or return the reason why the vehicle cannot be diagnosed.

    Args:
        trace: of a drive.
        usable: (n,) samples that no mask has taken.
    """
    signals, dt, n = trace.signals, trace.dt, trace.t.size
    if n * dt < MIN_DRIVE_S:
        return f"the log lasts {n * dt:.0f} s"
    if output_role(trace) != "pedal" or "speed" not in signals:
        return "no pedal was recorded, so the demand on the engine is not known: map `pedal`"
    pedal, speed = signals["pedal"], signals["speed"]
    known = np.isfinite(pedal) & np.isfinite(speed) & (speed > SLIP_SPEED)
    own_speed = filled(speed)
    if "accel" in signals and np.isfinite(signals["accel"]).mean() > 0.5:
        measured, signal = signals["accel"], "accel"
        ahead = 0
    else:
        measured, signal = slope(own_speed, dt), "speed"
        # samples after its own that a slope holds
        ahead = max(round(SLOPE_SPAN_S / dt / 2), 1)
    braked = _around(braking(trace), ahead, round(AFTER_BRAKE_S / dt))
    gone = _around(~(known & np.isfinite(measured) & usable), ahead, round(LAG_SETTLING_S / dt))
    fine = ~braked & ~gone
    if not fine.any() or np.std(measured[fine]) < STILL_ACCEL or np.std(pedal[fine]) < STILL_PEDAL:
        return "pedal and speed hardly move"
    road = graded(trace, own_speed)
    gear = signals.get("gear", np.full(n, np.nan))
    geared = bool(np.isfinite(gear[known]).mean() > 0.9) if known.any() else False
    sd = float(np.std(road[known])) if known.any() else 0.0
    standard = (road - np.mean(road[known])) / sd if sd > LEVEL_SLOPE_PERCENT else np.zeros(n)
    seen = VehicleSeen(
        trace.t - trace.t[0] if n else trace.t, filled(pedal), own_speed, standard, filled(gear)
    )
    nowhere = np.zeros(n, dtype=bool)
    output = Output(filled(measured), fine, nowhere, -np.inf, nowhere, np.inf, dt)
    mapped = "grade" in signals or "altitude" in signals
    return VehicleData(seen, output, signal, sd if mapped else float("nan"), geared)


def _around(flags: Flags, before: int, after: int) -> Flags:
    """Extend each stretch of True by samples on both sides."""
    return extended(extended(flags[::-1], before)[::-1], after)


def graded(trace: Trace, speed: Array) -> Array:
    """Return the measured slope of the road, (n,) %; zeros where nobody measures it.

    Example:
        >>> import canid
        >>> trace = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> bool(0.2 < np.std(graded(trace, trace.signals["speed"])) < 2.0)
        True
    """
    known = np.flatnonzero(np.isfinite(trace.signals.get("speed", speed)))
    # drives that were joined, or a log that was interrupted: between them the road is another one
    cuts = known[1:][np.diff(known) * trace.dt > NEW_ROAD_S] if known.size else known
    edges = [0, *cuts.tolist(), speed.size]
    return np.concatenate([_graded(trace, speed, slice(a, b)) for a, b in pairwise(edges)])


def _graded(trace: Trace, whole: Array, here: slice) -> Array:
    """Slope along one road."""
    signals, dt, speed = {role: x[here] for role, x in trace.signals.items()}, trace.dt, whole[here]
    way = np.cumsum(np.maximum(speed, 0.0)) * dt
    if "grade" in signals and np.isfinite(signals["grade"]).any():
        grade = filled(signals["grade"])
        area = np.cumsum(grade * np.maximum(speed, 0.1)) * dt
        return _between(way, area, SLOPE_AVERAGING_M)
    if "altitude" in signals and np.isfinite(signals["altitude"]).any():
        return 100 * _between(way, filled(signals["altitude"]), ALTITUDE_BASE_M)
    return np.zeros(speed.size)


def _between(way: Array, height: Array, over: float) -> Array:
    """Rise per metre between the points half of `over` behind and ahead."""
    away = np.clip(way - over / 2, way[0], way[-1]), np.clip(way + over / 2, way[0], way[-1])
    behind, ahead = (np.interp(x, way, height) for x in away)
    out: Array = (ahead - behind) / np.maximum(away[1] - away[0], over / 4)
    return out
