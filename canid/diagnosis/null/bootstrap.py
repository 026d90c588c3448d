"""Analysis of the replicates, as of the drive itself: only the fits of what is about to be said, not the whole search."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.diagnosis.driver import driver_candidates, held_out, random_walk
from canid.diagnosis.driver.driver_data import DriverData, prepare
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_search import MIN_ROWS, Search
from canid.diagnosis.fitting import likelihood
from canid.diagnosis.fitting.fitted_model import scaled_by_state, solve
from canid.diagnosis.fitting.least_squares import ROUGH_TOLERANCE
from canid.diagnosis.fitting.search import Named
from canid.diagnosis.null.names import Statistics
from canid.diagnosis.null.replicates import Replicate
from canid.effects.effect import Detector, Effect


def refitted(replicate: Replicate, null: FittedDriver) -> tuple[DriverData, FittedDriver] | None:
    """Fit the null's model to a replicate; None: too few samples.

    Args:
        replicate: a drive of the null.
        null: its driver.
    """
    data = prepare(replicate.trace, replicate.usable, jerks=replicate.jerks)
    rows = likelihood.counted(data.output, null.noise.A.size - 1)
    if int(rows.sum()) < MIN_ROWS // 2:
        return None
    first = solve(data, null.model, null.q, null.noise, rows, turns=1, tolerance=ROUGH_TOLERANCE)
    noise = scaled_by_state(data, null.model, first.fitted, null.noise, rows)
    return data, solve(data, null.model, first.q, noise, rows, turns=2)


def statistics(replicate: Replicate, null: FittedDriver, named: Sequence[Named]) -> Statistics | None:
    """Fit null and named effects to a replicate; None: it cannot be fitted.

    Args:
        replicate: a drive of the null.
        null: its driver.
        named: what was named on the recorded drive; those that are fitted are.
    """
    made = refitted(replicate, null)
    if made is None:
        return None
    data, base = made
    evidence: dict[str, float] = {}
    solved, walk, kept = base, None, list[Named]()
    output = data.output
    for one in named:
        if Detector.RANDOM_WALK in one.effect.detectors:
            walk = random_walk.detect(data, solved)
            evidence[one.effect.id] = 0.0 if walk is None else walk.evidence
            if walk is not None:
                data = data._replace(output=data.output._replace(y=output.y - walk.added))
                solved = solve(data, solved.model, solved.q, walk.noise, solved.rows)
            kept.append(one)
        elif testable(one.effect):
            found = driver_candidates.tried(
                one.effect, data, solved, driver_candidates.screen(one.effect, data, solved)
            )
            evidence[one.effect.id], solved = found.evidence, found.solved
            kept.append(one)
    original = data._replace(output=output)
    search = Search(base, data, solved, tuple(kept), (), walk)
    folds = held_out.folds(original, search)
    before, after, where = held_out.errors(original, search, folds)
    total = float(np.sum(before[where]))
    return Statistics(evidence, 1.0 - float(np.sum(after[where])) / total if total > 0 else 0.0)


def testable(effect: Effect) -> bool:
    """Is the effect fitted to inputs that the loop feeds back? A pedal that stands still no noise makes."""
    return (
        bool(effect.parameters)
        and not any(p.fixed for p in effect.parameters)
        and not (
            set(effect.detectors) & {Detector.PEDAL_HOLDS, Detector.PEDAL_RHYTHM, Detector.SPECTRAL_LINE}
        )
    )
