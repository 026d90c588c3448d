"""What a log shows of a candidate: does it move, in which range, and does it agree with the roles found before."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.proposal.log_columns import STEP_S, LogColumns, column
from canid.proposal.name_score import Candidate
from canid.types import Array
from canid.vehicle.roles import ROLES
from canid.vehicle.units import factor_to

# points, in the same unit as those of names: a clear agreement outweighs a unit, a contradiction a name
AGREES, AGREES_WEAKLY, CONTRADICTS, STILL = 3.0, 1.0, -6.0, -1.5
# s over which derivatives are taken: a radar's quantisation of 0.1 m and a speed's of 0.1 km/h are small in it
_SLOPE_S = 1.0
# m/s: a gap that changes faster is another vehicle's
MAX_GAP_RATE = 15.0
# rows (of 0.1 s) without which nothing is said
_MIN_ROWS = 50
# m/s below which wheels and speeds are compared with their quantisation
_MIN_SPEED = 3.0
# speedometers show 1 to 10 % more than the car drives (UN R39 allows 10 % + 4 km/h), tyres vary by 1.5 %
_SPEEDOMETER = (1.017, 1.13)
_SAME = 0.017
# m/s; a speed that is shown comes in steps of a tenth of a km/h or more, one that is measured in finer ones
_DISPLAY_STEP = 0.1 / 3.6
# units of speeds that DBC files leave out, as factors to m/s
_SPEED_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704}


class References(NamedTuple):
    """Roles that are known already, on the raster, in canid's units; NaN: not measured."""

    wheels: Array | None = None  # m/s, or of unknown unit
    wheels_unit: bool = False
    speed: Array | None = None
    accel: Array | None = None  # derivative of `speed`, m/s2
    pedal: Array | None = None
    cruise: Array | None = None
    steering: Array | None = None
    gap_rate: Array | None = None


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
    found = column(candidate.message, candidate.signal, bus, columns)
    if found is None:
        return None
    raw = found[1]
    if not np.isfinite(raw).any():
        return None
    judge = _JUDGES.get(candidate.role, _any)
    points, remarks, made = judge(candidate._replace(bus=bus), raw, known)
    values = in_role_unit(made, raw)
    finite = values[np.isfinite(values)]
    low, high = (float(np.min(finite)), float(np.max(finite))) if len(finite) else (math.nan, math.nan)
    t = found[0].t
    rate = (len(t) - 1) / (t[-1] - t[0]) if t[-1] > t[0] else 0.0
    return Seen(made, points, tuple(remarks), values, low, high, float(rate))


def in_role_unit(candidate: Candidate, raw: Array) -> Array:
    """Values of the DBC as the vehicle file would convert them."""
    unit = ROLES[candidate.role].unit
    if ROLES[candidate.role].kind == "bool":
        on = np.isin(raw, candidate.on) if candidate.on is not None else raw != 0
        return np.where(np.isfinite(raw), on.astype(float), np.nan)
    factor = factor_to(candidate.unit, unit) if unit and candidate.unit else None
    return raw * candidate.scale * (factor if factor is not None else 1.0)


def slope(values: Array) -> Array:
    """Derivative over one second; NaN at the ends and where something was not measured.

    Example:
        >>> slope(0.1 * np.arange(30.0))[10:12].round(3).tolist()
        [1.0, 1.0]
    """
    half = round(_SLOPE_S / STEP_S / 2)
    made = np.full(len(values), np.nan)
    if len(values) > 2 * half:
        made[half:-half] = (values[2 * half :] - values[: -2 * half]) / (2 * half * STEP_S)
    return made


def correlation(a: Array, b: Array) -> tuple[float, float, int]:
    """Correlation, slope of `a` on `b` through the mean, and rows; NaN where they do not move together in enough rows."""
    both = np.isfinite(a) & np.isfinite(b)
    n = int(both.sum())
    if n < _MIN_ROWS:
        return math.nan, math.nan, n
    x, y = b[both] - b[both].mean(), a[both] - a[both].mean()
    xx, yy = float(x @ x), float(y @ y)
    if xx <= 1e-12 * n or yy <= 1e-12 * n:
        return math.nan, math.nan, n
    return float(x @ y) / math.sqrt(xx * yy), float(x @ y) / xx, n


Judged = tuple[float, list[str], Candidate]


def _moves(raw: Array) -> bool:
    finite = raw[np.isfinite(raw)]
    return len(finite) > 1 and float(np.ptp(finite)) > 0.0


def _any(candidate: Candidate, raw: Array, known: References) -> Judged:
    if not _moves(raw):
        still = ROLES[candidate.role].kind == "number"
        return (STILL if still else 0.0), ["constant in the log"], candidate
    return AGREES_WEAKLY, [], candidate


def _speed(candidate: Candidate, raw: Array, known: References) -> Judged:
    if not _moves(raw):
        return 2 * STILL, ["constant in the log"], candidate
    if known.wheels is None:
        return AGREES_WEAKLY, [], candidate
    fast = (
        np.isfinite(raw)
        & np.isfinite(known.wheels)
        & (known.wheels > (_MIN_SPEED if known.wheels_unit else 0.0))
    )
    r, _, n = correlation(raw[fast], known.wheels[fast])
    if n < _MIN_ROWS:
        return 0.0, [], candidate
    if not math.isfinite(r):
        r = 1.0 if np.ptp(raw[fast]) == np.ptp(known.wheels[fast]) == 0 else 0.0
    ratio = float(np.median(raw[fast] / known.wheels[fast]))
    # a constant speed says little in the correlation: its ratio is compared alone
    steady = float(np.std(known.wheels[fast])) < 0.02 * float(np.mean(known.wheels[fast]))
    if r < 0.97 and not steady:
        return CONTRADICTS, [f"does not follow the wheel speeds (r = {r:.2f})"], candidate
    if not known.wheels_unit:
        return AGREES, [f"follows the wheel speeds (r = {r:.3f})"], candidate
    if candidate.unit:
        share = ratio * (factor_to(candidate.unit, "m/s") or 1.0)
    else:
        unit = min(_SPEED_UNITS, key=lambda name: abs(math.log(max(ratio, 1e-9) * _SPEED_UNITS[name])))
        share = ratio * _SPEED_UNITS[unit]
        if not 0.9 < share < 1.15:
            return 0.0, [f"{ratio:.3g} times the wheel speeds in m/s: no usual unit"], candidate
        candidate = candidate._replace(
            unit=unit, remarks=(f"no unit in the DBC; {unit} by the wheel speeds",)
        )
    if abs(share - 1.0) < _SAME:
        return AGREES, [f"{share:.3f} of the wheel speeds"], candidate
    step = abs(candidate.signal.scale) * (factor_to(candidate.unit, "m/s") or 1.0)
    if _SPEEDOMETER[0] <= share <= _SPEEDOMETER[1] and step >= _DISPLAY_STEP:
        return -AGREES, [f"{share:.3f} of the wheel speeds, as a speedometer shows"], candidate
    if 0.9 < share < 1.15:
        return 0.0, [f"{share:.3f} of the wheel speeds"], candidate
    return CONTRADICTS, [f"{share:.3g} of the wheel speeds: its unit is wrong"], candidate


def _accel(candidate: Candidate, raw: Array, known: References) -> Judged:
    if not _moves(raw):
        return STILL, ["constant in the log"], candidate
    if known.accel is None:
        return 0.0, [], candidate
    r, _, _ = correlation(known.accel, _smooth(raw))
    if not math.isfinite(r):
        return 0.0, [], candidate
    if candidate.role == "accel" and r <= -0.6:
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


def _smooth(raw: Array) -> Array:
    """Mean over the second of `slope`."""
    width = round(_SLOPE_S / STEP_S)
    ok = np.isfinite(raw)
    total = np.convolve(np.where(ok, raw, 0.0), np.ones(width), "same")
    count = np.convolve(ok.astype(float), np.ones(width), "same")
    return np.where(count > width / 2, total / np.maximum(count, 1), np.nan)


def _pedal(candidate: Candidate, raw: Array, known: References) -> Judged:
    if not _moves(raw):
        return STILL, ["constant in the log"], candidate
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
    share = in_role_unit(candidate, raw)
    if candidate.unit and np.nanmax(share) > 130.0:
        points += CONTRADICTS / 2
    return points, remarks, candidate


def _gap(candidate: Candidate, raw: Array, known: References) -> Judged:
    return (AGREES_WEAKLY, [], candidate) if _moves(raw) else (STILL, ["constant in the log"], candidate)


def _range_rate(candidate: Candidate, raw: Array, known: References) -> Judged:
    if not _moves(raw):
        return STILL, ["constant in the log"], candidate
    if known.gap_rate is None:
        return 0.0, [], candidate
    near = np.where(np.abs(known.gap_rate) < MAX_GAP_RATE, known.gap_rate, np.nan)
    r, gain, _ = correlation(near, _smooth(raw))
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


def _brake(candidate: Candidate, raw: Array, known: References) -> Judged:
    if not _moves(raw):
        return 0.0, ["constant in the log"], candidate
    if known.accel is None:
        return 0.0, [], candidate
    if candidate.on is None and candidate.signal.length > 1:
        on = _braking_values(raw, known)
        if on:
            candidate = candidate._replace(
                on=on, remarks=(f"{list(on)}: the values with which the car brakes in the log",)
            )
            return AGREES + 1.0, ["on while the car brakes"], candidate
    return _while_on(candidate, raw, known)


def _while_on(candidate: Candidate, raw: Array, known: References) -> Judged:
    on = in_role_unit(candidate, raw) > 0.5
    off = np.isfinite(raw) & ~on
    assert known.accel is not None
    a_on, a_off = _mean(known.accel, on), _mean(known.accel, off)
    pressed = (
        _mean((known.pedal > 3.0).astype(float), on & np.isfinite(known.pedal))
        if known.pedal is not None
        else math.nan
    )
    remarks = []
    points = 0.0
    if math.isfinite(a_on) and math.isfinite(a_off):
        remarks.append(f"mean acceleration {a_on:.1f} m/s2 while on, {a_off:.1f} while off")
        points += AGREES if a_on < a_off - 0.3 else CONTRADICTS if a_on > a_off + 0.2 else 0.0
    if known.cruise is not None and _mean(known.cruise, on) > 0.5:
        # a driver who brakes ends cruise control: this is the controller's brake, or the lamp
        return CONTRADICTS, ["on while cruise control drives"], candidate
    if pressed > 0.5:
        points += CONTRADICTS
        remarks.append("the accelerator is pressed meanwhile")
    return points, remarks, candidate


def _braking_values(raw: Array, known: References) -> tuple[int, ...]:
    """The states in which the car brakes and the accelerator is at rest."""
    assert known.accel is not None
    found = []
    values = np.unique(raw[np.isfinite(raw)])
    means = {value: _mean(known.accel, raw == value) for value in values}
    usual = max(values, key=lambda value: int((raw == value).sum()))
    for value in values:
        pressed = _mean((known.pedal > 3.0).astype(float), raw == value) if known.pedal is not None else 0.0
        if value != usual and means[value] < min(-0.3, means[usual] - 0.3) and not pressed > 0.3:
            found.append(int(value))
    return tuple(found)


def _mean(values: Array, rows: npt.NDArray[np.bool_]) -> float:
    chosen = values[rows & np.isfinite(values)]
    return float(chosen.mean()) if len(chosen) >= 5 else math.nan


def _cruise(candidate: Candidate, raw: Array, known: References) -> Judged:
    if not _moves(raw):
        return 0.0, ["constant in the log"], candidate
    if known.speed is None or known.pedal is None:
        return 0.0, [], candidate
    on = in_role_unit(candidate, raw) > 0.5
    moving = on & (known.speed > 5.0)
    held = _mean((np.abs(known.pedal) < 2.0).astype(float), moving & np.isfinite(known.pedal))
    if not math.isfinite(held):
        return 0.0, [], candidate
    remarks = [f"accelerator at rest in {100 * held:.0f} % of the time while on"]
    return (AGREES if held > 0.7 else STILL if held < 0.2 else 0.0), remarks, candidate


def _yaw(candidate: Candidate, raw: Array, known: References) -> Judged:
    if not _moves(raw):
        return STILL, ["constant in the log"], candidate
    if known.steering is None or known.speed is None:
        return AGREES_WEAKLY, [], candidate
    r, _, _ = correlation(raw, known.steering * known.speed)
    if not math.isfinite(r) or float(np.nanstd(known.steering)) < 1.0:
        return 0.0, [], candidate
    points = AGREES if abs(r) > 0.6 else STILL if abs(r) < 0.2 else 0.0
    return points, [f"r = {r:.2f} with speed times steering angle"], candidate


_JUDGES: Mapping[str, Callable[[Candidate, Array, References], Judged]] = {
    "speed": _speed,
    "accel": _accel,
    "pedal": _pedal,
    "gap": _gap,
    "range_rate": _range_rate,
    "brake": _brake,
    "cruise_active": _cruise,
    "yaw_rate": _yaw,
}
