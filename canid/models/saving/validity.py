"""Validation of a restored state: finite numbers, ranges, shapes, and a trial run of the estimators.

The checksum of a saved state keeps accidents out, not people: whoever can write the file can compute it. So nothing
of a state is used before it has passed:

- the constraints in the annotations of its types (state_constraints.py), and bounds that hold for every number;
- the shapes, by each estimator's `check_state`;
- a trial of five seconds on synthetic samples, whose results are discarded: it finds what no rule covers.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from canid.mathematics.estimators import agreement
from canid.mathematics.identification.identifiability import QUOTABLE
from canid.models.monitor import change_monitor
from canid.models.pipeline import pipeline, restart_time
from canid.signals.signal_checks import signal_checks
from canid.signals.vehicle import Vehicle
from canid.values.state_constraints import FINITE, NOT_NEGATIVE, POSITIVE, TIME, Constraint
from canid.values.types import TASK_INPUTS, Estimate, Identifiable, LearnGate, Sample, Status

# s; three years of driving. Beyond, the step of the grid is lost in the time's own rounding
MAX_TIME_S = 1e8
# s by which a time may be later than the last sample: the rounding of sums of the grid's step
TIME_ROUNDING_S = 1.0
# of any quantity that is estimated, in any unit: beyond, squares lose what they are added to
MAX_ESTIMATE = 1e9
# of any number of a state, which may be a square
MAX_NUMBER = MAX_ESTIMATE**2
# of an array, as many rows as no estimator keeps of one second or less of data each
MAX_ROWS = 100_000
# samples of the trial: 5 s at 10 Hz, two blocks of the recursion and two updates of the monitor, for 0.15 s of
# processor time
TRIAL_SAMPLES = 50


def check(known: pipeline.Known, vehicle: Vehicle, dt: float) -> str:
    """Say why a restored state is not used; "" where it is.

    Args:
        known: of the right types.
        vehicle: that it is to be used for.
        dt: the grid's step, s.
    """
    with np.errstate(all="raise", under="ignore"):
        try:
            now = known.time.t + known.time.ahead
            if not (0.0 <= known.time.t <= MAX_TIME_S and 0.0 <= now <= MAX_TIME_S):
                return f"its time is {now:g} s"
            for problem in _number_errors(known, "", now):
                return problem
            return _trial_error(known, vehicle, dt)
        except (Exception, RecursionError) as error:
            # whatever a state makes the estimators raise is the state's fault: they were given no data yet
            return f"the estimators cannot go on from it ({type(error).__name__})"


@cache
def _constraints(kind: type) -> dict[str, frozenset[Constraint]]:
    """The constraints in the annotations of a NamedTuple, field by field."""

    def in_hint(hint: Any) -> Iterator[Constraint]:
        yield from (x for x in getattr(hint, "__metadata__", ()) if isinstance(x, Constraint))
        for part in typing.get_args(hint):  # X | None
            yield from in_hint(part)

    hints = typing.get_type_hints(kind, include_extras=True)
    return {name: frozenset(in_hint(hint)) for name, hint in hints.items()}


def _number_errors(
    value: Any, place: str, now: float, constraints: frozenset[Constraint] = frozenset()
) -> Iterator[str]:
    """Sentences about numbers that cannot be, with their places."""
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        by_field = _constraints(type(value))
        for name, part in zip(value._fields, value, strict=True):
            # a nested state inherits what holds for all of it
            yield from _number_errors(part, f"{place}.{name}", now, constraints | by_field[name])
    elif isinstance(value, tuple):
        for k, part in enumerate(value):
            yield from _number_errors(part, f"{place}[{k}]", now, constraints)
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _number_errors(part, place, now, constraints)
    elif isinstance(value, np.ndarray):
        if value.ndim and (len(value) > MAX_ROWS or (not value.size and max(value.shape) > MAX_ROWS)):
            yield f"{place} has the shape {value.shape}"
        elif (
            value.size and value.dtype.kind == "f" and not np.nanmax(np.abs(value), initial=0.0) <= MAX_NUMBER
        ):
            yield f"{place} holds a number larger than any measured quantity"
        yield from _violations(value, place, now, constraints)
    elif isinstance(value, int) and abs(value) > MAX_ESTIMATE:
        yield f"{place} is a number of {len(str(abs(value)))} digits"
    elif isinstance(value, float | int):
        if math.isfinite(value) and abs(value) > MAX_NUMBER:
            yield f"{place} is {value:g}"
        yield from _violations(value, place, now, constraints)


_FULFILLED: dict[Constraint, Callable[[Any, float], Any]] = {
    FINITE: lambda x, now: np.isfinite(x),
    NOT_NEGATIVE: lambda x, now: ~(np.asarray(x) < 0),  # also where x is NaN
    POSITIVE: lambda x, now: np.asarray(x) > 0,
    TIME: lambda x, now: ~(np.asarray(x) > now + TIME_ROUNDING_S),
}


def _violations(number: Any, place: str, now: float, constraints: frozenset[Constraint]) -> Iterator[str]:
    for constraint in constraints:
        if not np.all(_FULFILLED[constraint](number, now)):
            last = f" ({now:g} s)" if constraint is TIME else ""
            yield f"{place} is not {constraint.value}{last}"


def _trial_error(known: pipeline.Known, vehicle: Vehicle, dt: float) -> str:
    """Check shapes, and let the estimators go on from a state, on synthetic samples."""
    names = TASK_INPUTS[vehicle.driver.task]
    estimators, monitor = pipeline.estimators(vehicle, dt), change_monitor.make(names)
    for estimator, state in zip(estimators, known.estimators, strict=True):
        for problem in estimator.check_state(state):
            return problem
    for problem in monitor.check_state(known.monitor):
        return problem
    _, pause = restart_time.resume(known.time, dt, len(names))
    states = [
        estimator.step(known_state, pause)[0]
        for estimator, known_state in zip(estimators, known.estimators, strict=True)
    ]
    monitored, _ = monitor.step(known.monitor, pause)
    signals, _ = signal_checks.step(known.signals, pause, vehicle.driver, dt)
    agreed = known.agreement
    for k in range(1, TRIAL_SAMPLES + 1):
        sample = _sample(pause.t + k * dt, pause.segment, k, len(names))
        said = []
        for place, estimator in enumerate(estimators):
            states[place], estimate = estimator.step(states[place], sample)
            said += [estimate] if estimate is not None else []
        agreed, estimates = agreement.step(agreed, said)
        monitored, _ = monitor.step(monitored, sample)
        signals, _ = signal_checks.step(signals, sample, vehicle.driver, dt)
        for estimate in estimates:
            if not _plausible(estimate):
                return f"{estimate.estimator} gives impossible numbers from it"
    return ""


def _sample(t: float, segment: int, k: int, inputs: int) -> Sample:
    """Sample k of a synthetic driver who answers a little."""
    moved = 0.5 * math.sin(0.13 * k)
    output = 20.0 + 3.0 * math.sin(0.13 * k - 0.5) + 0.3 * math.sin(1.7 * k)
    signals = {
        "speed": 20.0 + moved,
        "gap": 30.0 + moved,
        "range_rate": moved,
        "pedal": output,
        "accel": 0.1 * moved,
    }
    return Sample(
        t, output, (moved, 0.7 * math.sin(0.21 * k))[:inputs], LearnGate.OPEN, True, segment, signals
    )


def _plausible(estimate: Estimate) -> bool:
    """Whether an estimate that counts has ordered intervals of possible numbers, and the headline one a gain."""
    if estimate.status is not Status.OK:
        return True
    for channel in estimate.channels.values():
        for interval in (getattr(channel, name) for name in QUOTABLE[channel.status]):
            ends = [x for x in interval if x == x]
            if ends and (
                len(ends) < len(interval)
                or not interval.low <= interval.high
                or max(map(abs, ends)) > MAX_ESTIMATE
            ):
                return False
    return not estimate.headline or any(
        channel.status is not Identifiable.NOT for channel in estimate.channels.values()
    )
