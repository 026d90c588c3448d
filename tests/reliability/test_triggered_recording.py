"""`canid record --trigger` between processes: what is recorded, when the child dies, and when the recorder is killed."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from benchmarks.reliability.recording import Recording, until
from canid.io.buses import python_can
from canid.io.logs import open_log
from canid.io.logs.reader_state import Note
from canid.io.recording.journal import journal_path
from tests.fixtures.readers import by_python_can
from tests.fixtures.traffic import BUS

PRE_S, POST_S = 0.5, 0.3
WORDS = ("--vehicle", "generic", "--trigger", "brake > 0", "--pre", PRE_S, "--post", POST_S)
BRAKE_ID = 0x140
# s: kill -9 costs 0.25 s on a machine that is not busy
MAX_LOSS_S = 4 * 0.25


class Drive:
    """A thread that sends 500 numbered frames/s, and the brake's state every tenth; `pulse` presses it for one frame."""

    def __init__(self) -> None:
        self._pulses = 0
        self._stopping = threading.Event()
        self.sent = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def pulse(self) -> None:
        self._pulses += 1

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        can = python_can.load()
        bus: Any = can.Bus(**BUS)
        began = time.monotonic()
        while not self._stopping.is_set():
            while self.sent < (time.monotonic() - began) * 500:
                k = self.sent
                if k % 10 == 0:
                    pressed, self._pulses = self._pulses > 0, max(self._pulses - 1, 0)
                    message = can.Message(arbitration_id=BRAKE_ID, data=[pressed, 0], is_extended_id=False)
                else:
                    message = can.Message(
                        arbitration_id=0x300, data=k.to_bytes(4, "big"), is_extended_id=False
                    )
                bus.send(message)
                self.sent += 1
            time.sleep(0.002)
        bus.shutdown()


class Seen(NamedTuple):
    """A frame of a file, with its stamp in µs since 1970."""

    us: float
    id: int
    data: bytes


def frames_of(path: Path) -> list[Seen]:
    """What canid reads, once python-can has read the same."""
    log = open_log(path)
    frames, start = list(log), log.start_ns
    assert log.damage is None
    assert start is not None
    assert by_python_can(path).frames == [(f.id, f.data) for f in frames]
    return [Seen((start + round(f.t * 1e9)) / 1000, f.id, f.data) for f in frames]


def inside(frames: list[Seen]) -> list[Seen]:
    """The definition, offline: at most `PRE_S` before or `POST_S` after a frame while the brake is pressed."""
    true, pressed = [], False
    for frame in frames:
        pressed = bool(frame.data[0]) if frame.id == BRAKE_ID else pressed
        true += [frame.us] if pressed else []
    return [f for f in frames if any(at - PRE_S * 1e6 <= f.us <= at + POST_S * 1e6 for at in true)]


def events_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in journal_path(path).read_text().splitlines()]


def notes_of(path: Path) -> list[Note]:
    """The events in the log itself, and the row of the frame behind each."""
    notes: list[Note] = []
    for _ in open_log(path).columns(notes=notes):
        pass
    return notes


def child_of(recording: Recording) -> int:
    """The process that evaluates, which any thread of the recorder may have started."""
    tasks = Path(f"/proc/{recording.process.pid}/task").iterdir()
    found = [int(word) for task in tasks for word in (task / "children").read_text().split()]
    return found[0]


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.usefixtures("between_processes")
def test_pulses_of_one_frame_are_recorded_to_the_frame(tmp_path: Path) -> None:
    """Next to a recording of everything: the same frames and stamps within the windows, no other, none twice.

    The first pulse comes while the child that evaluates still imports.
    """
    plain = Recording(tmp_path / "all.blf", talk=tmp_path)
    triggered = Recording(tmp_path / "x.blf", *WORDS, talk=tmp_path)
    drive = Drive()
    until(lambda: drive.sent > 300)
    drive.pulse()
    until(lambda: drive.sent > 1500)
    for _ in range(2):  # two that overlap
        drive.pulse()
        time.sleep(0.5)
    until(lambda: drive.sent > 2600)
    drive.pulse()  # one whose window the end cuts
    time.sleep(0.15)
    drive.stop()
    assert (triggered.end(), plain.end()) == (143, 143)
    everything, found = frames_of(tmp_path / "all.blf"), frames_of(tmp_path / "x.blf")
    assert found == inside(everything)
    assert len(everything) == drive.sent > len(found) + 800
    what = [(e["what"], e["says"]) for e in events_of(tmp_path / "x.blf") if e["what"].startswith("trigger")]
    assert [name for name, _ in what] == ["trigger_armed", *3 * ["trigger", "trigger_end"]]
    assert "brake > 0" in what[1][1]
    notes = [n for n in notes_of(tmp_path / "x.blf") if n.event.what in ("trigger", "trigger_end")]
    assert [n.event.says for n in notes] == [says for name, says in what[1:]]
    # a marker stands before the frame that triggered, or behind the last one of the window
    assert [found[n.row].data[0] for n in notes[::2]] == [1, 1, 1]
    assert all(found[n.row - 1].us < found[n.row].us - 100_000 for n in notes[1:-1:2])
    status = triggered.reported()
    assert status["trigger"]["windows"] == 3
    assert (status["frames"], status["written"]) == (drive.sent, len(found))


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.usefixtures("between_processes")
def test_a_child_that_is_killed_costs_no_frame_of_a_window(tmp_path: Path) -> None:
    """kill -9 of the process that evaluates, with pulses around it: all windows are there; what it had in hand as well."""
    plain = Recording(tmp_path / "all.blf", talk=tmp_path)
    triggered = Recording(tmp_path / "x.blf", *WORDS, talk=tmp_path)
    drive = Drive()
    drive.pulse()
    until(lambda: '"what": "trigger"' in journal_text(tmp_path / "x.blf"))  # it evaluates
    child = child_of(triggered)
    os.kill(child, signal.SIGSTOP)  # so that it has frames in hand
    drive.pulse()
    time.sleep(0.4)
    os.kill(child, signal.SIGKILL)
    drive.pulse()
    time.sleep(0.05)
    drive.pulse()
    until(lambda: "trigger_evaluated" in journal_text(tmp_path / "x.blf"))
    time.sleep(1.0)
    drive.stop()
    assert (triggered.end(), plain.end()) == (143, 143)
    everything, found = frames_of(tmp_path / "all.blf"), frames_of(tmp_path / "x.blf")
    kept = set(found)
    assert [f for f in inside(everything) if f not in kept] == []
    assert found == [f for f in everything if f in kept]  # in order, none twice
    assert "trigger_not_evaluated" in journal_text(tmp_path / "x.blf")
    assert triggered.reported()["frames"] == len(everything) == drive.sent


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.usefixtures("between_processes")
def test_a_kill_inside_a_window_keeps_the_pre_trigger_part(tmp_path: Path) -> None:
    """kill -9 of the recorder after a trigger: from `PRE_S` before it on, all but the last tenths of a second is there."""
    triggered = Recording(tmp_path / "x.blf", *WORDS[:-1], 60, talk=tmp_path)
    drive = Drive()
    until(lambda: drive.sent > 500)
    drive.pulse()
    until(lambda: '"what": "trigger"' in journal_text(tmp_path / "x.blf"))
    time.sleep(1.0)
    instant = triggered.kill()
    drive.stop()
    found = frames_of(tmp_path / "x.blf")
    pressed = next(f.us for f in found if f.id == BRAKE_ID and f.data[0])
    assert found[0].us <= pressed - PRE_S * 1e6 + 30_000
    assert instant * 1e6 - found[-1].us < MAX_LOSS_S * 1e6
    numbers = [int.from_bytes(f.data, "big") for f in found if f.id == 0x300]
    assert numbers == [k for k in range(numbers[0], numbers[-1] + 1) if k % 10]


def journal_text(path: Path) -> str:
    try:
        return journal_path(path).read_text()
    except OSError:
        return ""
