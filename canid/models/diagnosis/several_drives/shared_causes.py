"""Does what was found on several drives together hold on each of them, and in what do they differ?

Each drive is predicted by models that were fitted to the other drives, with and without a cause; the drive itself gives
its own offset and size of the noise only. The gain in one-step log score is what the cause is worth on a drive that had no
part in its fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from canid.models.diagnosis.driver import driver_intervals, driver_search, held_out, local_minima
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import BASE, K1, K2, TAU1, TAU2, THETA1, THETA2
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.driver.held_out import Again, C
from canid.models.diagnosis.fitting import likelihood
from canid.models.diagnosis.fitting.fitted_model import FittedModel, M, dropped, solve
from canid.models.diagnosis.fitting.likelihood import whitened
from canid.models.diagnosis.fitting.log_score_gain import gain
from canid.models.diagnosis.fitting.model import Columns
from canid.models.diagnosis.fitting.uncertainty import inflation
from canid.models.diagnosis.null import predictive_score
from canid.values.findings import DriveShare, Flags
from canid.values.text.numbers import chance
from canid.values.types import Array, Interval

# chance that drives of one driver are said to differ, over all groups of parameters
DIFFER_CHANCE = 0.01
# what may differ from drive to drive
GROUPS = {"gains": (K1, K2), "lags and dead times": (TAU1, TAU2, THETA1, THETA2)}
# samples that count; on fewer a drive has no estimate of its own
MIN_ROWS = 400


class Shared(NamedTuple):
    """What each drive says of the joint model."""

    drives: tuple[DriveShare, ...]
    differ: tuple[str, ...]  # sentences: what is not the same on all drives


def shared(
    data: DriverData, search: Search, spans: Sequence[tuple[float, float]], names: Sequence[str]
) -> Shared:
    """Judge each drive.

    Args:
        data: of all drives.
        search: on them together.
        spans: s, [begin, end) of each drive.
        names: of the drives.
    """
    t, rows = data.seen.t, search.solved.rows
    inside = [rows & (t >= begin) & (t < end) for begin, end in spans]
    without = left_out(search.data, search.solved, [effect.id for effect in search.solved.model.effects])
    again = driver_search.again
    shares, fits = [], list[FittedDriver | None]()
    for name, here in zip(names, inside, strict=True):
        gains = gains_by_the_others(search.data, search.solved, without, here, again)
        alone = _alone(search.data, search.solved, here)
        fits.append(alone)
        channels = {} if alone is None else driver_intervals.channels(alone, data.output.dt)
        shares.append(DriveShare(name, float(here.sum()) * data.output.dt, gains, channels))
    return Shared(
        tuple(shares), _differences(search, [fit for fit in fits if fit is not None], data.output.dt)
    )


def left_out(data: Columns, solved: FittedModel[M], effects: Sequence[str]) -> dict[str, FittedModel[M]]:
    """The model without each of some of its effects, by the effect's id, refitted to all drives."""
    return {effect: dropped(data, solved, effect) for effect in effects}


def gains_by_the_others(
    data: C, model: FittedModel[M], without: Mapping[str, FittedModel[M]], here: Flags, again: Again[C, M]
) -> dict[str, Interval]:
    """Gain of each cause on a drive in one-step log score, nats/min, by fits to the other drives: effect id -> gain.

    Args:
        data: of all drives.
        model: fitted to all of them.
        without: the model without each of its effects.
        here: (n,) rows of the drive.
        again: searches an effect.
    """
    others = model.rows & ~here
    if not without:
        return {}
    if not others.any() or not here.any():
        return dict.fromkeys(without, Interval())
    size = model.noise.size
    with_it, known = _predicted(data, model, here, others, size, again)
    out = {}
    for effect, left in without.items():
        predicted, also = _predicted(data, left, here, others, size, again)
        won = predictive_score.difference(predicted, with_it, here)
        out[effect] = gain(np.where(known & also, won, 0.0), here, data.output.dt)
    return out


def _predicted(
    data: C, fitted: FittedModel[M], here: Flags, others: Flags, size: Array, again: Again[C, M]
) -> tuple[predictive_score.Predicted, Flags]:
    """One-step predictions on a drive by a fit to the others, after its own offset; where that fit determines a change."""
    fit = held_out.searched(data, fitted, others, again)
    free = here & ~data.output.hidden
    level = np.where(free, whitened(fit.noise, np.ones(here.size)), 0.0)
    error = likelihood.score(data.output, free, fit.noise, fit.fitted.model).e
    offset = float(level @ error) / max(float(level @ level), 1e-12)
    output = data.output._replace(y=np.where(here, data.output.y - offset, data.output.y))
    predicted = predictive_score.predictions(output, here, fit, fitted.rows & others, size)
    return predicted, local_minima.determined(data, fit)


def _alone(data: DriverData, solved: FittedDriver, here: Flags) -> FittedDriver | None:
    """The joint model fitted to one drive; its causes are held."""
    if int(here.sum()) < MIN_ROWS:
        return None
    base = range(len(BASE))
    free = tuple(k for k in solved.model.free() if k in base)
    return solve(data, solved.model, solved.q, solved.noise, here, joint=False, free=free)


def _differences(search: Search, fits: Sequence[FittedDriver], dt: float) -> tuple[str, ...]:
    """Likelihood ratio of own parameters on each drive against common ones, group by group."""
    if len(fits) < 2:
        return ()
    out = []
    for name, group in GROUPS.items():
        won, freedom = 0.0, 0
        for alone in fits:
            here = alone.rows
            held = solve(
                search.data, alone.model, search.solved.q, alone.noise, here, joint=False,
                free=tuple(k for k in alone.fitted.free if k not in group),
            )  # fmt: skip
            spread = inflation(alone.fitted, [k for k in group if k in alone.fitted.free], dt)
            won += max(held.deviance - alone.deviance, 0.0) / spread
            freedom += len(group)
        # the common ones were fitted to the same drives
        p = float(chi2.sf(won, max(freedom - len(group), 1)))
        if p < DIFFER_CHANCE / len(GROUPS):
            out.append(f"the driver's {name} are not the same on all drives (chance {chance(p)})")
    return tuple(out)
