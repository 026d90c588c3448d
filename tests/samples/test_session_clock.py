"""Session time never goes backwards, whatever the log's clock does."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from canid.signals.samples import session_clock
from canid.values.frame_columns import chunks
from canid.values.types import Event, Frame


def run_in_chunks(times: list[float], size: int) -> tuple[list[float], list[Event], session_clock.State]:
    state, kept, events = session_clock.init(), [], []
    for chunk in chunks([Frame(t, 0, 1, b"") for t in times], size):
        state, timed = session_clock.step(state, chunk)
        kept += timed.frames.t.tolist()
        events += [event for _, event in timed.events]
        # the rows that are kept, and the newest time at each of them
        rows = range(len(chunk.t)) if timed.rows is None else timed.rows.tolist()
        assert len(rows) == len(timed.frames.t) == len(timed.latest)
        assert (np.diff(timed.latest) >= 0).all()
        assert (timed.latest >= timed.frames.t - 1e-9).all()
    return kept, events, state


def run(times: list[float]) -> tuple[list[float], list[Event], session_clock.State]:
    """Session times, events and the last state; the same frame by frame and in chunks."""
    one = run_in_chunks(times, 1)
    assert run_in_chunks(times, 7) == run_in_chunks(times, 1000) == one
    return one


def test_a_good_clock_passes_unchanged() -> None:
    times = [k * 0.01 for k in range(500)]
    assert run(times)[:2] == (times, [])


def test_two_buses_may_swap_by_milliseconds() -> None:
    times = [0.0, 0.02, 0.015, 0.03]
    assert run(times)[:2] == (times, [])


def test_one_damaged_stamp_costs_one_frame() -> None:
    times = [k * 0.1 for k in range(100)]
    for wild in (-50.0, 1e6):
        kept, events, state = run([*times[:50], wild, *times[50:]])
        assert kept == times
        assert not events
        assert state.dropped == 1


def test_a_clock_that_is_set_back_is_followed() -> None:
    """The session goes on where it was, and the user is informed."""
    times = [k * 0.1 for k in range(100)]
    kept, events, state = run([*[t + 3600 * 2 for t in times], *times])
    assert [e.what for e in events] == ["clock_step", "clock_step"]  # ahead at the very start, and back
    assert len(kept) == 200 - state.dropped
    assert all(b >= a for a, b in pairwise(kept))


@given(st.lists(st.floats(-1e5, 1e5), max_size=300))
def test_never_backwards_by_more_than_the_tolerance(times: list[float]) -> None:
    latest = 0.0
    for t in run(times)[0]:
        assert t >= latest - session_clock.MAX_REORDERING_S - 1e-9
        latest = max(latest, t)
