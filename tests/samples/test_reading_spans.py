"""How often a value is updated is read off its readings, whatever stands between them, and nothing is read into noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.signals.samples import reading_spans
from canid.signals.samples.reading_spans import ReadingSpan
from tests.exact import exact
from tests.seeds import mostly
from tests.signal_checks.synthetic import Array, smooth

SECONDS = 60.0


def signal(seed: int, step: float, t: Array) -> Array:
    """A smooth movement with some noise, in steps, at times t in s."""
    rng = np.random.default_rng(seed)
    fine = 5.0 * smooth(round(SECONDS / 0.1) + 20, 2.0, rng)
    x = np.interp(t, 0.1 * np.arange(len(fine)), fine) + 0.05 * rng.standard_normal(len(t))
    return np.round(x / step) * step


def readings(seed: int, hz: float, between: str, message_hz: float, step: float) -> tuple[Array, Array]:
    """Times and values of a message whose value is updated more slowly."""
    dense, measured = np.arange(0.0, SECONDS, 1.0 / message_hz), np.arange(0.013, SECONDS + 2.0, 1.0 / hz)
    value = signal(seed, step, measured)
    if between == "points":
        return measured, value
    if between == "line":
        return dense, np.round(np.interp(dense, measured, value), 4)
    return dense, value[np.maximum(np.searchsorted(measured, dense, side="right") - 1, 0)]


def spans(t: Array, value: Array, sizes: tuple[int, ...] = (10**9,)) -> list[ReadingSpan]:
    """What the spans show, in chunks of these sizes in turn."""
    state, out, k, n = reading_spans.init(), [], 0, 0
    while k < len(t):
        rows = np.arange(k, min(k + sizes[n % len(sizes)], len(t)))
        state, over = reading_spans.step(state, "gap", t[rows], value[rows], rows)
        out += over
        k, n = k + len(rows), n + 1
    assert [row for row, _ in out] == np.searchsorted(t, [10.0 * (j + 1) for j in range(len(out))]).tolist()
    return [span for _, span in out]


@pytest.mark.parametrize("step", [1e-4, 0.1])
@pytest.mark.parametrize("message_hz", [10.0, 25.0])
@pytest.mark.parametrize("between", ["points", "hold", "line"])
@pytest.mark.parametrize("hz", [1.0, 2.0, 3.3])
@mostly(0.9)
def test_a_slow_update_is_found(hz: float, between: str, message_hz: float, step: float, seed: int) -> None:
    """Its period within a fifth, and what stands between two updates, on most spans; lines are not in steps."""
    t, value = readings(seed, hz, between, message_hz, step)
    shown = spans(t, value)
    right = [abs(span.update * hz - 1.0) < 0.2 and span.kind == between for span in shown]
    assert sum(right) >= 0.6 * len(shown), shown


@pytest.mark.parametrize("between", ["hold", "line"])
@mostly(0.9)
def test_every_second_reading_may_be_a_value_of_its_own(between: str, seed: int) -> None:
    """At 5 Hz in a table of 10 Hz, whichever rows hold the values."""
    t = 0.1 * np.arange(round(SECONDS / 0.1))
    first = seed % 2
    own, value = t[first::2], signal(seed, 1e-4, t[first::2])
    joined = np.interp(t, own, value)
    held = value[np.maximum(np.searchsorted(own, t, side="right") - 1, 0)]
    shown = spans(t, joined if between == "line" else held)
    right = [abs(span.update - 0.2) < 0.02 and span.kind == between for span in shown]
    assert sum(right) >= 0.6 * len(shown), shown


@pytest.mark.parametrize("step", [1e-4, 0.1, 0.5])
@pytest.mark.parametrize("hz", [10.0, 20.0, 100.0])
def test_a_signal_of_its_message_is_no_slower(hz: float, step: float, seed: int) -> None:
    """Neither fine nor coarse values are called held or joined by lines."""
    t = np.arange(0.0, SECONDS, 1.0 / hz)
    for span in spans(t, signal(seed, step, t)):
        assert span.kind == "points"
        assert span.update == pytest.approx(1.0 / hz)


@pytest.mark.parametrize("lost", [0.05, 0.2, 0.5])
def test_lost_readings_count_by_how_long_lines_stand_in(lost: float, seed: int) -> None:
    """The sum of d² over that of d, of geometric intervals that are joined: up to 0.5 s."""
    rng = np.random.default_rng(seed)
    t = np.flatnonzero(rng.random(20_000) >= lost) * 0.1
    updates = [span.update for span in spans(t, rng.standard_normal(len(t)))]
    d = np.arange(1, 6)
    chance = lost ** (d - 1.0)
    expected = 0.1 * np.sum(chance * d**2) / np.sum(chance * d)
    assert np.mean(updates) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(
    ("between", "period", "lost"),
    [("hold", 0.2, 0.1), ("hold", 0.2, 0.3), ("line", 0.245, 0.0), ("line", 0.245, 0.1), ("line", 0.3, 0.1),
     ("line", 0.3, 0.3)],
)  # fmt: skip
@mostly(0.9)
def test_a_slow_update_is_found_where_readings_were_lost(
    between: str, period: float, lost: float, seed: int
) -> None:
    """Values held for two readings, and lines whose knots are two or three readings apart, of a table of 10 Hz."""
    rng = np.random.default_rng(seed)
    t = np.round(0.1 * np.arange(round(SECONDS / 0.1)), 4)
    own = np.unique(np.searchsorted(t, np.arange(0.013, SECONDS - period, period)))
    value = signal(seed, 1e-4, t[own])
    joined = np.interp(t, t[own], value)
    held = value[np.maximum(np.searchsorted(own, np.arange(len(t)), side="right") - 1, 0)]
    kept = rng.random(len(t)) >= lost
    shown = spans(t[kept], np.round(joined if between == "line" else held, 4)[kept])
    right = [span.kind == between and span.update > 0.75 * period for span in shown]
    assert sum(right) >= 0.6 * len(shown), shown


@pytest.mark.parametrize("step", [1e-4, 0.1, 0.5])
@pytest.mark.parametrize("lost", [0.1, 0.3])
def test_lost_readings_make_no_holds_and_no_lines(step: float, lost: float, seed: int) -> None:
    """Of a signal of its message, fine and coarse."""
    t = np.flatnonzero(np.random.default_rng(seed).random(600) >= lost) * 0.1
    assert {span.kind for span in spans(t, signal(seed, step, t))} == {"points"}


@pytest.mark.parametrize("sd", [0.003, 0.05])
@pytest.mark.parametrize("lost", [0.0, 0.1, 0.3])
@mostly(0.9)
def test_lively_stretches_between_calm_ones_are_no_lines(lost: float, sd: float, seed: int) -> None:
    """Straight readings and bent ones that are among themselves, for 0.5 to 4 s."""
    rng = np.random.default_rng(seed)
    kept = rng.random(round(SECONDS / 0.1)) >= lost
    ends = np.cumsum(rng.integers(5, 40, len(kept)))
    lively = np.searchsorted(ends, np.arange(len(kept)), side="right") % 2 == 1
    t = 0.1 * np.arange(len(kept))
    value = np.round(0.2 * t + sd * lively * rng.standard_normal(len(t)), 4)
    assert {span.kind for span in spans(t[kept], value[kept])} == {"points"}


def test_a_coarse_value_that_stands_still_is_neither_held_nor_a_line(seed: int) -> None:
    """A pedal in steps of 1/256, as percent of two decimals: steps of 0.39 and 0.40 are on no lattice."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(round(20.0 * SECONDS / 0.1))
    steps = np.cumsum(rng.choice([-1, 0, 1], len(t), p=[0.13, 0.74, 0.13]))
    kinds = [span.kind for span in spans(t, np.round(steps * 100.0 / 256.0, 2))]
    assert kinds.count("points") >= 0.97 * len(kinds)


def test_a_constant_shows_no_update() -> None:
    """A value that stands still says nothing about its rate."""
    t = np.arange(0.0, SECONDS, 0.1)
    assert all(np.isnan(span.update) for span in spans(t, np.full(len(t), 3.0)))


def test_spans_do_not_depend_on_the_chunks(seed: int) -> None:
    """To the last bit, and the row is that of the reading that ends the span."""
    t, value = readings(seed, 2.0, "line", 10.0, 1e-4)
    whole = exact(spans(t, value))
    assert exact(spans(t, value, (1, 7, 100, 3))) == whole
    assert exact(spans(t, value, (1,))) == whole


@pytest.mark.parametrize("tau", [0.1, 0.17, 0.4])
@pytest.mark.parametrize("period", [0.3, 0.62, 1.0])
def test_what_is_held_before_a_lag_is_found(period: float, tau: float, seed: int) -> None:
    """A radar of 1 to 3 Hz behind a filter of the logger, in decimals of 0.1 mm/s; the filter alone shows nothing."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(1220)
    keep = np.exp(-0.1 / tau)
    white = lfilter([1.0], [1.0, -0.95], rng.standard_normal(len(t)))
    held = white[(np.floor(t / period + 1e-6) * period / 0.1).astype(int)]
    for source, expected in ((held, period), (white, 0.1)):
        seen = np.round(lfilter([1.0 - keep], [1.0, -keep], source), 4)
        _, over = reading_spans.step(reading_spans.init(), "range_rate", t, seen, np.arange(len(t)))
        update = float(np.median([span.update for _, span in over]))
        assert update == pytest.approx(expected, abs=0.06), [span.kind for _, span in over]
        assert {span.kind for _, span in over} == ({"hold"} if source is held else {"points"})


def moved_by_foot(seed: int, hz: float, duration: float) -> tuple[Array, Array]:
    """Readings of a pedal in steps of 1/2.55 % that moves every 0.3 to 1 s, within so many s, and stands in between."""
    rng = np.random.default_rng(seed)
    at = np.cumsum(rng.uniform(0.3, 1.0, 300))
    at = at[at < SECONDS]
    steps = np.cumsum(np.r_[20.0, rng.normal(0.0, 2.0, len(at))])
    t = np.arange(0.0, SECONDS, 1.0 / hz)
    k = np.searchsorted(at, t, side="right")
    share = np.minimum((t - np.r_[0.0, at][k]) / max(duration, 1e-6), 1.0)
    value = steps[np.maximum(k - 1, 0)] + share * (steps[k] - steps[np.maximum(k - 1, 0)])
    return t, np.round(2.55 * value) / 2.55


@pytest.mark.parametrize("hz", [10.0, 20.0, 50.0])
@pytest.mark.parametrize("duration", [0.0, 0.15])
@mostly(0.9)
def test_what_a_driver_holds_is_on_no_clock(duration: float, hz: float, seed: int) -> None:
    """Steps every 0.3 to 1 s, at once or within 0.15 s; of the spans in which it is seen to be held, most."""
    held = [span for span in spans(*moved_by_foot(seed, hz, duration)) if span.update > 0.135]
    assert duration > 0.0 or len(held) >= 4
    assert sum(not span.clock for span in held) >= 0.5 * len(held)


@pytest.mark.parametrize("message_hz", [10.0, 20.0, 50.0])
@pytest.mark.parametrize("hz", [1.43, 2.0, 3.3, 4.0])
@mostly(0.9)
def test_what_a_program_holds_is_on_a_clock(hz: float, message_hz: float, seed: int) -> None:
    """At periods that are no multiple of the readings' as well; of a pedal in steps of its sensor."""
    shown = spans(*readings(seed, hz, "hold", message_hz, 0.4))
    assert sum(span.clock for span in shown) >= 0.6 * len(shown)


@pytest.mark.parametrize("adds_up", [True, False])
@pytest.mark.parametrize(("varies", "clocked"), [(0.0, True), (0.12, False)])
@pytest.mark.parametrize("hz", [10.0, 50.0])
@mostly(0.9)
def test_how_even_intervals_are_says_not_whose(
    hz: float, varies: float, clocked: bool, adds_up: bool, seed: int
) -> None:
    """A person's intervals, whose variations add up, and those of a program about a clock are judged alike."""
    rng = np.random.default_rng(seed)
    usual = rng.uniform(0.4, 0.8)
    off = varies * rng.standard_normal(int(SECONDS / usual))
    at = np.sort(usual * (np.arange(len(off)) + (np.cumsum(off) if adds_up else off)))
    t = np.arange(0.0, SECONDS, 1.0 / hz)
    shown = spans(t, np.cumsum(rng.normal(0.0, 3.0, len(at) + 1))[np.searchsorted(at, t)])
    share = np.mean([span.clock for span in shown])
    assert share >= 0.8 if clocked else share <= 0.25, share
