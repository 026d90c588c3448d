"""The likelihood of a response to the lead's acceleration finds the one that was planted, and none where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.mathematics.identification import lead_anticipation
from canid.mathematics.identification.fopdt import answer_columns, fopdt_fit, regression_rows
from canid.mathematics.identification.lead_anticipation import AHEAD_S, BEFORE_S, acceleration_ahead, compare
from canid.values.types import Array
from tests.plants.first_order_lag import answer
from tests.seeds import mostly

DT, SECONDS = 0.1, 60.0
NAMES = ("headway_error", "range_rate")


def compared(seed: int, ahead: float) -> Array:
    """Compare drivers in a minute in which one with K2 = 5, and `ahead` s, follows; own and lead's speed are given."""
    rng = np.random.default_rng([seed, 171])
    n, before = round((SECONDS + 10.0) / DT), round(BEFORE_S / DT)
    accel = lfilter([1.0], [1.0, -0.9], 0.25 * rng.normal(size=(2, n)))
    own, lead = 20.0 + np.cumsum(accel - accel.mean(axis=1)[:, None], axis=1) * DT
    rate = lead - own
    headway = (25.0 + np.cumsum(rate) * DT) / own
    noise = lfilter([1.0], [1.0, -0.8], 0.4 * rng.normal(size=n))
    wanted = rate + ahead * np.gradient(lead, DT)
    y = 20.0 + 3.0 * answer(headway, DT, 0.5, 0.4) + 5.0 * answer(wanted, DT, 0.4, 0.4) + noise
    layout = fopdt_fit.row_layout(2, DT, 3.0, 1.5)
    samples = np.column_stack([y, np.ones(n), np.zeros(n), headway, rate])
    rows = regression_rows.put(layout, regression_rows.State(), samples, 4.5)[1][-round(SECONDS / DT) :]
    fit = fopdt_fit.fit_rows(layout, rows, fopdt_fit.Settings(names=NAMES))
    at = answer_columns.reference(fit)
    assert at is not None
    raw, usable = answer_columns.raw(layout, rows, at)
    made = answer_columns.whitened(layout, raw, usable, at)
    assert made is not None
    seen = acceleration_ahead(lead + 0.02 * rng.normal(size=n), DT)[n - 1 - len(rows) - before : n - 1]
    return compare(layout, rows, at, made, seen, None)


@mostly(0.9)
def test_the_planted_response_is_the_likeliest(seed: int) -> None:
    """Of the times on the grid that of the driver, or its neighbour."""
    found = compared(seed, 1.0)
    best = int(np.argmax(found[:, 0]))
    assert found[best, 0] > 5.0
    assert abs(AHEAD_S[1 + best] - 1.0) <= 0.5


@mostly(0.9)
def test_where_there_is_none_none_is_likelier_than_by_chance(seed: int) -> None:
    """Twice the log of a likelihood ratio of one parameter is below 4 in 95 of 100; an integrated one is smaller."""
    assert compared(seed, 0.0)[:, 0].max() < 2.0


def test_another_lead_has_no_acceleration() -> None:
    """A jump of the lead's speed is another lead, and what is not measured is none: both count as no change."""
    speed = np.r_[np.full(30, 20.0), np.full(10, np.nan), np.full(30, 25.0), np.full(30, 15.0)]
    assert acceleration_ahead(speed, DT).tolist() == [0.0] * 100


@pytest.mark.parametrize("step", [0.1, 0.2])
def test_an_acceleration_comes_neither_early_nor_late(step: float) -> None:
    """That of a slow oscillation is its derivative, at the same instant."""
    t = np.arange(0.0, 60.0, step)
    accel = acceleration_ahead(20.0 + np.sin(0.8 * t), step)
    inside = slice(20, -20)
    np.testing.assert_allclose(accel[inside], (0.8 * np.cos(0.8 * t))[inside], atol=0.04)


def test_times_before_the_drive_add_up_to_one() -> None:
    """What is known before the drive of T."""
    assert lead_anticipation.PRIOR.sum() == pytest.approx(1.0)
