"""Features of the monitor's predictors: five rows a second, NaN where nothing may be learnt."""

from __future__ import annotations

from math import isfinite
from typing import Annotated, NamedTuple

from canid.values.state_constraints import TIME
from canid.values.types import NAN, Sample

# s; 5 Hz. A person's response ends below 1 Hz; slower rows would mix dead time and lag, faster ones cost more
ROW_INTERVAL_S = 0.2
# s; time constant of the leaky sums of gap and range rate, so that a slow drift is no change
LEAK_S = 5.0
# %; below this an engine brakes, and its force is no longer in proportion to the pedal
MIN_PEDAL = 2.0
# m/s; below this a vehicle creeps by itself
MIN_SPEED = 2.0
# m; closer than this a radar's report no longer follows the bumper, and nobody drives
MIN_GAP = 2.0
# s; half a millisecond against the rounding of t = k dt
TIME_ROUNDING_S = 5e-4
# (m/s)² per unit of the speed² column: speeds of 10 to 30 m/s give numbers of the size of a pedal's
SQUARED_SPEED_UNIT = 100.0

# The columns of a row; the driver's inputs follow.
(
    SEGMENT,
    OUTPUT,
    ACCEL,
    PEDAL,
    SPEED_SQUARED,
    GAP_RESIDUAL,
    RANGE_RATE_SUM,
    SPEED_DIFFERENCE,
    SPEED,
    FIRST_INPUT,
) = range(10)


class State(NamedTuple):
    """What the next row needs of the previous ones."""

    t: Annotated[float, TIME] = NAN  # s, of the last row
    segment: int = -1
    speed: float = NAN  # m/s
    gap: float = NAN  # m
    range_rate: float = NAN  # m/s
    gap_residual: float = 0.0  # m, leaky sum of the change of the gap that the range rate does not explain
    range_rate_sum: float = 0.0  # m, leaky integral of the range rate


def due(state: State, t: float) -> bool:
    """Whether a sample at t [s] begins a new row."""
    return not t - state.t < ROW_INTERVAL_S - TIME_ROUNDING_S


def step(state: State, sample: Sample) -> tuple[State, tuple[float, ...]]:
    """Make a row of a sample.

    Example:
        >>> from canid.values.types import LearnGate
        >>> signals = {"speed": 20.0, "gap": 30.0, "range_rate": 1.0, "pedal": 12.0}
        >>> _, row = step(State(), Sample(0.0, 12.0, (0.1, 1.0), LearnGate.OPEN, True, 0, signals))
        >>> row[OUTPUT], row[PEDAL], row[FIRST_INPUT:]
        (12.0, 12.0, (0.1, 1.0))
    """
    get = sample.signals.get
    t, speed = sample.t, get("speed", NAN)
    # as the radar reported them: smoothing makes the two agree, and what is to be seen here is that they do not
    gap, range_rate = (get(f"{role}_reported", get(role, NAN)) for role in ("gap", "range_rate"))
    h = t - state.t
    contiguous = not h > 1.5 * ROW_INTERVAL_S  # the first row has no h, and no hole before it
    follows = contiguous and sample.segment == state.segment
    accel = get("accel", NAN)
    if accel != accel and follows:
        accel = (speed - state.speed) / h
    pedal = get("pedal", NAN)
    disengaged = get("brake", 0.0) > 0.0 or get("clutch", 0.0) > 0.0 or get("cruise_active", 0.0) > 0.0
    driven = speed > MIN_SPEED and pedal > MIN_PEDAL and not disengaged
    gap_residual = range_rate_sum = 0.0
    sums = (NAN, NAN)
    integral = 0.5 * h * (range_rate + state.range_rate)
    unexplained = gap - state.gap - integral
    # a hole ends the sums; they restart after it
    if follows and isfinite(unexplained) and min(gap, state.gap) > MIN_GAP:
        kept = 1.0 - h / LEAK_S
        gap_residual, range_rate_sum = (
            kept * state.gap_residual + unexplained,
            kept * state.range_rate_sum + integral,
        )
        sums = gap_residual, range_rate_sum
    row = (
        float(sample.segment) if contiguous else NAN,
        sample.output if sample.learn else NAN,
        accel if driven else NAN,
        pedal if driven else NAN,
        speed * speed / SQUARED_SPEED_UNIT,
        *sums,
        get("gnss_speed", NAN) - speed,
        speed,
        *sample.inputs,
    )
    return State(t, sample.segment, speed, gap, range_rate, gap_residual, range_rate_sum), row
