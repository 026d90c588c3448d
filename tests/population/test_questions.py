"""Wrong labels, changes, groups and pairs are found where they are, and where nothing is nothing is called a discovery."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.stats import binomtest, multivariate_normal

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.population.change_over_time import WEEK_S, change_over_time
from canid.mathematics.population.drive_forecast import forecasts
from canid.mathematics.population.drive_table import DriveTable, drive_table, rows
from canid.mathematics.population.false_discovery import adjusted
from canid.mathematics.population.groups import contrasts
from canid.mathematics.population.hierarchical import Population, pool
from canid.mathematics.population.pooled_causes import Diagnosed, pooled_causes, random_effects_mean
from canid.mathematics.population.same_driver import drives_fit, pairs
from canid.values.types import Array, Interval
from tests.seeds import mostly

DRIVERS, DRIVES = 12, 6
WITHIN = np.array([[0.16, 0.05], [0.05, 0.09]])


def fleet(seed: int, between: float) -> tuple[DriveTable, Array]:
    """12 drivers with 6 drives each over 20 weeks; the drivers' true means."""
    rng = np.random.default_rng(seed)
    n = DRIVERS * DRIVES
    mean = between * rng.standard_normal((DRIVERS, 2))
    sd = 0.2 * np.exp(0.4 * rng.standard_normal((n, 2)))
    who = np.repeat(np.arange(DRIVERS), DRIVES)
    y = (
        mean[who]
        + multivariate_normal(np.zeros(2), WITHIN).rvs(n, random_state=rng)
        + sd * rng.standard_normal((n, 2))
    )
    names = tuple(f"driver {k}" for k in who)
    weeks = np.tile(np.linspace(0.0, 20.0, DRIVES), DRIVERS) + rng.uniform(0.0, 1.0, n)
    return drive_table(("K", "tau"), y, sd**2, names, start=weeks * WEEK_S), mean


@cache
def one_person(seed: int) -> tuple[DriveTable, Population]:
    table, _ = fleet(seed, 0.0)
    return table, pool(table)


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_one_person_labelled_as_twelve_is_not_separated(seed: int) -> None:
    """No pair differs, no drive misfits, nobody changes, no group differs, and the spread between drivers may be 0."""
    table, of = one_person(seed)
    assert np.all(of.between.low == 0.0)
    assert np.all(of.between.high < 0.6)
    assert not pairs(table, of).different.any()
    assert not drives_fit(table, of).misfit.any()
    assert not change_over_time(table, of).changed.any()
    labels = tuple(np.random.default_rng(seed).choice(["a", "b", "c"], len(table.drives)).tolist())
    assert not contrasts(table, labels).different.any()


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_p_values_of_one_person_are_not_too_small(seed: int) -> None:
    """Below 5 % are no more than chance allows: of 72 drives left out, 12 drivers over time."""
    table, of = one_person(seed)
    for p in (drives_fit(table, of).p_value, change_over_time(table, of).p_value):
        assert binomtest(int(np.sum(p < 0.05)), len(p), 0.05, alternative="greater").pvalue > 0.02


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_plants_are_found_and_nothing_else(seed: int) -> None:
    """A drive under another driver's name, and a driver who changes: both found, with the right names and numbers."""
    table, mean = fleet(seed, 1.5)
    # the two drivers that are furthest apart; a change of 2.5 standard deviations of a drive over the time
    apart = np.linalg.norm(mean[:, None] - mean[None, :], axis=-1)
    a, b = (int(k) for k in np.unravel_index(np.argmax(apart), apart.shape))
    driver = table.driver.copy()
    driver[a * DRIVES] = b
    changer = next(k for k in range(DRIVERS) if k not in (a, b))
    y = table.estimate.copy()
    weeks = table.start / WEEK_S - 10.0
    y[table.driver == changer, 0] += 0.2 * weeks[table.driver == changer]
    table = table._replace(driver=driver, estimate=y)
    of = pool(table)
    fit = drives_fit(table, of)
    assert fit.misfit[a * DRIVES]
    # another driver may be as near as the right one, but not the one whose name it has
    assert fit.closest[a * DRIVES] != b
    others = np.delete(fit.misfit, [a * DRIVES, *range(changer * DRIVES, changer * DRIVES + DRIVES)])
    assert others.sum() <= 1
    change = change_over_time(table, of)
    assert change.changed[changer]
    assert change.low[changer, 0] < 0.2 < change.high[changer, 0]
    assert change.changed.sum() <= 2
    assert pairs(table, of).different.mean() > 0.5


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_groups_differ_where_they_do(seed: int) -> None:
    """A setting that shifts the gain by 0.6 within drivers is found though drivers spread 2.5 times as much."""
    table, _ = fleet(seed, 1.5)
    setting = np.random.default_rng(seed).integers(0, 2, len(table.drives))
    labels = tuple(np.where(setting > 0, "long", "short").tolist())
    shifted = table._replace(estimate=table.estimate + 0.6 * setting[:, None] * np.array([1.0, 0.0]))
    of = contrasts(shifted, labels)
    assert of.groups == ("long", "short")
    assert of.different[0]
    assert of.low[0, 0] < -0.6 < of.high[0, 0]
    assert of.high[0, 0] - of.low[0, 0] < 0.7
    assert of.low[0, 1] < 0.0 < of.high[0, 1]
    # by chance a driver has one setting in all six drives
    both = sum(len(set(setting[table.driver == k].tolist())) == 2 for k in range(DRIVERS))
    assert f"{both} drivers drive both" in of.status[0]


@pytest.mark.slow("whole drives through the pipeline")
def test_groups_of_different_drivers_have_the_spread_between_drivers_as_error(seed: int) -> None:
    """Two groups with two drivers each say nothing, however many drives they have, and the status says so."""
    table, _ = fleet(seed, 1.5)
    few = rows(table, table.driver < 4)
    of = contrasts(few, tuple("ab"[k // 2] for k in few.driver))
    assert not of.different[0]
    assert of.high[0, 0] - of.low[0, 0] > 2.0
    assert "no driver drives both" in of.status[0]
    assert "few" not in of.status[0]
    assert "say little" in of.status[0]


@pytest.mark.slow("fleets drawn many times")
@mostly(0.95)
def test_the_p_value_of_a_pair_is_bonferronis(seed: int) -> None:
    """Of the clearest parameter: their joint distance is too sure where the spread between drivers is hardly known."""
    table, _ = fleet(seed, 1.5)
    of = contrasts(table, tuple("abc"[k % 3] for k in table.driver))
    np.testing.assert_allclose(of.p_value, np.minimum(1.0, 2.0 * of.each.min(axis=1)))


@pytest.mark.slow("fleets drawn many times")
def test_what_is_not_identifiable_is_said(seed: int) -> None:
    """One driver, one drive each, nothing at all: NaN where nothing is known, and a status that says what to do."""
    table, _ = fleet(seed, 1.0)
    alone = pool(rows(table, table.driver == 3))
    assert np.isnan(alone.between.value).all()
    assert np.isnan(alone.new_driver.value).all()
    assert np.isfinite(alone.within.value).all()
    assert all("one driver" in x for x in alone.status)
    assert np.isnan(alone.driver.value[0]).all()
    single = rows(table, np.arange(0, DRIVERS * DRIVES, DRIVES))
    each = pool(single)
    assert all("cannot be separated" in x for x in each.status)
    assert np.isnan(each.within.value).all()
    assert np.isnan(each.between.value).all()
    assert all("only drive" in x for x in drives_fit(single, each).status)
    compared = pairs(single, each)
    assert not len(compared.different)
    assert "one drive per driver" in compared.says[0]
    nothing = table._replace(estimate=np.full_like(table.estimate, np.nan))
    of = pool(nothing)
    assert np.isnan(of.mean.value).all()
    assert of.status == ("no drive knows it",) * 2
    assert len(pairs(nothing, of).p_value) == 0
    assert forecasts(nothing, of) == ()
    half = table._replace(estimate=np.where([True, False], table.estimate, np.nan))
    partly = pool(half)
    assert np.isfinite(partly.new_driver.value).tolist() == [True, False]
    assert partly.status[1] == "no drive knows it"
    of_K = half._replace(names=("K",), estimate=half.estimate[:, :1], covariance=half.covariance[:, :1, :1])
    # a parameter that nobody knows changes nothing of the others
    assert np.array_equal(partly.mean.value[:1], pool(of_K).mean.value)


@mostly(0.95)
def test_a_misplaced_drive_finds_its_driver_by_the_parameters_that_are_predicted(seed: int) -> None:
    """Also where it knows one that a single drive of each driver knows."""
    rng = np.random.default_rng(seed)
    who = np.repeat(np.arange(6), 5)
    y = np.stack([3.0 + who, np.where(np.arange(30) % 5 == 0, 1.0, np.nan)], axis=1)
    y += 0.1 * rng.standard_normal(y.shape)
    y[10, 0] = 8.0  # of driver 2, driven by driver 5
    table = drive_table(("K", "tau"), y, np.full((30, 2), 0.1**2), tuple(f"driver {k}" for k in who))
    fit = drives_fit(table, pool(table))
    assert np.flatnonzero(fit.misfit).tolist() == [10]
    assert table.drivers[int(fit.closest[10])] == "driver 5"


@mostly(0.95)
def test_a_parameter_that_one_drive_of_each_driver_knows_has_neither_spread(seed: int) -> None:
    """Whatever the other parameters' drives show: its two spreads are one, and what would be stated is their prior."""
    rng = np.random.default_rng(seed)
    who = np.repeat(np.arange(8), 4)
    truth = rng.normal(1.0, 0.3, 8)[who, None] + rng.normal(0.0, 0.1, (32, 2))
    y = truth + rng.normal(0.0, 0.05, (32, 2))
    y[np.arange(32) % 4 != 0, 1] = np.nan
    table = drive_table(("K", "tau"), y, np.full((32, 2), 0.05**2), tuple(f"driver {k}" for k in who))
    of = pool(table)
    assert of.between.low[0] < 0.3 < of.between.high[0]
    assert np.isfinite([of.within.value[0], of.mean.value[1], of.new_driver.value[1]]).all()
    assert np.isfinite(of.driver.value).all()
    for spread in (of.between, of.within):
        assert np.isnan([spread.value[1], spread.low[1], spread.high[1], spread.covariance[0, 1]]).all()
    assert "one drive per driver" in of.status[1]
    assert not of.status[0]
    assert np.isfinite(drives_fit(table, of).p_value).all()
    assert np.isfinite(pairs(table, of).p_value).all()
    assert {forecast.parameter for forecast in forecasts(table, of)} == {"K"}


def test_false_discovery_rate_is_the_textbooks(seed: int) -> None:
    """Adjusted p-values call the same discoveries as the step-up procedure of Benjamini & Hochberg 1995."""
    p = np.random.default_rng(seed).uniform(size=200) ** 3
    p[::7] = np.nan
    for dependent in (False, True):
        of = adjusted(p, dependent=dependent)
        tested = np.sort(p[np.isfinite(p)])
        m = len(tested)
        factor = float(np.sum(1.0 / np.arange(1, m + 1))) if dependent else 1.0
        for rate in (0.01, 0.05, 0.2):
            passed = np.flatnonzero(tested <= np.arange(1, m + 1) / m * rate / factor)
            limit = tested[passed[-1]] if len(passed) else -1.0
            assert np.array_equal(np.nan_to_num(of, nan=1.0) <= rate, np.nan_to_num(p, nan=1.0) <= limit)
    assert adjusted(np.array([np.nan])).tolist() != [0.0]


@mostly(0.95)
def test_false_discoveries_stay_below_the_rate(seed: int) -> None:
    """Of 400 families with true and false hypotheses the mean share of false discoveries is at most 5 %."""
    rng = np.random.default_rng(seed)
    share = []
    for _ in range(400):
        z = rng.standard_normal(40) + np.where(np.arange(40) < 10, 3.5, 0.0)
        p = 2.0 * multivariate_normal(0.0, 1.0).cdf(-np.abs(z))
        found = adjusted(p) <= 0.05
        share.append(found[10:].sum() / max(found.sum(), 1))
    # expectation 0.05 * 30 / 40; sd of the mean of 400 is 0.003
    assert np.mean(share) < 0.05


def cases(
    named: int, of: int, drivers: int, effect: str = "delay", detectable: float = 0.1
) -> list[Diagnosed]:
    strength = Interval(0.3, 0.3 - 0.05 * NORMAL_QUANTILE, 0.3 + 0.05 * NORMAL_QUANTILE)
    return [
        Diagnosed(f"{k}", f"driver {k * drivers // of}", "van", effect, k < named, strength, detectable)
        for k in range(of)
    ]


def test_causes_of_many_drives_stand_out_from_false_names() -> None:
    """20 of 40 drives is evidence, 2 of 40 is what false names give; of drives that could not name it none counts."""
    blind = [one._replace(detectable=1.0) for one in cases(0, 30, 6)]
    often, seldom = pooled_causes([*cases(20, 40, 8), *blind, *cases(2, 40, 8, "backlash")])
    assert (often.effect, often.named, often.possible, often.diagnosed) == ("delay", 20, 40, 70)
    assert often.real
    assert not seldom.real
    assert abs(often.strength.value - 0.3) < 1e-9
    assert abs(often.p_value / binomtest(20, 70, 0.05, alternative="greater").pvalue - 1.0) < 1e-9


def test_drives_of_one_driver_are_no_independent_evidence_of_a_rate() -> None:
    """Half of the drivers always, half never: the interval is that of 8 drivers, not of 80 drives."""
    (clustered,) = pooled_causes(cases(40, 80, 8))
    spread_out = [one._replace(driver=f"driver {k % 8}") for k, one in enumerate(cases(40, 80, 8))]
    (independent,) = pooled_causes(spread_out)
    widths = [one.rate.high - one.rate.low for one in (clustered, independent)]
    assert widths[0] > 2.5 * widths[1]
    assert 0.4 < widths[0] < 0.75
    (single,) = pooled_causes(cases(5, 10, 1))
    assert single.rate.high - single.rate.low > 0.7
    assert "1 driver" in single.status


@mostly(0.95)
def test_random_effects_mean_covers(seed: int) -> None:
    """Of 500 sets of 5 estimates with a spread, the 95 % interval of the mean holds the truth in 92 % and more."""
    rng = np.random.default_rng(seed)
    hits = 0
    for _ in range(500):
        sd = rng.uniform(0.1, 0.5, 5)
        x = 1.0 + 0.3 * rng.standard_normal(5) + sd * rng.standard_normal(5)
        of, _ = random_effects_mean(
            [Interval(a, a - 1.959964 * s, a + 1.959964 * s) for a, s in zip(x, sd, strict=True)]
        )
        hits += of.low < 1.0 < of.high
    assert hits / 500 >= 0.92


@pytest.mark.slow("fleets drawn many times")
def test_the_driver_of_one_drive_gains_most_by_another() -> None:
    """What to drive next is the driver of whom least is known, and the promised width is that of the next pool."""
    table, _ = fleet(5, 1.0)
    keep = np.ones(len(table.drives), dtype=bool)
    keep[1:DRIVES] = False
    few = rows(table, keep)
    of = forecasts(few, pool(few))
    assert of[0].driver == "driver 0"
    two = keep.copy()
    two[1] = True
    after = pool(rows(table, two))
    k = table.names.index(of[0].parameter)
    width = float(after.driver.high[0, k] - after.driver.low[0, k])
    assert abs(width / of[0].expected - 1.0) < 0.3


@pytest.mark.long("samples a population")
def test_one_drive_per_driver_is_not_parted(seed: int) -> None:
    """Neither spread is stated, the sampler converges, shrunken drivers and the predicted drive have true intervals."""
    rng = np.random.default_rng(seed)
    true, error = rng.normal(5.0, 1.0, (400, 2)), 0.3
    estimate = true + error * rng.standard_normal(true.shape)
    table = drive_table(
        ("a", "b"), estimate, np.tile(error**2 * np.eye(2), (400, 1, 1)), tuple(map(str, range(400)))
    )
    of = pool(table)
    assert all("one drive per driver" in status for status in of.status)
    assert np.isnan(of.between.value).all()
    assert np.isnan(of.within.value).all()
    assert of.reduction < 1.1
    assert np.mean((of.driver.low < true) & (true < of.driver.high)) == pytest.approx(0.95, abs=0.04)
    assert (of.new_driver.high - of.new_driver.low) / (2 * 1.96) == pytest.approx(1.0, abs=0.15)
    found = pairs(table, of)
    assert not len(found.different)
    assert "one drive per driver" in found.says[0]
