"""What no cause explains is said to be unexplained; what is nothing but noise is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from canid.models.diagnosis.adequacy import (
    adequacy,
    alternatives,
    held_perception,
    intermittent_gain,
    refit_noise,
    skewness,
)
from canid.models.diagnosis.adequacy.alternatives import shapes
from canid.models.diagnosis.diagnose import diagnose
from canid.models.diagnosis.driver.driver_data import DriverData, sideways
from canid.models.diagnosis.driver.driver_fit import baseline
from canid.models.diagnosis.driver.driver_model import lagged
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.fitting.likelihood import Noise, filtered
from canid.models.diagnosis.fitting.uncertainty import newey_west
from canid.models.diagnosis.prepared_drive import Prepared, ready
from canid.models.effects import CATALOGUE
from canid.values.findings import Verdict
from canid.values.types import Array, LearnGate, Trace
from tests import seeds
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("simulator", "effect", "strength", "noise", "profile"),
    seeds.in_turn(
        [
            ("one", "headway_hysteresis", {"width": 0.9}, "white", "mixed"),
            ("two", "brake_light_startle", {"drop": 12.0, "threshold": 0.6}, "resonant", "mixed"),
        ],
        2,
        "unexplained",
    ),
)
def test_an_effect_of_nobodys_catalogue_is_unexplained(
    simulator: str, effect: str, strength: dict[str, float], noise: str, profile: str
) -> None:
    planted = PLANTS[simulator]({effect: strength}, seed=97, minutes=8, noise=noise, profile=profile)
    report = diagnose(trace(planted))
    assert report.verdict is Verdict.UNEXPLAINED, report.says
    assert all(finding.surrogate for finding in report.findings)
    assert report.unexplained.value > 0.01


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("simulator", "effect", "strength"),
    seeds.in_turn(
        [
            ("one", "attention_gap", {"per_minute": 1.5, "duration": 3.5}),
            ("two", "gain_change", {"share": 0.6, "time": 200.0}),
        ],
        2,
        "taken out",
    ),
)
def test_a_cause_that_is_taken_out_of_the_catalogue_is_not_its_neighbour(
    simulator: str, effect: str, strength: dict[str, float]
) -> None:
    planted = PLANTS[simulator]({effect: strength}, seed=98, minutes=8, noise="ar1", profile="mixed")
    report = diagnose(trace(planted), catalogue=tuple(one for one in CATALOGUE if one.id != effect))
    assert report.verdict is Verdict.UNEXPLAINED, report.says
    assert all(finding.surrogate for finding in report.findings)


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    """A clean drive with its baseline."""
    measured = trace(plant_two.plant({}, seed=96, minutes=6, noise="ar1", profile="mixed"))
    found = ready(measured, np.ones(measured.t.size, dtype=bool))
    assert found is not None
    return found


@pytest.mark.slow("diagnoses planted drives")
def test_families_are_finite_and_have_names_of_their_own(prepared: Prepared) -> None:
    families = shapes(prepared.data, prepared.fitted)
    assert len({one.name for one in families}) == len(families)
    for one in families:
        assert one.says, one.name
        assert one.columns.shape[0] == prepared.trace.t.size, one.name
        assert np.isfinite(one.columns).all(), one.name


@pytest.mark.slow("diagnoses planted drives")
def test_a_slow_structure_explains_more_beside_a_colour_of_its_own(prepared: Prepared) -> None:
    """A noise model fitted without a slow structure absorbs it."""
    data, fitted = prepared.data, prepared.fitted
    slow = 3.0 * np.sin(2 * np.pi * data.seen.t / 60.0)
    # of samples at the floor, only on which side of it the demand was: it moves along, so that the same ones are
    output = data.output._replace(y=data.output.y + slow, floor=data.output.floor + slow)
    added = data._replace(output=output)
    own, memory = refit_noise.directions(added, fitted), refit_noise.noise_memory(fitted)
    with_it = np.column_stack([own, slow / np.linalg.norm(slow)])

    def won(of: DriverData) -> float:
        return (
            refit_noise.refit(of, fitted, own, memory).deviance
            - refit_noise.refit(of, fitted, with_it, memory).deviance
        )

    assert won(added) > 20.0
    assert won(data) < 12.0


def test_noise_of_any_colour_and_size_follows_no_answer() -> None:
    """Chance in 40 pairs of unrelated processes: about as many as it says, and none by much."""
    rng = np.random.default_rng(5)
    rows = np.ones(6000, dtype=bool)
    p = []
    for k in range(40):
        x, e = rng.normal(size=(2, 6000))
        x = np.convolve(x, np.ones(1 + 4 * (k % 5)), "same")
        # noise scale that follows the answer, autocorrelation that whitening has left
        e = (e + 0.2 * np.r_[0.0, e[:-1]]) * (1 + 0.5 * np.abs(x) / x.std())
        p.append(intermittent_gain.detect({"x": x}, e, rows, 0.1).p)
    assert sum(one < 0.05 for one in p) <= 6
    assert min(p) > 1e-4


def test_an_answer_that_comes_and_goes_is_seen() -> None:
    rng = np.random.default_rng(6)
    x = np.convolve(rng.normal(size=6000), np.ones(10), "same")
    away = (np.arange(6000) // 40) % 8 == 0
    e = rng.normal(size=6000)
    lost = 0.4 * x * (away - away.mean())
    assert intermittent_gain.detect({"x": x}, e + lost, np.ones(6000, dtype=bool), 0.1).p < 1e-4


def test_a_normal_noise_of_any_colour_is_even_handed() -> None:
    """The score of skewness has the spread that it says, also where the noise remembers."""
    rng = np.random.default_rng(7)
    known = np.ones(3000, dtype=bool)
    scores = []
    for k in range(60):
        x = rng.normal(size=3400)
        smooth = np.convolve(x, np.ones(1 + 6 * (k % 4)), "valid")[:3000]
        scores.append(skewness.skewed(smooth, known, 60)[0])
    assert 0.6 < np.std(scores) < 1.3
    assert max(np.abs(scores)) < 4.0


def test_free_curves_hold_every_straight_line() -> None:
    """What a free curve spans holds a line, so that it never explains less than one."""
    x = np.random.default_rng(8).normal(size=500)
    H = alternatives.hats(x, np.ones(500, dtype=bool), 8)
    inside = (x > np.quantile(x, 0.02)) & (x < np.quantile(x, 0.98))
    b = np.linalg.lstsq(H[inside], x[inside], rcond=None)[0]
    assert np.allclose((H @ b)[inside], x[inside])
    assert alternatives.hats(np.zeros(500), np.ones(500, dtype=bool), 8).shape == (500, 0)


def held_now_and_then(x: Array, rng: np.random.Generator) -> Array:
    """What a driver acts on who sees the road again only after 1.5 to 4 s, several times a minute."""
    at, seen = 0, np.arange(x.size)
    while True:
        at += round(rng.uniform(6.0, 16.0) / 0.1)
        stop = at + round(rng.uniform(1.5, 4.0) / 0.1)
        if stop >= x.size:
            return x[seen]
        seen[at:stop] = at
        at = stop


@pytest.mark.parametrize("noise", ["white", "ar", "bursts"])
def test_inputs_that_are_held_now_and_then_are_seen(noise: str) -> None:
    """In 10 min of each noise; a driver who holds none has no evidence for it."""
    rng = np.random.default_rng(9)
    n, A = 6000, np.array([1.0, -0.8]) if noise == "ar" else np.ones(1)
    x = np.convolve(rng.normal(size=n + 40), np.hanning(40) / 20**0.5, "valid")[:n]
    e = rng.normal(size=n)
    if noise == "bursts":
        e *= np.exp(np.repeat(rng.normal(0.0, 0.7, n // 100), 100))
    model = Noise(A, 0.4, np.ones(n), np.empty(0))
    rows, answer = np.ones(n, dtype=bool), [held_perception.Response(x, 1.0, 0.3)]
    missing = lagged(held_now_and_then(x, rng) - x, 0.3, 0.1)
    away = e + np.convolve(missing, A)[:n] / 0.4
    evidence = [held_perception.log_evidence(answer, of, rows, model, 0.1) for of in (e, away)]
    assert evidence[0] < 3.0
    assert evidence[1] > 15.0


def test_evidence_of_held_inputs_is_a_bound_of_chance() -> None:
    """Its mean is 1 where none is held (Ville 1939), for inputs that the noise has moved as well."""
    rng = np.random.default_rng(10)
    model = Noise(np.ones(1), 1.0, np.ones(1000), np.empty(0))
    rows, values = np.ones(1000, dtype=bool), []
    for _ in range(20):
        e = rng.normal(size=1000)
        # the noise of before moves the car, and what is seen of it
        x = 0.3 * np.convolve(np.r_[0.0, e], np.exp(-0.1 * np.arange(60)))[:1000] + rng.normal(size=1000)
        answer = [held_perception.Response(x, 0.5, 0.2)]
        values.append(held_perception.log_evidence(answer, e, rows, model, 0.1))
    assert max(values) < np.log(20 / 0.01)
    assert np.mean(np.exp(values)) < 3.0


@pytest.mark.parametrize("strength", [0.5, 4.0])
def test_held_inputs_have_the_evidence_of_every_sequence_of_stretches(seed: int, strength: float) -> None:
    """Against one stretch at a time, and a sum of logarithms; also where the ratio is beyond the largest number."""
    rng = np.random.default_rng(seed)
    n, dt, past = 400, 0.1, int(rng.integers(0, 40))
    A = np.r_[1.0, rng.normal(0.0, 0.3 / (past + 1), past)]
    noise = Noise(A, 1.3, np.exp(0.2 * rng.normal(size=n)), np.empty(0))
    x, rows, e = strength * np.cumsum(rng.normal(size=n)), rng.uniform(size=n) < 0.9, rng.normal(size=n)
    answer = [held_perception.Response(x, 1.2, 0.3), held_perception.Response(np.roll(x, 3), -0.7, 0.0)]
    size = held_perception._size(e, rows, dt)
    left = np.where(rows, np.clip(e / size, -4.0, 4.0), 0.0)
    lengths, behind = [10, 15, 20, 30, 45], 10
    enter, on = np.log(dt / 20.0 / len(lengths)), np.log1p(-dt / 20.0)
    driving = np.full(n + 1, -np.inf)
    driving[0] = 0.0
    for t in range(1, n + 1):
        terms = [driving[t - 1] + on]
        for k in lengths:
            a = t - k - behind
            # one that ends with the drive is not seen to end
            if a < 0 or t == n:
                continue
            change = np.zeros(t - a)
            for response in answer:
                late = np.where(np.arange(t - a) < k, response.x[a] - response.x[a:t], 0.0)
                decay = np.exp(-dt / response.tau) if response.tau else 0.0
                y = 0.0
                for i, seen in enumerate(late):
                    y = decay * y + (1.0 - decay) * seen
                    change[i] += response.gain * y
            white = np.convolve(change, A)[: t - a] / (noise.sd * noise.size * size)[a:t]
            white = np.where(rows[a:t], white, 0.0)
            terms.append(driving[a] + enter + float(white @ (left[a:t] - 0.5 * white)))
        driving[t] = np.logaddexp.reduce(terms)
    found = held_perception.log_evidence(answer, e, rows, noise, dt)
    assert found == pytest.approx(driving[-1], rel=1e-9, abs=1e-9)


def test_what_is_too_small_to_fail_is_not_tested_twice(
    prepared: Prepared, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a replicate only families that may fail are read: these have the p that they have with all tested twice."""
    search = Search(prepared.fitted, prepared.data, prepared.fitted)
    refits, refit = list[int](), refit_noise.refit

    def counted(*given: Any) -> refit_noise.Refit:
        refits.append(1)
        return refit(*given)

    monkeypatch.setattr(refit_noise, "refit", counted)
    for explained in (0.0, 0.5, 9.0):
        before = len(refits)
        whole = adequacy.assess(search, prepared.data, explained)
        between = len(refits)
        alone = adequacy.assess(search, prepared.data, explained, material_alone=True)
        assert len(refits) - between <= between - before
        material = [family for family in whole.families if family.share >= whole.material]
        assert material == [family for family in alone.families if family.share >= alone.material]
        assert alone.failed == whole.failed
    # next to a cause that explained so much
    assert len(refits) == between > before


@pytest.mark.parametrize("role", ["yaw_rate", "curvature"])
def test_bends_are_those_of_the_yaw_rate_or_the_curvature(role: str) -> None:
    """To the left or the right; without either there are none to answer."""
    n, turn = 200, 0.1 * np.sin(0.1 * np.arange(200))
    columns = {"speed": np.full(n, 20.0), role: turn if role == "yaw_rate" else turn / 20.0}
    drive = Trace(
        0.1, 0.1 * np.arange(n), np.zeros(n), np.zeros((n, 2)), ("headway_error", "range_rate"),
        (LearnGate.OPEN,) * n, np.ones(n, bool), np.zeros(n, np.int64), columns,
    )  # fmt: skip
    found = sideways(drive)
    assert found is not None
    assert found == pytest.approx(20.0 * np.abs(turn))
    assert sideways(drive._replace(signals={"speed": columns["speed"]})) is None


@pytest.mark.slow("diagnoses planted drives")
def test_an_answer_to_the_roads_bends_is_seen(prepared: Prepared) -> None:
    """A driver who lifts a second before each bend; one who does not leaves nothing of its form."""
    data = prepared.data
    t = data.seen.t
    bends = 2.0 * np.maximum(np.sin(2 * np.pi * t / 23.0), 0.0) ** 4
    data = data._replace(sideways=bends)
    lifted = data.output.y - 3.0 * np.interp(t + 1.0, t, bends)
    for y, seen in ((data.output.y, False), (lifted, True)):
        given = data.with_output(data.output._replace(y=y))
        again = baseline(given)
        assert again is not None
        families = [one for one in shapes(given, again) if one.name == "bends"]
        assert len(families) == 1
        assert (adequacy.spanned(families, given, again)[0].p < 1e-4) == seen


def test_many_short_rows_are_filtered_as_a_few_long_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for order in (0, 3, 11, 12, 32, 40):
        A, rows = np.r_[1.0, rng.normal(size=order)], rng.normal(size=(200, 47))
        expected = [np.convolve(row, A)[:47] for row in rows]
        assert filtered(A, rows) == pytest.approx(np.array(expected), rel=1e-9, abs=1e-9)
        assert filtered(A, rows[:1]) == pytest.approx(np.array(expected[:1]), rel=1e-9, abs=1e-9)


def test_the_long_run_covariance_is_the_tapered_sum_of_autocovariances(seed: int) -> None:
    """Newey & West 1987, eq. 5."""
    g = np.random.default_rng(seed).normal(0.4, 1.0, (300, 3))
    for lags in (0, 1, 7, 40):
        total = g.T @ g
        for lag in range(1, lags + 1):
            cross = g[lag:].T @ g[:-lag]
            total = total + (1 - lag / (lags + 1)) * (cross + cross.T)
        assert newey_west(g, lags) == pytest.approx(total, rel=1e-10, abs=1e-10)
