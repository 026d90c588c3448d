"""Draws of gains, lags and dead times of a driver from FOPDT's joint posterior, and of the car from its own covariance.

A lag that is not identifiable alone moves the gains with it; the joint posterior holds that. Gains are then stretched to the
stated intervals, which are wider than the posterior (they hold the profile likelihood's, and the feedback's bias is taken
off: `mathematics/identification/feedback_bias.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import QUANTILES
from canid.mathematics.identification.fopdt import posterior_cells
from canid.mathematics.identification.fopdt.fopdt_posterior import Grid
from canid.mathematics.systems.car_response import CarResponse
from canid.values.types import Array, Interval


class Drawn(NamedTuple):
    """k drivers."""

    K: Array  # (k, 2)
    tau: Array  # (k, 2) s
    dead_time: Array  # (k, 2) s


def driver_draws(posterior: Grid, gains: tuple[Interval, Interval], count: int) -> Drawn:
    """Draw drivers; the same posterior gives the same draws: no estimate may depend on chance.

    Args:
        posterior: of two channels.
        gains: the stated intervals.
        count: how many.
    """
    rng = np.random.default_rng(0)
    # systematic sampling of the pairs of cells (Kitagawa 1996): less scatter than independent draws
    weight = posterior.weight.ravel()
    at = np.searchsorted(np.cumsum(weight) / weight.sum(), (np.arange(count) + rng.uniform()) / count)
    chosen = np.unravel_index(np.minimum(at, len(weight) - 1), posterior.weight.shape)
    tau, dead_time = np.empty((count, 2)), np.empty((count, 2))
    for i, (cells, k) in enumerate(zip(posterior.cells, chosen, strict=True)):
        along = cells.tau_width[k] * rng.uniform(-0.5, 0.5, count)
        tau[:, i] = cells.tau[k] + along
        across = cells.dead_time_width[k] * rng.uniform(-0.5, 0.5, count)
        dead_time[:, i] = cells.dead_time[k] + posterior_cells.lean(cells)[k] * along + across
    z, other = rng.standard_normal((2, count))
    # estimates of two gains scatter against each other as far as their answers are alike
    r = posterior.K_correlation[chosen]
    scatter = (z, r * z + np.sqrt(np.maximum(1.0 - r * r, 0.0)) * other)
    K = np.column_stack(
        [
            stretched(mean[chosen] + sd[chosen] * e, gain)
            for mean, sd, e, gain in zip(posterior.K, posterior.K_sd, scatter, gains, strict=True)
        ]
    )
    return Drawn(K, np.maximum(tau, 0.0), np.maximum(dead_time, 0.0))


def stretched(draws: Array, stated: Interval) -> Array:
    """Move and stretch draws to a stated median and interval, each side by its own factor.

    Args:
        draws: (n,).
        stated: value and 95 % interval.

    >>> x = stretched(np.linspace(-1.0, 1.0, 201), Interval(5.0, 4.05, 7.85))
    >>> [round(float(np.quantile(x, q)), 2) for q in (QUANTILES[0], 0.5, QUANTILES[1])]
    [4.05, 5.0, 7.85]
    """
    low, middle, high = np.quantile(draws, (QUANTILES[0], 0.5, QUANTILES[1]))
    below = (stated.value - stated.low) / max(middle - low, 1e-300)
    above = (stated.high - stated.value) / max(high - middle, 1e-300)
    from_middle = draws - middle
    out: Array = stated.value + from_middle * np.where(from_middle < 0.0, below, above)
    return out


def car_draws(car: CarResponse, count: int) -> Array:
    """Draw strength, lag and damping, (3, k); a lag or damping below 0 is 0, a strength a tenth of its value at least."""
    rng = np.random.default_rng(1)
    value = np.array([car.strength.value, car.lag.value, car.damping.value])
    drawn = rng.multivariate_normal(value, car.covariance, count, method="eigh").T
    out: Array = np.maximum(drawn, np.array([[0.1 * car.strength.value], [0.0], [0.0]]))
    return out
