"""A population's prior narrows a new driver's first minute, and holds what it is about."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.mathematics.estimators.fopdt import FOPDT
from canid.mathematics.estimators.fopdt_whole_drive import Fitting
from canid.mathematics.estimators.whole_drive import settings_of
from canid.mathematics.identification.fopdt.prior import Prior, check_prior
from canid.mathematics.population.drive_table import drive_table
from canid.mathematics.population.hierarchical import pool
from canid.mathematics.population.population_prior import SAME_DELAYS_SD_S, prior_of
from canid.values.types import Channel, Trace
from tests.plants import plant_one
from tests.plants.measurement import trace
from tests.seeds import mostly

NAMES = ("headway_error.K", "range_rate.K", "range_rate.log_tau_plus_dead_time")
# hidden from what estimates: mean and spread of drivers
MEAN, SD = np.array([6.0, 5.6, math.log(0.8)]), np.array([1.3, 1.0, 0.2])
# errors of what a fleet knows of one drive of each
ERROR = np.array([0.8, 0.3, 0.08])


def fitted(of: Trace, prior: Prior | None) -> dict[str, Channel]:
    """The channels of a trace as one window."""
    s = settings_of(FOPDT, of, {})
    how = Fitting(s.tau_max, s.dead_time_max, prior, s.output_filter)
    return dict(zip(of.input_names, how.fit(of, slice(None)).channels, strict=True))


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_a_new_drivers_first_minute(seed: int) -> None:
    """Eight held-out drivers: K1, K2 and τ2+θ2 after 60 s to 0.8 of the width in the median, 19 of 24 hold the truth."""
    rng = np.random.default_rng(seed)
    drivers = MEAN + SD * rng.standard_normal((28, 3))
    known = drivers[:20] + ERROR * rng.standard_normal((20, 3))
    table = drive_table(NAMES, known, np.tile(ERROR**2, (20, 1)), tuple(f"driver {k}" for k in range(20)))
    found = pool(table)
    prior = prior_of(NAMES, found.new_driver.value, found.new_driver.covariance)
    assert prior is not None
    check_prior(prior)
    ratio, held = [], []
    for k, (K1, K2, log_sum) in enumerate(drivers[20:].tolist()):
        share = rng.uniform(0.4, 0.6)
        delays = {"tau2": share * math.exp(log_sum), "dead_time2": (1.0 - share) * math.exp(log_sum)}
        noise = ("white", "ar1", "ar4", "resonant")[k % 4]
        how = {"seed": seed + k, "minutes": 1.0, "noise": noise, "profile": "mixed"}
        planted = plant_one.plant({}, **how, K1=max(K1, 1.5), K2=K2, **delays)
        first = trace(planted)
        without, with_prior = fitted(first, None), fitted(first, prior)
        truths = (("headway_error", "K", max(K1, 1.5)), ("range_rate", "K", K2))
        for channel, parameter, truth in (*truths, ("range_rate", "tau_plus_dead_time", math.exp(log_sum))):
            a, b = getattr(without[channel], parameter), getattr(with_prior[channel], parameter)
            ratio.append((b.high - b.low) / (a.high - a.low))
            held.append(b.low < truth < b.high)
    assert np.median(ratio) < 0.8
    assert sum(held) >= 19


def test_the_prior_states_the_predictive_distribution() -> None:
    """Means, standard deviations and correlation; delays that nobody knows are tied to those of the other response."""
    covariance = np.diag([4.0, 0.25, 0.04])
    covariance[0, 1] = covariance[1, 0] = 0.3
    made = prior_of(NAMES, np.array([6.0, 5.5, math.log(0.8)]), covariance)
    assert made is not None
    assert (made.headway_error.K, made.headway_error.K_sd) == (6.0, 2.0)
    assert (made.range_rate.K, made.range_rate.K_sd) == (5.5, 0.5)
    assert made.range_rate.tau_plus_dead_time == pytest.approx(0.8)
    assert made.range_rate.tau_plus_dead_time_factor == pytest.approx(math.exp(0.2), rel=1e-3)
    assert made.gain_correlation == 0.3
    assert made.same_tau == made.same_dead_time == SAME_DELAYS_SD_S
    check_prior(made)


@pytest.mark.parametrize("known", [(0,), (1,), (2,), (0, 2), ()])
def test_what_is_not_known_is_not_stated(known: tuple[int, ...]) -> None:
    """NaN of a parameter leaves it to the box; of all, there is no prior."""
    value = np.full(3, np.nan)
    value[list(known)] = MEAN[list(known)]
    made = prior_of(NAMES, value, np.diag(SD**2))
    assert (made is None) == (not known)
    if made is not None:
        check_prior(made)
        assert math.isnan(made.gain_correlation)


def test_extremes_stay_what_a_vehicle_file_may_state() -> None:
    """Spreads of nothing or beyond all bounds, perfect correlation, negative dead times."""
    names = ("headway_error.K", "range_rate.K", "range_rate.log_tau_plus_dead_time", "range_rate.dead_time")
    for scale in (1e-12, 1.0, 1e12):
        sd = np.sqrt(scale) * np.ones(4)
        covariance = np.outer(sd, sd)
        made = prior_of(names, np.array([5.0, 5.0, 30.0, -0.3]), covariance)
        assert made is not None
        check_prior(made)
        assert made.range_rate.dead_time == 0.0
        assert made.gain_correlation == 0.95
