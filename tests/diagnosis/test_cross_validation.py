"""A cause chosen by chance gains nothing on held-out data; a true cause gains nearly all of its evidence there."""

from __future__ import annotations

import numpy as np
import pytest

from canid.models.diagnosis.driver import driver_candidates, driver_search, held_out
from canid.models.diagnosis.driver.driver_data import prepare
from canid.models.diagnosis.driver.driver_fit import baseline
from canid.models.diagnosis.driver.driver_model import DriverModel
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.driver.held_out import Fold
from canid.models.diagnosis.fitting.fitted_model import solve
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.null import confirmed_search, predictive_score
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Effect
from canid.values.types import Interval, Trace
from tests.plants import plant_one, plant_two
from tests.plants.loop_noise import follower
from tests.plants.measurement import trace
from tests.seeds import mostly

(GAIN_CHANGE,) = (effect for effect in CATALOGUE if effect.id == "gain_change")
(ASYMMETRY,) = (effect for effect in CATALOGUE if effect.id == "asymmetric_gain")
# m/s² and s: noise that the loop carries back into headway and range rate
SLOW_NOISE = 0.5, 30.0


def fitted(plant: object, strength: dict[str, float] | None, seed: int = 47) -> Search:
    """A search that ended with `gain_change`, right or wrong."""
    effects = {} if strength is None else {"gain_change": strength}
    planted = plant(effects, seed=seed, minutes=8, noise="ar1", profile="mixed")  # type: ignore[operator]
    return ended_with(GAIN_CHANGE, trace(planted))


def ended_with(effect: Effect, measured: Trace) -> Search:
    """A search that ended with an effect."""
    data = prepare(measured, np.ones(measured.t.size, dtype=bool))
    before = baseline(data)
    assert before is not None
    begins = driver_candidates.screen(effect, data, before)
    found = driver_candidates.tried(effect, data, before, begins)
    named = (Named(effect, found.evidence, 20.0, ()),)
    return Search(before, data, found.solved, named, (), None, ())


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("plant", [plant_one.plant, plant_two.plant])
def test_what_chance_chose_does_not_carry_over(plant: object) -> None:
    of = fitted(plant, None)
    assert held_out.carried(of, GAIN_CHANGE) < 3.0


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("plant", [plant_one.plant, plant_two.plant])
def test_a_true_cause_carries_over(plant: object) -> None:
    of = fitted(plant, {"share": 0.5, "time": 200.0})
    assert of.named[0].evidence > 30.0
    assert held_out.carried(of, GAIN_CHANGE) > 0.5 * of.named[0].evidence


@pytest.mark.slow("fits a planted drive")
def test_a_model_knows_nothing_of_the_samples_that_it_is_held_against(seed: int) -> None:
    """With a cause and without it, noise included: the other folds' likelihood is at its maximum, from any start."""
    of = ended_with(ASYMMETRY, follower(seed, 0.0, asymmetry=0.35, slow_noise=SLOW_NOISE))
    folds = held_out_folds(of)
    for solved, fits in (
        (of.baseline, held_out.models(of.data, of.baseline, driver_search.again)),
        (of.baseline, [fold.base for fold in folds]),
        (of.solved, [fold.extended for fold in folds]),
    ):
        for k, fit in enumerate(fits):
            train = solved.rows & (held_out.dealt(of.data) != k)
            assert np.array_equal(fit.rows, train)
            better = solve(of.data, fit.model, fit.q, fit.noise, train)
            assert fit.deviance - better.deviance < 0.2


@pytest.mark.slow("fits planted drives")
def test_a_change_point_is_searched_again_for_every_fold(seed: int) -> None:
    """On drives without any change the time found on three quarters is not the one that suits the whole drive."""
    moved, surely = [], 0
    for k in range(4):
        of = fitted(plant_one.plant, None, seed + k)
        folds = held_out_folds(of)
        time = of.solved.model.where[-1].stop - 1
        moved += [abs(float(one.extended.q[time] - of.solved.q[time])) for one in folds]
        surely += predictive_score.of_whole(of.data, of, folds, of.baseline.noise.size).low > 0
    print(np.round(moved), surely)
    # a fit from where the whole drive is moves by less than the ramp of the change; the whole drive's time stays where the
    # other folds do not part the two
    assert np.max(moved) > 20.0
    # at a rate of 16 % all four happen once in a thousand runs
    assert surely <= 3


def held_out_folds(of: Search) -> tuple[Fold[DriverModel], ...]:
    return held_out.folds(of.data, of, driver_search.again)


def simulated_gain(of: Search) -> Interval:
    return held_out.simulation_gain(of.data, of, held_out_folds(of))


# drives of simulator two in town: by the noise that the loop carries into the inputs, and by samples next to the floor
@pytest.mark.slow("fits planted drives")
@pytest.mark.parametrize(
    ("effect", "drive", "noise"),
    [("lead_acceleration", 1822103, "mix"), ("asymmetric_gain", 1822101, "white")],
)
def test_without_the_cause_no_gain_of_the_simulation_is_sure(effect: str, drive: int, noise: str) -> None:
    (added,) = (each for each in CATALOGUE if each.id == effect)
    of = ended_with(added, trace(plant_two.plant({}, seed=drive, minutes=8, noise=noise, profile="urban")))
    errors = held_out.errors(of.data, of, held_out_folds(of))
    assert held_out.gain(*errors, of.data.output.dt).low > 0.0
    assert simulated_gain(of).low <= 0.0


@pytest.mark.slow("fits planted drives")
@mostly(0.9)
def test_with_the_cause_the_gain_of_the_simulation_stays_sure(seed: int) -> None:
    made = plant_one.plant(
        {ASYMMETRY.id: {"share": 0.45}}, seed=seed, minutes=10, noise="white", profile="mixed"
    )
    of = ended_with(ASYMMETRY, trace(made))
    assert of.named[0].evidence > 50.0
    assert simulated_gain(of).low > 0.0


@pytest.mark.slow("fits planted drives")
@mostly(0.95)
def test_a_true_cause_is_not_dropped_for_what_the_loop_does_to_the_simulation(seed: int) -> None:
    """Where the driver's own noise is in the inputs the true law simulates held-out data worse on one drive in four."""
    for known in (8, 10):
        of = ended_with(ASYMMETRY, follower(known, 0.0, asymmetry=0.35, slow_noise=SLOW_NOISE))
        gain = simulated_gain(of)
        assert of.named[0].evidence > 60.0
        assert gain.value < -0.1
        assert not confirmed_search.worse(gain, of.data, of, held_out_folds(of))
    of = ended_with(ASYMMETRY, follower(seed, 0.0, asymmetry=0.35, slow_noise=SLOW_NOISE))
    assert not confirmed_search.worse(simulated_gain(of), of.data, of, held_out_folds(of))


@pytest.mark.slow("fits planted drives")
@mostly(0.95)
def test_a_cause_that_neither_simulates_nor_predicts_better_is_dropped(seed: int) -> None:
    of = ended_with(ASYMMETRY, follower(seed, 0.0, slow_noise=SLOW_NOISE))
    assert confirmed_search.worse(Interval(-0.02, -0.05, 0.01), of.data, of, held_out_folds(of))
