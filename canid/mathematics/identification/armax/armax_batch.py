"""ARMAX with several inputs by prediction errors: A y = sum B_i u_i + c0 + C e (Ljung 1999, sec. 10.2).

Start by Hannan & Rissanen (1982): a long ARX gives the innovations, least squares on them the polynomials.
Then Levenberg-Marquardt on the exact gradient. Every run of usable samples starts with its real lags and e =
0; filling them with zeros instead costs a factor three in C.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import innovation_law, residual_tests
from canid.mathematics.identification.armax import polynomial
from canid.mathematics.identification.armax.rates import STATED_S, rates
from canid.mathematics.identification.levenberg_marquardt import Damping, Local, gauss_newton, minimise
from canid.values.runs import runs
from canid.values.types import NAN, Array

# Thirty steps: from Hannan & Rissanen five are usual.
# rounds of the law of the innovations and of the parameters under it
LAW_ROUNDS = 2

DAMPING = Damping(1e-6, up=10.0, down=10.0, least=1e-12, tries=12, iterations=30, tolerance=1e-9)


class Orders(NamedTuple):
    """Orders of the polynomials; nk is the dead time in samples, at least one where the loop is closed."""

    na: int = 2
    nb: int = 2
    nc: int = 1
    nk: int = 1

    def count(self, m: int) -> int:
        """How many parameters with m inputs, offset included."""
        return self.na + m * self.nb + 1 + self.nc

    def lag(self) -> int:
        """How many samples before the first that can be predicted."""
        return max(self.na, self.nb + self.nk - 1, 1)


class Lags(NamedTuple):
    """What the prediction of the next sample needs of the past, newest first; empty where the data ended in a gap."""

    y: tuple[float, ...] = ()  # na, at least one
    u: tuple[tuple[float, ...], ...] = ()  # per input, nb + nk - 1
    e: tuple[float, ...] = ()  # nc innovations
    psi: tuple[tuple[float, ...], ...] = ()  # nc gradients, each (n,)


class StandardErrors(NamedTuple):
    """Of the coefficients."""

    A: Array  # (na + 1,) the first is 0
    B: Array  # (m, nb)
    C: Array  # (nc + 1,) the first is 0
    offset: float


class ArmaxFit(NamedTuple):
    """Parameters in the order a1..., b_1,1..., b_2,1..., c0, c1..."""

    orders: Orders
    theta: Array  # (n,)
    covariance: Array  # (n, n), widened by `variance_inflation`
    variance_inflation: (
        float  # >= 1: autocorrelation of the innovations, see residual_tests.long_run_inflation
    )
    inverse_information: Array  # (n, n) of the weighted samples, for noise of variance one
    law: innovation_law.Law  # of the innovations
    sigma: float  # of the innovations
    residual: Array  # (N,) innovations, NaN where not predicted
    used: int  # samples
    whiteness: residual_tests.Whiteness
    lags: Lags  # at the end of the data

    @property
    def A(self) -> Array:  # noqa: N802
        """Return (na + 1,), with the leading one."""
        return np.concatenate([[1.0], self.theta[: self.orders.na]])

    @property
    def B(self) -> Array:  # noqa: N802
        """Return (m, nb), one row per input, first coefficient at lag nk."""
        return self.theta[self.orders.na : -1 - self.orders.nc].reshape(-1, self.orders.nb)

    @property
    def C(self) -> Array:  # noqa: N802
        """Return (nc + 1,), with the leading one."""
        return np.concatenate([[1.0], self.theta[len(self.theta) - self.orders.nc :]])

    @property
    def offset(self) -> float:
        """The constant c0, in the output's unit times A(1)."""
        return float(self.theta[len(self.theta) - self.orders.nc - 1])

    @property
    def standard_errors(self) -> StandardErrors:
        """Of the coefficients, in the shapes of A, B and C; the leading ones are exact."""
        o, sd = self.orders, np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return StandardErrors(
            np.concatenate([[0.0], sd[: o.na]]),
            sd[o.na : -1 - o.nc].reshape(-1, o.nb),
            np.concatenate([[0.0], sd[len(sd) - o.nc :]]),
            float(sd[len(sd) - o.nc - 1]),
        )

    @property
    def poles(self) -> npt.NDArray[np.complex128]:
        """Return (na,) zeros of A."""
        return np.roots(self.A).astype(np.complex128)


class _Data(NamedTuple):
    y: Array
    u: Array  # (m, N)
    runs: list[tuple[int, int]]  # usable stretches, longer than the lags
    age: npt.NDArray[np.int64]  # (N,) samples since the first of its run that can be predicted; -1: cannot be


def _regressors(data: _Data, o: Orders) -> Array:
    """(na + m nb + 1, N): minus the lags of y, the lags of the inputs, one."""
    N = len(data.y)
    rows = []
    for lags, x, sign in [(range(1, o.na + 1), data.y, -1.0)] + [
        (range(o.nk, o.nk + o.nb), u, 1.0) for u in data.u
    ]:
        for k in lags:
            row = np.zeros(N)
            row[k:] = sign * x[: N - k]
            rows.append(row)
    rows.append(np.ones(N))
    return np.array(rows)


def _innovations(theta: Array, phi: Array, data: _Data) -> Array:
    """(N,), zero outside the runs."""
    linear, c = theta[: len(phi)], theta[len(phi) :]
    return polynomial.divide(np.where(data.age >= 0, data.y - linear @ phi, 0.0), c, data.age)


def _gradient(theta: Array, e: Array, phi: Array, data: _Data, o: Orders) -> Array:
    """Negative gradient (n, N) of the innovations; zero outside the runs.

    Every row is filtered by 1/C from rest at the start of its run. The rows of one signal are lags of each other: its
    first is filtered, and each next one is that a sample later, plus what the sample that it has before answers: the
    impulse response.
    """
    linear, c, outside = len(phi), theta[len(phi) :], data.age < 0
    first = [0] * (o.na > 0) + [o.na + i * o.nb for i in range(len(data.u))] + [linear - 1]
    ready = np.concatenate([phi[first], e[None], (data.age == 0)[None]])
    ready[:, outside] = 0.0
    *done, of_e, impulse = polynomial.divide(ready, c, data.age)
    begin = np.where(outside, 0, np.arange(len(e)) - data.age)
    psi = np.zeros((len(theta), len(e)))
    psi[first] = done
    for k in range(len(theta)):
        if k not in first:
            psi[k, 1:] = of_e[:-1] if k == linear else psi[k - 1, :-1]
            if k < linear:  # the innovations have no sample before their first
                psi[k] += phi[k, begin] * impulse
            psi[k, outside] = 0.0
    return psi


def _start(data: _Data, phi: Array, o: Orders, long: int) -> Array:
    """Hannan & Rissanen."""
    N = len(data.y)
    inside = np.zeros(N, bool)
    long = max(o.lag(), min(long, min(b - a for a, b in data.runs) // 3))
    far = Orders(long, long, 0, o.nk)
    for a, b in data.runs:
        inside[a + far.lag() : b] = True
    if o.nc == 0:
        return np.asarray(np.linalg.lstsq(phi[:, inside].T, data.y[inside], rcond=None)[0])
    wide = _regressors(data, far)
    w = np.linalg.lstsq(wide[:, inside].T, data.y[inside], rcond=None)[0]
    e = np.where(inside, data.y - w @ wide, 0.0)
    X = [phi]
    for k in range(1, o.nc + 1):
        row = np.zeros(N)
        row[k:] = e[:-k]
        X.append(row[None])
    theta = np.asarray(np.linalg.lstsq(np.concatenate(X)[:, inside].T, data.y[inside], rcond=None)[0])
    theta[len(phi) :] = polynomial.project(theta[len(phi) :], 0.9)
    return theta


def fit_armax(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    orders: Orders = Orders(),  # noqa: B008
    *,
    segment: npt.NDArray[np.int64] | None = None,
    start: Array | None = None,
    dt: float = STATED_S,
) -> ArmaxFit | None:
    """Fit one ARMAX model to all usable stretches.

    Args:
        output: (N,), NaN where not measured.
        inputs: (N, m), NaN where not measured.
        usable: (N,) samples that may be learnt from.
        orders: of the polynomials.
        segment: (N,), changes where the inputs' history breaks.
        start: (n,) parameters to start from, instead of Hannan & Rissanen's.
        dt: s, the grid's step.

    Returns:
        The fit, or None where there are too few data or they do not excite (weak data are no error).

    Raises:
        ValueError: shapes that do not fit, orders below zero or no dead time.

    >>> rng = np.random.default_rng(0)
    >>> u, e, y = rng.normal(size=(500, 1)), 0.1 * rng.normal(size=500), np.zeros(500)
    >>> for t in range(1, 500): y[t] = 0.8 * y[t-1] + 0.5 * u[t-1, 0] + e[t] + 0.3 * e[t-1]
    >>> fit = fit_armax(y, u, np.full(500, True), Orders(1, 1, 1, 1))
    >>> fit.theta.round(1)
    array([-0.8,  0.5, -0. ,  0.3])
    """
    inputs = np.asarray(inputs, float)
    if inputs.ndim != 2 or not len(output) == len(inputs) == len(usable):
        raise ValueError(f"output {np.shape(output)}, inputs {inputs.shape}: expected (N,) and (N, m)")
    if min(orders.na, orders.nc) < 0 or orders.nb < 1 or orders.nk < 0:
        raise ValueError(f"{orders}: na, nc, nk >= 0 and nb >= 1")
    data, scale = _ready(np.asarray(output, float), inputs, usable, orders, segment)
    n = orders.count(inputs.shape[1])
    count = int((data.age >= 0).sum())
    # five samples per parameter is the least from which the start's long regression can be solved
    if count < 5 * n or not scale > 0.0:
        return None
    phi = _regressors(data, orders)
    theta = _start(data, phi, orders, rates(dt).long_order) if start is None else np.array(start, float)
    minimum = _descend(theta, phi, data, orders)
    if minimum is None:
        return None
    inside = data.age >= 0
    law, root = innovation_law.equal(0).law, inside.astype(float)
    for _ in range(LAW_ROUNDS if count >= innovation_law.MIN_ROWS else 0):
        known = minimum[1][inside]
        weights = innovation_law.fit(known, np.full(count, True), np.zeros((0, count)), before=law)
        if weights.law.is_plain:
            break
        law = weights.law
        root[inside] = np.sqrt(weights.weight)
        better = _descend(minimum[0], phi, data, orders, root)
        minimum = minimum if better is None else better
    theta, e, psi = minimum
    freedom = max(count - n, 1)
    sigma = (float(e @ e) / freedom) ** 0.5
    weighted, score = root * e, root * psi
    law = law._replace(sd=(float(weighted @ weighted) / freedom) ** 0.5)
    try:
        inverse = np.linalg.inv(score @ score.T)
    except np.linalg.LinAlgError:
        return None
    inverse = 0.5 * (inverse + inverse.T)
    # the plain covariance times one honest factor covers better than the sandwich itself, whose
    # n^2 numbers a minute cannot fill: 0.92 against 0.88 of K in 60 s of simulated car following
    variance_inflation = residual_tests.long_run_inflation(
        score[:, inside] * weighted[inside],
        score[:, inside] * (law.sd / law.inflation**0.5),
        round(residual_tests.HAC_LAG_S / dt),
    )
    covariance = inverse * (law.sd**2 * law.inflation * variance_inflation)
    if not np.isfinite(covariance).all():
        return None
    return ArmaxFit(
        orders,
        theta,
        covariance,
        variance_inflation,
        inverse,
        law,
        sigma,
        np.where(inside, e, NAN),
        count,
        residual_tests.whiteness(e[inside], fitted=orders.na + orders.nc),
        _lags(data, orders, e, psi),
    )


def _lags(data: _Data, o: Orders, e: Array, psi: Array) -> Lags:
    """What a recursion that goes on where the data end begins with."""
    N = len(data.y)
    if data.runs[-1][1] != N:
        return Lags()

    def newest(x: Array, count: int) -> tuple[float, ...]:
        return tuple(x[N - count :][::-1].tolist())

    return Lags(
        newest(data.y, max(o.na, 1)),
        tuple([newest(u, o.nb + o.nk - 1) for u in data.u]),
        newest(e, o.nc),
        tuple([tuple(psi[:, N - 1 - i].tolist()) for i in range(o.nc)]),
    )


def _ready(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    orders: Orders,
    segment: npt.NDArray[np.int64] | None,
) -> tuple[_Data, float]:
    good = usable & np.isfinite(output) & np.isfinite(inputs).all(axis=1)
    pieces = runs(good, orders.lag() + 5)
    if segment is not None:
        cuts = np.flatnonzero(np.diff(segment)) + 1
        pieces = [
            (int(a), int(b)) for s, e in pieces for a, b in _cut(s, e, cuts) if b - a > orders.lag() + 5
        ]
    y = np.where(good, output, 0.0)
    u = np.ascontiguousarray(np.where(good[:, None], inputs, 0.0).T)
    age = np.full(len(y), -1)
    for a, b in pieces:
        age[a + orders.lag() : b] = np.arange(b - a - orders.lag())
    return _Data(y, u, pieces, age), float(np.std(output[good])) if good.any() else 0.0


def _cut(start: int, end: int, cuts: npt.NDArray[np.int64]) -> list[tuple[int, int]]:
    inner = [start, *(int(c) for c in cuts if start < c < end), end]
    return [(inner[i], inner[i + 1]) for i in range(len(inner) - 1)]


class _Point(NamedTuple):
    theta: Array  # (n,)
    e: Array  # (N,) innovations
    cost: float


def _descend(
    theta: Array, phi: Array, data: _Data, o: Orders, root: Array | None = None
) -> tuple[Array, Array, Array] | None:
    """Parameters, innovations and their negative gradient; None where the data do not excite every parameter.

    `root`: (N,) of the weight of each squared innovation; None: one.
    """
    latest: tuple[Array, Array] | None = None
    excited = True

    def point(theta: Array) -> _Point:
        e = _innovations(theta, phi, data)
        weighted = e if root is None else root * e
        return _Point(theta, e, float(weighted @ weighted))

    def gradient(at: _Point) -> Array:
        nonlocal latest
        if latest is None or latest[0] is not at.theta:
            latest = at.theta, _gradient(at.theta, at.e, phi, data, o)
        return latest[1]

    def local(at: _Point) -> Local[_Point] | None:
        nonlocal excited

        def move(step: Array) -> _Point | None:
            trial = at.theta + step
            stable = polynomial.is_stable([float(c) for c in trial[len(phi) :]], 0.999)
            return point(trial) if stable else None

        near = gauss_newton(gradient(at), at.e, root, move)
        excited = near is not None
        return near

    try:
        minimum = minimise(point(theta), lambda at: at.cost, local, DAMPING).point
    except np.linalg.LinAlgError:
        return None
    return (minimum.theta, minimum.e, gradient(minimum)) if excited else None
