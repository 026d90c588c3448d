"""`canid compare` on simulated drivers, through frames and logs: the benchmark in small."""

from __future__ import annotations

from benchmarks.compare import drives
from canid.analysis.comparison.comparison import compare
from tests.seeds import mostly


@mostly(0.95)
def test_one_driver_is_one_and_two_are_two(seed: int) -> None:
    """Two drives of one driver behind different leads show no difference (at 0.5 %, which one pair in 200 misses); a gain
    1.5 times as large and a dead time 0.5 s longer are named. The rates are measured in benchmarks/compare."""
    driver, noise = drives.drawn(seed)
    minutes = 5.0
    first = drives.side("A", drives.estimates(driver, noise, minutes, seed, "mixed"))
    again = drives.side("B", drives.estimates(driver, noise, minutes, seed + 1, "urban"))
    known = [row.p_adjusted for row in compare(first, again).rows if row.compared]
    assert len(known) > 3
    assert min(known) > 0.005
    for other, name in (
        (driver._replace(K2=1.5 * driver.K2), "range_rate K"),
        (driver._replace(dead_time2=driver.dead_time2 + 0.5), "range_rate tau_plus_dead_time"),
    ):
        found = compare(first, drives.side("B", drives.estimates(other, noise, minutes, seed + 2, "mixed")))
        assert name in [row.name for row in found.different]
