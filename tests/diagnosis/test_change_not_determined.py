"""What only the samples that are held out know of a cause is worth nothing there."""

from __future__ import annotations

import numpy as np
import pytest

from canid.models.diagnosis.driver import driver_search, held_out, local_minima, random_walk
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.null import predictive_score
from canid.models.effects import CATALOGUE
from canid.values.types import Array
from tests.diagnosis.test_cross_validation import fitted
from tests.diagnosis.test_joint_fit import driven
from tests.plants import plant_one

(WALK,) = (effect for effect in CATALOGUE if effect.id == "headway_drift")
SHARE, TIME = 0.5, 200.0


def same(first: Array, other: Array) -> bool:
    return bool(np.array_equal(first, other, equal_nan=True))


@pytest.mark.slow("fits planted drives")
def test_a_change_within_what_is_held_out_is_not_determined(seed: int) -> None:
    """Its fold has a stretch without a prediction of its own, around the change."""
    of = fitted(plant_one.plant, {"share": SHARE, "time": TIME}, seed)
    t, fold = of.data.seen.t, held_out.dealt(of.data)
    folds = held_out.folds(of.data, of, driver_search.again)
    k = fold[int(np.searchsorted(t, TIME))]
    here = ~local_minima.determined(of.data, folds[k].extended)
    assert here[int(np.searchsorted(t, TIME))]
    # a block is held out, and the change may lie anywhere in it
    assert np.count_nonzero(here) * of.data.output.dt < 4 * held_out.FOLD_BLOCK_S
    before, after, _ = held_out.errors(of.data, of, folds)
    mine = here & (fold == k)
    assert same(before[mine], after[mine])
    models = [each.extended for each in folds]
    assert not held_out.determined(of.data, models)[mine].any()


@pytest.mark.slow("fits planted drives")
def test_a_random_walk_is_scored_by_what_the_other_folds_know(seed: int) -> None:
    """The size of its steps that suits the whole drive has no part in it."""
    data, base = driven(seed, share=0.0, bursts=0.0)
    walk = random_walk.detect(data, base)
    assert walk is not None
    less = data._replace(output=data.output._replace(y=data.output.y - walk.added))
    of = Search(base, less, base, (Named(WALK, 20.0, 10.0),), (), walk)
    folds = held_out.folds(data, of, driver_search.again)
    size = base.noise.size
    won = predictive_score.of_whole(data, of, folds, size)
    other = of._replace(random_walk=walk._replace(step=10.0 * walk.step))
    assert predictive_score.of_whole(data, other, folds, size) == won
