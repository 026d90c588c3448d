"""ARMAX live: a short batch start, then recursive prediction errors, frozen while nothing is to be learnt.

The mathematics is in identification/armax_batch.py, armax_recursive.py and moments.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.estimators import status
from canid.identification import armax_batch, armax_recursive, moments
from canid.types import (
    AnyEstimator,
    ArmaxSettings,
    Channel,
    Estimate,
    Estimator,
    Gate,
    Identifiable,
    Sample,
    Status,
)

NAME = "armax"

# s; over which the inputs' movement is judged: the period of the slowest traffic waves that still teach a
# lag.
LOOK = 20.0

# An input that moves less than this share of what it usually does (status.usual) is below sensor noise:
# learning from it would learn the noise.
STILL = 0.05

# Buffers of the start are kept to this many times its length: if the first seconds did not excite, later
# ones may.
PATIENCE = 4


class Movement(NamedTuple):
    """Exponentially weighted mean and variance of each input."""

    samples: int
    mean: tuple[float, ...]
    variance: tuple[float, ...]


class Quality(NamedTuple):
    """How well the simulated answer follows: exponentially weighted powers."""

    simulated: tuple[float, ...]  # the model's own past outputs, newest first
    mean: float  # of the output
    power: float  # of the output about its mean
    error: float  # of output minus simulation


class State(NamedTuple):
    """What the next step needs."""

    closed: status.Closed
    t: float  # s, of the last sample
    segment: int  # of the inputs' history
    piece: int  # grows with every interruption
    rows: tuple[tuple[float, ...], ...]  # (piece, output, inputs...), until the start is made
    model: armax_recursive.State | None
    used: float  # s of data learnt from
    movement: Movement
    quality: Quality


def make(
    input_names: tuple[str, ...],
    dt: float,
    settings: ArmaxSettings = ArmaxSettings(),
) -> AnyEstimator:
    """Build the ARMAX estimator.

    Args:
        input_names: in the order of `Sample.inputs`.
        dt: s, the grid of the samples.
        settings: orders, start and forgetting.

    Raises:
        ValueError: settings that make no sense.

    >>> estimator = make(("range_rate",), 0.1)
    >>> state, estimate = estimator.step(estimator.init(), Sample(0.0, 20.0, (0.1,), Gate.OPEN, True, 0, {}))
    >>> estimate.says
    '0 s of 20 s of data: keep following'
    """
    m = len(input_names)
    o = armax_batch.Orders(settings.na, settings.nb, settings.nc, settings.nk)
    if m < 1 or not dt > 0.0 or not 0.5 < settings.forgetting <= 1.0 or min(o) < 0 or o.nb < 1 or o.na < 1:
        raise ValueError(
            f"inputs {input_names}, dt = {dt} s, {settings}: na, nb >= 1, forgetting in (0.5, 1]"
        )
    # the start needs at least five samples per parameter, whatever the settings say
    first = max(round(settings.start / dt), 6 * o.count(m))
    look = dt / LOOK
    fade = 1.0 - settings.forgetting if settings.forgetting < 1.0 else look

    def init() -> State:
        nothing = Movement(0, (0.0,) * m, (0.0,) * m)
        return State(status.Closed(), math.nan, 0, 0, (), None, 0.0, nothing, Quality((), math.nan, 0.0, 0.0))

    def step(state: State, sample: Sample) -> tuple[State, Estimate | None]:
        if not math.isfinite(sample.t) or sample.t <= state.t:
            return state, None
        gap = sample.segment != state.segment or sample.t - state.t > 1.5 * dt
        usable = sample.learn and all(map(math.isfinite, (sample.output, *sample.inputs)))
        if gap or not usable:
            state = _interrupt(state)
        closed, forced = status.step(state.closed, sample)
        state = state._replace(closed=closed, t=sample.t, segment=sample.segment)
        if usable:
            state = _take(state, sample)
        if forced is not None:
            if not status.due(closed, sample.t, forced):
                return state, None
            said = status.said(closed, sample.t, forced)
            return state._replace(closed=said), status.silent(
                sample.t, NAME, forced, sample.gate.value, input_names
            )
        gate_spoke = closed.kind in (Status.NO_DRIVER, Status.NO_LEAD, Status.STALE)
        if not gate_spoke and sample.t - closed.emitted < status.EVERY - status.ROUNDING:
            return state, None
        if state.model is None and len(state.rows) >= first:
            state = _start(state)
        estimate = _estimate(state, sample)
        return state._replace(closed=status.said(closed, sample.t, estimate.status)), estimate

    def _interrupt(state: State) -> State:
        model = armax_recursive.rest(state.model) if state.model is not None else None
        return state._replace(
            piece=state.piece + 1, model=model, quality=state.quality._replace(simulated=())
        )

    def _take(state: State, sample: Sample) -> State:
        movement = _moved(state.movement, sample.inputs)
        if state.model is None:
            row = (float(state.piece), sample.output, *sample.inputs)
            return state._replace(
                rows=(*state.rows, row)[-PATIENCE * first :], movement=movement, used=state.used + dt
            )
        learn = _excited(movement)
        model, _ = armax_recursive.step(
            state.model, o, sample.output, sample.inputs, settings.forgetting, learn
        )
        quality = _simulated(state.quality, state.model, sample) if learn else state.quality
        used = state.used + dt if learn else state.used
        return state._replace(model=model, movement=movement, quality=quality, used=used)

    def _moved(before: Movement, inputs: tuple[float, ...]) -> Movement:
        # the first samples weigh alike, later ones fade: no start value that would count as movement
        count = before.samples + 1
        w = max(look, 1.0 / count)
        away = [x - mean for x, mean in zip(inputs, before.mean, strict=True)]
        return Movement(
            count,
            tuple([mean + w * d for mean, d in zip(before.mean, away, strict=True)]),
            tuple([(1.0 - w) * (v + w * d * d) for v, d in zip(before.variance, away, strict=True)]),
        )

    def _excited(movement: Movement) -> bool:
        return any(
            v > (STILL * status.usual(name)) ** 2
            for name, v in zip(input_names, movement.variance, strict=True)
        )

    def _simulated(quality: Quality, model: armax_recursive.State, sample: Sample) -> Quality:
        """Run the model, as it was before this sample, on its own past outputs beside the measured one."""
        past, output = quality.simulated, sample.output
        if len(past) < o.na or not model.u or len(model.u[0]) < o.nb + o.nk - 1:
            return quality._replace(simulated=(output, *past)[: o.na])
        theta = model.theta
        y = -sum(a * x for a, x in zip(theta, past, strict=False)) + theta[o.na + m * o.nb]
        for i, (now, before) in enumerate(zip(sample.inputs, model.u, strict=True)):
            lagged = (now, *before)[o.nk :]
            for b, x in zip(theta[o.na + i * o.nb :][: o.nb], lagged, strict=False):
                y += b * x
        away = output - (quality.mean if math.isfinite(quality.mean) else output)
        return Quality(
            # a simulation that runs away starts again from what was measured
            ((y if abs(y) < 1e6 else output), *past)[: o.na],
            output - away + fade * away,
            (1.0 - fade) * (quality.power + fade * away * away),
            (1.0 - fade) * quality.error + fade * min((output - y) ** 2, 1e12),
        )

    def _start(state: State) -> State:
        rows = np.array(state.rows)
        if not _excited(state.movement):
            return state
        fit = armax_batch.fit_armax(
            rows[:, 1], rows[:, 2:], np.full(len(rows), True), o, segment=rows[:, 0].astype(np.int64)
        )
        if fit is None:
            return state
        try:
            model = armax_recursive.begin(fit)
        except ValueError:  # not every parameter is excited yet
            return state
        return state._replace(model=model, rows=())

    def _estimate(state: State, sample: Sample) -> Estimate:
        excitation = {name: v**0.5 for name, v in zip(input_names, state.movement.variance, strict=True)}

        def silent(kind: Status, says: str) -> Estimate:
            why = sample.gate.value if sample.gate is not Gate.OPEN else says
            plain = status.silent(sample.t, NAME, kind, why, input_names)
            return plain._replace(excitation=excitation, used=state.used)

        if state.used < max(status.ENOUGH, first * dt) - 0.5 * dt:
            enough = max(status.ENOUGH, first * dt)
            return silent(Status.CONVERGING, f"{state.used:.0f} s of {enough:.0f} s of data: keep following")
        if state.model is None or not _excited(state.movement):
            return silent(Status.NOT_EXCITED, status.hardly_moved(excitation))
        channels = _channels(state.model)
        if all(c.status is Identifiable.NOT for c in channels.values()):
            return silent(Status.NOT_EXCITED, status.hardly_moved(excitation))
        q = state.quality
        fit = 100.0 * (1.0 - (q.error / q.power) ** 0.5) if q.power > 0.0 else math.nan
        return Estimate(
            sample.t, NAME, Status.OK, status.what_is_told(channels), channels, fit, excitation, state.used
        )

    def _channels(model: armax_recursive.State) -> dict[str, Channel]:
        theta, covariance = np.array(model.theta), armax_recursive.covariance(model)
        A = np.concatenate([[1.0], theta[: o.na]])
        B = theta[o.na : o.na + len(input_names) * o.nb].reshape(-1, o.nb)
        return moments.channels(input_names, A, B, o.nk, covariance, dt)

    return Estimator(NAME, init, step)
