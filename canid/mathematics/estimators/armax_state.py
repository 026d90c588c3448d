"""State of the ARMAX estimator, and what a saved one must satisfy."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np

from canid.mathematics.estimators import pooling, status
from canid.mathematics.identification import innovation_law
from canid.mathematics.identification.armax import armax_recursive, arx_recursive, box_jenkins_state
from canid.mathematics.identification.armax.armax_batch import Orders
from canid.mathematics.identification.armax.rates import rates
from canid.mathematics.identification.fopdt import regression_rows
from canid.values.state_constraints import FINITE, NOT_NEGATIVE, TIME
from canid.values.types import Array, OutputFilter

# s; over which the inputs' movement is measured: the period of the slowest traffic waves that still teach a lag.
MOVEMENT_MEMORY_S = 20.0

# Share of its usual standard deviation (status.usual) that an input must move by to be learnt from: below is sensor
# noise, and learning from it would learn the noise. (FOPDT asks for less: fopdt.MIN_MOVEMENT_TO_FIT.)
MIN_MOVEMENT_TO_LEARN = 0.05

# s; an estimate after a longer break is said to be from before it, until `status.MIN_DATA_S` seconds have confirmed it.
LONG_BREAK_S = 60.0

# s of data; with fewer an ARX model's interval is too narrow: with 60 s K held on 130 of 146, with 120 s on 156 of 166
MIN_ARX_S = 90.0
# share of what a memory can hold at which it counts as filled
FILLED = 0.9

# of any coefficient: beyond, squares drown what they are added to
MAX_PARAMETER = 1e9


class Setup(NamedTuple):
    """Inputs, grid and settings, and what follows from them."""

    input_names: tuple[str, ...]  # m
    dt: float  # s, from row to row
    orders: Orders
    forgetting: tuple[float, ...]  # per row
    start: int  # rows of the batch start
    grid: float  # s, from sample to sample
    per_row: int  # samples
    layout: regression_rows.Layout | None  # with several inputs, each with poles of its own; None: one input
    output_filter: OutputFilter | None  # that the output has passed; None: not known

    @property
    def arx(self) -> arx_recursive.Layout:
        """Models that gains and delays are taken from, where the inputs have no poles of their own."""
        return arx_recursive.layout(len(self.input_names), self.orders.nk, len(self.forgetting), self.dt)

    @property
    def width(self) -> int:
        """Columns of the rows that are kept: piece, innovation, output, inputs."""
        return 3 + len(self.input_names)

    @property
    def needed(self) -> float:
        """Data in s below which nothing is estimated."""
        start = max(status.MIN_DATA_S, self.start * self.dt)
        if self.layout is not None:
            return start
        faded = 1.0 - self.forgetting[-1]
        # where the longest memory fades it never knows more
        return max(start, min(MIN_ARX_S, FILLED * 2.0 / faded * self.dt) if faded else MIN_ARX_S)


class Movement(NamedTuple):
    """Exponentially weighted mean and variance of each input."""

    samples: Annotated[int, NOT_NEGATIVE]
    mean: tuple[float, ...]
    variance: Annotated[tuple[float, ...], NOT_NEGATIVE]


class Quality(NamedTuple):
    """Fit of the model's free simulation: exponentially weighted powers."""

    simulated: tuple[float, ...]  # the model's own past outputs, newest first
    mean: float  # of the output
    power: Annotated[float, NOT_NEGATIVE]  # of the output about its mean
    error: Annotated[float, NOT_NEGATIVE]  # of output minus simulation


class Learnt(NamedTuple):
    """Data learnt from so far."""

    used: Annotated[float, NOT_NEGATIVE] = 0.0  # s of data in all
    t: Annotated[float, TIME] = math.nan  # s, of the last sample learnt from
    pause: Annotated[float, NOT_NEGATIVE] = 0.0  # s, length of the last long break
    since: Annotated[float, NOT_NEGATIVE] = math.inf  # s of data since then


class State(NamedTuple):
    """What the next step needs. Rows are (piece, innovation, output, inputs...), a piece of NaN not to be learnt."""

    pace: status.Pace
    pool: pooling.State  # samples of the next row
    t: Annotated[float, TIME]  # s, of the last sample
    segment: int  # of the inputs' history
    piece: int  # grows with every interruption
    past: Array  # (n, 3 + m) rows on the grid, read only
    recent: tuple[tuple[float, ...], ...]  # rows since then, no more than `armax.MAX_PENDING_ROWS`
    due: int  # samples to learn from, of these rows, at which the next batch fit is made; 0: none any more
    model: Annotated[armax_recursive.State, FINITE] | None
    learnt: Learnt
    movement: Annotated[Movement, FINITE]
    quality: Quality
    arx: arx_recursive.State | None = None  # next to `model`, which decides how far each memory is believed
    separate: box_jenkins_state.State | None = None  # with several inputs, instead of both


def init(setup: Setup) -> State:
    """Start without data."""
    m = len(setup.input_names)
    return State(
        status.Pace(),
        pooling.State(),
        math.nan,
        0,
        0,
        np.zeros((0, setup.width)),
        (),
        setup.start,
        None,
        Learnt(),
        Movement(0, (0.0,) * m, (0.0,) * m),
        Quality((), math.nan, 0.0, 0.0),
        arx_recursive.init(setup.arx) if setup.layout is None else None,
    )


def with_sample(setup: Setup, before: Learnt, t: float) -> Learnt:
    """Count a sample that is learnt from."""
    pause, dt = t - before.t, setup.dt
    if pause > LONG_BREAK_S:
        return Learnt(before.used + dt, t, pause, dt)
    return Learnt(before.used + dt, t, before.pause, before.since + dt)


def moved(setup: Setup, before: Movement, inputs: tuple[float, ...]) -> Movement:
    """Follow mean and variance of the inputs."""
    # the first samples weigh alike, later ones fade: no start value that would count as movement
    count = before.samples + 1
    w = max(setup.dt / MOVEMENT_MEMORY_S, 1.0 / count)
    away = [x - mean for x, mean in zip(inputs, before.mean, strict=True)]
    return Movement(
        count,
        tuple([mean + w * d for mean, d in zip(before.mean, away, strict=True)]),
        tuple([(1.0 - w) * (v + w * d * d) for v, d in zip(before.variance, away, strict=True)]),
    )


def is_excited(setup: Setup, movement: Movement) -> bool:
    """Whether any input moves enough to be learnt from."""
    least = [(MIN_MOVEMENT_TO_LEARN * status.usual(name)) ** 2 for name in setup.input_names]
    return any(map(operator.gt, movement.variance, least))


def unconfirmed(setup: Setup, learnt: Learnt) -> str:
    """Say that an estimate is from before a long break; empty: data since then have confirmed it."""
    if learnt.since < status.MIN_DATA_S - 0.5 * setup.dt:
        return f"; from before a break of {duration(learnt.pause)}, not yet confirmed"
    return ""


def duration(seconds: float) -> str:
    """Say how long, in s or min.

    >>> duration(75.0), duration(1200.0)
    ('75 s', '20 min')
    """
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


def check_state(setup: Setup, state: State) -> Iterator[str]:
    """Why a restored state is not of this setup."""
    m, o, forgetting = len(setup.input_names), setup.orders, setup.forgetting
    k, n, model = len(forgetting), o.count(m), state.model
    width = setup.width
    if state.past.ndim != 2 or state.past.shape[1] != width or any(len(row) != width for row in state.recent):
        yield "the samples of armax have another shape"
    if len(state.movement.mean) != m or len(state.movement.variance) != m:
        yield "armax has another number of inputs"
    yield from _check_separate(setup, state.separate)
    yield from _check_arx(setup, state.arx)
    if model is None:
        return
    if not np.array_equal(model.forgetting, np.array(forgetting)):
        yield "armax has other forgetting factors"
    shapes: list[tuple[Any, tuple[int, ...]]] = [
        (model.theta, (k, 1, n)),
        (model.root, (k, n, n)),
        (model.e, (k, 1, o.nc)),
        (model.weights, (2, k)),
        (model.score, (2, n)),
        (model.anchor, (n, n)),
        (model.trust.weights, (k,)),
        (model.trust.leave, (k - 1,)),
        (model.innovations, (len(model.innovations),)),
        *[(psi, (k, 1, n)) for psi in model.psi],
        *[(sample.psi, (k, 1, n)) for sample in model.block],
        *[(sample.e, (k,)) for sample in model.block],
    ]
    if any(np.shape(part) != shape for part, shape in shapes):
        yield "the model of armax has another shape"
    if len(model.psi) != o.nc or len(model.block) >= rates(setup.dt).block or len(model.u) not in (0, m):
        yield "the lags of armax have another shape"
    if not abs(sum(model.trust.weights) - 1.0) < 1e-6:
        yield "the weights of armax do not add up to one"
    if not innovation_law.is_possible(model.law):
        yield "the law of the innovations of armax is none"
    if not np.abs(model.theta).max(initial=0.0) <= MAX_PARAMETER:
        yield "the parameters of armax are larger than any measured quantity"


def _check_arx(setup: Setup, model: arx_recursive.State | None) -> Iterator[str]:
    if model is None or setup.layout is not None:
        if (model is None) != (setup.layout is not None):
            yield "armax has another number of inputs"
        return
    shape, m = setup.arx, len(setup.input_names)
    good = model.products.shape == (shape.memories, shape.width, shape.width)
    good &= model.weights.shape == (2, shape.memories)
    good &= all(len(row) == 2 + m for row in model.rows) and len(model.rows) <= shape.reach + shape.block
    if not good or not model.fresh < shape.block or model.fresh > len(model.rows):
        yield "the products of armax have another shape"


def _check_separate(setup: Setup, model: box_jenkins_state.State | None) -> Iterator[str]:
    if model is None:
        return
    if setup.layout is None:
        yield "armax has another number of inputs"
        return
    m, k, width = setup.layout.inputs, len(setup.forgetting), setup.layout.width
    c = m * setup.layout.basis.size + 2 + len(model.ar)
    shapes: list[tuple[Any, tuple[int, ...]]] = [
        (model.products, (k, c, c)),
        (model.weights, (2, k)),
        (model.point, (3, m)),
        (model.nodes, (3, m, m * setup.layout.basis.size)),
        (model.mean_ar, (len(model.ar),)),
        (model.score, (2, 3 * m)),
        (model.trust.weights, (k,)),
        (model.trust.leave, (k - 1,)),
        (model.tail, (len(model.tail), width)),
        (model.tested, (len(model.tested), 2 + m)),
    ]
    if any(np.shape(part) != shape for part, shape in shapes) or len(model.regions) != m:
        yield "the model of armax has another shape"
    if not len(model.ar) * model.stride <= model.ready <= len(model.tail) or model.phase >= model.stride:
        yield "the lags of armax have another shape"
    if not innovation_law.is_possible(model.law):
        yield "the law of the innovations of armax is none"
    if not abs(sum(model.trust.weights) - 1.0) < 1e-6:
        yield "the weights of armax do not add up to one"
