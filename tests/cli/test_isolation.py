"""A faulty estimator process costs no frame of the recording, and the user is informed."""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path

import pytest

from canid.analysis.session import estimator_process
from canid.analysis.session.session import Result, SessionSettings, World, session
from canid.io.buses.bus_opener import open_buses
from canid.io.buses.send import onto
from canid.io.logs import open_log
from canid.ui.cli import live_session
from canid.ui.cli.output import display
from canid.ui.views.terminal_view.picture import render
from canid.ui.views.terminal_view.state import View, update
from canid.values.text import json_values
from canid.values.types import Estimate, Event, Frame
from tests.terminal import plain

# frames, and s that they take: at 1,500/s the faulty children have time to fail, and be restarted
FRAMES, SECONDS = 4500, 3.0
# s; bounds what hangs, no more
PATIENCE_S = 120.0

# A child speaks pickles; these speak as much as they need to be believed.
START = """
import os, pickle, sys, time
import numpy  # before it is ready, as the estimators' process: frames come as columns
def say(kind, payload=None):
    pickle.dump((kind, payload), sys.stdout.buffer)
    sys.stdout.buffer.flush()
"""
FAULTY = {
    "raises": START
    + """
say("ready")
seen = 0
while True:
    frames = len(pickle.load(sys.stdin.buffer)[0])
    seen += frames
    if seen > 500:
        say("failed", "ZeroDivisionError: division by zero")
        sys.exit(1)
    say("out", (frames, [], {}, []))
""",
    "hangs": START + 'say("ready")\ntime.sleep(1000)\n',
    "dies": "import sys; sys.exit(1)",
    "garbage": "import sys\nprint('hello, I am a library that prints' * 100, flush=True)\nsys.stdin.read()",
    "lies": START + 'say("out", "nonsense")\nsys.stdin.read()',
    # pages that are never touched: the limit counts them, the machine does not
    "eats memory": START
    + """
import mmap
say("ready")
heap = []
try:
    while len(heap) < 1000:
        heap.append(mmap.mmap(-1, 100_000_000, flags=mmap.MAP_PRIVATE))
except OSError as error:
    say("failed", f"{len(heap) / 10} GB, and then: {error.strerror}")
    sys.exit(1)
""",
    "speaks another protocol": START
    + "pickle.dump(7, sys.stdout.buffer); sys.stdout.flush(); sys.stdin.read()",
}


def played(tmp_path: Path) -> tuple[dict[str, str], list[Frame]]:
    """A virtual bus, and numbered frames with the vehicle's ids, so that they reach the estimators."""
    frames = [Frame(k * SECONDS / FRAMES, 0, 0x100 + k % 4, k.to_bytes(8, "little")) for k in range(FRAMES)]
    return {"interface": "virtual", "channel": str(tmp_path)}, frames


NAN_CHILD = (
    START
    + """
from canid.values.types import Channel, Estimate, Status
say("ready", "pedal")
while True:
    try:
        chunk = pickle.load(sys.stdin.buffer)
    except EOFError:
        say("end")
        break
    channels = {"headway_error": Channel(), "range_rate": Channel()}
    estimate = Estimate(float("nan"), "fopdt", Status.OK, "all is nan", channels, headline=True)
    say("out", (len(chunk[0]), [(float("nan"), estimate)], {}, []))
"""
)


def test_an_estimator_that_says_nan_costs_no_frame_and_breaks_no_view(
    tmp_path: Path,
) -> None:
    """Estimates that are NaN throughout, times too: all frames are recorded, JSON says null, the view goes on."""
    config, frames = played(tmp_path)
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, frames, 1.0))
    sender.start()
    view, estimates = View("nan"), 0
    last: World | None = None
    child = [sys.executable, "-c", NAN_CHILD]
    for item in session(
        buses,
        SessionSettings("generic", tmp_path / "x.blf", command=child),
        stopped=lambda: not sender.is_alive(),
    ):
        if isinstance(item, World):
            last = item
        elif isinstance(item.item, Estimate):
            estimates += 1
            view = update(view, item.item)
            row = json.loads(json_values.line(json_values.plain(item.item)))
            assert row["t"] is None
            assert row["channels"]["range_rate"]["K"]["value"] is None
            assert "FOPDT" in plain(render(view, 80, 24))
    assert estimates > 0
    assert last is not None
    assert last.estimator is not None
    assert last.estimator.restarts == 0
    assert [(f.id, f.data) for f in open_log(tmp_path / "x.blf")] == [(f.id, f.data) for f in frames]


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("fault", FAULTY)
def test_a_faulty_estimator_costs_no_frame(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All frames are recorded, the restart is reported and recorded in the journal, the session ends in time."""
    monkeypatch.setattr(estimator_process, "ANSWER_TIMEOUT_S", 0.5)
    config, frames = played(tmp_path)
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, frames, 1.0))
    sender.start()
    events: list[Event] = []
    last: World | None = None
    recording = tmp_path / "live.blf"
    child = [sys.executable, "-c", FAULTY[fault]]
    ended = 0.0

    def stopped() -> bool:
        """The frames are over, and the fault has shown: on a busy machine a child takes longer to start than they last."""
        if sender.is_alive():
            return False
        seen = any(event.what == "estimator_restarted" for event in events)
        return seen or time.monotonic() - began > PATIENCE_S

    began = time.monotonic()
    for item in session(buses, SessionSettings("generic", recording, command=child), stopped=stopped):
        if not stopped():
            ended = time.monotonic()
        if isinstance(item, World):
            last = item
        elif isinstance(item, Result) and isinstance(item.item, Event):
            events.append(item.item)
    # the frames that wait may go to one more child, which may hang once more
    assert time.monotonic() - ended < PATIENCE_S
    assert last is not None
    assert last.estimator is not None
    assert last.recorder.drops_bus == 0

    log = open_log(recording)
    assert [(f.id, f.data) for f in log] == [(f.id, f.data) for f in frames]
    assert log.damage is None

    restarts = [event for event in events if event.what == "estimator_restarted"]
    assert restarts
    assert last.estimator.restarts >= len(restarts) > 0
    assert all("restarted" in event.says for event in restarts)
    if fault == "raises":
        assert "ZeroDivisionError" in restarts[0].says
    if fault == "eats memory":
        assert "GB, and then: Cannot allocate memory" in restarts[0].says
    if fault == "hangs":
        assert "no answer" in restarts[0].says
    journal = (tmp_path / "live.events.jsonl").read_text().splitlines()
    assert sum(json.loads(line)["what"] == "estimator_restarted" for line in journal) == len(restarts)
    # not one frame is forgotten: each was estimated, or is counted as missing
    counts = last.estimator
    assert counts.done + counts.dropped == counts.offered == len(frames)


class Broken:
    """A display that cannot show what it gets."""

    def put(self, item: object) -> None:
        raise ValueError("no such number")

    def lines(self, lines: object, output: str = "") -> None:
        raise ValueError("no such number")

    def close(self) -> None:
        raise AssertionError("it is given up, not closed")


def test_a_view_that_raises_does_not_end_the_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the display raises: one line says so, every frame is recorded, the exit code is that of lost output."""
    config, frames = played(tmp_path)
    monkeypatch.setattr(display, "display", lambda view, **_: Broken())
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, frames, 1.0))
    sender.start()
    code, _ = live_session.watch(
        buses,
        SessionSettings(record=tmp_path / "x.blf"),
        View("broken"),
        stop=lambda: not sender.is_alive(),
    )
    assert code == 5
    messages = capsys.readouterr().err
    assert messages.count("no such number); the recording goes on") == 1
    assert [(f.id, f.data) for f in open_log(tmp_path / "x.blf")] == [(f.id, f.data) for f in frames]
