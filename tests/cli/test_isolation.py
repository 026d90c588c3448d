"""Whatever the estimator's process does, every frame is recorded and the user is told."""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path

import pytest

from canid import estimating
from canid.frames import open_log
from canid.frames.bus import open_buses
from canid.frames.send import onto
from canid.session import Result, World, session
from canid.types import Event, Frame

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
    "speaks another protocol": START
    + "pickle.dump(7, sys.stdout.buffer); sys.stdout.flush(); sys.stdin.read()",
}


@pytest.mark.parametrize("fault", FAULTY)
def test_a_faulty_estimator_costs_no_frame(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All frames are recorded, the restart is told and stands in the journal, the session ends in time."""
    monkeypatch.setattr(estimating, "HANG", 0.5)
    # the vehicle's ids, so that what is sent deserves to be estimated
    frames = [Frame(k * SECONDS / FRAMES, 0, 0x100 + k % 4, k.to_bytes(8, "little")) for k in range(FRAMES)]
    config = {"interface": "virtual", "channel": str(tmp_path)}
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
    if fault == "hangs":
        assert "no answer" in restarts[0].says
    journal = (tmp_path / "live.events.jsonl").read_text().splitlines()
    assert sum(json.loads(line)["what"] == "estimator_restarted" for line in journal) == len(restarts)
    # not one frame is forgotten: each was estimated, or is counted as missing
    counts = last.estimator
    assert counts.done + counts.dropped == counts.offered == len(frames)
