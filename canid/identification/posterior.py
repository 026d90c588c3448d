"""How well (tau, dead time) of each channel are known: a posterior on a grid that finds its own place.

For every pair of cells (one per channel) the gains, the offset and the noise's colour are integrated or
minimised in closed form, from inner products alone; so the joint posterior over four numbers costs one matrix
product, and K1 is marginalised over all lags that the data allow, not over a parabola around one of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from canid.identification import first_order, verdict
from canid.types import Array, Channel, Interval

# Cells per axis: with a half-width of 4 sd a cell is 0.9 sd wide, where the midpoint rule is still exact to
# 1e-4.
CELLS = 9
REACH = 4.0

# A marginal whose last cell at the upper end of the box holds this share of the fullest cell's is pressed
# to the box: its width then says where we stopped looking. (The lower ends are physics, not convention.)
PRESSED = 0.05

_Z = np.array(
    [NormalDist().inv_cdf((i + 0.5) / 41) for i in range(41)]
)  # quantile points that stand for a Gaussian


class Box(NamedTuple):
    """Where tau and dead time may lie."""

    tau_min: float  # s
    tau_max: float  # s
    dead_time_max: float  # s


class Region(NamedTuple):
    """Where the grid of one channel lies: an ellipse's bounding parallelogram."""

    tau: float  # centre, s
    dead_time: float  # centre, s
    tau_sd: float  # s
    rest_sd: float  # sd of dead time at given tau, s
    slope: float  # of dead time by tau


class Cells(NamedTuple):
    """The grid of one channel."""

    tau: Array  # (c,) s
    dead_time: Array  # (c,) s
    weight: Array  # (c,) prior mass
    spacing: tuple[float, float]  # of tau and of dead time, s


class Grid(NamedTuple):
    """The joint posterior of all channels on their grids."""

    cells: tuple[Cells, ...]
    log: Array  # (c1,) or (c1, c2), log posterior, zero at its highest
    weight: Array  # of that shape, sums to one
    K: tuple[Array, ...]  # of the shape of `weight`
    K_sd: tuple[Array, ...]
    residual: float  # sum of squares at the most likely cell


def whole_box(box: Box) -> Region:
    """Return the region that covers the box.

    >>> whole_box(Box(0.02, 3.0, 1.5)).slope
    0.0
    """
    tau, half = 0.5 * (box.tau_min + box.tau_max), 0.5 * (box.tau_max - box.tau_min)
    return Region(tau, 0.5 * box.dead_time_max, half / REACH, 0.5 * box.dead_time_max / REACH, 0.0)


def lay(region: Region, box: Box, cells: int = CELLS) -> Cells:
    """Lay midpoint cells over a region, cut off at the box.

    The prior mass of a cell is its area times 1/tau (a lag is a scale: 0.1 to 0.2 s weighs as 1 to 2 s) times
    1 - dead_time / dead_time_max (the end of the box is where belief ends, so it ends at zero). A uniform
    box would put a headway lag that cannot be told at 2.2 s in the mean; as headway integrates range rate,
    K2 then comes out 3 % too large and its interval covers 0.72 (measured in closed loop; so 0.93).
    """
    low = max(box.tau_min, region.tau - REACH * region.tau_sd)
    high = min(box.tau_max, region.tau + REACH * region.tau_sd)
    middle = (np.arange(cells) + 0.5) / cells
    tau = low + (high - low) * middle
    centre = region.dead_time + region.slope * (tau - region.tau)
    bottom = np.clip(centre - REACH * region.rest_sd, 0.0, box.dead_time_max)
    top = np.clip(centre + REACH * region.rest_sd, 0.0, box.dead_time_max)
    width = top - bottom
    dead_time = bottom[:, None] + width[:, None] * middle
    lag = np.repeat(tau, cells)
    weight = np.repeat(width, cells) / lag * (1.0 - dead_time.ravel() / box.dead_time_max)
    spacing = ((high - low) / cells, float(np.max(width)) / cells)
    return Cells(lag, dead_time.ravel(), weight, spacing)


def columns(u: Array, dt: float, grid: Cells, starts: Sequence[int]) -> Array:
    """(c, n): the input as each cell answers it."""
    taus, first = np.unique(grid.tau, return_index=True)
    x = first_order.lags(u, dt, taus, starts)
    per = len(grid.tau) // len(taus)
    out = np.empty((len(grid.tau), len(u)))
    for row, tau, i in zip(x, taus, first, strict=True):
        out[i : i + per] = first_order.delayed(u, row, dt, float(tau), grid.dead_time[i : i + per])
    return out


def evaluate(y: Array, X: Sequence[Array], Z: Array, cells: Sequence[Cells], temper: float = 1.0) -> Grid:
    """Compute the posterior over the cells, gains and nuisance columns taken out.

    The prior is uniform over the box and, for the gains, uniform in K |X|: a prior uniform in K alone would
    prefer cells that hardly let the input through.

    Args:
        y: (n,) whitened output.
        X: per channel (c, n) whitened answers.
        Z: (n, q) whitened nuisance columns (offset, lagged residuals).
        cells: per channel.
        temper: >= 1; the likelihood is taken to the power 1/temper where the residual is not white.
    """
    Q = np.linalg.qr(Z)[0]
    yq = Q.T @ y
    total = float(y @ y - yq @ yq)
    freedom = len(y) - Z.shape[1] - len(X)
    A = [x @ Q for x in X]
    b = [x @ y - a @ yq for x, a in zip(X, A, strict=True)]
    s = []
    for x, a in zip(X, A, strict=True):
        raw = np.einsum("cn,cn->c", x, x)
        # an input that does not move is the offset again: bounded away from zero, its gain gets a huge sd
        s.append(np.maximum(raw - np.einsum("cq,cq->c", a, a), 1e-9 * raw + 1e-12))
    K: tuple[Array, ...]
    inverse: tuple[Array, ...]
    if len(X) == 1:
        K = (b[0] / s[0],)
        inverse = (1.0 / s[0],)
        explained = b[0] * K[0]
        prior = cells[0].weight
    elif len(X) == 2:
        s1, s2, b1, b2 = s[0][:, None], s[1][None, :], b[0][:, None], b[1][None, :]
        s12 = X[0] @ X[1].T - A[0] @ A[1].T
        det = np.maximum(s1 * s2 - s12 * s12, 1e-9 * s1 * s2)
        K = ((s2 * b1 - s12 * b2) / det, (s1 * b2 - s12 * b1) / det)
        inverse = (s2 / det, s1 / det)
        explained = b1 * K[0] + b2 * K[1]
        prior = cells[0].weight[:, None] * cells[1].weight[None, :]
    else:
        raise ValueError(f"{len(X)} inputs: one or two are supported")
    residual = np.maximum(total - explained, 1e-9 * total + 1e-300)
    with np.errstate(divide="ignore"):  # a cell outside the box has no mass
        log = np.log(prior) - 0.5 * freedom / temper * np.log(residual)
    best = np.unravel_index(int(np.argmax(log)), log.shape)
    log -= log[best]
    weight = np.exp(log)
    weight /= weight.sum()
    variance = residual * (temper / max(freedom, 1))
    K_sd = tuple(np.sqrt(variance * i) for i in inverse)
    return Grid(tuple(cells), log, weight, K, K_sd, float(residual[best]))


def marginal(grid: Grid, channel: int) -> Array:
    """Return (c,) weights of one channel's cells."""
    return _onto(grid.weight, channel)


def _onto(weight: Array, channel: int) -> Array:
    other = tuple(i for i in range(weight.ndim) if i != channel)
    out: Array = weight.sum(axis=other) if other else weight
    return out


# sd in cells from which on a grid shows where a posterior lies and how it leans; below, one cell hides it.
SEEN = 0.8


def gather(grid: Grid, channel: int, box: Box) -> Region:
    """Where the posterior of one channel lies: the region of the next, finer grid.

    A posterior narrower than a cell is looked at through a power of it, log/4, log/16, ..., which is wide
    enough to be seen; for a Gaussian that leaves the centre and the slope and doubles the widths each time.
    """
    c = grid.cells[channel]
    power = 1.0
    while True:
        weight = grid.weight if power == 1.0 else np.exp(power * grid.log)
        w = _onto(weight, channel)
        w = w / w.sum()
        tau, dead_time = float(w @ c.tau), float(w @ c.dead_time)
        vt = float(w @ (c.tau - tau) ** 2)
        slope = float(w @ ((c.tau - tau) * (c.dead_time - dead_time))) / max(vt, 1e-12)
        rest = float(w @ (c.dead_time - dead_time - slope * (c.tau - tau)) ** 2)
        seen = vt >= (SEEN * c.spacing[0]) ** 2 and rest >= (SEEN * c.spacing[1]) ** 2
        # 1e-6: a thousandth of a cell; nothing in a drive is known to more
        if seen or power < 1e-6:
            break
        power *= 0.25
    # a twelfth of a cell squared is the variance of a uniform cell: not to shrink more than fourfold at once
    vt = max(vt * power, c.spacing[0] ** 2 / 12)
    rest = max(rest * power, c.spacing[1] ** 2 / 12)
    w = marginal(grid, channel)
    spills_tau, spills_rest = _spills(w, c, box)
    # where the posterior lies partly outside, half as wide again as this grid, and centred on the rim
    side = round(len(w) ** 0.5)
    grow = 1.5 * side / (2.0 * REACH)
    return Region(
        tau,
        dead_time,
        max(vt**0.5, grow * c.spacing[0]) if spills_tau else vt**0.5,
        max(rest**0.5, grow * c.spacing[1]) if spills_rest else rest**0.5,
        slope,
    )


# Mass on the rim of a grid that does not end at the box: the posterior lies partly outside. On a Gaussian
# within its four sd the rim holds 0.1 %; a tenth of what a flat posterior would hold there is twelve times
# that.
SPILL = 0.012


def _spills(w: Array, c: Cells, box: Box) -> tuple[bool, bool]:
    """Whether along tau, and along dead time."""
    side = round(len(w) ** 0.5)
    table, dead_time = w.reshape(side, side), c.dead_time.reshape(side, side)
    half_tau, half = 0.51 * c.spacing[0], 0.51 * c.spacing[1]
    low, high = table[:, 0], table[:, -1]
    tau = (c.tau[0] - half_tau > box.tau_min and float(table[0].sum()) > SPILL) or (
        c.tau[-1] + half_tau < box.tau_max and float(table[-1].sum()) > SPILL
    )
    rest = (
        float(low[dead_time[:, 0] - half > 0.0].sum()) > SPILL
        or float(high[dead_time[:, -1] + half < box.dead_time_max].sum()) > SPILL
    )
    return tau, rest


def quantiles(x: Array, w: Array) -> Interval:
    """Median and 95 % interval of weighted points, the cumulated weight joined by lines.

    >>> quantiles(np.linspace(0.0, 1.0, 101), np.full(101, 1 / 101))
    Interval(value=0.5, low=0.02025, high=0.97975)
    """
    order = np.argsort(x, kind="stable")
    x, w = x[order], w[order]
    c = np.cumsum(w) - 0.5 * w
    low, value, high = np.interp((0.025, 0.5, 0.975), c / float(w.sum()), x)
    return Interval(round(float(value), 9), round(float(low), 9), round(float(high), 9))


def _gain(grid: Grid, channel: int) -> tuple[Interval, float]:
    """Mix the Gaussians of all cells, gathered into 32 bins of their means."""
    w, K, sd = grid.weight.ravel(), grid.K[channel].ravel(), grid.K_sd[channel].ravel()
    keep = w > 1e-6 * float(w.max())
    w, K, sd = w[keep], K[keep], sd[keep]
    low, high = float(K.min()), float(K.max())
    bins = 32
    index = np.minimum(((K - low) / (high - low + 1e-300) * bins).astype(np.int64), bins - 1)
    mass = np.bincount(index, w, bins)
    full = mass > 0.0
    mass_full = mass[full]
    mean = np.bincount(index, w * K, bins)[full] / mass_full
    variance = np.bincount(index, w * (sd * sd + K * K), bins)[full] / mass_full - mean**2
    width = np.sqrt(np.maximum(variance, 0.0))
    points = mean[:, None] + width[:, None] * _Z
    interval = quantiles(points.ravel(), np.repeat(mass_full / len(_Z), len(_Z)))
    centre = float(mass_full @ mean / mass_full.sum())
    spread = float(mass_full @ (variance + (mean - centre) ** 2) / mass_full.sum())
    return interval, max(spread, 0.0) ** 0.5


def _worst(grid: Grid, channel: int) -> Interval:
    """Return the gain's 95 % profile likelihood interval: the union over all lags that the data allow.

    Without the prior: where the lag of one channel cannot be told, the gain of the other depends on it.
    """
    prior = [c.weight for c in grid.cells]
    mass = prior[0] if len(prior) == 1 else prior[0][:, None] * prior[1][None, :]
    inside = mass > 0.0
    likelihood = grid.log[inside] - np.log(mass[inside])
    # 3.84: chi-squared of one degree of freedom, 95 %
    left = 3.84 + 2.0 * (likelihood - likelihood.max())
    near = left > 0.0
    K, reach = grid.K[channel][inside][near], np.sqrt(left[near]) * grid.K_sd[channel][inside][near]
    return Interval(float(K.mean()), float((K - reach).min()), float((K + reach).max()))


def channel(grid: Grid, index: int, box: Box) -> Channel:
    """Say what can be told of one channel: intervals, with NaN for what cannot."""
    mean, K_sd = _gain(grid, index)
    worst = _worst(grid, index)
    K = Interval(mean.value, min(mean.low, worst.low), max(mean.high, worst.high))
    w, c = marginal(grid, index), grid.cells[index]
    total = c.tau + c.dead_time

    def sd(x: Array) -> float:
        return math.sqrt(float(w @ (x - float(w @ x)) ** 2))

    # pressed to the box: tau and dead time end where we stopped looking, and so does their sum
    free = not pressed(grid, index, box)
    status = verdict.judge(K, K_sd, sd(c.tau), sd(c.dead_time), sd(total), free)
    return verdict.told(status, K, quantiles(c.tau, w), quantiles(c.dead_time, w), quantiles(total, w))


def pressed(grid: Grid, index: int, box: Box) -> bool:
    """Whether the posterior leans on the upper end of the box, in tau or in dead time."""
    w, c = marginal(grid, index), grid.cells[index]
    for x, end, spacing in (
        (c.tau, box.tau_max, c.spacing[0]),
        (c.dead_time, box.dead_time_max, c.spacing[1]),
    ):
        mass = np.bincount(np.floor((end - x) / spacing).astype(np.int64), w)
        if mass[0] > PRESSED * mass.max():
            return True
    return False
