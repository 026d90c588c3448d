"""State of the ARMAX estimator, and what a saved one must satisfy."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np

from canid.estimators import pooling, status
from canid.identification.armax import armax_recursive
from canid.identification.armax.armax_batch import Orders
from canid.identification.armax.rates import rates
from canid.state_constraints import FINITE, NOT_NEGATIVE, TIME
from canid.types import Array

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

    @property
    def width(self) -> int:
        """Columns of the rows that are kept: piece, innovation, output, inputs."""
        return 3 + len(self.input_names)

    @property
    def needed(self) -> float:
        """Data in s below which nothing is estimated."""
        return max(status.MIN_DATA_S, self.start * self.dt)


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
    )


def check_state(setup: Setup, state: State) -> Iterator[str]:
    """Why a restored state is not of this setup."""
    m, o, forgetting = len(setup.input_names), setup.orders, setup.forgetting
    k, n, model = len(forgetting), o.count(m), state.model
    width = setup.width
    if state.past.ndim != 2 or state.past.shape[1] != width or any(len(row) != width for row in state.recent):
        yield "the samples of armax have another shape"
    if len(state.movement.mean) != m or len(state.movement.variance) != m:
        yield "armax has another number of inputs"
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
        *[(psi, (k, 1, n)) for psi in model.psi],
        *[(one.psi, (k, 1, n)) for one in model.block],
        *[(one.e, (k,)) for one in model.block],
    ]
    if any(np.shape(part) != shape for part, shape in shapes):
        yield "the model of armax has another shape"
    if len(model.psi) != o.nc or len(model.block) >= rates(setup.dt).block or len(model.u) not in (0, m):
        yield "the lags of armax have another shape"
    if not abs(sum(model.trust.weights) - 1.0) < 1e-6:
        yield "the weights of armax do not add up to one"
    if not np.abs(model.theta).max(initial=0.0) <= MAX_PARAMETER:
        yield "the parameters of armax are larger than any measured quantity"
