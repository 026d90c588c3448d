"""From samples to rows: what the predictors regress, five times a second, NaN where nobody may learn from it."""

from __future__ import annotations

from typing import NamedTuple

from canid.types import NAN, Gate, Sample

# s; 5 Hz. A person's answer ends below 1 Hz; slower rows would mix the dead time with the lag, faster ones cost more
STEP = 0.2
# s; sums of gap and range rate leak away: what went before a change of target, or drifts, is no news
LEAK = 5.0
# %; below this an engine brakes, and pulls no longer in proportion to the pedal
PULLS = 2.0
# m/s; below this a car creeps by itself
ROLLS = 2.0

# The columns of a row; the driver's inputs follow.
SEGMENT, ANSWER, ACCEL, PULL, DRAG, CREPT, RAN, LEAD, OWN, BESIDE, SPEED, FIRST_INPUT = range(12)


class State(NamedTuple):
    """What the next row needs of the ones before."""

    t: float = NAN  # s, of the last row
    segment: int = -1
    speed: float = NAN  # m/s
    gap: float = NAN  # m
    rate: float = NAN  # m/s
    crept: float = 0.0  # m, gap beyond what the range rate says, leaking
    ran: float = 0.0  # m, what the range rate says, leaking
    lead: float = 0.0  # m/s, change of the lead's speed, leaking
    own: float = 0.0  # m/s, change of the own speed, leaking


def due(state: State, t: float) -> bool:
    """Whether a sample at t [s] begins a new row."""
    # half a millisecond against the rounding of t = k dt
    return not t - state.t < STEP - 5e-4


def step(state: State, sample: Sample) -> tuple[State, tuple[float, ...]]:
    """Make a row of a sample.

    Example:
        >>> signals = {"speed": 20.0, "gap": 30.0, "range_rate": 1.0, "pedal": 12.0}
        >>> _, row = step(State(), Sample(0.0, 12.0, (0.1, 1.0), Gate.OPEN, True, 0, signals))
        >>> row[ANSWER], row[PULL], row[FIRST_INPUT:]
        (12.0, 12.0, (0.1, 1.0))
    """
    get = sample.signals.get
    t, speed, gap, rate = sample.t, get("speed", NAN), get("gap", NAN), get("range_rate", NAN)
    h = t - state.t
    follows = sample.segment == state.segment and h < 1.5 * STEP
    slowed = speed - state.speed if follows else NAN
    accel = get("accel", NAN)
    if accel != accel and follows:
        accel = slowed / h
    pulls = (
        sample.gate not in (Gate.CRUISE, Gate.NO_CRUISE)
        and speed > ROLLS
        and not get("brake", 0.0) > 0.0
        and not get("clutch", 0.0) > 0.0
        and get("pedal", NAN) > PULLS
    )
    crept = ran = lead = own = 0.0
    ranged = follows and gap == gap and rate == rate
    # a hole ends the sums; they begin anew behind it
    if ranged and state.gap == state.gap and state.rate == state.rate:
        kept = 1.0 - h / LEAK
        went = 0.5 * h * (rate + state.rate)
        crept, ran = kept * state.crept + gap - state.gap - went, kept * state.ran + went
        lead, own = kept * state.lead + slowed + rate - state.rate, kept * state.own + slowed
        summed = (crept, ran, lead, own)
    else:
        summed = (NAN,) * 4
    after = State(t, sample.segment, speed, gap, rate, crept, ran, lead, own)
    row = (
        float(sample.segment) if h < 1.5 * STEP or h != h else NAN,
        sample.output if sample.learn else NAN,
        accel if pulls else NAN,
        get("pedal", NAN) if pulls else NAN,
        speed * speed * 1e-2,
        *summed,
        get("gnss_speed", NAN) - speed,
        speed,
        *sample.inputs,
    )
    return after, row
