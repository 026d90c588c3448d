"""The noise model of FOPDT's rows: its band, its autoregression, the law of its innovations, and rows at a bound.

Estimated at one point of the search; what it gives, weights and pseudo-values, keeps every later step a matter of
inner products.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import autoregression, band, censoring, innovation_law, residual_tests
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt import (
    fopdt_posterior,
    information_bounds,
    offset_drift,
    reduced_basis,
)
from canid.mathematics.identification.fopdt import regression_rows as rows
from canid.mathematics.identification.fopdt.offset_drift import Drift
from canid.values.types import NAN, Array

Flags = npt.NDArray[np.bool_]

# Highest order of the noise. Ornstein-Uhlenbeck noise is AR(1), a resonance AR(2), autocorrelated plus white noise
# ARMA(1,1), which AR(4) follows to a per cent at 10 Hz.
NOISE_ORDER = 5


# Share of the output's power below which a residual is rounding, and has no band.
EXACT_SHARE = 1e-4


class Point(NamedTuple):
    """One value of every parameter, noise aside."""

    K: Array  # (m,)
    tau: Array  # (m,) s
    dead_time: Array  # (m,) s
    offset: float
    w: Array  # (m b,) the simulated output is the offset and the basis' answers times these


class Data(NamedTuple):
    """Rows made ready: finite, means taken out, zero where neither usable nor bounded."""

    both: Array  # (m b + 1, n) answers and output
    usable: Flags  # (n,)
    bounded: Flags  # (n,) the output is a bound of the demand
    side: Array  # (n,) 1: an upper bound, -1: a lower one
    y_mean: float
    X_mean: Array  # (m b,)

    @property
    def X(self) -> Array:  # noqa: N802
        """Return (m b, n) the basis' answers."""
        answered: Array = self.both[:-1]
        return answered

    @property
    def y(self) -> Array:
        """Return (n,) the output."""
        output: Array = self.both[-1]
        return output


class Phases(NamedTuple):
    """Rows laid out for a stride, one phase after the other, and what every noise model asks of them."""

    data: Data
    run: npt.NDArray[np.int64]  # (n,) usable rows right before each
    change: Array  # (n,) size of the output's change from two rows ago to the last

    def preceded(self, p: int) -> Flags:
        """(n,) where the p rows before are all usable."""
        out: Flags = self.run >= p
        return out


class Weighed(NamedTuple):
    """Rows at one point, and how each counts."""

    rows: Flags  # (n,) which count: their predecessors are usable
    residual: Array  # (n,) not whitened, with pseudo-values at the bound; zero where not usable
    e: Array  # (n,) whitened, likewise, times the root of its weight
    psi: Array  # (n,) the score's part of each row
    law: innovation_law.Law  # of the innovations
    root: Array | None  # (n,) of the weights; None: one each
    shift: Array | None  # (n,) from the whitened bound to its pseudo-value; None: no row at a bound counts
    counted: float  # rows that count, those at a bound by what they are worth


class Noise(NamedTuple):
    """Noise model at one point."""

    ar: Array  # (p,) coefficients of the autoregression
    stride: int  # rows from one to the one that predicts it
    phases: Phases
    weighed: Weighed  # its rows
    variance_inflation: float  # with that of the law
    drift: Drift | None  # of the offset; None: not yet looked for
    slow: Array  # (k, n) its columns, laid out for the stride
    drift_cost: float  # in log likelihood
    sd: float  # of the innovations where the output is known; NaN: as the sum of squares says


def white(data: Data) -> Noise:
    """White noise of one size, of rows as they are."""
    n = len(data.usable)
    count = float(np.count_nonzero(data.usable))
    law = innovation_law.equal(0).law
    weighed = Weighed(data.usable, np.zeros(n), np.zeros(n), np.zeros(n), law, None, None, count)
    return Noise(np.zeros(0), 1, _phased(data, 1), weighed, 1.0, None, np.zeros((0, n)), 0.0, NAN)


def by_channel(layout: rows.Layout, w: Array) -> Array:
    """(m, m b) from (m, b): row i picks channel i's answer from those of all channels."""
    out = np.zeros((layout.inputs, w.size))
    for i, row in enumerate(w):
        out[i, i * len(row) : (i + 1) * len(row)] = row
    return out


def power(x: Array) -> float:
    """Sum of squares."""
    return float(x @ x)


def residual_of(data: Data, simulated: Array) -> Array:
    """(n,) not whitened, of mean zero where usable; zero where neither usable nor bounded."""
    residual: Array = data.y - simulated
    residual -= float(residual @ data.usable) / float(data.usable.sum())
    residual[~(data.usable | data.bounded)] = 0.0
    return residual


def strided(x: Array, stride: int) -> Array:
    """Every `stride`-th row from the first, then from the second, and so on, (k, n) to (k, stride (n/stride + p)).

    Zeros between two phases, as many as a noise model looks back, keep them apart.
    """
    k, n = x.shape
    height = -(-n // stride)
    out = np.zeros((k, stride, height + NOISE_ORDER), x.dtype)
    for phase in range(stride):
        part = x[:, phase::stride]
        out[:, phase, : part.shape[1]] = part
    return out.reshape(k, stride * (height + NOISE_ORDER))


def _phased(data: Data, stride: int) -> Phases:
    """Lay out the phases of a stride one after the other: all rows are used, whatever row the window begins with."""
    if stride > 1:
        usable, bounded = strided(np.vstack([data.usable, data.bounded]), stride)
        side = strided(data.side[None], stride)[0]
        data = Data(strided(data.both, stride), usable, bounded, side, data.y_mean, data.X_mean)
    change = innovation_law.changes(data.y, data.usable)
    return Phases(data, autoregression.run_lengths(data.usable), change)


def estimate(
    layout: rows.Layout,
    data: Data,
    at: Point,
    simulated: Array,
    limits: band.Strides,
    before: Noise | None = None,
    near: bool = False,
) -> Noise:
    """Estimate the noise model at one point.

    Args:
        layout: of the rows.
        data: the window.
        at: the point.
        simulated: (n,) the answer there, its mean taken out.
        limits: of the stride; a shorter one was found too short in this fit already.
        before: of the same window; lends its phases where the stride is the same, and its law.
        near: the point is close to the posterior: elsewhere the misfit would be taken for heavy tails.
    """
    residual = residual_of(data, simulated)
    free = np.where(data.usable, residual, 0.0)
    exact = power(free) <= EXACT_SHARE * power(data.y * data.usable)
    plain = exact or not near
    stride = limits.least if exact else band.stride(free, data.usable, layout.step, limits)
    same = before if before is not None and before.stride == stride else None
    phases = same.phases if same is not None else _phased(data, stride)
    each = reduced_basis.with_slopes(layout.basis, at.tau, at.dead_time)
    phased, usable, bounded = phases.data, phases.data.usable, phases.data.bounded
    m, b = layout.inputs, layout.basis.size
    # (m, 3, n): answer and slopes of each channel; then (3 m, n), all answers first
    J = each.transpose(1, 0, 2) @ phased.X.reshape(m, b, -1)
    J = J.transpose(1, 0, 2).reshape(3 * m, -1)
    last = same.weighed if same is not None else None
    drift = same.drift if same is not None else None
    slow, cost = np.zeros((0, len(usable))), 0.0
    if drift is not None and same is not None:
        slow, drift = same.slow, drift._replace(ar=same.ar)
    elif near and not exact:
        drift = offset_drift.find(residual, data.usable, layout.step, stride, NOISE_ORDER)
        slow = drift.columns if stride == 1 else strided(drift.columns, stride)
    if drift is not None:
        residual, cost = offset_drift.without(drift.columns, residual, data.usable, drift.ar, stride)
    r = residual if stride == 1 else strided(residual[None], stride)[0]
    # one round from the residual's own noise model: from round to round a noise that drifts could excuse ever more drift
    seen = r if last is None or last.shift is None else r + last.shift
    root = last.root if last is not None else None
    ar = autoregression.fit(seen, usable, NOISE_ORDER, bounded=bounded, root=root, run=phases.run)
    law = before.weighed.law if before is not None else None
    weighed = _weigh(phases, r, ar, layout.step, stride, law, plain)
    explained = _explained(layout, at, J, weighed, ar, stride)
    ar = autoregression.fit(
        np.vstack([weighed.residual, explained]),
        usable,
        NOISE_ORDER,
        bounded=bounded,
        root=weighed.root,
        run=phases.run,
    )
    weighed = _weigh(phases, r, ar, layout.step, stride, weighed.law, plain, fit=False)
    inside = autoregression.chosen(weighed.rows)
    slopes = autoregression.whiten(J, ar)
    if weighed.root is not None:
        slopes *= weighed.root
    score = slopes[:, inside]
    score = score - (score.sum(axis=1) / max(score.shape[1], 1))[:, None]
    psi = weighed.psi[inside]
    sd = (power(psi) / max(len(psi), 1)) ** 0.5
    variance_inflation = weighed.law.inflation * residual_tests.long_run_inflation(
        score * psi, score * sd, round(residual_tests.HAC_LAG_S / layout.step / stride)
    )
    # effective number of independent samples of the noise: its variance over its spectrum at zero frequency
    whitened = autoregression.whiten(r, ar)[usable & phases.preceded(len(ar))]
    innovation_sd = (power(whitened) / max(len(whitened), 1)) ** 0.5
    long_run = (innovation_sd / (1.0 - float(np.sum(ar)))) ** 2
    effective = power(np.where(usable, r, 0.0)) / stride / max(long_run, 1e-300)
    return Noise(
        ar,
        stride,
        phases,
        weighed,
        variance_inflation * student_factor(effective) ** 2,
        drift,
        slow,
        cost,
        NAN if weighed.root is None else innovation_sd,
    )


def _weigh(
    phases: Phases,
    r: Array,
    ar: Array,
    step: float,
    stride: int,
    before: innovation_law.Law | None,
    gaussian: bool,
    fit: bool = True,
) -> Weighed:
    """Fit the law of the innovations; replace bounds by pseudo-values.

    Args:
        phases: of the stride.
        r: (n,) residual.
        ar: its autoregression.
        step: s, of the rows.
        stride: rows.
        before: a law to begin with.
        gaussian: without looking for another law.
        fit: the law; else the one before is applied.
    """
    preceded = phases.preceded(len(ar))
    free, at_bound = phases.data.usable & preceded, phases.data.bounded & preceded
    count = float(np.count_nonzero(free))
    e = autoregression.whiten(r, ar)
    e -= float(e @ free) / max(count, 1.0)
    if gaussian or count < innovation_law.MIN_ROWS:
        law = innovation_law.equal(len(e), (power(e[free]) / max(count, 1.0)) ** 0.5)
    else:
        law = _law(phases, e, free, step, stride, before, fit)
    plain = law.law.is_plain
    weight = law.weight
    shift, residual, every = None, r, free
    if at_bound.any() and law.law.sd > 0.0:
        scale = law.law.sd * law.size[at_bound]
        bound, middle, w, known = e[at_bound], 0.0, weight[free], e[free]
        total, size, side = float(w.sum()), law.size[at_bound] ** 2, phases.data.side[at_bound]
        for _ in range(MIDDLE_ROUNDS):
            pseudo = censoring.below(side * (bound - middle) / scale)
            value, of_bound = middle + scale * (side * pseudo.value), pseudo.weight / size
            middle = float(w @ known + of_bound @ value) / (total + float(of_bound.sum()))
        shift = np.zeros(len(e))
        shift[at_bound] = value - bound
        weight = np.where(at_bound, 0.0, weight)
        weight[at_bound] = of_bound
        e, residual, every = e + shift, r + shift, free | at_bound
        count += float(pseudo.freedom.sum())
        plain = False
    root = None if plain else np.sqrt(weight)
    psi = e / law.size * np.where(at_bound, 1.0, law.mixture) if not plain else e
    if shift is not None:
        psi[at_bound] *= pseudo.weight
    return Weighed(every, residual, e if root is None else e * root, psi, law.law, root, shift, count)


def _law(
    phases: Phases,
    e: Array,
    free: Flags,
    step: float,
    stride: int,
    before: innovation_law.Law | None,
    fit: bool,
) -> innovation_law.Weights:
    """Fit or apply the law of innovations (n,); see `_weigh`."""
    if not fit and before is not None and not len(before.slopes):
        return innovation_law.weights(e, before, np.zeros((0, len(e))), free)
    features = innovation_law.features(e, free, phases.change, 1.0 / (step * stride))
    if not fit and before is not None:
        return innovation_law.weights(e, before, features, free)
    return innovation_law.fit(e, free, features, 1.0 / stride, before)


# of the innovations' mean and the pseudo-values, which depend on it
MIDDLE_ROUNDS = 3

# Least degrees of freedom that Student's t is taken for: below, its tails are those of the formula, not of the noise.
MIN_FREEDOM = 4.0


def student_factor(freedom: float) -> float:
    """How much wider Student's t is than a Gaussian at 95 % (Fisher & Cornish 1960, to second order).

    >>> round(NORMAL_QUANTILE * student_factor(10.0), 2)  # tables: 2.23
    2.23
    """
    z2, v = NORMAL_QUANTILE**2, max(freedom, MIN_FREEDOM)
    return 1.0 + (z2 + 1.0) / (4.0 * v) + (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * v * v)


def _explained(
    layout: rows.Layout, at: Point, answers: Array, weighed: Weighed, ar: Array, stride: int
) -> Array:
    """Return (3 m + 1, n): what else the answer and the offset may be, each direction by its own sd.

    Args:
        layout: of the rows.
        at: the point.
        answers: (3 m, n) answers, and their derivatives by tau and by dead time, of unit gain.
        weighed: innovations.
        ar: autoregression so far.
        stride: how many phases the rows hold.
    """
    m = layout.inputs
    J = np.vstack([answers[:m], np.tile(at.K, 2)[:, None] * answers[m:], np.ones(answers.shape[1])])
    inside = autoregression.chosen(weighed.rows)
    white = autoregression.whiten(J, ar)
    if weighed.root is not None:
        white *= weighed.root
    white = white[:, inside]
    variance = power(weighed.e[inside]) / max(white.shape[1] - len(J), 1)
    by_tau, by_dead_time = information_bounds.precision(layout.basis.box)
    least = np.concatenate([np.zeros(m), np.full(m, by_tau), np.full(m, by_dead_time), [0.0]])
    information = white @ white.T / stride + np.diag(variance * least)
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    value, vector = np.linalg.eigh(information / np.outer(size, size))
    known = value > 1e-9
    root = vector[:, known] / np.sqrt(value[known])
    out: Array = variance**0.5 * (root.T / size) @ J
    return out


def score(noise: Noise, step: float) -> float:
    """Log likelihood of the innovations less a unit for each coefficient of the noise model (Akaike 1974).

    On the same rows whatever the autoregression's order, so that fits of one stride may be compared.

    Args:
        noise: at its point.
        step: s, of the rows.
    """
    phases, weighed = noise.phases, noise.weighed
    preceded = phases.preceded(NOISE_ORDER)
    free, at_bound = phases.data.usable & preceded, phases.data.bounded & preceded
    residual = weighed.residual if weighed.shift is None else weighed.residual - weighed.shift
    e = autoregression.whiten(residual, noise.ar)
    e -= float(e @ free) / max(float(np.count_nonzero(free)), 1.0)
    features = innovation_law.features(e, free, phases.change, 1.0 / (step * noise.stride))
    law, value = innovation_law.log_likelihood(e, weighed.law, features, free)
    if at_bound.any() and law.law.sd > 0.0:
        from_bound = phases.data.side[at_bound] * e[at_bound] / (law.law.sd * law.size[at_bound])
        surprise = censoring.surprise(from_bound).value
        value -= 0.5 * power(surprise)
    drifts = bool(len(noise.slow))
    counted = len(noise.ar) + drifts + len(law.law.slopes) + math.isfinite(law.law.freedom)
    return value / noise.stride - counted - noise.drift_cost


def products(noise: Noise, first: int, count: int) -> fopdt_posterior.Products:
    """Inner products of a piece of the rows that count, `count` of them from the `first` on."""
    p, weighed = len(noise.ar), noise.weighed
    begin = max(first - p, 0)
    # with the rows before, which whitening needs
    piece, new = slice(begin, first + count), slice(first - begin, None)
    r, used = weighed.residual[piece], weighed.rows[piece][new].astype(float)
    nuisance = np.zeros((p + 1 + len(noise.slow), len(r)))
    nuisance[0] = 1.0
    for i, row in enumerate(nuisance[1 : p + 1], 1):
        row[i:] = r[:-i]
    nuisance[p + 1 :] = autoregression.whiten(noise.slow[:, piece], noise.ar)
    white = autoregression.whiten(noise.phases.data.both[:, piece], noise.ar)[:, new]
    if weighed.shift is not None:
        white[-1] += weighed.shift[piece][new]
    if weighed.root is not None:
        used *= weighed.root[piece][new]
    white *= used
    return fopdt_posterior.products(white, nuisance[:, new] * used)


def with_answers(noise: Noise, answers: Array) -> Noise:
    """The same model of rows with other answers (k, n)."""
    data = noise.phases.data
    laid = answers if noise.stride == 1 else strided(answers, noise.stride)
    return noise._replace(phases=noise.phases._replace(data=data._replace(both=np.vstack([laid, data.y]))))


def precision(noise: Noise) -> Array:
    """(q,) of the prior of each nuisance column's coefficient, in shares of an innovation's variance: of a drift's alone."""
    return np.concatenate([np.zeros(len(noise.ar) + 1), np.ones(len(noise.slow))])
