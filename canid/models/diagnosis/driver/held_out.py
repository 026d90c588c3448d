"""Gain of the extended simulation on held-out data, open loop from the measured inputs (cross-validation).

The drive is cut into blocks of half a minute, dealt out to four folds. Each fold is simulated by both models as fitted to
the other three; the gain is the relative reduction of the error's variance, its interval that of a bootstrap over
stretches longer than the noise's memory. What a search chose is chosen again on these three: a fit that begins at the
time, speed or width that suits the whole drive stays there, and gains by what it knows of the fold that is held out. Where
the three leave open whether a change has been, both models are taken for the same.

What that says of another drive behind another lead is less sure. The odds g / (1 − g) of a gain g are the power of the
effect over that of the driver's noise, and how much of the effect a drive shows depends on its lead: on how often the
relative speed is small, how hard the lead accelerates, how the gap varies. Stretches of one drive differ much less. So the
interval is one of prediction (Higgins, Thompson & Spiegelhalter 2009): the error of the estimate, and the spread of the
log odds between drives, which was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.special import expit, logit

from canid.mathematics.identification.confidence import SIGMAS
from canid.models.diagnosis.driver import driver_search, local_minima, pedal_holds, random_walk
from canid.models.diagnosis.driver.driver_search import CauseSearch, Search
from canid.models.diagnosis.driver.random_walk import RandomWalk
from canid.models.diagnosis.fitting import held_out_gain
from canid.models.diagnosis.fitting.fitted_model import D, FittedModel, M, dropped, solve, without_parameters
from canid.models.diagnosis.fitting.least_squares import ROUGH_TOLERANCE
from canid.models.diagnosis.fitting.likelihood import Scored, score, whitened
from canid.models.diagnosis.fitting.model import Columns
from canid.models.effects.effect import Effect
from canid.values.findings import Flags
from canid.values.types import Array, Interval

FOLD_BLOCK_S = 30.0
FOLDS = 4
# s; longer than any remnant's memory
BOOTSTRAP_STRETCH_S = 15.0
# fewer stretches do not show how much the gain varies
MIN_STRETCHES = 4
# of a whitened difference; below it both simulations are the same
MIN_POWER = 1e-12

C = TypeVar("C", bound=Columns)

# (effect, data, model without it) -> the model with it, its own parameters searched on that model's rows; the model
# without it, where nothing of it is there
Again = Callable[[Effect, C, FittedModel[M]], FittedModel[M]]


def simulated(search: CauseSearch[D, M], extended: FittedModel[M], drift: RandomWalk | None) -> Array:
    """Simulate the extended model (n,): its random walk, ceiling and held episodes included."""
    out = extended.fitted.model + (drift.added if drift is not None else 0.0)
    out = np.asarray(np.minimum(out, pedal_holds.ceiling(search.holds)))
    for start, stop in pedal_holds.away(search.holds):
        out[start:stop] = out[start]
    return out


class Fold(NamedTuple, Generic[M]):
    """Both models, fitted to all of the drive but one fold."""

    base: FittedModel[M]
    extended: FittedModel[M]
    random_walk: RandomWalk | None


def folds(original: D, search: CauseSearch[D, M], again: Again[D, M]) -> tuple[Fold[M], ...]:
    """Fit both models to all but each fold.

    Args:
        original: the drive, with nothing taken out of it.
        search: what was found on it.
        again: searches an effect.
    """
    bases = models(original, search.baseline, again)
    if not search.named:
        return tuple(Fold(base, base, None) for base in bases)
    out = []
    for base, extended in zip(bases, models(search.data, search.solved, again), strict=True):
        drift = None
        if search.random_walk is not None:
            # only a driver who follows a lead has one
            whole: Any = search.data.with_output(search.data.output._replace(y=original.output.y))
            fit: Any = extended
            drift = random_walk.detect(whole, fit)
        out.append(Fold(base, extended, drift))
    return tuple(out)


def determined(data: Columns, fits: Sequence[FittedModel[M]]) -> Flags:
    """Samples (n,) at which the model that was fitted to the other folds says whether a change has been.

    At all others it predicts what the model without the change does: what only the held-out samples know is worth nothing.
    """
    fold, out = dealt(data), np.zeros(data.output.y.size, dtype=bool)
    for k, fit in enumerate(fits):
        out[fold == k] = local_minima.determined(data, fit)[fold == k]
    return out


def models(data: C, solved: FittedModel[M], again: Again[C, M]) -> list[FittedModel[M]]:
    """One model, searched on all but each fold; arguments as of `searched`."""
    fold = dealt(data)
    return [searched(data, solved, fold != k, again) for k in range(FOLDS)]


def dealt(data: Columns) -> npt.NDArray[np.int64]:
    """Fold of each sample, (n,)."""
    return (np.arange(data.output.y.size) // round(FOLD_BLOCK_S / data.output.dt)) % FOLDS


def errors(original: D, search: CauseSearch[D, M], fits: tuple[Fold[M], ...]) -> tuple[Array, Array, Flags]:
    """Squared errors of both models on held-out data, (n,) each, and where there are any.

    Args:
        original: the drive.
        search: what was found on it.
        fits: both models, fold by fold.
    """
    fold, n = dealt(original), original.output.y.size
    before, after = np.full(n, np.nan), np.full(n, np.nan)
    y = original.output.y
    for k, fitted in enumerate(fits):
        out = simulated(search, fitted.extended, fitted.random_walk)
        here = fold == k
        left, after_left = y - fitted.base.fitted.model, y - out
        after_left = np.where(local_minima.determined(search.data, fitted.extended), after_left, left)
        before[here], after[here] = left[here] ** 2, after_left[here] ** 2
    return before, after, original.output.usable & ~original.output.hidden


def carried(search: Search, effect: Effect) -> float:
    """2 Δ log likelihood of a cause on held-out data, over the model without it.

    The cause is fitted anew to each three quarters, with its time, speed or width: what fits these by chance gains
    nothing on the quarter that was left out.
    """
    data = search.data
    without = dropped(data, search.solved, effect.id)
    fold = dealt(data)
    won = 0.0
    for k in range(FOLDS):
        base = searched(data, without, fold != k, driver_search.again)
        with_it = driver_search.again(effect, data, base)
        here = without.rows & (fold == k) & local_minima.determined(data, with_it)
        lost = [
            _deviance(score(data.output, here, each.noise, each.fitted.model), each.noise.sd)
            for each in (base, with_it)
        ]
        won += lost[0] - lost[1]
    return won


def _deviance(scored: Scored, sd: float) -> float:
    return scored.cost + 2.0 * scored.free * float(np.log(sd))


def searched(data: C, solved: FittedModel[M], train: Flags, again: Again[C, M]) -> FittedModel[M]:
    """Fit a model to some samples only, what a search chose included: its effects one after the other, as they were found.

    Args:
        data: what is explained.
        solved: the model, on all samples.
        train: (n,) samples that may be known.
        again: searches an effect.
    """
    effects, model, q = solved.model.effects, solved.model, solved.q
    if effects:
        model, q = without_parameters(solved, *(effect.id for effect in effects))
    # with a noise model of its own: that of the model with the effects leaves no room for them, and that of the whole drive
    # knows the samples that are held out
    fit = solve(data, model, q, solved.noise, solved.rows & train)
    for effect in effects:
        fit = again(effect, data, fit)
    return fit


def refitted(data: Columns, solved: FittedModel[M], train: Flags) -> FittedModel[M]:
    """Fit a model again, to some samples only, from where it is: for parameters that no search chose."""
    rows = solved.rows & train
    return solve(data, solved.model, solved.q, solved.noise, rows, joint=False, tolerance=ROUGH_TOLERANCE)


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


def simulation_gain(original: D, search: CauseSearch[D, M], fits: tuple[Fold[M], ...]) -> Interval:
    """Relative reduction of the simulation's error variance; its lower end is also that which one-step predictions show.

    In closed loop the driver's noise is in the inputs, and whatever counters it makes the error smaller: so does a response
    to the lead's acceleration that is not there, on every other drive. Samples at a limit have no error, so that those next
    to it are selected. The score of a likelihood with both in it has the mean 0: with d the whitened difference of both
    simulations and ε the baseline's innovations, the driver does the share b = Σ ε d / Σ d² of it, which takes
    (2b − 1) Σ d² from the power of the error.

    Args:
        original: the drive.
        search: what was found on it.
        fits: both models, fold by fold.
    """
    before, after, where = errors(original, search, fits)
    reduction = gain(before, after, where, original.output.dt)
    if search.random_walk is not None or search.holds:
        # no response to what was seen
        return reduction
    fold, rows = dealt(original), search.baseline.rows & search.solved.rows
    along, size, power = np.zeros((3, before.size))
    for k, fit in enumerate(fits):
        base, here = fit.base, (fold == k) & local_minima.determined(search.data, fit.extended)
        changed = simulated(search, fit.extended, None) - base.fitted.model
        scored = score(original.output, rows & here, base.noise, base.fitted.model)
        white = whitened(base.noise, changed) * scored.slope
        along, size, power = along - white * scored.e, size + white**2, power + (changed * here) ** 2
    block = np.arange(before.size) // max(round(BOOTSTRAP_STRETCH_S / original.output.dt), 1)
    columns = (np.where(where, before, 0.0), np.where(where, power, 0.0), along, size)

    def share(sums: Array) -> Array:
        return np.asarray((2.0 * sums[2] / np.maximum(sums[3], MIN_POWER) - 1.0) * sums[1] / sums[0])

    low = held_out_gain.bootstrapped(columns, block, MIN_STRETCHES, share).low
    return reduction._replace(low=min(reduction.low, low))


# of the log odds between drives of one driver behind other leads, standard deviation
# (python -m benchmarks.hidden_effects.another_lead)
SPREAD = 1.3
# a gain nearer to 0 or 1 than this has the odds of this
LEAST = 0.01


def predicted(gain: Interval) -> Interval:
    """Widen the interval of a gain to where the gain on another drive lies, 95 %; never narrow it.

    Args:
        gain: on held-out data of one drive, with the interval of a bootstrap; NaN stays.

    Example:
        >>> of = predicted(Interval(0.5, 0.4, 0.6))
        >>> round(of.low, 2), of.value, round(of.high, 2)
        (0.07, 0.5, 0.93)
    """
    if not np.isfinite(gain).all() or gain.value <= 0.0:
        return gain
    value, low, high = logit(np.clip(gain, LEAST, 1.0 - LEAST))
    sd = float(np.hypot((high - low) / (2 * SIGMAS), SPREAD))
    ends = expit(value - SIGMAS * sd), expit(value + SIGMAS * sd)
    return Interval(gain.value, min(gain.low, float(ends[0])), max(gain.high, float(ends[1])))
