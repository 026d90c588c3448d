"""The terminal view at every size from 40x15 to 200x60: nothing outside the screen, what matters always inside."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.cells import cell_len

from canid.ui.terminal.spans import Span
from canid.ui.views.terminal_view.digits import FONT, large
from canid.ui.views.terminal_view.headline import main_channel
from canid.ui.views.terminal_view.picture import LEFT_SHARE, TWO_FROM_COLUMNS, Overlay, render
from canid.ui.views.terminal_view.state import HealthLine, View, frozen, update, with_status
from canid.ui.views.terminal_view.units import SpeedUnit
from canid.values.text import estimate_text
from canid.values.types import (
    Channel,
    Estimate,
    Event,
    Identifiable,
    Interval,
    LearnGate,
    MonitorReport,
    Progress,
    Sample,
    SignalFinding,
    SignalReport,
    Status,
)
from tests.terminal import plain

SIZES = st.tuples(st.integers(40, 200), st.integers(15, 60))
SOURCES = st.text(st.characters(codec="utf-8"), max_size=120)
SENTENCES = st.lists(st.from_regex(r"[a-z]{1,12}", fullmatch=True), min_size=1, max_size=14).map(" ".join)
NUMBERS = st.floats(-99.0, 99.0)
INTERVALS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(sorted).map(lambda x: Interval(x[1], x[0], x[2]))
PROGRESS = st.builds(
    Progress, st.sampled_from(("K", "tau")), st.floats(0.01, 9.0), st.floats(0.01, 1.0), st.floats(0.0, 1e4)
)  # fmt: skip
CHANNELS = st.builds(
    Channel, INTERVALS, INTERVALS, INTERVALS, INTERVALS, st.sampled_from(Identifiable), progress=st.none() | PROGRESS
)  # fmt: skip
ESTIMATES = st.builds(
    Estimate,
    st.floats(0.0, 9999.0),
    st.sampled_from(("armax", "fopdt", "sliding_window")),
    st.sampled_from(Status),
    SENTENCES,
    st.fixed_dictionaries({"headway_error": CHANNELS, "range_rate": CHANNELS}),
    NUMBERS,
    st.fixed_dictionaries({"range_rate": NUMBERS}),
    st.floats(0.0, 9999.0),
    headline=st.booleans(),
)
SAMPLES = st.builds(
    Sample, st.floats(0.0, 9999.0), NUMBERS, st.just(()), st.sampled_from(LearnGate), st.booleans(), st.just(0),
    st.fixed_dictionaries({"gap": NUMBERS, "range_rate": NUMBERS | st.just(math.nan), "speed": NUMBERS}),
)  # fmt: skip
EVENTS = st.builds(Event, st.floats(0.0, 9999.0), st.just("x"), SOURCES)
FINDINGS = st.builds(
    SignalFinding,
    st.just("x"),
    st.just(("speed",)),
    st.just(1.0),
    st.just(2.0),
    SOURCES,
    SENTENCES,
    st.booleans(),
)
REPORTS = st.lists(FINDINGS, max_size=3).map(lambda all_: SignalReport(3.0, tuple(all_)))
MONITORS = st.builds(
    MonitorReport, st.just(1.0), st.booleans(), st.just(math.nan), st.just("driver"), SENTENCES, st.just({})
)
SESSIONS = st.fixed_dictionaries(
    {
        "state": st.sampled_from(
            ("waiting", "recording", "listening", "failed: no space left", "stopping", "armed")
        ),
        "path": SOURCES,
        "frames": st.integers(0, 10**9),
        "written": st.integers(0, 10**9),
        "bytes": st.integers(0, 10**12),
        "lag": st.floats(0.0, 99.0) | st.none(),
        "drops": st.integers(0, 10**7),
        "drops_disk": st.integers(0, 10**7),
        "elapsed": st.floats(0.0, 9e4),
        "buses": st.lists(
            st.fixed_dictionaries({"name": SOURCES, "load": st.floats(0.0, 1.0) | st.none()}), max_size=4
        ),
    }
)
REPLAYS = st.fixed_dictionaries(
    {
        "t": st.floats(0.0, 9e4),
        "duration": st.none() | st.floats(0.0, 9e4),
        "paused": st.booleans(),
        "speed": st.sampled_from((1.0, 10.0, math.inf)),
    }
)
OVERLAYS = st.builds(
    Overlay,
    st.sampled_from(SpeedUnit),
    st.booleans(),
    st.sampled_from(((), (Span("paused"),))),
    st.booleans(),
)


def viewed(title: str, items: list[Any], status: dict[str, Any], lines: list[HealthLine]) -> View:
    view = View(title, lines=tuple(lines), truth=((title, title),))
    for item in items:
        view = update(view, item)
    return with_status(view, status)


VIEWS = st.builds(
    viewed,
    SOURCES,
    st.lists(SAMPLES | ESTIMATES | EVENTS | REPORTS | MONITORS, max_size=10),
    SESSIONS | REPLAYS,
    st.lists(st.builds(HealthLine, SOURCES, st.booleans()), max_size=6),
)


def squeezed(text: str) -> str:
    return "".join(text.split())


@pytest.mark.slow("pages in a browser")
@settings(max_examples=80, deadline=None)
@given(VIEWS, SIZES, OVERLAYS)
def test_nothing_is_outside_and_what_matters_is_inside(
    view: View, size: tuple[int, int], overlay: Overlay
) -> None:
    """No more rows and columns than there are; recording, drops, K, its interval and the sentence are in them."""
    columns, rows = size
    picture = render(view, columns, rows, overlay)
    assert len(picture) == rows
    lines = plain(picture).split("\n")
    assert max(map(cell_len, lines)) <= columns
    text = squeezed("".join(lines))
    if view.recording is not None:
        r = view.recording
        assert f"{r.dropped:,}dropped" in text
        frames = r.written if r.path else r.frames
        assert f"{frames:,}" in text
        assert ("REC" in text) == (
            r.state != "listening" and r.state != "armed" and bool(r.path)
        ) or "REC" in text
    else:
        assert "REPLAY" in text
    # with two columns the headline stands in the left one
    left = int(LEFT_SHARE * columns) if columns >= TWO_FROM_COLUMNS and not overlay.help else columns
    # all characters of the headline have one column; those of other lines do not matter here
    shown = squeezed("".join(line[:left] for line in lines))
    for e in view.estimates:
        if e.headline and sum(other.headline for other in view.estimates) == 1 and not overlay.help:
            assert e.estimator in shown
            assert e.status.value in shown
            assert squeezed(e.says) in shown
            name = main_channel(e.channels)
            if name is not None and e.status is Status.OK:
                assert squeezed(estimate_text.fixed(e.channels[name].K).partition(" ")[2]) in shown


@pytest.mark.parametrize(("columns", "rows"), [(200, 60), (160, 50), (120, 40), (100, 30)])
def test_no_rows_are_left_empty_at_the_end(columns: int, rows: int) -> None:
    """Where there are curves they take what is left: fewer rows are empty than there are curves."""
    iv = Interval(5.0, 4.0, 6.0)
    channels = {name: Channel(iv, iv, iv, iv, Identifiable.OK) for name in ("headway_error", "range_rate")}
    view = View("x", lines=(HealthLine("recorder"),))
    for t in range(60, 240):
        view = update(view, Estimate(float(t), "fopdt", Status.OK, "all", channels, 80.0, headline=True))
    picture = plain(render(view, columns, rows)).split("\n")
    assert sum(not line.strip(" │") for line in reversed(picture[-10:])) < 3


def test_both_estimators_fit_on_80x24() -> None:
    """All parameters of two channels of both estimators, with their intervals, on the usual terminal."""
    iv = Interval(-12.34, -22.28, -11.05)
    channels = {name: Channel(iv, iv, iv, iv, Identifiable.OK) for name in ("headway_error", "range_rate")}
    view = View("x", lines=(HealthLine("recorder"), HealthLine("can0: open   1 frames")))
    view = with_status(view, {"state": "recording", "path": "a.blf", "buses": []})
    for name in ("armax", "fopdt"):
        says = "headway error: K, τ and θ; range rate: K, τ and θ"
        view = update(view, Estimate(60.0, name, Status.OK, says, channels, 80.0, headline=name == "fopdt"))
    text = plain(render(view, 80, 24))
    assert text.count("[-22.28, -11.05]") >= 12
    assert "…" not in text


def test_a_paused_view_keeps_the_drive_and_not_the_recorder() -> None:
    """Estimates of the time of the pause; frames, drops and events of now."""
    then = with_status(
        View("x"), {"state": "recording", "path": "a.blf", "frames": 1, "written": 1, "buses": []}
    )
    channels = {"range_rate": Channel(Interval(4.0, 3.0, 5.0), status=Identifiable.GAIN_ONLY)}
    then = update(then, Estimate(60.0, "fopdt", Status.OK, "K only", channels, headline=True))
    other = {"range_rate": Channel(Interval(8.0, 7.0, 9.0), status=Identifiable.GAIN_ONLY)}
    now = update(then, Estimate(61.0, "fopdt", Status.OK, "K only", other, headline=True))
    now = update(now, Event(61.0, "mark", "mark: here"))
    now = with_status(
        now, {"state": "recording", "path": "a.blf", "frames": 777, "written": 777, "drops": 5, "buses": []}
    )
    text = plain(render(frozen(now, then), 80, 24))
    assert "[3.00, 5.00]" in text
    assert "[7.00, 9.00]" not in text
    for live in ("777 frames", "5 dropped", "mark: here"):
        assert live in text


def test_a_replay_that_goes_back_forgets_what_came_later() -> None:
    """After a seek backwards no estimate and no trend of a later time is shown."""
    view = View("x")
    for t in (1.0, 2.0, 3.0):
        channels = {"range_rate": Channel(Interval(4.0, 3.0, 5.0), status=Identifiable.GAIN_ONLY)}
        view = update(view, Sample(100.0 + t, 0.0, (), LearnGate.OPEN, True, 0, {}))
        view = update(view, Estimate(100.0 + t, "fopdt", Status.OK, "K only", channels, headline=True))
    back = update(view, Sample(10.0, 0.0, (), LearnGate.OPEN, True, 0, {}))
    assert len(view.trend) == 3
    assert (back.t, back.trend, back.estimates, back.last_ok) == (10.0, (), (), ())


@pytest.mark.parametrize("digit", "0123456789")
def test_every_digit_differs_from_every_other(digit: str) -> None:
    """Ten different pictures of three rows and three columns."""
    picture = large(digit)
    assert [len(row) for row in picture] == [3, 3, 3]
    assert [other for other in FONT if large(other) == picture] == [digit]
