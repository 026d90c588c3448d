"""The mathematics of a comparison against known truths: intervals, several tests at once, drives of one driver, causes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from canid.analysis.comparison import between_drives, causes, difference, multiplicity
from canid.analysis.comparison.comparison import compare
from canid.analysis.comparison.drive import Causes, DriveEstimates, Effect, Quantity, Side
from canid.analysis.comparison.multiplicity import Block
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Interval
from tests.seeds import mostly

# standard errors of a share over so many simulated cases that a correct rate may lie above its nominal one
SIGMAS = 3.5


def above(rate: float, runs: int) -> float:
    """Return the highest share that a true rate gives by chance."""
    return rate + SIGMAS * math.sqrt(rate * (1.0 - rate) / runs)


def estimate(value: float, sd: float) -> Interval:
    return Interval(value, value - NORMAL_QUANTILE * sd, value + NORMAL_QUANTILE * sd)


def drive(quantities: dict[str, Quantity], **more: Any) -> DriveEstimates:
    return DriveEstimates("drive", "identify", "car", "pedal", 300.0, quantities, **more)


def sides(a: DriveEstimates, b: DriveEstimates) -> tuple[Side, Side]:
    return Side("A", (a,)), Side("B", (b,))


@mostly(0.95)
def test_equal_drivers_are_rarely_called_different_whatever_the_correlation(seed: int) -> None:
    """Six correlated parameters without a difference: at least one is named in 5 % of the cases, and not in far fewer where
    the correlation is known; without adjustment in more than 10 %."""
    rng = np.random.default_rng(seed)
    mixing = rng.standard_normal((6, 2))
    covariance = mixing @ mixing.T + 0.2 * np.eye(6)
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    runs = 1200
    z = rng.multivariate_normal(np.zeros(6), correlation, runs)
    critical = [
        multiplicity.critical_value(6, blocks) for blocks in ([Block(tuple(range(6)), correlation)], [])
    ]
    joint, conservative = (float((np.abs(z).max(axis=1) > c).mean()) for c in critical)
    assert conservative <= joint <= above(0.05, runs)
    assert joint > 0.05 - SIGMAS * math.sqrt(0.05 * 0.95 / runs)
    assert float((np.abs(z).max(axis=1) > NORMAL_QUANTILE).mean()) > 0.10
    # step-down p-values name the same cases at the first step
    for row in z[:60]:
        p = multiplicity.adjusted(list(row), [Block(tuple(range(6)), correlation)])
        if abs(float(np.abs(row).max()) - critical[0]) > 0.03:
            assert bool(p.min() < 0.05) == bool(np.abs(row).max() > critical[0])


@mostly(0.95)
def test_skewed_intervals_hold_the_difference(seed: int) -> None:
    """Two lognormal estimates, each with its exact skewed interval: the difference's interval holds the truth in 95 %; it
    excludes 0 exactly where that of the ratio excludes 1."""
    rng = np.random.default_rng(seed)
    runs, sd, truth = 3000, 0.35, (2.0, 3.0)
    held = 0
    for _ in range(runs):
        a, b = (
            Interval(x, x * math.exp(-NORMAL_QUANTILE * sd), x * math.exp(NORMAL_QUANTILE * sd))
            for x in (t * math.exp(sd * rng.standard_normal()) for t in truth)
        )
        of = difference.difference(a, b)
        ratio = difference.ratio(a, b)
        held += of.low <= truth[1] - truth[0] <= of.high
        if math.isfinite(ratio.low) and abs(of.low) > 1e-9 and abs(of.high) > 1e-9:
            assert (of.low > 0.0) == (ratio.low > 1.0)
            assert (of.high < 0.0) == (ratio.high < 1.0)
    assert 1.0 - held / runs <= above(0.05, runs) + 0.01


@pytest.mark.slow("compares many drives")
@mostly(0.95)
def test_the_spread_of_one_driver_is_no_difference(seed: int) -> None:
    """Three drives a side of one driver whose gain varies by 10 % from drive to drive, each known to 3 %: called different
    in 5 %; as if each drive were exact, in more than 25 %. A gain 1.6 times as large is found in most cases."""
    rng = np.random.default_rng(seed)
    runs = 600

    def side(mean: float) -> list[Interval]:
        return [estimate(x, 0.03 * mean) for x in mean * (1 + 0.1044 * rng.standard_normal(3))]

    equal = [between_drives.contrast(side(5.0), side(5.0)) for _ in range(runs)]
    assert np.mean([abs(of.z) > NORMAL_QUANTILE for of in equal]) <= above(0.05, runs)
    naive = [abs(of.b.value - of.a.value) > NORMAL_QUANTILE * 0.15 * math.sqrt(2 / 3) for of in equal]
    assert np.mean(naive) > 0.25
    assert (
        np.mean([abs(between_drives.contrast(side(5.0), side(8.0)).z) > NORMAL_QUANTILE for _ in range(100)])
        > 0.8
    )


def test_units_that_differ_are_not_compared_but_times_are() -> None:
    """A pedal in % against an acceleration: no verdict on K, one on the dead time; a side without the parameter says so."""
    one = drive(
        {
            "range_rate K": Quantity(estimate(5.0, 0.1), "% per m/s"),
            "range_rate dead_time": Quantity(estimate(0.3, 0.02), "s"),
            "range_rate tau": Quantity(estimate(0.5, 0.02), "s"),
        }
    )
    other = drive(
        {
            "range_rate K": Quantity(estimate(0.3, 0.01), "m/s² per m/s"),
            "range_rate dead_time": Quantity(estimate(0.6, 0.02), "s"),
            "range_rate tau": Quantity(Interval(0.9, 0.0, 3.0), "s", "not identifiable"),
        }
    )
    found = compare(*sides(one, other))
    rows = {row.name: row for row in found.rows}
    assert "units differ" in rows["range_rate K"].why
    assert not rows["range_rate K"].differs
    assert rows["range_rate tau"].why == "B: not identifiable"
    assert not rows["range_rate tau"].differs
    assert [row.name for row in found.different] == ["range_rate dead_time"]
    assert compare(*sides(drive({}), other)).verdict == "not_comparable"


@pytest.mark.slow("compares many drives")
@mostly(0.95)
def test_the_detectable_difference_is_found_in_eight_of_ten(seed: int) -> None:
    """Drivers that differ by what the comparison states as detectable are called different in 80 % of the cases."""
    rng = np.random.default_rng(seed)

    def pair(by: float) -> tuple[Side, Side]:
        values = [
            {
                name: Quantity(estimate(5.0 + d * (name == "x") + 0.3 * rng.standard_normal(), 0.3), "")
                for name in "xyz"
            }
            for d in (0.0, by)
        ]
        return sides(drive(values[0]), drive(values[1]))

    size = compare(*pair(0.0)).rows[0].detectable
    found = np.mean([next(r for r in compare(*pair(size)).rows if r.name == "x").differs for _ in range(150)])
    assert abs(found - 0.8) < SIGMAS * math.sqrt(0.16 / 150)


def test_a_cause_of_one_side_differs_only_where_the_other_excludes_it() -> None:
    """Found in A: B differs where it would have named a weaker one; not where it is not testable, nearly as strong, hidden
    by a rival, or where B's own model failed."""

    def diagnosed(
        effects: tuple[Effect, ...] = (),
        verdict: str = "adequate",
        shown: float = 0.5,
        hidden: tuple[str, ...] = (),
    ) -> DriveEstimates:
        of = Causes(verdict, effects, {"backlash": ("width", shown, "m/s")}, frozenset(hidden))
        return drive({}, causes=of)

    width = {"width": Quantity(Interval(1.0, 0.8, 1.2), "m/s")}
    a = diagnosed((Effect("backlash", "driver", ("dead_zone",), False, width),), "named")
    rival = diagnosed((Effect("dead_zone", "driver", (), False, {}),), "named")

    def judged(b: DriveEstimates) -> bool | None:
        return next(c.differs for c in causes.compare(*sides(a, b)) if c.effect == "backlash")

    assert judged(diagnosed()) is True
    assert judged(diagnosed(shown=0.7)) is None  # 1.2 times 0.7 is more than 0.8
    assert judged(diagnosed(shown=math.nan)) is None
    assert judged(diagnosed(hidden=("backlash",))) is None
    assert judged(diagnosed(verdict="unexplained")) is None
    assert judged(rival) is None
    assert compare(*sides(a, diagnosed())).verdict == "different"
    assert compare(*sides(a, diagnosed(shown=math.nan))).verdict == "not_comparable"
    both = compare(*sides(a, a))
    assert [row.name for row in both.rows if row.compared] == ["backlash: width"]
    assert both.verdict == "no_difference_found"
