"""Speeds and times whose unit a table does not state: what the numbers cannot be in m/s and in s.

- Whole numbers: buses and phones report speeds in steps of 1 km/h or 1 mph, no sensor in steps of 1 m/s. Multiples of 0.6214
  are whole km/h that a program has made mph.
- Level: 5 % of a drive behind a lead above 55 m/s (198 km/h).
- Specific power: speed times acceleration grows with the square of a factor. Its 99 % quantile is 8 to 29 W/kg on ten
  measured drives, and at most 44 on simulated ones. In mph it is five times as large.
- A lead that stands: while the own vehicle rolls towards it the closing rate is the speed, in the unit of the range rate.
- The range rate integrates to the change of the gap in the unit of the times; yd and m, ft/s and km/h differ by 9 % alone.

The own motion in the range rate (`signals/signal_checks/own_motion.py`) does not decide between m/s and mph: noise of
0.02 m/s in the speed takes its factor from 1 to 0.15.
"""

from __future__ import annotations

import numpy as np

from canid.analysis.tables.slopes import ACCEL_WIDTH_S, slope
from canid.values.types import Array

# different values from which on their steps are judged; the steps, and the rounding to one decimal
_MIN_VALUES, _MPH_OF_KMH, _ROUNDED = 20, 1.0 / 1.609344, 0.0501
# m/s, and W/kg; and the quantiles that are compared with them
_MAX_SPEED, _MAX_POWER = 55.0, 55.0
_SPEED_SHARE, _POWER_SHARE = 0.95, 0.99
# speeds over closing rates behind a lead that stands, by unit
_FACTORS = {"mph": 1.0 / 0.44704, "kn": 3.6 / 1.852, "km/h": 3.6}
# of such a ratio over its factor: its range; that of a lead that moves; and times as many rows as there
_NEAR, _BELOW, _TIMES = (0.92, 1.06), 0.65, 1.5
# s in which a lead stands; and the range of the speeds then, with which the ratio to a lead that moves changes
_MIN_STANDING_S, _MIN_RANGE = 2.0, 2.0
# m/s; below it noise decides
_MIN_SPEED = 2.0
# real s in a supposed one, and how near a ratio comes to it; rows of one change, and changes that are needed
_TIME_FACTORS, _TIME_NEAR = (60.0, 3600.0, 1440.0, 1e-3, 0.01, 0.1, 10.0, 100.0, 1e3, 1 / 24), 0.1
_ROWS, _MIN_CHANGES = 20, 10
# the same for units of the gap and the range rate whose ratio is near 1; standard errors by which it has to differ from 1
_GAP_FACTORS, _GAP_NEAR, _SURE = ((1 / 0.9144, "yd with m/s"), (1 / 0.3048 / 3.6, "ft with km/h")), 0.02, 4.0
# squared correlation of what are the same changes
_SAME = 0.9


def of_times(t: Array, gap: Array, rate: Array) -> str:
    """Why times are not in s; "": nothing shows that.

    Args:
        t: (n,) ascending, in what was taken for s.
        gap: (n,) m; NaN: none.
        rate: (n,) m/s; NaN: none.

    Example:
        >>> t = np.arange(0.0, 120.0, 0.1)
        >>> of_times(t / 60.0, 30.0 + 5.0 * np.sin(0.3 * t), 1.5 * np.cos(0.3 * t))
        'the gap changes by 60 times the integral of the range rate'
    """
    ratio, _ = _of_changes(t, gap, rate)
    near = any(abs(ratio / factor - 1.0) < _TIME_NEAR for factor in _TIME_FACTORS)
    return f"the gap changes by {ratio:.3g} times the integral of the range rate" if near else ""


def of_gap(t: Array, gap: Array, rate: Array) -> str:
    """Why a gap is not in m or a range rate not in m/s, where no check of signals finds it; "": nothing shows that.

    Args:
        t: (n,) s, ascending.
        gap: (n,) m; NaN: none.
        rate: (n,) m/s; NaN: none.

    Example:
        >>> t = np.arange(0.0, 120.0, 0.1)
        >>> of_gap(t, (30.0 + 5.0 * np.sin(0.3 * t)) / 0.9144, 1.5 * np.cos(0.3 * t))
        'the gap changes by 1.094 times the integral of the range rate, as yd with m/s'
    """
    ratio, error = _of_changes(t, gap, rate)
    units = next((units for factor, units in _GAP_FACTORS if abs(ratio / factor - 1.0) < _GAP_NEAR), "")
    sure = units and abs(ratio - 1.0) > _SURE * error
    return f"the gap changes by {ratio:.4g} times the integral of the range rate, as {units}" if sure else ""


@np.errstate(over="ignore", invalid="ignore")  # damaged cells
def _of_changes(t: Array, gap: Array, rate: Array) -> tuple[float, float]:
    """How many times the integral of the range rate the gap changes, and the standard error; NaN: not known."""
    steps = np.diff(t) * (rate[1:] + rate[:-1]) / 2.0
    area = np.append(0.0, np.cumsum(np.nan_to_num(steps)))
    holes = np.append(0, np.cumsum(~np.isfinite(steps)))
    change, x, missing = (column[_ROWS::_ROWS] - column[:-_ROWS:_ROWS] for column in (gap, area, holes))
    both = np.isfinite(change) & (missing == 0)
    change, x = change[both], x[both]
    shared, power, changed = float(change @ x), float(x @ x), float(change @ change)
    if len(x) < _MIN_CHANGES or not (
        0.0 < power < np.inf and np.inf > shared * shared > _SAME * power * changed
    ):
        return float("nan"), float("nan")
    rest = changed - shared * shared / power
    return abs(shared) / power, float(np.sqrt(max(rest, 0.0) / power / len(x)))


def of_speed(t: Array, speed: Array, rate: Array | None) -> str:
    """Why a speed is not in m/s; "": nothing shows that.

    Args:
        t: (n,) s, ascending.
        speed: (n,) the numbers as written; NaN: none.
        rate: (n,) range rate, m/s; NaN: none; None: not recorded.

    Example:
        >>> t = np.arange(0.0, 60.0, 0.1)
        >>> v = 20.0 + 9.0 * np.sin(0.3 * t)
        >>> of_speed(t, v / 2.0, None), of_speed(t, np.rint(v * 2.237), None)
        ('', 'it has whole numbers: no sensor reports a speed in steps of 1 m/s')
    """
    known = np.isfinite(speed)
    v, times = np.abs(speed[known]), t[known]
    values = np.unique(v)
    if len(values) >= _MIN_VALUES:
        if (values == np.rint(values)).all():
            return "it has whole numbers: no sensor reports a speed in steps of 1 m/s"
        if np.abs(values - _MPH_OF_KMH * np.rint(values / _MPH_OF_KMH)).max() < _ROUNDED:
            return f"its values are multiples of {_MPH_OF_KMH:.4f}: mph, made of whole km/h"
    if v.size and (high := float(np.quantile(v, _SPEED_SHARE))) > _MAX_SPEED:
        return f"5 % of its values are above {high:.3g}, in m/s {3.6 * high:.0f} km/h"
    power = v * slope(times, v, ACCEL_WIDTH_S)
    there = np.isfinite(power)
    # which lasts for two such times: a wrong value goes up and down within one
    power = (
        np.minimum(power[there], np.interp(times[there] + ACCEL_WIDTH_S, times[there], power[there]))
        if there.any()
        else power[there]
    )
    if power.size and (most := float(np.quantile(power, _POWER_SHARE))) > _MAX_POWER:
        return f"its changes take {most:.0f} W/kg in 1 % of the time if it is in m/s"
    return "" if rate is None else _standing(times, v, rate[known])


def _standing(t: Array, v: Array, rate: Array) -> str:
    """The ratio of the speed to the closing rate where the lead stands, if it is that of another unit."""
    row_s = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    there = np.isfinite(rate) & (v > _MIN_SPEED) & (rate < 0.0)
    v, ratio = v[there], -rate[there] / v[there]
    for unit, factor in _FACTORS.items():
        x = ratio * factor
        near, above = (x > _NEAR[0]) & (x < _NEAR[1]), x >= _NEAR[1]
        others = max(int(((x > _BELOW) & (x <= _NEAR[0])).sum()), int(above.sum()))
        enough = near.sum() * row_s >= _MIN_STANDING_S and near.sum() >= _TIMES * others
        if enough and v[near].max() > _MIN_RANGE * v[near].min():
            return f"behind a lead that stands it is {factor:.3g} times the closing rate, as in {unit}"
    return ""
