"""A stop while another process goes on sending: what came before it is recorded, all of it, and reading ends."""

from __future__ import annotations

import array
import os
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from canid.io.buses.bus_opener import open_bus
from canid.io.buses.bus_reader import Arrival, BusReader
from canid.io.buses.receivers.received_columns import frames_of
from canid.io.logs import open_log
from canid.io.recording.recorder import Recorder

pytestmark = pytest.mark.netns
# of this process: its tests may run while those of another worker do
GROUP, PORT = f"239.76.{os.getpid() // 254 % 254 + 1}.{os.getpid() % 254 + 1}", 43113
CONFIG = {"interface": "udp_multicast", "channel": GROUP, "hop_limit": 0}
# s; a stop takes about one. Before, it took as long as the sender went on, up to 60.
PATIENCE = 300.0

# Sends a burst of argv[2] frames, then argv[1] frames/s until it is asked to end; afterwards writes down when each
# frame had been sent, so that what was sent before the stop is known from the sender's side.
SENDER = """
import array, socket, struct, sys, threading, time
import msgpack
rate, burst, path = float(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
fields = dict(timestamp=0.0, arbitration_id=0x123, is_extended_id=False, is_remote_frame=False, is_error_frame=False,
              channel=None, dlc=8, data=bytes(8), is_fd=False, bitrate_switch=False, error_state_indicator=False)
before, after = msgpack.packb(fields).split(b"\\xc4\\x08" + bytes(8))
sent = array.array("q")
ended = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
def send():
    out.sendto(before + b"\\xc4\\x08" + struct.pack("<Q", len(sent)) + after, ("GROUP", PORT))
    sent.append(time.time_ns())
for _ in range(burst):
    send()
print("burst", flush=True)
began, n = time.monotonic(), 0
while not ended.is_set() and n < 60 * rate:
    while n < (time.monotonic() - began) * rate:
        send()
        n += 1
    time.sleep(0.0005)
open(path, "wb").write(sent.tobytes())
""".replace("GROUP", GROUP).replace("PORT", str(PORT))


class Flood:
    """The sending process."""

    def __init__(self, folder: Path, rate: float, burst: int = 0):
        self._path = folder / "sent"
        words = [sys.executable, "-c", SENDER, str(rate), str(burst), str(self._path)]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == b"burst\n"

    def end(self) -> array.array[int]:
        """Epoch ns after each frame had been sent."""
        self._process.communicate(timeout=600)
        assert self._process.returncode == 0
        sent = array.array("q")
        sent.frombytes(self._path.read_bytes())
        return sent


def numbers(data: list[bytes]) -> list[int]:
    return [int(struct.unpack("<Q", each)[0]) for each in data]


def test_a_stop_at_20000_frames_per_second(tmp_path: Path) -> None:
    """Everything sent before the stop is in the file, nothing sent a second later, and the stop takes seconds."""
    path = tmp_path / "x.blf"
    recorder = Recorder([open_bus(CONFIG)], path).start()
    flood = Flood(tmp_path, 20_000)
    time.sleep(1.5)  # 30,000 frames, which the socket holds unread
    stopped_ns = time.time_ns()
    began = time.monotonic()
    stats = recorder.stop()
    took = time.monotonic() - began
    sent = flood.end()
    found = numbers([frame.data for frame in open_log(path)])
    assert found == list(range(len(found)))
    before = sum(ns < stopped_ns for ns in sent)
    assert before > 1_000  # a busy machine sends less than was asked for
    assert len(sent) > before  # it did go on sending
    assert before <= len(found) <= sum(ns < stopped_ns + 1_000_000_000 for ns in sent)
    assert stats.written == len(found)
    assert not [event for event in recorder.events() if event.what == "left_unread"]
    assert took < PATIENCE


@pytest.mark.slow("sessions on a bus in real time")
@pytest.mark.parametrize(
    "filters", [None, [{"can_id": 0x123, "can_mask": 0x7FF}], [{"can_id": 0, "can_mask": 0x7FF}]]
)
def test_a_burst_that_waits_at_the_stop_is_read_to_its_end(
    tmp_path: Path, filters: list[dict[str, int]] | None
) -> None:
    """60,000 frames in the socket when the stop comes, more after it; also where filters hide all or none of them."""
    bus = open_bus({**CONFIG, "can_filters": filters})
    flood = Flood(tmp_path, 20_000, burst=60_000)
    got: list[Arrival] = []
    events: list[tuple[str, str]] = []
    stopping = threading.Event()
    stopping.set()
    stopped_ns = time.time_ns()
    began = time.monotonic()
    BusReader(bus, 0, got.append, stopping, lambda what, says: events.append((what, says))).run()
    took = time.monotonic() - began
    drops = bus.drops
    bus.shutdown()
    sent = flood.end()
    before = sum(ns < stopped_ns for ns in sent)
    frames = [frame for each in got for frame in frames_of(each.frames)]
    taken = len(frames) + bus.hidden
    assert before >= 60_000
    assert taken + drops >= before
    assert taken <= sum(ns < stopped_ns + 1_000_000_000 for ns in sent)
    if filters is None or filters[0]["can_id"]:
        found = numbers([frame.data for frame in frames])
        assert found[:60_000] == list(range(60_000))
    else:
        assert not got
    assert events == []
    assert took < 2 * PATIENCE
