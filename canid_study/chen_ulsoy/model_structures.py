"""ARX, ARMAX, OE and BJ at equal order, and what their residuals show (Chen & Ulsoy 2001, sec. 2.2, Fig. 8).

ARX and ARMAX by `mathematics/identification/armax/armax_batch.py`. Output error and Box-Jenkins by prediction errors with
the exact gradient (Ljung 1999, sec. 4.2, eq. 10.53): e = (D/C) [A y - (B/F) u].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.stats import norm

from canid.mathematics.identification.armax import polynomial
from canid.mathematics.identification.armax.armax_batch import Orders, fit_armax
from canid.mathematics.identification.levenberg_marquardt import Damping, Local, minimise
from canid.mathematics.identification.residual_tests import LAGS, LEVEL
from canid.values.types import NAN, Array
from canid_study.chen_ulsoy.segment_fits import fit_segments

STRUCTURES = ("ARX", "ARMAX", "OE", "BJ")
# second-order dynamics with two coefficients of B at a delay of one sample, and one of C, as eq. 3; BJ has two of D, so
# that its noise model is as large as ARMAX's
NF, NB, NC, ND = 2, 2, 1, 2

_DAMPING = Damping(1e-4, up=10.0, down=10.0, least=1e-12, tries=12, iterations=60, tolerance=1e-10)
# poles and zeros of the noise closer to the circle answer for longer than a segment
_RADIUS = 0.999


class StructureFit(NamedTuple):
    """One model of one segment."""

    structure: str
    parameters: dict[str, Array]  # "A", "B", "C", "D", "F" without the leading one; B whole
    residual: Array  # (N,) NaN where not predicted
    loss: float  # mean square of the residual


class ResidualPlot(NamedTuple):
    """Correlations of Fig. 8."""

    lags: Array  # (51,) -25 to 25
    auto: Array  # (51,) of the residual
    cross: Array  # (51,) of residual(t + lag) and input(t): at negative lags the feedback
    auto_bound: float  # 99 %
    cross_bound: float
    inside: float  # share of lags 1 to 25 of the autocorrelation inside the bound


class _Point(NamedTuple):
    theta: Array
    e: Array
    cost: float


def fit(structure: str, y: Array, u: Array) -> StructureFit | None:
    """Fit one structure to one segment.

    Args:
        structure: of `STRUCTURES`.
        y: (N,) output.
        u: (N,) input.

    Returns:
        None where the data do not excite it.

    Raises:
        ValueError: an unknown structure.

    >>> rng = np.random.default_rng(0)
    >>> u = rng.normal(size=2000)
    >>> y = lfilter([0.0, 1.0, -0.5], [1.0, -1.2, 0.4], u) + 0.1 * rng.normal(size=2000)
    >>> model = fit("OE", y, u)
    >>> model.parameters["F"].round(1), model.parameters["B"].round(1)
    (array([-1.2,  0.4]), array([ 1. , -0.5]))
    """
    if structure not in STRUCTURES:
        raise ValueError(f"structure {structure!r} is not one of {', '.join(STRUCTURES)}")
    if structure in ("ARX", "ARMAX"):
        orders = Orders(NF, NB, NC if structure == "ARMAX" else 0, 1)
        made = fit_armax(y, u[:, None], np.full(len(y), True), orders)
        if made is None:
            return None
        known = made.residual[np.isfinite(made.residual)]
        parameters = {"A": made.A[1:], "B": made.B[0]}
        if orders.nc:
            parameters["C"] = made.C[1:]
        return StructureFit(structure, parameters, made.residual, float(np.mean(known**2)))
    nc, nd = (NC, ND) if structure == "BJ" else (0, 0)
    return _prediction_error(structure, y - y.mean(), u - u.mean(), nc, nd)


def _prediction_error(structure: str, y: Array, u: Array, nc: int, nd: int) -> StructureFit | None:
    """OE and BJ: e = (D/C) [y - (B/F) u]."""
    start = fit_segments(y[None], u[None]).theta[0]
    if not np.isfinite(start).all():
        return None
    f = polynomial.project(start[:NF], 0.95)
    c = np.array([np.clip(start[-1], -0.9, 0.9)])[:nc]
    theta0 = np.concatenate([start[NF : NF + NB], f, c, f[:nd] if nd else np.zeros(0)])

    def parts(theta: Array) -> tuple[Array, Array, Array, Array]:
        B = np.concatenate([[0.0], theta[:NB]])
        F = np.concatenate([[1.0], theta[NB : NB + NF]])
        C = np.concatenate([[1.0], theta[NB + NF : NB + NF + nc]])
        return B, F, C, np.concatenate([[1.0], theta[NB + NF + nc :]])

    def point(theta: Array) -> _Point:
        B, F, C, D = parts(theta)
        e = lfilter(D, C, y - lfilter(B, F, u))
        return _Point(theta, e, float(e @ e))

    def gradient(at: _Point) -> Array:
        B, F, C, D = parts(at.theta)
        w = lfilter(B, F, u)
        of_input = lfilter(D, np.convolve(C, F), u)
        of_response = lfilter(D, np.convolve(C, F), w)
        of_residual = lfilter([1.0], C, at.e)
        of_noise = lfilter([1.0], C, y - w)
        rows = [_lag(-of_input, k) for k in range(1, NB + 1)]
        rows += [_lag(of_response, k) for k in range(1, NF + 1)]
        rows += [_lag(-of_residual, k) for k in range(1, nc + 1)]
        rows += [_lag(of_noise, k) for k in range(1, nd + 1)]
        return np.array(rows)

    def local(at: _Point) -> Local[_Point] | None:
        J = gradient(at)
        H = J @ J.T
        size = np.diag(H).copy()
        if not (np.isfinite(size).all() and (size > 0.0).all()):
            return None

        def move(step: Array) -> _Point | None:
            theta = at.theta + step
            _, F, C, D = parts(theta)
            stable = all(polynomial.is_stable([float(x) for x in q[1:]], _RADIUS) for q in (F, C, D))
            return point(theta) if stable else None

        return Local(J @ at.e, H, size, move)

    try:
        minimum = minimise(point(theta0), lambda at: at.cost, local, _DAMPING).point
    except np.linalg.LinAlgError:
        return None
    B, F, C, D = parts(minimum.theta)
    parameters = {"B": B[1:], "F": F[1:]}
    if nc:
        parameters |= {"C": C[1:], "D": D[1:]}
    e = minimum.e.copy()
    e[: max(NB, NF)] = NAN
    return StructureFit(structure, parameters, e, float(np.mean(minimum.e[max(NB, NF) :] ** 2)))


def _lag(x: Array, k: int) -> Array:
    return np.concatenate([np.zeros(k), x[:-k]])


def residual_plot(e: Array, u: Array) -> ResidualPlot:
    """Correlations of a residual with itself and with the input, with 99 % bounds (Ljung 1999, sec. 16.6).

    Args:
        e: (N,) residual, NaN where there is none at its start.
        u: (N,) input.

    >>> rng = np.random.default_rng(0)
    >>> residual_plot(rng.normal(size=600), rng.normal(size=600)).inside > 0.9
    True
    """
    known = np.isfinite(e)
    e, u = e[known] - e[known].mean(), u[known] - u[known].mean()
    N = len(e)
    quantile = float(norm.ppf(0.5 + 0.5 * LEVEL))
    auto = _correlation(e, e)
    cross = _correlation(e, u)
    # of two independent series the variance of their correlation is the sum of the products of their own
    both = float(np.sum(_correlation(e, e) * _correlation(u, u)))
    bound = quantile / N**0.5
    return ResidualPlot(
        np.arange(-LAGS, LAGS + 1.0),
        auto,
        cross,
        bound,
        quantile * (max(both, 0.0) / N) ** 0.5,
        float((np.abs(auto[LAGS + 1 :]) <= bound).mean()),
    )


def _correlation(x: Array, y: Array) -> Array:
    """Of x(t + lag) and y(t), lags -25 to 25."""
    N = len(x)
    scale = float(np.sqrt((x @ x) * (y @ y)))
    if not scale > 0.0:
        return np.zeros(2 * LAGS + 1)
    full = [x[k:] @ y[: N - k] for k in range(LAGS + 1)]
    back = [x[: N - k] @ y[k:] for k in range(LAGS, 0, -1)]
    return np.array([*back, *full]) / scale
