"""Costs with many local minima: of a driver's delays, from a grid of them, and of the time at which something changed.

A few steps from each point of a grid of delays, with gains that suit it, show the minima. Which of them is the lowest
shows only with a noise model of its own: that of a model already fitted favours what is near it.

With all else fixed the whitened residual is, but for the seconds around a change, the one of "not yet" before it and the
one of "already" after it. Two sums along the drive are the cost of every time.

A sample lies inside a dead zone of the headway or outside of it, so that the likelihood has steps along both edges of the
zone; a grid of edges, with gains that suit each, shows the minimum that a descent misses.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE, SIGMAS
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_model import (
    BASE,
    DESIRED,
    K1,
    K2,
    NO_PARAMETERS,
    OFFSET,
    TAU1,
    TAU2,
    THETA1,
    THETA2,
    DriverModel,
    pedal,
    responses,
)
from canid.models.diagnosis.fitting.candidates import ROUNDING, Guess, model_directions
from canid.models.diagnosis.fitting.fitted_model import FittedModel, M, solve
from canid.models.diagnosis.fitting.least_squares import ROUGH_TOLERANCE
from canid.models.diagnosis.fitting.likelihood import score, whitened
from canid.models.diagnosis.fitting.model import Columns, Model, RecentValues, place
from canid.models.diagnosis.fitting.uncertainty import sandwich
from canid.models.effects.effect import Effect
from canid.values.findings import Flags
from canid.values.types import Array, Interval

# s, delays of the grid, and steps from each
GRID_THETA_S, GRID_TAU_S = (0.3, 0.7, 1.1, 1.5), (0.2, 0.8)
GRID_ITERATIONS = 6
# s of lag and dead time of the response to range rate, and share of its gain by which other gains differ, within which two
# fits are in one minimum. Their likelihoods say less: on one measured drive the lowest minimum was 15 above the others by
# the noise model without the effect, and 33 below them by its own
SAME_DELAY_S, SAME_GAIN = 0.2, 0.25
# minima that are compared
MAX_MINIMA = 3
# of the largest eigenvalue; a direction below it is rounding
RANK_TOLERANCE = 1e-12
# of a whitened column; a shorter one is 0
MIN_LENGTH = 1e-100


def minima(
    model: DriverModel, data: DriverData, without: FittedModel[DriverModel], q: Array
) -> list[FittedModel[DriverModel]]:
    """Fits of a model from the grid, those that have reached different minima.

    Args:
        model: what is fitted.
        data: the driver's columns.
        without: a model already fitted, whose noise model the first steps use.
        q: of the model; its delays and gains are replaced.
    """
    apart: list[FittedModel[DriverModel]] = []
    for minimum in rough_fits(model, data, without, q):
        if not any(same_minimum(minimum.q, other.q) for other in apart):
            apart.append(minimum)
    return [solve(data, model, minimum.q, without.noise, without.rows) for minimum in apart[:MAX_MINIMA]]


def rough_fits(
    model: DriverModel, data: DriverData, without: FittedModel[DriverModel], q: Array
) -> list[FittedModel[DriverModel]]:
    """Fits of a few steps from each point of the grid, the likeliest first; arguments as of `minima`."""
    short, recent = [], RecentValues()
    for theta, tau in product(GRID_THETA_S, GRID_TAU_S):
        guess = q.copy()
        guess[[TAU1, TAU2]], guess[[THETA1, THETA2]] = tau, theta
        guess = regained(model, data, without, guess, recent).q
        few = solve(
            data,
            model,
            guess,
            without.noise,
            without.rows,
            None,
            GRID_ITERATIONS,
            ROUGH_TOLERANCE,
            joint=False,
        )
        short.append(few)
    return sorted(short, key=lambda minimum: minimum.deviance)


def same_minimum(first: Array, other: Array) -> bool:
    """Whether two fits differ little in the delay of the response to range rate and in what is added to it.

    Args:
        first: (p,) parameters of a model.
        other: (p,) of the same model.

    Example:
        >>> q = np.zeros(11)
        >>> q[[K2, TAU2, THETA2, 10]] = 0.4, 0.2, 0.9, 0.3
        >>> p = q.copy()
        >>> p[[TAU2, THETA2]] = 0.5, 0.62
        >>> same_minimum(q, p)
        True
        >>> p[10] = 0.0
        >>> same_minimum(q, p)
        False
    """
    delay = abs(first[TAU2] + first[THETA2] - other[TAU2] - other[THETA2])
    added = np.abs(first[len(BASE) :] - other[len(BASE) :])
    return bool(delay < SAME_DELAY_S and (added <= SAME_GAIN * max(abs(first[K2]), abs(other[K2]))).all())


def regained(
    model: DriverModel,
    data: DriverData,
    without: FittedModel[DriverModel],
    q: Array,
    recent: RecentValues | None = None,
) -> Guess:
    """Fit both gains, and the offset where it is free, by linear least squares, everything else fixed."""
    answers, rows = responses(model, data, q, recent, without.noise.A), without.fitted.scored.slope == -1.0
    level = 1.0 if OFFSET in model.free() else 0.0
    ends = np.stack([np.full_like(answers.first, level), data.output.y - answers.extra])
    # where an effect adds something, that is another output for each guess
    kept = recent if recent is not None and isinstance(answers.extra, float) else RecentValues()
    outer = kept.value("white", NO_PARAMETERS, lambda: whitened(without.noise, ends.T).T * rows)
    inner = whitened(without.noise, np.stack([answers.first, answers.second]).T).T * rows
    weight = _weights(data, without)
    X, y = np.stack([outer[0], *inner]) * weight, outer[1] * weight
    before = np.divide(without.fitted.scored.e, weight, out=np.zeros(y.size), where=weight > 0.0)
    square = X @ X.T
    length = np.maximum(np.sqrt(np.diag(square)), MIN_LENGTH)
    gram = square / np.outer(length, length)
    gains = np.linalg.lstsq(gram, X @ y / length, rcond=RANK_TOLERANCE)[0] / length
    left = y - gains @ X
    q = q.copy()
    q[[OFFSET, K1, K2]] = np.clip(gains, model.low[[OFFSET, K1, K2]], model.high[[OFFSET, K1, K2]])
    return Guess(q, max(float(before @ before - left @ left), 0.0))


def _weights(data: DriverData, without: FittedModel[DriverModel]) -> Array:
    """Weight (n,) of each whitened sample that counts, as Student's t weighs it in the model that is there; else 0."""
    rows = without.fitted.scored.slope == -1.0
    out: Array = rows.astype(float)
    if np.isfinite(without.noise.freedom):
        is_ = whitened(without.noise, data.output.y - without.fitted.model)
        np.sqrt(np.divide(without.fitted.scored.e, is_, out=out, where=rows & (is_ != 0.0)), out=out)
    return out


def deepest(data: DriverData, solved: FittedModel[DriverModel]) -> FittedModel[DriverModel]:
    """Move to the deepest minimum that a profile along each number of the causes meets, everything fitted anew there.

    A cause shares its answers with gains and delays, and its likelihood may have a second minimum at another strength. An
    interval around the first one is that of no maximum of the likelihood.
    """
    spread = np.sqrt(np.diag(sandwich(solved.fitted, data.output.dt).C))
    best = solved
    for i, k in enumerate(solved.fitted.free):
        if k < solved.model.where[0].start or k in change_points(solved.model, *solved.model.effects):
            continue
        others = tuple(j for j in solved.fitted.free if j != k)
        for sigmas in (-SIGMAS, SIGMAS):
            q = solved.q.copy()
            q[k] = np.clip(q[k] + sigmas * spread[i], solved.model.low[k], solved.model.high[k])
            held = solve(data, solved.model, q, solved.noise, solved.rows, free=others)
            if held.deviance > best.deviance + CHI_SQUARED_QUANTILE:
                continue
            tried = solve(data, solved.model, held.q, held.noise, solved.rows)
            if tried.deviance < best.deviance - MIN_DEVIANCE_DROP:
                best = tried
    return best


# 2 Δ log likelihood within which the true change point lies in 95 % (Hansen 2000, eq. 11 and table 1): its likelihood
# is no parabola
CHANGE_POINT_FALL = 7.35
# s before or after a drive, at which a change has no part in it
FAR_S = 1e9
# how often the other parameters and the change point are fitted in turn
CHANGE_POINT_ALTERNATIONS = 3
# −2 log likelihood by which another time, or another dead zone, must be better
MIN_DEVIANCE_DROP = 0.5
# s by which each edge of a dead zone of the headway is moved, and how often the edges and all else are fitted in turn.
# Up to 0.16 in 9 steps, minima that are 14, 18 and 71 deeper were missed: between two steps, and with one edge far away
EDGE_STEPS_S = np.r_[np.arange(-20, -4), np.arange(-8, 9) / 2, np.arange(5, 21)] * 0.04
EDGE_ALTERNATIONS = 2


def change_points(model: Model, *among: Effect) -> list[int]:
    """Indices of the parameters that are change points, of some effects."""
    return [
        k
        for effect, where in zip(model.effects, model.where, strict=True)
        for p, k in zip(effect.parameters, range(where.start, where.stop), strict=True)
        if p.change_point and effect in among
    ]


def at_best_times(
    model: DriverModel, data: DriverData, without: FittedModel[DriverModel], guesses: list[Array], k: int
) -> list[Array]:
    """Initial guesses that differ in more than the time of a change, each at the time at which its direction explains most.

    But for the seconds around it, the direction of a change is that of one which was there all along, 0 before it.

    Args:
        model: with the change.
        data: the driver's columns.
        without: the model without it.
        guesses: at several times.
        k: the change point's index.
    """
    t, e, Q = data.seen.t, without.fitted.scored.e, model_directions(without)
    inside = (t >= min(q[k] for q in guesses)) & (t <= max(q[k] for q in guesses))
    leaves, out = Q.T @ e, []
    for guess in guesses:
        if guess[k] != guesses[0][k]:
            continue
        q = guess.copy()
        q[k] = -FAR_S
        change = pedal(model, data, q, A=without.noise.A) - without.fitted.model
        d = whitened(without.noise, change) * without.fitted.scored.slope
        # sums from each time on
        taken = _from_here(Q * d[:, None])
        size = _from_here(d * d) - np.sum(taken * taken, axis=1)
        along = _from_here(d * e) - taken @ leaves
        useful = inside & (size > ROUNDING) & (along < 0)
        q[k] = t[int(np.argmax(np.where(useful, along * along / np.maximum(size, ROUNDING), 0.0)))]
        out.append(q)
    return out


def at_best_edges(
    data: DriverData, solved: FittedModel[DriverModel], effect: Effect
) -> FittedModel[DriverModel]:
    """Move the edges T ± width of a dead zone of the headway to the deepest minimum near them, everything fitted anew."""
    edged = effect.headway is not None and effect.shows_desired_headway
    if not edged or any(each.pedal is not None for each in solved.model.effects):
        return solved
    for _ in range(EDGE_ALTERNATIONS):
        q = regained(solved.model, data, solved, _at_likeliest_edges(data, solved, effect)).q
        moved = solve(data, solved.model, q, solved.noise, solved.rows)
        if moved.deviance > solved.deviance - MIN_DEVIANCE_DROP:
            break
        solved = moved
    return solved


def _at_likeliest_edges(data: DriverData, solved: FittedModel[DriverModel], effect: Effect) -> Array:
    """Parameters (p,) with the pair of edges at which both gains and the offset, fitted anew, explain most.

    What lies beyond one edge does not depend on the other: changes of the response add, and the normal equations of every
    pair are sums of the same products of columns.
    """
    model, steps = solved.model, EDGE_STEPS_S.size
    width = np.eye(1, solved.q.size, place(model, effect.id).start)[0]

    def beyond(side: int) -> Array:
        edge, recent = (
            effect._replace(headway=lambda p, e, _: e - side * np.minimum(side * e, p[0])),
            RecentValues(),
        )
        alone = model.with_effects([edge if each.id == effect.id else each for each in model.effects])
        moved = (solved.q + side * step * width for step in EDGE_STEPS_S)
        first = np.stack([responses(alone, data, q, recent).first for q in moved])
        return np.asarray(first - first[steps // 2])

    answers = responses(model, data, solved.q, None, solved.noise.A)
    level = np.full_like(answers.first, OFFSET in model.free())
    columns = np.vstack(
        [level, answers.second, answers.first, data.output.y - answers.extra, beyond(-1), beyond(1)]
    )
    white = whitened(solved.noise, columns.T).T * _weights(data, solved)
    products = white @ white.T
    lower, upper = np.indices((steps, steps)).reshape(2, -1)
    pair, add = np.arange(lower.size), np.tile(np.eye(4, len(columns)), (lower.size, 1, 1))
    add[pair, 2, 4 + lower] = add[pair, 2, 4 + steps + upper] = 1.0
    square, scale = add @ products @ add.swapaxes(1, 2), np.diag(products)
    # a zone that holds the whole drive leaves rounding of what was added
    rounding = RANK_TOLERANCE * np.r_[scale[:2], scale[2] + scale[4:].max(), scale[3]]
    length = np.maximum(np.sqrt(np.maximum(np.diagonal(square, axis1=1, axis2=2), rounding)), MIN_LENGTH)
    square /= length[:, :, None] * length[:, None, :]
    inverse, along = np.linalg.pinv(square[:, :3, :3], RANK_TOLERANCE, True), square[:, :3, 3]
    explains = np.einsum("pi,pij,pj->p", along, inverse, along)
    q = solved.q + np.outer(0.5 * (EDGE_STEPS_S[upper] - EDGE_STEPS_S[lower]), width)
    q[:, DESIRED] += 0.5 * (EDGE_STEPS_S[upper] + EDGE_STEPS_S[lower])
    inside = ((model.low <= q) & (q <= model.high)).all(axis=1)
    best: Array = q[int(np.argmax(np.where(inside, explains, -1.0)))]
    return best


def _from_here(x: Array) -> Array:
    out: Array = np.cumsum(x[::-1], axis=0)[::-1]
    return out


def costs(data: Columns, solved: FittedModel[M], k: int) -> Array:
    """−2 log likelihood (n,) with the change point at each sample, all else fixed; up to a constant."""
    simulate = solved.model.bind(data, solved.noise)

    def squares(time: float) -> Array:
        q = solved.q.copy()
        q[k] = time
        return score(data.output, solved.rows, solved.noise, simulate(q)).loss

    before, after = squares(FAR_S), squares(-FAR_S)
    out: Array = np.cumsum(before) - before + _from_here(after)
    return out


def determined(data: Columns, solved: FittedModel[M]) -> Flags:
    """Samples (n,) at which a fit says whether a change has been.

    Between the first and the last time of the change that its own rows take for likely (95 %, Hansen 2000) it does not: as
    where it is fitted to the rest of a drive, and the change lies in what is left out.
    """
    out = np.ones(solved.rows.size, dtype=bool)
    for k in change_points(solved.model, *solved.model.effects):
        cost = costs(data, solved, k)
        likely = np.flatnonzero(cost - cost.min() <= CHANGE_POINT_FALL)
        out[likely[0] : likely[-1] + 1] = False
    return out


def refined(data: DriverData, solved: FittedModel[DriverModel]) -> FittedModel[DriverModel]:
    """Move every change point to the deepest minimum, everything else fitted anew."""
    for k in change_points(solved.model, *solved.model.effects):
        for _ in range(CHANGE_POINT_ALTERNATIONS):
            q = solved.q.copy()
            q[k] = float(data.seen.t[int(np.argmin(costs(data, solved, k)))])
            if abs(q[k] - solved.q[k]) <= data.output.dt:
                break
            tried = solve(data, solved.model, q, solved.noise, solved.rows)
            if tried.deviance > solved.deviance - MIN_DEVIANCE_DROP:
                break
            solved = tried
    return solved


def interval(
    data: DriverData, solved: FittedModel[DriverModel], k: int, variance_inflation: float
) -> Interval:
    """95 % interval of a change point: from the first to the last time that is as likely.

    Args:
        data: what was fitted.
        solved: the fit.
        k: the change point's index.
        variance_inflation: how much faster the likelihood falls than the scores' covariance allows, at least 1.
    """
    t, cost = data.seen.t, costs(data, solved, k)
    likely = np.flatnonzero(cost - cost.min() <= CHANGE_POINT_FALL * variance_inflation)
    at, dt = float(solved.q[k]), data.output.dt
    return Interval(at, min(float(t[likely[0]]) - dt, at), max(float(t[likely[-1]]) + dt, at))
