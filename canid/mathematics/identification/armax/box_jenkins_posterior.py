"""Gains, lags and dead times of a recursive Box-Jenkins model: the posterior of each memory, and their mixture."""

from __future__ import annotations

import numpy as np

from canid.mathematics.identification import autoregression
from canid.mathematics.identification.armax import forgetting_mixture, polynomial
from canid.mathematics.identification.armax.box_jenkins_state import State, lead, solved, unit_answers
from canid.mathematics.identification.fopdt import (
    channel_mixture,
    fopdt_posterior,
    grid_search,
    information_bounds,
    input_noise,
    posterior_cells,
    posterior_channels,
    posterior_region,
    reduced_basis,
)
from canid.mathematics.identification.fopdt import regression_rows as rows
from canid.mathematics.identification.fopdt.row_noise import student_factor
from canid.mathematics.identification.residual_tests import HAC_LAG_S
from canid.values.types import Channel

# Passes of the posterior's grid: from the whole box to 5 ms takes five.
MAX_PASSES = 8
# of D: noise that remembers for longer is not distinguishable from a drifting offset
MAX_ZERO = 0.999
# Share of a memory in the mixture below which it changes no interval.
MIN_SHARE = 0.05
# s of innovations below which their blocks say nothing about how white they are
MIN_SCORED_S = 30.0


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
    """Long-run over plain variance of the block scores, at least 1 (Newey & West 1987), see residual_tests.py.

    Times what the law of the innovations asks.
    """
    # the first blocks say little: a mean of squares over n blocks is off by sqrt(2 / n)
    moving = state.score[1] > 0.0
    if not moving.any() or state.blocks * HAC_LAG_S < MIN_SCORED_S:
        return state.law.inflation
    return max(1.0, float(np.mean(state.score[0][moving] / state.score[1][moving]))) * state.law.inflation


def _posterior(
    layout: rows.Layout, state: State, k: int, inflation: float
) -> tuple[fopdt_posterior.Moments, fopdt_posterior.Grid, tuple[posterior_cells.Region, ...]]:
    """Close in on the posterior of one memory from where it was."""
    box = layout.basis.box
    known = _moments(layout, state, k)
    regions = state.regions
    for _ in range(MAX_PASSES):
        cells = tuple(posterior_cells.make_cells(region, box) for region in regions)
        side = posterior_cells.CELLS_PER_AXIS
        tau = np.concatenate([c.tau[::side] for c in cells])
        dead_time = np.concatenate([c.dead_time for c in cells]).reshape(-1, side)
        every = reduced_basis.weights_on_grid(layout.basis, tau, dead_time)
        W = tuple(every.reshape(len(cells), side * side, -1))
        grid = fopdt_posterior.evaluate(known, W, cells, inflation)
        regions = tuple(posterior_region.gather(grid, i, box) for i in range(layout.inputs))
        fine = all(grid_search.is_fine(r, c) for r, c in zip(regions, cells, strict=True))
        if fine and not any(posterior_region.missed(grid, i, box) for i in range(layout.inputs)):
            break
    return known, grid, regions


def located(layout: rows.Layout, state: State) -> State:
    """Find the point anew at which predictions are made: the posterior mean of the memory that is believed most."""
    inflation = variance_inflation(layout, state)
    _, grid, regions = _posterior(layout, state, lead(state), inflation)
    weights = [fopdt_posterior.marginal(grid, i) for i in range(layout.inputs)]
    tau = [float(w @ c.tau) for w, c in zip(weights, grid.cells, strict=True)]
    dead_time = [float(w @ c.dead_time) for w, c in zip(weights, grid.cells, strict=True)]
    gains = [float(np.vdot(grid.weight, K)) for K in grid.K]
    nodes = unit_answers(layout, np.array(tau), np.array(dead_time))
    state = state._replace(regions=regions, point=np.array([gains, tau, dead_time]), nodes=nodes)
    # the offset that belongs to them
    size = layout.inputs * layout.basis.size
    G = state.products[lead(state)]
    w = np.concatenate([-np.array(gains) @ nodes[0], [1.0]])
    offset = float(w @ G[: size + 1, size + 1]) / max(float(G[size + 1, size + 1]), 1e-300)
    return _with_noise(layout, state._replace(offset=offset))


def _with_noise(layout: rows.Layout, state: State) -> State:
    """Whiten the next rows by D as now estimated: its mean so far, and what the longest memory finds missing."""
    missing = solved(layout, state)[2][-1, layout.inputs + 1 :]
    ar = state.mean_ar + missing
    total = float(ar.sum())
    ar = ar * (autoregression.SLOWEST / total) if total > autoregression.SLOWEST else ar
    return state._replace(ar=ar) if polynomial.is_stable((-ar).tolist(), MAX_ZERO) else state


def channels(layout: rows.Layout, state: State) -> tuple[Channel, ...]:
    """Return the channels of all inputs: the mixture of the memories that are believed."""
    shares = np.array(forgetting_mixture.shares(state.trust))
    kept = np.flatnonzero(shares > MIN_SHARE).tolist()
    inflation = variance_inflation(layout, state)
    per_memory = [_channels_of(layout, state, k, inflation * _small_sample(state, k)) for k in kept]
    return channel_mixture.mixed(per_memory, shares[kept] / shares[kept].sum())


def _small_sample(state: State, k: int) -> float:
    """Inflate variances by Student's t with as many degrees of freedom as a memory holds independent noise samples."""
    w1, w2 = state.weights[:, k].tolist()
    # the noise's variance over its spectrum at zero frequency
    long_run = state.law.variance * state.recent / (1.0 - float(state.ar.sum())) ** 2
    return student_factor(w1 * w1 / w2 / state.stride * state.quality.power[1] / max(long_run, 1e-300)) ** 2


def _channels_of(layout: rows.Layout, state: State, k: int, inflation: float) -> tuple[Channel, ...]:
    known, grid, _ = _posterior(layout, state, k, inflation)
    weights = [fopdt_posterior.marginal(grid, i) for i in range(layout.inputs)]
    tau = np.array([float(w @ c.tau) for w, c in zip(weights, grid.cells, strict=True)])
    dead_time = np.array([float(w @ c.dead_time) for w, c in zip(weights, grid.cells, strict=True)])
    K = np.array([float(np.vdot(grid.weight, each)) for each in grid.K])
    box, variance = layout.basis.box, inflation * grid.residual / max(known.freedom, 1)
    J = input_noise.slopes(K, reduced_basis.with_slopes(layout.basis, tau, dead_time))
    limits = information_bounds.bounds(known, J, variance, box)
    made = posterior_channels.channels(grid, box, limits, float(state.weights[0, k]) * layout.step)
    at = input_noise.Fitted(K, tau, dead_time, variance, 1.0)
    return input_noise.believed(made, limits, known, layout, at)
