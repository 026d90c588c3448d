"""The naive way: output error, white noise; each candidate fitted, the best by BIC kept; again, until none is worth it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.hidden_effects.peers.library import Fitted, library
from canid.models.diagnosis.driver import driver_candidates
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import with_effects
from canid.models.diagnosis.fitting.fitted_model import FittedModel, extended, problem, solve
from canid.models.diagnosis.fitting.least_squares import fit
from canid.models.diagnosis.fitting.likelihood import Noise
from canid.models.effects.effect import Effect, Kind
from canid.values.findings import Flags
from tests.plants.planted_drive import Array

# candidates that a step fits in full: those whose columns promise most
FITTED = 3


class Settings(NamedTuple):
    """What its user has to choose."""

    difference: float  # of BIC that a cause must bring
    most: int  # causes


def white(n: int) -> Noise:
    """White noise of constant variance."""
    return Noise(np.array([1.0]), 1.0, np.ones(n), np.empty(0))


def select(at: Fitted, catalogue: Sequence[Effect], most: int) -> list[tuple[str, float]]:
    """Select forwards; returns each step's cause and its difference of BIC, until one brings less than nothing.

    What is no function of its parameters (episodes, a rhythm, a random walk of the desired headway) enters by its columns.
    """
    data, solved, rows = at
    n = len(data.output.y)
    model = with_effects(())
    begin = fit(problem(data, model, white(n), rows)._replace(ties=None), solved.q)
    own: FittedDriver = FittedModel(model, begin, white(n), rows, 0.0)
    m = int(rows.sum())
    added = np.zeros(n)  # by columns
    steps: list[tuple[str, float]] = []
    for _ in range(most):
        left = data._replace(output=data.output._replace(y=data.output.y - added))
        here = _squares(own, left.output.y)
        have = {name for name, _ in steps}
        options: list[tuple[float, str, FittedDriver | Array]] = []
        lib = library(Fitted(left, own, rows), [e for e in catalogue if e.id not in have])
        curves = {e.id: e for e in catalogue if e.kind is Kind.PARAMETRIC}
        promised = sorted(
            {name for name in lib.names if name in curves},
            key=lambda name: -abs(float(lib.X[:, lib.names.index(name)] @ lib.y)),
        )
        for name in promised[:FITTED]:
            best = driver_candidates.screen(curves[name], left, own)[0]
            tried = solve(left, extended(own.model, curves[name]), best.q, white(n), rows, joint=False)
            # `solve` puts the noise at its size; a next step begins again with 1
            tried = _plain(tried, left.output.y, rows)
            k = len(tried.fitted.free) - len(own.fitted.free)
            options.append((_bic(here, _squares(tried, left.output.y), m, k), name, tried))
        for name in sorted({name for name in lib.names if name not in curves}):
            X = lib.X[:, [c for c, other in enumerate(lib.names) if other == name]]
            coefficients = np.linalg.lstsq(X, lib.y, rcond=None)[0]
            scale = float(np.sqrt(here / m))
            gone = float(np.sum((lib.y - X @ coefficients) ** 2)) / float(lib.y @ lib.y)
            column = np.zeros(n)
            column[rows] = X @ coefficients * scale
            options.append((_bic(here, here * gone, m, X.shape[1] + 1), name, column))
        if not options:
            break
        won, name, what = max(options, key=lambda option: option[0])
        if won <= 0.0:
            break
        steps.append((name, won))
        if isinstance(what, FittedModel):
            own = what
        else:
            added = added + what
    return steps


def _plain(solved: FittedDriver, y: Array, rows: Flags) -> FittedDriver:
    """A fit with noise of sd 1 again."""
    scored = solved.fitted.scored
    e = np.where(rows, y - solved.fitted.model, 0.0)
    J = solved.fitted.jacobian * solved.noise.sd
    again = solved.fitted._replace(scored=scored._replace(e=e, cost=float(e @ e)), jacobian=J)
    return solved._replace(fitted=again, noise=white(len(y)))


def _squares(solved: FittedDriver, y: Array) -> float:
    return float(np.sum((y - solved.fitted.model)[solved.rows] ** 2))


def _bic(before: float, after: float, n: int, parameters: int) -> float:
    """How much lower BIC is afterwards.

    Example:
        >>> round(_bic(100.0, 50.0, 100, 1), 1)
        64.7
    """
    return n * float(np.log(before / max(after, 1e-12))) - parameters * float(np.log(n))
