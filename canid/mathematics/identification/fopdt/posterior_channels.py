"""Channels from the joint posterior: intervals, and which of them may be quoted."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from canid.mathematics.identification import identifiability
from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE
from canid.mathematics.identification.fopdt.fopdt_posterior import Grid, marginal
from canid.mathematics.identification.fopdt.information_bounds import Deviations, precision
from canid.mathematics.identification.fopdt.posterior_cells import lean
from canid.mathematics.identification.fopdt.reduced_basis import Box
from canid.mathematics.identification.fopdt.weighted_quantiles import (
    MIN_WEIGHT,
    cell_quantiles,
    mixture_quantiles,
)
from canid.mathematics.identification.identifiability import PARAMETERS
from canid.values.types import NAN, Array, Channel, Interval

# A marginal whose last cell at the upper end of the box holds this share of the fullest cell's is pressed
# to the box: its width is then that of the search. (The lower ends are physics, not convention.)
PRESSED_SHARE = 0.05


def _worst(left: Array, K: Array, sd: Array) -> tuple[float, float]:
    """Return the gain's 95 % profile likelihood interval: the union over all lags that the data allow.

    Without the prior: where the lag of one channel is not identifiable, the gain of the other depends on it.

    Args:
        left: (n,) what is left of the 95 % quantile of chi-squared with one degree of freedom at each pair of cells,
            positive.
        K: (n,) gains.
        sd: (n,) of the gains.
    """
    reach = np.sqrt(left) * sd
    return float((K - reach).min()), float((K + reach).max())


def channels(
    grid: Grid,
    box: Box,
    limits: Sequence[Deviations],
    used: float,
    believed: bool = False,
    gains: Sequence[bool] = (),
    settled: bool = False,
) -> tuple[Channel, ...]:
    """Channels: every interval, and which of them may be quoted.

    Identifiability is judged by what the data alone allow, not by the width of the posterior, which the box narrows as
    well; how well it is known is the posterior's width. With a declared prior (`believed`) it is judged by the
    posterior, and `prior_weights` are the shares of it that the prior brought. `used`: s of data; `gains`: per channel,
    whether a prior of its gain is declared; `settled`: of all gains and delays one is declared, so none is left to the box:
    the intervals of gains are the posterior's then, without the union over all lags that the data allow.
    """
    weight, every_K, every_sd = grid.weight, grid.K, grid.K_sd
    possible = np.where(np.isfinite(grid.log), grid.fit, -np.inf)
    if grid.gains is not None:
        # every component of the prior is a pair of cells of its own
        weight, possible = grid.gains.share * weight, grid.gains.profile + possible
        every_K, every_sd = grid.gains.mean, tuple(np.sqrt(v) for v in grid.gains.variance)
    weight, possible = weight.ravel(), possible.ravel()
    kept = np.flatnonzero(weight > MIN_WEIGHT * float(weight.max()))
    left = CHI_SQUARED_QUANTILE + 2.0 * (possible - possible.max())
    allowed = np.flatnonzero(left > 0.0)
    left = left[allowed]
    out = []
    for i, (K, sd) in enumerate(zip(every_K, every_sd, strict=True)):
        K, sd = K.ravel(), sd.ravel()
        mean = mixture_quantiles(weight[kept], K[kept], sd[kept])
        low, high = (mean.low, mean.high) if settled else _worst(left, K[allowed], sd[allowed])
        gain = Interval(mean.value, min(mean.low, low), max(mean.high, high))
        out.append(_channel(grid, i, box, gain, limits[i], used, believed, bool(gains) and gains[i]))
    return tuple(out)


def _gain_sd(grid: Grid, index: int) -> float:
    """Standard deviation of a gain over its whole posterior."""
    K, sd = grid.K[index], grid.K_sd[index]
    mean = float(np.vdot(grid.weight, K))
    return math.sqrt(float(np.vdot(grid.weight, sd * sd + (K - mean) ** 2)))


def _sd(w: Array, x: Array) -> float:
    return math.sqrt(float(w @ (x - float(w @ x)) ** 2))


def _channel(
    grid: Grid,
    index: int,
    box: Box,
    K: Interval,
    limit: Deviations,
    used: float,
    believed: bool,
    gain_believed: bool,
) -> Channel:
    w, c = marginal(grid, index), grid.cells[index]
    total = c.tau + c.dead_time
    weight, weights = NAN, {}
    if believed:
        known = Deviations(_gain_sd(grid, index), *(_sd(w, x) for x in (c.tau, c.dead_time, total)))
        # share of the precision: the data's own is what they would know alone
        weights = {
            name: 1.0 - (a / b) ** 2 if a < b else 0.0
            for name, a, b in zip(PARAMETERS, known, limit, strict=True)
        }
        weight = max(share for name, share in weights.items() if name != "K" or gain_believed)
        least = Deviations(*(min(a, b) for a, b in zip(known, limit, strict=True)))
        limit = least if gain_believed else least._replace(K=limit.K)
    # pressed to the box: tau and dead time end where we stopped looking, and so does their sum
    free = not pressed(grid, index, box)
    status = identifiability.judge(K, limit.K, limit.tau, limit.dead_time, limit.total, free)
    half_tau, half, slope = 0.5 * c.tau_width, 0.5 * c.dead_time_width, lean(c)
    # within its cell, too, a dead time that leans against tau keeps their sum
    delays = (
        cell_quantiles(c.tau, half_tau, w),
        cell_quantiles(c.dead_time, np.hypot(slope * half_tau, half), w, 0.0, box.dead_time_max),
        cell_quantiles(total, np.hypot((1.0 + slope) * half_tau, half), w, box.tau_min),
    )
    made = identifiability.channel(status, K, *delays)
    by_tau, by_dead_time = (p**-0.5 for p in precision(box))
    of_box = (math.inf, by_tau, by_dead_time, math.hypot(by_tau, by_dead_time))
    # what the prior knows was there before the data, as the box
    known_before = weights if gain_believed else {**weights, "K": 0.0}
    before = [
        box_sd if not share > 0.0 else (share / max(sd * sd, 1e-300) + box_sd**-2) ** -0.5
        for box_sd, sd, share in zip(
            of_box, limit, (known_before.get(p, 0.0) for p in PARAMETERS), strict=True
        )
    ]
    missing = identifiability.progress(made.status, K, limit, before, used, free)
    return made._replace(prior_weight=weight, progress=missing, prior_weights=weights)


def pressed(grid: Grid, index: int, box: Box) -> bool:
    """Whether the posterior leans on the upper end of the box, in tau or in dead time."""
    w, c = marginal(grid, index), grid.cells[index]
    for x, end, spacing in (
        (c.tau, box.tau_max, c.spacing[0]),
        (c.dead_time, box.dead_time_max, c.spacing[1]),
    ):
        mass = np.bincount(np.floor((end - x) / spacing).astype(np.int64), w)
        if mass[0] > PRESSED_SHARE * mass.max():
            return True
    return False
