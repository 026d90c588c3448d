"""Joint posterior of (tau, dead time) of each channel on an adaptive grid.

For every pair of cells (one per channel) the gains, the offset and the noise model are integrated or
minimised in closed form, from inner products of the basis (reduced_basis.py) alone; so the joint posterior over four
numbers needs no pass over the data, and K1 is marginalised over all lags that the data allow, not over a parabola
around one of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import Annotated, NamedTuple

import numpy as np

from canid.identification import identifiability
from canid.identification.confidence import CHI_SQUARED_QUANTILE, QUANTILES
from canid.identification.fopdt import gain_prior
from canid.identification.fopdt.gain_prior import Components, GainPrior
from canid.identification.fopdt.reduced_basis import Box
from canid.identification.identifiability import PARAMETERS
from canid.state_constraints import NOT_NEGATIVE, POSITIVE
from canid.types import NAN, Array, Channel, Interval

# Cells per axis: with a half-width of 4 sd a cell is 0.9 sd wide, where the midpoint rule is still exact to
# 1e-4.
CELLS_PER_AXIS = 9
HALF_WIDTH_SD = 4.0

# A marginal whose last cell at the upper end of the box holds this share of the fullest cell's is pressed
# to the box: its width is then that of the search. (The lower ends are physics, not convention.)
PRESSED_SHARE = 0.05

GAUSSIAN_POINTS = np.array(
    [NormalDist().inv_cdf((i + 0.5) / 41) for i in range(41)]
)  # quantile points that stand for a Gaussian


class Region(NamedTuple):
    """Where the grid of one channel lies: an ellipse's bounding parallelogram."""

    tau: float  # centre, s
    dead_time: float  # centre, s
    tau_sd: Annotated[float, POSITIVE]  # s
    rest_sd: Annotated[float, POSITIVE]  # sd of dead time at given tau, s
    slope: float  # of dead time by tau


class Cells(NamedTuple):
    """The grid of one channel."""

    tau: Annotated[Array, POSITIVE]  # (c,) s
    dead_time: Annotated[Array, NOT_NEGATIVE]  # (c,) s
    weight: Annotated[Array, NOT_NEGATIVE]  # (c,) prior mass
    spacing: Annotated[tuple[float, float], POSITIVE]  # of tau and of dead time, at most, s
    tau_width: Annotated[Array, NOT_NEGATIVE]  # (c,) s, of each cell
    dead_time_width: Annotated[Array, NOT_NEGATIVE]  # (c,) s


class Grid(NamedTuple):
    """The joint posterior of all channels on their grids."""

    cells: tuple[Cells, ...]
    fit: Array  # (c1,) or (c1, c2), log likelihood, and log of a declared prior
    log: Array  # of that shape, log posterior, zero at its highest
    weight: Array  # of that shape, sums to one
    marginals: tuple[Array, ...]  # (c1,) and (c2,), of the weight
    # gains times `free`, for answers of one size: most grids are evaluated without gains
    along: tuple[Array, ...]
    free: Array  # share of an answer's square that the other's cannot give; (1,) or of the shape of `weight`
    size: tuple[Array, ...]  # of the answers: (c1,) or (c1, 1) and (c2,)
    left: Array  # sum of squares
    variance: float  # of the noise, in shares of `left`
    residual: float  # sum of squares at the most likely cell
    shared: (
        Array  # cosine of the angle between the two answers, of the shape of `weight`; (1,) of one input: 0
    )
    gains: Components | None = None  # with a declared prior of gains; None: none is declared

    @property
    def data_K(self) -> tuple[Array, ...]:  # noqa: N802
        """Gains by least squares, without a prior of them, of the shape of `weight`."""
        return tuple(K / (self.free * size) for K, size in zip(self.along, self.size, strict=True))

    @property
    def K(self) -> tuple[Array, ...]:  # noqa: N802
        """Gains, posterior means of the shape of `weight`."""
        if self.gains is None:
            return self.data_K
        return tuple((self.gains.share * K).sum(axis=0) for K in self.gains.mean)

    @property
    def K_sd(self) -> tuple[Array, ...]:  # noqa: N802
        """Their standard deviations."""
        if self.gains is None:
            sd = np.sqrt(self.variance * self.left / self.free)
            return tuple(sd / size for size in self.size)
        share = self.gains.share
        each = zip(self.gains.mean, self.gains.variance, self.K, strict=True)
        return tuple(np.sqrt((share * (variance + (own - K) ** 2)).sum(axis=0)) for own, variance, K in each)

    @property
    def K_correlation(self) -> Array:  # noqa: N802
        """Correlation of the two gains, of the shape of `weight`; (1,) of one input: 0."""
        if self.gains is None or len(self.cells) == 1:
            return -self.shared
        (one, two), (one_sd, two_sd) = self.K, self.K_sd
        each = self.gains.covariance + (self.gains.mean[0] - one) * (self.gains.mean[1] - two)
        return np.asarray((self.gains.share * each).sum(axis=0) / (one_sd * two_sd))


def whole_box(box: Box) -> Region:
    """Return the region that covers the box.

    >>> whole_box(Box(0.02, 3.0, 1.5)).slope
    0.0
    """
    tau, half = 0.5 * (box.tau_min + box.tau_max), 0.5 * (box.tau_max - box.tau_min)
    return Region(
        tau, 0.5 * box.dead_time_max, half / HALF_WIDTH_SD, 0.5 * box.dead_time_max / HALF_WIDTH_SD, 0.0
    )


def make_cells(region: Region, box: Box, cells: int = CELLS_PER_AXIS) -> Cells:
    """Midpoint cells over a region, cut off at the box.

    The prior mass of a cell is its area times 1/tau (a lag is a scale: 0.1 to 0.2 s weighs as 1 to 2 s) times
    1 - dead_time / dead_time_max (the end of the box is where belief ends, so it ends at zero). A uniform
    box would put a headway lag that is not identifiable at 2.2 s in the mean; as headway integrates range rate,
    K2 then comes out 3 % too large and its interval covers 0.72 (measured in closed loop; so 0.93).
    """
    low = max(box.tau_min, region.tau - HALF_WIDTH_SD * region.tau_sd)
    high = min(box.tau_max, region.tau + HALF_WIDTH_SD * region.tau_sd)
    middle = (np.arange(cells) + 0.5) / cells
    tau = low + (high - low) * middle
    centre = region.dead_time + region.slope * (tau - region.tau)
    # not np.clip, which takes three times as long
    bottom = np.minimum(np.maximum(centre - HALF_WIDTH_SD * region.rest_sd, 0.0), box.dead_time_max)
    top = np.minimum(np.maximum(centre + HALF_WIDTH_SD * region.rest_sd, 0.0), box.dead_time_max)
    width = top - bottom
    dead_time = bottom[:, None] + width[:, None] * middle
    lag = np.repeat(tau, cells)
    weight = np.repeat(width, cells) / lag * (1.0 - dead_time.ravel() / box.dead_time_max)
    spacing = ((high - low) / cells, float(np.max(width)) / cells)
    widths = np.full(len(lag), spacing[0]), np.repeat(width / cells, cells)
    return Cells(lag, dead_time.ravel(), weight, spacing, *widths)


class Moments(NamedTuple):
    """Inner products of whitened rows, the nuisance columns taken out."""

    xx: Array  # (m b, m b) of the basis' answers, input by input
    xy: Array  # (m b,)
    yy: float
    raw: Array  # (m b, m b) before the nuisance was taken out
    freedom: int  # rows less nuisance columns and gains


class Products(NamedTuple):
    """Inner products of whitened rows and nuisance columns; those of a drive are the sum of its parts'."""

    own: Array  # (m b + 1, m b + 1) of the basis' answers, input by input, and the output
    along: Array  # (m b + 1, q) with the nuisance
    nuisance: Array  # (q, q)


def products(rows: Array, nuisance: Array) -> Products:
    """Multiply.

    Args:
        rows: (m b + 1, n) whitened: the basis' answers input by input, and the output.
        nuisance: (q, n) offset and lagged residuals.
    """
    return Products(rows @ rows.T, rows @ nuisance.T, nuisance @ nuisance.T)


def moments(found: Products, inputs: int, columns: int) -> Moments:
    """Gather what the posterior needs.

    Args:
        found: of a window or a drive.
        inputs: m.
        columns: n, those that are usable.
    """
    G, b, out = found.own, len(found.own) - 1, found.nuisance.copy()
    # a trace of the diagonal keeps columns that are nearly the same from making the matrix singular
    out.flat[:: len(out) + 1] = out.diagonal() * (1.0 + 1e-12) + 1e-300
    left = G - found.along @ np.linalg.solve(out, found.along.T)
    freedom = columns - len(out) - inputs
    return Moments(left[:b, :b], left[:b, b], float(left[b, b]), G[:b, :b], freedom)


def evaluate(
    known: Moments,
    W: Sequence[Array],
    cells: Sequence[Cells],
    variance_inflation: float = 1.0,
    joint: Array | None = None,
    measure: Array | None = None,
    gains: GainPrior | None = None,
) -> Grid:
    """Compute the posterior over the cells, gains and nuisance columns taken out.

    The prior is that of the cells and, for the gains, uniform in K |X|: a prior uniform in K alone would
    prefer cells that hardly let the input through. With a prior of the gains that one takes its place.

    Args:
        known: inner products.
        W: per channel (c, b) weights of the basis.
        cells: per channel.
        variance_inflation: >= 1; the likelihood is taken to the power 1/variance_inflation where the residual is not white.
        joint: (c1,) or (c1, c2) log of a declared prior of lags and dead times.
        measure: of that shape, log of what makes the cells' mass that of the declared coordinates.
        gains: declared prior of them.
    """
    if len(W) not in (1, 2):
        raise ValueError(f"{len(W)} inputs: one or two are supported")
    b = W[0].shape[1]
    blocks = [slice(i * b, (i + 1) * b) for i in range(len(W))]
    size = [np.sqrt(_squares(w, known.xx[k, k], known.raw[k, k])) for w, k in zip(W, blocks, strict=True)]
    gain = [w @ known.xy[k] / of for w, k, of in zip(W, blocks, size, strict=True)]
    with np.errstate(divide="ignore"):  # a cell outside the box has no mass
        prior = [np.log(c.weight) for c in cells]
    along: tuple[Array, ...]
    alone: tuple[Array, ...]
    of_size: tuple[Array, ...]
    shared = np.zeros(1)
    if len(W) == 1:
        alone, along, free = (gain[0],), (gain[0],), np.ones(1)
        log, left, of_size = prior[0].copy(), known.yy - gain[0] * gain[0], (size[0],)
    else:
        one, two = gain[0][:, None], gain[1]
        shared = W[0] / size[0][:, None] @ known.xx[blocks[0], blocks[1]] @ (W[1] / size[1][:, None]).T
        free = np.maximum(1.0 - shared * shared, 1e-9)
        alone, along = (one, two), (one - shared * two, two - shared * one)
        log, left = prior[0][:, None] + prior[1], known.yy - (one * along[0] + two * along[1]) / free
        of_size = (size[0][:, None], size[1])
    np.maximum(left, 1e-9 * known.yy + 1e-300, out=left)
    fit = (-0.5 * known.freedom / variance_inflation) * np.log(left)
    if joint is not None:
        fit += joint
    log += fit
    if measure is not None:
        log += measure
    variance = variance_inflation / max(known.freedom, 1)
    multiplied = None
    if gains is not None:
        multiplied = gain_prior.multiply(gains, alone, of_size, shared, free, variance * left)
        log += multiplied.log
    best = np.unravel_index(int(np.argmax(log)), log.shape)
    log -= log[best]
    weight = np.exp(log)
    weight /= weight.sum()
    return Grid(
        tuple(cells),
        fit,
        log,
        weight,
        (weight,) if weight.ndim == 1 else (weight.sum(axis=1), weight.sum(axis=0)),
        along,
        free,
        of_size,
        left,
        variance,
        float(left[best]),
        shared,
        multiplied,
    )


def _squares(w: Array, xx: Array, raw: Array) -> Array:
    """(c,) sums of squares of the answers, bounded away from zero.

    An input that does not move is the offset again: its gain gets a huge sd.

    Args:
        w: (c, b) weights.
        xx: (b, b) inner products.
        raw: (b, b) before the nuisance was taken out.
    """
    square: Array = np.einsum("cb,cb->c", w @ xx, w)
    # no answer's raw square is more than this
    most = float(np.abs(w).sum(axis=1).max()) ** 2 * float(np.diag(raw).max())
    if not float(square.min()) > 1e-9 * most + 1e-12:
        square = np.maximum(square, 1e-9 * np.einsum("cb,cb->c", w @ raw, w) + 1e-12)
    return square


def marginal(grid: Grid, channel: int) -> Array:
    """Return (c,) weights of one channel's cells."""
    return grid.marginals[channel]


def _onto(weight: Array, channel: int) -> Array:
    other = tuple(i for i in range(weight.ndim) if i != channel)
    out: Array = weight.sum(axis=other) if other else weight
    return out


# sd in cells from which on a grid shows where a posterior lies and how it leans; below, one cell hides it.
MIN_SD_CELLS = 0.8


def gather(grid: Grid, channel: int, box: Box) -> Region:
    """Where the posterior of one channel lies: the region of the next, finer grid.

    A posterior narrower than a cell is replaced by a power of it, log/4, log/16, ..., which is wide
    enough to be seen; for a Gaussian that leaves the centre and the slope and doubles the widths each time.
    """
    c = grid.cells[channel]
    power = 1.0
    while True:
        w = marginal(grid, channel) if power == 1.0 else _onto(np.exp(power * grid.log), channel)
        w = w / w.sum()
        tau, dead_time = float(w @ c.tau), float(w @ c.dead_time)
        vt = float(w @ (c.tau - tau) ** 2)
        slope = float(w @ ((c.tau - tau) * (c.dead_time - dead_time))) / max(vt, 1e-12)
        rest = float(w @ (c.dead_time - dead_time - slope * (c.tau - tau)) ** 2)
        seen = vt >= (MIN_SD_CELLS * c.spacing[0]) ** 2 and rest >= (MIN_SD_CELLS * c.spacing[1]) ** 2
        # 1e-6: a thousandth of a cell; nothing in a drive is known to more
        if seen or power < 1e-6:
            break
        power *= 0.25
    # a twelfth of a cell squared is the variance of a uniform cell: not to shrink more than fourfold at once
    vt = max(vt * power, c.spacing[0] ** 2 / 12)
    rest = max(rest * power, c.spacing[1] ** 2 / 12)
    spills_tau, spills_rest = _spills(grid, channel, box)
    w = marginal(grid, channel)
    # where the posterior lies partly outside, half as wide again as this grid, and centred on the rim
    side = round(len(w) ** 0.5)
    grow = 1.5 * side / (2.0 * HALF_WIDTH_SD)
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
SPILLED_SHARE = 0.012


# The same, beyond which a grid must not be believed: some posteriors have tails that no grid of 4 sd holds.
MISSED_SHARE = 0.05


def missed(grid: Grid, channel: int, box: Box) -> bool:
    """Whether the posterior of one channel lies to a good part outside its grid."""
    return any(_spills(grid, channel, box, MISSED_SHARE))


def _spills(grid: Grid, channel: int, box: Box, most: float = SPILLED_SHARE) -> tuple[bool, bool]:
    """Whether along tau, and along dead time."""
    w, c = marginal(grid, channel), grid.cells[channel]
    side = round(len(w) ** 0.5)
    table, dead_time = w.reshape(side, side), c.dead_time.reshape(side, side)
    half_tau, half = 0.51 * c.spacing[0], 0.51 * c.spacing[1]
    low, high = table[:, 0], table[:, -1]
    tau = (c.tau[0] - half_tau > box.tau_min and float(table[0].sum()) > most) or (
        c.tau[-1] + half_tau < box.tau_max and float(table[-1].sum()) > most
    )
    rest = (
        float(low[dead_time[:, 0] - half > 0.0].sum()) > most
        or float(high[dead_time[:, -1] + half < box.dead_time_max].sum()) > most
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
    low, value, high = np.interp((QUANTILES[0], 0.5, QUANTILES[1]), c / float(w.sum()), x)
    return Interval(round(float(value), 9), round(float(low), 9), round(float(high), 9))


def cell_quantiles(middle: Array, half: Array, w: Array) -> Interval:
    """Median and 95 % interval of weighted cells, the weight of each spread evenly over its width.

    Args:
        middle: (c,) of the cells.
        half: (c,) half of their widths.
        w: (c,) weights.

    >>> cell_quantiles(np.array([0.5, 1.5]), np.array([0.5, 0.5]), np.array([1.0, 1.0]))
    Interval(value=1.0, low=0.05, high=1.95)
    """
    full = w > MIN_WEIGHT * float(w.max())
    low, width, w = middle[full] - half[full], np.maximum(2.0 * half[full], 1e-12), w[full]
    density = w / width
    ends = np.concatenate([low, low + width])
    order = np.argsort(ends)
    ends = ends[order]
    # the density changes at the ends of cells; its integral is the weight below
    of_all = np.cumsum(np.concatenate([density, -density])[order])
    below = np.zeros(len(ends))
    np.cumsum(of_all[:-1] * (ends[1:] - ends[:-1]), out=below[1:])
    below /= float(w.sum())
    first, value, last = np.interp((QUANTILES[0], 0.5, QUANTILES[1]), below, ends)
    return Interval(round(float(value), 9), round(float(first), 9), round(float(last), 9))


# weight, in shares of the fullest cell's, below which a pair of cells changes no interval
MIN_WEIGHT = 1e-4


def _gain(weight: Array, K: Array, sd: Array) -> Interval:
    """Mix the Gaussians of all cells, gathered into 32 bins of their means."""
    low, high = float(K.min()), float(K.max())
    bins = 32
    index = ((K - low) * ((bins - 1e-9) / (high - low + 1e-300))).astype(np.int64)
    mass = np.bincount(index, weight, bins)
    full = mass > 0.0
    mass_full = mass[full]
    mean = np.bincount(index, weight * K, bins)[full] / mass_full
    variance = np.bincount(index, weight * (sd * sd + K * K), bins)[full] / mass_full - mean**2
    width = np.sqrt(np.maximum(variance, 0.0))
    points = mean[:, None] + width[:, None] * GAUSSIAN_POINTS
    return quantiles(points.ravel(), np.repeat(mass_full, len(GAUSSIAN_POINTS)))


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


def precision(box: Box) -> tuple[float, float]:
    """Prior precision of tau and of dead time by the box alone: one over the variance of a uniform, side^2 / 12."""
    return 12.0 / (box.tau_max - box.tau_min) ** 2, 12.0 / box.dead_time_max**2


class Deviations(NamedTuple):
    """What the data alone allow one channel's parameters to be known to: standard deviations by Cramér and Rao."""

    K: float
    tau: float  # s
    dead_time: float  # s
    total: float  # s, of tau + dead time


def bounds(known: Moments, J: Sequence[Array], variance: float, box: Box) -> tuple[Deviations, ...]:
    """Bound each channel, all of them unknown: the inverse of Fisher's information at one point, and of the box.

    What a lag of one channel leaves open of the other's gain ends with the box: without it a headway lag that nobody
    can know would make the gain of range rate unknown too. Next to what is judged (verdict.py) the box alone is wide.

    Args:
        known: inner products.
        J: per channel (3, m b): weights of the derivatives of the output by K, tau and dead time.
        variance: of the whitened residual.
        box: where tau and dead time may lie.
    """
    every = np.concatenate(J)
    information = every @ known.xx @ every.T / variance + np.diag(np.tile([0.0, *precision(box)], len(J)))
    # a parameter that moves nothing has no information, and is known to no size at all
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(size, size) + 1e-12 * np.eye(len(size))
    # the pseudoinverse, as numpy's pinv takes it, in a fifth of the time
    value, vector = np.linalg.eigh(scaled)
    kept = np.abs(value) > 1e-15 * float(np.abs(value).max())
    covariance = (vector[:, kept] / value[kept]) @ vector[:, kept].T / np.outer(size, size)
    out = []
    for i in range(len(J)):
        P = covariance[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        total = P[1, 1] + P[2, 2] + 2.0 * P[1, 2]
        out.append(Deviations(*(math.sqrt(max(float(x), 0.0)) for x in (P[0, 0], P[1, 1], P[2, 2], total))))
    return tuple(out)


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
        mean = _gain(weight[kept], K[kept], sd[kept])
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
        weight = max(of for name, of in weights.items() if name != "K" or gain_believed)
        least = Deviations(*(min(a, b) for a, b in zip(known, limit, strict=True)))
        limit = least if gain_believed else least._replace(K=limit.K)
    # pressed to the box: tau and dead time end where we stopped looking, and so does their sum
    free = not pressed(grid, index, box)
    status = identifiability.judge(K, limit.K, limit.tau, limit.dead_time, limit.total, free)
    half_tau, half = 0.5 * c.tau_width, 0.5 * c.dead_time_width
    delays = (
        cell_quantiles(c.tau, half_tau, w),
        cell_quantiles(c.dead_time, half, w),
        cell_quantiles(total, np.hypot(half_tau, half), w),
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
