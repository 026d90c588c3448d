"""ARX models of all orders at all memories, from one recursion of their inner products; AIC chooses the order of each.

In a loop a noise model that is too small biases the answer; ARX models hold every noise as their order grows (Ljung 1999,
sec. 13.4 and 10.4), and AIC lets it grow with what is known (Shibata 1980). The models are nested, so that the products
of the longest one's columns hold those of all.

On drives of two simulated lane keepers with noises of 0.06 to 1.5 s (seeds 510000 to 510007, every minute of 10) K by the
recursion of ARMAX(2,2,1) held on 218 of 335 values, by this one, on six of each eight drives, on 218 of 220.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.armax.armax_recursive import RESTART_WIDENING
from canid.mathematics.identification.armax.rates import LONG_AR_S, rates
from canid.values.state_constraints import FINITE, NOT_NEGATIVE
from canid.values.types import Array

# s; lags of the ARX models that are compared: one sample more each would say the same
ARX_S = (0.2, 0.3, 0.4, 0.6, 0.8, 1.1, LONG_AR_S)
# rows per parameter below which a model is not compared
MIN_ROWS_PER_PARAMETER = 5
# An order that is too small biases the answer, one that is too large only costs width: of those whose N ln V + 2 p is so
# close to the least one (Burnham & Anderson 2002, sec. 2.6) the largest is taken. After a minute or two K then held on 286
# of 312 values, with the least on 285 of 324.
AIC_MARGIN = 4.0
# relative to the diagonal; what never moved stays zero
RIDGE = 1e-12


def lags(dt: float) -> tuple[int, ...]:
    """Orders that are compared on a grid of `dt` s, ascending.

    >>> lags(0.1), lags(0.5)
    ((2, 3, 4, 6, 8, 11, 15), (2, 3))
    """
    return tuple(sorted({max(round(seconds / dt), 2) for seconds in ARX_S}))


class Layout(NamedTuple):
    """Columns of the products: lags of the output, lags of each input from the sample itself on, one, the output."""

    orders: tuple[int, ...]  # that are compared, ascending
    inputs: int
    dead_time: int  # samples before the first lag of an input that may answer
    block: int  # rows that are taken in at once
    memories: int

    @property
    def reach(self) -> int:
        """Lags of an input."""
        return self.orders[-1] + self.dead_time

    @property
    def width(self) -> int:
        """How many columns."""
        return self.orders[-1] + self.inputs * self.reach + 2

    def places(self, order: int, dead_time: int) -> npt.NDArray[np.int64]:
        """Where the regressors of one model are: outputs, inputs, one."""
        of_inputs = [
            self.orders[-1] + i * self.reach + dead_time + np.arange(order) for i in range(self.inputs)
        ]
        return np.concatenate([np.arange(order), *of_inputs, [self.width - 2]])


def layout(inputs: int, dead_time: int, memories: int, dt: float) -> Layout:
    """Lay out the columns for a grid of `dt` s."""
    return Layout(lags(dt), inputs, dead_time, rates(dt).block, memories)


class State(NamedTuple):
    """What the next row needs; k memories, the longest last, c columns."""

    rows: tuple[
        tuple[float, ...], ...
    ]  # (learn, output, inputs...): history, and those that are not taken in yet
    fresh: Annotated[int, NOT_NEGATIVE]  # of the latter
    products: Annotated[Array, FINITE]  # (k, c, c)
    weights: Annotated[Array, NOT_NEGATIVE]  # (2, k) sums of the rows' weights and of their squares


def init(shape: Layout) -> State:
    """Start without data."""
    k, c = shape.memories, shape.width
    return State((), 0, np.zeros((k, c, c)), np.zeros((2, k)))


def step(shape: Layout, state: State, forgetting: Sequence[float], row: tuple[float, ...]) -> State:
    """Take in a row (learn, output, inputs...), a block of them at once.

    >>> rng = np.random.default_rng(0)
    >>> u, e, y = rng.normal(size=900), 0.1 * rng.normal(size=900), np.zeros(900)
    >>> for t in range(1, 900): y[t] = 0.8 * y[t-1] + 0.5 * u[t-1] + e[t]
    >>> shape = layout(1, 1, 2, 0.1)
    >>> state = init(shape)
    >>> for t in range(900): state = step(shape, state, (0.98, 1.0), (1.0, y[t], u[t]))
    >>> found = solved(shape, state)
    >>> [round(float(x[15:30].sum() / (1 + x[:15].sum())), 1) for x in found.theta]
    [2.4, 2.4]
    >>> best = of_least_aic(shape, state)
    >>> len(best.A), np.abs(best.B).round(1).tolist(), abs(best.at_once[0]) < 3.9 < best.sums[0]
    (3, [[0.5, 0.0]], True)
    """
    state = state._replace(rows=(*state.rows, row), fresh=state.fresh + 1)
    return state if state.fresh < shape.block else _taken(shape, state, forgetting)


def rest(shape: Layout, state: State, forgetting: Sequence[float]) -> State:
    """Take in what waits and forget the history: before a gap."""
    return _taken(shape, state, forgetting)._replace(rows=()) if state.rows else state


def renewed(state: State, best: int) -> State:
    """Let the longest memory and the shortest begin anew from `best`, as `armax_recursive` does."""
    kept = [best, *range(1, len(state.products) - 1), best]
    share = np.ones(len(kept))
    share[[0, -1]] = RESTART_WIDENING**-2
    return state._replace(
        products=share[:, None, None] * state.products[kept], weights=state.weights[:, kept] * share
    )


def _taken(shape: Layout, state: State, forgetting: Sequence[float]) -> State:
    rows, longest = np.array(state.rows), shape.reach
    first = max(len(rows) - state.fresh, longest)
    state = state._replace(rows=state.rows[-longest:], fresh=0)
    if first >= len(rows):
        return state
    learn = rows[first:, 0]
    # (rows, columns, lags), the newest first
    past = np.lib.stride_tricks.sliding_window_view(rows[:, 1:], longest + 1, axis=0)[
        first - longest :, :, ::-1
    ]
    X = np.column_stack(
        [
            -past[:, 0, 1 : shape.orders[-1] + 1],
            past[:, 1:, :longest].reshape(len(past), -1),
            np.ones(len(past)),
            past[:, 0, 0],
        ]
    )
    X *= learn[:, None]
    count = float(learn.sum())
    fade = np.array(forgetting) ** count
    return state._replace(
        products=fade[:, None, None] * state.products + X.T @ X,
        weights=state.weights * [fade, fade * fade] + count,
    )


class Solved(NamedTuple):
    """Least squares of each memory by the model that AIC prefers, zeros where it has no lag; p columns, as laid out."""

    orders: tuple[int, ...]  # (k,)
    theta: Array  # (k, p) outputs and inputs, no constant
    covariance: Array  # (k, p, p)


def solved(shape: Layout, state: State) -> Solved:
    """Fit every order in every memory, and choose."""
    k, longest = shape.memories, shape.orders[-1]
    wide = shape._replace(orders=(longest,)).places(longest, shape.dead_time)
    p = len(wide) - 1
    theta, covariance = np.zeros((k, p)), np.zeros((k, p, p))
    fits = [_least_squares(state, shape.places(order, shape.dead_time)) for order in shape.orders]
    chosen = _chosen(fits, rows(state))[0]
    for i, j in enumerate(chosen):
        at = np.flatnonzero(np.isin(wide, shape.places(shape.orders[j], shape.dead_time)))[:-1]
        theta[i, at] = fits[j].theta[i, :-1]
        covariance[i][np.ix_(at, at)] = fits[j].covariance[i, :-1, :-1]
    return Solved(tuple([shape.orders[j] for j in chosen]), theta, covariance)


def rows(state: State) -> Array:
    """(k,) rows of equal weights that would tell as much as each memory."""
    w1, w2 = state.weights
    return np.asarray(w1 * w1 / np.maximum(w2, 1.0))


def _chosen(fits: Sequence[_Fit], rows: Array) -> tuple[list[int], int]:
    """Which fit of each memory, and which one has the least AIC in the longest."""
    counts = np.array([fit.theta.shape[1] for fit in fits])[:, None]
    aic = rows * np.log(np.maximum([fit.variance for fit in fits], 1e-300)) + 2.0 * counts
    aic[1:][rows < MIN_ROWS_PER_PARAMETER * counts[1:]] = np.inf
    close = aic <= aic.min(axis=0) + AIC_MARGIN
    return [int(np.flatnonzero(column)[-1]) for column in close.T], int(aic[:, -1].argmin())


class _Fit(NamedTuple):
    theta: Array  # (k, p)
    covariance: Array  # (k, p, p)
    variance: Array  # (k,) of the residual


def _least_squares(state: State, places: npt.NDArray[np.int64]) -> _Fit:
    gram = state.products[:, places[:, None], places]
    along = state.products[:, places, -1]
    diagonal = np.arange(len(places))
    gram[:, diagonal, diagonal] = gram[:, diagonal, diagonal] * (1.0 + RIDGE) + 1e-9 * RIDGE
    inverse = np.asarray(np.linalg.inv(gram), np.float64)
    theta = np.einsum("kij,kj->ki", inverse, along)
    left = np.maximum(state.products[:, -1, -1] - np.einsum("ki,ki->k", theta, along), 0.0)
    w1, w2 = state.weights
    freedom = np.maximum(w1 - len(places), 1.0)
    scale = left / freedom * w2 / np.maximum(w1, 1.0)
    return _Fit(theta, scale[:, None, None] * inverse, left / np.maximum(w1, 1.0))


class LeastAic(NamedTuple):
    """The model that AIC prefers in the longest memory, without a margin: lags that nothing asks for hide an answer."""

    A: Array  # (n + 1,)
    B: Array  # (m, n)
    covariance: Array  # (m n, m n) of B
    at_once: tuple[float, ...]  # (m,) answers within the sample, with one more lag, in standard deviations
    sums: tuple[float, ...]  # (m,) of B, likewise


def of_least_aic(shape: Layout, state: State) -> LeastAic:
    """Fit every order in the longest memory, and choose."""
    longest = state._replace(products=state.products[-1:], weights=state.weights[:, -1:])
    fits = [_least_squares(longest, shape.places(order, shape.dead_time)) for order in shape.orders]
    least = _chosen(fits, rows(longest))[1]
    n, m, theta = shape.orders[least], shape.inputs, fits[least].theta[0]
    covariance = fits[least].covariance[0, n:-1, n:-1]
    B, at_once = theta[n:-1].reshape(m, n), _least_squares(longest, shape.places(n, 0))
    first = n + n * np.arange(m)
    answers = at_once.theta[0, first] / np.maximum(np.diag(at_once.covariance[0])[first], 1e-300) ** 0.5
    variance = covariance.reshape(m, n, m, n)[np.arange(m), :, np.arange(m)].sum(axis=(1, 2))
    sums = B.sum(axis=1) / np.maximum(variance, 1e-300) ** 0.5
    return LeastAic(np.r_[1.0, theta[:n]], B, covariance, tuple(answers.tolist()), tuple(sums.tolist()))


def exchanged(shape: Layout, state: State) -> tuple[Layout, State]:
    """The products of the model whose output is the one input, and whose input is the output.

    >>> y, u = np.random.default_rng(0).normal(size=(2, 99))
    >>> shape = layout(1, 1, 1, 0.1)
    >>> states = [init(shape), init(shape)]
    >>> for a, b in zip(y, u):
    ...     states = [step(shape, one, (1.0,), (1.0, *row)) for one, row in zip(states, ((a, b), (b, a)))]
    >>> other, turned = exchanged(shape, states[0])
    >>> other == shape, bool(np.allclose(turned.products, states[1].products))
    (True, True)
    """
    n, reach = shape.orders[-1], shape.reach
    orders = tuple(order for order in shape.orders if order < reach) or (reach - 1,)
    m = orders[-1]
    # lags of the input, the output itself and its lags, one, the input itself
    at = [*range(n + 1, n + 1 + m), shape.width - 1, *range(m), shape.width - 2, n]
    sign = np.r_[np.full(m, -1.0), 1.0, np.full(m, -1.0), 1.0, 1.0]
    products = state.products[:, at][:, :, at] * sign[:, None] * sign
    return shape._replace(orders=orders, dead_time=1), state._replace(products=products)
