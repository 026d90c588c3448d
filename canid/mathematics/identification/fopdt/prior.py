"""Declared prior of gains, lags and dead times: off unless the vehicle file states it, and always shown with its weight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from canid.mathematics.identification.fopdt import gain_prior
from canid.mathematics.identification.fopdt.gain_prior import (
    ATYPICAL_FACTOR,
    ATYPICAL_SHARE,
    GainPrior,
    Normal,
)
from canid.mathematics.identification.fopdt.posterior_cells import Cells
from canid.mathematics.identification.fopdt.reduced_basis import Box
from canid.values.types import NAN, Array

# s; from exact to indifferent
Belief = Annotated[float, Field(ge=1e-3, le=100.0, allow_inf_nan=False)]
# one standard deviation up is the median times this
Factor = Annotated[float, Field(ge=1.001, le=100.0, allow_inf_nan=False)]
DeadTime = Annotated[float, Field(ge=0.0, le=10.0, allow_inf_nan=False)]  # s
# output unit per input unit, of whatever units
Gain = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
GainSd = Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False)]


class ChannelPrior(NamedTuple):
    """Prior distributions of one input's parameters; NaN: none. Of the delays two of three: the third follows."""

    K: Gain = NAN  # output unit per input unit, mean of a normal
    K_sd: GainSd = NAN
    tau: Belief = NAN  # s, median of a log-normal
    tau_factor: Factor = NAN
    dead_time: DeadTime = NAN  # s, mean of a normal
    dead_time_sd: Belief = NAN  # s
    tau_plus_dead_time: Belief = NAN  # s, median of a log-normal
    tau_plus_dead_time_factor: Factor = NAN


class Prior(NamedTuple):
    """Prior distributions; NaN, None: none. What is not in a channel's own holds for every channel."""

    tau: Belief = NAN  # s, median of a log-normal
    tau_factor: Factor = NAN
    dead_time: DeadTime = NAN  # s, mean of a normal
    dead_time_sd: Belief = NAN  # s
    same_tau: Belief = NAN  # s, sd of the difference between the two channels
    same_dead_time: Belief = NAN  # s
    headway_error: ChannelPrior | None = None
    range_rate: ChannelPrior | None = None
    lateral_offset: ChannelPrior | None = None
    # of the two gains among drivers
    gain_correlation: Annotated[float, Field(ge=-0.95, le=0.95, allow_inf_nan=False)] = NAN
    # share of drivers that the channels' own priors do not describe; NaN: `ATYPICAL_SHARE`
    atypical: Annotated[float, Field(ge=0.0, le=0.5, allow_inf_nan=False)] = NAN


# the fields of a prior that are a channel's own
CHANNELS = ("headway_error", "range_rate", "lateral_offset")


class InputPrior(NamedTuple):
    """A prior, laid out for the inputs of a fit."""

    common: Prior
    own: tuple[ChannelPrior | None, ...]  # (m,)
    gains: GainPrior | None
    atypical: float


def for_inputs(prior: Prior, names: Sequence[str]) -> InputPrior:
    """Lay a prior out for the inputs of a fit.

    Args:
        prior: declared.
        names: of the inputs, in their order.

    Raises:
        ValueError: it has a channel's own prior, and the inputs have no names.

    >>> for_inputs(Prior(range_rate=ChannelPrior(K=5.6, K_sd=1.1)), ("headway_error", "range_rate")).gains.mean
    (0.0, 5.6)
    """
    stated = {name: given for name in CHANNELS if (given := getattr(prior, name)) is not None}
    if stated and not names:
        raise ValueError(f"a prior of {', '.join(stated)}: the inputs need names")
    given = tuple(stated.get(name) for name in names)
    atypical = ATYPICAL_SHARE if math.isnan(prior.atypical) else prior.atypical
    correlation = 0.0 if math.isnan(prior.gain_correlation) else prior.gain_correlation
    normals = [Normal(NAN, NAN) if c is None else Normal(c.K, c.K_sd) for c in given]
    return InputPrior(prior, given, gain_prior.make(normals, correlation, atypical), atypical)


def states_nothing(prior: InputPrior) -> bool:
    """Whether it is about none of these inputs' parameters.

    >>> states_nothing(for_inputs(Prior(), ())), states_nothing(for_inputs(Prior(tau=0.5, tau_factor=1.5), ()))
    (True, False)
    """
    common = prior.common._replace(headway_error=None, range_rate=None, lateral_offset=None)
    return common == Prior() and not any(prior.own)


def states_all(prior: InputPrior) -> bool:
    """Whether it is about every gain, and about the delays of every channel, if only by a tie to those of another.

    >>> one = ChannelPrior(K=5.6, K_sd=1.1, tau_plus_dead_time=0.8, tau_plus_dead_time_factor=1.3)
    >>> states_all(for_inputs(Prior(range_rate=one), ("range_rate",)))
    True
    """
    common = prior.common
    delays = [
        common.tau > 0.0
        or common.dead_time >= 0.0
        or (
            channel is not None
            and (channel.tau > 0.0 or channel.dead_time >= 0.0 or channel.tau_plus_dead_time > 0.0)
        )
        for channel in prior.own
    ]
    tied = common.same_tau > 0.0 and common.same_dead_time > 0.0
    return prior.gains is not None and all(prior.gains.stated) and (any(delays) if tied else all(delays))


_PAIRS = (
    ("K", "K_sd"),
    ("tau", "tau_factor"),
    ("dead_time", "dead_time_sd"),
    ("tau_plus_dead_time", "tau_plus_dead_time_factor"),
)
# what must be above which number
_LEAST = {
    "K_sd": 0.0,
    "tau": 0.0,
    "tau_factor": 1.0,
    "dead_time_sd": 0.0,
    "tau_plus_dead_time": 0.0,
    "tau_plus_dead_time_factor": 1.0,
    "same_tau": 0.0,
    "same_dead_time": 0.0,
}


def incomplete(stated: Prior | ChannelPrior) -> Iterator[str]:
    """Sentences on what is stated in part, or twice.

    >>> list(incomplete(ChannelPrior(K=5.6)))
    ['K and K_sd belong together: give both or neither']
    """
    for a, b in _PAIRS:
        if hasattr(stated, a) and math.isnan(getattr(stated, a)) != math.isnan(getattr(stated, b)):
            yield f"{a} and {b} belong together: give both or neither"
    if isinstance(stated, ChannelPrior) and not any(
        math.isnan(x) for x in (stated.tau, stated.dead_time, stated.tau_plus_dead_time)
    ):
        yield "tau, dead_time and tau_plus_dead_time: give two of them, the third follows"
    if isinstance(stated, Prior):
        known = [given for name in CHANNELS if (given := getattr(stated, name)) is not None]
        with_gain = [channel for channel in known if not math.isnan(channel.K)]
        if not math.isnan(stated.gain_correlation) and len(with_gain) < 2:
            yield "gain_correlation needs K and K_sd of two channels"
        if not math.isnan(stated.atypical) and not known:
            yield "atypical needs a channel's own prior, such as [fopdt.prior.range_rate]"


def is_empty(stated: Prior | ChannelPrior) -> bool:
    """Whether nothing is stated."""
    return all(x is None or (isinstance(x, float) and math.isnan(x)) for x in stated)


def check_prior(prior: Prior) -> None:
    """Refuse a prior that makes no sense.

    Raises:
        ValueError: names the number.

    >>> check_prior(Prior(tau=0.35, tau_factor=0.5))
    Traceback (most recent call last):
    ValueError: prior: tau_factor = 0.5 must be above 1
    """
    by_channel = {name: given for name in CHANNELS if (given := getattr(prior, name)) is not None}
    every: dict[str, Prior | ChannelPrior] = {"prior": prior} | {
        f"prior.{k}": given for k, given in by_channel.items()
    }
    for where, stated in every.items():
        for name, least in _LEAST.items():
            value = getattr(stated, name, NAN)
            if value <= least or math.isinf(value):
                raise ValueError(f"{where}: {name} = {value:g} must be above {least:g}")
        for says in incomplete(stated):
            raise ValueError(f"{where}: {says}")
        if stated.dead_time < 0.0:
            raise ValueError(f"{where}: dead_time = {stated.dead_time:g} must not be negative")
        if isinstance(stated, ChannelPrior) and math.isinf(stated.K):
            raise ValueError(f"{where}: K = {stated.K:g} must be finite")
    for name, low, high in (("gain_correlation", -0.95, 0.95), ("atypical", 0.0, 0.5)):
        value = getattr(prior, name)
        if not (math.isnan(value) or low <= value <= high):
            raise ValueError(f"prior: {name} = {value:g} must lie between {low:g} and {high:g}")


def log_density(prior: Prior, cells: Sequence[Cells]) -> Array:
    """Log of what a prior states of every channel alike at every pair of cells, up to a constant: (c1,) or (c1, c2).

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


class Density(NamedTuple):
    """A prior of lags and dead times at every pair of cells, (c1,) or (c1, c2), up to a constant."""

    log: Array  # of the density over the coordinates in which it is stated
    # log of what makes the cells' mass that of those coordinates: with it a channel's own prior is the one that is stated,
    # within the box; None: the mass stays as it is
    measure: Array | None


def density(prior: InputPrior, cells: Sequence[Cells], box: Box) -> Density:
    """Evaluate a prior of lags and dead times.

    Args:
        prior: of the inputs.
        cells: of each.
        box: that the cells' mass is of.
    """
    log = log_density(prior.common, cells)
    if not any(channel is not None for channel in prior.own):
        return Density(log, None)
    each = [
        (np.zeros(len(c.tau)), np.zeros(len(c.tau)))
        if channel is None
        else (own_density(channel, c, prior.atypical), _measure(channel, c, box))
        for channel, c in zip(prior.own, cells, strict=True)
    ]
    if len(each) == 1:
        return Density(log + each[0][0], each[0][1])
    return Density(log + each[0][0][:, None] + each[1][0], each[0][1][:, None] + each[1][1])


def own_density(channel: ChannelPrior, cells: Cells, atypical: float) -> Array:
    """Log density (c,) of a channel's own delays: each a contaminated normal, of a logarithm or of the time itself.

    >>> one = Cells(np.array([0.3, 0.7]), np.array([0.3, 0.5]), np.ones(2), (0.1, 0.1), np.ones(2), np.ones(2))
    >>> own_density(ChannelPrior(tau_plus_dead_time=0.6, tau_plus_dead_time_factor=2.0), one, 0.0)
    array([ 0. , -0.5])
    """
    total = np.zeros(len(cells.tau))
    if channel.tau > 0.0:
        total += _contaminated(np.log(cells.tau / channel.tau) / math.log(channel.tau_factor), atypical)
    if channel.dead_time >= 0.0:
        total += _contaminated((cells.dead_time - channel.dead_time) / channel.dead_time_sd, atypical)
    if channel.tau_plus_dead_time > 0.0:
        z = np.log((cells.tau + cells.dead_time) / channel.tau_plus_dead_time)
        total += _contaminated(z / math.log(channel.tau_plus_dead_time_factor), atypical)
    return total


def _contaminated(z: Array, atypical: float) -> Array:
    """Log density (c,) of Tukey's contaminated normal at z standard deviations."""
    if atypical <= 0.0:
        plain: Array = -0.5 * z * z
        return plain
    typical = math.log(1.0 - atypical) - 0.5 * z * z
    wide = math.log(atypical / ATYPICAL_FACTOR) - 0.5 * (z / ATYPICAL_FACTOR) ** 2
    out: Array = np.logaddexp(typical, wide)
    return out


# a cell at the very end of the box has no mass, and no logarithm
_LEAST_SHARE = 1e-12


def _measure(channel: ChannelPrior, cells: Cells, box: Box) -> Array:
    """Log (c,) of the mass of the stated coordinates over the cells' own, (1 - dead time / its end) / tau.

    Coordinates: log tau, dead time, log of their sum. Where the sum alone is stated, its share in either delay is the box's.
    """
    tau, dead_time, total = cells.tau, cells.dead_time, cells.tau + cells.dead_time
    by_tau, by_dead_time, by_sum = (
        channel.tau > 0.0,
        channel.dead_time >= 0.0,
        channel.tau_plus_dead_time > 0.0,
    )
    out = np.zeros(len(tau))
    if not (by_tau or by_dead_time or by_sum):
        return out
    if by_dead_time or (by_sum and by_tau):
        out -= np.log(np.maximum(1.0 - dead_time / box.dead_time_max, _LEAST_SHARE))
    if by_sum:
        out -= np.log(total)
        if by_dead_time:
            out += np.log(tau)
        elif not by_tau:
            # mass of the box at one sum: the integral over tau of (1 - (total - tau) / end) / tau
            low = np.maximum(box.tau_min, total - box.dead_time_max)
            high = np.minimum(box.tau_max, total)
            end = box.dead_time_max
            mass = (1.0 - total / end) * np.log(high / low) + (high - low) / end
            out -= np.log(np.maximum(mass, _LEAST_SHARE))
    return out
