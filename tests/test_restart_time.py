"""The estimators' time: without a restart it is the session's; with one, the downtime is a single grid step that breaks."""

from __future__ import annotations

import math
from itertools import pairwise

from canid.models.pipeline import restart_time
from canid.values.types import LearnGate, Sample

DT = 0.1


def sample(k: int, segment: int = 0) -> Sample:
    return Sample(k * DT, 20.0, (0.1, 0.2), LearnGate.OPEN, True, segment, {})


def test_without_a_restart_every_sample_is_itself() -> None:
    state = restart_time.State()
    for k in range(50):
        state, moved = restart_time.step(state, sample(k), DT)
        assert moved == sample(k)


def test_time_and_segments_run_on_over_many_restarts() -> None:
    """Sessions that begin anywhere, with segments of their own: one time without gaps, one break at each restart."""
    state, times, segments = restart_time.State(), [], []
    for session, first in enumerate((0, 3, 100_000, 7)):
        if session:
            state, pause = restart_time.resume(state, DT, 2)
            assert pause.gate is LearnGate.STALE
            assert not pause.learn
            assert all(map(math.isnan, (pause.output, *pause.inputs)))
            times.append(pause.t)
            segments.append(pause.segment)
        for k in range(20):
            state, moved = restart_time.step(state, sample(first + k, segment=k // 10), DT)
            times.append(moved.t)
            segments.append(moved.segment)
    steps = [b - a for a, b in pairwise(times)]
    assert all(abs(step - DT) < 1e-6 for step in steps)
    breaks = [i for i, (a, b) in enumerate(pairwise(segments)) if a != b]
    # within each session one of its own, between two sessions one more
    assert len(breaks) == 4 + 3
    assert sorted(segments) == segments
