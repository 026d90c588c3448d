"""An effect on the driver's remnant is named from the log alone; Gaussian noise of any spectrum gets no name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from canid.models.diagnosis.diagnose import diagnose
from canid.models.diagnosis.remnant import law_search, log_score
from canid.models.diagnosis.remnant.innovations import Innovations
from canid.models.diagnosis.remnant.law_intervals import parameters
from canid.models.diagnosis.remnant.remnant_block import diagnose_remnant
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Kind, ScaleFeature
from canid.values.findings import Report, Verdict, extends
from tests import seeds
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace
from tests.plants.planted_drive import EFFECTS, PROFILES
from tests.seeds import mostly

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}
REMNANT = tuple(effect for effect in CATALOGUE if effect.kind is Kind.REMNANT)
# kinds of noise with content at the rate of the samples: of a resonance the innovations are below a step of the sensor
NOISES = ("white", "ar1", "ar4", "mix")
GAUSSIAN = (*NOISES, "resonant")
# a drive of some minutes may hold too few bursts, or a strength near the edge: one of so many must show it
DRIVES = 3


def drive(simulator: str, effects: tuple[str, ...], seed: int, noises: tuple[str, ...]) -> Report:
    rng = np.random.default_rng(seed)
    noise, profile = str(rng.choice(noises)), str(rng.choice(PROFILES))
    print(simulator, effects, seed, noise, profile)
    planted = PLANTS[simulator](
        {name: {} for name in effects}, seed=seed, minutes=10, noise=noise, profile=profile
    )
    return diagnose(trace(planted))


def in_a_drawn_simulator() -> list[Any]:
    """Each effect in one simulator, drawn in each run; in both with CANID_ALL_CASES=1."""
    return [
        case
        for effect in EFFECTS["remnant"]
        for case in seeds.in_turn([(name, effect) for name in PLANTS], len(PLANTS), effect)
    ]


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(("simulator", "effect"), in_a_drawn_simulator())
@seeds.mostly(0.95)
def test_an_effect_on_the_remnant_is_named(simulator: str, effect: str, seed: int) -> None:
    """Strength, noise and road drawn; bursts also make the tails heavy, so that name may be next to theirs."""
    for k in range(DRIVES):
        report = drive(simulator, (effect,), seed + k, NOISES)
        named = {name for f in report.findings for name in (f.effect, *f.rivals)}
        if effect not in named or any(f.where != "remnant" for f in report.findings if not f.surrogate):
            continue
        for finding in report.findings:
            if finding.where == "remnant":
                assert finding.log_score_gain.low > 0
                assert math.isnan(finding.gain.value)
                assert all(iv.low <= iv.value <= iv.high for iv in finding.parameters.values())
        assert report.blocks[-1].where == "remnant"
        assert report.blocks[-1].state == "wrong"
        return
    pytest.fail(f"not named; the last: {report.says}")


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
@mostly(0.95)
def test_gaussian_noise_gets_no_name(simulator: str, seed: int) -> None:
    report = drive(simulator, (), seed, GAUSSIAN)
    assert not [f for f in report.findings if f.where == "remnant"], report.says
    assert report.blocks[-1].state == "adequate"


@pytest.mark.slow("diagnoses planted drives")
def test_a_remnant_alone_has_its_block_and_leaves_the_mean_law_adequate() -> None:
    planted = plant_one.plant(
        {"heavy_tails": {"freedom": 3.0}}, seed=7700, minutes=10, noise="ar1", profile="urban"
    )
    report = diagnose(trace(planted))
    assert report.verdict is Verdict.ADEQUATE
    assert {one.where for one in report.findings} == {"remnant"}
    assert "Mean law adequate" in report.says
    assert "nats/min" in report.says
    assert not extends(report)
    assert report.extended.fit_percent == report.baseline.fit_percent


def synthetic(seed: int, n: int = 6000, *, freedom: float = math.inf, slope: float = 0.0) -> Innovations:
    """Innovations of a known law."""
    rng = np.random.default_rng(seed)
    features = {of: np.clip(rng.standard_normal(n), -3, 3) for of in ScaleFeature}
    z = rng.standard_t(freedom, n) if math.isfinite(freedom) else rng.standard_normal(n)
    x = z * np.exp(slope * features[ScaleFeature.OWN_ACCELERATION])
    return Innovations(x, np.ones(n, dtype=bool), features, np.zeros((0, n)), 0.1, np.ones(n))


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_intervals_hold_the_parameters_of_a_known_law(seed: int) -> None:
    """95 % intervals of both parameters: of 40 laws at least 33 hold (chance of fewer: 1 in 2000)."""
    kept = tuple(e for e in REMNANT if e.remnant and ScaleFeature.PAST_INNOVATIONS not in e.remnant.scale)
    held = np.zeros(2, dtype=int)
    for k in range(40):
        of = synthetic(seed + k, 3000, freedom=4.0, slope=0.3)
        estimates = parameters(of, kept, law_search.fitted(of, kept, of.rows))
        freedom, slope = (next(iter(estimates[e.id].values())) for e in kept)
        held += [freedom.low <= 4.0 <= freedom.high, slope.low <= 0.3 <= slope.high]
    assert (held >= 33).all(), held


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_false_names_of_gaussian_innovations_are_rare(seed: int) -> None:
    """100 drives of Gaussian innovations: at most one name (chance of two at 0.5 % of drives: 9 %, at 0.1 %: 0.5 %)."""
    fold = (np.arange(3000) // 300) % 4
    named = [
        f.effect
        for k in range(100)
        for f in diagnose_remnant(synthetic(seed + k, 3000), REMNANT, fold, 22).findings
    ]
    assert len(named) <= 1, named


def test_the_gain_is_that_of_the_textbook() -> None:
    """Mean difference of the log densities by scipy, with the law of the other folds."""
    from scipy.stats import norm, t

    of = synthetic(5, freedom=4.0)
    heavy = tuple(effect for effect in REMNANT if effect.remnant and effect.remnant.heavy_tailed)
    fold = (np.arange(6000) // 300) % 4
    total = 0.0
    for k in range(4):
        train, here = of.x[fold != k], of.x[fold == k]
        freedom, _, scale = t.fit(train, floc=0.0)
        total += float(np.sum(t.logpdf(here, freedom, scale=scale) - norm.logpdf(here, scale=np.std(train))))
    gained = log_score.held_out(of, heavy, fold).law
    assert gained.value == pytest.approx(total / 10.0, rel=0.02)
    assert gained.low < gained.value < gained.high


def test_the_gradient_is_that_of_the_likelihood() -> None:
    rng = np.random.default_rng(1)
    x, F = rng.standard_t(5, 400), rng.standard_normal((2, 400))
    theta, inverse, h = np.array([0.1, 0.2, -0.1]), 0.2, 1e-6
    _, gradient = law_search._value(x, F, theta, inverse, free=True)
    at = [(theta + h * np.eye(3)[k] * s, inverse) for k in range(3) for s in (1, -1)]
    at += [(theta, inverse + h), (theta, inverse - h)]
    values = [law_search._value(x, F, *p, free=True)[0] for p in at]
    numeric = [(values[2 * k] - values[2 * k + 1]) / (2 * h) for k in range(4)]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-4)
