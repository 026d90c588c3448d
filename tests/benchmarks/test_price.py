"""The price of an effect is what the true model wins on the data, and it is fair to no one's method in particular."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy.linalg import cho_factor, cho_solve, solve_toeplitz, toeplitz
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.special import log_ndtr

from benchmarks.hidden_effects import expected as oracle
from benchmarks.hidden_effects.expected import each, expected
from benchmarks.hidden_effects.metric import metric, size
from tests.plants.measurement import lean
from tests.plants.plant_two import plant
from tests.plants.planted_drive import EFFECTS, NOISES, Array, Planted
from tests.plants.sensors import sense

QUANTUM = 0.4 / math.sqrt(12.0)
# A weak engine on a heavy road: the pedal stands at 50 %, and on a motorway it never reaches the floor. Then no sample
# is selected by its noise, and the realised likelihood ratio is that of plain Gaussian noise.
HEAVY = {"gain": 0.015, "rolling": 0.75, "drag": 1e-5}
# A usual car, whose driver releases the pedal every now and then.
USUAL = {"gain": 0.034}


# --- the second route: dense covariances of the processes that the simulator names, a driver made of plain loops ---------


def whitening(noise: str, sd: float) -> Array:
    """Filter that whitens the named noise with the pedal's quantisation, from its true autocovariance: 20 s of it."""
    t = 0.1 * np.arange(200)
    fast, slow = np.exp(-t / 0.03), np.exp(-t / 1.0)
    r = sd**2 * {"white": fast, "ar1": slow, "mix": 0.7 * slow + 0.3 * fast}[noise]
    r[0] += QUANTUM**2
    phi = solve_toeplitz(r[:-1], r[1:])
    return np.concatenate([[1.0], -phi]) / math.sqrt(r[0] - phi @ r[1:])  # type: ignore[no-any-return]


def answer(x: Array, tau: float, dead_time: float, dt: float) -> Array:
    """Euler's exact step for an input that is held from half a step before to half a step after."""
    k = np.arange(len(x))
    held = np.interp(k - dead_time / dt - 0.5, k, x)
    decay = math.exp(-dt / tau)
    out, _ = lfilter([1.0 - decay], [1.0, -decay], held, zi=[decay * held[0]])
    return out  # type: ignore[no-any-return]


def columns(planted: Planted, every: int) -> tuple[Array, Array, Array]:
    """Pedal at 10 Hz, and the inputs every few samples."""
    c = planted.columns
    return c["pedal"][::10], (c["gap"] / c["speed"])[::every], c["range_rate"][::every]


def refitted(planted: Planted, distances: Callable[[Array], Array]) -> float:
    """Smallest sum of squared distances of a baseline, by scipy's own least squares over all seven numbers."""
    _, headway, rate = columns(planted, 5)
    d = planted.truth["driver"]

    def left(p: Array) -> Array:
        one, two = answer(headway, p[0], p[1], 0.05)[::2], answer(rate, p[2], p[3], 0.05)[::2]
        return distances(p[4] + p[5] * one + p[6] * two)

    start = [*(d[name] for name in ("tau1", "dead_time1", "tau2", "dead_time2")), 0.0, d["K1"], d["K2"]]
    start[4] = d["offset"] - d["K1"] * d["headway_desired"]
    box = ([0.02, 0.03, 0.02, 0.03, -200.0, -50.0, -50.0], [5.0, 2.5, 5.0, 2.5, 200.0, 50.0, 50.0])
    scale = [0.3, 0.3, 0.3, 0.3, 5.0, 3.0, 3.0]
    found = least_squares(left, start, bounds=box, x_scale=scale, diff_step=3e-3, max_nfev=30)
    return 2.0 * float(found.cost)


def drive(
    effects: Mapping[str, Mapping[str, float]], seed: int, noise: str = "ar1", **more: float
) -> Planted:
    settings = {"minutes": 3.0, "profile": "mixed", **(HEAVY if "gain" not in more else {}), **more}
    return plant(effects, seed=seed, noise=noise, **settings)  # type: ignore[arg-type]


# --- claims ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("noise", "drives"), [("white", 3), ("ar1", 8), ("mix", 6)])
def test_the_price_is_the_likelihood_ratio_that_is_realised(noise: str, drives: int) -> None:
    """Mean over drives: 2 log likelihood of the true model less that of the refitted baseline, within 15 %.

    The true model has no free number here, and the baseline's seven take 7 from the distance.
    """
    prices, won = [], []
    for seed in range(300, 300 + drives):
        p = drive({"asymmetric_gain": {"share": 0.5}}, seed, noise, profile="motorway", minutes=8.0)
        pedal, _, _ = columns(p, 5)
        assert np.all((pedal > 0.0) & (pedal < 100.0))
        taps = whitening(noise, p.truth["driver"]["noise_sd"])
        said = 0.4 * np.round(pedal / 0.4)

        def distances(mu: Array, taps: Array = taps, said: Array = said) -> Array:
            return lfilter(taps, [1.0], said - mu)[len(taps) :]  # type: ignore[no-any-return]

        true = distances(p.demand[::10])
        won.append(refitted(p, distances) - float(true @ true) + 7.0)
        prices.append(expected(p).lr)
    # the standard deviation of one realised ratio is 2 sqrt(LR): so well is the sum known
    assert 2.0 / math.sqrt(sum(prices)) < 0.06
    assert np.mean(won) == pytest.approx(np.mean(prices), rel=0.15)


def test_where_the_foot_leaves_the_pedal_the_price_is_between_two_methods() -> None:
    """Leaving out the samples at 0 % selects by noise and wins less; a censored likelihood uses them and wins more."""
    prices, masked, censored = [], [], []
    for seed in range(310, 316):
        p = drive({"asymmetric_gain": {"share": 0.3}}, seed, "white", minutes=5.0, **USUAL)
        pedal, _, _ = columns(p, 5)
        free = pedal > 0.0
        assert 0.5 < free.mean() < 0.95
        sd = p.truth["driver"]["noise_sd"]

        def plain(mu: Array, pedal: Array = pedal, free: Array = free, sd: float = sd) -> Array:
            return ((pedal - mu)[free]) / sd  # type: ignore[no-any-return]

        def tobit(mu: Array, pedal: Array = pedal, free: Array = free, sd: float = sd) -> Array:
            # -2 log P(below the floor) as a square
            floor = np.sqrt(-2.0 * log_ndtr(-mu[~free] / sd))
            return np.concatenate([(pedal - mu)[free] / sd, floor])

        for distances, out in ((plain, masked), (tobit, censored)):
            out.append(refitted(p, distances) - float(np.sum(distances(p.demand[::10]) ** 2)) + 7.0)
        prices.append(expected(p).lr)
    assert np.mean(masked) < np.mean(prices) < np.mean(censored)


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("profile", ["mixed", "urban", "motorway"])
def test_a_clean_drive_is_worth_nothing(profile: str, noise: str) -> None:
    price = expected(plant({}, seed=21, minutes=3, noise=noise, profile=profile))
    assert 0.0 <= price.lr < 0.1
    assert 0.0 <= price.share < 1e-4


def test_the_price_grows_with_the_square_of_a_small_strength_and_with_the_length() -> None:
    once, twice = (
        expected(drive({"asymmetric_gain": {"share": share}}, 22, minutes=6.0)).lr for share in (0.1, 0.2)
    )
    assert twice / once == pytest.approx(4.0, rel=0.25)
    half = np.mean([expected(drive({"asymmetric_gain": {"share": 0.2}}, seed)).lr for seed in range(23, 27)])
    whole = np.mean(
        [expected(drive({"asymmetric_gain": {"share": 0.2}}, seed, minutes=6.0)).lr for seed in range(23, 27)]
    )
    assert whole / half == pytest.approx(2.0, rel=0.35)


@pytest.mark.parametrize("effect", ["speed_scale", "range_rate_scale", "range_rate_sign", "headwind"])
def test_what_the_baseline_absorbs_or_the_car_does_is_worth_nothing(effect: str) -> None:
    assert expected(drive({effect: {}}, 24)).lr < 2.0


def test_a_second_lag_is_absorbed_and_a_looming_threshold_is_not() -> None:
    assert expected(drive({"second_lag": {"tau": 0.3}}, 25)).lr < 5.0
    assert expected(drive({"looming_threshold": {"threshold": 0.003}}, 25)).lr > 100.0


def test_the_share_is_that_of_the_variance_left_over() -> None:
    """A sine in addition to the answers: half its squared amplitude, against the remnant's variance."""
    p = drive({"periodic_task": {"amplitude": 3.0, "frequency": 0.2}}, 26, minutes=6.0)
    free = p.columns["pedal"][::10] > 0.0
    assert expected(p).share == pytest.approx(4.5 / (4.5 + p.remnant[::10][free].var()), rel=0.2)


def test_each_of_one_effect_is_the_whole() -> None:
    p = drive({"looming_gain": {"exponent": 0.5}}, 27)
    assert each(p)["looming_gain"].lr == pytest.approx(expected(p).lr, rel=0.01)
    offset = drive({"range_offset": {"distance": 3.0}}, 27, profile="urban", **USUAL)
    assert each(offset)["range_offset"].lr == pytest.approx(expected(offset).lr, rel=0.02)


def test_each_of_two_effects_is_worth_no_more_than_alone_and_less_where_they_look_alike() -> None:
    one = {"gain_drift": {"rate": -0.7}}
    alike = each(drive({**one, "gain_change": {"share": 0.3, "time": 90.0}}, 28))["gain_drift"].lr
    unlike = each(drive({**one, "periodic_task": {"amplitude": 2.0, "frequency": 0.1}}, 28))["gain_drift"].lr
    alone = expected(drive(one, 28)).lr
    assert alike < 0.6 * alone
    assert unlike == pytest.approx(alone, rel=0.2)


def test_a_pedal_that_is_never_free_has_no_price() -> None:
    p = drive({"asymmetric_gain": {}}, 29, minutes=1.5)
    blocked = p._replace(columns={**p.columns, "pedal": np.zeros(len(p.demand))})
    assert math.isnan(expected(blocked).lr)
    assert all(math.isnan(price.lr) for price in each(blocked).values())


def test_the_metric_is_the_dense_covariance_of_what_is_seen() -> None:
    """d' S^-1 d with the rows and columns of unseen samples left out, for a process whose S is known."""
    rng = np.random.default_rng(30)
    n = 4000
    x = np.zeros(n)
    for k in range(1, n):
        x[k] = 0.9 * x[k - 1] + rng.standard_normal()
    seen = rng.uniform(size=n) < 0.8
    seen[1000:1200] = False
    seen[-5:] = False
    direction = np.sin(np.arange(n) / 15.0) + 0.3 * rng.standard_normal(n)
    S = toeplitz(0.9 ** np.arange(n) / (1.0 - 0.81))[np.ix_(seen, seen)]
    exact = direction[seen] @ cho_solve(cho_factor(S), direction[seen])
    far = metric(x, 0.0, np.ones(n), seen)
    assert float(np.sum(far(direction) ** 2)) == pytest.approx(exact, rel=0.08)
    other = np.where(seen, direction, 1e3)
    np.testing.assert_allclose(far(other), far(direction), atol=1e-6)


def test_the_size_of_growing_noise_is_found() -> None:
    rng = np.random.default_rng(31)
    answers = 8.0 * rng.standard_normal(20_000)
    true = np.hypot(0.5, 0.25 * answers)
    found = size(true * rng.standard_normal(20_000), answers, 0.0)
    np.testing.assert_allclose(found, true, rtol=0.15)


@pytest.mark.parametrize("effect", EFFECTS["sensing"])
def test_the_oracle_sees_what_the_sensors_say(effect: str) -> None:
    """Gap and range rate as the oracle takes them are the sensors' without their noise."""
    p = drive({effect: {}}, 32)
    headway, rate, step = oracle._seen(p, [effect])
    t = step * np.arange(len(rate))
    said = {role: (m.t, x) for m in sense(p, lean(), 32) for role, x in m.values.items()}
    at, rates = said["range_rate"]
    gaps = said["gap"][1]
    speeds = np.interp(at, *said["speed"])
    inner = (at > 1.0) & (at < t[-1] - 1.0)
    # noise of a radar report: at most 0.12 m/s and 0.3 m; thousands of reports
    miss = (rates - np.interp(at, t, rate))[inner]
    assert abs(miss.mean()) < 0.02
    assert miss.std() < 0.15
    late = (gaps / speeds - np.interp(at, t, headway))[inner]
    assert abs(late.mean()) < 0.005
    # the dead time that an effect brings shows in what is left over along the slope
    slope = np.gradient(rate, step)
    lag = np.polyfit(np.interp(at, t, slope)[inner], miss, 1)[0]
    assert abs(lag) < 0.02
