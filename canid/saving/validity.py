"""Whether a restored state can be what an estimator has learnt: finite, in range, of the right shapes, and it runs.

The seal of a saved state keeps accidents out, not people: whoever can write the file can seal it. So nothing of it is
used before it has passed. Rules stand here by the type that they are about; what no rule foresees is found by a trial
of five seconds on samples that mean nothing, whose results are thrown away.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from canid import downtime, pipeline
from canid.estimators import agreement, armax, fopdt
from canid.identification import armax_recursive, memories, posterior, process_fit, rows
from canid.identification.armax_batch import Orders
from canid.screening import evidence, reference, watch
from canid.screening import rows as screen_rows
from canid.types import TASK_INPUTS, Estimate, Gate, Sample, Status
from canid.vehicle import Vehicle

# s; three years of driving. Beyond, the step of the grid is lost in the time's own rounding
_LATEST = 1e8
# s by which anything may be later than the last sample: the rounding of sums of the grid's step
_ROUNDING = 1.0
# of any quantity that is measured or estimated, in any unit: beyond, squares drown what they are added to
_LARGEST = 1e9
# names of times of the estimators' clock; NaN: it has not happened
_TIMES = ("t", "emitted", "began", "said_at", "again")
# of what one second or less of data is kept: rows of the grid
_MOST_ROWS = 100_000

# samples of the trial: 5 s at 10 Hz, two blocks of the recursion and two looks of the screen, for 0.15 s of processor time
_TRIAL = 50

# types of which no number may be missing, and what may be all the same
_WHOLE: dict[type, tuple[str, ...]] = {
    armax_recursive.State: (),
    armax_recursive.Noise: (),
    armax_recursive.Taken: (),
    memories.Trust: (),
    armax.Movement: (),
    process_fit.Point: (),
    process_fit.Laid: ("belief",),
    posterior.Cells: (),
    posterior.Region: (),
    rows.History: (),
    reference.State: ("variance",),
    evidence.State: ("since",),
}

# what can be no less than nothing, and what must be more
_NOT_NEGATIVE: dict[type, tuple[str, ...]] = {
    armax.Movement: ("samples", "variance"),
    armax.Quality: ("power", "error"),
    armax.Learnt: ("used", "pause", "since"),
    armax_recursive.Noise: ("recent",),
    memories.Trust: ("weights", "leave", "odds"),
    posterior.Cells: ("dead_time", "weight"),
    reference.State: ("rows", "foretold"),
    watch.Followed: ("unseen",),
    rows.History: ("age",),
}
_POSITIVE: dict[type, tuple[str, ...]] = {
    armax_recursive.Noise: ("power", "leverage"),
    armax_recursive.State: ("weights",),
    posterior.Cells: ("tau", "spacing"),
    posterior.Region: ("tau_sd", "rest_sd"),
}


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
            if not (0.0 <= known.time.t <= _LATEST and 0.0 <= now <= _LATEST):
                return f"its time is {now:g} s"
            for why in _wrong(known, "", now):
                return why
            for why in _misshapen(known, vehicle):
                return why
            return _tried(known, vehicle, dt)
        except (Exception, RecursionError) as error:
            # whatever a state makes the estimators raise is the state's fault: they were given no data yet
            return f"the estimators cannot go on from it ({type(error).__name__})"


def _wrong(value: Any, place: str, now: float) -> Iterator[str]:
    """Sentences about numbers that cannot be."""
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        kind = type(value)
        for name, part in zip(value._fields, value, strict=True):
            here = f"{place}.{name}"
            if name in _TIMES and isinstance(part, float) and part > now + _ROUNDING:
                yield f"{here} is {part:g} s, after its last sample at {now:g} s"
            for names, fits in (
                (_whole(kind, name), _finite),
                (_NOT_NEGATIVE.get(kind, ()), lambda x: not np.any(np.asarray(x) < 0)),
                (_POSITIVE.get(kind, ()), lambda x: bool(np.all(np.asarray(x) > 0))),
            ):
                if name in names and part is not None and not fits(part):
                    yield f"{here} is no number that it can have"
            yield from _wrong(part, here, now)
    elif isinstance(value, tuple):
        for k, part in enumerate(value):
            yield from _wrong(part, f"{place}[{k}]", now)
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _wrong(part, place, now)
    elif isinstance(value, np.ndarray):
        if (
            value.size
            and value.dtype.kind == "f"
            and not np.nanmax(np.abs(value), initial=0.0) <= _LARGEST**2
        ):
            yield f"{place} holds a number beyond all measure"
        if value.ndim and (len(value) > _MOST_ROWS or (not value.size and max(value.shape) > _MOST_ROWS)):
            yield f"{place} has the shape {value.shape}"
    elif isinstance(value, float) and math.isfinite(value) and abs(value) > _LARGEST**2:
        yield f"{place} is {value:g}"
    elif isinstance(value, int) and abs(value) > _LARGEST:
        yield f"{place} is a number of {len(str(abs(value)))} digits"


def _whole(kind: type, name: str) -> tuple[str, ...]:
    return (name,) if kind in _WHOLE and name not in _WHOLE[kind] else ()


def _finite(part: Any) -> bool:
    if isinstance(part, np.ndarray):
        return bool(np.isfinite(part).all())
    if isinstance(part, float):
        return math.isfinite(part)
    if isinstance(part, tuple) and not hasattr(part, "_fields"):
        return all(map(_finite, part))
    return True


def _misshapen(known: pipeline.Known, vehicle: Vehicle) -> Iterator[str]:
    """Sentences about shapes that are not of this configuration."""
    m, settings = len(TASK_INPUTS[vehicle.driver.task]), vehicle.armax
    for state in known.estimators:
        if isinstance(state, armax.State):
            o = Orders(settings.na, settings.nb, settings.nc, settings.nk)
            yield from _of_armax(state, m, o, settings.forgetting)
        elif isinstance(state, fopdt.State) and (
            state.window.ndim != 2 or any(len(row) != 3 + m for row in state.recent)
        ):
            yield "the window of fopdt has another shape"
    fresh = watch.make(TASK_INPUTS[vehicle.driver.task]).init()
    if len(known.screen.followed) != len(fresh.followed) or len(known.screen.suspicions) != len(
        fresh.suspicions
    ):
        yield "the screen follows other predictors"
    for own, new in zip(known.screen.followed, fresh.followed, strict=True):
        for part, usual in zip(
            (*own.reference, *own.misfit, *own.scatter),
            (*new.reference, *new.misfit, *new.scatter),
            strict=True,
        ):
            if np.asarray(part).shape != np.asarray(usual).shape:
                yield "a predictor of the screen has another shape"
    width = screen_rows.FIRST_INPUT + m
    pending, looks = known.screen.pending, known.screen.looks
    # a look is made as soon as it is full; they are kept until they are a minute old and a window has passed
    if len(pending) >= watch.LOOK or any(len(row) != width for row in pending) or len(looks) > 2 * watch.LATE:
        yield "the rows of the screen have another shape"
    if any(look.shape != (watch.LOOK, width) for look in looks):
        yield "the looks of the screen have another shape"


def _of_armax(state: armax.State, m: int, o: Orders, forgetting: Sequence[float]) -> Iterator[str]:
    k, n, model = len(forgetting), o.count(m), state.model
    if state.past.ndim != 2 or state.past.shape[1] != 3 + m or any(len(row) != 3 + m for row in state.recent):
        yield "the rows of armax have another shape"
    if len(state.movement.mean) != m or len(state.movement.variance) != m:
        yield "the inputs of armax are others"
    if model is None:
        return
    if not np.array_equal(model.forgetting, np.array(forgetting)):
        yield "the memories of armax are others"
    shapes: list[tuple[Any, tuple[int, ...]]] = [
        (model.theta, (k, 1, n)),
        (model.root, (k, n, n)),
        (model.e, (k, 1, o.nc)),
        (model.weights, (2, k)),
        (model.score, (2, n)),
        (model.anchor, (n, n)),
        (model.trust.weights, (k,)),
        (model.trust.leave, (k - 1,)),
        *[(psi, (k, 1, n)) for psi in model.psi],
        *[(taken.psi, (k, 1, n)) for taken in model.block],
        *[(taken.e, (k,)) for taken in model.block],
    ]
    if any(np.shape(part) != shape for part, shape in shapes):
        yield "the model of armax has another shape"
    if len(model.psi) != o.nc or len(model.block) >= armax_recursive.BLOCK or len(model.u) not in (0, m):
        yield "the lags of armax have another shape"
    if not abs(sum(model.trust.weights) - 1.0) < 1e-6:
        yield "the weights of armax do not add up to one"
    if not np.abs(model.theta).max(initial=0.0) <= _LARGEST:
        yield "the parameters of armax are beyond all measure"


def _tried(known: pipeline.Known, vehicle: Vehicle, dt: float) -> str:
    """Let the estimators run on, on samples that mean nothing."""
    names = TASK_INPUTS[vehicle.driver.task]
    estimators, screen = pipeline.estimators(vehicle, dt), watch.make(names)
    _, pause = downtime.resume(known.time, dt, len(names))
    states = [one.step(of, pause)[0] for one, of in zip(estimators, known.estimators, strict=True)]
    watching, _ = screen.step(known.screen, pause)
    agreed = known.agreement
    for k in range(1, _TRIAL + 1):
        sample = _sample(pause.t + k * dt, pause.segment, k, len(names))
        said = []
        for place, one in enumerate(estimators):
            states[place], estimate = one.step(states[place], sample)
            said += [estimate] if estimate is not None else []
        agreed, told = agreement.step(agreed, said)
        watching, _ = screen.step(watching, sample)
        for estimate in told:
            if not _sensible(estimate):
                return f"{estimate.estimator} says numbers without sense from it"
    return ""


def _sample(t: float, segment: int, k: int, inputs: int) -> Sample:
    """A driver who answers a little; nothing of it is kept."""
    moved = 0.5 * math.sin(0.13 * k)
    output = 20.0 + 3.0 * math.sin(0.13 * k - 0.5) + 0.3 * math.sin(1.7 * k)
    signals = {
        "speed": 20.0 + moved,
        "gap": 30.0 + moved,
        "range_rate": moved,
        "pedal": output,
        "accel": 0.1 * moved,
    }
    return Sample(t, output, (moved, 0.7 * math.sin(0.21 * k))[:inputs], Gate.OPEN, True, segment, signals)


def _sensible(estimate: Estimate) -> bool:
    if estimate.status is not Status.OK:
        return True
    for channel in estimate.channels.values():
        for interval in (channel.K, channel.tau, channel.dead_time, channel.tau_plus_dead_time):
            ends = [x for x in interval if x == x]
            if ends and (
                len(ends) < len(interval)
                or not interval.low <= interval.high
                or max(map(abs, ends)) > _LARGEST
            ):
                return False
    return not estimate.headline or any(
        channel.K.value == channel.K.value for channel in estimate.channels.values()
    )
