"""Gain of the extended simulation on held-out data, open loop from the measured inputs (cross-validation).

The drive is cut into blocks of half a minute, dealt out to four folds. Each fold is simulated by both models as fitted
to the other three; the gain is the relative reduction of the error's variance, its interval that of a bootstrap over
stretches longer than the noise's memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.diagnosis.driver import driver_candidates, pedal_holds, random_walk
from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_search import Search
from canid.diagnosis.driver.random_walk import RandomWalk
from canid.diagnosis.fitting import held_out_gain
from canid.diagnosis.fitting.fitted_model import FittedModel, M, dropped, solve
from canid.diagnosis.fitting.least_squares import ROUGH_TOLERANCE
from canid.diagnosis.fitting.likelihood import Scored, score, whitened
from canid.diagnosis.fitting.model import Columns
from canid.effects.effect import Effect
from canid.findings import Flags
from canid.types import Array, Interval

FOLD_BLOCK_S = 30.0
FOLDS = 4
# s; longer than any remnant's memory
BOOTSTRAP_STRETCH_S = 15.0
# fewer stretches do not show how much the gain varies
MIN_STRETCHES = 4


def simulated(found: Search, data: DriverData, extended: FittedDriver, drift: RandomWalk | None) -> Array:
    """Simulate the extended model (n,): its random walk, ceiling and held episodes included."""
    out = extended.fitted.model + (drift.added if drift is not None else 0.0)
    out = np.asarray(np.minimum(out, pedal_holds.ceiling(found.holds)))
    for start, stop in pedal_holds.away(found.holds):
        out[start:stop] = out[start]
    return out


class Fold(NamedTuple):
    """Both models, fitted to all of the drive but one fold."""

    base: FittedDriver
    extended: FittedDriver
    random_walk: RandomWalk | None


def folds(original: DriverData, found: Search) -> tuple[Fold, ...]:
    """Fit both models to all but each fold."""
    fold = dealt(original)
    out = []
    for k in range(FOLDS):
        train = fold != k
        base = refitted(original, found.baseline, train)
        if not found.named:
            out.append(Fold(base, base, None))
            continue
        extended = refitted(found.data, found.solved, train)
        drift = None
        if found.random_walk is not None:
            whole = found.data._replace(output=found.data.output._replace(y=original.output.y))
            drift = random_walk.detect(whole, extended)
        out.append(Fold(base, extended, drift))
    return tuple(out)


def dealt(data: Columns) -> npt.NDArray[np.int64]:
    """Fold of each sample, (n,)."""
    return (np.arange(data.output.y.size) // round(FOLD_BLOCK_S / data.output.dt)) % FOLDS


def errors(
    original: DriverData, found: Search, fits: tuple[Fold, ...], *, predicted_errors: bool = False
) -> tuple[Array, Array, Flags]:
    """Squared errors of both models on held-out data, (n,) each, and where there are any.

    Args:
        original: the drive.
        found: what was found on it.
        fits: both models, fold by fold.
        predicted_errors: of one-step predictions by the baseline's noise model instead of the simulation. They show a cause
            that acts quickly, which slow noise hides in the simulation.
    """
    fold, n = dealt(original), original.seen.t.size
    before, after = np.full(n, np.nan), np.full(n, np.nan)
    y = original.output.y
    for k, one in enumerate(fits):
        out = simulated(found, found.data, one.extended, one.random_walk)
        here = fold == k
        left, after_left = y - one.base.fitted.model, y - out
        if predicted_errors:
            left, after_left = (whitened(found.baseline.noise, x) for x in (left, after_left))
        before[here], after[here] = left[here] ** 2, after_left[here] ** 2
    where = original.output.usable & ~original.output.below & (found.baseline.rows | (not predicted_errors))
    return before, after, where


def carried(of: Search, effect: Effect) -> float:
    """2 Δ log likelihood of a cause on held-out data, over the model without it.

    The cause is fitted anew to each three quarters, with its time, speed or width: what fits these by chance gains
    nothing on the quarter that was left out.
    """
    data = of.data
    without = dropped(data, of.solved, effect.id)
    fold = dealt(data)
    won = 0.0
    for k in range(FOLDS):
        rows = without.rows & (fold != k)
        # each with a noise model of its own: that of the model without the cause takes up a part of it
        base = solve(data, without.model, without.q, without.noise, rows, turns=2)
        found = driver_candidates.tried(
            effect, data, base, driver_candidates.screen(effect, data, base)
        ).solved
        here = without.rows & (fold == k)
        lost = [
            _deviance(score(data.output, here, one.noise, one.fitted.model), one.noise.sd)
            for one in (base, found)
        ]
        won += lost[0] - lost[1]
    return won


def _deviance(scored: Scored, sd: float) -> float:
    return scored.cost + 2.0 * scored.free * float(np.log(sd))


def refitted(data: Columns, solved: FittedModel[M], train: Flags) -> FittedModel[M]:
    """Fit a model again, to some samples only."""
    rows = solved.rows & train
    return solve(data, solved.model, solved.q, solved.noise, rows, turns=1, tolerance=ROUGH_TOLERANCE)


def gain(before: Array, after: Array, where: Flags, dt: float) -> Interval:
    """Relative reduction of the error's variance, its interval by a bootstrap over stretches.

    Args:
        before: (n,) squared errors.
        after: (n,) squared errors.
        where: (n,) samples that count.
        dt: s.
    """
    block = np.arange(before.size) // max(round(BOOTSTRAP_STRETCH_S / dt), 1)
    return held_out_gain.gain(before[where], after[where], block[where], MIN_STRETCHES)
