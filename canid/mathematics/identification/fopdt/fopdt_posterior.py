"""Joint posterior of (tau, dead time) of each channel on an adaptive grid.

For every pair of cells (one per channel) the gains, the offset and the noise model are integrated or
minimised in closed form, from inner products of the basis (reduced_basis.py) alone; so the joint posterior over four
numbers needs no pass over the data, and K1 is marginalised over all lags that the data allow, not over a parabola
around one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.fopdt import gain_prior
from canid.mathematics.identification.fopdt.gain_prior import Components, GainPrior
from canid.mathematics.identification.fopdt.posterior_cells import Cells
from canid.values.types import Array


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
        return tuple(
            np.sqrt((share * (variance + (mean - K) ** 2)).sum(axis=0)) for mean, variance, K in each
        )

    @property
    def K_correlation(self) -> Array:  # noqa: N802
        """Correlation of the two gains, of the shape of `weight`; (1,) of one input: 0."""
        if self.gains is None or len(self.cells) == 1:
            return -self.shared
        (first, two), (one_sd, two_sd) = self.K, self.K_sd
        each = self.gains.covariance + (self.gains.mean[0] - first) * (self.gains.mean[1] - two)
        return np.asarray((self.gains.share * each).sum(axis=0) / (one_sd * two_sd))


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


def moments(products: Products, inputs: int, columns: int) -> Moments:
    """Gather what the posterior needs.

    Args:
        products: of a window or a drive.
        inputs: m.
        columns: n, those that are usable.
    """
    G, b, out = products.own, len(products.own) - 1, products.nuisance.copy()
    # a trace of the diagonal keeps columns that are nearly the same from making the matrix singular
    out.flat[:: len(out) + 1] = out.diagonal() * (1.0 + 1e-12) + 1e-300
    left = G - products.along @ np.linalg.solve(out, products.along.T)
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
    gain = [w @ known.xy[k] / scale for w, k, scale in zip(W, blocks, size, strict=True)]
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
        first, two = gain[0][:, None], gain[1]
        shared = W[0] / size[0][:, None] @ known.xx[blocks[0], blocks[1]] @ (W[1] / size[1][:, None]).T
        free = np.maximum(1.0 - shared * shared, 1e-9)
        alone, along = (first, two), (first - shared * two, two - shared * first)
        log, left = prior[0][:, None] + prior[1], known.yy - (first * along[0] + two * along[1]) / free
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
