"""May the estimators learn from this sample, and if not, why: a gate with a recovery time, as openpilot's lagd has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from canid.signals.samples.limited_values import AT_LIMIT
from canid.values.roles import assistant_of
from canid.values.types import NAN, Driver, LearnGate, Sample

# %; one step of an 8-bit pedal sensor: at or below it the pedal may be released
PEDAL_FLOOR_PERCENT = 0.5
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
# about 2 s (openpilot waits the same time); the driver changes from brake to accelerator in 1 s; at the floor only the
# pedal was hidden, not the driver: three samples for the sensor's own lag
RECOVERY_S = {LearnGate.BRAKE: 1.0, LearnGate.PEDAL_FLOOR: 0.3}
DEFAULT_RECOVERY_S = 2.0


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
    if driver.task == "car_following":
        state = _distance(state, t, values, driver)
    gate = judge(state, values, driver)
    values.pop(AT_LIMIT, None)
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
    if gate is not LearnGate.OPEN or swapped:
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
    )
    output = values.get(driver.output, NAN)
    # who brakes with the pedal pressed says nothing of his demand; a released pedal does
    hidden = gate in (LearnGate.PEDAL_FLOOR, LearnGate.BRAKE) and output <= PEDAL_FLOOR_PERCENT
    bound = PEDAL_FLOOR_PERCENT if hidden else NAN
    return after, Sample(t, output, inputs(values, driver), gate, learn, segment, values, bound)
