"""One-step predictive log score of a driver's effects on held-out data (Dawid 1984; Gneiting & Raftery 2007).

The density of the next sample given all before it does not profit from the driver's own noise that the loop carries back
into the inputs, as an open-loop simulation does. Both models are those of `held_out`: fitted to the other folds.

The baseline is the model without the effect. Where the effect is not there, the larger model predicts worse, by the error
of its extra parameters, and where it is there, the plain difference of two scores spreads twice as widely as it need:
Clark & West (2007) take half the slope of the baseline's score along the change of the prediction. It has the expectation
of the gain with the effect's parameters known, 0 without the effect, and to first order no spread from what both models
leave. Where the plain difference is not positive, it stands: such an extension predicts nothing better.

A random walk is scored as it would be filtered, knot by knot; a pedal that stands still by the chance that it stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import movement_rhythm
from canid.models.diagnosis.driver import driver_fit, driver_search, held_out, pedal_holds
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import DriverModel
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.driver.held_out import Fold
from canid.models.diagnosis.driver.random_walk import scores_of_walk
from canid.models.diagnosis.fitting.fitted_model import D, FittedModel, M, dropped
from canid.models.diagnosis.fitting.likelihood import Output, fit_noise, score, whitened
from canid.models.diagnosis.fitting.log_score_gain import gain
from canid.models.diagnosis.remnant import law_search
from canid.models.effects.effect import Detector
from canid.values.findings import Flags
from canid.values.types import Array, Interval

Counts = npt.NDArray[np.int64]

# samples that the pedal has stood, upper edges of bins that double: what a pedal does that rests by chance
RESTS = (1, 2, 4, 8, 16)
# of a rhythm's interval, width of the bins in which the chance of a movement is counted, and how many
RHYTHM_BIN_SHARE, RHYTHM_BINS = 0.125, 12
# samples that count at each end of a chance beforehand
PRIOR_COUNT = 1.0


class Predicted(NamedTuple):
    """One-step predictions of one model."""

    log: Array  # (n,) log density; of a sample at the floor log probability
    slope: Array  # (n,) its derivative by the prediction, per output unit
    left: Array  # (n,) output less prediction


def predictions(output: Output, rows: Flags, fit: FittedModel[M], train: Flags, size: Array) -> Predicted:
    """Predict each sample from those before it. Scores are 0 where no row is.

    Innovations are Student's t: a Gaussian score of people is that of a few outliers. The noise is fitted to other rows,
    with the same relative scale for all models that are compared.

    Args:
        output: what is predicted.
        rows: (n,) samples that count.
        fit: the model.
        train: (n,) samples that its noise is fitted to.
        size: (n,) relative scale of the noise.
    """
    rest = output.y - fit.fitted.model
    known_ = output._replace(usable=output.usable & train)
    noise = fit_noise(known_, rest, fit.noise.A.size - 1, size, fit.noise.freedom)
    noise = noise._replace(freedom=math.inf)
    scored = score(output, rows | train, noise, fit.fitted.model)
    known, unit = ~output.hidden, noise.sd * noise.size
    law = law_search.fit(scored.e[train & known], np.zeros((0, int((train & known).sum()))), heavy=True).law
    free = rows & known
    log = np.where(rows, -0.5 * scored.e * scored.e, 0.0)
    log[free] = law_search.log_density(law, scored.e[free], np.zeros((0, int(free.sum())))) - np.log(
        unit[free]
    )
    slope = np.where(rows, -scored.e * scored.slope, 0.0) / unit
    slope[free] = law_search.slope(law, scored.e[free]) / unit[free]
    left = whitened(noise, output.limited - fit.fitted.model) * unit
    return Predicted(log, slope, left)


def difference(without: Predicted, extended: Predicted, rows: Flags) -> Array:
    """Gain (n,) of each prediction, nats (Clark & West 2007); the plain difference where that is not positive in sum."""
    plain = extended.log - without.log
    if float(plain[rows].sum()) <= 0:
        return plain
    out: Array = 0.5 * without.slope * (without.left - extended.left)
    return out


def of_whole(
    original: DriverData, search: Search, fits: Sequence[Fold[DriverModel]], size: Array
) -> Interval:
    """Gain of all effects together over the baseline, nats/min.

    Args:
        original: the drive, with nothing taken out of it.
        search: what was found on it.
        fits: both models, fold by fold.
        size: (n,) relative scale of the noise, by the law of the baseline's innovations: the same for both.
    """
    rows = search.baseline.rows & search.solved.rows
    if search.random_walk is None:
        base, models = by_fold(original, [fold.base for fold in fits], rows, size), [f.extended for f in fits]
        won = difference(base, by_fold(search.data, models, rows, size), rows)
        won = np.where(held_out.determined(search.data, models), won, 0.0)
    else:
        won = _walk(original, search, fits, rows)
    return gain(*_with_holds(original, search, won), original.output.dt)


def of_each(
    original: DriverData, search: Search, fits: Sequence[Fold[DriverModel]], size: Array, whole: Interval
) -> dict[str, Interval]:
    """Gain of each effect over the model without it, nats/min: effect id -> gain.

    Args:
        original: the drive, with nothing taken out of it.
        search: what was found on it.
        fits: both models, fold by fold.
        size: as in `of_whole`.
        whole: of all together.
    """
    if len(search.named) == 1:
        return {search.named[0].effect.id: whole}
    out = {}
    fitted = {effect.id for effect in search.solved.model.effects}
    dt = original.output.dt
    rows = search.solved.rows
    models = [fold.extended for fold in fits]
    with_all, known = by_fold(search.data, models, rows, size), held_out.determined(search.data, models)
    zero = np.zeros(rows.size)
    for cause in search.named:
        if cause.effect.id in fitted:
            left = dropped(search.data, search.solved, cause.effect.id)
            models = held_out.models(search.data, left, driver_search.again)
            won = difference(by_fold(search.data, models, rows, size), with_all, rows)
            both = known & held_out.determined(search.data, models)
            out[cause.effect.id] = gain(np.where(both, won, 0.0), rows, dt)
        elif search.random_walk is not None and Detector.RANDOM_WALK in cause.effect.detectors:
            out[cause.effect.id] = gain(_walk(original, search, fits, rows), rows, dt)
        else:
            # what else is held is known to both
            alone = search._replace(
                holds=tuple(h for h in search.holds if h.pattern in cause.effect.detectors)
            )
            out[cause.effect.id] = gain(*_with_holds(original, alone, zero, only=True), dt)
    return out


def of_answers(data: DriverData, fitted: FittedDriver) -> Interval:
    """Gain of the answers to the lead over a driver who answers nothing, nats/min.

    Args:
        data: the driver's columns.
        fitted: the baseline.
    """
    rows, size = fitted.rows, fitted.noise.size

    def silent(data: DriverData, model: FittedDriver, train: Flags) -> FittedDriver:
        return driver_fit.silent(data, model, model.rows & train)

    same = [fitted] * held_out.FOLDS
    won = difference(by_fold(data, same, rows, size, silent), by_fold(data, same, rows, size), rows)
    return gain(won, rows, data.output.dt)


def by_fold(
    data: D,
    fits: Sequence[FittedModel[M]],
    rows: Flags,
    size: Array,
    refit: Callable[[D, FittedModel[M], Flags], FittedModel[M]] = held_out.refitted,
) -> Predicted:
    """Predictions of each fold by the model as fitted to the others, with noise of that scale.

    Args:
        data: what is predicted.
        fits: the model, searched on all but each fold.
        rows: (n,) samples that count.
        size: (n,) relative scale of the noise.
        refit: fits it again with that scale.
    """
    fold, out = held_out.dealt(data), Predicted(*np.zeros((3, rows.size)))
    for k, solved in enumerate(fits):
        here, train = rows & (fold == k), fold != k
        output = data.output._replace(usable=data.output.usable & train)
        noise = fit_noise(
            output, data.output.y - solved.fitted.model, solved.noise.A.size - 1, size, solved.noise.freedom
        )
        fit = refit(data, solved._replace(noise=noise), train)
        for whole, part in zip(out, predictions(data.output, here, fit, rows & train, size), strict=True):
            whole[here] = part[here]
    return out


def _walk(original: DriverData, search: Search, fits: Sequence[Fold[DriverModel]], rows: Flags) -> Array:
    """What a filtered random walk adds to each log score, (n,); its size and the noise are those of the other folds."""
    whole = search.data._replace(output=search.data.output._replace(y=original.output.y))
    fold, out = held_out.dealt(original), np.zeros(rows.size)
    for k, fit in enumerate(fits):
        if fit.random_walk is not None:
            here = fold == k
            out[here] = scores_of_walk(whole, fit.extended, fit.random_walk, rows)[here]
    return out


def _with_holds(original: DriverData, search: Search, won: Array, only: bool = False) -> tuple[Array, Flags]:
    """Add what the standstills of the pedal are worth, and the rows in them.

    A standing pedal is predicted by the chance that it stays, as long as it has stood by then, or at the top, counted on the
    other folds; compared with chances that do not know of holds: of a rest among movements, of a movement after a rest.
    """
    none = np.zeros(won.size, dtype=bool)
    rows = none if only else search.baseline.rows & search.solved.rows & ~search.data.output.above
    if not search.holds:
        return won, rows
    y, free = original.output.y, original.output.usable & ~original.output.hidden
    step = movement_rhythm.step_size(y[original.output.usable])
    still = np.abs(np.diff(y, prepend=np.nan)) < 0.5 * step
    stood = run_length(still)
    level, patterns = pedal_holds.ceiling(search.holds), {holds.pattern for holds in search.holds}
    # at the top a ceiling keeps the pedal
    top = np.r_[False, y[:-1] >= level - pedal_holds.TOP_STEPS * step].astype(np.int64)
    plain: Counts = (stood > 0).astype(np.int64)
    fine: Counts = 2 * plain + top
    if Detector.PEDAL_RHYTHM in patterns:
        interval = next(holds.level for holds in search.holds if holds.pattern is Detector.PEDAL_RHYTHM)
        since = _since_movement(still) * original.output.dt / interval
        fine = 2 * np.minimum((since / RHYTHM_BIN_SHARE).astype(np.int64), RHYTHM_BINS) + plain
        plain = np.digitize(stood, RESTS)
    elif Detector.PEDAL_HOLDS in patterns:
        fine = 2 * np.digitize(stood, RESTS) + top
    out, counted = won.copy(), free & np.r_[False, free[:-1]]
    out[~rows] = 0.0
    return out + of_standstills(still, plain, fine, counted, held_out.dealt(original)), rows | counted


def of_standstills(still: Flags, plain: Counts, fine: Counts, counted: Flags, fold: Counts) -> Array:
    """Gain in log score (n,) of chances to stand still that are counted by `fine` cells, over those by `plain` ones.

    Args:
        still: (n,) the output repeats itself.
        plain: (n,) number of the cell of each sample.
        fine: (n,) the same of the other chances.
        counted: (n,) samples that are scored.
        fold: (n,) each is predicted by what was counted on the others.
    """
    out = np.zeros(still.size)
    for k in range(held_out.FOLDS):
        here, train = counted & (fold == k), counted & (fold != k)
        chances = [_stays(cell, still, train)[cell] for cell in (plain, fine)]
        log = [np.where(still, np.log(chance), np.log1p(-chance)) for chance in chances]
        out[here] += (log[1] - log[0])[here]
    return out


def run_length(still: Flags) -> Counts:
    """Samples that the pedal had stood still before each sample.

    Example:
        >>> run_length(np.array([False, True, True, False, True])).tolist()
        [0, 0, 1, 2, 0]
    """
    index = np.arange(still.size)
    last = np.maximum.accumulate(np.where(still, -1, index))
    after = np.where(last >= 0, index - last, index + 1)
    out: Counts = np.r_[0, after[:-1]]
    return out


def _since_movement(still: Flags) -> Counts:
    """Samples since the pedal last began to move, before each sample."""
    index = np.arange(still.size)
    begins = ~still & np.r_[True, still[:-1]]
    last = np.maximum.accumulate(np.where(begins, index, 0))
    out: Counts = np.r_[0, (index - last)[:-1]]
    return out


def _stays(cell: Counts, still: Flags, train: Flags) -> Array:
    """Chance that the pedal stands at a sample, by cell."""
    size = int(cell.max()) + 1
    stands = np.bincount(cell[train & still], minlength=size) + PRIOR_COUNT
    moves = np.bincount(cell[train & ~still], minlength=size) + PRIOR_COUNT
    return np.asarray(stands / (stands + moves))
