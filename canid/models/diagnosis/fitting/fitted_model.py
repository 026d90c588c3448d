"""Maximum likelihood of one model under autoregressive noise, by turns: the parameters given the noise, and the reverse."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from canid.models.diagnosis.fitting import likelihood
from canid.models.diagnosis.fitting.least_squares import (
    ITERATIONS,
    ROUGH_TOLERANCE,
    TOLERANCE,
    Fitted,
    Problem,
    fit,
)
from canid.models.diagnosis.fitting.likelihood import Noise
from canid.models.diagnosis.fitting.model import Along, Columns, Model
from canid.models.effects.effect import Effect
from canid.values.findings import Flags
from canid.values.types import Array

# turns of "parameters given the noise, noise given the parameters"; the third moves an evidence by less than 0.1
FIT_TURNS = 3
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
    return Problem(data.output, rows, noise, model.bind(data), moving, *box, model.ties(data))


def solve(
    data: Columns,
    model: M,
    q: Array,
    noise: Noise,
    rows: Flags,
    turns: int = FIT_TURNS,
    free: tuple[int, ...] | None = None,
    iterations: int = ITERATIONS,
    tolerance: float = TOLERANCE,
) -> FittedModel[M]:
    """Fit parameters and noise by turns; rows, order and scale of the noise are held.

    Args:
        data: what is explained.
        model: what explains it.
        q: initial guess.
        noise: noise model to begin with; its order and scale are kept.
        rows: samples that count.
        turns: how often.
        free: parameters that move; None: all of the model's.
        iterations: of the first turn, at most: few where many initial guesses are compared.
        tolerance: of the last turn.
    """
    fitted, noise = _by_turns(data, problem(data, model, noise, rows, free), q, turns, iterations, tolerance)
    noise, fitted = _rescaled(data, fitted, noise)
    return FittedModel(model, fitted, noise, rows, _deviance(fitted, noise))


def _by_turns(
    data: Columns,
    to_fit: Problem,
    q: Array,
    turns: int,
    iterations: int = ITERATIONS,
    tolerance: float = TOLERANCE,
) -> tuple[Fitted, Noise]:
    def ends(turn: int) -> float:
        return tolerance if turn == turns - 1 else ROUGH_TOLERANCE

    fitted = fit(to_fit, q, iterations, ends(0))
    for turn in range(1, turns):
        to_fit = to_fit._replace(noise=refitted(data, fitted, to_fit.noise))
        fitted = fit(to_fit, fitted.q, tolerance=ends(turn))
    return fitted, to_fit.noise


def refitted(data: Columns, fitted: Fitted, noise: Noise) -> Noise:
    """Fit the noise model again to what the model leaves, of the same order and scale."""
    left, p = data.output.y - fitted.model, noise.A.size - 1
    return likelihood.fit_noise(data.output, left, p, noise.size, noise.freedom)._replace(state=noise.state)


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
            tried = solve(data, solved.model, q, begin.noise, solved.rows, turns=1)
            if tried.deviance < best.deviance - MIN_FIT_IMPROVEMENT:
                best = tried
    if best is solved:
        return best
    return solve(data, solved.model, best.q, best.noise, solved.rows, turns=2)


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
        fitted = _by_turns(data, to_fit, q, start.turns)[0]
        if best is None or fitted.scored.cost + fitted.tied < best.scored.cost + best.tied:
            best = fitted
    assert best is not None
    noise = to_fit.noise
    for _ in range(start.rounds):
        noise, rows = _ordered(data, best)
        best = _by_turns(data, to_fit._replace(noise=noise, rows=rows), best.q, start.turns)[0]
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


def rescaled(data: Columns, solved: FittedModel[M], turns: int = FIT_TURNS) -> FittedModel[M]:
    """Fit how the noise scale follows the state anew, then the model."""
    noise = scaled_by_state(data, solved.model, solved.fitted, solved.noise, solved.rows)
    return solve(data, solved.model, solved.q, noise, solved.rows, turns)


def scaled_by_state(data: Columns, model: Model, fitted: Fitted, noise: Noise, rows: Flags) -> Noise:
    """Let the noise scale follow the state, where the model names features of it, then fit the noise model again."""
    features = model.noise_features(data, fitted.model)
    if features is None:
        return noise
    residual = data.output.y - fitted.model
    plain = likelihood.whitened(noise._replace(size=np.ones(rows.size)), residual)
    size, state = likelihood.state_scale(plain, rows & ~data.output.hidden, features)
    return likelihood.fit_noise(data.output, residual, noise.A.size - 1, size)._replace(state=state)
