"""From samples to rows: what the predictors regress, five times a second, NaN where nobody may learn from it."""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from canid.types import NAN, Sample

# s; 5 Hz. A person's answer ends below 1 Hz; slower rows would mix the dead time with the lag, faster ones cost more
STEP = 0.2
# s; sums of gap and range rate leak away, so that what drifts slowly (data/openacc) is no news
LEAK = 5.0
# %; below this an engine brakes, and pulls no longer in proportion to the pedal
PULLS = 2.0
# m/s; below this a car creeps by itself
ROLLS = 2.0
# m; closer than this a radar's report follows the bumper no longer, and nobody drives
NEAREST = 2.0
# half a millisecond against the rounding of t = k dt
_ROUNDING = 5e-4
# (m/s)² per unit of the drag column: speeds of 10 to 30 m/s give numbers of the size of a pedal's
_SQUARE = 100.0

# The columns of a row; the driver's inputs follow.
SEGMENT, ANSWER, ACCEL, PULL, DRAG, CREPT, RAN, BESIDE, SPEED, FIRST_INPUT = range(10)


class State(NamedTuple):
    """What the next row needs of the ones before."""

    t: float = NAN  # s, of the last row
    segment: int = -1
    speed: float = NAN  # m/s
    gap: float = NAN  # m
    rate: float = NAN  # m/s
    crept: float = 0.0  # m, gap beyond what the range rate says, leaking
    ran: float = 0.0  # m, what the range rate says, leaking


def due(state: State, t: float) -> bool:
    """Whether a sample at t [s] begins a new row."""
    return not t - state.t < STEP - _ROUNDING


def step(state: State, sample: Sample) -> tuple[State, tuple[float, ...]]:
    """Make a row of a sample.

    Example:
        >>> from canid.types import Gate
        >>> signals = {"speed": 20.0, "gap": 30.0, "range_rate": 1.0, "pedal": 12.0}
        >>> _, row = step(State(), Sample(0.0, 12.0, (0.1, 1.0), Gate.OPEN, True, 0, signals))
        >>> row[ANSWER], row[PULL], row[FIRST_INPUT:]
        (12.0, 12.0, (0.1, 1.0))
    """
    get = sample.signals.get
    t, speed, gap, rate = sample.t, get("speed", NAN), get("gap", NAN), get("range_rate", NAN)
    h = t - state.t
    whole = not h > 1.5 * STEP  # the first row has no h, and no hole before it
    follows = whole and sample.segment == state.segment
    accel = get("accel", NAN)
    if accel != accel and follows:
        accel = (speed - state.speed) / h
    pedal = get("pedal", NAN)
    away = get("brake", 0.0) > 0.0 or get("clutch", 0.0) > 0.0 or get("cruise_active", 0.0) > 0.0
    pulls = speed > ROLLS and pedal > PULLS and not away
    crept = ran = 0.0
    summed = (NAN, NAN)
    went = 0.5 * h * (rate + state.rate)
    grew = gap - state.gap - went
    # a hole ends the sums; they begin anew behind it
    if follows and isfinite(grew) and min(gap, state.gap) > NEAREST:
        kept = 1.0 - h / LEAK
        summed = crept, ran = kept * state.crept + grew, kept * state.ran + went
    row = (
        float(sample.segment) if whole else NAN,
        sample.output if sample.learn else NAN,
        accel if pulls else NAN,
        pedal if pulls else NAN,
        speed * speed / _SQUARE,
        *summed,
        get("gnss_speed", NAN) - speed,
        speed,
        *sample.inputs,
    )
    return State(t, sample.segment, speed, gap, rate, crept, ran), row
