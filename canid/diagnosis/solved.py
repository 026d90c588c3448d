"""One model of the driver, fitted with the noise's colour and size: maximum likelihood by turns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.diagnosis import likelihood
from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import (
    DESIRED,
    K1,
    K2,
    OFFSET,
    TAU1,
    TAU2,
    THETA1,
    THETA2,
    DriverModel,
    bound,
    with_effects,
)
from canid.diagnosis.least_squares import ITERATIONS, Fitted, fit
from canid.diagnosis.likelihood import Noise
from canid.effects.cause import Effect
from canid.findings import Flags
from canid.types import Array

# turns of "parameters given the noise, noise given the parameters"; the third moves an evidence by less than 0.1
TURNS = 3
# a driver as the literature has him: where every first fit begins (Grover 2021, table 4.2; reaction times in following)
BEGIN = {K1: 5.0, K2: 5.0, TAU1: 0.4, TAU2: 0.4, THETA1: 0.4, THETA2: 0.4}
# s, dead times from which the baseline's fit begins beside that: the cost has a valley for each
BEGIN_THETA2 = (0.2, 0.6, 1.0)
# the channel that moves more first; parts of lag and dead time together that are tried as the lag
SPLIT = ((TAU2, THETA2), (TAU1, THETA1))
PARTS = (0.1, 0.5, 0.85)
# −2 log likelihood by which another valley must be deeper
BETTER = 0.1


class Solved(NamedTuple):
    """A fitted model."""

    model: DriverModel
    fitted: Fitted
    noise: Noise
    rows: Flags
    deviance: float  # −2 log likelihood up to a constant that all models of these rows share

    @property
    def q(self) -> Array:
        """Parameters."""
        return self.fitted.q


def tied(model: DriverModel, data: DriverData) -> Array | None:
    """What is known of the delays beforehand: of a foot. An acceleration is the car's too, and a controller's."""
    return model.ties if data.pedal else None


def deviance(fitted: Fitted, noise: Noise) -> float:
    """−2 log likelihood: Σ e² + Σ log sd² over the samples with a density, and what is known beforehand."""
    return fitted.scored.cost + fitted.tied + 2.0 * fitted.scored.free * float(np.log(noise.sd))


def solve(
    data: DriverData,
    effects: Sequence[Effect],
    q: Array,
    noise: Noise,
    rows: Flags,
    turns: int = TURNS,
    free: tuple[int, ...] | None = None,
    iterations: int = ITERATIONS,
) -> Solved:
    """Fit parameters and noise by turns; rows, order and size of the noise are held.

    Args:
        data: what is explained.
        effects: causes in the model.
        q: where to begin.
        noise: colour to begin with; its order and size are kept.
        rows: samples that count.
        turns: how often.
        free: parameters that move; None: all of the model's.
        iterations: of the first turn, at most: where a glance tells which of many starts is worth a fit.
    """
    model = with_effects(effects)
    moving = model.free() if free is None else free
    function = bound(model, data)
    box = model.low, model.high, model.scale
    ties = tied(model, data)
    fitted = fit(data.output, rows, noise, function, q, moving, *box, iterations, ties)
    for _ in range(turns - 1):
        noise = recoloured(data, fitted, noise)
        fitted = fit(data.output, rows, noise, function, fitted.q, moving, *box, ties=ties)
    noise, fitted = rescaled(fitted, noise)
    return Solved(model, fitted, noise, rows, deviance(fitted, noise))


def polished(data: DriverData, solved: Solved) -> Solved:
    """Look for a better split of each channel's delay into lag and dead time: the likelihood has a valley for several.

    Not found, an evidence is the difference of two valleys instead of two models.
    """
    best = solved
    for tau, theta in SPLIT:
        total = float(best.q[tau] + best.q[theta])
        begin = best
        for part in PARTS:
            q = begin.q.copy()
            q[tau], q[theta] = part * total, (1 - part) * total
            tried = solve(data, solved.model.effects, q, begin.noise, solved.rows, turns=1)
            if tried.deviance < best.deviance - BETTER:
                best = tried
    return (
        best
        if best is solved
        else solve(data, solved.model.effects, best.q, best.noise, solved.rows, turns=2)
    )


def recoloured(data: DriverData, fitted: Fitted, noise: Noise) -> Noise:
    """Fit the colour again to what the model leaves."""
    p = noise.A.size - 1
    return likelihood.colour(data.output, data.output.y - fitted.model, p, noise.size)._replace(
        state=noise.state
    )


def rescaled(fitted: Fitted, noise: Noise) -> tuple[Noise, Fitted]:
    """Put the standard deviation at its best for the fit, hidden samples left where they are."""
    scored = fitted.scored
    free = max(scored.free, 1)
    hidden = (scored.slope != 0) & (scored.slope != -1.0)
    square = float(scored.e[~hidden] @ scored.e[~hidden]) / free
    ratio = float(np.sqrt(max(square, 1e-12)))
    e = np.where(hidden, scored.e, scored.e / ratio)
    J = np.where(hidden[:, None], fitted.jacobian, fitted.jacobian / ratio)
    return noise._replace(sd=noise.sd * ratio), fitted._replace(
        scored=scored._replace(e=e, cost=float(e @ e)), jacobian=J
    )


def baseline(data: DriverData) -> Solved | None:
    """Fit the model without any cause, choose the noise's order and how its size follows the state; None: too few."""
    output = data.output
    if int(np.count_nonzero(output.usable & ~output.below)) < 200:
        return None
    model = with_effects(())
    function = bound(model, data)
    box = model.low, model.high, model.scale
    q = np.zeros(len(model.low))
    for k, value in BEGIN.items():
        q[k] = value
    free = output.usable & ~output.below
    q[DESIRED] = float(np.median(data.seen.headway[free]))
    q[OFFSET] = float(np.median(output.y[free]))
    ones = np.ones(output.y.size)
    # first with the colour that pedals mostly have, then with what is found
    noise = Noise(
        np.array([1.0, -0.9, 0.0]), max(float(np.std(output.y[free])) * 0.4, 1e-6), ones, np.empty(0)
    )
    rows = likelihood.counted(output, 2)
    best: Fitted | None = None
    for theta in (q[THETA2], *BEGIN_THETA2):
        q[THETA2] = theta
        fitted = fit(output, rows, noise, function, q, model.free(), *box, ties=tied(model, data))
        if best is None or fitted.scored.cost + fitted.tied < best.scored.cost + best.tied:
            best = fitted
    assert best is not None
    for _ in range(2):
        residual = output.y - best.model
        p = likelihood.order(output, residual)
        rows = likelihood.counted(output, p)
        noise = likelihood.colour(output, residual, p, ones)
        best = fit(output, rows, noise, function, best.q, model.free(), *box, ties=tied(model, data))
    noise = sized(data, best, noise, rows)
    return polished(data, solve(data, (), best.q, noise, rows))


def features(data: DriverData, model: Array) -> Array:
    """What the noise's size may follow: how much is answered, and how fast the car is; (n, 3), standardised."""
    free = data.output.usable & ~data.output.below

    def standard(x: Array) -> Array:
        sd = float(np.std(x[free]))
        out: Array = np.clip((x - np.mean(x[free])) / sd, -3, 3) if sd > 1e-9 else np.zeros_like(x)
        return out

    away = model - np.median(model[free])
    return np.stack([standard(np.abs(away)), standard(away), standard(data.seen.speed)], axis=1)


def sized(data: DriverData, fitted: Fitted, noise: Noise, rows: Flags) -> Noise:
    """Let the noise's size follow the state, then fit its colour again."""
    free = rows & ~data.output.hidden
    plain = likelihood.whitened(noise._replace(size=np.ones(rows.size)), data.output.y - fitted.model)
    size, state = likelihood.state_size(plain, free, features(data, fitted.model))
    p = noise.A.size - 1
    return likelihood.colour(data.output, data.output.y - fitted.model, p, size)._replace(state=state)
