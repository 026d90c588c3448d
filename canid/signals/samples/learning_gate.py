"""May the estimators learn from this sample, and if not, why: a gate with a recovery time, as openpilot's lagd has."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification import output_limits
from canid.signals.samples.limited_values import AT_LIMIT
from canid.signals.samples.sampling_grid import MAX_PAUSE_S
from canid.values.output_role import output_role
from canid.values.roles import assistant_of
from canid.values.types import NAN, Driver, LearnGate, Sample, Trace

# %; one step of an 8-bit pedal sensor: at or below it the pedal may be released
PEDAL_FLOOR_PERCENT = 0.5
# %; as far from its other end a pedal may be pressed down
PEDAL_FULL_PERCENT = 99.5
# m/s; below walking pace headway = gap/speed says nothing and people creep
CREEP_SPEED = 2.0
# s; up to 6 s a driver's speed depends on that of the vehicle ahead (Vogel 2002, "What characterizes a free vehicle in an
# urban area?"); one who wants a longer headway than 2 s may follow at three times that. Following is resumed below 5 s, the
# limit of the Highway Capacity Manual 1985, so that the gate does not flutter
FREE_HEADWAY_S, FOLLOWING_HEADWAY_S, FREE_FACTOR = 6.0, 5.0, 3.0
# s and m/s; a lead that departs for so long beyond the headway of free traffic of the Highway Capacity Manual 2000 (3 s)
# and a margin is not followed
DEPARTING_HEADWAY_S, DEPARTING_RATE, DEPARTING_S = 4.0, 0.5, 10.0
# s; a headway that is long only now and then is no free driving
FREE_AFTER_S = 3.0
# s; sums of the grid's step must not make 3 s less than 3 s
ROUNDING_S = 1e-6
# s after the gate opens again before anything is learnt. The person takes over from cruise or finds a new lead in
# about 2 s (openpilot waits the same time); the driver changes from brake to accelerator in 1 s; at the floor and at any
# other limit only the output was hidden, not the driver: three samples for the sensor's own lag
RECOVERY_S = {LearnGate.BRAKE: 1.0, LearnGate.PEDAL_FLOOR: 0.3, LearnGate.OUTPUT_LIMIT: 0.3}
DEFAULT_RECOVERY_S = 2.0
# gates with which the output is the driver's demand, up to its limits
SHOWS_DEMAND = (LearnGate.OPEN, LearnGate.PEDAL_FLOOR, LearnGate.OUTPUT_LIMIT)


class State(NamedTuple):
    """What the next sample's gate depends on."""

    t: float = NAN  # of the last sample
    opens: float = 0.0  # s; learning may go on from here
    target: float = NAN  # serial number of the lead
    cruise: float = NAN
    segment: int = 0
    distant: float = NAN  # s, since when the headway has been too long; NaN: it is not
    departing: float = NAN  # s, since when the lead has been departing
    free: bool = False  # the lead is not followed
    limits: output_limits.State = output_limits.init()  # of the output, as its samples have shown them
    begun: bool = False  # the signals have come since the begin or the latest pause


def init() -> State:
    """Return the state before the first sample."""
    return State()


def inputs(values: Mapping[str, float], driver: Driver) -> tuple[float, ...]:
    """Return the model's inputs, in the order of `TASK_INPUTS`.

    Example:
        >>> inputs({"headway": 1.5, "range_rate": -0.5}, Driver(headway_desired=2.0))
        (-0.5, -0.5)
    """
    if driver.task == "lane_keeping":
        return (values.get("lateral_offset", NAN),)
    return values["headway"] - driver.headway_desired, values["range_rate"]


def headway(values: Mapping[str, float]) -> float:
    """Time headway in s; NaN where the vehicle stands or there is no lead.

    Example:
        >>> headway({"gap": 30.0, "speed": 20.0})
        1.5
    """
    speed = values.get("speed", NAN)
    return values.get("gap", NAN) / speed if speed >= CREEP_SPEED / 2 else NAN


def judge(state: State, values: Mapping[str, float], driver: Driver) -> LearnGate:
    """What is wrong with this instant; `LearnGate.OPEN`: nothing."""
    output = values.get(driver.output, NAN)
    assistant = assistant_of(driver.output, values)
    speed, cruise = values.get("speed", NAN), values.get(assistant, 0.0)
    if output != output or cruise != cruise or (speed != speed and "speed" in values):
        return LearnGate.STALE
    person = driver.output in ("pedal", "steering_angle")
    if person and cruise:
        return LearnGate.CRUISE if assistant == "cruise_active" else LearnGate.ASSIST
    if driver.output == "accel_command" and "cruise_active" in values and not cruise:
        return LearnGate.NO_CRUISE
    if in_reverse(values):
        return LearnGate.REVERSE
    if speed < CREEP_SPEED:
        return LearnGate.STANDSTILL
    if driver.task == "car_following":
        valid = values.get("lead_valid", NAN)
        if valid == 0.0:
            return LearnGate.NO_LEAD
        if values.get(AT_LIMIT, 0.0) == 1.0:
            return LearnGate.LIMITED
        if any(x != x for x in inputs(values, driver)):
            return LearnGate.STALE if valid != valid else LearnGate.NO_LEAD
        if state.target == state.target and values.get("target", NAN) != state.target:
            return LearnGate.TARGET_CHANGE
        if state.free:
            return LearnGate.FREE_DRIVING
    elif any(x != x for x in inputs(values, driver)):
        return LearnGate.STALE
    if driver.output == "pedal":
        if values.get("brake", 0.0) > 0.0:
            return LearnGate.BRAKE
        if output <= PEDAL_FLOOR_PERCENT:
            return LearnGate.PEDAL_FLOOR
    return LearnGate.OPEN


def in_reverse(values: Mapping[str, float]) -> bool:
    """Whether the reverse gear is engaged: `reverse` says so, or `gear` is negative.

    Example:
        >>> in_reverse({"gear": -1.0}), in_reverse({"reverse": 1.0}), in_reverse({"gear": 3.0}), in_reverse({})
        (True, True, False, False)
    """
    return values.get("reverse", 0.0) > 0.0 or values.get("gear", 0.0) < 0.0


def _distance(state: State, t: float, values: Mapping[str, float], driver: Driver) -> State:
    """Follow whether the lead is beyond reach."""
    headway = values["headway"]
    # a driver who wants a longer headway follows at longer ones
    wide = max(1.0, FREE_FACTOR * driver.headway_desired / FREE_HEADWAY_S)
    if not headway > DEPARTING_HEADWAY_S * wide or values.get("lead_valid", NAN) != 1.0:
        known = state.free or state.distant == state.distant or state.departing == state.departing
        return state._replace(distant=NAN, departing=NAN, free=False) if known else state
    departs = values["range_rate"] > DEPARTING_RATE
    departing = (state.departing if state.departing == state.departing else t) if departs else NAN
    far = headway > FREE_HEADWAY_S * wide
    distant = (state.distant if state.distant == state.distant else t) if far else NAN
    stays = state.free and (headway > FOLLOWING_HEADWAY_S * wide or departs)
    # comparisons with NaN are false
    begins = t - distant >= FREE_AFTER_S - ROUNDING_S or t - departing >= DEPARTING_S - ROUNDING_S
    return state._replace(distant=distant, departing=departing, free=stays or begins)


def step(
    state: State, t: float, values: Mapping[str, float], driver: Driver, dt: float
) -> tuple[State, Sample]:
    """Turn the roles' values at one grid point into a sample.

    Args:
        state: from `init()` or the step before.
        t: s.
        values: role -> value in its unit; NaN = not measured; roles that the vehicle does not map are absent.
        driver: whose response is identified.
        dt: the grid's step, s.

    Example:
        >>> values = {"pedal": 12.0, "speed": 20.0, "gap": 30.0, "range_rate": 0.1, "lead_valid": 1.0, "brake": 1.0}
        >>> state, sample = step(init(), 0.0, values, Driver(), 0.1)
        >>> sample.gate.name, sample.learn
        ('BRAKE', False)
    """
    values = {**values, "headway": headway(values)}
    if t - state.t > MAX_PAUSE_S - dt:
        # begun anew, as a drive: who drives and what is ahead was so before the first sample
        state = State(t=state.t, segment=state.segment, limits=state.limits)
    if driver.task == "car_following":
        state = _distance(state, t, values, driver)
    gate = judge(state, values, driver)
    values.pop(AT_LIMIT, None)
    output, known = values.get(driver.output, NAN), output_limits.NOWHERE
    before = state.limits.last
    if gate in SHOWS_DEMAND:
        state = state._replace(limits=output_limits.step(state.limits, output))
        known = _with_pedal(output_limits.limits(state.limits), driver.output)
    if gate is LearnGate.OPEN and known.side(output):
        gate = LearnGate.OUTPUT_LIMIT
    segment = state.segment
    target = values.get("target", NAN)
    cruise = values.get("cruise_active", NAN)
    changed = target == target and state.target == state.target and target != state.target
    # where the acceleration stands in for the driver, another one drives from here on
    swapped = (
        driver.output == "accel"
        and cruise == cruise
        and state.cruise == state.cruise
        and cruise != state.cruise
    )
    if changed or swapped or t - state.t > 1.5 * dt:
        segment += 1
    opens = state.opens
    # what has not come yet was not lost
    begun = state.begun or gate is not LearnGate.STALE
    if (gate is not LearnGate.OPEN and begun) or swapped:
        opens = t + RECOVERY_S.get(gate, DEFAULT_RECOVERY_S)
        # a brief gate right after a long one does not cut the long one's recovery short
        opens = max(opens, state.opens)
    # half a step against the rounding of t = k·dt
    learn = gate is LearnGate.OPEN and t >= opens - dt / 2
    after = State(
        t,
        opens,
        target if target == target else state.target,
        cruise if cruise == cruise else state.cruise,
        segment,
        state.distant,
        state.departing,
        state.free,
        state.limits,
        begun,
    )
    # who brakes with the pedal pressed says nothing of his demand; a released pedal does
    released = gate in (LearnGate.PEDAL_FLOOR, LearnGate.BRAKE) and output <= PEDAL_FLOOR_PERCENT
    bound = PEDAL_FLOOR_PERCENT if released else NAN
    if gate is LearnGate.OUTPUT_LIMIT:
        bound = _bound(known, known.side(output))
    elif learn:
        top = state.limits.top[0].value
        bound = _bound(known, _near(known, before, driver.output, top))
    return after, Sample(t, output, inputs(values, driver), gate, learn, segment, values, bound)


def _with_pedal(known: output_limits.Limits, output: str) -> output_limits.Limits:
    """Limits of an output by its role: a pedal ends at 0 % and at 100 %, whatever its samples show."""
    if output != "pedal":
        return known
    return known._replace(
        lower=max(known.lower, PEDAL_FLOOR_PERCENT), upper=min(known.upper, PEDAL_FULL_PERCENT)
    )


def _near(known: output_limits.Limits, before: float, output: str, top: float) -> int:
    """Side on which a sample may be at a limit that the drive has met, by the sample before it; 0: on none.

    A pedal's 0 % is left out: released, it falls there from anywhere. So is a wheel, that crosses its range at once.
    """
    if output == "steering_angle":
        return 0
    if before >= known.upper - known.margin and top >= known.upper - known.tolerance:
        return 1
    return -1 if output != "pedal" and before <= known.lower + known.margin else 0


def _bound(known: output_limits.Limits, side: int) -> float:
    """What the demand is at most or at least at a limit, see `Sample.bound`; NaN on no side."""
    if side == 0:
        return NAN
    return (
        known.lower + known.tolerance
        if side < 0
        else math.nextafter(known.upper - known.tolerance, -math.inf)
    )


def limits(trace: Trace) -> output_limits.Limits:
    """Return the limits of a drive's output, as all its samples show them; of a pedal its own ends as well."""
    shown = np.array([gate in SHOWS_DEMAND for gate in trace.gate], dtype=bool) & np.isfinite(trace.output)
    return _with_pedal(output_limits.find(trace.output[shown].tolist()), output_role(trace))


def with_limits(trace: Trace) -> Trace:
    """Close the gate at a limit of the output from the drive's beginning on, not from when its samples had shown it.

    Args:
        trace: of a drive, its gates as they were judged sample by sample.
    """
    known, role = limits(trace), output_role(trace)
    output = trace.output.tolist()
    sides = np.array([known.side(y) for y in output], dtype=np.int64)
    opened = np.array([gate is LearnGate.OPEN for gate in trace.gate], dtype=bool)
    at = opened & (sides != 0)
    met = at | np.array([gate is LearnGate.OUTPUT_LIMIT for gate in trace.gate], dtype=bool)
    if not met.any():
        return trace
    index = np.arange(at.size)
    since = index - np.maximum.accumulate(np.where(at, index, -at.size))
    settles = since * trace.dt < RECOVERY_S[LearnGate.OUTPUT_LIMIT] - trace.dt / 2
    bound = np.full(at.size, NAN) if trace.bound is None else trace.bound.copy()
    bound[opened] = NAN
    bound[at] = [_bound(known, side) for side in sides[at].tolist()]
    top = float(trace.output[met].max())
    near = [0, *(_near(known, y, role, top) for y in output[:-1])]
    free = trace.learn & ~settles & ~met
    bound[free] = [_bound(known, side) for side in np.array(near)[free].tolist()]
    gate = tuple(
        LearnGate.OUTPUT_LIMIT if here else before
        for here, before in zip(at.tolist(), trace.gate, strict=True)
    )
    return trace._replace(gate=gate, learn=trace.learn & ~settles, bound=bound)
