"""A declared prior on lags and dead times: off unless the vehicle file states it, and always shown with its weight."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from canid.identification.posterior import Cells
from canid.types import Array, Prior


def check(prior: Prior) -> None:
    """Refuse a prior that makes no sense.

    Raises:
        ValueError: says which number.

    >>> check(Prior(tau=0.35, tau_factor=0.5))
    Traceback (most recent call last):
    ValueError: prior: tau_factor = 0.5 must be above 1
    """
    for name, least in (
        ("tau", 0.0),
        ("tau_factor", 1.0),
        ("dead_time_sd", 0.0),
        ("same_tau", 0.0),
        ("same_dead_time", 0.0),
    ):
        value = getattr(prior, name)
        if value <= least or math.isinf(value):
            raise ValueError(f"prior: {name} = {value:g} must be above {least:g}")
    for pair in (("tau", "tau_factor"), ("dead_time", "dead_time_sd")):
        if math.isnan(getattr(prior, pair[0])) != math.isnan(getattr(prior, pair[1])):
            raise ValueError(f"prior: {pair[0]} and {pair[1]} belong together: give both or neither")
    if prior.dead_time < 0.0:
        raise ValueError(f"prior: dead_time = {prior.dead_time:g} must not be negative")


def log_density(prior: Prior, cells: Sequence[Cells]) -> Array:
    """Log of the declared prior at every pair of cells, up to a constant: (c1,) or (c1, c2).

    A log-normal tau, a normal dead time, the same for every channel; and normal differences between two channels.
    The cells' own mass already holds the 1/tau of a log-normal.

    >>> one = Cells(np.array([0.35, 0.7]), np.array([0.3, 0.3]), np.ones(2), (0.1, 0.1))
    >>> log_density(Prior(tau=0.35, tau_factor=2.0), [one])
    array([ 0. , -0.5])
    """
    each = []
    for c in cells:
        total = np.zeros(len(c.tau))
        if prior.tau > 0.0:
            total -= 0.5 * (np.log(c.tau / prior.tau) / math.log(prior.tau_factor)) ** 2
        if prior.dead_time >= 0.0:
            total -= 0.5 * ((c.dead_time - prior.dead_time) / prior.dead_time_sd) ** 2
        each.append(total)
    if len(each) == 1:
        return each[0]
    out: Array = each[0][:, None] + each[1]
    if prior.same_tau > 0.0:
        out -= 0.5 * (np.subtract.outer(cells[0].tau, cells[1].tau) / prior.same_tau) ** 2
    if prior.same_dead_time > 0.0:
        out -= 0.5 * (np.subtract.outer(cells[0].dead_time, cells[1].dead_time) / prior.same_dead_time) ** 2
    return out
