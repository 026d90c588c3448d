"""Behind a pause the samples begin anew as at a drive's begin, and before it none is lost."""

from __future__ import annotations

import random

import numpy as np
import pytest

from canid.models.pipeline import pipeline
from canid.signals.samples import lead, learning_gate, trace_assembly
from canid.signals.samples.lead import Settings
from canid.signals.samples.sampling_grid import MAX_PAUSE_S
from canid.signals.vehicle import read_vehicle
from canid.values.types import Driver, LearnGate, Reading, Sample, Trace, TrackReading
from tests.samples.test_chunks import drawn, forever, outputs, urban
from tests.samples.test_learning_gate import DRIVING, NAN

# s; of the log: from when on it has no frame
BEGIN_S = 8.0


def _paused(seconds: float, lost: frozenset[int] = frozenset(), sizes: tuple[int, ...] = (4096,)) -> Trace:
    """25 s of following with a pause, or with the ids `lost` missing for as long."""
    frames = [
        frame
        for frame in urban()
        if not (BEGIN_S < frame.t < BEGIN_S + seconds and (not lost or frame.id in lost))
    ]
    chunks = forever(sizes[0]) if len(sizes) == 1 else drawn(random.Random(4), sizes)
    _, items, _ = outputs(frames, read_vehicle("generic"), chunks)
    samples = [item for item in items if isinstance(item, Sample)]
    return trace_assembly.trace(samples, Driver(), pipeline.DT)


@pytest.mark.parametrize("sizes", [(4096,), (1, 7, 60)])
def test_what_was_recorded_on_both_sides_of_a_pause_is_learnt_from(sizes: tuple[int, ...]) -> None:
    """All but the sample after the last reading of the radar before it, and before the first one behind it."""
    trace, whole = _paused(12.0, sizes=sizes), _paused(0.0)
    before, after = trace.t <= BEGIN_S, trace.t >= BEGIN_S + 12.0
    assert (before | after).all()
    opened = {
        round(t, 6) for t, gate in zip(whole.t, whole.gate, strict=True) if gate is LearnGate.OPEN and t > 3.0
    }
    used = {round(t, 6) for t in trace.t[trace.learn]}
    missing = {t for t in opened if t < BEGIN_S - 0.1 or t > BEGIN_S + 12.2} - used
    assert not missing
    assert {*trace.segment[before]}.isdisjoint(trace.segment[after])
    # smoothed with what there is, they are the same motion
    kept = np.isin(whole.t.round(6), trace.t[before].round(6))
    gap = trace.signals["gap"][before][: kept.sum()]
    np.testing.assert_allclose(gap[5:-1], whole.signals["gap"][kept][5:-1], atol=0.5)


def test_a_radar_that_is_lost_for_as_long_recovers() -> None:
    """The other signals come: the lead is found again, which takes the driver two seconds."""
    trace = _paused(12.0, frozenset({0x130}))
    back = trace.t[(trace.t > BEGIN_S + 12.0) & trace.learn]
    assert back[0] >= BEGIN_S + 12.0 + learning_gate.DEFAULT_RECOVERY_S
    # half a second after it the last report counts no more
    assert not trace.learn[(trace.t > BEGIN_S + 0.6) & (trace.t < BEGIN_S + 12.0)].any()


def test_a_pause_ends_what_the_gate_waits_for() -> None:
    state = learning_gate.init()
    for t in (0.0, 0.1):
        state, sample = learning_gate.step(state, t, {**DRIVING, "cruise_active": 1.0}, Driver(), 0.1)
    assert sample.gate is LearnGate.CRUISE
    short, _ = learning_gate.step(state, 5.0, DRIVING, Driver(), 0.1)
    assert short.segment == state.segment + 1
    state, sample = learning_gate.step(
        state, 0.1 + MAX_PAUSE_S + 0.1, {**DRIVING, "target": 2.0}, Driver(), 0.1
    )
    assert (sample.gate, sample.learn, sample.segment) == (LearnGate.OPEN, True, 1)


@pytest.mark.parametrize(("first", "learns"), [({"pedal": NAN}, True), ({"lead_valid": 0.0}, False)])
def test_what_has_not_come_yet_was_not_lost(first: dict[str, float], learns: bool) -> None:
    """A signal that comes later needs no recovery; a vehicle ahead that is found later does."""
    state, _ = learning_gate.step(learning_gate.init(), 0.0, {**DRIVING, **first}, Driver(), 0.1)
    state, sample = learning_gate.step(state, 0.1, DRIVING, Driver(), 0.1)
    assert sample.gate is LearnGate.OPEN
    assert sample.learn is learns


def test_tracks_are_given_out_and_forgotten_at_a_pause() -> None:
    settings, state, out = Settings(from_tracks=True), lead.init(), []
    for k in range(40):
        state, more = lead.step(
            state, TrackReading(0.05 * k, 3, 30.0, 0.0, 0.0, valid=True, new=k == 0), settings
        )
        out += more
    assert max(item.t for item in out) < 1.6
    state, rest = lead.step(state, Reading(20.0, lead.PAUSE, 0.0), settings)
    assert max(item.t for item in rest) == pytest.approx(1.95)
    assert (state.tracks, state.target, state.serial) == ({}, -1, 1)
