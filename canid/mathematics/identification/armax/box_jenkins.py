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

from canid.mathematics.identification import band, innovation_law, residual_tests
from canid.mathematics.identification.armax import polynomial
from canid.mathematics.identification.armax.prediction_errors import (
    BoxJenkinsOrders,
    Point,
    Rows,
    at_point,
    gradient,
    shifted,
    whitened,
)
from canid.mathematics.identification.armax.rates import STATED_S
from canid.mathematics.identification.armax.simulated_fit import FORGOTTEN_S, fit_percent, since
from canid.mathematics.identification.armax.walled_descent import (
    GIVEN_LAG,
    TRIAL,
    at_delay_wall,
    at_pole_wall,
    descend,
)
from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE
from canid.mathematics.identification.fopdt import vehicle_band
from canid.mathematics.identification.output_filter import Kernel, equalizer, filtered
from canid.values.types import NAN, Array, OutputFilter

# s; lags at which the search starts, for every input
START_LAGS_S = (0.3, 1.0)
# s; dead times that are tried: two coefficients of B span the tenth of a second from one to the next
DEAD_TIMES_S = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8)


# samples by which a dead time is moved at most, where B is pressed against its wall
MOST_SHIFTS = 3

# rounds of the law of the innovations and of the parameters under it
LAW_ROUNDS = 2


class StandardErrors(NamedTuple):
    """Of the coefficients."""

    B: Array  # (m, nb)
    F: Array  # (m, nf + 1) the first is 0
    C: Array  # (nc + 1,) the first is 0
    D: Array  # (nd + 1,) the first is 0


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
    stride: (
        int  # samples per step of C and D: more than one where the noise has no content above some frequency
    )
    cost: float  # sum of squared innovations, weighted, over the stride
    law: innovation_law.Law  # of the innovations
    root: Array | None  # (N,) of the weight of each squared innovation, by phase; None: one
    fit_percent: float  # of the simulated answers, see simulated_fit.py
    # (n, n) with the curvature by the inputs as vehicles move them (White 1982): their noise adds to the score alone
    sandwich: Array

    @property
    def B(self) -> Array:  # noqa: N802
        """Return (m, nb), one row per input, first coefficient at the input's delay."""
        return self._inputs[:, : self.orders.nb]

    @property
    def F(self) -> Array:  # noqa: N802
        """Return (m, nf + 1), with the leading one."""
        coefficients = self._inputs[:, self.orders.nb :]
        return np.concatenate([np.ones((len(coefficients), 1)), coefficients], axis=1)

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
    def standard_errors(self) -> StandardErrors:
        """Of the coefficients, in the shapes of B, F, C and D; the leading ones are exact."""
        sd = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        same = self._replace(theta=sd)
        exact = (same.F - np.eye(1, same.F.shape[1]), same.C - np.eye(1, len(same.C))[0])
        return StandardErrors(same.B, *exact, same.D - np.eye(1, len(same.D))[0])

    @property
    def _inputs(self) -> Array:
        o = self.orders
        return self.theta[: len(self.delays) * (o.nb + o.nf)].reshape(-1, o.nb + o.nf)


def fit_rows(rows: Rows, dt: float, output_filter: OutputFilter | None = None) -> BoxJenkinsFit | None:
    """Fit one model to rows made ready.

    Args:
        rows: from `ready_rows`.
        dt: s.
        output_filter: that the output has passed; None: nothing is said of one.

    Returns:
        The fit, or None where there are too few data or they do not excite.

    >>> rng = np.random.default_rng(0)
    >>> u, e = rng.normal(size=(3000, 1)), 0.1 * rng.normal(size=3000)
    >>> w, v = np.zeros(3000), np.zeros(3000)
    >>> for t in range(2, 3000): w[t] = 0.8 * w[t-1] + 0.5 * u[t-1, 0]; v[t] = 0.6 * v[t-1] + e[t]
    >>> fit = fit_rows(ready_rows(w + v, u, np.full(3000, True), BoxJenkinsOrders(1, 1, 0, 1, 1)), 0.1)
    >>> fit.B.round(1), fit.F.round(1), fit.D.round(1)
    (array([[0.5]]), array([[ 1. , -0.8]]), array([ 1. , -0.6]))
    """
    limits = band.strides(dt, output_filter)
    data = at_stride(rows, limits.least)
    minimum = _search(data, dt)
    if minimum is None:
        return None
    # the residual of the first fit shows the noise's band
    rest, used = np.empty(len(minimum.v)), np.empty(len(minimum.v), bool)
    rest[data.phased], used[data.phased] = minimum.v, data.age >= 0
    stride = band.stride(rest, used, dt, limits)
    if stride != data.stride:
        data = at_stride(rows, stride)
        minimum = _search(data, dt)
    if minimum is None:
        return None
    data, minimum = _delayed(data, minimum, dt)
    data, minimum, law = _under_law(data, minimum, dt)
    return _finished(data, minimum, law, np.full(len(minimum.theta), True), dt)


def _under_law(data: Rows, minimum: Point, dt: float) -> tuple[Rows, Point, innovation_law.Law]:
    """Fit the law of the innovations, and the parameters under it."""
    law, known = innovation_law.equal(0).law, data.age >= data.orders.nd
    if np.count_nonzero(known) < innovation_law.MIN_ROWS * data.stride:
        return data, minimum, law
    change = innovation_law.changes(data.y, data.age >= 0)
    for _ in range(LAW_ROUNDS):
        features = innovation_law.features(minimum.e, known, change, 1.0 / (dt * data.stride))
        weights = innovation_law.fit(minimum.e, known, features, 1.0 / data.stride, law)
        if weights.law.is_plain:
            break
        tried = data._replace(root=np.where(known, np.sqrt(weights.weight), 0.0))
        free = np.full(len(minimum.theta), True)
        better = descend(minimum.theta, tried, dt, free)
        if better is None:
            break
        law = weights.law
        data, minimum = _off_walls(tried, better, dt, free)
        if data.delays != tried.delays:
            better = descend(minimum.theta, data, dt, free)
            minimum = minimum if better is None else better
    return data, minimum, law


def _delayed(data: Rows, minimum: Point, dt: float) -> tuple[Rows, Point]:
    """Choose the dead time of each input, the last first, by the innovations' variance."""
    o, free = data.orders, np.full(len(minimum.theta), True)
    # a fall of 2 log likelihood that chance alone seldom makes; all phases fall together
    clear = CHI_SQUARED_QUANTILE * data.stride * minimum.cost / max(int((data.age >= 0).sum()), 1)
    for i in reversed(range(len(data.u))):
        begun = data.delays[i]
        for late in sorted({max(round(seconds / dt), 1) for seconds in DEAD_TIMES_S} - {begun}):
            tried = data._replace(delays=(*data.delays[:i], late, *data.delays[i + 1 :]))
            theta = minimum.theta.copy()
            at = slice(i * (o.nb + o.nf), i * (o.nb + o.nf) + o.nb)
            theta[at] = theta[at].mean()
            other = descend(theta, tried, dt, free, TRIAL)
            if other is not None and other.cost < minimum.cost - clear:
                data, minimum = tried, other
    data, minimum = _off_walls(data, minimum, dt, free)
    best = descend(minimum.theta, data, dt, free)
    return data, minimum if best is None else best


def _off_walls(data: Rows, minimum: Point, dt: float, free: npt.NDArray[np.bool_]) -> tuple[Rows, Point]:
    """Move the dead time of an input whose B is pressed towards another by a sample, as long as that gains."""
    o, m = data.orders, len(data.u)
    for _ in range(MOST_SHIFTS):
        moved = False
        for i, to in enumerate(at_delay_wall(minimum.theta, o, m)):
            late = data.delays[i] + to
            if not to or late < 1:
                continue
            tried = data._replace(delays=(*data.delays[:i], late, *data.delays[i + 1 :]))
            theta, at = minimum.theta.copy(), slice(i * (o.nb + o.nf), i * (o.nb + o.nf) + o.nb)
            # the same answer, one sample further in B
            theta[at] = np.roll(theta[at], -to)
            other = descend(theta, tried, dt, free, TRIAL)
            if other is not None and other.cost < minimum.cost:
                data, minimum, moved = tried, other, True
        if not moved:
            break
    return data, minimum


def refit(fit: BoxJenkinsFit, rows: Rows, dt: float, i: int, lag: float) -> BoxJenkinsFit | None:
    """Fit again with the first pole of one input fixed.

    Args:
        fit: from `fit_rows`.
        rows: what it was fitted to, from `ready_rows`.
        dt: s.
        i: the input.
        lag: s, of its pole.
    """
    o, data = fit.orders, at_stride(rows._replace(delays=fit.delays), fit.stride)._replace(root=fit.root)
    at = i * (o.nb + o.nf) + o.nb
    theta, free = fit.theta.copy(), np.full(len(fit.theta), True)
    # the gain stays about where it was
    pole = -np.exp(-dt / lag)
    theta[at - o.nb : at] *= (1.0 + pole) / (1.0 + theta[at])
    theta[at], free[at] = pole, False
    minimum = descend(theta, data, dt, free, GIVEN_LAG)
    return None if minimum is None else _finished(*_off_walls(data, minimum, dt, free), fit.law, free, dt)


def ready_rows(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    orders: BoxJenkinsOrders = BoxJenkinsOrders(),  # noqa: B008
    *,
    segment: npt.NDArray[np.int64] | None = None,
    dt: float = STATED_S,
    output_filter: OutputFilter | None = None,
) -> Rows:
    """Make data ready: a stated filter undone, runs found.

    Args:
        output: (N,), NaN where not measured.
        inputs: (N, m), NaN where not measured.
        usable: (N,) whether the output may be learned from; the inputs drive the answers all the same.
        orders: of the polynomials.
        segment: (N,), changes where the inputs' history breaks.
        dt: s, the grid's step.
        output_filter: that the output has passed; None: not known.
    """
    output, inputs = np.array(output, float), np.array(inputs, float)
    by = equalizer(output_filter, dt)
    if by is not None:
        output = _equalized(output, by.output)
        inputs = np.array([_equalized(u, by.answers) for u in inputs.T]).T
    return _ready(output, inputs, usable, orders, segment, dt)


def at_stride(rows: Rows, stride: int) -> Rows:
    """Put the phases of a stride one after the other: the noise model steps by `stride` samples.

    Args:
        rows: from `ready_rows`.
        stride: samples.
    """
    N = len(rows.y)
    phased = np.concatenate([np.arange(phase, N, stride) for phase in range(stride)])
    # a step back is `stride` samples back: the same run, so many steps from its start
    age = np.where(rows.age >= 0, rows.age // stride, -1)
    return rows._replace(y=rows.y[phased], age=age[phased], stride=stride, phased=phased, root=None)


def _search(data: Rows, dt: float) -> Point | None:
    o, m, inside = data.orders, len(data.u), data.age >= 0
    n = m * (o.nb + o.nf) + 1 + o.nc + o.nd
    if int(inside.sum()) < 10 * n * data.stride or not float(np.ptp(data.y[inside])) > 0.0:
        return None
    starts = [_start(data, lags, dt) for lags in itertools.product(START_LAGS_S, repeat=m)]
    points = [at_point(theta, data) for theta in starts if theta is not None]
    if not points:
        return None
    nearest = min(points, key=lambda at: at.cost)
    return descend(nearest.theta, data, dt, np.full(n, True))


def _finished(
    data: Rows, best: Point, law: innovation_law.Law, free: npt.NDArray[np.bool_], dt: float
) -> BoxJenkinsFit | None:
    o, inside = data.orders, data.age >= 0
    free = free.copy()
    for i in np.flatnonzero(at_pole_wall(best.theta, o, len(data.u), dt)):
        # at a lag of zero a pole does what a coefficient of B does
        free[i * (o.nb + o.nf) + o.nb : (i + 1) * (o.nb + o.nf)] = False
    count, n = int(inside.sum()), int(free.sum())
    psi, slow, e = gradient(best, data)[free], _slow_gradient(best, data, dt)[free], best.e
    freedom = max(count - n * data.stride, 1)
    sigma2 = float(e @ e) / freedom
    law = law._replace(sd=(best.cost / freedom) ** 0.5)
    if data.root is not None:
        psi, slow, e = data.root * psi, data.root * slow, data.root * e
    try:
        information = psi @ psi.T
        inverse, bread = np.linalg.inv(information), np.linalg.inv(slow @ slow.T)
    except np.linalg.LinAlgError:
        return None
    inflation = residual_tests.long_run_inflation(
        psi[:, inside] * e[inside],
        psi[:, inside] * (law.sd / law.inflation**0.5),
        max(round(residual_tests.HAC_LAG_S / dt / data.stride), 1),
    )
    # the phases of a stride know together about as much as one of them
    covariance, sandwich = np.zeros((2, len(free), len(free)))
    for out, by in ((covariance, inverse), (sandwich, bread @ information @ bread)):
        out[np.ix_(free, free)] = 0.5 * (by + by.T) * (law.sd**2 * law.inflation * inflation * data.stride)
    if not np.isfinite(covariance).all() or not (np.diag(covariance)[free] > 0.0).all():
        return None
    residual = np.empty(len(best.e))
    residual[data.phased] = np.where(inside, best.e, NAN)
    return BoxJenkinsFit(
        data.orders,
        data.delays,
        best.theta,
        covariance,
        inflation,
        sigma2**0.5,
        residual,
        count,
        data.stride,
        best.cost / data.stride,
        law,
        data.root,
        fit_percent(data.y, best.v, inside),
        sandwich,
    )


def _slow_gradient(at: Point, data: Rows, dt: float) -> Array:
    """The gradient (n, N) by the inputs as vehicles move them (fopdt/vehicle_band.py)."""
    moved = at_point(at.theta, data._replace(u=vehicle_band.slow(data.u, dt)))
    return gradient(at._replace(filtered=moved.filtered, answers=moved.answers), data)


def _equalized(x: Array, by: Kernel) -> Array:
    """Filter (N,); NaN where the kernel reads what is not known."""
    value, known = filtered(by, x)
    return np.where(known, value, NAN)


def _ready(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    orders: BoxJenkinsOrders,
    segment: npt.NDArray[np.int64] | None,
    dt: float,
) -> Rows:
    N, delays = len(output), (orders.nk,) * inputs.shape[1]
    known: npt.NDArray[np.bool_] = np.asarray(np.isfinite(inputs).all(axis=1))
    driven = since(known, segment)
    warm = round(FORGOTTEN_S / dt) + max(delays) + orders.nb
    used: npt.NDArray[np.bool_] = np.asarray(usable & known & np.isfinite(output) & (driven >= warm))
    return Rows(
        np.where(used, output, 0.0),
        np.ascontiguousarray(np.where(known[:, None], inputs, 0.0).T),
        driven,
        since(used, segment),
        orders,
        delays,
        1,
        np.arange(N),
    )


def _start(data: Rows, lags: tuple[float, ...], dt: float) -> Array | None:
    """B and offset by generalised least squares at given lags, D by the residual's autoregression."""
    o, inside = data.orders, data.age >= 0
    rows = []
    for u, lag, late in zip(data.u, lags, data.delays, strict=True):
        pole = np.zeros(o.nf)
        pole[:1] = -np.exp(-dt / lag)
        filtered = polynomial.divide(u, pole, data.driven)
        rows += [shifted(filtered, late + j, data.driven) for j in range(o.nb)]
    X = np.array([*rows, np.ones(len(data.y))])[:, data.phased]
    c, d = np.zeros(o.nc), np.zeros(o.nd)
    w = np.zeros(len(X))
    for _ in range(2):
        white = whitened(np.concatenate([X, data.y[None]]), c, d, data.age)
        white[:, data.age < o.nd] = 0.0
        w = np.linalg.lstsq(white[:-1].T, white[-1], rcond=None)[0]
        v = np.where(inside, data.y - w @ X, 0.0)
        d = -_autoregression(v, o.nd, data.age)
    of_inputs = []
    for i, lag in enumerate(lags):
        pole = np.zeros(o.nf)
        pole[:1] = -np.exp(-dt / lag)
        of_inputs += [*np.full(o.nb, w[i * o.nb : (i + 1) * o.nb].mean()), *pole]
    theta = np.array([*of_inputs, w[-1], *c, *polynomial.project(d, 0.98)])
    return theta if np.isfinite(theta).all() else None


def _autoregression(v: Array, order: int, age: npt.NDArray[np.int64]) -> Array:
    rows = np.array([shifted(v, i, np.maximum(age, 0)) for i in range(1, order + 1)]).reshape(order, -1)
    some = age >= order
    coefficients: Array = np.linalg.lstsq(rows[:, some].T, v[some], rcond=None)[0]
    return coefficients
