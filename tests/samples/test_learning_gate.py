"""The estimators learn only while a person follows a vehicle with the pedal, and after a recovery time."""

from __future__ import annotations

import pytest

from canid.signals.samples import learning_gate
from canid.values.types import Driver, LearnGate

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


@pytest.mark.parametrize("change", [{"gear": -1.0}, {"reverse": 1.0}])
def test_nothing_is_learned_in_reverse(change: dict[str, float]) -> None:
    """A negative gear, or the role `reverse`, shuts the gate at once; a forward gear does not."""
    samples = run({0.0: {"gear": 3.0, "reverse": 0.0}, 4.0: change}, Driver())
    assert {s.gate for s in samples[:40]} == {LearnGate.OPEN}
    assert {s.gate for s in samples[40:]} == {LearnGate.REVERSE}


def test_a_lead_beyond_reach_is_not_followed() -> None:
    """Free driving begins 3 s after the headway has exceeded 6 s, and ends where it falls below 5 s."""
    changes = {5.0: {"gap": 130.0}, 15.0: {"gap": 110.0}, 20.0: {"gap": 90.0}}
    samples = run(changes, Driver(), 30.0)
    free = [round(s.t, 1) for s in samples if s.gate is LearnGate.FREE_DRIVING]
    assert (free[0], free[-1]) == (8.0, 19.9)
    assert len(free) == 120
    assert not any(s.learn for s in samples if 8.0 <= s.t < 21.8)


def test_a_lead_that_departs_is_not_followed() -> None:
    """A gap that opens for 10 s beyond a headway of 4 s is free driving; one that closes is following."""
    departing = run({5.0: {"gap": 90.0, "range_rate": 1.0}}, Driver(), 30.0)
    assert next(s.t for s in departing if s.gate is LearnGate.FREE_DRIVING) == pytest.approx(15.0)
    closing = run({5.0: {"gap": 90.0, "range_rate": -1.0}}, Driver(), 30.0)
    assert {s.gate for s in closing} == {LearnGate.OPEN}


def test_who_wants_a_longer_headway_follows_at_a_longer_one() -> None:
    """With a desired headway of 4 s, 7 s is following."""
    samples = run({5.0: {"gap": 140.0}}, Driver(headway_desired=4.0), 20.0)
    assert {s.gate for s in samples} == {LearnGate.OPEN}


def test_a_new_lead_is_followed_at_once() -> None:
    """Free driving belongs to one lead: it ends where none is measured."""
    changes = {2.0: {"gap": 140.0}, 8.0: {"lead_valid": 0.0}, 9.0: {"lead_valid": 1.0, "gap": 110.0}}
    samples = run(changes, Driver(), 16.0)
    assert any(s.gate is LearnGate.FREE_DRIVING for s in samples[:80])
    assert not any(s.gate is LearnGate.FREE_DRIVING for s in samples[80:])


def test_an_assistant_at_the_wheel_is_not_the_person() -> None:
    """It shuts the gate of the wheel; who holds the speed does not, and the pedal does not know the wheel."""
    lane = Driver(task="lane_keeping", output="steering_angle")
    changes = {
        0.0: {"steering_assist": 0.0, "cruise_active": 1.0},
        3.0: {"steering_assist": 1.0},
        5.0: {"steering_assist": 0.0},
    }
    samples = run(changes, lane)
    assisted = [3.0 <= round(s.t, 1) < 5.0 for s in samples]
    assert [s.gate for s in samples] == [LearnGate.ASSIST if on else LearnGate.OPEN for on in assisted]
    unknown = run({0.0: {"steering_assist": 0.0}, 3.0: {"steering_assist": NAN}}, lane)
    assert unknown[-1].gate is LearnGate.STALE
    assert {s.gate for s in run({0.0: {"steering_assist": 1.0}}, Driver())} == {LearnGate.OPEN}
