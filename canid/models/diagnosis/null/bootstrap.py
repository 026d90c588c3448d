"""Analysis of the replicates, as of the drive itself: the first step of the search, and the fits of what was named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.models.diagnosis.driver import driver_search, held_out, noise_law, random_walk
from canid.models.diagnosis.driver.driver_data import DriverData, prepare
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_search import MIN_ROWS, Search
from canid.models.diagnosis.fitting import likelihood
from canid.models.diagnosis.fitting.fitted_model import solve
from canid.models.diagnosis.fitting.least_squares import ROUGH_TOLERANCE
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.null.replicates import Replicate
from canid.models.effects.effect import Detector, Effect


def refitted(replicate: Replicate, null: FittedDriver) -> tuple[DriverData, FittedDriver] | None:
    """Fit the null's model to a replicate; None: too few samples.

    Args:
        replicate: a drive of the null.
        null: its driver.
    """
    data = prepare(replicate.trace, replicate.usable, motions=replicate.motions)
    rows = likelihood.counted(data.output, null.noise.A.size - 1)
    if int(rows.sum()) < MIN_ROWS // 2:
        return None
    # bursts come at other times
    noise = null.noise._replace(size=np.ones(rows.size)) if np.isfinite(null.noise.freedom) else null.noise
    first = solve(data, null.model, null.q, noise, rows, joint=False, tolerance=ROUGH_TOLERANCE)
    return data, noise_law.again(data, first)


def gain(data: DriverData, base: FittedDriver, named: Sequence[Named]) -> float:
    """Relative reduction of the simulation's error variance on held-out data, of all names together.

    Args:
        data: a replicate.
        base: the null's model, fitted to it.
        named: what was named on the recorded drive; those that are fitted are.
    """
    solved, walk, kept = base, None, list[Named]()
    output = data.output
    for cause in named:
        if Detector.RANDOM_WALK in cause.effect.detectors:
            walk = random_walk.detect(data, solved)
            if walk is not None:
                data = data._replace(output=data.output._replace(y=output.y - walk.added))
                solved = solve(data, solved.model, solved.q, walk.noise, solved.rows)
            kept.append(cause)
        elif testable(cause.effect):
            solved = driver_search.again(cause.effect, data, solved)
            kept.append(cause)
    original = data._replace(output=output)
    search = Search(base, data, solved, tuple(kept), (), walk)
    folds = held_out.folds(original, search, driver_search.again)
    before, after, where = held_out.errors(original, search, folds)
    total = float(np.sum(before[where]))
    return 1.0 - float(np.sum(after[where])) / total if total > 0 else 0.0


def testable(effect: Effect) -> bool:
    """Is the effect fitted to inputs that the loop feeds back? A pedal that stands still no noise makes."""
    return (
        bool(effect.parameters)
        and not any(p.fixed for p in effect.parameters)
        and not (
            set(effect.detectors) & {Detector.PEDAL_HOLDS, Detector.PEDAL_RHYTHM, Detector.SPECTRAL_LINE}
        )
    )
