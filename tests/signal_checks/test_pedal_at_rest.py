"""Braking is what the brake's signal says; where there is none, slowing counts that the pedal does not explain."""

from __future__ import annotations

import numpy as np
import pytest

from canid.analysis.tables.column_map import ColumnMap
from canid.analysis.tables.table import open_table, trace_of
from tests.fixtures.measured_logs import files, needs_measured
from tests.seeds import mostly
from tests.signal_checks.synthetic import DT, Array, Columns, findings, following, smooth

NAME = "pedal_is_throttle"


def driven(seed: int) -> tuple[Array, Array, np.random.Generator]:
    """Acceleration and speed, (n,), of 8 min in which the car slows by more than 1.2 m/s² again and again."""
    rng = np.random.default_rng(seed)
    n = round(480.0 / DT)
    accel = 1.0 * smooth(n, 1.5, rng)
    speed, v = np.empty(n), 25.0
    for k, a in enumerate(accel.tolist()):
        v += DT * (a - 0.05 * (v - 25.0))
        speed[k] = v
    return np.gradient(speed, DT), speed, rng


def columns(seed: int, accel: Array, speed: Array, pedal: Array, **more: Array) -> Columns:
    """A drive whose gap nothing contradicts."""
    lead = following(seed, 8.0)
    n, rng = len(speed), np.random.default_rng([seed, 1])
    gap = 40.0 + 5.0 * smooth(n, 5.0, rng)
    return {
        "gap": gap,
        "range_rate": np.gradient(gap, DT),
        "speed": speed + 0.03 * rng.standard_normal(n),
        "accel": accel + 0.05 * rng.standard_normal(n),
        "pedal": pedal,
        "lead_valid": lead["lead_valid"],
        **more,
    }


def one_pedal(seed: int, slopes: float = 0.15) -> Columns:
    """A motor slows the car by 2.2 m/s² at a released pedal; the road's slope does something too."""
    accel, speed, rng = driven(seed)
    road = slopes * smooth(len(speed), 4.0, rng)
    return columns(seed, accel, speed, np.maximum((accel - road + 2.2) / 0.1, 0.0))


def throttle(seed: int) -> Columns:
    """A plate that stays open by 5 % while the brake slows the car; nobody measures the brake."""
    accel, speed, rng = driven(seed)
    idle = 5.0 + smooth(len(speed), 1.0, rng)
    return columns(seed, accel, speed, np.maximum((accel + 0.5) / 0.06, 0.0) + idle)


def named(seen: Columns) -> set[str]:
    return {finding.name for finding in findings(seen)}


@pytest.mark.parametrize("brake", [True, False], ids=["brake never pressed", "no brake signal"])
@mostly(0.95)
def test_a_motor_that_slows_the_car_is_no_fault_of_the_pedal(brake: bool, seed: int) -> None:
    """In a car with one pedal it is pressed while the car slows, and that is right."""
    seen = one_pedal(seed)
    n = len(seen["speed"])
    assert np.diff(seen["speed"][::10]).min() < -1.5
    assert NAME not in named(seen | ({"brake": np.zeros(n), "cruise_active": np.zeros(n)} if brake else {}))


@mostly(0.95)
def test_a_throttle_without_a_brake_signal_is_still_found(seed: int) -> None:
    """Its idle opening does not explain how the car slows."""
    assert NAME in named(throttle(seed))


@mostly(0.95)
def test_a_pedal_that_is_released_for_an_unmeasured_brake_is_sound(seed: int) -> None:
    """The brake slows the car while the pedal is at 0."""
    accel, speed, _ = driven(seed)
    assert NAME not in named(columns(seed, accel, speed, np.maximum((accel + 0.5) / 0.06, 0.0)))


@pytest.mark.long("takes whole drives")
@needs_measured
def test_a_measured_kind_of_one_pedal_car_is_left_alone() -> None:
    """Brake and cruise control are 0 throughout; the whole drive is trusted."""
    for log in files("reports/46-one-pedal/ev1.csv"):
        assert trace_of(open_table(log, ColumnMap()), DT).findings == ()
