"""A declared prior helps where data are few, says how much, and is off by default."""

import math

import numpy as np
import pytest

from canid.mathematics.estimators.fopdt import FOPDT, FopdtSettings
from canid.mathematics.identification.fopdt import fopdt_fit, posterior_cells
from canid.mathematics.identification.fopdt.prior import Prior, check_prior, log_density
from canid.values.types import Identifiable

DT = 0.1
# of drivers as published, not of the one in these data (tau2 0.4, theta2 0.2)
USUAL = Prior(tau=0.35, tau_factor=2.0, dead_time=0.3, dead_time_sd=0.2, same_tau=0.25, same_dead_time=0.15)


def test_its_weight_falls_as_data_come(follow):
    """The prior dominates the lags after 30 s of data, and matters little after 10 min."""
    weights = []
    for seconds in (35.0, 600.0):
        y, u = follow(1, seconds=seconds)
        channel = fopdt_fit.fit_process(
            y, u, np.full(len(y), True), DT, fopdt_fit.Settings(prior=USUAL)
        ).channels[1]
        weights.append(channel.prior_weight)
    assert 1.0 >= weights[0] > weights[1] >= 0.0
    assert weights[0] > 0.3
    assert weights[1] < 0.35


def test_without_one_nothing_claims_a_weight(follow):
    """NaN: no prior was declared."""
    y, u = follow(1)
    for channel in fopdt_fit.fit_process(y, u, np.full(len(y), True), DT).channels:
        assert math.isnan(channel.prior_weight)


def test_a_wrong_belief_gives_way_to_data(follow):
    """A belief two sd off moves ten minutes of data by less than their interval."""
    y, u = follow(2, seconds=600.0)
    wrong = Prior(tau=1.5, tau_factor=2.0, dead_time=0.8, dead_time_sd=0.3)
    plain = fopdt_fit.fit_process(y, u, np.full(len(y), True), DT).channels[1]
    biased = fopdt_fit.fit_process(y, u, np.full(len(y), True), DT, fopdt_fit.Settings(prior=wrong)).channels[
        1
    ]
    assert plain.status in (Identifiable.OK, Identifiable.SUM_ONLY)
    half = (plain.tau_plus_dead_time.high - plain.tau_plus_dead_time.low) / 2
    assert abs(biased.tau_plus_dead_time.value - plain.tau_plus_dead_time.value) < half
    assert abs(biased.K.value / plain.K.value - 1) < 0.05


def test_a_tie_alone_draws_the_channels_together(follow):
    """`same_tau` needs nothing else, and makes the two lags more alike."""
    y, u = follow(4, seconds=120.0)
    free = fopdt_fit.fit_process(y, u, np.full(len(y), True), DT).point
    tied = fopdt_fit.fit_process(
        y, u, np.full(len(y), True), DT, fopdt_fit.Settings(prior=Prior(same_tau=0.05))
    ).point
    assert abs(tied.tau[0] - tied.tau[1]) < min(0.1, abs(free.tau[0] - free.tau[1]))


@pytest.mark.parametrize(
    ("prior", "says"),
    [
        (Prior(tau=-0.1, tau_factor=2.0), "tau = -0.1"),
        (Prior(tau=0.3), "tau and tau_factor"),
        (Prior(dead_time=0.3), "dead_time and dead_time_sd"),
        (Prior(dead_time=-0.1, dead_time_sd=0.2), "dead_time = -0.1"),
        (Prior(same_tau=0.0), "same_tau = 0"),
    ],
)
def test_a_prior_that_makes_no_sense_is_refused(prior, says):
    """At once, by number."""
    with pytest.raises(ValueError, match=says):
        check_prior(prior)
    with pytest.raises(ValueError, match=says):
        FOPDT.make(("range_rate",), 0.1, FopdtSettings(prior=prior))


def test_the_density_is_that_of_its_words():
    """Log-normal, normal, and normal differences, at a few points by hand."""
    cells = [
        posterior_cells.Cells(
            np.array([0.2, 0.8]), np.array([0.1, 0.5]), np.ones(2), (0.1, 0.1), np.ones(2), np.ones(2)
        )
        for _ in range(2)
    ]
    log = log_density(USUAL, cells)
    by_hand = -0.5 * (
        (math.log(0.2 / 0.35) / math.log(2)) ** 2
        + (math.log(0.8 / 0.35) / math.log(2)) ** 2
        + ((0.1 - 0.3) / 0.2) ** 2
        + ((0.5 - 0.3) / 0.2) ** 2
        + ((0.2 - 0.8) / 0.25) ** 2
        + ((0.1 - 0.5) / 0.15) ** 2
    )
    assert log.shape == (2, 2)
    assert abs(log[0, 1] - by_hand) < 1e-9
