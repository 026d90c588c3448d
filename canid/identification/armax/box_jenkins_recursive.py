"""Box-Jenkins model sample by sample: recursive generalised least squares with several memories.

y = c0 + sum K_i e^(-theta_i s) / (1 + tau_i s) u_i + e / D: each input has a pole and a dead time of its own, and the noise
its own poles (Hastings-James & Sage 1969; Young 2011, ch. 7). The answers of all poles and dead times are weighted sums of
a fixed basis (fopdt/reduced_basis.py), so that the recursion is linear: exponentially forgotten inner products of columns
that are whitened as they come, with the lagged residuals among them for what D still errs by. Gains, poles and dead times
are the posterior of these products. D and the band come from a batch fit of the first minutes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.identification import autoregression
from canid.identification.armax import forgetting_mixture, polynomial
from canid.identification.armax.armax_recursive import (
    MAX_SQUARED_INNOVATION,
    RESTART_WIDENING,
    WHITENESS_BLOCKS,
)
from canid.identification.armax.rates import rates
from canid.identification.armax.square_root_covariance import RENEWAL
from canid.identification.fopdt import fopdt_fit, fopdt_posterior, reduced_basis
from canid.identification.fopdt import regression_rows as rows
from canid.identification.fopdt.row_noise import NOISE_ORDER, by_channel, student_factor
from canid.identification.output_filter import equalizer
from canid.identification.residual_tests import HAC_LAG_S
from canid.state_constraints import FINITE, NOT_NEGATIVE, POSITIVE
from canid.types import NAN, Array, Channel, Identifiable, Interval, OutputFilter

# s of innovations that are kept for the residual tests
TESTED_S = 60.0
# s; over which the simulation is compared with the output
FIT_MEMORY_S = 60.0
# Blocks after which the point that predictions are made at is found anew: 40 s.
LOCATE_BLOCKS = 20
# Passes of the posterior's grid: from the whole box to 5 ms takes five.
MAX_PASSES = 8
# of D: noise that remembers for longer is not distinguishable from a drifting offset
MAX_ZERO = 0.999
# Share of a memory in the mixture below which it changes no interval.
MIN_SHARE = 0.05
# s of data after which the anytime interval is narrowest, see gain_and_delay.SHARPEST_S.


class Quality(NamedTuple):
    """Exponentially weighted means and variances of the output and of what the simulation leaves."""

    mean: tuple[float, float]
    power: Annotated[tuple[float, float], NOT_NEGATIVE]
    samples: Annotated[int, NOT_NEGATIVE]

    @property
    def fit_percent(self) -> float:
        """Of the simulation; NaN: not known."""
        y, v = self.power
        return 100.0 * (1.0 - (v / y) ** 0.5) if y > 0.0 else NAN


class State(NamedTuple):
    """What the next rows need; k memories, the longest last, c columns: answers, output, one, lagged residuals."""

    making: rows.State
    tail: Array  # (n, width) rows that whitening or the output filter still needs
    ready: int  # rows of the tail that are history alone
    ar: Annotated[Array, FINITE]  # (p,) of every `stride`-th row
    mean_ar: Annotated[Array, FINITE]  # (p,) mean over the rows that the longest memory knows
    stride: Annotated[int, POSITIVE]
    reference: float  # subtracted from the output
    products: Annotated[Array, FINITE]  # (k, c, c)
    weights: Annotated[Array, NOT_NEGATIVE]  # (2, k) sums of the rows' weights and of their squares
    regions: Annotated[tuple[fopdt_posterior.Region, ...], FINITE]  # where the posterior lies
    point: Annotated[Array, FINITE]  # (3, m) gain, tau, dead time at which predictions are made
    nodes: Annotated[Array, FINITE]  # (3, m, m b) weights of the unit answers there, and of their slopes
    offset: float
    trust: forgetting_mixture.Trust
    recent: Annotated[float, NOT_NEGATIVE]  # variance of the innovations over the last RECENT_S seconds
    score: Annotated[Array, NOT_NEGATIVE]  # (2, 3 m) as of armax_recursive.State
    tested: Array  # (n, 1 + m) the last innovations and inputs
    quality: Annotated[Quality, FINITE]
    blocks: Annotated[int, NOT_NEGATIVE]
    phase: Annotated[int, NOT_NEGATIVE]  # of the next row within the stride
    restarts: Annotated[int, NOT_NEGATIVE]  # times that the longest memory was refuted


class _Columns(NamedTuple):
    """New rows, whitened; zero where they may not be learnt from."""

    white: Array  # (c, q)
    used: npt.NDArray[np.bool_]  # (q,)
    output: Array  # (q,)
    left: Array  # (q,) output minus simulation
    known: npt.NDArray[np.bool_]  # (q,) of the last two
    inputs: Array  # (q, m)


def begin(
    layout: rows.Layout,
    samples: Array,
    forgetting: Sequence[float],
    output_filter: OutputFilter | None,
    settle: float,
    restarts: int = 0,
) -> State | None:
    """Begin with a batch fit of the samples so far; None: they do not suffice.

    Args:
        layout: of the rows.
        samples: (n, 3 + m) as of `regression_rows.put`.
        forgetting: per row, ascending.
        output_filter: that the output has passed; None: not known.
        settle: s after a break in which the unknown history still matters.
        restarts: so far.

    >>> from canid.identification.first_order import scan
    >>> rng = np.random.default_rng(0)
    >>> u = scan(rng.normal(size=900), np.array([0.82]))
    >>> x = np.roll(scan(0.22 * u, np.array([0.78])), 2)  # a lag of 0.4 s behind 0.2 s
    >>> y = 3.0 + 5.6 * x + 0.05 * rng.normal(size=900)
    >>> samples = np.column_stack([y, np.ones(900), np.zeros(900), u])
    >>> layout = fopdt_fit.row_layout(1, 0.1, 3.0, 1.5)
    >>> state = begin(layout, samples[:300], (0.98, 1.0), None, 4.5)
    >>> for k in range(300, 900, 20): state = step(layout, state, samples[k : k + 20], (0.98, 1.0), None, 4.5)
    >>> found = channels(layout, state)[0]
    >>> found.K.low < 5.6 < found.K.high, abs(found.tau_plus_dead_time.value - 0.55) < 0.01
    (True, True)
    """
    m, b, k = layout.inputs, layout.basis.size, len(forgetting)
    making, made = rows.put(layout, rows.State(), samples, settle)
    fit = fopdt_fit.fit_rows(layout, made, output_filter=output_filter)
    if fit.start is None or not all(math.isfinite(x) for x in (*fit.point.K, fit.point.offset)):
        return None
    # the order that a minute chooses is not that of an hour: the lagged residuals hold all of them
    ar = np.concatenate([fit.noise, np.zeros(NOISE_ORDER - len(fit.noise))])
    c = m * b + 2 + len(ar)
    stride = fit.stride
    state = State(
        making,
        np.zeros((0, layout.width)),
        0,
        ar,
        ar,
        stride,
        fit.point.offset,
        np.zeros((k, c, c)),
        np.zeros((2, k)),
        fit.start.search_grid.regions,
        np.array([fit.point.K, fit.point.tau, fit.point.dead_time]),
        _nodes(layout, fit.point.tau, fit.point.dead_time),
        0.0,
        forgetting_mixture.begin(forgetting, rates(stride * layout.step).stated),
        fit.sigma**2,
        np.zeros((2, 3 * m)),
        np.zeros((0, 1 + m)),
        Quality((0.0, 0.0), (0.0, 0.0), 0),
        0,
        0,
        restarts,
    )
    before, _ = _reach(layout, state, output_filter)
    state = state._replace(tail=np.zeros((before, layout.width)), ready=before)
    block = rates(layout.step).block
    for first in range(0, len(made), block):
        state = _taken(layout, state, made[first : first + block], forgetting, output_filter, weighing=False)
    return _located(layout, state)


def step(
    layout: rows.Layout,
    state: State,
    samples: Array,
    forgetting: Sequence[float],
    output_filter: OutputFilter | None,
    settle: float,
) -> State:
    """Take in a block of samples; arguments as of `begin`."""
    making, made = rows.put(layout, state.making, samples, settle)
    state = _taken(layout, state._replace(making=making), made, forgetting, output_filter, weighing=True)
    return _located(layout, state) if state.blocks % LOCATE_BLOCKS == 0 else state


def _reach(layout: rows.Layout, state: State, output_filter: OutputFilter | None) -> tuple[int, int]:
    """Rows before and after that a whitened row needs."""
    own = len(state.ar) * state.stride
    by = equalizer(output_filter, layout.step)
    if by is None:
        return own, 0
    most = max((by.output, by.answers), key=lambda kernel: kernel.before + kernel.after)
    return own + most.before, most.after


def _columns(
    layout: rows.Layout, state: State, first: int, stop: int, output_filter: OutputFilter | None
) -> _Columns:
    """Whiten rows [first, stop) of the tail."""
    m, tail, size = layout.inputs, state.tail, layout.inputs * layout.basis.size
    begin = first - len(state.ar) * state.stride
    usable = tail[begin:stop, 1] > 0.0
    by = _filters(output_filter, layout.step, begin, stop, len(tail))
    if by is None:
        both = np.empty((size + 1, stop - begin))
        both[:-1], both[-1] = tail[begin:stop, 2 + m :].T, tail[begin:stop, 0]
    else:
        both, known = _equalized(by, tail[:, 2 + m :].T, tail[:, 0])
        usable &= known
    tail, first, stop = tail[begin:stop], first - begin, stop - begin
    both[:, ~usable] = 0.0
    both[-1, usable] -= state.reference
    nodes = state.nodes[0]
    left = np.where(usable, both[-1] - state.point[0] @ nodes @ both[:-1] - state.offset, 0.0)
    lags = [slice(first - i * state.stride, stop - i * state.stride) for i in range(len(state.ar) + 1)]
    white = np.empty((size + 2 + len(state.ar), stop - first))
    white[: size + 1] = both[:, lags[0]]
    used = usable[lags[0]].copy()
    for value, lag in zip(state.ar, lags[1:], strict=True):
        white[: size + 1] -= value * both[:, lag]
        used &= usable[lag]
    white[size + 1] = 1.0 - float(state.ar.sum())
    for i, lag in enumerate(lags[1:], size + 2):
        white[i] = left[lag]
    white[:, ~used] = 0.0
    now = lags[0]
    return _Columns(white, used, both[-1, now], left[now], usable[now], tail[now, 2 : 2 + m])


class _Filters(NamedTuple):
    """What answers and output pass, as matrices from the tail to the rows that are wanted."""

    answers: Array  # (n, q)
    output: Array  # (n, q)
    taps: tuple[Array, Array]  # where they are not zero
    counts: tuple[int, int]  # how many there are


@lru_cache(maxsize=8)
def _filters(
    output_filter: OutputFilter | None, step: float, first: int, stop: int, length: int
) -> _Filters | None:
    by = equalizer(output_filter, step)
    if by is None:
        return None
    made, taps = [], []
    for kernel in (by.answers, by.output):
        matrix, known = np.zeros((length, stop - first)), np.zeros((length, stop - first))
        for i, weight in enumerate(kernel.weights):
            at = np.arange(first, stop) + kernel.after - i
            inside = (at >= 0) & (at < length)
            matrix[at[inside], np.flatnonzero(inside)] = weight
            known[at[inside], np.flatnonzero(inside)] = 1.0
        made.append(matrix)
        taps.append(known)
    counts = len(by.answers.weights), len(by.output.weights)
    return _Filters(made[0], made[1], (taps[0], taps[1]), counts)


def _equalized(by: _Filters, answers: Array, output: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Pass answers (m b, n) and output (n,) through the filters; and where all that these read is known."""
    known = np.isfinite(answers[0]) & np.isfinite(answers[-1]), np.isfinite(output)
    both = np.vstack(
        [np.where(known[0], answers, 0.0) @ by.answers, np.where(known[1], output, 0.0) @ by.output]
    )
    whole = [k.astype(float) @ t > n - 0.5 for k, t, n in zip(known, by.taps, by.counts, strict=True)]
    return both, whole[0] & whole[1]


def _nodes(layout: rows.Layout, tau: Array, dead_time: Array) -> Array:
    """(3, m, m b) weights of the unit answers and of their slopes by lag and dead time, by channel."""
    each = reduced_basis.with_slopes(layout.basis, tau, dead_time)
    return np.array([by_channel(layout, w) for w in each])


def _taken(
    layout: rows.Layout,
    state: State,
    made: Array,
    forgetting: Sequence[float],
    output_filter: OutputFilter | None,
    *,
    weighing: bool,
) -> State:
    """Take in rows; `weighing`: let them judge the memories."""
    before, after = _reach(layout, state, output_filter)
    state = state._replace(tail=np.concatenate([state.tail, made]))
    first, stop = state.ready, len(state.tail) - after
    if stop <= first:
        return state
    new = _columns(layout, state, first, stop, output_filter)
    kept = state.tail[stop - before :]
    state = state._replace(tail=kept, ready=before, blocks=state.blocks + 1)
    count, size = int(new.used.sum()), layout.inputs * layout.basis.size
    tested = np.column_stack([np.full(len(new.used), NAN), new.inputs])
    if count:
        predicted = _predicted(layout, state, new)
        if not weighing:
            # the first memories know nothing yet: these rows' innovations are the residuals of the batch fit
            of_fit = new.white[size] - state.point[0] @ (state.nodes[0] @ new.white[:size])
            predicted = predicted._replace(lead=of_fit, variance=state.recent)
        tested[new.used, 0] = predicted.lead[new.used]
        state = _judged(layout, state, new, predicted) if weighing else state
        state = _learnt(layout, state, new, predicted, forgetting)
        best = forgetting_mixture.refuted(state.trust) if weighing else None
        state = state if best is None else _renewed(state, best)
    longest = round(TESTED_S / layout.step)
    state = state._replace(
        tested=np.concatenate([state.tested, tested])[-longest:],
        quality=_compared(state.quality, new, layout.step / FIT_MEMORY_S),
        phase=(state.phase + stop - first) % state.stride,
    )
    return state


class _Predicted(NamedTuple):
    """One-step predictions of the memories."""

    errors: Array  # (k, q)
    spreads: Array  # (k, q) variance of an error over that of the noise
    lead: Array  # (q,) errors of the memory that is believed most
    variance: float  # of the noise
    held: Array  # (k, m) sums of squares of the unit answers that each memory knows
    brought: Array  # (m,) and that the rows bring


def _predicted(layout: rows.Layout, state: State, new: _Columns) -> _Predicted:
    """Predict with gains, offset and D of each memory, at the common lags and dead times."""
    size = layout.inputs * layout.basis.size
    turn, along, theta, inverse, held = _solved(layout, state)
    columns = turn @ new.white
    errors = new.white[size] - theta @ columns
    spreads = 1.0 + ((inverse @ columns) * columns).sum(axis=1)
    lead = _lead(state)
    left = state.products[:, size, size] - np.einsum("ki,ki->k", theta, along)
    freedom = state.weights[0] - len(turn)
    variance = float(left[lead] / freedom[lead]) if freedom[lead] > 1.0 and left[lead] > 0.0 else state.recent
    brought = np.square(columns[: layout.inputs]).sum(axis=1)
    return _Predicted(errors, spreads, errors[lead], variance, held, brought)


def _solved(layout: rows.Layout, state: State) -> tuple[Array, Array, Array, Array, Array]:
    """Least squares of gains, offset and what D errs by, (m + 1 + p,), in each memory at the common lags and dead times.

    Returns:
        (m + 1 + p, c) these regressors from the columns; (k, m + 1 + p) their products with the output; the solution; the
        inverse of their products; (k, m) sums of squares of the unit answers.
    """
    m, size = layout.inputs, layout.inputs * layout.basis.size
    turn = np.zeros((m + 1 + len(state.ar), state.products.shape[1]))
    turn[:m, :size] = state.nodes[0]
    turn[m:, size + 1 :] = np.eye(len(turn) - m)
    part = turn @ state.products
    gram, along = part @ turn.T, part[:, :, size]
    held = gram[:, range(m), range(m)].copy()
    # what never moved stays zero
    gram[:, range(len(turn)), range(len(turn))] *= 1.0 + 1e-9
    gram += 1e-9 * np.eye(len(turn))
    inverse = np.asarray(np.linalg.inv(gram), np.float64)
    theta: Array = np.einsum("kij,kj->ki", inverse, along)
    return turn, along, theta, inverse, held


def _lead(state: State) -> int:
    return max(range(len(state.trust.weights)), key=state.trust.weights.__getitem__)


def _judged(layout: rows.Layout, state: State, new: _Columns, predicted: _Predicted) -> State:
    """Weigh the memories by their predictions, one phase of the stride; and follow the noise's variance."""
    trust, recent, w = state.trust, state.recent, 1.0 / rates(layout.step).recent
    errors, spreads = predicted.errors.T.tolist(), predicted.spreads.T.tolist()
    for i in np.flatnonzero(new.used).tolist():
        worst = max(predicted.variance, recent)
        # the shortest memory follows every change, so that its errors are noise alone
        square = min(errors[i][0] ** 2 / spreads[i][0], MAX_SQUARED_INNOVATION * worst)
        recent += w * (square - recent)
        if (state.phase + i) % state.stride == 0:
            trust = forgetting_mixture.step(trust, errors[i], spreads[i], worst)
    return state._replace(trust=trust, recent=recent)


def _learnt(
    layout: rows.Layout, state: State, new: _Columns, predicted: _Predicted, forgetting: Sequence[float]
) -> State:
    """Add the block to the products, which forget as much as it renews."""
    size, count = layout.inputs * layout.basis.size, int(new.used.sum())
    block = new.white @ new.white.T
    nodes = state.nodes
    share = (predicted.brought / np.maximum(predicted.held + predicted.brought, 1e-300)).min(axis=1)
    fade = 1.0 - np.minimum(1.0 - np.array(forgetting) ** count, RENEWAL * share)
    slopes = np.concatenate([nodes[0], *(state.point[0][:, None] * x for x in nodes[1:])])
    psi = slopes @ new.white[:size]
    psi -= np.where(new.used, psi.sum(axis=1, keepdims=True) / count, 0.0)
    score = np.array([(psi @ predicted.lead) ** 2, (psi**2).sum(axis=1) * predicted.variance * state.stride])
    known = float(fade[-1] * state.weights[0, -1])
    return state._replace(
        mean_ar=(known * state.mean_ar + count * state.ar) / (known + count),
        products=fade[:, None, None] * state.products + block,
        weights=state.weights * [fade, fade * fade] + count,
        score=state.score * (1.0 - 1.0 / WHITENESS_BLOCKS) + score,
    )


def _renewed(state: State, best: int) -> State:
    """Let the longest memory, which was refuted, and the shortest begin anew from `best`."""
    k = len(state.trust.weights)
    of = [best, *range(1, k - 1), best]
    share = np.ones(k)
    share[[0, -1]] = RESTART_WIDENING**-2
    return state._replace(
        products=share[:, None, None] * state.products[of],
        weights=state.weights[:, of] * share,
        trust=forgetting_mixture.renew(state.trust),
        restarts=state.restarts + 1,
    )


def _compared(before: Quality, new: _Columns, rate: float) -> Quality:
    mean, power, count = list(before.mean), list(before.power), before.samples
    for pair in zip(new.output[new.known].tolist(), new.left[new.known].tolist(), strict=True):
        count += 1
        w = max(rate, 1.0 / count)
        for i, x in enumerate(pair):
            away = x - mean[i]
            mean[i] += w * away
            power[i] = (1.0 - w) * (power[i] + w * away * away)
    return Quality((mean[0], mean[1]), (power[0], power[1]), count)


# --- posterior -------------------------------------------------------------------------------------


def _moments(layout: rows.Layout, state: State, k: int) -> fopdt_posterior.Moments:
    """Information of one memory: its weights w are squared in the variance of what they average."""
    size = layout.inputs * layout.basis.size
    w1, w2 = state.weights[:, k]
    share = float(w1 / w2) / state.stride
    G = share * state.products[k]
    parts = fopdt_posterior.Products(
        G[: size + 1, : size + 1], G[: size + 1, size + 1 :], G[size + 1 :, size + 1 :]
    )
    return fopdt_posterior.moments(parts, layout.inputs, max(round(share * float(w1)), 1))


def variance_inflation(layout: rows.Layout, state: State) -> float:
    """Long-run over plain variance of the block scores, at least 1 (Newey & West 1987), see residual_tests.py."""
    # the first blocks say little: a mean of squares over n blocks is off by sqrt(2 / n)
    moving = state.score[1] > 0.0
    if not moving.any() or state.blocks * HAC_LAG_S < 2.0 * TESTED_S / 4.0:
        return 1.0
    return max(1.0, float(np.mean(state.score[0][moving] / state.score[1][moving])))


def _posterior(
    layout: rows.Layout, state: State, k: int, inflation: float
) -> tuple[fopdt_posterior.Moments, fopdt_posterior.Grid, tuple[fopdt_posterior.Region, ...]]:
    """Close in on the posterior of one memory from where it was."""
    box = layout.basis.box
    known = _moments(layout, state, k)
    regions = state.regions
    for _ in range(MAX_PASSES):
        cells = tuple(fopdt_posterior.make_cells(region, box) for region in regions)
        side = fopdt_posterior.CELLS_PER_AXIS
        tau = np.concatenate([c.tau[::side] for c in cells])
        dead_time = np.concatenate([c.dead_time for c in cells]).reshape(-1, side)
        every = reduced_basis.weights_on_grid(layout.basis, tau, dead_time)
        W = tuple(every.reshape(len(cells), side * side, -1))
        grid = fopdt_posterior.evaluate(known, W, cells, inflation)
        regions = tuple(fopdt_posterior.gather(grid, i, box) for i in range(layout.inputs))
        fine = all(fopdt_fit.is_fine(r, c) for r, c in zip(regions, cells, strict=True))
        if fine and not any(fopdt_posterior.missed(grid, i, box) for i in range(layout.inputs)):
            break
    return known, grid, regions


def _located(layout: rows.Layout, state: State) -> State:
    """Find the point anew at which predictions are made: the posterior mean of the memory that is believed most."""
    inflation = variance_inflation(layout, state)
    _, grid, regions = _posterior(layout, state, _lead(state), inflation)
    weights = [fopdt_posterior.marginal(grid, i) for i in range(layout.inputs)]
    tau = [float(w @ c.tau) for w, c in zip(weights, grid.cells, strict=True)]
    dead_time = [float(w @ c.dead_time) for w, c in zip(weights, grid.cells, strict=True)]
    gains = [float(np.vdot(grid.weight, K)) for K in grid.K]
    nodes = _nodes(layout, np.array(tau), np.array(dead_time))
    state = state._replace(regions=regions, point=np.array([gains, tau, dead_time]), nodes=nodes)
    # the offset that belongs to them
    size = layout.inputs * layout.basis.size
    G = state.products[_lead(state)]
    w = np.concatenate([-np.array(gains) @ nodes[0], [1.0]])
    offset = float(w @ G[: size + 1, size + 1]) / max(float(G[size + 1, size + 1]), 1e-300)
    return _with_noise(layout, state._replace(offset=offset))


def _with_noise(layout: rows.Layout, state: State) -> State:
    """Whiten the next rows by D as now estimated: its mean so far, and what the longest memory finds missing."""
    missing = _solved(layout, state)[2][-1, layout.inputs + 1 :]
    ar = state.mean_ar + missing
    total = float(ar.sum())
    ar = ar * (autoregression.SLOWEST / total) if total > autoregression.SLOWEST else ar
    return state._replace(ar=ar) if polynomial.is_stable((-ar).tolist(), MAX_ZERO) else state


def channels(layout: rows.Layout, state: State) -> tuple[Channel, ...]:
    """Return the channels of all inputs: the mixture of the memories that are believed."""
    shares = np.array(forgetting_mixture.shares(state.trust))
    kept = np.flatnonzero(shares > MIN_SHARE).tolist()
    inflation = variance_inflation(layout, state)
    found = [_channels_of(layout, state, k, inflation * _small_sample(state, k)) for k in kept]
    return found[0] if len(found) == 1 else _mixed(found, shares[kept] / shares[kept].sum())


def _small_sample(state: State, k: int) -> float:
    """Inflate variances by Student's t with as many degrees of freedom as a memory holds independent noise samples."""
    w1, w2 = state.weights[:, k].tolist()
    # the noise's variance over its spectrum at zero frequency
    long_run = state.recent / (1.0 - float(state.ar.sum())) ** 2
    return student_factor(w1 * w1 / w2 / state.stride * state.quality.power[1] / max(long_run, 1e-300)) ** 2


def _channels_of(layout: rows.Layout, state: State, k: int, inflation: float) -> tuple[Channel, ...]:
    known, grid, _ = _posterior(layout, state, k, inflation)
    weights = [fopdt_posterior.marginal(grid, i) for i in range(layout.inputs)]
    tau = np.array([float(w @ c.tau) for w, c in zip(weights, grid.cells, strict=True)])
    dead_time = np.array([float(w @ c.dead_time) for w, c in zip(weights, grid.cells, strict=True)])
    by_K, by_tau, by_dead_time = (
        by_channel(layout, w) for w in reduced_basis.with_slopes(layout.basis, tau, dead_time)
    )
    J = []
    for i in range(layout.inputs):
        K = float(np.vdot(grid.weight, grid.K[i]))
        J.append(np.array([by_K[i], K * by_tau[i], K * by_dead_time[i]]))
    variance = inflation * grid.residual / max(known.freedom, 1)
    limits = fopdt_posterior.bounds(known, J, variance, layout.basis.box)
    used = float(state.weights[0, k]) * layout.step
    return fopdt_posterior.channels(grid, layout.basis.box, limits, used)


def _mixed(found: list[tuple[Channel, ...]], shares: Array) -> tuple[Channel, ...]:
    """Mean of the memories' intervals, widened by what they differ by; quotable is what all may quote."""
    out = []
    order = [Identifiable.NOT, Identifiable.GAIN_ONLY, Identifiable.SUM_ONLY, Identifiable.OK]
    for parts in zip(*found, strict=True):
        fields = {}
        for name in ("K", "tau", "dead_time", "tau_plus_dead_time"):
            value, low, high = np.array([getattr(part, name) for part in parts]).T
            mean = float(shares @ value)
            down = float(shares @ ((value - low) ** 2 + (value - mean) ** 2)) ** 0.5
            up = float(shares @ ((high - value) ** 2 + (value - mean) ** 2)) ** 0.5
            fields[name] = Interval(mean, mean - down, mean + up)
        least = min((part.status for part in parts), key=order.index)
        out.append(parts[-1]._replace(**fields, status=least, progress=None))
    return tuple(out)


def seconds(layout: rows.Layout, state: State) -> float:
    """S of data that the longest memory knows."""
    return float(state.weights[0, -1]) * layout.step


def whitening_order(state: State) -> int:
    """Order of D."""
    return len(state.ar)
