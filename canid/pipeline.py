"""One frame in; samples, estimates, screens and events out: the composition that live, replay and batch share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from canid import clock, downtime, gate, lead, sampling
from canid.estimators import ESTIMATORS, agreement
from canid.screening import watch
from canid.types import (
    TASK_INPUTS,
    AnyEstimator,
    Estimate,
    Event,
    Frame,
    Reading,
    Sample,
    Screened,
    TrackReading,
)
from canid.vehicle import Vehicle, decoder

# s; 10 Hz, the rate of Chen & Ulsoy 2001 and well above what a person's answer holds (below 1 Hz)
DT = 0.1

# the lead as the radar reported it, beside the smoothed one: smoothing makes gap and range rate agree with each other,
# and a frozen report move, so what is wrong with the radar itself can be seen in these alone
REPORTED = {"gap": "gap_reported", "range_rate": "range_rate_reported"}

Output = Sample | Estimate | Screened | Event


class State(NamedTuple):
    """Everything that the next frame's meaning depends on."""

    clock: clock.State
    decode: Any
    lead: lead.State
    sampling: sampling.State
    gate: gate.State
    estimators: tuple[Any, ...]
    time: downtime.State = downtime.State()  # of the estimators
    agreement: agreement.State = agreement.State()  # among them
    screen: watch.State | None = None  # None: not estimating


class Known(NamedTuple):
    """What outlives a restart: what the estimators and the screen have learnt, and where their time stands."""

    time: downtime.State
    estimators: tuple[Any, ...]
    agreement: agreement.State
    screen: watch.State


class Pipeline(NamedTuple):
    """A vehicle's pipeline: pure functions."""

    init: Callable[[], State]
    step: Callable[[State, Frame], tuple[State, list[Output]]]
    resume: Callable[[State, Known], State]  # from `init()`, with what was known before a restart


def sampled_roles(vehicle: Vehicle) -> dict[str, sampling.Role]:
    """How each role that this vehicle has is brought onto the grid."""
    needed = {vehicle.driver.output, "speed", "gap", "range_rate", "lateral_offset"}
    roles = {
        role: sampling.Role(how.switch, how.stale, role in needed and not how.switch)
        for role, how in vehicle.roles.items()
        if role != "lead_valid"
    }
    if vehicle.driver.task == "car_following":
        age = lead.settings_of(vehicle).age._asdict()
        following = {role: sampling.Role(stale=age[role], needed=True) for role in REPORTED}
        reported = {name: sampling.Role(stale=age[role]) for role, name in REPORTED.items()}
        roles |= following | sampling.MADE | reported
    return roles


def reported(reading: Reading | TrackReading, target: int) -> list[Reading]:
    """Return what a radar's report says of the lead, unsmoothed, as readings of `REPORTED`.

    Args:
        reading: as decoded.
        target: number of the followed track; -1: none, or the lead is given as signals.

    Example:
        >>> reported(Reading(1.0, "gap", 31.2), -1)
        [Reading(t=1.0, role='gap_reported', value=31.2)]
        >>> reported(TrackReading(1.0, 3, 31.2, -0.4, 0.1, True, False), 2)
        []
    """
    if isinstance(reading, TrackReading):
        if reading.track != target:
            return []
        pair = {"gap": reading.distance, "range_rate": reading.rate}
        return [Reading(reading.t, REPORTED[role], value) for role, value in pair.items()]
    if reading.role not in REPORTED:
        return []
    return [Reading(reading.t, REPORTED[reading.role], reading.value)]


def estimators(vehicle: Vehicle, dt: float = DT) -> tuple[AnyEstimator, ...]:
    """Return the estimators, with this vehicle's settings bound."""
    names = TASK_INPUTS[vehicle.driver.task]
    return tuple(make(names, dt, getattr(vehicle, name)) for name, make in ESTIMATORS)


def build(vehicle: Vehicle, *, estimating: bool = True, dt: float = DT) -> Pipeline:
    """Compose a vehicle's pipeline.

    Args:
        vehicle: from `read_vehicle`.
        estimating: False leaves the estimators and the screen out: only samples and events come.
        dt: step of the grid, s.

    Returns:
        `init() -> state` and `step(state, frame) -> (state, outputs)`; outputs in the order in which they came to be.
    """
    decode_init, decode = decoder(vehicle)
    roles = sampled_roles(vehicle)
    driver = vehicle.driver
    following = driver.task == "car_following"
    settings = lead.settings_of(vehicle)
    running = estimators(vehicle, dt) if estimating else ()
    screen = watch.make(TASK_INPUTS[driver.task])

    def init() -> State:
        states = tuple(estimator.init() for estimator in running)
        watching = screen.init() if estimating else None
        lists = clock.init(), decode_init(), lead.init(), sampling.init(), gate.init(), states
        return State(*lists, screen=watching)

    def step(state: State, frame: Frame) -> tuple[State, list[Output]]:
        out: list[Output] = []
        now, timed, event = clock.step(state.clock, frame)
        if event:
            out.append(event)
        if timed is None:
            return state._replace(clock=now), out
        decoded, readings = decode(state.decode, timed)
        if not readings and now.latest < state.sampling.next * dt + sampling.WAIT:
            # most frames of a bus are not mapped: without a reading no grid point becomes complete
            return State(now, decoded, *state[2:]), out
        follow, samples = state.lead, state.sampling
        for reading in readings:
            if isinstance(reading, Event):
                out.append(reading)
                continue
            kept: list[Reading | Event]
            if following:
                follow, kept = lead.step(follow, reading, settings)
                kept = [*kept, *reported(reading, follow.target)]
            else:
                kept = [reading] if isinstance(reading, Reading) else []
            for item in kept:
                if isinstance(item, Event):
                    out.append(item)
                else:
                    samples = sampling.put(samples, item)
        samples, points = sampling.take(samples, now.latest, dt, roles)
        judged, states, time, agreed = state.gate, state.estimators, state.time, state.agreement
        watching = state.screen
        for t, values in points:
            judged, sample = gate.step(judged, t, values, driver, dt)
            out.append(sample)
            time, own = downtime.step(time, sample, dt)
            stepped, spoken = [], []
            for estimator, inner in zip(running, states, strict=True):
                inner, estimate = estimator.step(inner, own)
                stepped.append(inner)
                if estimate is not None:
                    spoken.append(estimate)
            states = tuple(stepped)
            agreed, told = agreement.step(agreed, spoken)
            out += [estimate._replace(t=t) for estimate in told]
            if watching is not None:
                watching, screened = screen.step(watching, own)
                if screened is not None:
                    out.append(watch.moved(screened, t - own.t))
        return State(now, decoded, follow, samples, judged, states, time, agreed, watching), out

    def resume(state: State, known: Known) -> State:
        time, pause = downtime.resume(known.time, dt, len(TASK_INPUTS[driver.task]))
        pairs = zip(running, known.estimators, strict=True)
        paused = tuple(estimator.step(inner, pause)[0] for estimator, inner in pairs)
        watching, _ = screen.step(known.screen, pause)
        return state._replace(estimators=paused, time=time, agreement=known.agreement, screen=watching)

    return Pipeline(init, step, resume)


def known(state: State) -> Known | None:
    """Return what outlives a restart; None where no sample has come that could have added to it."""
    if state.screen is None or state.time.t != state.time.t or state.time.resumed:
        return None
    return Known(state.time, state.estimators, state.agreement, state.screen)


def run(pipeline: Pipeline, frames: Iterable[Frame]) -> Iterator[tuple[State, Output]]:
    """Run frames through a pipeline; yields each output with the state after it."""
    state = pipeline.init()
    for frame in frames:
        state, out = pipeline.step(state, frame)
        for item in out:
            yield state, item
