"""Session time never goes backwards, whatever the log's clock does."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canid.signals.samples import sampling_grid, session_clock
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
        assert (state.dropped, state.ahead) == (wild < 0, wild > 0)


def test_a_clock_that_is_set_back_is_followed() -> None:
    """The drive is cut in two, none of its frames is lost, and the user is informed."""
    times = [k * 0.1 for k in range(100)]
    kept, events, state = run([*[t + 5000.0 for t in times], *times])
    assert [e.says for e in events] == [
        "the log's clock is set back by 5009.9 s at 5009.90 s: the drive is cut in two there, since nothing says for how "
        "long it paused"
    ]
    assert len(kept) == 200
    assert session_clock.back_in_time(state) == ""
    gaps = [b - a for a, b in pairwise(kept)]
    # no sample is made of both parts: the grid begins anew behind such a gap
    assert gaps[99] > sampling_grid.MAX_PAUSE_S
    assert max(gaps[:99] + gaps[100:]) < 0.11


@pytest.mark.parametrize("hours", [1.0, 2.0, 26.0, 24 * 40.0])
def test_a_pause_of_any_length_is_a_pause(hours: float) -> None:
    """No frame is lost, all keep their times, and the pause is reported."""
    times = [k * 0.01 + (k >= 300) * hours * 3600.0 for k in range(600)]
    kept, events, state = run(times)
    assert kept == times
    assert [event.says for event in events] == [
        f"no frame for {hours:.3g} h at 2.99 s: a pause, or its clock was set"
    ]
    assert session_clock.back_in_time(state) == ""


def test_a_clock_from_1970_that_is_set_is_cut_and_not_a_pause_of_decades() -> None:
    """Times stay within what a drive lasts."""
    times = [k * 0.01 + (k >= 300) * 1.7e9 for k in range(600)]
    kept, events, _ = run(times)
    assert len(kept) == 600
    assert kept[-1] < 30.0
    assert len(events) == 1


@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize("period", [60.0, 65.536, 3600.0, 2**32 * 1e-6, 86_400.0, 604_800.0, 2**32 * 1e-3])
@pytest.mark.parametrize("start", [1.0, 45.0])
def test_a_counter_that_wraps_is_unwrapped(period: float, start: float, seed: int) -> None:
    """All frames have the times of a clock that does not wrap, however often it does, and it is reported once."""
    rng = np.random.default_rng(seed)
    # two buses: some frames are a few ms out of order, also where the counter wraps
    true = np.cumsum(rng.uniform(0.001, 0.08, 4000)) + rng.uniform(-0.004, 0.004, 4000)
    true = np.round(np.maximum(true - true[0], 0.0), 6)
    counter = (true + period - start) % period
    source = (counter - counter[0]).tolist()
    kept, events, state = run(source)
    for size in (7, 1000):
        parts = session_clock.unwrapped(chunks([Frame(t, 0, 1, b"") for t in source], size))
        t = np.concatenate([part.t for part in parts])
        # a frame of before the wrap that comes behind it cannot be distinguished there
        assert len(t) == len(source)
        assert np.mean(np.abs(t - true) < 1e-6) > 0.999
    assert np.abs(np.sort(kept) - np.sort(true)).max() < 1e-6
    assert len(events) == 1
    assert session_clock.back_in_time(state) == ""


def test_two_clocks_that_alternate_are_no_step() -> None:
    """Frames of a bus whose clock is behind are left out and counted; those of the other keep their times."""
    times = [k * 0.001 - (k % 2) * 60.0 for k in range(2000)]
    kept, events, state = run(times)
    assert kept == times[::2]
    assert not events
    assert session_clock.back_in_time(state).startswith("1000 frames go back in time (by up to 60 s)")


def test_what_a_log_ends_with_is_counted() -> None:
    """Frames hours ahead of which too few come to show that the log paused."""
    _, events, state = run([k * 0.1 + (k >= 90) * 7200.0 for k in range(100)])
    assert not events
    assert session_clock.back_in_time(state) == "10 frames are hours ahead and were left out"


@given(st.lists(st.floats(-1e5, 1e5), max_size=300))
def test_never_backwards_by_more_than_the_tolerance(times: list[float]) -> None:
    latest = 0.0
    for t in run(times)[0]:
        assert t >= latest - session_clock.MAX_REORDERING_S - 1e-9
        latest = max(latest, t)
