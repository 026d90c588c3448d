"""A triggered recording's gate: evaluation that hangs or fails, a slow disk, bounds in memory, and marks."""

from __future__ import annotations

import gc
import json
import os
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.session.session import Result, SessionSettings, World, session
from canid.io.buses import python_can
from canid.io.buses.bus_opener import open_buses
from canid.io.logs import open_log
from canid.io.recording import trigger_gate
from canid.io.recording.controls import Controls
from canid.io.recording.pre_trigger_buffer import MARK_MARGIN_S, MAX_BUFFERED_FRAMES, PreTriggerBuffer
from canid.io.recording.trigger_gate import ANSWER_TIMEOUT_S, TriggerGate
from canid.signals.triggers.trigger import MAX_PRE_S, Trigger
from canid.values.frame_columns import columns_of, frames_of
from canid.values.types import Columns, Event, Frame

# bytes of a frame in the buffer, as docs/triggers.md states it for classic CAN
STATED_FRAME_BYTES = 40


class Log:
    """Keeps what it gets; `stuck`: it writes nothing."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.stuck = False
        self._written = 0

    @property
    def waiting(self) -> int:
        if not self.stuck:
            self._written = len(self.frames)
        return len(self.frames) - self._written

    def put(self, frames: Columns, at: float, start_ns: int) -> None:
        self.frames += frames_of(frames)

    def put_event(self, event: Event) -> None:
        pass


def frames_from(first: int, count: int, rate: float = 1000.0) -> list[Frame]:
    return [Frame(k / rate, 0, k % 2048, k.to_bytes(8, "big")) for k in range(first, first + count)]


def columns_from(first: int, count: int) -> Columns:
    return columns_of(frames_from(first, count))


def gate_with(log: Log, **options: Any) -> tuple[TriggerGate, list[Event]]:
    events: list[Event] = []
    gate = TriggerGate(0.1, 0.1, **({"evaluating": True} | options))
    gate.bind(log, events.append)
    return gate, events


def what(events: list[Event]) -> list[str]:
    return [event.what for event in events]


def test_what_nobody_evaluates_is_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    """No answer for longer than the timeout: everything goes to the log, is reported, and ends with the next answers."""
    monkeypatch.setattr(trigger_gate, "ANSWER_TIMEOUT_S", 0.05)
    log = Log()
    gate, events = gate_with(log)
    gate.put(columns_from(0, 500), time.monotonic(), 0)
    assert log.frames == []
    time.sleep(0.06)
    gate.tick()
    assert log.frames == frames_from(0, 500)
    assert gate.stats()[:2] == ("recording_all", "conditions not evaluated")
    assert what(events) == ["trigger_not_evaluated", "trigger"]
    gate.answered(500, [])  # late: it was decided without it
    gate.put(columns_from(500, 4000), time.monotonic(), 0)
    gate.answered(4000, [])
    assert "trigger_evaluated" in what(events)
    gate.finish()
    assert log.frames == frames_from(0, 600)  # and `post` after the last one


def test_a_consumer_that_raises_makes_it_record_everything() -> None:
    """Which frames were evaluated is unknown then: from there on all are kept."""
    log = Log()
    gate, _ = gate_with(log)
    gate.put(columns_from(0, 300), time.monotonic(), 0)
    gate.answered(300, [])
    gate.give_up()
    gate.put(columns_from(300, 3000), time.monotonic(), 0)
    gate.finish()
    assert log.frames[-3000:] == frames_from(300, 3000)


def test_the_end_records_what_was_not_evaluated(monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording that ends before the first answer holds all that came."""
    monkeypatch.setattr(trigger_gate, "LAST_ANSWERS_S", 0.05)
    log = Log()
    gate, events = gate_with(log)
    gate.put(columns_from(0, 700), time.monotonic(), 0)
    gate.finish()
    assert log.frames == frames_from(0, 700)
    assert "the recording ended before" in events[0].says
    assert gate.waited >= 0.05  # what the end of the session waits less for the same process


def test_a_slow_disk_gets_no_more_than_it_has_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A window larger than the log's queue is handed over in parts; the end waits for it, and nothing is lost."""
    monkeypatch.setattr(trigger_gate, "MAX_HANDED_FRAMES", 1000)
    log = Log()
    log.stuck = True
    gate, _ = gate_with(log)
    for first in range(0, 5000, 100):
        gate.put(columns_from(first, 100), time.monotonic(), 0)
        gate.answered(100, [(0, 100, "x")])
    assert 1000 <= len(log.frames) <= 1100
    ending = threading.Thread(target=gate.finish)
    ending.start()
    time.sleep(0.05)
    assert ending.is_alive()
    log.stuck = False
    ending.join(60.0)
    assert log.frames == frames_from(0, 5000)


def test_a_full_buffer_records_what_is_unknown_and_reports_what_is_missing() -> None:
    """More frames than the buffer holds: unknown ones are recorded; known ones before a trigger go, and it says so."""
    log = Log()
    gate, events = gate_with(log, max_frames=1000)
    for first in range(0, 3000, 100):
        gate.put(columns_from(first, 100), time.monotonic(), 0)
    assert len(log.frames) >= 1900
    assert what(events)[0] == "trigger_not_evaluated"
    gate, events = gate_with(Log(), max_frames=50)
    for first in range(0, 500, 10):
        gate.put(columns_from(first, 10), time.monotonic(), 0)
        gate.answered(10, [])
    gate.put(columns_from(500, 1), time.monotonic(), 0)
    gate.answered(1, [(0, 1, "brake > 0")])
    (begin,) = [event for event in events if event.what == "trigger"]
    assert " s of it were not in the buffer any more" in begin.says


def test_a_full_bus_fits_into_the_stated_memory() -> None:
    """8,000 frames/s: all of the last `pre` s are kept, no more, and a frame takes what is stated.

    With `MAX_PRE_S` they are within the bound of the buffer; `python -m benchmarks.triggers` fills it.
    """
    rate, batch, pre, seconds = 8000, 500, 8, 12
    assert (MAX_PRE_S + MARK_MARGIN_S + ANSWER_TIMEOUT_S) * rate < MAX_BUFFERED_FRAMES
    buffer = PreTriggerBuffer(pre, 1.0)
    gc.collect()
    before = resident()
    for first in range(0, seconds * rate, batch):
        frames = frames_from(first, batch, rate)
        buffer.put(columns_of(frames), at=frames[0].t)
        buffer.answered(batch, [])
        assert not any(buffer.take())
    used = resident() - before
    assert pre * rate <= buffer.buffered <= (pre + MARK_MARGIN_S + 0.1) * rate
    assert used < 1.1 * STATED_FRAME_BYTES * buffer.buffered
    last = frames_from(seconds * rate, 1, rate)
    buffer.put(columns_of(last), at=last[0].t)
    buffer.answered(1, [(0, 1, "x")])
    taken = [frame for item in buffer.take() if isinstance(item, Columns) for frame in frames_of(item)]
    assert taken == frames_from((seconds - pre) * rate, pre * rate + 1, rate)


def resident() -> int:
    """Bytes of memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_marks_alone_trigger_without_a_child(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """`--trigger mark`: a person's mark keeps what came before and after it, and stands in log and journal."""
    name = request.node.name
    can = python_can.load()
    sender: Any = can.Bus(name, interface="virtual")
    controls = Controls()
    running = session(
        open_buses([{"interface": "virtual", "channel": name}]),
        SessionSettings(
            record=tmp_path / "x.blf", duration=3.0, trigger=Trigger(("mark",), pre=0.4, post=0.3)
        ),
        controls=controls,
    )
    began, sent, states, marked = time.monotonic(), 0, [], False
    worlds: list[World] = []

    def send() -> None:
        nonlocal sent
        while time.monotonic() - began < 2.7:
            message = can.Message(arbitration_id=1, data=sent.to_bytes(4, "big"), is_extended_id=False)
            sender.send(message)
            sent += 1
            time.sleep(0.005)

    thread = threading.Thread(target=send)
    thread.start()
    for item in running:
        assert not isinstance(item, Result)
        worlds.append(item)
        states.append(item.recorder.state)
        if item.elapsed > 1.2 and not marked:
            controls.mark("overtaking")
            marked = True
    thread.join()
    sender.shutdown()
    frames = list(open_log(tmp_path / "x.blf"))
    events = [json.loads(line) for line in (tmp_path / "x.events.jsonl").read_text().splitlines()]
    assert "trigger: mark: overtaking" in next(e["says"] for e in events if e["what"] == "trigger")
    numbers = [int.from_bytes(frame.data, "big") for frame in frames]
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert 0 < len(frames) < sent
    assert frames[-1].t - frames[0].t <= 0.7 + 1e-6
    assert {"armed", "recording (trigger: mark: overtaking)"} <= set(states)
    last = worlds[-1].recorder
    assert (last.frames, last.written, last.trigger and last.trigger.windows) == (sent, len(frames), 1)


def test_a_mark_just_before_the_end_is_kept(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """A mark, and the stop at once: the mark stands in the journal."""
    controls = Controls()
    controls.mark("last words")
    controls.stop()
    buses = open_buses([{"interface": "virtual", "channel": request.node.name}])
    for _ in session(buses, SessionSettings(record=tmp_path / "x.blf"), controls=controls):
        pass
    assert "last words" in (tmp_path / "x.events.jsonl").read_text(encoding="utf-8")
