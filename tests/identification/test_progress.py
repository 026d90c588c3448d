"""The forecast of how much more driving would do, against what it takes where information comes otherwise than simulated."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.mathematics.identification import identifiability
from canid.mathematics.identification.first_order import scan
from canid.mathematics.identification.fopdt.fopdt_fit import Settings, fit_process
from canid.values.types import Identifiable, Interval, OutputFilter, Progress

NO_BOX = (math.inf, math.inf, math.inf, math.inf)
K = Interval(5.0, 4.0, 6.0)


def of_dead_time(sd: float, used: float) -> Progress:
    """The forecast where dead time alone is missing."""
    made = identifiability.progress(Identifiable.SUM_ONLY, K, (0.1, 0.01, sd, 0.01), NO_BOX, used)
    assert made is not None
    assert made.parameter == "dead_time"
    return made


@pytest.mark.parametrize("used", [20.0, 60.0, 600.0, 3600.0])
@pytest.mark.parametrize("ratio", [1.0, 1.3, 2.0, 5.0, 30.0])
def test_the_total_is_the_median_of_its_distribution(used: float, ratio: float) -> None:
    """Against draws: normal in the logarithm, those that would be over already rejected."""
    spread = (identifiability.BURST_S / used) ** 0.5
    drawn = math.log(ratio) + spread * np.random.default_rng(0).normal(size=200_000)
    expected = np.median(drawn[drawn > 0.0])
    assert math.log(identifiability.median_of_total(ratio, used)) == pytest.approx(
        expected, abs=0.02 * spread
    )


@pytest.mark.parametrize("ratio", [2.0, 8.0])
def test_a_long_even_drive_is_extrapolated_by_its_rate(ratio: float) -> None:
    sd = identifiability.DEAD_TIME_SD * ratio**0.5
    assert of_dead_time(sd, 3600.0).seconds == pytest.approx(3600.0 * (ratio - 1.0), rel=0.02)


def test_short_of_the_goal_is_never_as_good_as_there() -> None:
    """Just above the limit, a share of the time so far remains, less of it after a longer drive."""
    sd = 1.0001 * identifiability.DEAD_TIME_SD
    shares = [of_dead_time(sd, used).seconds / used for used in (20.0, 60.0, 600.0, 3600.0)]
    assert shares == sorted(shares, reverse=True)
    assert 0.05 < shares[-1] < 0.1 < 0.5 < shares[0] < 1.5


@pytest.mark.parametrize(("gap", "least"), [(3.0, 0.97), (8.0, 0.91), (15.0, 0.82), (40.0, 0.62)])
def test_where_information_comes_at_random_times(gap: float, least: float) -> None:
    """Manoeuvres at the times of a Poisson process, each worth an exponential draw: forecasts at half of the way."""
    rng = np.random.default_rng(3)
    good = []
    for _ in range(2000):
        times = np.cumsum(rng.exponential(gap, 2000))
        known = np.cumsum(rng.exponential(size=2000))
        # s; at a constant rate the goal is reached after 100 to 1000 s
        goal = rng.uniform(100.0, 1000.0) / gap
        end = float(times[np.searchsorted(known, goal)])
        so_far = float(known[max(int(np.searchsorted(times, 0.5 * end)) - 1, 0)])
        forecast = of_dead_time(identifiability.DEAD_TIME_SD * (goal / so_far) ** 0.5, 0.5 * end).seconds
        good.append(0.5 <= forecast / (0.5 * end) <= 2.0)
    assert np.mean(good) > least


def test_a_gain_is_forecast_whatever_the_lag_does() -> None:
    """That an interval of tau ends in the box keeps tau from being quoted, not the gain."""
    for free in (True, False):
        made = identifiability.progress(
            Identifiable.NOT, Interval(2.0, -1.0, 5.0), (1.0, 0.8, 0.4, 0.9), NO_BOX, 60.0, free
        )
        assert made is not None
        assert made.parameter == "K"
        assert 30.0 < made.seconds < 180.0
    made = identifiability.progress(Identifiable.GAIN_ONLY, K, (0.1, 0.8, 0.4, 0.9), NO_BOX, 60.0, False)
    assert made is not None
    assert math.isnan(made.seconds)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_a_gains_forecast_does_not_depend_on_its_unit(unit: float) -> None:
    """Nor does it grow without limit where the estimate happens to be zero, or differ with the sign."""
    seconds = []
    for value in (-2.0, 1e-9, 0.5, 1.0, 2.0, 2.9):
        gain = Interval(unit * value, -9.0 * unit, 9.0 * unit)
        made = identifiability.progress(Identifiable.NOT, gain, (unit, 0.8, 0.4, 0.9), NO_BOX, 60.0)
        assert made is not None
        seconds.append(made.seconds)
    assert seconds[1:] == sorted(seconds[1:], reverse=True)
    assert seconds[0] == pytest.approx(seconds[4])
    assert seconds[1] < 20.0 * 60.0


@pytest.mark.parametrize("sd", [0.0, math.nan, math.inf])
def test_an_sd_that_is_none_gives_no_forecast(sd: float) -> None:
    made = identifiability.progress(
        Identifiable.NOT, Interval(2.0, -1.0, 5.0), (sd, sd, sd, sd), NO_BOX, 60.0
    )
    assert made is None


@pytest.mark.slow("fits many drives")
def test_on_fits_of_another_plant() -> None:
    """Open loop, pulses of random length at random times, Laplace noise: at half of the way, most within a factor of 2."""
    found = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        u = np.zeros(9000)
        for start in np.flatnonzero(rng.random(len(u)) < 0.1 / 10.0):
            u[start : start + rng.integers(10, 50)] += rng.normal()
        u = scan(0.3 * u, np.array([0.7])) + 0.02 * rng.normal(size=len(u))
        pole = math.exp(-0.1 / 0.5)
        y = 3.0 * scan((1.0 - pole) * np.roll(u, 4), np.array([pole])) + 0.8 * rng.laplace(size=len(u))

        def at(t: float, y: np.ndarray = y, u: np.ndarray = u) -> tuple[Identifiable, Progress | None]:
            n = round(t / 0.1)
            channel = fit_process(
                y[:n], u[:n, None], np.full(n, True), 0.1, Settings(output_filter=OutputFilter("none"))
            ).channels[0]
            return channel.status, channel.progress

        times = 30.0 * 1.25 ** np.arange(15)
        reached = [at(t)[0] is Identifiable.OK for t in times]
        end = next(
            (float(t) for t, *there in zip(times, reached, reached[1:], strict=False) if all(there)), math.nan
        )
        status, missing = at(0.5 * end) if end > 60.0 else (Identifiable.OK, None)
        if status is Identifiable.SUM_ONLY and missing is not None:
            found.append(missing.seconds / (0.5 * end))
    assert len(found) >= 3
    assert np.mean([0.5 <= ratio <= 2.0 for ratio in found]) >= 0.6, found
