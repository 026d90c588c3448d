"""Fitting the car: parameters and the noise's colour by turns, and what a cause explains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from canid.diagnosis import likelihood
from canid.diagnosis.evidence import sandwich, spread
from canid.diagnosis.least_squares import Fitted, fit
from canid.diagnosis.likelihood import Noise, whitened
from canid.diagnosis.vehicle_data import VehicleData
from canid.diagnosis.vehicle_model import VehicleModel, accel, with_effects
from canid.effects.cause import Effect
from canid.findings import Flags
from canid.types import Array

TURNS = 3
# s; what is left of the noise's colour after whitening has died away by then
REACH = 5.0
# a middle-class car, where every first fit begins
BEGIN = (0.04, 0.35, 0.2, 3e-4)
FEWEST = 400  # samples


class SolvedCar(NamedTuple):
    """A fitted car."""

    model: VehicleModel
    fitted: Fitted
    noise: Noise
    rows: Flags
    deviance: float  # −2 log likelihood up to a constant that all models of these rows share


def solve(
    data: VehicleData, effects: Sequence[Effect], q: Array, noise: Noise, rows: Flags, turns: int = TURNS
) -> SolvedCar:
    """Fit parameters and noise by turns; rows and order of the noise are held.

    Args:
        data: what is explained.
        effects: causes in the model.
        q: where to begin.
        noise: colour to begin with.
        rows: samples that count.
        turns: how often.
    """
    model = with_effects(effects)
    free, dt = tuple(range(len(model.low))), data.output.dt

    def function(q: Array) -> Array:
        return accel(model, data.seen, q, dt)

    for turn in range(turns):
        fitted = fit(data.output, rows, noise, function, q, free, model.low, model.high, model.scale)
        q = fitted.q
        if turn + 1 < turns:
            noise = likelihood.colour(
                data.output, data.output.y - fitted.model, noise.A.size - 1, np.ones(rows.size)
            )
    count = max(fitted.scored.free, 1)
    ratio = float(np.sqrt(max(fitted.scored.cost / count, 1e-12)))
    scored = fitted.scored._replace(e=fitted.scored.e / ratio, cost=fitted.scored.cost / ratio**2)
    fitted = fitted._replace(scored=scored, jacobian=fitted.jacobian / ratio)
    noise = noise._replace(sd=noise.sd * ratio)
    return SolvedCar(model, fitted, noise, rows, scored.cost + 2 * count * float(np.log(noise.sd)))


def baseline(data: VehicleData) -> SolvedCar | None:
    """Fit the car without any cause and choose the noise's order; None: too few samples."""
    output = data.output
    if int(np.count_nonzero(output.usable)) < FEWEST:
        return None
    ones = np.ones(output.y.size)
    noise = Noise(
        np.array([1.0, -0.9]), max(float(np.std(output.y[output.usable])) * 0.3, 1e-6), ones, ones[:0]
    )
    q = np.array(BEGIN)
    solved: SolvedCar | None = None
    for _ in range(2):
        rows = likelihood.counted(output, noise.A.size - 1)
        solved = solve(data, (), q, noise, rows, turns=2)
        residual = output.y - solved.fitted.model
        noise = likelihood.colour(output, residual, likelihood.order(output, residual), ones)
        q = solved.fitted.q
    rows = likelihood.counted(output, noise.A.size - 1)
    return solve(data, (), q, noise, rows) if int(rows.sum()) >= FEWEST else None


def inflation(solved: SolvedCar, of: Sequence[int], dt: float) -> float:
    """How much larger the score of some parameters spreads than the likelihood says: at least 1 (White 1982)."""
    J, e = solved.fitted.jacobian, solved.fitted.scored.e
    others = [k for k in range(J.shape[1]) if k not in of]
    Q = qr(J[:, others], mode="economic")[0]
    G = J[:, list(of)] - Q @ (Q.T @ J[:, list(of)])
    bread = G.T @ G
    if not np.all(np.diag(bread) > 1e-9 * np.maximum(np.sum(J[:, list(of)] ** 2, axis=0), 1e-300)):
        return 1.0
    ratio = np.linalg.eigvals(np.linalg.solve(bread, spread(G * e[:, None], round(REACH / dt)))).real
    return max(float(ratio.max()), 1.0)


def doubt(solved: SolvedCar, dt: float) -> Array:
    """Standard deviations of the parameters (k,): the sandwich, nowhere narrower than the likelihood's."""
    C = sandwich(solved.fitted, dt).C
    out: Array = np.sqrt(np.diag(C))
    return out


def direction(solved: SolvedCar, data: VehicleData, effect: Effect, p: Array) -> Array:
    """What a cause of this strength would change in the whitened residual and the model cannot take up, (n,)."""
    model = with_effects((*solved.model.effects, effect))
    q = np.concatenate([solved.fitted.q, p])
    d = whitened(solved.noise, accel(model, data.seen, q, data.output.dt) - solved.fitted.model)
    d[~solved.rows] = 0.0
    Q = qr(solved.fitted.jacobian, mode="economic")[0]
    out: Array = d - Q @ (Q.T @ d)
    return out
