"""A driver whose response to relative speed is bent, or another: live, the gain of a straight line is not quoted."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.mathematics.estimators import ESTIMATORS, bent_response
from canid.mathematics.estimators.windows import reported_estimates
from canid.mathematics.identification.fopdt.answer_columns import Columns, Reference
from canid.mathematics.identification.identifiability import quotable
from canid.models.effects.driver import looming_gain
from canid.values.types import Array, Estimate, LearnGate, Sample, Status
from tests.plants.first_order_lag import answer
from tests.seeds import mostly

DT, MINUTES = 0.1, 4.0
K1, K2 = 6.0, 5.0


def straight(rate: Array) -> Array:
    return rate


def dead_zone(rate: Array) -> Array:
    return np.sign(rate) * np.maximum(np.abs(rate) - 1.0, 0.0)


def drive(seed: int, bend: Callable[[Array], Array], noisy: float = 1.0) -> list[Estimate]:
    """Reports of a drive behind a lead that no loop is closed with: headway and range rate are given."""
    rng = np.random.default_rng([seed, 151])
    n = round(MINUTES * 60.0 / DT)
    rate = lfilter([1.0], [1.0, -0.95], 0.5 * rng.normal(size=n))
    headway = np.clip(1.7 + 0.4 * lfilter([0.1], [1.0, -0.99], rng.normal(size=n)), 0.8, 3.0)
    noise = lfilter([1.0], [1.0, -0.9], 0.3 * noisy * rng.normal(size=n))
    y = 20.0 + K1 * answer(headway - 1.7, DT, 0.5, 0.3) + K2 * answer(bend(rate), DT, 0.4, 0.3) + noise
    samples = [
        Sample(round(k * DT, 6), float(a), (float(h), float(r)), LearnGate.OPEN, True, 0, {})
        for k, (a, h, r) in enumerate(zip(y, headway - 1.7, rate, strict=True))
    ]
    running = [estimator.make(("headway_error", "range_rate"), DT) for estimator in ESTIMATORS]
    return [e for e in reported_estimates(running, samples) if e.t > 125.0]


def in_loop(seed: int, ahead: float = 0.0, nearness: float = 0.0) -> list[Estimate]:
    """Reports of a drive in which the pedal moves the car: K2·(30 m/gap)^nearness·range rate, and K2·ahead·lead's accel."""
    rng = np.random.default_rng([seed, 152])
    n, delay, keep = round(6.0 * 60.0 / DT), 4, np.exp(-DT / 0.4)
    lead_accel = lfilter([1.0], [1.0, -0.96], 0.1 * rng.normal(size=n))
    lead = 22.0 + np.cumsum(lead_accel) * DT
    lead += 4.0 * np.sin(np.arange(n) * DT / 25.0) - np.linspace(0.0, lead[-1] - 22.0, n)
    lead_accel = np.gradient(lead, DT)
    noise = lfilter([1.0], [1.0, -0.9], 0.3 * rng.normal(size=n))
    wanted = 1.7 + 0.5 * np.sin(np.arange(n) * DT / 40.0)
    speed, gap, lag, accel = lead[0], 1.7 * lead[0], 0.0, 0.0
    demands, samples = [0.0] * n, []
    for k in range(n):
        rate, headway = lead[k] - speed, gap / speed
        near = (looming_gain.REFERENCE_GAP_M / max(gap, 5.0)) ** nearness
        demands[k] = K1 * (headway - wanted[k]) + K2 * (near * rate + ahead * lead_accel[k])
        lag = keep * lag + (1.0 - keep) * demands[max(k - delay, 0)]
        y = 20.0 + lag + noise[k]
        signals = {"speed": float(speed), "headway": float(headway)}
        inputs = (float(headway - 1.7), float(rate))
        samples.append(Sample(round(k * DT, 6), float(y), inputs, LearnGate.OPEN, True, 0, signals))
        accel += DT / 0.4 * (0.12 * (y - 20.0) - 0.02 * (speed - 22.0) - accel)
        speed, gap = max(speed + DT * accel, 3.0), max(gap + DT * rate, 3.0)
    running = [estimator.make(("headway_error", "range_rate"), DT) for estimator in ESTIMATORS]
    return [e for e in reported_estimates(running, samples) if e.t > 125.0]


def missed(estimates: list[Estimate]) -> list[Estimate]:
    """Those that quote a gain of relative speed whose interval does not hold it."""
    quoted = [e for e in estimates if e.status is Status.OK and quotable(e.channels["range_rate"], "K")]
    return [e for e in quoted if not e.channels["range_rate"].K.low <= K2 <= e.channels["range_rate"].K.high]


@pytest.mark.slow("estimates over whole drives")
@mostly(0.9)
def test_an_average_over_a_dead_zone_is_withheld_by_both_estimators(seed: int) -> None:
    """After two minutes neither quotes the gain, and both say why in the same words."""
    estimates = drive(seed, dead_zone)
    withheld = [e for e in estimates if "range rate is probably an average over a cause" in e.says]
    assert len(withheld) >= 0.3 * len(estimates)
    assert {e.estimator for e in withheld} == {"fopdt", "armax"}
    assert len(missed(estimates)) <= 0.3 * len(estimates)


@pytest.mark.slow("estimates over whole drives")
@mostly(0.9)
def test_a_straight_response_keeps_its_gain(seed: int) -> None:
    """Nothing is withheld, and the interval holds it."""
    estimates = drive(seed, straight)
    assert all(e.status is Status.OK and quotable(e.channels["range_rate"], "K") for e in estimates)
    assert len([e for e in missed(estimates) if e.estimator == "fopdt"]) <= 0.1 * len(estimates)


@pytest.mark.slow("estimates over whole drives")
@mostly(0.9)
def test_a_gain_that_is_hardly_known_is_not_withheld_for_its_end_at_zero(seed: int) -> None:
    """An end is lowered towards zero for having been quoted by chance; that is no bend."""
    estimates = [e for e in drive(seed, straight, 8.0) if e.estimator == "fopdt" and e.status is Status.OK]
    ends = [e.channels["range_rate"] for e in estimates if e.channels["range_rate"].K.low == 0.0]
    assert all(quotable(channel, "K") for channel in ends)


@pytest.mark.slow("estimates over whole drives")
@pytest.mark.parametrize("cause", [{"ahead": 1.2}, {"nearness": 1.0}])
@mostly(0.9)
def test_a_gain_that_a_cause_moves_is_not_quoted_without_it(cause: dict[str, float], seed: int) -> None:
    """Of the lead's acceleration or the gap: K of both estimators is withheld, or so wide that it holds."""
    estimates = in_loop(seed, **cause)
    assert len(missed(estimates)) <= 0.25 * len(estimates)


@pytest.mark.slow("estimates over whole drives")
@mostly(0.9)
def test_in_a_loop_a_gain_that_nothing_moves_is_quoted(seed: int) -> None:
    """Gap and speed are known, and show nothing."""
    estimates = [e for e in in_loop(seed) if e.estimator == "fopdt"]
    quoted = [e for e in estimates if e.status is Status.OK and quotable(e.channels["range_rate"], "K")]
    assert len(quoted) >= 0.9 * len(estimates)
    assert len(missed(estimates)) <= 0.1 * len(estimates)


def test_sums_over_windows_are_the_likelihood_of_all_their_rows(seed: int) -> None:
    """Odds and gains are those of one regression on all rows: common gains, and of each window an offset and habits."""
    rng = np.random.default_rng(seed)
    n, windows, K = 200, 4, np.array([6.0, 5.0])
    evidence, stacked, spread = bent_response.Evidence(), [], []
    for k in range(windows):
        answers, bends = rng.normal(size=(2, n)), rng.normal(size=(3, n))
        bends += rng.normal(size=(3, 2)) @ answers
        habit = K * (1.0 + bent_response.HABIT * rng.normal(size=2))
        y = habit @ answers + rng.normal() + 0.4 * bends[1] + rng.normal(size=n)
        values = np.vstack([answers, np.ones(n), y])
        made = Columns(values, np.ones(n), np.full(n, True), 2, np.zeros(3), 1.0)
        at = Reference(K, np.ones(2), np.ones(2), K, np.zeros(1), 1, 1.0, 1.0)
        products, last = bent_response._products(made, bends, at)
        evidence = evidence._replace(products=evidence.products + products, last=last)
        stacked.append(np.vstack([answers, bends, y]))
        own = np.vstack([1e4 * np.ones(n), bent_response.HABIT * K[:, None] * answers])
        spread.append(np.pad(own, ((0, 0), (n * k, n * (windows - 1 - k)))))
    rows, Z = np.hstack(stacked), np.vstack(spread)
    V, X = np.eye(n * windows) + Z.T @ Z, rows[:2]

    def likelihood(V: Array) -> float:
        # restricted to what common gains leave (Patterson & Thompson 1971)
        inner, along = X @ np.linalg.solve(V, X.T), X @ np.linalg.solve(V, rows[-1])
        square = rows[-1] @ np.linalg.solve(V, rows[-1]) - along @ np.linalg.solve(inner, along)
        return float(-0.5 * (square + np.linalg.slogdet(V)[1] + np.linalg.slogdet(inner)[1]))

    def gains(b: Array, sd: float) -> Array:
        x = np.vstack([X, b])
        inner = x @ np.linalg.solve(V, x.T)
        inner[2, 2] += sd**-2.0
        return np.asarray(np.linalg.solve(inner, x @ np.linalg.solve(V, rows[-1]))[:2])

    plain = gains(np.zeros(n * windows), 1.0)
    found = bent_response.others(evidence)
    for i, b in enumerate(rows[2:5]):
        with_bend = likelihood(V + bent_response.TYPICAL[i] ** 2 * np.outer(b, b)) - likelihood(V)
        for channel, name in enumerate(found):
            model = found[name][i]
            odds = np.exp(min(with_bend, 50.0)) * bent_response.PRIOR_ODDS
            assert math.isclose(model.odds, odds, rel_tol=1e-3) or with_bend > 40.0
            expected = gains(b, bent_response.TYPICAL[i])[channel] / plain[channel]
            # of a power to first order
            measured = 1.0 + math.log(model.drive_gain) if (i, channel) == (2, 1) else model.drive_gain
            assert math.isclose(measured, expected, rel_tol=1e-4)


def test_the_gap_that_a_gain_refers_to_is_that_of_the_catalogue() -> None:
    """Two layers have it: a widened interval holds the K of what the diagnosis finds."""
    assert (bent_response.GAP_M, bent_response.MIN_GAP_M) == (
        looming_gain.REFERENCE_GAP_M,
        looming_gain.MIN_GAP_M,
    )
