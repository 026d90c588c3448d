"""Estimates of several drives of one driver as one, and what the diagnosis of all of them may quote next to it."""

from __future__ import annotations

import numpy as np

from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.estimators.pooled_drives import pooled
from canid.mathematics.estimators.whole_drive_agreement import diagnosed
from canid.values.types import Channel, Identifiable, Interval, ResidualTests

NAME = "range_rate"


def known(value: float, sd: float = 1.0, status: Identifiable = Identifiable.GAIN_ONLY) -> WholeDrive:
    """A gain with its standard deviation, and a sum of delays."""
    K, total = (Interval(x, x - 1.96 * s, x + 1.96 * s) for x, s in ((value, sd), (0.8, 0.1)))
    return WholeDrive({NAME: Channel(K, tau_plus_dead_time=total, status=status)})


def together(*drives: WholeDrive) -> WholeDrive:
    found = pooled([{"fopdt": drive} for drive in drives])["fopdt"]
    assert found is not None
    return found


def test_the_interval_of_four_drives_holds_the_truth(seed: int) -> None:
    """In 0.92 to 0.99 of 2,000 draws, at about half of the width of one: the Birge ratio is one at least."""
    rng = np.random.default_rng(seed)
    held, wide = [], []
    for _ in range(2000):
        K = together(*(known(float(x)) for x in rng.normal(5.0, 1.0, 4))).channels[NAME].K
        held.append(K.low <= 5.0 <= K.high)
        wide.append((K.high - K.low) / 3.92)
    assert 0.92 < np.mean(held) < 0.99
    assert 0.5 <= np.median(wide) < 0.6


def test_drives_that_differ_widen_the_interval() -> None:
    """By what they differ, and a drive that may quote nothing counts for nothing."""
    one = together(known(2.0), known(8.0)).channels[NAME].K
    assert abs(one.value - 5.0) < 1e-9
    assert one.high - one.low > 2.0 * 1.96 * 2.9
    alone = together(known(2.0), known(8.0, status=Identifiable.NOT)).channels[NAME].K
    np.testing.assert_allclose(alone, known(2.0).channels[NAME].K)


def test_the_diagnosis_of_all_drives_is_held_against_all() -> None:
    """Disjoint gains, a response that one drive leaves over, gains that changed in one: none may be quoted."""
    mine = {
        NAME: Channel(
            Interval(9.0, 8.0, 10.0),
            tau_plus_dead_time=Interval(0.8, 0.6, 1.0),
            status=Identifiable.SUM_ONLY,
        )
    }
    found = pooled([{"fopdt": known(5.0), "armax": None}, {"fopdt": known(6.0), "armax": None}])
    assert found["armax"] is None
    left, says, _ = diagnosed(mine, found, {})
    assert left[NAME].status is Identifiable.NOT
    assert "9.00 [8.00, 10.00] by diagnose" in says[0]
    tests = ResidualTests(True, 0.0, 1.0, (NAME,), (), True, {}, {NAME: 0.9})
    some = {"fopdt": together(known(9.0), known(9.0)._replace(residual_tests=tests))}
    assert diagnosed(mine, some, None)[0][NAME].status is Identifiable.GAIN_ONLY
    changed = {"fopdt": together(known(9.0), known(9.0)._replace(details={"changes": ("one",)}))}
    assert diagnosed(mine, changed, None)[0][NAME].status is Identifiable.NOT
