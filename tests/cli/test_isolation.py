"""Whatever the estimator's process does, every frame is recorded and the user is told."""

from __future__ import annotations

import io
import json
import sys
import threading
import time
from pathlib import Path

import pytest
from rich.console import Console

from canid import estimating
from canid.cli import sessions, show
from canid.frames import open_log
from canid.frames.bus import open_buses
from canid.frames.send import onto
from canid.session import Result, World, session
from canid.types import Estimate, Event, Frame
from canid.views import as_json
from canid.views.screen import View, render, update

# frames, and s that they take: at 1,500/s the faulty children have time to fail, and be restarted
FRAMES, SECONDS = 4500, 3.0

# A child speaks pickles; these speak as much as they need to be believed.
START = """
import os, pickle, sys, time
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
    batch = pickle.load(sys.stdin.buffer)
    seen += len(batch)
    if seen > 500:
        say("failed", "ZeroDivisionError: division by zero")
        sys.exit(1)
    say("out", (len(batch), [], {}, []))
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
    """A virtual bus, and numbered frames with the vehicle's ids, so that they deserve to be estimated."""
    frames = [Frame(k * SECONDS / FRAMES, 0, 0x100 + k % 4, k.to_bytes(8, "little")) for k in range(FRAMES)]
    return {"interface": "virtual", "channel": str(tmp_path)}, frames


NAN_CHILD = (
    START
    + """
from canid.types import Channel, Estimate, Status
say("ready", "pedal")
while True:
    try:
        batch = pickle.load(sys.stdin.buffer)
    except EOFError:
        say("end")
        break
    channels = {"headway_error": Channel(), "range_rate": Channel()}
    told = Estimate(float("nan"), "fopdt", Status.OK, "all is nan", channels, headline=True)
    say("out", (len(batch), [(float("nan"), told)], {}, []))
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
    screen, told = View("nan"), 0
    last: World | None = None
    child = [sys.executable, "-c", NAN_CHILD]
    for item in session(
        buses,
        "generic",
        record=tmp_path / "x.blf",
        stopped=lambda: not sender.is_alive(),
        command=child,
    ):
        if isinstance(item, World):
            last = item
        elif isinstance(item.item, Estimate):
            told += 1
            screen = update(screen, item.item)
            row = json.loads(as_json.line(as_json.estimate(item.item)))
            assert row["t"] is None
            assert row["channels"]["range_rate"]["K"]["value"] is None
            page = io.StringIO()
            Console(file=page).print(render(screen))
            assert "fopdt" in page.getvalue()
    assert told > 0
    assert last is not None
    assert last.estimator is not None
    assert last.estimator.restarts == 0
    assert [(f.id, f.data) for f in open_log(tmp_path / "x.blf")] == [(f.id, f.data) for f in frames]


@pytest.mark.parametrize("fault", FAULTY)
def test_a_faulty_estimator_costs_no_frame(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All frames are recorded, the restart is told and stands in the journal, the session ends in time."""
    monkeypatch.setattr(estimating, "HANG", 0.5)
    config, frames = played(tmp_path)
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, frames, 1.0))
    sender.start()
    told: list[Event] = []
    last: World | None = None
    recording = tmp_path / "live.blf"
    child = [sys.executable, "-c", FAULTY[fault]]
    ended = 0.0
    for item in session(
        buses, "generic", record=recording, stopped=lambda: not sender.is_alive(), command=child
    ):
        if sender.is_alive():
            ended = time.monotonic()
        if isinstance(item, World):
            last = item
        elif isinstance(item, Result) and isinstance(item.item, Event):
            told.append(item.item)
    # the frames that wait may go to one more child, which may hang once more
    assert time.monotonic() - ended < 8.0
    assert last is not None
    assert last.estimator is not None
    assert last.recorder.drops_bus == 0

    log = open_log(recording)
    assert [(f.id, f.data) for f in log] == [(f.id, f.data) for f in frames]
    assert log.damage is None

    restarts = [event for event in told if event.what == "estimator_restarted"]
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
    monkeypatch.setattr(show, "display", lambda view, json: Broken())
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, frames, 1.0))
    sender.start()
    code, _ = sessions.watch(
        buses,
        None,
        View("broken"),
        record=str(tmp_path / "x.blf"),
        duration=None,
        json=None,
        stop=lambda: not sender.is_alive(),
    )
    assert code == 5
    told = capsys.readouterr().err
    assert told.count("no such number); the recording goes on") == 1
    assert [(f.id, f.data) for f in open_log(tmp_path / "x.blf")] == [(f.id, f.data) for f in frames]
