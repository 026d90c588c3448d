"""What a log shows of a candidate: does it move, in which range, and does it agree with the roles found before."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from canid.analysis.proposal.log_columns import LogColumns, column
from canid.analysis.proposal.name_score import Candidate
from canid.analysis.proposal.signal_agreement import (
    AGREES,
    AGREES_WEAKLY,
    CONTRADICTS,
    MIN_ROWS,
    STILL,
    Judged,
    References,
    correlation,
    in_role_unit,
    moves,
    smooth,
)
from canid.analysis.proposal.signal_words import dbc_unit
from canid.analysis.proposal.switch_evidence import brake, cruise, lead_valid, steering_assist
from canid.signals.vehicle.units import factor_to
from canid.values.roles import ROLES
from canid.values.types import Array

# m/s: a gap that changes faster is another vehicle's
MAX_GAP_RATE = 15.0
# m/s below which wheels and speeds are compared with their quantisation
_MIN_SPEED = 3.0
# speedometers show 1 to 10 % more than the car drives (UN R39 allows 10 % + 4 km/h), tyres vary by 1.5 %
_SPEEDOMETER = (1.017, 1.13)
_SAME = 0.017
# m/s; a speed that is shown comes in steps of a tenth of a km/h or more, one that is measured in finer ones
_DISPLAY_STEP = 0.1 / 3.6
# in the role's unit: what nine tenths of a drive's values do not exceed in any car
_LARGEST = {"speed": 90.0, "accel": 15.0, "steering_angle": 900.0, "lateral_offset": 10.0, "yaw_rate": 3.0}
# numbers that a drive in which the speed changes moves; where they stand still, a car of this kind does not send them
_DEAD_WHERE_STILL = (
    "accel",
    "accel_command",
    "engine_speed",
    "steering_angle",
    "yaw_rate",
    "grade",
    "altitude",
    "gnss_speed",
    "wheel_speed",
    "lat",
    "lon",
    "east",
    "north",
)
# units of speeds that DBC files leave out, as factors to m/s
_SPEED_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704}


# bits of a pedal's converter; what is wider has bits that nothing fills
_PEDAL_BITS = 12
# share by which readings may leave the range that the DBC states: by a step or two
_BEYOND = 1.05


class Seen(NamedTuple):
    """A candidate in the log."""

    candidate: Candidate  # with unit, scale, bus as the log shows them
    points: float
    remarks: tuple[str, ...]
    values: Array  # on the raster, in the role's unit
    low: float = math.nan
    high: float = math.nan
    rate: float = 0.0  # readings in a second


def seen(candidate: Candidate, bus: int, columns: LogColumns, known: References) -> Seen | None:
    """Compare a candidate with the log; None where no frame carries it."""
    state = ROLES[candidate.role].kind == "state"
    decoded = column(candidate.message, candidate.signal, bus, columns, texts_are_values=state)
    if decoded is None:
        return None
    raw = decoded[1]
    if not np.isfinite(raw).any():
        return None
    points, remarks, made = _judged(candidate._replace(bus=bus), raw, known)
    values = in_role_unit(made, raw)
    finite = values[np.isfinite(values)]
    most = _LARGEST.get(candidate.role)
    if most is not None and made.unit and len(finite) and float(np.percentile(np.abs(finite), 90)) > most:
        points, remarks = CONTRADICTS, [*remarks, "larger than it can be: is the DBC that of this car?"]
    low, high = (float(np.min(finite)), float(np.max(finite))) if len(finite) else (math.nan, math.nan)
    rate = columns.time.rate_of(decoded[0].t)
    if candidate.role in _DEAD_WHERE_STILL and known.accel is not None and low == high:
        points, remarks = CONTRADICTS, ["constant in the log, in which the speed changes: nobody sends it"]
    return Seen(made, points, tuple(remarks), values, low, high, rate if rate == rate else 0.0)


def _judged(candidate: Candidate, raw: Array, known: References) -> Judged:
    """How well the readings are those of the role."""
    role = candidate.role
    if role in _SWITCHES:
        return _SWITCHES[role](candidate, raw, known)
    if not moves(raw):
        points = 2 * STILL if role == "speed" else STILL if ROLES[role].kind == "number" else 0.0
        return points, ["constant in the log"], candidate
    judge = _JUDGES.get(role)
    return (AGREES_WEAKLY, [], candidate) if judge is None else judge(candidate, raw, known)


def _speed(candidate: Candidate, raw: Array, known: References) -> Judged:
    if known.wheels is None:
        return AGREES_WEAKLY, [], candidate
    if known.wheels_are == candidate.where:
        return AGREES_WEAKLY, ["another message has the same speed"], candidate
    fast = (
        np.isfinite(raw)
        & np.isfinite(known.wheels)
        & (known.wheels > (_MIN_SPEED if known.wheels_unit else 0.0))
    )
    r, _, n = correlation(raw[fast], known.wheels[fast])
    if n < MIN_ROWS:
        return 0.0, [], candidate
    if not math.isfinite(r):
        r = 1.0 if np.ptp(raw[fast]) == np.ptp(known.wheels[fast]) == 0 else 0.0
    ratio = float(np.median(raw[fast] / known.wheels[fast]))
    # a constant speed says little in the correlation: its ratio is compared alone
    steady = float(np.std(known.wheels[fast])) < 0.02 * float(np.mean(known.wheels[fast]))
    if r < 0.97 and not steady:
        return CONTRADICTS, [f"does not follow {known.wheels_are} (r = {r:.2f})"], candidate
    if not known.wheels_unit:
        return AGREES, [f"follows {known.wheels_are} (r = {r:.3f})"], candidate
    if candidate.unit:
        share = ratio * (factor_to(candidate.unit, "m/s") or 1.0)
    else:
        unit = min(_SPEED_UNITS, key=lambda name: abs(math.log(max(ratio, 1e-9) * _SPEED_UNITS[name])))
        share = ratio * _SPEED_UNITS[unit]
        if not 0.9 < share < 1.15:
            return 0.0, [f"{ratio:.3g} times {known.wheels_are} in m/s: no usual unit"], candidate
        candidate = candidate._replace(
            unit=unit, remarks=(f"no unit in the DBC; {unit} by {known.wheels_are}",)
        )
    if abs(share - 1.0) < _SAME:
        return AGREES, [f"{share:.3f} of {known.wheels_are}"], candidate
    step = abs(candidate.signal.scale) * (factor_to(candidate.unit, "m/s") or 1.0)
    if _SPEEDOMETER[0] <= share <= _SPEEDOMETER[1] and step >= _DISPLAY_STEP:
        return -AGREES, [f"{share:.3f} of {known.wheels_are}, as a speedometer shows"], candidate
    if 0.9 < share < 1.15:
        return 0.0, [f"{share:.3f} of {known.wheels_are}"], candidate
    return CONTRADICTS, [f"{share:.3g} of {known.wheels_are}: its unit is wrong"], candidate


def _accel(candidate: Candidate, raw: Array, known: References) -> Judged:
    if known.accel is None:
        return 0.0, [], candidate
    r, _, _ = correlation(known.accel, smooth(raw))
    if not math.isfinite(r):
        return 0.0, [], candidate
    if r <= -0.6:
        return (
            AGREES,
            [f"falls when the speed grows (r = {r:.2f})"],
            candidate._replace(
                scale=-candidate.scale, remarks=(*candidate.remarks, "sign by the change of speed")
            ),
        )
    if r >= 0.6:
        return AGREES, [f"follows the change of speed (r = {r:.2f})"], candidate
    if r < 0.2 and float(np.nanstd(known.accel)) > 0.3:
        return CONTRADICTS / 2, [f"does not follow the change of speed (r = {r:.2f})"], candidate
    return 0.0, [f"r = {r:.2f} with the change of speed"], candidate


def _pedal(candidate: Candidate, raw: Array, known: References) -> Judged:
    remarks, points = [], 0.0
    if known.accel is not None:
        best = 0.0
        for lag in range(1, 12, 2):  # 0.1 to 1.1 s from pedal to acceleration
            moved = np.r_[np.full(lag, np.nan), raw[:-lag]]
            r, _, _ = correlation(known.accel, moved)
            best = max(best, r, key=lambda x: abs(x) if math.isfinite(x) else 0.0)
        remarks.append(f"r = {best:.2f} with the acceleration")
        points += (
            AGREES if best > 0.4 else AGREES_WEAKLY if best > 0.1 else CONTRADICTS / 2 if best < -0.2 else 0.0
        )
    if np.nanmin(raw) < -2.0 * abs(candidate.signal.scale):
        points += STILL
        remarks.append("is negative at times")
    # a range that the readings leave is none
    beyond = candidate.signal.maximum is not None and np.nanmax(raw) > _BEYOND * candidate.signal.maximum
    if not dbc_unit(candidate.signal.unit) and np.nanmax(raw) > 0.0 and (beyond or not candidate.unit):
        candidate = _by_bits(candidate, float(np.nanmax(raw)))
    share = in_role_unit(candidate, raw)
    if candidate.unit and np.nanmax(share) > 130.0:
        points += CONTRADICTS / 2
    return points, remarks, candidate


def _by_bits(candidate: Candidate, highest: float) -> Candidate:
    """A pedal of raw numbers: its bits are taken as full travel, of a wide signal those that the log fills."""
    step = abs(candidate.signal.scale)
    filled = math.ceil(math.log2(highest / step + 1.0))
    top = step * (2.0 ** (candidate.signal.length if candidate.signal.length <= _PEDAL_BITS else filled) - 1)
    says = f"no unit in the DBC; {top:g} is taken as 100 %: check the scale"
    return candidate._replace(unit="%", scale=float(f"{100.0 / top:.4g}"), remarks=(says,))


def _range_rate(candidate: Candidate, raw: Array, known: References) -> Judged:
    if known.gap_rate is None:
        return 0.0, [], candidate
    near = np.where(np.abs(known.gap_rate) < MAX_GAP_RATE, known.gap_rate, np.nan)
    r, gain, _ = correlation(near, smooth(raw))
    if not math.isfinite(r):
        return 0.0, [], candidate
    factor = factor_to(candidate.unit, "m/s") if candidate.unit else None
    if abs(r) > 0.75:
        if factor is None:
            unit = min(_SPEED_UNITS, key=lambda name: abs(math.log(abs(gain) / _SPEED_UNITS[name])))
            if not 0.8 < abs(gain) / _SPEED_UNITS[unit] < 1.25:
                return (
                    AGREES_WEAKLY,
                    [f"r = {r:.2f} with the change of the gap; its unit stays unknown"],
                    candidate,
                )
            candidate = candidate._replace(unit=unit, remarks=(f"no unit in the DBC; {unit} by the gap",))
        if r < 0:
            candidate = candidate._replace(
                scale=-candidate.scale,
                remarks=(*candidate.remarks, "closing speed: sign by the change of the gap"),
            )
        return AGREES, [f"r = {r:.2f} with the change of the gap"], candidate
    return 0.0, [f"r = {r:.2f} with the change of the gap"], candidate


def _yaw(candidate: Candidate, raw: Array, known: References) -> Judged:
    if known.steering is None or known.speed is None:
        return AGREES_WEAKLY, [], candidate
    r, _, _ = correlation(raw, known.steering * known.speed)
    if not math.isfinite(r) or float(np.nanstd(known.steering)) < 1.0:
        return 0.0, [], candidate
    points = AGREES if abs(r) > 0.6 else STILL if abs(r) < 0.2 else 0.0
    return points, [f"r = {r:.2f} with speed times steering angle"], candidate


_Judge = Callable[[Candidate, Array, References], Judged]
_SWITCHES: Mapping[str, _Judge] = {
    "brake": brake,
    "cruise_active": cruise,
    "steering_assist": steering_assist,
    "lead_valid": lead_valid,
}
# of signals that move
_JUDGES: Mapping[str, _Judge] = {
    "speed": _speed,
    "accel": _accel,
    "pedal": _pedal,
    "range_rate": _range_rate,
    "yaw_rate": _yaw,
}
