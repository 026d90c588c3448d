"""Box-Jenkins model by prediction errors: y = c0 + sum B_i / F_i u_i + C / D e (Box & Jenkins 1970; Ljung 1999, eq. 4.31).

Each input has a pole of its own, and the noise has its own: what an input's answer is need not be paid for by the other's,
or by the noise's. Starts: a grid of lags, B by least squares whitened by an autoregression; then Levenberg-Marquardt on
the exact gradient.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.identification import residual_tests
from canid.identification.armax import polynomial
from canid.identification.armax.rates import STATED_S
from canid.identification.levenberg_marquardt import Damping, Local, minimise
from canid.runs import runs
from canid.types import NAN, Array

DAMPING = Damping(1e-3, up=8.0, down=8.0, least=1e-10, tries=8, iterations=40, tolerance=1e-8)

# s; lags at which the search starts, for every input
START_LAGS_S = (0.3, 1.0)
# s; longest lag of a driver: a pole beyond is another offset
MAX_LAG_S = 3.0
# s; after which an answer has forgotten that its input's history before is not known
FORGOTTEN_S = 4.5


class BoxJenkinsOrders(NamedTuple):
    """Orders of the polynomials."""

    nb: int = 2
    nf: int = 1
    nc: int = 1
    nd: int = 2
    nk: int = 1  # dead time in samples


class BoxJenkinsFit(NamedTuple):
    """Parameters in the order b_1,1... f_1,1..., b_2,1... f_2,1..., c0, c1..., d1..."""

    orders: BoxJenkinsOrders
    delays: tuple[int, ...]  # samples, of each input
    theta: Array  # (n,)
    covariance: Array  # (n, n), widened by `variance_inflation`
    variance_inflation: float  # >= 1: see residual_tests.long_run_inflation
    sigma: float  # of the innovations
    residual: Array  # (N,) innovations, NaN where not predicted
    used: int  # samples

    @property
    def B(self) -> Array:  # noqa: N802
        """Return (m, nb), one row per input, first coefficient at the input's delay."""
        return self._inputs[:, : self.orders.nb]

    @property
    def F(self) -> Array:  # noqa: N802
        """Return (m, nf + 1), with the leading one."""
        own = self._inputs[:, self.orders.nb :]
        return np.concatenate([np.ones((len(own), 1)), own], axis=1)

    @property
    def C(self) -> Array:  # noqa: N802
        """Return (nc + 1,), with the leading one."""
        first = len(self.theta) - self.orders.nc - self.orders.nd
        return np.concatenate([[1.0], self.theta[first : first + self.orders.nc]])

    @property
    def D(self) -> Array:  # noqa: N802
        """Return (nd + 1,), with the leading one."""
        return np.concatenate([[1.0], self.theta[len(self.theta) - self.orders.nd :]])

    @property
    def _inputs(self) -> Array:
        o = self.orders
        return self.theta[: len(self.delays) * (o.nb + o.nf)].reshape(-1, o.nb + o.nf)


class _Data(NamedTuple):
    y: Array  # (N,) zero where not used
    u: Array  # (m, N) zero where not known
    driven: npt.NDArray[np.int64]  # (N,) samples since the inputs' history began; -1: not known
    age: npt.NDArray[np.int64]  # (N,) since the first of its run that is used; -1: not used
    orders: BoxJenkinsOrders
    delays: tuple[int, ...]


def fit_box_jenkins(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    orders: BoxJenkinsOrders = BoxJenkinsOrders(),  # noqa: B008
    delays: tuple[int, ...] | None = None,
    *,
    segment: npt.NDArray[np.int64] | None = None,
    dt: float = STATED_S,
) -> BoxJenkinsFit | None:
    """Fit one model to all usable stretches.

    Args:
        output: (N,), NaN where not measured.
        inputs: (N, m), NaN where not measured.
        usable: (N,) whether the output may be learned from; the inputs drive the answers all the same.
        orders: of the polynomials.
        delays: (m,) samples, of each input; None: the orders' one.
        segment: (N,), changes where the inputs' history breaks.
        dt: s, the grid's step.

    Returns:
        The fit, or None where there are too few data or they do not excite.

    >>> rng = np.random.default_rng(0)
    >>> u, e = rng.normal(size=(3000, 1)), 0.1 * rng.normal(size=3000)
    >>> w, v = np.zeros(3000), np.zeros(3000)
    >>> for t in range(2, 3000): w[t] = 0.8 * w[t-1] + 0.5 * u[t-1, 0]; v[t] = 0.6 * v[t-1] + e[t]
    >>> fit = fit_box_jenkins(w + v, u, np.full(3000, True), BoxJenkinsOrders(1, 1, 0, 1))
    >>> fit.B.round(1), fit.F.round(1), fit.D.round(1)
    (array([[0.5]]), array([[ 1. , -0.8]]), array([ 1. , -0.6]))
    """
    inputs = np.asarray(inputs, float)
    m, N = inputs.shape[1], len(output)
    delays = (orders.nk,) * m if delays is None else delays
    n = m * (orders.nb + orders.nf) + 1 + orders.nc + orders.nd
    data = _ready(np.asarray(output, float), inputs, usable, orders, delays, segment, dt)
    inside = data.age >= 0
    count = int(inside.sum())
    if count < 10 * n or not float(np.ptp(data.y[inside])) > 0.0:
        return None
    best: _Point | None = None
    for lags in itertools.product(START_LAGS_S, repeat=m):
        start = _start(data, lags, dt)
        if start is None:
            continue
        found = _descend(start, data, dt)
        if found is not None and (best is None or found.cost < best.cost):
            best = found
    if best is None:
        return None
    psi = _gradient(best, data)
    sigma2 = best.cost / max(count - n, 1)
    try:
        inverse = np.linalg.inv(psi @ psi.T)
    except np.linalg.LinAlgError:
        return None
    inflation = residual_tests.long_run_inflation(
        psi[:, inside] * best.e[inside],
        psi[:, inside] * sigma2**0.5,
        round(residual_tests.HAC_LAG_S / dt),
    )
    covariance = inverse * (sigma2 * inflation)
    if not np.isfinite(covariance).all() or not (np.diag(covariance) > 0.0).all():
        return None
    return BoxJenkinsFit(
        orders,
        delays,
        best.theta,
        0.5 * (covariance + covariance.T),
        inflation,
        sigma2**0.5,
        np.where(inside, best.e, NAN),
        count,
    )


def _ready(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    orders: BoxJenkinsOrders,
    delays: tuple[int, ...],
    segment: npt.NDArray[np.int64] | None,
    dt: float,
) -> _Data:
    N = len(output)
    known = np.isfinite(inputs).all(axis=1)
    driven = _since(known, segment)
    warm = round(FORGOTTEN_S / dt) + max(delays) + orders.nb
    used = usable & known & np.isfinite(output) & (driven >= warm)
    age = np.full(N, -1)
    cut = _since(used, segment)
    for a, b in runs(used, 1):
        age[a:b] = cut[a:b]
    return _Data(
        np.where(used, output, 0.0),
        np.ascontiguousarray(np.where(known[:, None], inputs, 0.0).T),
        driven,
        age,
        orders,
        delays,
    )


def _since(good: npt.NDArray[np.bool_], segment: npt.NDArray[np.int64] | None) -> npt.NDArray[np.int64]:
    """Samples since a run of True in one segment began; -1 outside."""
    k = np.arange(len(good))
    begins = good & ~np.concatenate([[False], good[:-1]])
    if segment is not None:
        begins |= good & np.concatenate([[False], np.diff(segment) != 0])
    first = np.maximum.accumulate(np.where(begins, k, 0))
    return np.where(good, k - first, -1)


class _Point(NamedTuple):
    theta: Array
    e: Array  # (N,) innovations
    filtered: Array  # (m, N) inputs behind 1 / F
    answers: Array  # (m, N)
    v: Array  # (N,) the output without the answers
    cost: float


def _split(theta: Array, o: BoxJenkinsOrders, m: int) -> tuple[Array, Array, float, Array, Array]:
    """B (m, nb), F (m, nf), offset, C, D; without leading ones."""
    own = theta[: m * (o.nb + o.nf)].reshape(m, -1)
    rest = theta[m * (o.nb + o.nf) :]
    return own[:, : o.nb], own[:, o.nb :], float(rest[0]), rest[1 : 1 + o.nc], rest[1 + o.nc :]


def _shifted(x: Array, lag: int, driven: npt.NDArray[np.int64]) -> Array:
    out = np.zeros_like(x)
    out[lag:] = x[: len(x) - lag] if lag else x
    return np.where(driven >= lag, out, 0.0)


def _whitened(x: Array, c: Array, d: Array, age: npt.NDArray[np.int64]) -> Array:
    """D / C x along the last axis, from rest at the start of each run."""
    x = np.where(age >= 0, x, 0.0)
    out = x.copy()
    for i, value in enumerate(d, 1):
        late = np.zeros_like(x)
        late[..., i:] = x[..., :-i]
        out += value * np.where(age >= i, late, 0.0)
    return polynomial.divide(out, c, age)


def _at(theta: Array, data: _Data) -> _Point:
    o, m = data.orders, len(data.u)
    B, F, offset, c, d = _split(theta, o, m)
    filtered = np.array([polynomial.divide(u, f, data.driven) for u, f in zip(data.u, F, strict=True)])
    answers = np.array(
        [
            sum(b[j] * _shifted(x, late + j, data.driven) for j in range(o.nb))
            for b, x, late in zip(B, filtered, data.delays, strict=True)
        ]
    )
    v = np.where(data.age >= 0, data.y - offset - answers.sum(axis=0), 0.0)
    e = _whitened(v, c, d, data.age)
    # the first innovations of a run lack what was before
    e[data.age < o.nd] = 0.0
    return _Point(theta, e, filtered, answers, v, float(e @ e))


def _gradient(at: _Point, data: _Data) -> Array:
    """Negative gradient (n, N) of the innovations."""
    o, m = data.orders, len(data.u)
    _, F, _, c, d = _split(at.theta, o, m)
    rows = []
    for x, w, f, late in zip(at.filtered, at.answers, F, data.delays, strict=True):
        rows += [_shifted(x, late + j, data.driven) for j in range(o.nb)]
        again = polynomial.divide(w, f, data.driven)
        rows += [-_shifted(again, j, data.driven) for j in range(1, o.nf + 1)]
    rows.append(np.ones(len(at.e)))
    psi = np.empty((len(at.theta), len(at.e)))
    psi[: len(rows)] = _whitened(np.array(rows), c, d, data.age)
    k = len(rows)
    if o.nc:
        by_e = polynomial.divide(at.e, c, data.age)
        psi[k : k + o.nc] = [_shifted(by_e, i, np.maximum(data.age, 0)) for i in range(1, o.nc + 1)]
        k += o.nc
    by_v = polynomial.divide(at.v, c, data.age)
    psi[k:] = np.array([-_shifted(by_v, i, np.maximum(data.age, 0)) for i in range(1, o.nd + 1)]).reshape(
        o.nd, -1
    )
    psi[:, data.age < o.nd] = 0.0
    return psi


def _start(data: _Data, lags: tuple[float, ...], dt: float) -> Array | None:
    """B and offset by generalised least squares at given lags, D by the residual's autoregression."""
    o, inside = data.orders, data.age >= 0
    rows = []
    for u, lag, late in zip(data.u, lags, data.delays, strict=True):
        pole = np.zeros(o.nf)
        pole[:1] = -np.exp(-dt / lag)
        filtered = polynomial.divide(u, pole, data.driven)
        rows += [_shifted(filtered, late + j, data.driven) for j in range(o.nb)]
    X = np.array([*rows, np.ones(len(data.y))])
    c, d = np.zeros(o.nc), np.zeros(o.nd)
    w = np.zeros(len(X))
    for _ in range(2):
        white = _whitened(np.concatenate([X, data.y[None]]), c, d, data.age)
        white[:, data.age < o.nd] = 0.0
        w = np.linalg.lstsq(white[:-1].T, white[-1], rcond=None)[0]
        v = np.where(inside, data.y - w @ X, 0.0)
        d = -_autoregression(v, o.nd, data.age)
    own = []
    for i, lag in enumerate(lags):
        pole = np.zeros(o.nf)
        pole[:1] = -np.exp(-dt / lag)
        own += [*w[i * o.nb : (i + 1) * o.nb], *pole]
    theta = np.array([*own, w[-1], *c, *polynomial.project(d, 0.98)])
    return theta if np.isfinite(theta).all() else None


def _autoregression(v: Array, order: int, age: npt.NDArray[np.int64]) -> Array:
    rows = np.array([_shifted(v, i, np.maximum(age, 0)) for i in range(1, order + 1)]).reshape(order, -1)
    some = age >= order
    found: Array = np.linalg.lstsq(rows[:, some].T, v[some], rcond=None)[0]
    return found


def _descend(theta: Array, data: _Data, dt: float) -> _Point | None:
    o, m = data.orders, len(data.u)
    longest = float(np.exp(-dt / MAX_LAG_S))

    def allowed(theta: Array) -> bool:
        _, F, _, c, d = _split(theta, o, m)
        return (
            all(polynomial.is_stable(f.tolist(), longest) for f in F)
            and polynomial.is_stable(c.tolist(), 0.995)
            and polynomial.is_stable(d.tolist(), 0.999)
        )

    def local(at: _Point) -> Local[_Point] | None:
        psi = _gradient(at, data)
        H = psi @ psi.T
        size = np.diag(H)
        if not (np.isfinite(size).all() and (size > 0.0).all()):
            return None

        def move(step: Array) -> _Point | None:
            trial = at.theta + step
            return _at(trial, data) if allowed(trial) else None

        return Local(-(psi @ at.e), H, size, move)

    try:
        return minimise(_at(theta, data), lambda at: at.cost, local, DAMPING).point
    except np.linalg.LinAlgError:
        return None
