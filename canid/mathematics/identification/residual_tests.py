"""Residual tests: whiteness, stationarity, and correlation with past inputs (Ljung 1999, sec. 16.6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import NAN, Array, ResidualTests

# The 99 % bound of Chen & Ulsoy 2001, fig. 8.
LEVEL = 0.99

# Lags of the tests: 2.5 s at 10 Hz, as in Chen & Ulsoy 2001, fig. 8.
LAGS = 25

# Order of the autoregression that whitens the residual before it is tested against an input: 1 s at
# 10 Hz. A right model leaves none; noise with more order than the model's leaves some, and the whiteness test shows that.
OWN = 10

# A direction in which an input moves by less than 1 % of its own standard deviation counts as still: a range rate
# of 1 m/s reported in steps of 0.025 m/s (Toyota's radar) carries 0.7 % of rounding.
FLOOR = 1e-2

# Relative to the trace of a Gram matrix: where double precision ends; keeps exactly periodic inputs solvable.
RIDGE = 1e-12

# Samples whose mean square is one value of the stationarity test: 1 s at 10 Hz.
BLOCK = 10

# Bendat & Piersol 2010, table A.6, begins at ten values; beyond sixty they are made longer, not more.
BLOCKS = (10, 60)


class Whiteness(NamedTuple):
    """The test of Ljung & Box (1978)."""

    white: bool
    statistic: float  # Q
    bound: float  # Q of white noise stays below in 99 %
    lags: int


def run_tests(
    e: Array,
    inputs: Array,
    names: Sequence[str],
    fitted: int,
    stride: int = 1,
    response: Array | None = None,
) -> ResidualTests:
    """Every residual test at once; each alone alarms at a right model in 1 %.

    What cannot be tested has not passed (white, stationary) and shows nothing (left_over, feedback).

    Args:
        e: (n,) residuals on the grid; NaN where there is none. Pairs and windows with a NaN are left out.
        inputs: (n, m) the model's inputs at the same times.
        names: (m,) of the inputs.
        fitted: parameters of the noise model.
        stride: samples from a residual to the next that it is white against. All phases are tested, and count as one:
            neighbours may know the same.
        response: (n,) the model's response, whitened as `e` is; None: no shares of it are given.

    Raises:
        ValueError: shapes that do not belong together.

    >>> rng = np.random.default_rng(0)
    >>> e, u = rng.normal(size=600), rng.normal(size=(600, 1))
    >>> run_tests(e, u, ["range_rate"], 0)[3:]
    ((), (), True, {'range_rate': 25}, {})
    >>> run_tests(e + np.roll(u[:, 0], 3), u, ["range_rate"], 0).left_over
    ('range_rate',)
    """
    if inputs.shape != (len(e), len(names)):
        raise ValueError(f"inputs {inputs.shape} for {len(e)} residuals and {len(names)} names")
    largest = _largest(e)
    e = phases(_scaled(e), stride)
    white = whiteness(e, fitted=fitted, stride=stride)
    whitened = innovations(e, OWN)
    held = {
        name: _against(whitened, phases(_scaled(u), stride), stride)
        for name, u in zip(names, inputs.T, strict=True)
    }
    return ResidualTests(
        white=white.white,
        statistic=white.statistic,
        bound=white.bound,
        left_over=tuple(name for name, x in held.items() if x.left_over),
        feedback=tuple(name for name, x in held.items() if x.feedback),
        stationary=stationary(_sizes(whitened, stride)),
        excitation_order={name: x.order for name, x in held.items()},
        left_over_share=(
            {} if response is None else _shares(held, _variance(whitened) * largest**2, _variance(response))
        ),
    )


def _variance(x: Array) -> float:
    """Of what is known; zero where nothing is."""
    known = x[np.isfinite(x)]
    return float(np.var(known)) if len(known) else 0.0


def _shares(held: Mapping[str, _AgainstInput], noise: float, response: float) -> dict[str, float]:
    """Left-over responses over the model's own, root mean squares, from the variances of residual and response."""
    return {
        name: (x.explained * noise / response) ** 0.5 if response > 0.0 else NAN for name, x in held.items()
    }


def phases(x: Array, stride: int) -> Array:
    """Every `stride`-th sample from the first, then from the second, and so on; NaN keeps one phase from the next.

    >>> phases(np.arange(5.0), 2)[[0, 1, 2, -2, -1]], phases(np.arange(5.0), 1)
    (array([ 0.,  2.,  4., nan, nan]), array([0., 1., 2., 3., 4.]))
    """
    if stride == 1:
        return x
    height = -(-len(x) // stride)
    out = np.full((stride, height + LAGS), NAN)
    for phase, row in enumerate(out):
        part = x[phase::stride]
        row[: len(part)] = part
    return out.ravel()


def _sizes(e: Array, stride: int) -> Array:
    """Root mean square of the phases at each step: their sizes, in the order of time."""
    if stride == 1:
        return e
    square = np.square(e.reshape(stride, -1))
    known = np.isfinite(square)
    count = known.sum(axis=0)
    total = np.where(known, square, 0.0).sum(axis=0)
    out: Array = np.sqrt(np.where(count > 0, total / np.maximum(count, 1), NAN))
    return out


def _largest(x: Array) -> float:
    return float(np.max(np.abs(x), initial=0.0, where=np.isfinite(x)))


def _scaled(x: Array) -> Array:
    """Divide by the largest size: no test depends on the unit, and no square leaves the range of a double."""
    largest = _largest(x)
    return x / largest if largest > 0.0 else np.ascontiguousarray(x)


def variance_inflation(tests: ResidualTests | None) -> float:
    """What the variances of a model's parameters are multiplied by: the whiteness statistic over its bound, at least 1.

    Noise of more order than the model's bends what shares its poles, however many samples there are.

    >>> white = run_tests(np.random.default_rng(0).normal(size=600), np.zeros((600, 0)), (), 3)
    >>> correlated = white._replace(statistic=2.0 * white.bound)
    >>> variance_inflation(white), round(variance_inflation(correlated), 1), variance_inflation(None)
    (1.0, 2.0, 1.0)
    """
    return max(1.0, tests.statistic / tests.bound) if tests is not None and tests.bound > 0.0 else 1.0


def chi2_bound(freedom: int, level: float = LEVEL) -> float:
    """Quantile of chi-squared by Wilson & Hilferty (1931): to 0.2 % from five degrees of freedom, 0.8 % from one.

    >>> round(chi2_bound(20), 1)  # tables: 37.57
    37.6
    """
    k = max(freedom, 1)
    z = NormalDist().inv_cdf(level)
    return float(k * (1.0 - 2.0 / (9.0 * k) + z * (2.0 / (9.0 * k)) ** 0.5) ** 3)


def whiteness(e: Array, lags: int = LAGS, fitted: int = 0, stride: int = 1) -> Whiteness:
    """Ljung & Box: Q = n (n+2) sum r_k^2 / n_k, with n_k the pairs that are k samples apart (n - k without gaps).

    Args:
        e: (n,) residuals; NaN where there is none.
        lags: how many.
        fitted: parameters of the noise model, taken off the degrees of freedom.
        stride: how many phases `e` consists of, see `phases`.

    >>> whiteness(np.random.default_rng(0).normal(size=600)).white
    True
    >>> whiteness(np.sin(np.arange(600.0))).white
    False
    """
    known = np.isfinite(e)
    n = int(known.sum())
    lags = min(lags, n // stride // 4)
    e = np.where(known, e, 0.0)
    power = float(e @ e)
    if lags <= fitted or not power > 0.0:
        return Whiteness(False, NAN, NAN, 0)
    pairs = _products(known.astype(float), lags)
    r = _products(e, lags) / power
    some = pairs > 0.0
    q = float(n * (n + 2) * np.sum(r[some] ** 2 / pairs[some])) / stride
    bound = chi2_bound(int(some.sum()) - fitted)
    return Whiteness(q <= bound, q, bound, lags)


def _products(x: Array, lags: int) -> Array:
    """Sum of x_t x_(t-k) for k = 1 ... lags."""
    padded = np.concatenate([np.zeros(lags), x])
    out: Array = (x @ _windows(padded, lags + 1))[lags - 1 :: -1]
    return out


def _windows(x: Array, width: int) -> Array:
    """(n - width + 1, width) windows of (n,), oldest first: numpy's sliding_window_view at a tenth of its price."""
    x = np.ascontiguousarray(x)
    return np.ndarray((len(x) - width + 1, width), x.dtype, x, 0, x.strides * 2)


def _complete(x: Array, width: int) -> npt.NDArray[np.bool_]:
    """Which windows of `width` samples hold no NaN; (n - width + 1,)."""
    missing = np.concatenate([[0], np.cumsum(~np.isfinite(x))])
    whole: npt.NDArray[np.bool_] = missing[width:] == missing[:-width]
    return whole


def _lagged(x: Array, width: int, known: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """Known windows of `width` samples, oldest first, about one common mean; and their covariance times n."""
    middle = float(x[width - 1 :][known].mean())
    rows = _windows(x - middle, width)[known]
    total = np.ones(len(rows)) @ rows
    return rows, rows.T @ rows - np.outer(total, total / len(rows))


def _innovation(rows: Array, gram: Array) -> Array:
    """Residual of the last column's least-squares regression on a constant and the other columns."""
    past = gram[:-1, :-1].copy()
    past[np.diag_indices(len(past))] += RIDGE * np.trace(past) + np.finfo(float).tiny
    new: Array = rows[:, -1] - rows[:, :-1] @ np.linalg.solve(past, gram[:-1, -1])
    new -= new.mean()
    return new


def innovations(x: Array, order: int) -> Array:
    """Innovations of a series: residuals of its least-squares autoregression on `order` lags and a constant.

    Args:
        x: (n,); NaN where not known.
        order: lags.

    Returns:
        (n,), NaN where the lags are not complete, or too few are to fit.

    >>> e = innovations(np.cos(0.1 * np.arange(300.0)), 4)
    >>> bool(np.abs(e[4:]).max() < 1e-6)
    True
    """
    out = np.full(len(x), NAN)
    if len(x) <= order:
        return out
    known = _complete(x, order + 1)
    if known.sum() >= 4 * order:
        out[order:][known] = _innovation(*_lagged(x, order + 1, known))
    return out


class _AgainstInput(NamedTuple):
    """The residual tested against one input."""

    left_over: bool
    feedback: bool
    order: int  # of persistent excitation
    explained: float = 0.0  # share of the residual's variance, beyond what chance explains


def _against(whitened: Array, u: Array, stride: int = 1) -> _AgainstInput:
    """Test whether the input's past predicts the residual (left over), and the residual's past the input (feedback).

    Left over: regression of the residual on the input's lags, in the directions in which these move; n R^2 is
    chi-squared with as many degrees of freedom, whatever the input's spectrum (Ljung 1999, eq. 16.64 ff., for all
    lags at once). Their number is the order of persistent excitation (def. 13.2: rank of the input's covariance).

    Feedback: correlation of what is new in the input with the residual's past. Both are white, so each has the
    variance 1/n and none leans on another (Haugh 1976). With the input itself an answer that is left over would
    show at negative lags too, through the input's autocorrelation.

    Args:
        whitened: (n,) whitened residual; NaN where there is none.
        u: (n,) input.
        stride: how many phases both consist of.
    """
    nothing = _AgainstInput(False, False, 0)
    if len(u) <= 3 * LAGS:
        return nothing
    y = whitened[LAGS:]
    known = _complete(u, LAGS + 1) & np.isfinite(y)
    y = y[known]
    n = len(y)
    if n < 2 * LAGS * stride:
        return nothing
    rows, gram = _lagged(u, LAGS + 1, known)
    size = float(np.trace(gram)) / n  # LAGS + 1 times the input's variance
    # a constant leaves the rounding of its mean
    if not size > RIDGE * float(np.square(u[LAGS:][known]).max()):
        return nothing
    power, moved = np.linalg.eigh(gram[1:, 1:])
    moving = power > FLOOR**2 * float(power.mean())
    order = int(moving.sum())
    y = y - y.mean()
    noise = float(y @ y)
    if not noise > 0.0:
        return _AgainstInput(False, False, order)
    along = (y @ rows[:, 1:]) @ moved[:, moving]
    answer = n / stride * float(np.sum(along**2 / power[moving])) / noise

    new = _innovation(rows, gram)
    fresh = float(new @ new)
    # an input that its own past predicts entirely (a sine) has nothing new in it
    explained = max(answer - order, 0.0) * stride / n
    if not fresh > RIDGE * n * size:
        return _AgainstInput(answer > chi2_bound(order), False, order, explained)
    past = np.where(np.isfinite(whitened), whitened, 0.0)
    fresh *= float(past @ past) / np.count_nonzero(past)
    along = new @ _windows(past, LAGS)[:-1][known]
    moves = float(along @ along) / fresh / stride
    return _AgainstInput(answer > chi2_bound(order), bool(moves > chi2_bound(LAGS)), order, explained)


def stationary(e: Array) -> bool:
    """Reverse arrangements of mean squares: no trend in the residual's size (Bendat & Piersol 2010, sec. 4.5.2).

    The number of reverse arrangements of k values has the mean k (k-1) / 4 and the variance k (k-1) (2k+5) / 72.

    Args:
        e: (n,); NaN where there is none.

    >>> e = np.random.default_rng(0).normal(size=600)
    >>> stationary(e), stationary(e * np.linspace(1.0, 3.0, 600))
    (True, False)
    """
    e = e[np.isfinite(e)]
    k = min(len(e) // BLOCK, BLOCKS[1])
    if k < BLOCKS[0] or not np.any(e):
        return False
    length = len(e) // k
    sizes = np.square(e[len(e) - k * length :]).reshape(k, length).mean(axis=1)
    reverse = int(np.triu(sizes[:, None] > sizes[None, :]).sum())
    spread = (k * (k - 1) * (2 * k + 5) / 72.0) ** 0.5
    return bool(abs(reverse - k * (k - 1) / 4.0) <= NormalDist().inv_cdf(0.5 + 0.5 * LEVEL) * spread)


# s; how long a movement of the pedal or the wheel lasts: autocorrelation is taken into account up to here.
HAC_LAG_S = 2.0


def long_run_inflation(scores: Array, plain: Array, lags: int = 20) -> float:
    """Inflation of variances by the autocorrelation that whitening left: mean ratio of long-run to plain variance.

    Ribatet, Cooley & Davison 2012 (magnitude adjustment of a composite likelihood), with the variance of the
    score by Newey & West 1987. At least one: luck must not narrow an interval.

    Args:
        scores: (k, n) residual times derivative of the prediction, one row per parameter.
        plain: (k, n) the derivatives times the residual's standard deviation.
        lags: samples; 20 are HAC_LAG_S at 10 Hz.

    >>> long_run_inflation(np.tile([1.0, -1.0], (1, 50)), np.ones((1, 100)))
    1.0
    """
    # no more lags than a quarter of the data can carry
    lags = min(lags, scores.shape[1] // 4)
    expected = np.einsum("kn,kn->k", plain, plain)
    # Bartlett's weights are those of the sums over lags + 1 samples, whereever they start
    total = np.zeros((len(scores), scores.shape[1] + 2 * lags + 1))
    np.cumsum(scores, axis=1, out=total[:, lags + 1 : lags + 1 + scores.shape[1]])
    total[:, lags + 1 + scores.shape[1] :] = total[:, [lags + scores.shape[1]]]
    sums = total[:, lags + 1 :] - total[:, : -lags - 1]
    variance = np.einsum("kn,kn->k", sums, sums) / (lags + 1)
    moving = expected > 0.0
    return max(1.0, float(np.mean(variance[moving] / expected[moving]))) if moving.any() else 1.0
