"""How sure an estimate is: robust covariance, profile likelihood, and block jackknife.

The covariance of a fit and of its scores is robust against autocorrelated noise (White 1982; Newey & West 1987), and so is
the evidence that chance exceeds. Profile likelihoods (Venzon & Moolgavkar 1988) are for likelihoods that are no parabola:
of a dead zone's width, a threshold, the split of a delay the likelihood falls slowly on one side and fast on the other,
and the curvature at its top shows neither. Each end is moved, all other parameters and the noise fitted anew, until the
fall is what the interval allows, times the variance inflation of the score. The block jackknife estimates with one stretch
of the drive left out (Quenouille 1956, Künsch 1989).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import qr
from scipy.stats import chi2
from scipy.stats import t as student

from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE, MISS, SIGMAS
from canid.models.diagnosis.fitting.fitted_model import FittedModel, M, solve
from canid.models.diagnosis.fitting.least_squares import Fitted, without_memory
from canid.models.diagnosis.fitting.model import Columns, place
from canid.models.effects.effect import Effect
from canid.values.findings import Flags
from canid.values.types import Array, Interval

# of a direction's own size; keeps the inverse of two that coincide finite
RIDGE = 1e-6
# s; the autocorrelation that whitening leaves, and that of the noise scale, has died away by then
SCORE_LAG_S = 5.0
# chance that any candidate is named on a drive without causes, all of them together: half of what is promised, as
# evidence is trusted to follow its law only so far
FALSE_ALARM = 0.005


def needed(parameters: int, tried: int) -> float:
    """Evidence that chance exceeds once in FALSE_ALARM drives, with so many candidates (Bonferroni).

    Example:
        >>> round(needed(1, 20), 1)
        13.4
    """
    return float(chi2.isf(FALSE_ALARM / max(tried, 1), max(parameters, 1)))


def inflation(fitted: Fitted, indices: Sequence[int], dt: float) -> float:
    """Variance inflation of the score of some parameters over the likelihood's: at least 1.

    The likelihood believes that whitened residuals are white and of even size. The score's real spread is that of
    its sums over `SCORE_LAG_S` (Newey & West 1987); their ratio is by how much evidence is overstated (White 1982).

    Args:
        fitted: with whitened residuals and their derivatives.
        indices: indices into q.
        dt: s.
    """
    J, e = fitted.jacobian, fitted.scored.e
    columns = [fitted.free.index(k) for k in indices]
    others = [k for k in range(J.shape[1]) if k not in columns]
    G = J[:, columns]
    if others:
        Q = qr(J[:, others], mode="economic")[0]
        G = G - Q @ (Q.T @ G)
    bread = G.T @ G
    if not np.all(np.diag(bread) > 1e-9 * np.maximum(np.sum(J[:, columns] ** 2, axis=0), 1e-300)):
        return 1.0
    meat = newey_west(G * e[:, None], round(SCORE_LAG_S / dt))
    # to unit length, and no direction narrower than rounding: two parameters that do the same here are one
    scale = np.sqrt(np.outer(np.diag(bread), np.diag(bread)))
    ratio = np.linalg.eigvals(np.linalg.solve(bread / scale + RIDGE * np.eye(len(bread)), meat / scale)).real
    return max(float(ratio.max()), 1.0)


class Covariance(NamedTuple):
    """Covariance of the free parameters of a fit."""

    C: Array  # (k, k) covariance
    variance_inflation: Array  # (k,) robust variance over the likelihood's, at least 1


def sandwich(fitted: Fitted, dt: float) -> Covariance:
    """Covariance of the free parameters (White 1982), nowhere narrower than the likelihood's.

    The coefficients of the noise are estimated as well, and in closed loop they are no other matter: the inputs hold the
    noise of before.

    Args:
        fitted: with whitened residuals (n,), their derivatives (n, k) and what was known beforehand.
        dt: s.
    """
    J, e = without_memory(fitted.jacobian, fitted.memory), fitted.scored.e
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0] = 1.0
    J, ties = J / scale, fitted.ties / scale
    # a direction that the data do not know is wide, not singular
    plain = np.linalg.inv(J.T @ J + ties.T @ ties + 1e-8 * np.eye(J.shape[1]))
    robust = plain @ (newey_west(J * e[:, None], round(SCORE_LAG_S / dt)) + ties.T @ ties) @ plain
    variance_inflation = np.maximum(np.diag(robust) / np.diag(plain), 1.0)
    wider = np.sqrt(variance_inflation) / scale
    return Covariance(plain * wider[:, None] * wider[None, :], variance_inflation)


def newey_west(g: Array, lags: int) -> Array:
    """Sum of the autocovariances of g (n, k) up to some lags, tapered (Newey & West 1987): (k, k)."""
    # the taper is that of the products of sums over lags + 1 samples, of which each pair shares lags + 1 − lag
    whole = np.zeros((len(g) + 2 * lags + 1, g.shape[1]))
    np.cumsum(g, axis=0, out=whole[lags + 1 : lags + 1 + len(g)])
    whole[lags + 1 + len(g) :] = whole[lags + len(g)]
    sums = whole[lags + 1 :] - whole[: -lags - 1]
    total: Array = sums.T @ sums / (lags + 1)
    return total


# ends are moved at most so often, and by no more than this factor each time
MAX_MOVES, MAX_FACTOR = 3, 3.0
# of the fall, within which an end is where it belongs
TOLERANCE = 0.25
# moves of an end inwards: it may begin far outside
MOVES_INWARDS = 6
# how often an end goes on from a lower minimum
MAX_RESTARTS = 3


def widened(
    data: Columns, solved: FittedModel[M], k: int, narrow: Interval, variance_inflation: float
) -> Interval:
    """Move both ends of an interval to where the likelihood has fallen enough; never inwards.

    Args:
        data: what was fitted.
        solved: the best fit.
        k: index of the parameter.
        narrow: the interval by the curvature.
        variance_inflation: how much faster the likelihood falls than the scores' covariance allows, at least 1.
    """
    value = float(solved.q[k])
    return Interval(
        narrow.value,
        min(
            _end(data, solved, k, value, narrow.low, float(solved.model.low[k]), variance_inflation),
            narrow.low,
        ),
        max(
            _end(data, solved, k, value, narrow.high, float(solved.model.high[k]), variance_inflation),
            narrow.high,
        ),
    )


def of_effect(
    data: Columns,
    solved: FittedModel[M],
    effect: Effect,
    wider: float = 1.0,
    starts: Callable[[Array], Sequence[Array]] = lambda q: (),
) -> dict[str, Interval]:
    """Profile likelihood intervals of one effect's parameters, 95 %: name -> interval; change points have none.

    Args:
        data: what was fitted.
        solved: the best fit.
        effect: of its model.
        wider: by how much the errors of such fits exceed what their likelihood says.
        starts: other points, for a point of the profile, from which its fit may end in a lower minimum.
    """
    robust, where = sandwich(solved.fitted, data.output.dt), place(solved.model, effect.id)
    at = {k: i for i, k in enumerate(solved.fitted.free)}
    out = {}
    for p, k in zip(effect.parameters, range(where.start, where.stop), strict=True):
        if k in at and not p.change_point:
            i, value = at[k], float(solved.q[k])
            half = wider * SIGMAS * math.sqrt(float(robust.C[i, i]))
            narrow = Interval(value, max(value - half, p.low), min(value + half, p.high))
            inflated = wider**2 * float(robust.variance_inflation[i])
            out[p.name] = profiled(data, solved, k, narrow, inflated, starts)
    return out


def profiled(
    data: Columns,
    solved: FittedModel[M],
    k: int,
    narrow: Interval,
    variance_inflation: float,
    starts: Callable[[Array], Sequence[Array]] = lambda q: (),
) -> Interval:
    """Move both ends to where the likelihood has fallen enough, inwards as well; arguments as of `widened`, `of_effect`."""
    value, model, ends = float(solved.q[k]), solved.model, []
    free = tuple(j for j in solved.fitted.free if j != k)
    for end, bound in ((narrow.low, float(model.low[k])), (narrow.high, float(model.high[k]))):
        end = _crossing(data, solved, k, solved.q, end, bound, variance_inflation)
        for _ in range(MAX_RESTARTS):
            # a profile is the lowest minimum at each value; the path that led here may have ended in another
            q = solved.q.copy()
            q[k] = end
            others = [solve(data, model, other, solved.noise, solved.rows, free=free) for other in starts(q)]
            lowest = min(others, key=lambda other: other.deviance, default=None)
            enough = (1.0 - TOLERANCE) * CHI_SQUARED_QUANTILE * variance_inflation
            if lowest is None or end == bound or lowest.deviance - solved.deviance >= enough:
                break
            end = _crossing(data, solved, k, lowest.q, end, bound, variance_inflation, abs(end - value))
        ends.append(end)
    return Interval(narrow.value, min(ends[0], value), max(ends[1], value))


def _crossing(
    data: Columns,
    solved: FittedModel[M],
    k: int,
    start: Array,
    end: float,
    bound: float,
    variance_inflation: float,
    inner: float = 0.0,
) -> float:
    """Where the likelihood has fallen enough, by bisection of the root of its fall; the outer end of what is left.

    `inner`: a distance at which it has not.
    """
    value, free = float(solved.q[k]), tuple(j for j in solved.fitted.free if j != k)
    # distance with too large a fall
    outer = math.inf
    q, far = start.copy(), abs(bound - value)
    away, sign = min(abs(end - value), far), math.copysign(1.0, bound - value)
    for _ in range(MOVES_INWARDS):
        if not 1e-9 < away < math.inf:
            return value + sign * away
        q[k] = value + sign * away
        there = solve(data, solved.model, q, solved.noise, solved.rows, free=free)
        q, fallen = there.q.copy(), max(there.deviance - solved.deviance, 0.0) / variance_inflation
        if abs(fallen / CHI_SQUARED_QUANTILE - 1.0) < TOLERANCE:
            return value + sign * min(away * math.sqrt(CHI_SQUARED_QUANTILE / fallen), far)
        if fallen < CHI_SQUARED_QUANTILE:
            inner = away
            if away == far:
                return bound
        else:
            outer = away
        step = math.sqrt(CHI_SQUARED_QUANTILE / max(fallen, 1e-3))
        away = min(away * min(max(step, 1 / MAX_FACTOR), MAX_FACTOR), far)
        if not inner < away < outer:
            away = 0.5 * (inner + outer)
    return value + sign * min(outer, far)


def _end(
    data: Columns,
    solved: FittedModel[M],
    k: int,
    value: float,
    end: float,
    bound: float,
    variance_inflation: float,
) -> float:
    free = tuple(j for j in solved.fitted.free if j != k)
    q = solved.q.copy()
    for _ in range(MAX_MOVES):
        away = end - value
        if abs(away) < 1e-9 or not np.isfinite(away):
            return end
        q[k] = end
        there = solve(data, solved.model, q, solved.noise, solved.rows, free=free)
        fallen = max(there.deviance - solved.deviance, 0.0) / variance_inflation
        if fallen >= CHI_SQUARED_QUANTILE * (1 - TOLERANCE) or end == bound:
            return end
        further = value + away * min(float(np.sqrt(CHI_SQUARED_QUANTILE / max(fallen, 1e-3))), MAX_FACTOR)
        end = max(further, bound) if away < 0 else min(further, bound)
        q = there.q.copy()
    return end


# fewer do not show how much an estimate varies
MIN_BLOCKS = 6


class Jackknife(NamedTuple):
    """An estimate with its standard error."""

    value: Array  # (k,)
    sd: Array  # (k,)
    dof: int  # blocks − 1
    without: Array  # (blocks, k), each block left out in turn


def jackknife(estimate: Callable[[Flags], Array], block: npt.NDArray[np.int64]) -> Jackknife | None:
    """Estimate, and leave each block out in turn; None: fewer than `MIN_BLOCKS` blocks.

    Blocks longer than the noise's memory make the standard error right whatever the noise's spectrum and scale.

    Args:
        estimate: rows that count (n,) -> (k,).
        block: (n,) number of the block of each row.

    Example:
        >>> x = np.random.default_rng(3).normal(size=400)
        >>> found = jackknife(lambda rows: np.array([x[rows].mean()]), np.arange(400) // 10)
        >>> round(float(found.sd[0]), 2), found.dof
        (0.05, 39)
    """
    numbers = np.unique(block)
    if numbers.size < MIN_BLOCKS:
        return None
    whole = estimate(np.ones(block.size, dtype=bool))
    without = np.array([estimate(block != k) for k in numbers])
    m = numbers.size
    sd = np.sqrt((m - 1) / m * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
    return Jackknife(whole, sd, m - 1, without)


def interval(value: float, sd: float, dof: int, chance: float = MISS) -> Interval:
    """Return the interval that misses with this chance.

    Example:
        >>> round(interval(1.0, 0.5, 1000).high, 2)
        1.98
    """
    wide = float(student.isf(chance / 2, dof)) * sd
    return Interval(value, value - wide, value + wide)
