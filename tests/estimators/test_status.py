"""The words and the clock of the status logic."""

from canid.estimators import status
from canid.types import Channel, Gate, Identifiable, Sample, Status


def sample(t, gate):
    return Sample(t, 0.0, (0.0,), gate, gate is Gate.OPEN, 0, {})


def test_a_brief_gate_starts_its_clock_anew_after_the_gate_was_open():
    """Two dabs of 4 s with a moment in between are two brief ones; one of 5 s is not brief."""
    state, seen = status.Closed(), []
    for t, gate in [
        (0.0, Gate.BRAKE),
        (4.0, Gate.BRAKE),
        (4.1, Gate.OPEN),
        (4.2, Gate.BRAKE),
        (9.1, Gate.BRAKE),
        (9.2, Gate.BRAKE),
    ]:
        state, forced = status.step(state, sample(t, gate))
        seen.append(forced)
    assert seen == [None, None, None, None, None, Status.NO_DRIVER]


def test_the_pace_does_not_drift_with_rounding():
    """On a grid of summed 0.1 s steps an estimate is due at every fifth sample, for an hour."""
    state, t, count = status.Closed(), 0.0, 0
    for _ in range(36_000):
        if status.due(state, t, Status.OK):
            state, count = status.said(state, t, Status.OK), count + 1
        t += 0.1
    assert count == 7_200


def test_every_gate_but_open_ends_in_a_status():
    """No closed gate is forgotten: after 5 s each forces something."""
    for gate in Gate:
        state, _ = status.step(status.Closed(), sample(0.0, gate))
        _, forced = status.step(state, sample(5.0, gate))
        assert (forced is None) == (gate is Gate.OPEN)


def test_sentences_name_the_input_that_moved_least_and_its_unit():
    """Relative to what is usual, not in numbers."""
    says = status.hardly_moved({"headway_error": 0.2, "range_rate": 0.3})
    assert says.startswith("range rate hardly moved (sd 0.30 m/s)")
    assert "move within the lane" in status.hardly_moved({"lateral_offset": 0.0})
    assert "hide the answer" in status.hardly_moved({"range_rate": 3.0})
    assert status.what_is_told({"a_b": Channel(status=Identifiable.SUM_ONLY)}).startswith("a b: K, and tau")
