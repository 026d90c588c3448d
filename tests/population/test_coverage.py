"""The sampler has the textbook's distributions, and units, names and the order of drives change nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import wishart

from canid.mathematics.population import covariance_prior, gibbs, scaling
from canid.mathematics.population.drive_table import drive_table, known, rows
from canid.mathematics.population.hierarchical import pool
from canid.values.types import Array
from tests.plants.many_fleets import Layout, draw, sampler_data, tables
from tests.population.exact_posterior import exact
from tests.seeds import mostly

# by which two runs of one table may differ, in widths of an interval: five standard errors of a difference of two medians
# of 800 independent draws, 1.25 sqrt(2 / 800) sd each; of the 2,880 draws of a run each counts for a third
SAME = 5.0 * 1.25 * (2.0 / 800.0) ** 0.5 / 3.92
# ends of intervals from exact ones, in half widths: it was 0.05 at most in 5 times 4 fleets; an end is known to 0.1 sd
MOST_APART = 0.1


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_chains_with_data_of_their_own_are_the_same_as_alone(seed: int) -> None:
    """The test bench's vectorised fleets say what each fleet says by `pool`, up to the scatter of draws."""
    of = draw(np.random.default_rng(seed), Layout("", 8, 4, 2, 1.0, 0.4), 2)
    data, centre, unit = sampler_data(of)
    draws = gibbs.sample(data, np.random.default_rng(1), 200, 1500)
    mean = np.median(draws.mean[:, :, 0], axis=0).T * unit + centre
    for r, table in enumerate(tables(of)[:1]):
        alone = pool(table)
        width = alone.mean.high - alone.mean.low
        assert np.all(np.abs(alone.mean.value - mean[:, r]) < SAME * width)


@mostly(0.95)
def test_prior_step_has_its_stationary_distribution(seed: int) -> None:
    """Rescaling leaves the posterior as it is: with and without it a chain has the same distribution of W.

    Deviations known exactly; the posterior of the plain step is then half-t times inverse Wishart, sampled here by scipy.
    """
    rng, chains = np.random.default_rng(seed), 4000
    u = rng.standard_normal((2, 12))
    scatter = np.tile(u @ u.T, (chains, 1, 1))
    within = np.tile(np.eye(2), (chains, 1, 1))
    for _ in range(30):
        within = covariance_prior.draw(rng, within, scatter, np.full(chains, 12.0), 1.0)
    # textbook: a by inverse gamma, W by scipy's Wishart
    w = np.eye(2)
    out = []
    for _ in range(2000):
        a = [(0.5 * (2.0 + 2.0), 2.0 * np.linalg.inv(w)[k, k] + 1.0) for k in range(2)]
        inverse_a = np.array([rng.gamma(shape) / rate for shape, rate in a])
        w = np.linalg.inv(
            wishart(3.0 + 12.0, np.linalg.inv(u @ u.T + 4.0 * np.diag(inverse_a))).rvs(random_state=rng)
        )
        out.append(w)
    ours, theirs = np.log(within[:, 0, 0]), np.log(np.array(out)[:, 0, 0])
    assert abs(ours.mean() - theirs.mean()) < 4.0 * theirs.std() / np.sqrt(1000)
    assert abs(ours.std() / theirs.std() - 1.0) < 0.12


def reml(y: Array, v: Array, who: Array) -> tuple[float, float, float, float]:
    """Textbook restricted likelihood of one parameter (Searle, Casella & McCulloch 1992, section 6.6): mean, se, B, W."""
    z = (who[:, None] == np.unique(who)[None, :]).astype(float)
    one = np.ones(len(y))

    def at(log_variances: Array) -> tuple[float, float, float]:
        between, within = np.exp(log_variances)
        cov = np.diag(v + within) + between * z @ z.T
        inverse = np.linalg.inv(cov)
        information = float(one @ inverse @ one)
        mean = float(one @ inverse @ y) / information
        r = y - mean
        minus = float(np.linalg.slogdet(cov)[1]) + float(np.log(information)) + float(r @ inverse @ r)
        return minus, mean, information**-0.5

    best = minimize(lambda x: at(x)[0], np.log([0.5, 0.5]), method="Nelder-Mead", options={"xatol": 1e-4})
    _, mean, se = at(best.x)
    return mean, se, float(np.exp(0.5 * best.x[0])), float(np.exp(0.5 * best.x[1]))


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_agrees_with_restricted_likelihood_where_drivers_are_many(seed: int) -> None:
    """Of 40 drivers with 4 drives both routes give the same mean, error of the mean, and spreads.

    Over eight fleets, root mean square: each route has a random error that the other one has not, as the pool is robust
    against outliers, which costs some per cent of efficiency. It was 0.08 to 0.11 in 40 fleets, 0.45 in the worst one.
    """
    rng = np.random.default_rng(seed)
    who = np.repeat(np.arange(40), 4)
    out = []
    for _ in range(8):
        v = rng.uniform(0.05, 0.3, 160) ** 2
        y = rng.normal(5.0, 1.0, 40)[who] + rng.normal(0.0, 0.4, 160) + np.sqrt(v) * rng.standard_normal(160)
        mean, se, between, within = reml(y, v, who)
        of = pool(drive_table(("K",), y[:, None], v[:, None], tuple(f"d{k}" for k in who)))
        half = [0.5 * float(spread.high[0] - spread.low[0]) for spread in (of.between, of.within)]
        out.append(
            [
                (of.mean.value[0] - mean) / se,
                of.mean.covariance[0, 0] ** 0.5 / se - 1.0,
                (of.between.value[0] - between) / half[0],
                (of.within.value[0] - within) / half[1],
            ]
        )
    assert np.all(np.sqrt(np.mean(np.square(out), axis=0)) < 0.25)


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_agrees_with_the_exact_posterior_where_drivers_are_few(seed: int) -> None:
    """Of 6 drivers with 4 drives, where none of either is an outlier: both ends of all intervals.

    Over four fleets, root mean square. Outliers, of which the exact posterior has none, widen the interval of the spread
    within a driver by 5 to 10 % (`python -m benchmarks pooling_peers`).
    """
    rng, who = np.random.default_rng(seed), np.repeat(np.arange(6), 4)
    apart = []
    for _ in range(4):
        sd = rng.uniform(0.1, 0.5, 24)
        y = rng.normal(5.0, 1.0, 6)[who] + rng.normal(0.0, 0.4, 24) + sd * rng.standard_normal(24)
        table = drive_table(("K",), y[:, None], sd[:, None] ** 2, tuple(f"d{k}" for k in who))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(gibbs, "SHARE_OUTLIER", (1.0, 1e9))
            of = pool(table)
        unit = float(scaling.units(table, known(table)).size[0])
        drawn = exact(y, sd**2, who, (gibbs.SCALE[0] * unit, gibbs.SCALE[1] * unit), seed)
        row = []
        for ours, draws in zip((of.mean, of.between, of.within, of.driver), drawn, strict=True):
            low, high = np.quantile(draws.reshape(len(draws), -1), (0.025, 0.975), axis=0)
            moved = np.abs(ours.low.ravel() - low) + np.abs(ours.high.ravel() - high)
            row.append(float(np.mean(moved / (high - low))))
        apart.append(row)
    assert np.all(np.sqrt(np.mean(np.square(apart), axis=0)) < MOST_APART), apart


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_shrinks_as_the_normal_model_does(seed: int) -> None:
    """A driver with hardly known drives has the population's mean, one with well known drives his or her own."""
    rng = np.random.default_rng(seed)
    truth = rng.normal(0.0, 1.0, 30)
    sd = np.where(np.arange(30) < 15, 0.05, 5.0)
    who = np.repeat(np.arange(30), 3)
    y = truth[who] + rng.normal(0.0, 0.1, 90) + sd[who] * rng.standard_normal(90)
    of = pool(drive_table(("K",), y[:, None], sd[who, None] ** 2, tuple(f"d{k}" for k in who)))
    assert np.all(of.shrinkage[:15, 0] < 0.1)
    assert np.all(of.shrinkage[15:, 0] > 0.7)
    error = of.driver.value[:, 0] - truth
    own = np.array([y[who == k].mean() for k in range(30)]) - truth
    assert np.mean(error[15:] ** 2) < 0.5 * np.mean(own[15:] ** 2)


@pytest.mark.slow("fleets drawn many times")
def test_units_and_names_change_nothing(seed: int) -> None:
    """The same drives in other units, and under other names, have the same results to the last bit."""
    (table,) = tables(draw(np.random.default_rng(seed), Layout("", 6, 3, 2, 1.0, 0.4), 1))
    other = table._replace(drivers=tuple(reversed(table.drivers)), drives=table.drives[::-1])
    # a power of two, by which no digit is lost
    other = other._replace(estimate=table.estimate * 2.0**20, covariance=table.covariance * 2.0**40)
    a, b = pool(table), pool(other)
    for x, y in (
        (a.mean.value, b.mean.value),
        (a.driver.high, b.driver.high),
        (a.within.value, b.within.value),
    ):
        assert np.all(x * 2.0**20 == y)


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_order_changes_nothing_but_the_draws(seed: int) -> None:
    """Drives in another order have the same results up to the scatter of draws."""
    rng = np.random.default_rng(seed)
    (table,) = tables(draw(rng, Layout("", 10, 4, 2, 1.0, 0.4), 1))
    order = rng.permutation(len(table.drives))
    a, b = pool(table), pool(rows(table, order))
    width = a.driver.high - a.driver.low
    assert np.all(np.abs(a.driver.value - b.driver.value) < SAME * width)
    # NaN of both: a drive whose estimates are all missing
    assert np.array_equal(np.isnan(a.drive_outlier[order]), np.isnan(b.drive_outlier))
    assert np.nanmean(np.abs(a.drive_outlier[order] - b.drive_outlier)) < 0.03


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_thousands_of_drives_find_the_truth(seed: int) -> None:
    """Of 300 drivers with 4 drives the spreads are known to some percent, and the true ones are within 4 standard errors."""
    (table,) = tables(draw(np.random.default_rng(seed), Layout("", 300, 7, 3, 1.0, 0.4), 1))
    of = pool(table)
    # standard errors: sd / sqrt(2 degrees of freedom), 0.045 of 300 drivers, 0.016 of 1,800 drives with sampling errors as
    # large as their spread; four of them, and a tenth for estimates that are missing
    assert np.all(np.abs(of.between.value - 1.0) < 0.2)
    assert np.all(np.abs(of.within.value - 0.4) < 0.08)
    assert np.all(np.isfinite(of.driver.value))
