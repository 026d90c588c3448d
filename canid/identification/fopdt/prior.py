"""Declared prior of lags and dead times: off unless the vehicle file states it, and always shown with its weight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from canid.identification.fopdt.fopdt_posterior import Cells
from canid.types import NAN, Array

# s; from exact to indifferent
Belief = Annotated[float, Field(ge=1e-3, le=100.0, allow_inf_nan=False)]


class Prior(NamedTuple):
    """Prior distributions of lags and dead times; NaN: none."""

    tau: Belief = NAN  # s, median of a log-normal
    # one standard deviation up is the median times this
    tau_factor: Annotated[float, Field(ge=1.001, le=100.0, allow_inf_nan=False)] = NAN
    dead_time: Annotated[float, Field(ge=0.0, le=10.0, allow_inf_nan=False)] = NAN  # s, mean of a normal
    dead_time_sd: Belief = NAN  # s
    same_tau: Belief = NAN  # s, sd of the difference between the two channels
    same_dead_time: Belief = NAN  # s


def check_prior(prior: Prior) -> None:
    """Refuse a prior that makes no sense.

    Raises:
        ValueError: names the number.

    >>> check_prior(Prior(tau=0.35, tau_factor=0.5))
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

    >>> one = Cells(np.array([0.35, 0.7]), np.array([0.3, 0.3]), np.ones(2), (0.1, 0.1), np.ones(2), np.ones(2))
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
