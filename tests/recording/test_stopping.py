"""Stopping: what waits is written, shown while that takes time, and a disk that never answers can be left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from canid.io.buses import python_can
from canid.io.buses.bus_opener import open_buses
from canid.io.logs import open_log
from canid.io.logs.text_writers import AscWriter
from canid.io.recording import log_writer_thread
from canid.io.recording.recorder import Recorder
from canid.io.recording.recorder_stats import Stats
from canid.values.types import Columns

# s: a busy machine may need them
PATIENCE = 300.0


def recorder_of(request: pytest.FixtureRequest, path: Path, count: int) -> Recorder:
    """A recorder that has received `count` frames, of which none is written yet."""
    can = python_can.load()
    sender: Any = can.Bus(request.node.name, interface="virtual")
    recorder = Recorder(open_buses([{"interface": "virtual", "channel": request.node.name}]), path).start()
    for i in range(count):
        sender.send(can.Message(arbitration_id=i % 2048, data=i.to_bytes(4, "big"), is_extended_id=False))
    sender.shutdown()
    return recorder


def test_progress_is_shown_while_what_waits_is_written(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slow writer: the state is "stopping", frames that wait become fewer, and none is lost."""
    really = AscWriter.append_columns
    count = 3000

    def slow(self: AscWriter, chunk: Columns) -> None:
        time.sleep(0.0004 * len(chunk.t))
        really(self, chunk)

    monkeypatch.setattr(AscWriter, "append_columns", slow)
    recorder = recorder_of(request, tmp_path / "x.asc", count)
    seen: list[Stats] = []
    stats = recorder.stop(seen.append)
    assert len(seen) >= 3
    assert {each.state for each in seen} == {"stopping"}
    assert [each.written for each in seen] == sorted(each.written for each in seen)
    assert seen[-1].waiting < seen[0].waiting
    assert (stats.state, stats.written, stats.waiting) == ("stopped", count, 0)
    assert sum(1 for _ in open_log(tmp_path / "x.asc")) == count


def test_a_checkpoint_does_not_wait_for_all_that_waits(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was appended reaches the file every `CHECKPOINT` s, also while a long batch is written."""
    really = AscWriter.append_columns

    def slow(self: AscWriter, chunk: Columns) -> None:
        time.sleep(0.0003 * len(chunk.t))
        really(self, chunk)

    monkeypatch.setattr(AscWriter, "append_columns", slow)
    recorder = recorder_of(request, tmp_path / "x.asc", 4000)
    sizes: set[int] = set()
    recorder.stop(lambda stats: sizes.add((tmp_path / "x.asc").stat().st_size))
    # 1.2 s and more of writing: 4,000 lines of 60 bytes are two times less than would be written by size alone
    assert len(sizes) >= 3
    assert log_writer_thread.CHECKPOINT_S < 0.25


def test_waiting_for_a_disk_that_is_stuck_can_be_ended(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """fdatasync does not come back: progress is called on, and what it raises ends the waiting."""
    from canid.io.files import new_file

    stuck = threading.Event()
    monkeypatch.setattr(new_file, "_to_disk", lambda fd: stuck.wait(PATIENCE))

    class EndedError(Exception):
        pass

    calls = 0

    def progress(stats: Stats) -> None:
        nonlocal calls
        calls += 1
        if calls == 5:
            assert (stats.waiting, stats.written) == (0, 100)
            raise EndedError

    monkeypatch.setattr(new_file, "_open_linked", lambda *_: -1)  # the name is not synced first
    recorder = recorder_of(request, tmp_path / "x.blf", 100)
    try:
        with pytest.raises(EndedError):
            recorder.stop(progress)
        assert (
            sum(1 for _ in open_log(tmp_path / "x.blf")) == 100
        )  # a kill costs nothing now, a power cut might
    finally:
        stuck.set()


CHILD = """
import os, sys, threading, time
from canid.io.files import new_file as disk
from canid.io.buses import python_can
really = disk._to_disk
stuck = threading.Event()
def sync(fd):
    if os.path.exists(sys.argv[2]):
        stuck.wait()
    really(fd)
disk._to_disk = sync
from canid.ui.cli import main
sys.exit(main(["record", "-i", "virtual", "-c", "stuck", "-o", sys.argv[1]]))
"""


def test_a_second_signal_ends_a_recorder_whose_disk_is_stuck(tmp_path: Path) -> None:
    """The first one waits for the disk; the second one ends the process at once, with its code."""
    gate = tmp_path / "stuck"
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(tmp_path / "x.blf"), str(gate)], stderr=subprocess.PIPE
    )
    assert child.stderr is not None
    os.set_blocking(child.stderr.fileno(), False)
    end = time.monotonic() + PATIENCE
    reported = b""
    while b"listen-only" not in reported and time.monotonic() < end:
        reported += child.stderr.read() or b""
        time.sleep(0.05)
    gate.touch()
    child.send_signal(signal.SIGTERM)
    with pytest.raises(subprocess.TimeoutExpired):
        child.wait(3.0)
    began = time.monotonic()
    child.send_signal(signal.SIGTERM)
    assert child.wait(PATIENCE) == 128 + signal.SIGTERM
    assert time.monotonic() - began < PATIENCE / 3
    child.stderr.close()


ENDING = """
import os, sys, threading, time
from canid.io.files import new_file
from canid.io.buses import python_can
really, stuck = new_file._write, threading.Event()
def write(fd, at, data):
    if os.path.exists(sys.argv[2]):
        stuck.wait()
    really(fd, at, data)
new_file._write = write
def send():
    can = python_can.load()
    bus = can.Bus("ending", interface="virtual")
    while True:
        bus.send(can.Message(arbitration_id=1, data=bytes(8), is_extended_id=False))
        time.sleep(0.01)
threading.Thread(target=send, daemon=True).start()
from canid.ui.cli import main
sys.exit(main(["record", "-i", "virtual", "-c", "ending", "-o", sys.argv[1], "--duration", "2"]))
"""


@pytest.mark.slow("a recording in real time, whose disk is stuck")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_one_signal_ends_a_recorder_at_once_whose_end_duration_has_begun(number: int, tmp_path: Path) -> None:
    """As the line says that is shown meanwhile; it is the first signal."""
    gate = tmp_path / "stuck"
    words = [sys.executable, "-c", ENDING, str(tmp_path / "x.blf"), str(gate)]
    with (tmp_path / "said").open("wb") as said, subprocess.Popen(words, stderr=said) as child:
        try:
            end = time.monotonic() + PATIENCE
            while not (tmp_path / "x.blf").exists() and time.monotonic() < end:
                time.sleep(0.02)
            time.sleep(0.5)
            gate.touch()
            while b"a signal now ends at once" not in (tmp_path / "said").read_bytes():
                assert time.monotonic() < end
                time.sleep(0.02)
            began = time.monotonic()
            child.send_signal(number)
            assert child.wait(PATIENCE) == 128 + number
            assert time.monotonic() - began < PATIENCE / 3
        finally:
            child.kill()
