"""Maximum likelihood of one model under autoregressive noise: parameters and noise model jointly."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from canid.mathematics.identification.levenberg_marquardt import Local, minimise
from canid.models.diagnosis.fitting import likelihood
from canid.models.diagnosis.fitting.least_squares import (
    DAMPING,
    ITERATIONS,
    ROUGH_TOLERANCE,
    TOLERANCE,
    Fitted,
    Problem,
    fit,
    free_ties,
    jacobian,
    local,
    tied,
    without_memory,
)
from canid.models.diagnosis.fitting.likelihood import Noise
from canid.models.diagnosis.fitting.model import Along, Columns, Model
from canid.models.effects.effect import Effect
from canid.values.findings import Flags
from canid.values.types import Array

# parts of lag and dead time together that are tried as the lag
LAG_SHARES = (0.1, 0.5, 0.85)
# −2 log likelihood by which another local minimum must be deeper
MIN_FIT_IMPROVEMENT = 0.1

M = TypeVar("M", bound=Model)
D = TypeVar("D", bound=Along)


class FittedModel(NamedTuple, Generic[M]):
    """A fitted model."""

    model: M
    fitted: Fitted
    noise: Noise
    rows: Flags
    deviance: float  # −2 log likelihood up to a constant that all models of these rows share

    @property
    def q(self) -> Array:
        """Parameters."""
        return self.fitted.q


class Start(NamedTuple):
    """Where the fit of a baseline begins."""

    initial: Iterable[Array]  # initial guesses of q; the best fit of all is kept
    A: Array  # the noise model, A[0] = 1
    sd: float  # of the noise, output unit
    rounds: int  # how often the noise's order is chosen, before the last time
    turns: int  # of each fit until then
    min_rows: int = 0  # samples that count in the end; fewer: no fit


def problem(
    data: Columns, model: Model, noise: Noise, rows: Flags, free: tuple[int, ...] | None = None
) -> Problem:
    """Write a model's fit down as least squares."""
    moving = model.free() if free is None else free
    box = model.low, model.high, model.scale
    return Problem(data.output, rows, noise, model.bind(data, noise), moving, *box, model.ties(data))


def solve(
    data: Columns,
    model: M,
    q: Array,
    noise: Noise,
    rows: Flags,
    free: tuple[int, ...] | None = None,
    iterations: int = ITERATIONS,
    tolerance: float = TOLERANCE,
    joint: bool = True,
) -> FittedModel[M]:
    """Fit parameters and noise; rows, order and scale of the noise are held.

    Args:
        data: what is explained.
        model: what explains it.
        q: initial guess.
        noise: noise model to begin with; its order and scale are kept.
        rows: samples that count.
        free: parameters that move; None: all of the model's.
        iterations: with the noise model held, at most: few where many initial guesses are compared.
        tolerance: relative fall of the cost at which the fit has ended.
        joint: fit the coefficients of the noise model as well; False: they are held.
    """
    to_fit = problem(data, model, noise, rows, free)
    if not joint:
        fitted = fit(to_fit, q, iterations, tolerance)
        noise, fitted = _rescaled(data, fitted, noise)
        return FittedModel(model, fitted, noise, rows, _deviance(fitted, noise))
    rough = fit(to_fit, q, iterations, ROUGH_TOLERANCE)
    return _concentrated(data, model, to_fit, rough.q, tolerance)


def _concentrated(data: Columns, model: M, to_fit: Problem, q: Array, tolerance: float) -> FittedModel[M]:
    """Descend with the noise model at its best at every point (variable projection: Golub & Pereyra 1973, Kaufman 1975).

    In closed loop the inputs hold the noise of before, so that the noise model takes up a part of what a parameter does:
    turns of the one given the other come to their end late, or stop where they began.
    """

    def point(q: Array) -> FittedModel[M]:
        at = to_fit.model(q)
        noise = refitted(data, at, to_fit.noise, to_fit.rows)
        scored = likelihood.score(data.output, to_fit.rows, noise, at)
        nothing = np.empty((at.size, 0))
        fitted = Fitted(q, to_fit.free, at, scored, nothing, free_ties(to_fit), tied(to_fit, q))
        noise, fitted = _rescaled(data, fitted, noise)
        return FittedModel(model, fitted, noise, to_fit.rows, _deviance(fitted, noise))

    def derivatives(here: FittedModel[M]) -> Array:
        return jacobian(
            to_fit._replace(noise=here.noise), here.q, here.fitted.model, here.fitted.scored.slope
        )

    def near(here: FittedModel[M]) -> Local[FittedModel[M]] | None:
        J = without_memory(derivatives(here), memory(data, here))
        return local(to_fit, here.q, J, here.fitted.scored.e, point)

    first = point(np.clip(q, to_fit.low, to_fit.high))
    count = max(first.fitted.scored.free, 1)
    # positive, and near the first point of the slope of a sum of squares
    minimum = minimise(
        first,
        lambda at: count * float(np.exp((at.deviance - first.deviance) / count)),
        near,
        DAMPING._replace(tolerance=tolerance),
    ).point
    fitted = minimum.fitted._replace(jacobian=derivatives(minimum), memory=memory(data, minimum))
    return minimum._replace(fitted=fitted)


def memory(data: Columns, solved: FittedModel[M]) -> Array:
    """Derivatives of the whitened residuals by the noise model's coefficients, (n, p)."""
    noise, rows = solved.noise, solved.rows
    left = np.where(rows | data.output.usable, data.output.y - solved.fitted.model, 0.0)
    unit = -solved.fitted.scored.slope / (noise.sd * noise.size)
    out: Array = np.where(rows[:, None], likelihood.past(left, noise.A.size - 1) * unit[:, None], 0.0)
    return out


def _by_turns(data: Columns, to_fit: Problem, q: Array, turns: int) -> Fitted:
    """Fit parameters given the noise and the noise given the parameters by turns, roughly."""
    fitted = fit(to_fit, q, tolerance=ROUGH_TOLERANCE)
    for _ in range(1, turns):
        to_fit = to_fit._replace(noise=refitted(data, fitted.model, to_fit.noise))
        fitted = fit(to_fit, fitted.q, tolerance=ROUGH_TOLERANCE)
    return fitted


def refitted(data: Columns, model: Array, noise: Noise, rows: Flags | None = None) -> Noise:
    """Fit the noise model again to what a model's output (n,) leaves on some rows, of the same order and scale."""
    left, p = data.output.y - model, noise.A.size - 1
    again = likelihood.fit_noise(data.output, left, p, noise.size, noise.freedom, rows)
    return again._replace(state=noise.state)


def _rescaled(data: Columns, fitted: Fitted, noise: Noise) -> tuple[Noise, Fitted]:
    """Put the standard deviation at its best for the fit, hidden samples left where they are."""
    scored = fitted.scored
    rows, hidden = scored.slope != 0, (scored.slope != 0) & (scored.slope != -1.0)
    free = rows & ~hidden
    if np.isfinite(noise.freedom):
        white = np.where(free, likelihood.whitened(noise, data.output.y - fitted.model), scored.e)
        ratio = likelihood.scaled(white[free], noise.freedom) / noise.stretch if free.any() else 1.0
    else:
        white = scored.e
        ratio = float(np.sqrt(max(float(white[~hidden] @ white[~hidden]) / max(scored.free, 1), 1e-12)))
    white = np.where(hidden, white, white / ratio)
    again = likelihood.laid_out(white, scored.slope, rows, free, noise.freedom)
    J = np.where(hidden[:, None], fitted.jacobian, fitted.jacobian / ratio)
    return noise._replace(sd=noise.sd * ratio), fitted._replace(scored=again, jacobian=J)


def _deviance(fitted: Fitted, noise: Noise) -> float:
    """−2 log likelihood: Σ e² + Σ log sd² over the samples with a density, and what is known beforehand."""
    return fitted.scored.cost + fitted.tied + 2.0 * fitted.scored.free * float(np.log(noise.sd))


def polished(data: Columns, solved: FittedModel[M]) -> FittedModel[M]:
    """Try other splits of each delay into lag and dead time: the likelihood has a local minimum for several.

    Without it, an evidence is the difference of two local minima instead of two models.
    """
    best = solved
    for tau, theta in solved.model.delays:
        total = float(best.q[tau] + best.q[theta])
        begin = best
        for share in LAG_SHARES:
            q = begin.q.copy()
            q[tau], q[theta] = share * total, (1 - share) * total
            tried = solve(data, solved.model, q, begin.noise, solved.rows, joint=False)
            if tried.deviance < best.deviance - MIN_FIT_IMPROVEMENT:
                best = tried
    if best is solved:
        return best
    return solve(data, solved.model, best.q, best.noise, solved.rows)


def extended(model: M, effect: Effect) -> M:
    """Return the model with one more effect."""
    return model.with_effects((*model.effects, effect))


def dropped(data: Columns, solved: FittedModel[M], *gone: str) -> FittedModel[M]:
    """Refit the model without some of its effects, by their ids."""
    model, q = without_parameters(solved, *gone)
    return polished(data, solve(data, model, q, solved.noise, solved.rows))


def without_parameters(solved: FittedModel[M], *gone: str) -> tuple[M, Array]:
    """Return the model without some of its effects, and the parameters that are left."""
    pairs = zip(solved.model.effects, solved.model.where, strict=True)
    kept = [(effect, where) for effect, where in pairs if effect.id not in gone]
    first = solved.model.where[0].start
    q: Array = np.concatenate([solved.q[:first], *(solved.q[where] for _, where in kept)])
    return solved.model.with_effects([effect for effect, _ in kept]), q


def baseline(data: Columns, model: M, start: Start) -> FittedModel[M] | None:
    """Fit a model without effects, choose the noise's order and how its scale follows the state; None: too few rows."""
    output, ones = data.output, np.ones(data.output.y.size)
    rows = likelihood.counted(output, start.A.size - 1)
    to_fit = problem(data, model, Noise(start.A, start.sd, ones, np.empty(0)), rows)
    best: Fitted | None = None
    for q in start.initial:
        fitted = _by_turns(data, to_fit, q, start.turns)
        if best is None or fitted.scored.cost + fitted.tied < best.scored.cost + best.tied:
            best = fitted
    assert best is not None
    noise = to_fit.noise
    for _ in range(start.rounds):
        noise, rows = _ordered(data, best)
        best = _by_turns(data, to_fit._replace(noise=noise, rows=rows), best.q, start.turns)
    if model.noise_features(data, best.model) is None:
        noise, rows = _ordered(data, best)
    else:
        noise = scaled_by_state(data, model, best, noise, rows)
    if int(rows.sum()) < start.min_rows:
        return None
    return polished(data, solve(data, model, best.q, noise, rows))


def _ordered(data: Columns, fitted: Fitted) -> tuple[Noise, Flags]:
    """Choose the noise's order for what a fit leaves; and the samples that count with it."""
    residual = data.output.y - fitted.model
    p = likelihood.order(data.output, residual)
    noise = likelihood.fit_noise(data.output, residual, p, np.ones(residual.size))
    return noise, likelihood.counted(data.output, p)


def rescaled(data: Columns, solved: FittedModel[M]) -> FittedModel[M]:
    """Fit how the noise scale follows the state anew, then the model."""
    noise = scaled_by_state(data, solved.model, solved.fitted, solved.noise, solved.rows)
    return solve(data, solved.model, solved.q, noise, solved.rows)


def scaled_by_state(data: Columns, model: Model, fitted: Fitted, noise: Noise, rows: Flags) -> Noise:
    """Let the noise scale follow the state, where the model names features of it, then fit the noise model again."""
    features = model.noise_features(data, fitted.model)
    if features is None:
        return noise
    residual = data.output.y - fitted.model
    plain = likelihood.whitened(noise._replace(size=np.ones(rows.size)), residual)
    size, state = likelihood.state_scale(plain, rows & ~data.output.hidden, features)
    return likelihood.fit_noise(data.output, residual, noise.A.size - 1, size)._replace(state=state)
