"""How much better the extended simulation is on data that did not fit it: open loop, from the measured inputs.

The drive is cut into blocks of half a minute, dealt out to four folds. Each fold is simulated by both models as fitted
to the other three; the gain is the relative reduction of the error's variance, its interval that of a bootstrap over
stretches longer than the noise's memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.diagnosis import holds, naming, search, wander
from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.likelihood import score, whitened
from canid.diagnosis.naming import Search
from canid.diagnosis.solved import Solved, solve
from canid.effects.cause import Effect
from canid.findings import Flags
from canid.types import Array, Interval

BLOCK = 30.0  # s
FOLDS = 4
# s; longer than any remnant's memory
STRETCH = 15.0
DRAWS = 800


def simulated(found: Search, data: DriverData, extended: Solved, drift: wander.Wander | None) -> Array:
    """Simulate the extended model (n,): its wander, its ceiling and its held episodes included."""
    out = extended.fitted.model + (drift.added if drift is not None else 0.0)
    out = np.asarray(np.minimum(out, holds.ceiling(found.held)))
    for start, stop in holds.away(found.held):
        out[start:stop] = out[start]
    return out


class Fold(NamedTuple):
    """Both models, fitted to all of the drive but one fold."""

    base: Solved
    extended: Solved
    wander: wander.Wander | None


def folds(original: DriverData, found: Search) -> tuple[Fold, ...]:
    """Fit both models to all but each fold."""
    fold = dealt(original)
    out = []
    for k in range(FOLDS):
        train = fold != k
        base = _refit(original, found.before, train)
        if not found.named:
            out.append(Fold(base, base, None))
            continue
        extended = _refit(found.data, found.solved, train)
        drift = None
        if found.wander is not None:
            whole = found.data._replace(output=found.data.output._replace(y=original.output.y))
            drift = wander.look(whole, extended)
        out.append(Fold(base, extended, drift))
    return tuple(out)


def dealt(data: DriverData) -> npt.NDArray[np.int64]:
    """Fold of each sample, (n,)."""
    return (np.arange(data.seen.t.size) // round(BLOCK / data.output.dt)) % FOLDS


def errors(
    original: DriverData, found: Search, fits: tuple[Fold, ...], *, foreseen: bool = False
) -> tuple[Array, Array, Flags]:
    """Squared errors of both models on data that did not fit them, (n,) each, and where there are any.

    Args:
        original: the drive.
        found: what was found on it.
        fits: both models, fold by fold.
        foreseen: of what the samples before do not foretell, by the noise's colour: there a cause shows that acts quickly,
            and that slow noise hides in the simulation.
    """
    fold, n = dealt(original), original.seen.t.size
    before, after = np.full(n, np.nan), np.full(n, np.nan)
    y = original.output.y
    for k, one in enumerate(fits):
        out = simulated(found, found.data, one.extended, one.wander)
        here = fold == k
        left, after_left = y - one.base.fitted.model, y - out
        if foreseen:
            left, after_left = (whitened(found.before.noise, x) for x in (left, after_left))
        before[here], after[here] = left[here] ** 2, after_left[here] ** 2
    where = original.output.usable & ~original.output.below & (found.before.rows | (not foreseen))
    return before, after, where


def carried(of: Search, effect: Effect) -> float:
    """Return 2 Δ log likelihood that a cause wins on data that did not fit it, over the model without it.

    All of it is chosen anew on each three quarters: chance chooses a time, a speed, a width that fit these, and on the
    quarter that was left out they win nothing.
    """
    data = of.data
    without = naming.dropped(data, of.solved, effect.id)
    fold = dealt(data)
    won = 0.0
    for k in range(FOLDS):
        base = _refit(data, without, fold != k)
        found = search.tried(effect, data, base, search.screen(effect, data, base)).solved
        here = without.rows & (fold == k)
        lost = [score(data.output, here, base.noise, one.fitted.model).cost for one in (base, found)]
        won += lost[0] - lost[1]
    return won


def _refit(data: DriverData, solved: Solved, train: Flags) -> Solved:
    rows = solved.rows & train
    return solve(data, solved.model.effects, solved.q, solved.noise, rows, turns=1)


def gain(before: Array, after: Array, where: Flags, dt: float, seed: int = 0) -> Interval:
    """Relative reduction of the error's variance, 95 % by a bootstrap over stretches.

    Example:
        >>> e = np.random.default_rng(1).normal(size=6000) ** 2
        >>> told = gain(e, 0.5 * e, np.ones(6000, bool), 0.1)
        >>> round(told.value, 3), round(told.low, 3)
        (0.5, 0.5)
    """
    block = np.arange(before.size) // max(round(STRETCH / dt), 1)
    m = int(block[-1]) + 1 if before.size else 0
    b = np.bincount(block[where], weights=before[where], minlength=m)
    a = np.bincount(block[where], weights=after[where], minlength=m)
    keep = b > 0
    b, a = b[keep], a[keep]
    if b.size < 4:
        return Interval()
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, b.size, (DRAWS, b.size))
    ratio = 1 - a[draws].sum(axis=1) / b[draws].sum(axis=1)
    low, high = np.quantile(ratio, (0.025, 0.975))
    return Interval(float(1 - a.sum() / b.sum()), float(low), float(high))
