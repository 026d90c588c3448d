"""ARMAX live: a short batch start, then recursive prediction errors, frozen while nothing is to be learnt.

The mathematics is in identification/armax: armax_batch.py, armax_recursive.py, forgetting_mixture.py,
gain_and_delay.py. The state is in armax_state.py, the model of a whole drive in armax_whole_drive.py.
"""

from __future__ import annotations

import math
import operator
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from canid.mathematics.estimators import (
    agreement,
    armax_separate,
    armax_whole_drive,
    plausibility,
    pooling,
    status,
)
from canid.mathematics.estimators.armax_state import (
    Quality,
    Setup,
    State,
    check_state,
    init,
    is_excited,
    moved,
    unconfirmed,
    with_sample,
)
from canid.mathematics.estimators.estimator import Estimator, WholeDrive
from canid.mathematics.identification import feedback_bias, identifiability, residual_tests
from canid.mathematics.identification.armax import (
    armax_batch,
    armax_recursive,
    arx_recursive,
    forgetting_mixture,
    gain_and_delay,
    rates,
)
from canid.mathematics.identification.fopdt import fopdt_fit
from canid.values.types import (
    Array,
    Channel,
    Estimate,
    Identifiable,
    Latency,
    LearnGate,
    OutputFilter,
    ResidualTests,
    Sample,
    Status,
    Trace,
)

NAME = "armax"

# s; ends of the ranges of tau and dead time with several inputs, as FOPDT's
TAU_MAX_S = 3.0
DEAD_TIME_MAX_S = 1.5

# When the data are this many times those of the start, the recursion begins anew from a batch fit of all of
# them: its own first steps were taken from rough parameters, which costs C 3 % after a minute.
SECOND_START = 2

# s; over which the fit in percent is formed: the length of the window that the FOPDT estimator uses.
FIT_MEMORY_S = 60.0

# s of residuals that are tested, and below which they are not: 2.5 s of lags need ten times as much.
TESTED_S = 60.0
MIN_TESTED_S = 25.0

# Rows that are put to those before together, asked for or not: an array for each would cost more than what it holds.
MAX_PENDING_ROWS = 64


# --- settings --------------------------------------------------------------------------------------


def _one_or_several(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else (value,) if isinstance(value, int | float) else value


def _ascending(value: tuple[float, ...]) -> tuple[float, ...]:
    if list(value) != sorted(set(value)):
        raise ValueError("must ascend, the longest memory last")
    return value


# Below 0.5 a sample counts less than half as soon as the next one comes: no estimate would be left.
Forgetting = Annotated[float, Field(gt=0.5, le=1, allow_inf_nan=False)]
# one number, or several memories at once
Memories = Annotated[
    tuple[Forgetting, ...],
    Field(min_length=1, max_length=8),
    BeforeValidator(_one_or_several),
    AfterValidator(_ascending),
]


class ArmaxSettings(NamedTuple):
    """Orders of A(q) y = B(q) u + C(q) e (Chen & Ulsoy 2001, eq. 1 and 3), and memories."""

    na: Annotated[int, Field(ge=1, le=10)] = 2
    nb: Annotated[int, Field(ge=1, le=10)] = 2
    nc: Annotated[int, Field(ge=0, le=10)] = 1
    nk: Annotated[int, Field(ge=0, le=50)] = 1  # dead time in samples
    # s of data for the batch start
    start: Annotated[float, Field(ge=1.0, le=600.0, allow_inf_nan=False)] = 15.0
    forgetting: Memories = armax_recursive.FORGETTING  # per tenth of a second, ascending
    output_filter: OutputFilter | None = (
        None  # from [driver]: how the output was smoothed; None: nothing is known
    )
    latency: Latency | None = None  # from [lead]: of the radar; added to dead times

    @property
    def orders(self) -> armax_batch.Orders:
        """Orders of the polynomials."""
        return armax_batch.Orders(self.na, self.nb, self.nc, self.nk)


def configure(input_names: tuple[str, ...], dt: float, settings: ArmaxSettings) -> Setup:
    """Check the settings.

    Raises:
        ValueError: settings that make no sense.
    """
    m, o, memories = len(input_names), settings.orders, settings.forgetting
    if m < 1 or not dt > 0.0 or min(o) < 0 or o.nb < 1 or o.na < 1:
        raise ValueError(f"inputs {input_names}, dt = {dt} s, {settings}: na, nb >= 1")
    if (
        not memories
        or list(memories) != sorted(set(memories))
        or not 0.5 < memories[0] <= memories[-1] <= 1.0
    ):
        raise ValueError(f"forgetting {memories}: one or more in (0.5, 1], ascending")
    count = pooling.per_row(dt)
    step = count * dt if count > 1 else dt
    # the start needs at least five samples per parameter, whatever the settings say
    start = max(round(settings.start / step), 6 * o.count(m))
    layout = fopdt_fit.row_layout(m, step, TAU_MAX_S, DEAD_TIME_MAX_S) if m == 2 else None
    forgetting = rates.per_sample(memories, step)
    return Setup(input_names, step, o, forgetting, start, dt, count, layout, settings.output_filter)


# --- one sample ------------------------------------------------------------------------------------


def advance(setup: Setup, state: State, sample: Sample) -> tuple[State, bool]:
    """Take a sample; whether an estimate is due."""
    if not math.isfinite(sample.t) or sample.t <= state.t:
        return state, False
    pool, row = pooling.step(state.pool, sample, setup.grid, setup.per_row)
    # on a grid of a tenth of a second nothing is pooled
    state = state if pool is state.pool else state._replace(pool=pool)
    return _advanced(setup, state, row) if row is not None else (state, False)


def _advanced(setup: Setup, state: State, sample: Sample) -> tuple[State, bool]:
    if setup.layout is not None:
        return armax_separate.advance(setup, setup.layout, state, sample)
    gap = sample.segment != state.segment or sample.t - state.t > 1.5 * setup.dt
    usable = sample.learn and all(map(math.isfinite, (sample.output, *sample.inputs)))
    if gap or not usable:
        state = _interrupted(setup, state)
    pace, forced = status.by_gate(state.pace, sample)
    missing = _missing(setup, state, sample)
    state, row = _learn(setup, state, sample) if usable else (state, (math.nan, math.nan))
    recent = (*state.recent, *missing, (*row, sample.output, *sample.inputs))
    state = state._replace(pace=pace, t=sample.t, segment=sample.segment, recent=recent)
    state = _stored(setup, state) if len(recent) >= MAX_PENDING_ROWS else state
    if forced is not None:
        if not status.due(pace, sample.t, forced):
            return state, False
        return state._replace(pace=status.emitted(pace, sample.t, forced)), True
    if not status.due_from_data(pace, sample.t):
        return state, False
    state = _fitted(setup, _stored(setup, state)) if state.due else state
    return state._replace(pace=status.emitted(pace, sample.t, Status.OK)), True


def estimate(setup: Setup, state: State, sample: Sample) -> tuple[State, Estimate]:
    """Make the estimate that is due."""
    forced = state.pace.kind
    if forced is not None and status.of_gate(state.pace):
        says = sample.gate.value
        return state, status.without_numbers(sample.t, NAME, forced, says, setup.input_names)
    state = _stored(setup, state) if setup.layout is None else state
    made = _from_data(setup, state, sample)
    return state._replace(pace=status.emitted(state.pace, sample.t, made.status)), made


def _interrupted(setup: Setup, state: State) -> State:
    """Forget the inputs' history, keep the model."""
    model = armax_recursive.rest(state.model) if state.model is not None else None
    arx = arx_recursive.rest(setup.arx, state.arx, setup.forgetting) if state.arx is not None else None
    quality = state.quality._replace(simulated=())
    return state._replace(piece=state.piece + 1, model=model, arx=arx, quality=quality)


def _tested_rows(setup: Setup) -> int:
    return round(TESTED_S / setup.dt)


def _missing(setup: Setup, state: State, sample: Sample) -> tuple[tuple[float, ...], ...]:
    """Rows for grid times that never came."""
    if not math.isfinite(state.t):
        return ()
    count = min(round((sample.t - state.t) / setup.dt) - 1, _tested_rows(setup))
    return ((math.nan,) * setup.width,) * count


def _stored(setup: Setup, state: State) -> State:
    """Put the pending rows to those before."""
    if not state.recent:
        return state
    past = np.concatenate([state.past, np.array(state.recent).reshape(-1, setup.width)])
    # while a batch fit is to come, twice what it needs, for the samples that it may not learn from
    past = past[-max(_tested_rows(setup), 2 * state.due) :]
    past.setflags(write=False)
    return state._replace(past=past, recent=())


# --- learning --------------------------------------------------------------------------------------


def _learn(setup: Setup, state: State, sample: Sample) -> tuple[State, tuple[float, float]]:
    """Step the recursion; returns piece and innovation of the new row."""
    movement = moved(setup, state.movement, sample.inputs)
    excited = is_excited(setup, movement)
    piece = float(state.piece)
    before = state.model
    assert state.arx is not None
    row = (float(excited), sample.output, *sample.inputs)
    arx = arx_recursive.step(setup.arx, state.arx, setup.forgetting, row)
    state = state._replace(arx=arx)
    if before is None:
        learnt = with_sample(setup, state.learnt, sample.t)
        return state._replace(movement=movement, learnt=learnt), (piece, math.nan)
    model, innovation = armax_recursive.step(
        before, setup.orders, sample.output, sample.inputs, excited, setup.dt
    )
    if not excited:
        return state._replace(movement=movement, model=model), (math.nan, innovation)
    if model.restarts > before.restarts:
        # what came before is of another driver, or another manner: collect anew for a fit of the new one
        empty = np.zeros((0, setup.width))
        best = max(range(len(setup.forgetting) - 1), key=model.trust.weights.__getitem__)
        due, arx = SECOND_START * setup.start, arx_recursive.renewed(arx, best)
        state = state._replace(past=empty, recent=(), due=due, arx=arx)
    return state._replace(
        movement=movement,
        model=model,
        quality=_simulated(setup, state.quality, before, sample),
        learnt=with_sample(setup, state.learnt, sample.t),
    ), (piece, innovation)


def _simulated(setup: Setup, quality: Quality, model: armax_recursive.State, sample: Sample) -> Quality:
    """Run the model, as it was before this sample, on its own past outputs next to the measured one."""
    o, past, output = setup.orders, quality.simulated, sample.output
    if len(past) < o.na or not model.u or len(model.u[0]) < o.nb + o.nk - 1:
        return quality._replace(simulated=(output, *past)[: o.na])
    theta = armax_recursive.leading(model)
    y = -sum(map(operator.mul, theta, past)) + theta[o.na + len(sample.inputs) * o.nb]
    k = o.na
    for now, before in zip(sample.inputs, model.u, strict=True):
        for x in (now, *before)[o.nk :]:
            y += theta[k] * x
            k += 1
    fade = setup.dt / FIT_MEMORY_S
    away = output - (quality.mean if math.isfinite(quality.mean) else output)
    return Quality(
        # a simulation that runs away starts again from what was measured
        ((y if abs(y) < 1e6 else output), *past)[: o.na],
        output - away + fade * away,
        (1.0 - fade) * (quality.power + fade * away * away),
        (1.0 - fade) * quality.error + fade * min((output - y) ** 2, 1e12),
    )


def _fitted(setup: Setup, state: State) -> State:
    """Make a batch fit where one is due."""
    piece, output, inputs = state.past[:, 0], state.past[:, 2], state.past[:, 3:]
    usable = np.isfinite(piece)
    if usable.sum() < state.due or not is_excited(setup, state.movement):
        return state
    segment = np.where(usable, piece, -1.0).astype(np.int64)
    fit = armax_batch.fit_armax(output, inputs, usable, setup.orders, segment=segment, dt=setup.dt)
    try:
        model = armax_recursive.begin(fit, setup.forgetting, dt=setup.dt) if fit is not None else None
    except ValueError:  # not every parameter is excited yet
        model = None
    if state.model is not None:  # else the start is tried again with the next samples
        model = state.model if model is None else model._replace(restarts=state.model.restarts)
    elif model is None:
        return state
    return state._replace(model=model, due=SECOND_START * setup.start if state.due == setup.start else 0)


# --- estimating ------------------------------------------------------------------------------------


def _from_data(setup: Setup, state: State, sample: Sample) -> Estimate:
    names, used = setup.input_names, state.learnt.used
    excitation = {name: v**0.5 for name, v in zip(names, state.movement.variance, strict=True)}

    def refused(kind: Status, says: str) -> Estimate:
        # brief gates: say why no more data come
        why = sample.gate.value if sample.gate is not LearnGate.OPEN else says
        plain = status.without_numbers(sample.t, NAME, kind, why, names)
        return plain._replace(excitation=excitation, used=used)

    # half a sample: sums of 0.1 s
    known = _known_s(setup, state) + 0.5 * setup.dt
    weak = status.by_data(known, setup.needed, excitation, is_excited(setup, state.movement))
    if weak is not None:
        return refused(*weak)
    if setup.layout is not None:
        return armax_separate.estimate(setup, setup.layout, state, sample, excitation, refused)
    if state.model is None:
        return refused(*status.by_fit({}, excitation))
    tests = _residual_tests(setup, state.past[-_tested_rows(setup) :])
    inflation = residual_tests.variance_inflation(tests)
    # Such a model cannot give this driver's answer: a resonance of 0.5 to 1 Hz in the noise bends K and tau far
    # beyond their intervals. In 373 windows of simulated car following both happened together once.
    if tests is not None and tests.left_over and inflation > 1.0:
        says = (
            f"{', '.join(tests.left_over).replace('_', ' ')}: the residuals still hold a response that a model of "
            "these orders cannot give: do not use these numbers, or set higher orders in [armax]"
        )
        return refused(Status.INCONSISTENT, says)._replace(says=says, residual_tests=tests)
    channels, late = _channels(setup, state, inflation)
    if late:
        return refused(Status.INCONSISTENT, late)._replace(says=late, residual_tests=tests)
    q = state.quality
    fit = 100.0 * (1.0 - (q.error / q.power) ** 0.5) if q.power > 0.0 else math.nan
    verdict = plausibility.judge(channels, fit, plausibility.UNLIMITED)
    kind, says = status.by_fit(channels, excitation, *verdict)
    if kind is not Status.OK:
        made = refused(kind, says)
        # what was found against a model is the reason, whatever the gate says just now
        return made._replace(says=says, residual_tests=tests) if verdict.refused else made
    says += unconfirmed(setup, state.learnt)
    channels = identifiability.given_quoted(channels)
    return Estimate(sample.t, NAME, Status.OK, says, channels, fit, excitation, used, tests)


def _known_s(setup: Setup, state: State) -> float:
    """S of data that an estimate rests on: after a change of the driver few."""
    if state.model is None or state.arx is None:
        return state.learnt.used
    shares = forgetting_mixture.shares(state.model.trust)
    return float(shares @ arx_recursive.rows(state.arx)) * setup.dt


def _channels(setup: Setup, state: State, inflation: float) -> tuple[dict[str, Channel], str]:
    """Gains and delays by ARX models, the mean of the memories as far as each is believed; why none holds, if so."""
    assert state.model is not None
    assert state.arx is not None
    shape, shares = setup.arx, np.array(forgetting_mixture.shares(state.model.trust))
    models = arx_recursive.solved(shape, state.arx)
    theta, na = shares @ models.theta, shape.orders[-1]
    away = models.theta - theta
    covariance = np.einsum("k,kij->ij", shares, models.covariance) + (shares[:, None] * away).T @ away
    A, B = np.r_[1.0, theta[:na]], theta[na:].reshape(-1, na)
    names, nk = setup.input_names, setup.orders.nk
    channels = gain_and_delay.channels(names, A, B, nk, inflation * covariance, setup.dt)
    known_s = float(state.arx.weights[0, -1]) * setup.dt
    return {
        name: c._replace(K_anytime=gain_and_delay.anytime(c.K, known_s))
        if c.status is not Identifiable.NOT
        else c
        for name, c in feedback_bias.without_all(channels).items()
    }, _late(setup, state.arx)


def _late(setup: Setup, arx: arx_recursive.State) -> str:
    """Why the input is taken to be recorded late, or the output; "": neither is, by how driver and car answer."""
    driver = arx_recursive.of_least_aic(setup.arx, arx)
    if any(map(armax_whole_drive.is_at_once, driver.at_once, driver.sums)):
        return armax_whole_drive.INPUT_LATE
    if agreement.STEERING not in setup.input_names:
        return ""
    car = arx_recursive.of_least_aic(*arx_recursive.exchanged(setup.arx, arx))
    late = armax_whole_drive.car_is_late(
        car.A, car.B[0], car.covariance, car.at_once[0], driver.sums[0], setup.dt
    )
    return armax_whole_drive.CAR_LATE if late else ""


def _residual_tests(setup: Setup, rows: Array) -> ResidualTests | None:
    if np.isfinite(rows[:, 1]).sum() * setup.dt < MIN_TESTED_S:
        return None
    o = setup.orders
    return residual_tests.run_tests(rows[:, 1], rows[:, 3:], setup.input_names, o.na + o.nc)


def identify(trace: Trace, settings: ArmaxSettings) -> WholeDrive | None:
    """Fit one model to a whole drive."""
    return armax_whole_drive.identify(trace, settings.orders)


def forget(setup: Setup, state: State, since: float) -> State:
    """Begin anew, as a recursion holds nothing apart that it has learned since; when the next estimate is due stays."""
    return init(setup)._replace(pace=state.pace, pool=state.pool, t=state.t, segment=state.segment)


ARMAX = Estimator(
    NAME, ArmaxSettings, configure, init, advance, estimate, identify, check_state=check_state, forget=forget
)
