"""ARMAX live: a short batch start, then recursive prediction errors, frozen while nothing is to be learnt.

The mathematics is in identification/armax_batch.py, armax_recursive.py, memories.py and moments.py.
"""

from __future__ import annotations

import math
import operator
from typing import NamedTuple

import numpy as np

from canid.estimators import status
from canid.identification import armax_batch, armax_recursive, moments, residuals
from canid.types import (
    AnyEstimator,
    ArmaxSettings,
    Array,
    Channel,
    Estimate,
    Estimator,
    Gate,
    Identifiable,
    ResidualTests,
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

# When the data are this many times those of the start, the recursion begins anew from a batch fit of all of
# them: its own first steps were taken from rough parameters, which costs C 3 % after a minute.
AGAIN = 2

# s; over which the fit in percent is formed: the length of the window that the FOPDT estimator uses.
FIT = 60.0

# s of residuals that are tested, and below which they are not: 2.5 s of lags need ten times as much.
TESTED = 60.0
TESTABLE = 25.0

# s; after a longer break what is told is said to be from before it, until `status.ENOUGH` seconds have confirmed it.
BREAK = 60.0


# Rows that are put to those before together, asked for or not: an array for each would cost more than what it holds.
FOLD = 64


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


class Learnt(NamedTuple):
    """When was learnt."""

    used: float = 0.0  # s of data in all
    t: float = math.nan  # s, of the last sample learnt from
    pause: float = 0.0  # s, length of the last long break
    since: float = math.inf  # s of data since then


class State(NamedTuple):
    """What the next step needs. Rows are (piece, innovation, output, inputs...), a piece of NaN not to be learnt."""

    closed: status.Closed
    t: float  # s, of the last sample
    segment: int  # of the inputs' history
    piece: int  # grows with every interruption
    past: Array  # (n, 3 + m) rows on the grid, read only
    recent: tuple[tuple[float, ...], ...]  # rows since then, no more than `FOLD`
    due: int  # samples to learn from, of these rows, at which the next batch fit is made; 0: none any more
    model: armax_recursive.State | None
    learnt: Learnt
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
    memories = settings.forgetting
    if m < 1 or not dt > 0.0 or min(o) < 0 or o.nb < 1 or o.na < 1:
        raise ValueError(f"inputs {input_names}, dt = {dt} s, {settings}: na, nb >= 1")
    if (
        not memories
        or list(memories) != sorted(set(memories))
        or not 0.5 < memories[0] <= memories[-1] <= 1.0
    ):
        raise ValueError(f"forgetting {memories}: one or more in (0.5, 1], ascending")
    # the start needs at least five samples per parameter, whatever the settings say
    first = max(round(settings.start / dt), 6 * o.count(m))
    look = dt / LOOK
    fade = dt / FIT
    still = [(STILL * status.usual(name)) ** 2 for name in input_names]
    tested = round(TESTED / dt)
    empty = np.zeros((0, 3 + m))

    def init() -> State:
        nothing = Movement(0, (0.0,) * m, (0.0,) * m)
        quality = Quality((), math.nan, 0.0, 0.0)
        return State(status.Closed(), math.nan, 0, 0, empty, (), first, None, Learnt(), nothing, quality)

    def step(state: State, sample: Sample) -> tuple[State, Estimate | None]:
        state, due = advance(state, sample)
        return tell(state, sample) if due else (state, None)

    def advance(state: State, sample: Sample) -> tuple[State, bool]:
        if not math.isfinite(sample.t) or sample.t <= state.t:
            return state, False
        gap = sample.segment != state.segment or sample.t - state.t > 1.5 * dt
        usable = sample.learn and all(map(math.isfinite, (sample.output, *sample.inputs)))
        if gap or not usable:
            state = _interrupt(state)
        closed, forced = status.step(state.closed, sample)
        missing = _missing(state, sample)
        state, row = _take(state, sample) if usable else (state, (math.nan, math.nan))
        recent = (*state.recent, *missing, (*row, sample.output, *sample.inputs))
        state = state._replace(closed=closed, t=sample.t, segment=sample.segment, recent=recent)
        state = _fold(state) if len(recent) >= FOLD else state
        if forced is not None:
            if not status.due(closed, sample.t, forced):
                return state, False
            return state._replace(closed=status.said(closed, sample.t, forced)), True
        if not status.told_by_gate(closed) and sample.t - closed.emitted < status.EVERY - status.ROUNDING:
            return state, False
        state = _fitted(_fold(state)) if state.due else state
        return state._replace(closed=status.said(closed, sample.t, Status.OK)), True

    def tell(state: State, sample: Sample) -> tuple[State, Estimate]:
        forced = state.closed.kind
        if forced is not None and status.told_by_gate(state.closed):
            return state, status.silent(sample.t, NAME, forced, sample.gate.value, input_names)
        state = _fold(state)
        estimate = _estimate(state, sample)
        return state._replace(closed=status.said(state.closed, sample.t, estimate.status)), estimate

    def _interrupt(state: State) -> State:
        model = armax_recursive.rest(state.model) if state.model is not None else None
        return state._replace(
            piece=state.piece + 1, model=model, quality=state.quality._replace(simulated=())
        )

    def _missing(state: State, sample: Sample) -> tuple[tuple[float, ...], ...]:
        """Rows for grid times that never came."""
        if not math.isfinite(state.t):
            return ()
        return ((math.nan,) * (3 + m),) * min(round((sample.t - state.t) / dt) - 1, tested)

    def _fold(state: State) -> State:
        if not state.recent:
            return state
        past = np.concatenate([state.past, np.array(state.recent).reshape(-1, 3 + m)])
        # while a batch fit is to come, twice what it needs, for the samples that it may not learn from
        past = past[-max(tested, 2 * state.due) :]
        past.setflags(write=False)
        return state._replace(past=past, recent=())

    def _take(state: State, sample: Sample) -> tuple[State, tuple[float, float]]:
        movement = _moved(state.movement, sample.inputs)
        piece = float(state.piece)
        before = state.model
        if before is None:
            state = state._replace(movement=movement, learnt=_learnt(state.learnt, sample.t))
            return state, (piece, math.nan)
        learn = _excited(movement)
        model, innovation = armax_recursive.step(before, o, sample.output, sample.inputs, learn)
        if not learn:
            return state._replace(movement=movement, model=model), (math.nan, innovation)
        if model.restarts > before.restarts:
            # what came before is of another driver, or another manner: collect anew for a fit of the new one
            state = state._replace(past=empty, recent=(), due=AGAIN * first)
        return state._replace(
            movement=movement,
            model=model,
            quality=_simulated(state.quality, before, sample),
            learnt=_learnt(state.learnt, sample.t),
        ), (piece, innovation)

    def _learnt(before: Learnt, t: float) -> Learnt:
        pause = t - before.t
        if pause > BREAK:
            return Learnt(before.used + dt, t, pause, dt)
        return Learnt(before.used + dt, t, before.pause, before.since + dt)

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
        return any(map(operator.gt, movement.variance, still))

    def _simulated(quality: Quality, model: armax_recursive.State, sample: Sample) -> Quality:
        """Run the model, as it was before this sample, on its own past outputs beside the measured one."""
        past, output = quality.simulated, sample.output
        if len(past) < o.na or not model.u or len(model.u[0]) < o.nb + o.nk - 1:
            return quality._replace(simulated=(output, *past)[: o.na])
        theta = armax_recursive.leading(model)
        y = -sum(map(operator.mul, theta, past)) + theta[o.na + m * o.nb]
        k = o.na
        for now, before in zip(sample.inputs, model.u, strict=True):
            for x in (now, *before)[o.nk :]:
                y += theta[k] * x
                k += 1
        away = output - (quality.mean if math.isfinite(quality.mean) else output)
        return Quality(
            # a simulation that runs away starts again from what was measured
            ((y if abs(y) < 1e6 else output), *past)[: o.na],
            output - away + fade * away,
            (1.0 - fade) * (quality.power + fade * away * away),
            (1.0 - fade) * quality.error + fade * min((output - y) ** 2, 1e12),
        )

    def _fitted(state: State) -> State:
        """Make a batch fit where one is due."""
        piece, output, inputs = state.past[:, 0], state.past[:, 2], state.past[:, 3:]
        usable = np.isfinite(piece)
        if usable.sum() < state.due or not _excited(state.movement):
            return state
        fit = armax_batch.fit_armax(
            output, inputs, usable, o, segment=np.where(usable, piece, -1.0).astype(np.int64)
        )
        try:
            model = armax_recursive.begin(fit, memories) if fit is not None else None
        except ValueError:  # not every parameter is excited yet
            model = None
        if state.model is not None:  # else the start is tried again with the next samples
            model = state.model if model is None else model._replace(restarts=state.model.restarts)
        elif model is None:
            return state
        return state._replace(model=model, due=AGAIN * first if state.due == first else 0)

    def _estimate(state: State, sample: Sample) -> Estimate:
        used = state.learnt.used
        excitation = {name: v**0.5 for name, v in zip(input_names, state.movement.variance, strict=True)}

        def silent(kind: Status, says: str) -> Estimate:
            why = sample.gate.value if sample.gate is not Gate.OPEN else says
            plain = status.silent(sample.t, NAME, kind, why, input_names)
            return plain._replace(excitation=excitation, used=used)

        if used < max(status.ENOUGH, first * dt) - 0.5 * dt:
            enough = max(status.ENOUGH, first * dt)
            return silent(Status.CONVERGING, f"{used:.0f} s of {enough:.0f} s of data: keep following")
        if state.model is None or not _excited(state.movement):
            return silent(Status.NOT_EXCITED, status.hardly_moved(excitation))
        tests = _tests(state.past[-tested:])
        doubt = residuals.doubt(tests)
        # Such a model cannot give this driver's answer: a resonance of 0.5 to 1 Hz in the noise bends K and tau far
        # beyond their intervals. In 373 windows of simulated car following both happened together once.
        if tests is not None and tests.left_over and doubt > 1.0:
            says = (
                f"{', '.join(tests.left_over).replace('_', ' ')}: the residuals still hold an answer that a model of "
                "these orders cannot give; read no number, or set higher orders in [armax]"
            )
            return silent(Status.INCONSISTENT, says)._replace(says=says, residual_tests=tests)
        channels = _channels(state.model, doubt)
        if all(c.status is Identifiable.NOT for c in channels.values()):
            return silent(Status.NOT_EXCITED, status.hardly_moved(excitation))
        q = state.quality
        fit = 100.0 * (1.0 - (q.error / q.power) ** 0.5) if q.power > 0.0 else math.nan
        says = status.what_is_told(channels)
        if state.learnt.since < status.ENOUGH - 0.5 * dt:
            says += f"; from before a break of {_duration(state.learnt.pause)}, not yet confirmed"
        return Estimate(sample.t, NAME, Status.OK, says, channels, fit, excitation, used, tests)

    def _channels(model: armax_recursive.State, doubt: float) -> dict[str, Channel]:
        theta, covariance = armax_recursive.told(model)
        longest, now, before = armax_recursive.longest(model)
        A = np.concatenate([[1.0], theta[: o.na]])
        B = theta[o.na : o.na + m * o.nb].reshape(-1, o.nb)
        channels = moments.channels(input_names, A, B, o.nk, doubt * covariance, dt)
        always = moments.anytime_gain(
            longest, doubt * now, doubt * before, model.anchored, na=o.na, nb=o.nb, inputs=m
        )
        return {
            name: c._replace(K_anytime=K) if c.status is not Identifiable.NOT else c
            for (name, c), K in zip(channels.items(), always, strict=True)
        }

    def _tests(rows: Array) -> ResidualTests | None:
        if np.isfinite(rows[:, 1]).sum() * dt < TESTABLE:
            return None
        return residuals.look(rows[:, 1], rows[:, 3:], input_names, o.na + o.nc)

    return Estimator(NAME, init, step, advance, tell)


def _duration(seconds: float) -> str:
    """Say how long, as one reads it at a glance.

    >>> _duration(75.0), _duration(1200.0)
    ('75 s', '20 min')
    """
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
