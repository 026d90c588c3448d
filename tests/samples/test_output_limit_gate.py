"""At a limit of the output nothing is learned but that the demand is beyond it, live and of a whole drive."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.mathematics.estimators import pooling
from canid.signals.samples import learning_gate
from canid.signals.samples.trace_assembly import trace
from canid.signals.signal_checks import output_ends
from canid.values.types import Array, Driver, LearnGate, Sample
from tests.samples.test_learning_gate import DRIVING


def samples(output: Array, role: str) -> list[Sample]:
    state, out = learning_gate.init(), []
    for k, y in enumerate(output.tolist()):
        state, sample = learning_gate.step(state, 0.1 * k, DRIVING | {role: y}, Driver(output=role), 0.1)
        out.append(sample)
    return out


def swinging(middle: float, size: float, n: int = 900) -> Array:
    """(n,) that meets a limit above its middle every 6 s, with a noise that keeps its values apart."""
    t = 0.1 * np.arange(n)
    return middle + size * np.sin(t * 2 * math.pi / 6) + 0.05 * size * np.random.default_rng(1).normal(size=n)


def test_a_pedal_pressed_down_hides_the_demand_from_the_first_time_on() -> None:
    made = samples(np.minimum(swinging(80.0, 30.0), 100.0), "pedal")
    at = [sample for sample in made if sample.output >= 100.0]
    assert {(sample.gate, sample.learn, sample.bound < sample.output) for sample in at} == {
        (LearnGate.OUTPUT_LIMIT, False, True)
    }
    # with the bound just below what counts as pressed down
    assert {round(sample.bound, 3) for sample in at} == {99.5}


@pytest.mark.parametrize(("role", "sign"), [("accel_command", 1.0), ("accel_command", -1.0), ("accel", 1.0)])
def test_the_limit_of_another_output_is_found_when_it_was_met_three_times(role: str, sign: float) -> None:
    limited = sign * np.minimum(swinging(0.0, 2.0), 1.2)
    values = DRIVING | {"cruise_active": 1.0} if role == "accel_command" else DRIVING
    state, made = learning_gate.init(), []
    for k, y in enumerate(limited.tolist()):
        state, sample = learning_gate.step(state, 0.1 * k, values | {role: y}, Driver(output=role), 0.1)
        made.append(sample)
    closed = [sample.t for sample in made if sample.gate is LearnGate.OUTPUT_LIMIT]
    assert 12.0 < closed[0] < 30.0
    whole = learning_gate.with_limits(trace(made, Driver(output=role), 0.1))
    at = np.abs(limited) == 1.2
    assert [gate is LearnGate.OUTPUT_LIMIT for gate in whole.gate] == at.tolist()
    assert not whole.learn[at].any()
    # the demand is beyond the bound: below it where the output is not above it
    assert ((whole.output[at] > whole.bound[at]) == (sign > 0.0)).all()
    (end,) = output_ends.reached(whole)
    assert (end.side, round(end.value, 6)) == ("upper" if sign > 0.0 else "lower", sign * 1.2)
    assert end.share == pytest.approx(at.mean())


def test_what_settles_after_a_limit_is_no_bound() -> None:
    made = samples(np.minimum(swinging(80.0, 30.0), 100.0), "pedal")
    for drive in (trace(made, Driver(), 0.1), learning_gate.with_limits(trace(made, Driver(), 0.1))):
        hidden = ~drive.learn & np.isfinite(drive.bound)
        assert {drive.gate[k] for k in np.flatnonzero(hidden)} == {LearnGate.OUTPUT_LIMIT}


def test_a_drive_that_meets_no_limit_stays_the_same() -> None:
    drive = trace(samples(swinging(60.0, 30.0), "pedal"), Driver(), 0.1)
    assert np.isnan(drive.bound).all()
    assert learning_gate.with_limits(drive) is drive
    assert output_ends.reached(drive) == ()


def test_the_limits_of_a_whole_drive_are_found_once() -> None:
    drive = trace(samples(np.clip(swinging(60.0, 30.0), 40.0, 75.0), "pedal"), Driver(), 0.1)
    once = learning_gate.with_limits(drive)
    twice = learning_gate.with_limits(once)
    assert once.gate == twice.gate
    np.testing.assert_array_equal(once.bound, twice.bound)
    np.testing.assert_array_equal(once.learn, twice.learn)
    assert [end.side for end in output_ends.reached(once)] == ["lower", "upper"]


def test_what_is_left_out_next_to_a_limit_is_decided_by_the_sample_before() -> None:
    drive = learning_gate.with_limits(
        trace(samples(np.minimum(swinging(80.0, 30.0), 100.0), "pedal"), Driver(), 0.1)
    )
    margin = learning_gate.limits(drive).margin
    assert 1.0 < margin < 20.0
    before = np.r_[np.nan, drive.output[:-1]]
    learned = drive.learn & (np.arange(len(before)) > 0)
    within_reach = before >= 99.5 - margin
    assert (np.isfinite(drive.bound)[learned] == within_reach[learned]).all()
    assert 0.05 < within_reach[learned].mean() < 0.6
    rows = pooling.pooled(drive)
    assert (rows.learn == (drive.learn & ~np.isfinite(drive.bound))).all()
