"""ARMAX of every segment at once, and one fit over all, by prediction errors (Ljung 1999, sec. 10.2).

The model is eq. 3 of Chen & Ulsoy 2001:
A angle = B error + c0 + C e with one delay and C of order one at most. All segments are columns of the same array
operations, 0.3 ms each instead of the 5 ms of `mathematics/identification/armax/armax_batch.py`, which starts them by Hannan
& Rissanen's regression as well. Least squares without weights: repetitions of a driver are Gaussian, and the paper fits so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.first_order import scan
from canid.values.types import NAN, Array

# names of the parameters of eq. 3
NAMES = ("a1", "a2", "b1", "b2")

# steps of Levenberg-Marquardt: five are usual, a pole next to a zero takes twenty
_ITERATIONS = 30
# relative fall of the cost at which a segment has converged
_TOLERANCE = 1e-8
# largest |c1|: beyond it the residual's start fills the segment
_MAX_C = 0.98
# segments of one batch: their arrays stay within the cache of a few MB
_BATCH = 128
# order of the long regression that gives the start's innovations (Hannan & Rissanen 1982), 1 s at 10 Hz
_LONG = 10


class Fits(NamedTuple):
    """One ARMAX model per segment."""

    theta: Array  # (S, n) a1..., b1..., c0, and c1 where C has one; NaN where it could not be fitted
    covariance: Array  # (S, n, n)
    sigma: Array  # (S,) of the innovations
    residual: Array  # (S, N) innovations, NaN before the first
    na: int
    nb: int

    @property
    def model(self) -> Array:
        """(S, na + nb) parameters of A and B."""
        return self.theta[:, : self.na + self.nb]

    @property
    def model_covariance(self) -> Array:
        """(S, na + nb, na + nb)."""
        k = self.na + self.nb
        return self.covariance[:, :k, :k]

    def take(self, rows: npt.NDArray[np.bool_]) -> Fits:
        """Fits of some segments."""
        return self._replace(
            theta=self.theta[rows],
            covariance=self.covariance[rows],
            sigma=self.sigma[rows],
            residual=self.residual[rows],
        )


class Joint(NamedTuple):
    """One model of all segments, each with its own offset and noise."""

    theta: Array  # (n,) a1, a2, b1, b2, c1
    covariance: Array  # (n, n)
    offset: Array  # (S,)
    sigma: Array  # (S,)

    @property
    def model(self) -> Array:
        """(4,) a1, a2, b1, b2."""
        return self.theta[:-1]


def fit_segments(
    angle: Array, error: Array, na: int = 2, nb: int = 2, nc: int = 1, start: Array | None = None
) -> Fits:
    """Fit every segment by itself.

    Args:
        angle: (S, N) output.
        error: (S, N) input, the lateral error.
        na: order of A.
        nb: coefficients of B, the first at a delay of one sample.
        nc: 0 or 1, of C.
        start: (S, n) or (n,) parameters to begin at; None: by Hannan & Rissanen's regression.

    Returns:
        Parameters with covariances; NaN where the data do not excite them.

    Raises:
        ValueError: orders that are not provided.

    >>> rng = np.random.default_rng(0)
    >>> y, e, d = rng.normal(size=(3, 600)), 0.1 * rng.normal(size=(3, 600)), np.zeros((3, 600))
    >>> for t in range(2, 600): d[:, t] = 1.2*d[:, t-1] - .4*d[:, t-2] - 2*y[:, t-1] + y[:, t-2] + e[:, t] + .3*e[:, t-1]
    >>> fit_segments(d, y).theta[0].round(1) + 0.0
    array([-1.2,  0.4, -2. ,  1. ,  0. ,  0.3])
    """
    if na < 1 or nb < 1 or nc not in (0, 1):
        raise ValueError(f"orders na {na}, nb {nb}, nc {nc}: na, nb >= 1 and nc 0 or 1")
    S, N = angle.shape
    n = na + nb + 1 + nc
    out = Fits(np.full((S, n), NAN), np.full((S, n, n), NAN), np.full(S, NAN), np.full((S, N), NAN), na, nb)
    for first in range(0, S, _BATCH):
        part = slice(first, min(first + _BATCH, S))
        begin = None if start is None else np.broadcast_to(start, (S, n))[part]
        theta, covariance, sigma, e = _batch(angle[part], error[part], na, nb, nc, begin)
        out.theta[part], out.covariance[part], out.sigma[part] = theta, covariance, sigma
        out.residual[part, N - e.shape[1] :] = e
    return out


def regressors(angle: Array, error: Array, na: int, nb: int) -> Array:
    """(S, na + nb + 1, N - lag): minus the lags of the angle, the lags of the error, one."""
    lag, N = max(na, nb), angle.shape[1]
    rows = [-angle[:, lag - k : N - k] for k in range(1, na + 1)]
    rows += [error[:, lag - k : N - k] for k in range(1, nb + 1)]
    return np.stack([*rows, np.ones_like(rows[0])], axis=1)


def solve(H: Array, g: Array) -> Array:
    """Solve (S, n, n) systems; NaN where one is singular."""
    try:
        solution: Array = np.asarray(np.linalg.solve(H, g[..., None])[..., 0], np.float64)
    except np.linalg.LinAlgError:
        solution = np.full(g.shape, NAN)
        for k, (matrix, right) in enumerate(zip(H, g, strict=True)):
            try:
                solution[k] = np.linalg.solve(matrix, right)
            except np.linalg.LinAlgError:
                continue
    return solution


def _start(phi: Array, angle: Array, error: Array, nc: int, lag: int) -> Array:
    """Least squares; with C on the innovations of a long ARX as well."""
    y = angle[:, lag:]
    if nc:
        wide = regressors(angle, error, _LONG, _LONG)
        w = _least_squares(wide, angle[:, _LONG:])
        e = np.zeros(angle.shape)
        e[:, _LONG:] = angle[:, _LONG:] - np.einsum("sk,skt->st", w, wide)
        phi = np.concatenate([phi, e[:, None, lag - 1 : -1]], axis=1)[:, :, _LONG:]
        y = y[:, _LONG:]
    theta = _least_squares(phi, y)
    if nc:
        theta[:, -1] = np.clip(theta[:, -1], -0.9, 0.9)
    return theta


def _least_squares(X: Array, y: Array) -> Array:
    H = X @ X.swapaxes(1, 2)
    # relative: where double precision ends
    H = H + 1e-12 * np.trace(H, axis1=1, axis2=2)[:, None, None] * np.eye(H.shape[1])
    return solve(H, np.einsum("skt,st->sk", X, y))


def _innovations(theta: Array, phi: Array, y: Array, nc: int) -> Array:
    k = phi.shape[1]
    e: Array = y - np.einsum("sk,skt->st", theta[:, :k], phi)
    return scan(e, -theta[:, k:]) if nc else e


def _gradient(theta: Array, e: Array, phi: Array, nc: int) -> Array:
    """Minus the derivative of the innovations, (S, n, N)."""
    if not nc:
        return phi
    before = np.concatenate([np.zeros((len(e), 1)), e[:, :-1]], axis=1)
    return scan(np.concatenate([phi, before[:, None]], axis=1), -theta[:, -1:, None])


def _batch(
    angle: Array, error: Array, na: int, nb: int, nc: int, start: Array | None
) -> tuple[Array, Array, Array, Array]:
    """Levenberg-Marquardt in which every segment has its own damping."""
    lag = max(na, nb)
    phi, y = regressors(angle, error, na, nb), angle[:, lag:]
    theta = _start(phi, angle, error, nc, lag) if start is None else np.array(start)
    theta = np.where(np.isfinite(theta), theta, 0.0)
    e = _innovations(theta, phi, y, nc)
    S, n = theta.shape
    if nc:
        mu, going = np.full(S, 1e-6), np.full(S, True)
        cost = np.einsum("st,st->s", e, e)
        for _ in range(_ITERATIONS):
            at = np.flatnonzero(going)
            if not len(at):
                break
            psi = _gradient(theta[at], e[at], phi[at], nc)
            H = psi @ psi.swapaxes(1, 2)
            diagonal = np.einsum("skk->sk", H).copy()
            damped = H + (mu[at, None] * diagonal + 1e-300)[:, :, None] * np.eye(n)
            step = solve(damped, np.einsum("skt,st->sk", psi, e[at]))
            trial = theta[at] + np.where(np.isfinite(step), step, 0.0)
            inside = np.abs(trial[:, -1]) < _MAX_C
            trial[:, -1] = np.clip(trial[:, -1], -_MAX_C, _MAX_C)
            e_trial = _innovations(trial, phi[at], y[at], nc)
            new = np.einsum("st,st->s", e_trial, e_trial)
            better = inside & (new <= cost[at]) & np.isfinite(new)
            fell = cost[at] - new
            done = better & (fell <= _TOLERANCE * cost[at])
            moved = at[better]
            theta[moved], e[moved] = trial[better], e_trial[better]
            cost[moved] = new[better]
            mu[at] = np.where(better, np.maximum(mu[at] / 10.0, 1e-12), mu[at] * 10.0)
            # twelve steps in a row that cost more: the minimum
            going[at] = ~done & (mu[at] < 1e6)
    psi = _gradient(theta, e, phi, nc)
    variance = np.einsum("st,st->s", e, e) / max(e.shape[1] - n, 1)
    covariance = _inverse(psi @ psi.swapaxes(1, 2)) * variance[:, None, None]
    bad = ~(np.isfinite(covariance).all(axis=(1, 2)) & (np.einsum("skk->sk", covariance) > 0.0).all(axis=1))
    theta[bad], covariance[bad], variance[bad] = NAN, NAN, NAN
    return theta, covariance, np.sqrt(variance), e


def _inverse(H: Array) -> Array:
    """Inverses of (S, n, n); NaN where singular. Scaled, since parameters differ in unit and size."""
    size = np.sqrt(np.maximum(np.einsum("skk->sk", H), 1e-300))
    scaled = H / (size[:, :, None] * size[:, None, :])
    out = np.full(H.shape, NAN)
    good = np.isfinite(scaled).all(axis=(1, 2))
    if good.any():
        conditioned = np.zeros(len(H), bool)
        conditioned[good] = np.linalg.cond(scaled[good]) < 1e13
        out[conditioned] = np.linalg.inv(scaled[conditioned])
    out = out / (size[:, :, None] * size[:, None, :])
    symmetric: Array = 0.5 * (out + out.swapaxes(1, 2))
    return symmetric


def fit_joint(angle: Array, error: Array, start: Array) -> Joint | None:
    """One ARMAX(2,2,1) over all segments: prediction errors weighted by each segment's own noise.

    Averages of minute fits are biased, because the lags of the output are random; of one fit over S minutes that bias
    is S times smaller (Ljung 1999, sec. 9.2).

    Args:
        angle: (S, N).
        error: (S, N).
        start: (5,) a1, a2, b1, b2, c1 to begin at.

    Returns:
        None where the data do not excite the parameters.

    >>> rng = np.random.default_rng(0)
    >>> y, e, d = rng.normal(size=(9, 600)), 0.1 * rng.normal(size=(9, 600)), np.zeros((9, 600))
    >>> for t in range(2, 600): d[:, t] = 1.2*d[:, t-1] - .4*d[:, t-2] - 2*y[:, t-1] + y[:, t-2] + e[:, t] + .3*e[:, t-1]
    >>> fit_joint(d, y, np.array([-1.0, 0.3, -1.0, 0.5, 0.0])).theta.round(1) + 0.0
    array([-1.2,  0.4, -2. ,  1. ,  0.3])
    """
    phi, y = regressors(angle, error, 2, 2), angle[:, 2:]
    common = phi[:, :-1]
    theta, level = np.array(start, float), y.mean(axis=1) * (1.0 + start[0] + start[1])
    S, N = y.shape
    weight = np.ones(S)

    def innovations(theta: Array, level: Array) -> Array:
        v = y - np.einsum("k,skt->st", theta[:-1], common) - level[:, None]
        return scan(v, np.array([-theta[-1]]))

    e = innovations(theta, level)
    H = np.eye(5)
    for _ in range(_ITERATIONS):
        variance = np.einsum("st,st->s", e, e) / (N - 2)
        if not (np.isfinite(variance).all() and (variance > 0.0).all()):
            return None
        weight = 1.0 / variance
        before = np.concatenate([np.zeros((S, 1)), e[:, :-1]], axis=1)
        rows = np.concatenate([common, before[:, None], np.ones((S, 1, N))], axis=1)
        psi = scan(rows, np.array([-theta[-1]]))
        of_level = psi[:, -1]
        power = np.einsum("st,st->s", of_level, of_level)
        # each segment's offset is eliminated (Frisch & Waugh 1933)
        along = np.einsum("skt,st->sk", psi[:, :-1], of_level) / power[:, None]
        clean = psi[:, :-1] - along[:, :, None] * of_level[:, None]
        H = np.einsum("s,skt,slt->kl", weight, clean, clean, optimize=True)
        g = np.einsum("s,skt,st->k", weight, clean, e, optimize=True)
        try:
            step = np.linalg.solve(H, g)
        except np.linalg.LinAlgError:
            return None
        step_level = np.einsum("st,st->s", of_level, e) / power - along @ step
        shrink = 1.0
        cost = float(np.log(variance).sum())
        for _ in range(8):
            new = theta + shrink * step
            if abs(new[-1]) < _MAX_C:
                trial = innovations(new, level + shrink * step_level)
                trial_cost = float(np.log(np.einsum("st,st->s", trial, trial) / (N - 2)).sum())
                if trial_cost <= cost:
                    break
            shrink *= 0.5
        else:
            break
        theta, level, e = new, level + shrink * step_level, trial
        if cost - trial_cost <= _TOLERANCE * S:
            break
    if not np.isfinite(theta).all():
        return None
    return Joint(theta, _inverse(H[None])[0], level, np.sqrt(np.einsum("st,st->s", e, e) / (N - 2)))


def reasonable(model: Array, na: int = 2) -> npt.NDArray[np.bool_]:
    """Which models have stable poles that are not negative in z (Chen & Ulsoy 2001, sec. 4.1).

    Args:
        model: (S, na + nb).
        na: order of A; of the second order by the signs of its polynomial, else by its roots.

    >>> reasonable(np.array([[-1.2, 0.36, 1.0, -0.9], [-2.1, 1.1, 1.0, -0.9], [0.2, -0.1, 1.0, -0.9]])).tolist()
    [True, False, False]
    """
    out = np.zeros(len(model), bool)
    for k, coefficients in enumerate(model[:, :na]):
        if np.isfinite(coefficients).all():
            z = np.roots(np.concatenate([[1.0], coefficients]))
            negative = (np.abs(z.imag) < 1e-9) & (z.real < 0.0)
            out[k] = bool((np.abs(z) < 1.0).all() and not negative.any())
    return out
