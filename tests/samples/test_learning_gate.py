"""The estimators learn only while a person follows a vehicle with the pedal, and after a recovery time."""

from __future__ import annotations

import pytest

from canid.samples import learning_gate
from canid.types import Driver, LearnGate

DRIVING = {
    "pedal": 12.0, "accel": 0.1, "accel_command": 0.1, "steering_angle": 1.0, "lateral_offset": 0.1,
    "speed": 20.0, "gap": 30.0, "range_rate": 0.1, "lead_valid": 1.0, "target": 1.0,
    "brake": 0.0, "cruise_active": 0.0,
}  # fmt: skip
NAN = float("nan")


def run(changes: dict[float, dict[str, float]], driver: Driver, duration: float = 10.0) -> list:
    state, values, samples = learning_gate.init(), dict(DRIVING), []
    for k in range(int(duration * 10)):
        values |= changes.get(round(k * 0.1, 1), {})
        state, sample = learning_gate.step(state, k * 0.1, values, driver, 0.1)
        samples.append(sample)
    return samples


def shut(samples: list) -> tuple[float, float]:
    """First and last time at which nothing was learnt."""
    times = [s.t for s in samples if not s.learn]
    return round(times[0], 1), round(times[-1], 1)


@pytest.mark.parametrize(
    ("role", "value", "back", "expected", "recovery"),
    [
        ("cruise_active", 1.0, 0.0, LearnGate.CRUISE, 2.0),
        ("brake", 1.0, 0.0, LearnGate.BRAKE, 1.0),
        ("pedal", 0.0, 12.0, LearnGate.PEDAL_FLOOR, 0.3),
        ("pedal", NAN, 12.0, LearnGate.STALE, 2.0),
        ("speed", 0.5, 20.0, LearnGate.STANDSTILL, 2.0),
        ("lead_valid", 0.0, 1.0, LearnGate.NO_LEAD, 2.0),
        ("gap", NAN, 30.0, LearnGate.NO_LEAD, 2.0),
        ("cruise_active", NAN, 0.0, LearnGate.STALE, 2.0),
    ],
)
def test_each_gate_shuts_and_recovers(
    role: str, value: float, back: float, expected: LearnGate, recovery: float
) -> None:
    samples = run({3.0: {role: value}, 5.0: {role: back}}, Driver())
    assert {s.gate for s in samples if 3.0 <= round(s.t, 1) < 5.0} == {expected}
    first, last = shut(samples)
    assert first == 3.0
    assert last == pytest.approx(4.9 + recovery - 0.1, abs=0.11)


def test_another_target_shuts_for_a_while_and_starts_a_segment() -> None:
    samples = run({4.0: {"target": 2.0}}, Driver())
    assert [s.gate for s in samples if s.gate is not LearnGate.OPEN] == [LearnGate.TARGET_CHANGE]
    assert {s.segment for s in samples[:40]} == {0}
    assert {s.segment for s in samples[40:]} == {1}
    assert shut(samples) == (4.0, pytest.approx(5.9, abs=0.11))


def test_a_short_gate_does_not_cut_a_long_recovery() -> None:
    samples = run(
        {3.0: {"cruise_active": 1.0}, 4.0: {"cruise_active": 0.0}, 4.5: {"brake": 1.0}, 4.6: {"brake": 0.0}},
        Driver(),
    )
    assert shut(samples)[1] == pytest.approx(5.8, abs=0.11)


def test_the_cruise_controller_is_identified_only_while_it_drives() -> None:
    samples = run({5.0: {"cruise_active": 1.0}}, Driver(output="accel_command"))
    assert {s.gate for s in samples[:50]} == {LearnGate.NO_CRUISE}
    assert {s.gate for s in samples[50:]} == {LearnGate.OPEN}
    assert not any(s.learn for s in samples[:69])


def test_acceleration_stands_for_whoever_drives_but_never_mixes_them() -> None:
    """With output accel brake and floor mean nothing; taking over by cruise starts a segment."""
    samples = run({3.0: {"brake": 1.0, "accel": -2.0}, 6.0: {"cruise_active": 1.0}}, Driver(output="accel"))
    assert {s.gate for s in samples} == {LearnGate.OPEN}
    assert {s.segment for s in samples[:60]} == {0}
    assert {s.segment for s in samples[60:]} == {1}
    assert not any(s.learn for s in samples[60:79])


def test_lane_keeping_needs_no_lead() -> None:
    samples = run(
        {0.0: {"lead_valid": 0.0, "gap": NAN}}, Driver(task="lane_keeping", output="steering_angle")
    )
    assert {s.gate for s in samples} == {LearnGate.OPEN}
    assert samples[0].inputs == (0.1,)
