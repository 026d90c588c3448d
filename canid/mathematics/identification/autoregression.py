"""Autoregressive noise model AR(p), fitted through gaps by least squares; p by Akaike's criterion.

The diagnosis fits its own (`models.diagnosis.fitting.likelihood.fit_noise`): there each sample is weighed by a noise scale
that follows the state, samples at a floor or a ceiling condition the next ones but are not fitted, orders go to 25 and each
is fitted to all samples that it can use; here whitening is limited (`FLOOR`), what the fit has taken is put back, and
all orders are compared on the same samples. Which samples count is one rule for both (`preceded`).
"""

from __future__ import annotations

import math
import operator

import numpy as np
import numpy.typing as npt

from canid.values.types import Array

# Share of the noise's variance that is treated as white. Where a signal was smoothed (an acceleration, a
# derivative) its noise has next to no content at high frequencies; unlimited whitening would multiply exactly
# those by thousands and fit K, tau and dead time there, to what the smoothing left over. With 0.3 % the
# weight of an empty band against a full one ends near 300. The noise of a person, an Ornstein-Uhlenbeck
# process of 1 s at 10 Hz, has 5 % at the highest frequency: it is changed by 6 % there.
FLOOR = 0.003


def run_lengths(known: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """How many samples in a row right before each are known; what the sample itself is does not matter.

    >>> run_lengths(np.array([True, True, False, True, True, True]))
    array([0, 1, 2, 0, 1, 2])
    """
    index = np.arange(known.size)
    last_unknown = np.maximum.accumulate(np.where(known, -1, index))
    run = np.zeros(known.size, dtype=np.int64)
    run[1:] = (index - last_unknown)[:-1]
    return run


def preceded(known: npt.NDArray[np.bool_], p: int) -> npt.NDArray[np.bool_]:
    """Where the p samples before are all known; what the sample itself is does not matter.

    >>> preceded(np.array([True, True, False, True, True, True]), 1)
    array([False,  True,  True, False,  True,  True])
    """
    out: npt.NDArray[np.bool_] = run_lengths(known) >= p
    return out


def whole(usable: npt.NDArray[np.bool_], p: int) -> npt.NDArray[np.bool_]:
    """Where the sample and its p predecessors are all usable.

    >>> whole(np.array([True, True, False, True, True, True]), 1)
    array([False,  True, False, False,  True,  True])
    """
    return usable & preceded(usable, p)


def chosen(rows: npt.NDArray[np.bool_]) -> slice | npt.NDArray[np.bool_]:
    """Return an index of the chosen rows, a slice where they are one stretch: that copies nothing.

    >>> chosen(np.array([False, True, True]))
    slice(1, 3, None)
    """
    first, count = int(np.argmax(rows)), int(np.count_nonzero(rows))
    return slice(first, first + count) if rows[first : first + count].all() else rows


def whiten(x: Array, noise: Array, stride: int = 1) -> Array:
    """x_t - sum noise_i x_(t - i stride), along the last axis; the first p strides of values lack what came before them.

    One convolution of all rows, one after the other: numpy has a loop of its own for kernels of up to eleven numbers,
    fifteen times as fast as as many slices. What leaks from one row into the first p values of the next is made anew.

    Args:
        x: (..., n), finite; of one row NaN makes NaN of what it predicts.
        noise: (p,).
        stride: values from one to the one that predicts it.

    >>> whiten(np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]), np.array([0.5]))
    array([[1. , 0.5, 0.5],
           [2. , 1. , 1. ]])
    """
    if not len(noise) or not x.size:
        return x.copy()
    if stride > 1:
        strided = x.copy()
        for lag, coefficient in zip(range(stride, x.shape[-1], stride), noise, strict=False):
            strided[..., lag:] -= coefficient * x[..., :-lag]
        return strided
    kernel = np.concatenate([[1.0], -noise])
    out: Array = np.convolve(x.reshape(-1), kernel)[: x.size].reshape(x.shape)
    if x.ndim == 1:
        return out
    first = min(len(noise), x.shape[-1])
    # row i of a table in which a coefficient stands at its lag from the diagonal
    table = np.concatenate([np.zeros(first), kernel[:first]])[
        first - np.arange(first)[:, None] + np.arange(first)
    ]
    out[..., :first] = x[..., :first] @ table
    return out


def fit(
    r: Array,
    usable: npt.NDArray[np.bool_],
    most: int = 6,
    floor: float = FLOOR,
    bounded: npt.NDArray[np.bool_] | None = None,
    root: Array | None = None,
    run: npt.NDArray[np.int64] | None = None,
) -> Array:
    """Coefficients phi of r_t = sum phi_i r_(t-i) + e_t.

    Least squares over the samples whose `most` predecessors are usable too (so that all orders are compared
    on the same samples), order by AIC: BIC keeps AR(1) for a mixture of correlated and white noise, and then
    intervals cover too little.

    A residual is smaller than the noise: what was fitted has taken some of it, and most where the noise is strongest.
    Further series put it back. With r = n - X d and C the covariance of d, the expected products of the noise are
    those of r plus those of X C X' (the expectation step of Dempster, Laird & Rubin 1977; restricted maximum
    likelihood), so the columns of X C^(1/2) are those series.

    Args:
        r: (n,) residual or (1 + k, n) with further series; values where not usable are ignored.
        usable: (n,).
        most: highest order.
        floor: share of white variance added, see FLOOR.
        bounded: (n,) rows that have a pseudo-value (censoring.py): predicted, but nothing is predicted from them.
        root: (n,) of the weight that each prediction error has; None: one.
        run: (n,) `run_lengths` of `usable`, where they are known already.

    Returns:
        (p,), 0 <= p <= most; empty where there are too few samples.

    >>> rng = np.random.default_rng(1)
    >>> r = rng.normal(size=4000)
    >>> for k in range(1, 4000): r[k] += 0.8 * r[k - 1]
    >>> abs(fit(r, np.full(4000, True), most=1, floor=0.0)[0] - 0.8) < 0.03
    np.True_
    """
    known = usable if bounded is None else usable | bounded
    rows = known & ((run_lengths(usable) if run is None else run) >= most)
    count = int(np.count_nonzero(rows))
    # ten samples per coefficient: fewer cannot tell correlation from chance
    if most < 1 or count < 10 * most:
        return np.zeros(0)
    products, sums, weight = _lag_products(r, known, rows, most, root)
    if bounded is not None:
        # the mean of what is known is not the noise's: what lies below the bound is missing from it
        products -= np.outer(sums, sums) / max(weight, 1e-300)
    products.flat[:: most + 2] *= 1.0 + floor
    coefficients = np.array(_best_order(products.tolist(), count))
    total = float(coefficients.sum())
    return coefficients * (SLOWEST / total) if total > SLOWEST else coefficients


def _lag_products(
    r: Array, known: npt.NDArray[np.bool_], rows: npt.NDArray[np.bool_], most: int, root: Array | None
) -> tuple[Array, Array, float]:
    """Inner products (1 + most, 1 + most) of series now and at every lag, their sums (1 + most,), and the sum of weights.

    Args:
        r: (n,) or (k, n).
        known: (n,) where its values are to be used.
        rows: (n,) that count.
        most: lags.
        root: (n,) of the weight of each row; None: one.
    """
    series = np.where(known, np.atleast_2d(r), 0.0)
    n, later = series.shape[1], rows[most:].astype(float)
    if root is not None:
        later *= root[most:]
    weight = later * later
    products, sums = np.zeros((most + 1, most + 1)), np.zeros(most + 1)
    for first in range(0, n - most, PIECE):
        last = min(first + PIECE, n - most)
        # (1 + most, series, rows)
        X = np.empty((most + 1, len(series), last - first))
        for i in range(most + 1):
            X[i] = series[:, most - i + first : most - i + last]
        weighted = X * weight[first:last]
        sums += weighted[:, 0].sum(axis=1)
        # of two arrays: the routine that BLAS has for X X' takes four times as long on few and long rows
        products += weighted.reshape(most + 1, -1) @ X.reshape(most + 1, -1).T
    return products, sums, float(weight.sum())


def _best_order(products: list[list[float]], count: int) -> list[float]:
    """Coefficients of the order that Akaike's criterion prefers, from inner products with the floor on their diagonal.

    The orders are nested: one triangular factor solves them all, and its steps are what each order explains. In plain
    floats: for so few numbers a call of numpy takes longer than the arithmetic.

    >>> _best_order([[1.0, 0.5, 0.25], [0.5, 1.0, 0.5], [0.25, 0.5, 1.0]], 100)
    [0.5]
    """
    yy, most = products[0][0], len(products) - 1
    if not yy > 0.0:
        return []
    factor, explained = list[list[float]](), list[float]()  # L, and z of L z = h
    left, best, least = yy, 0, count * math.log(yy)
    for i in range(most):
        given, row = products[i + 1], list[float]()
        for k, other in enumerate(factor):
            row.append((given[k + 1] - sum(map(operator.mul, row, other))) / other[k])
        pivot = given[i + 1] - sum(x * x for x in row)
        if not pivot > 0.0:  # a residual that repeats itself exactly
            return []
        row.append(math.sqrt(pivot))
        factor.append(row)
        explained.append((given[0] - sum(map(operator.mul, row, explained))) / row[i])
        left -= explained[i] ** 2
        value = count * math.log(max(left, 1e-12 * yy)) + 2.0 * (i + 1)
        if value < least:
            best, least = i + 1, value
    coefficients = [0.0] * best
    for i in reversed(range(best)):
        coefficients[i] = (
            explained[i] - sum(factor[k][i] * coefficients[k] for k in range(i + 1, best))
        ) / factor[i][i]
    return coefficients


# Rows whose lags are laid out at once: of a whole drive they would take as much memory as its regression.
PIECE = 2048

# Noise that remembers for 200 samples cannot be distinguished from a drifting offset in a minute at 10 Hz.
SLOWEST = 0.995
