"""The words and the clock of the status logic."""

from canid.mathematics.estimators import status
from canid.values.types import Channel, Identifiable, Interval, LearnGate, Sample, Status


def sample(t, gate):
    return Sample(t, 0.0, (0.0,), gate, gate is LearnGate.OPEN, 0, {})


def test_a_brief_gate_starts_its_clock_anew_after_the_gate_was_open():
    """Two dabs of 4 s with the gate open in between are two brief ones; one of 5 s is not brief."""
    state, seen = status.Pace(), []
    for t, gate in [
        (0.0, LearnGate.BRAKE),
        (4.0, LearnGate.BRAKE),
        (4.1, LearnGate.OPEN),
        (4.2, LearnGate.BRAKE),
        (9.1, LearnGate.BRAKE),
        (9.2, LearnGate.BRAKE),
    ]:
        state, forced = status.by_gate(state, sample(t, gate))
        seen.append(forced)
    assert seen == [None, None, None, None, None, Status.NO_DRIVER]


def test_the_pace_does_not_drift_with_rounding():
    """On a grid of summed 0.1 s steps an estimate is due at every fifth sample, for an hour."""
    state, t, count = status.Pace(), 0.0, 0
    for _ in range(36_000):
        if status.due(state, t, Status.OK):
            state, count = status.emitted(state, t, Status.OK), count + 1
        t += 0.1
    assert count == 7_200


def test_every_gate_but_open_ends_in_a_status():
    """No closed gate is forgotten: after 5 s each forces something."""
    for gate in LearnGate:
        state, _ = status.by_gate(status.Pace(), sample(0.0, gate))
        _, forced = status.by_gate(state, sample(5.0, gate))
        assert (forced is None) == (gate is LearnGate.OPEN)


def test_sentences_name_the_input_that_moved_least_and_its_unit():
    """Relative to what is usual, not in numbers; and each task has a remedy of its own."""
    kind, says = status.by_data(60.0, 20.0, {"headway_error": 0.2, "range_rate": 0.3}, False)
    assert kind is Status.NOT_EXCITED
    assert says.startswith("range rate hardly moved (sd 0.30 m/s)")
    assert "move within the lane" in status.by_data(60.0, 20.0, {"lateral_offset": 0.0}, False)[1]
    assert "hide the response" in status.by_fit({}, {"range_rate": 3.0})[1]
    kind, says = status.by_fit({"a_b": Channel(status=Identifiable.SUM_ONLY)}, {"a_b": 1.0})
    assert kind is Status.OK
    assert says.startswith("a b: K, and τ")


def test_lane_keeping_does_not_speak_of_leads():
    """No sentence of a lane-keeping driver asks to follow anybody."""
    for moved, used in ((True, 5.0), (False, 60.0)):
        _, says = status.by_data(used, 20.0, {"lateral_offset": 0.1}, moved)
        assert "lane" in says
        assert "follow" not in says


def test_a_gain_of_the_wrong_sign_is_never_ok():
    """Nobody follows with a negative answer to headway or range rate; a steering answer may have either sign."""
    pushes = Channel(Interval(-2.0, -3.0, -1.0), status=Identifiable.GAIN_ONLY)
    unsure = pushes._replace(K=Interval(-1.0, -3.0, 1.0), status=Identifiable.NOT)
    right = Channel(Interval(5.0, 4.0, 6.0), status=Identifiable.OK)
    for name in ("headway_error", "range_rate"):
        other = "range_rate" if name == "headway_error" else "headway_error"
        kind, says = status.by_fit({name: pushes, other: right}, {name: 1.0, other: 1.0})
        assert kind is Status.INCONSISTENT
        assert name.replace("_", " ") in says
        assert status.by_fit({name: unsure, other: right}, {name: 1.0, other: 1.0})[0] is Status.OK
    assert status.by_fit({"lateral_offset": pushes}, {"lateral_offset": 1.0})[0] is Status.OK
