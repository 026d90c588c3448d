"""Output-error transfer functions by separable least squares (Ljung 1999, sec. 10.2; Golub & Pereyra 1973).

y(k) = (B(q) u(k) + C(q) delta(k)) / F(q) + e(k), with n + 1 coefficients in B, n in F, and n in C: the free initial state.
At given F the model is linear in B and C, which are projected out; F is found by Levenberg-Marquardt on the simulation error
(Kaufman 1975), begun from the Steiglitz-McBride iteration (1965) after ARX, and from the model of the order below with one
more pole. The percentage of fit is that of the simulation, not of the one-step prediction. This is what Grover (2021,
sec. 4.2) has of a toolbox; poles may grow, as those of his eq. 2.5 do, and then the model says so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from canid.mathematics.identification.levenberg_marquardt import Damping, Local, minimise
from canid.values.types import NAN, Array
from canid_study.grover.settings import GroverSettings
from canid_study.printed_numbers import SELECTION_PERCENT

Complex = npt.NDArray[np.complex128]

# %; a simulation that diverges has no better description
LEAST_FIT_PERCENT = -1000.0
# growth of an unstable pole over the record that is still tried: beyond it the projection loses all digits that a
# record of 1e-3 resolution holds
MAX_GROWTH = 1e4
# passes of Steiglitz-McBride; it settles in three or four or not at all
PASSES = 4
# of the pole that is added to the model of the order below: in the middle of the decaying ones
ADDED_POLE = 0.5
# damping in shares of the curvature's diagonal, and an end where a step gains less than 0.01 % of the cost: the fit in %
# then changes in its third digit
HOW = Damping(1e-2, 4.0, 6.0, 1e-8, 5, 12, 1e-4, growth=2.0, predicted=True)


class OutputError(NamedTuple):
    """A transfer function of one input as fitted to one record."""

    order: int
    num: Array  # (order + 1,) of q^-1, output unit per input unit
    den: Array  # (order + 1,) of q^-1, monic
    initial: Array  # (order,) of q^-1, what the initial state contributes
    simulated: Array  # (n,) output unit, the initial state included
    fit_percent: float  # of the simulation
    dt: float  # s

    @property
    def poles(self) -> Complex:
        """(order,) in z."""
        return np.asarray(np.roots(self.den), np.complex128)

    @property
    def growing(self) -> int:
        """Number of unstable poles."""
        return int(np.count_nonzero(np.abs(self.poles) >= 1.0))

    @property
    def dc_gain(self) -> float:
        """Output unit per input unit; of an unstable model a number without meaning."""
        total = float(self.den.sum())
        return float(self.num.sum()) / total if total else NAN

    @property
    def continuous_poles(self) -> Complex:
        """(order,) rad/s."""
        at = self.poles
        return np.asarray(np.log(np.where(np.abs(at) > 1e-12, at, 1e-12)) / self.dt, np.complex128)


class _Point(NamedTuple):
    """A denominator and all that is known there."""

    f: Array  # (n,)
    basis: Array  # (N, 2 n + 1) orthonormal, of the filtered inputs and impulses
    residual: Array  # (N,)
    cost: float


def fit_percent(output: Array, simulated: Array) -> float:
    """100 (1 - |y - simulated| / |y - mean y|), not below -1000.

    Args:
        output: (n,).
        simulated: (n,).

    >>> fit_percent(np.array([0.0, 2.0]), np.array([0.0, 2.0])), fit_percent(np.array([0.0, 2.0]), np.ones(2))
    (100.0, 0.0)
    """
    power = float(np.linalg.norm(output - output.mean()))
    if power <= 0.0:
        return NAN
    if not np.isfinite(simulated).all():
        return LEAST_FIT_PERCENT
    return max(100.0 * (1.0 - float(np.linalg.norm(output - simulated)) / power), LEAST_FIT_PERCENT)


def fit(
    output: Array, inp: Array, dt: float, order: int, below: OutputError | None = None
) -> OutputError | None:
    """Fit one order.

    Args:
        output: (N,) detrended.
        inp: (N,) detrended, the input.
        dt: s.
        order: of F, 1 or more.
        below: model of the order below, from which the descent begins as well; None: it is fitted. Begun from
            Steiglitz-McBride alone, 30 of 200 noisy records of a second-order system end in a poorer minimum, by up to 11
            points of the fit; from both none.

    Returns:
        None where the record is shorter than three times its parameters, or a signal is constant.

    >>> rng = np.random.default_rng(1)
    >>> u = rng.standard_normal(400)
    >>> y = lfilter([0.0, 0.2], [1.0, -0.8], u)
    >>> model = fit(y, u, 0.1, 1)
    >>> [round(float(x), 3) for x in (*model.num, *model.den)], round(model.fit_percent, 1)
    ([0.0, 0.2, 1.0, -0.8], 100.0)
    """
    count = 3 * order + 1
    scales = float(np.std(output)), float(np.std(inp))
    if len(output) < 3 * count or min(scales) <= 0.0 or not np.isfinite(scales).all():
        return None
    y, u = output / scales[0], inp / scales[1]
    starts = [_steiglitz_mcbride(y, u, order)]
    if below is None and order > 1:
        below = fit(output, inp, dt, order - 1)
    if below is not None:
        starts.append(np.convolve(below.den, [1.0, -ADDED_POLE])[1:])
    points = [p for p in (_evaluate(y, u, f) for f in starts) if p is not None]
    if not points:
        points = [p for p in (_evaluate(y, u, np.zeros(order)),) if p is not None]
    if not points:
        return None
    minima = [minimise(p, lambda p: p.cost, lambda p: _local(y, u, p), HOW).point for p in points]
    best = min(minima, key=lambda p: p.cost)
    return _model(y, u, best.f, scales, dt)


def orders(output: Array, inp: Array, dt: float, settings: GroverSettings) -> tuple[OutputError, ...]:
    """Fit orders from 1 on, up to the first that reaches the gate (Grover 2021, sec. 4.2).

    Args:
        output: (N,) detrended.
        inp: (N,) detrended.
        dt: s.
        settings: largest order.

    Returns:
        In rising order; none where the record is too short.
    """
    out: list[OutputError] = []
    for order in range(1, settings.max_order + 1):
        model = fit(output, inp, dt, order, out[-1] if out else None)
        if model is None:
            break
        out.append(model)
        if model.fit_percent >= SELECTION_PERCENT:
            break
    return tuple(out)


def selected(models: tuple[OutputError, ...]) -> OutputError | None:
    """The first that reaches the paper's gate, else the best.

    >>> selected(()) is None
    True
    """
    reached = [m for m in models if m.fit_percent >= SELECTION_PERCENT]
    return reached[0] if reached else max(models, key=lambda m: m.fit_percent, default=None)


def simulate(model: OutputError, inp: Array) -> Array:
    """Response from rest, (n,); may overflow where the model is unstable.

    >>> model = OutputError(1, np.array([0.0, 1.0]), np.array([1.0, -0.5]), np.zeros(1), np.zeros(0), 100.0, 0.1)
    >>> simulate(model, np.array([1.0, 0.0, 0.0])).tolist()
    [0.0, 1.0, 0.5]
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(lfilter(model.num, model.den, inp), float)


def initial_responses(model: OutputError, n: int) -> Array:
    """What initial states of one each contribute, (n, order): impulse responses of 1 / F, one sample later each."""
    with np.errstate(over="ignore", invalid="ignore"):
        return _shifted(lfilter([1.0], model.den, _impulse(n)), model.order)


def _impulse(n: int) -> Array:
    out = np.zeros(n)
    out[0] = 1.0
    return out


def _shifted(x: Array, count: int, first: int = 0) -> Array:
    """X and its copies up to `count` samples later, as columns (n, count)."""
    out = np.zeros((len(x), count))
    for k in range(count):
        late = k + first
        out[late:, k] = x[: len(x) - late]
    return out


def _evaluate(y: Array, u: Array, f: Array) -> _Point | None:
    """Project B and C out; None: the poles grow by more than `MAX_GROWTH` over the record."""
    n, den = len(f), np.concatenate([[1.0], f])
    if not np.isfinite(f).all():
        return None
    radius = float(np.abs(np.roots(den)).max(initial=0.0))
    if radius > MAX_GROWTH ** (1.0 / len(y)):
        return None
    columns = np.hstack(
        [_shifted(lfilter([1.0], den, u), n + 1), _shifted(lfilter([1.0], den, _impulse(len(y))), n)]
    )
    basis, _ = np.linalg.qr(columns)
    residual = y - basis @ (basis.T @ y)
    return _Point(f, basis, residual, float(residual @ residual))


def _local(y: Array, u: Array, p: _Point) -> Local[_Point]:
    """Gradient and Gauss-Newton curvature, with Kaufman's projection of the derivative."""
    n, den = len(p.f), np.concatenate([[1.0], p.f])
    slope = _shifted(lfilter([1.0], den, y - p.residual), n, first=1)
    jacobian = slope - p.basis @ (p.basis.T @ slope)  # of the residual
    curvature = jacobian.T @ jacobian
    diagonal = np.diag(curvature)
    # a direction in which nothing changes gets a damping all the same
    damped = diagonal + 1e-9 * max(float(diagonal.max(initial=0.0)), 1e-300) + 1e-30
    return Local(jacobian.T @ p.residual, curvature, damped, lambda step: _evaluate(y, u, p.f + step))


def _steiglitz_mcbride(y: Array, u: Array, order: int) -> Array:
    """ARX, then ARX on both signals filtered by 1 / F, again and again; poles outside are reflected."""
    f = np.zeros(order)
    for _ in range(PASSES):
        den = np.concatenate([[1.0], f])
        y_f, u_f = lfilter([1.0], den, y), lfilter([1.0], den, u)
        columns = np.hstack([-_shifted(y_f, order, first=1), _shifted(u_f, order + 1)])
        solution = np.linalg.lstsq(columns, y_f, rcond=None)[0]
        f = _reflected(solution[:order])
    return f


def _reflected(f: Array) -> Array:
    """Poles outside the unit circle at their reciprocal, all of them a little inside."""
    at = np.roots(np.concatenate([[1.0], f]))
    if not len(at):
        return np.zeros(len(f))
    size = np.maximum(np.abs(at), 1e-12)
    # 0.999 at 10 Hz is a time constant of 100 s, longer than an episode
    at = at / size * np.minimum(np.where(size > 1.0, 1.0 / size, size), 0.999)
    out = np.real(np.poly(at))[1:]
    return np.concatenate([out, np.zeros(len(f) - len(out))])


def _model(y: Array, u: Array, f: Array, scales: tuple[float, float], dt: float) -> OutputError:
    n, den = len(f), np.concatenate([[1.0], f])
    columns = np.hstack(
        [_shifted(lfilter([1.0], den, u), n + 1), _shifted(lfilter([1.0], den, _impulse(len(y))), n)]
    )
    # responses of slow and of growing poles differ by decades in size
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    weights = np.linalg.lstsq(columns / size, y, rcond=1e-14)[0] / size
    simulated = columns @ weights
    gain = scales[0] / scales[1]
    return OutputError(
        n,
        weights[: n + 1] * gain,
        den,
        weights[n + 1 :] * scales[0],
        simulated * scales[0],
        fit_percent(y, simulated),
        dt,
    )
