"""What canid owes a bus: can-utils and raw sockets check it on kernel SocketCAN."""

from __future__ import annotations

import json
import random
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from canid.io.buses.bus_opener import open_bus
from canid.io.buses.receivers import socketcan
from canid.io.logs import open_log, write_log
from canid.values.types import Flag, Frame
from tests.bus.network import counted, error_frame, ip, numbers, sending

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(600)]
BUS = ("-i", "socketcan", "-c", "vcan0", "--fd")
# the lengths that CAN FD has (ISO 11898-1, table of DLCs)
LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def lines(recording: Path) -> list[str]:
    """A log's frames in candump's words, written down here a second time."""
    return [line(frame) for frame in open_log(recording)]


def line(frame: Frame) -> str:
    """One frame as `candump -L` prints it, see its manual: id#data, id#R, id##flags data."""
    name = f"{frame.id:08X}" if frame.flags & Flag.EXTENDED else f"{frame.id:03X}"
    if frame.flags & Flag.REMOTE:
        return f"{name}#R{frame.length or ''}"
    if frame.flags & Flag.FD:
        bits = bool(frame.flags & Flag.BRS) + 2 * bool(frame.flags & Flag.ESI)
        return f"{name}##{bits:X}{frame.data.hex().upper()}"
    return f"{name}#{frame.data.hex().upper()}"


def seen(candump: Any) -> list[str]:
    """What the independent listener has seen, without times and channel."""
    candump.end(signal.SIGTERM)
    words = [text.split()[2] for text in candump.printed().splitlines()]
    # since Linux 5.14 the kernel itself marks a CAN FD frame with a 4 among the flags (CANFD_FDF)
    return [re.sub("##(.)", lambda found: f"##{int(found[1], 16) & 3:X}", word) for word in words]


def mixed(seed: int, n: int) -> list[Frame]:
    """Frames of every kind, a millisecond apart."""
    rng = random.Random(seed)
    frames = []
    for i in range(n):
        extended = rng.choice((0, int(Flag.EXTENDED)))
        name = rng.randrange(1 << (29 if extended else 11))
        kind = rng.choice(("classic", "remote", "fd", "fd"))
        if kind == "remote":
            frames.append(Frame(i * 1e-3, 0, name, b"", extended | Flag.REMOTE, rng.randrange(9)))
        elif kind == "classic":
            frames.append(Frame(i * 1e-3, 0, name, rng.randbytes(rng.randrange(9)), extended))
        else:
            bits = rng.choice((0, int(Flag.BRS))) | rng.choice((0, int(Flag.ESI)))
            frames.append(
                Frame(i * 1e-3, 0, name, rng.randbytes(rng.choice(LENGTHS)), extended | Flag.FD | bits)
            )
    # the largest, with the bit-rate switch, for certain
    frames.append(Frame(n * 1e-3, 0, 0x7FF, bytes(range(64)), int(Flag.FD | Flag.BRS)))
    return frames


@pytest.fixture
def raw() -> Iterator[socket.socket]:
    """A plain CAN socket of the standard library, to send with."""
    with sending("vcan0") as sock:
        yield sock


def transmitted(device: str) -> int:
    """How many packets have left through it."""
    reported = subprocess.run(
        ["ip", "-s", "-j", "link", "show", device], check=True, capture_output=True
    ).stdout
    return int(json.loads(reported)[0]["stats64"]["tx"]["packets"])


def dropped(record: Any) -> int:
    """How many frames a recorder that has ended says that it did not get."""
    reported = re.search(r"([\d,]+) dropped", record.printed())
    assert reported, record.printed()
    return int(reported[1].replace(",", ""))


def test_canplayer_is_recorded_whole(
    tmp_path: Path, start: Callable[..., Any], listening: Callable[..., Any]
) -> None:
    """What can-utils' canplayer plays onto the bus is in the recording: every kind of frame, in order."""
    wanted = [line(frame) for frame in mixed(seed=1, n=2000)]
    played = tmp_path / "played.log"
    # its own text format; a remote frame's length is not played by all versions of canplayer
    wanted = [text for text in wanted if "#R" not in text]
    played.write_text("".join(f"({1e9 + i * 1e-3:.6f}) vcan0 {text}\n" for i, text in enumerate(wanted)))
    recording = tmp_path / "heard.blf"
    record = listening("record", *BUS, "-o", recording)
    player = start("canplayer", "-I", played)
    assert player.end() == 0
    assert record.end(signal.SIGTERM) == 143
    assert lines(recording) == wanted


def test_candump_sees_what_canid_plays_and_nothing_else(
    tmp_path: Path, canid: Callable[..., Any], listening: Callable[..., Any], candump: Callable[[str], Any]
) -> None:
    """`replay --onto` puts each frame on the bus once; recording at the same time adds none, and loses none."""
    frames = mixed(seed=2, n=2000)
    log, recording = tmp_path / "log.blf", tmp_path / "heard.blf"
    write_log(log, frames, 1.7e9)
    record = listening("record", *BUS, "-o", recording)
    witness = candump("vcan0")
    sender = canid("replay", log, "--onto", *BUS)
    assert sender.end() == 0, sender.says()
    assert record.end(signal.SIGINT) == 130
    assert seen(witness) == [line(frame) for frame in frames]
    assert lines(recording) == [line(frame) for frame in frames]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_loses_nothing(
    number: int, tmp_path: Path, listening: Callable[..., Any], raw: socket.socket
) -> None:
    """A burst, and the signal at the same time: all of it is in the file, its start time too.

    But for what the kernel has dropped before any socket and counted at the device: received and counted are all.
    """
    recording = tmp_path / "heard.blf"
    before = time.time()
    record = listening("record", *BUS, "-o", recording)
    for i in range(3000):
        raw.send(counted(i))
    assert record.end(number) == 128 + number
    kept = numbers(recording)
    assert kept == sorted(set(kept))
    assert len(kept) + dropped(record) == 3000
    assert before <= open_log(recording).start_utc <= time.time()


def test_kernel_drops_are_counted(raw: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a small receive buffer the kernel drops frames: received and counted are all that were sent."""
    # the kernel doubles it: space for some twenty frames
    monkeypatch.setattr(socketcan, "RECEIVE_BUFFER_BYTES", 8192)
    bus = open_bus({"interface": "socketcan", "channel": "vcan0"})
    for i in range(1000):
        raw.send(counted(i))
    dropped = bus.drops  # before a frame was read, and after the last one that was kept
    received = 0
    while bus.recv(0.0):
        received += 1
    assert 0 < received < 1000
    assert received + dropped == 1000
    assert bus.drops == dropped
    bus.shutdown()


def test_a_recorder_that_stood_still_tells_its_drops(
    tmp_path: Path, start: Callable[..., Any], raw: socket.socket
) -> None:
    """A process that stands loses what the kernel cannot keep, and says how many; the rest is in the file."""
    recording = tmp_path / "heard.blf"
    # the whole command, with a buffer that a few hundred frames fill instead of 77,000
    small = "from canid.io.buses.receivers import socketcan; socketcan.RECEIVE_BUFFER_BYTES = 100_000; "
    record = start(
        sys.executable, "-c", small + "from canid.ui.cli import main; main()", "record", *BUS, "-o", recording
    )
    record.wait_for("listen-only")
    record.process.send_signal(signal.SIGSTOP)
    total = 5000
    for i in range(total):
        raw.send(counted(i))
    record.process.send_signal(signal.SIGCONT)
    # `main()` alone returns the status, it does not end with it
    assert record.end(signal.SIGTERM) == 0
    kept = numbers(recording)
    assert kept == sorted(set(kept))
    assert dropped(record) > 0
    assert len(kept) + dropped(record) == total


def test_a_physical_interface_is_refused(
    tmp_path: Path, canid: Callable[..., Any], candump: Callable[[str], Any]
) -> None:
    """`--onto` anything but a virtual bus sends nothing and ends with 2, unless that channel is armed."""
    log = tmp_path / "log.blf"
    write_log(log, mixed(seed=3, n=10), 1.7e9)
    ip("add", "wire0", "type", "dummy")
    try:
        ip("set", "wire0", "up")
        for arm in ((), ("--arm", "vcan0"), ("--arm", "wire1")):
            sender = canid("replay", log, "--onto", "-i", "socketcan", "-c", "wire0", *arm)
            assert sender.end() == 2
            assert sender.says().count("\n") == 1
            assert "will not send to socketcan wire0" in sender.says()
        sent = transmitted("wire0")
        # armed: it goes as far as the socket, and a dummy is no CAN device
        armed = canid("replay", log, "--onto", "-i", "socketcan", "-c", "wire0", "--arm", "wire0")
        assert armed.end() == 3
        assert "Traceback" not in armed.says()
        assert transmitted("wire0") == sent
    finally:
        ip("del", "wire0")


def test_an_interface_that_goes_down_ends_it_with_a_complete_file(
    tmp_path: Path, listening: Callable[..., Any]
) -> None:
    """The bus is taken away: one clear line, exit 3, and all frames until then are in the file."""
    recording = tmp_path / "heard.blf"
    record = listening("record", "-i", "socketcan", "-c", "vcan1", "--fd", "-o", recording)
    with sending("vcan1") as raw:
        for i in range(500):
            raw.send(counted(i))
    ip("set", "vcan1", "down")
    try:
        assert record.end() == 3, record.says()
    finally:
        ip("set", "vcan1", "up")
    assert "socketcan vcan1 is lost" in record.says()
    assert "Traceback" not in record.says()
    assert numbers(recording) == list(range(500))
    assert open_log(recording).damage is None


def test_an_interface_that_comes_back_goes_on(tmp_path: Path, listening: Callable[..., Any]) -> None:
    """Down for a short time: the recording goes on in the same file, and both events are reported."""
    recording = tmp_path / "heard.blf"
    record = listening("record", *BUS, "-o", recording)
    with sending("vcan0") as raw:
        for i in range(100):
            raw.send(counted(i))
    # the socket keeps the error until it is read: none can be missed
    ip("set", "vcan0", "down")
    ip("set", "vcan0", "up")
    record.wait_for("is lost")
    record.wait_for("is back")
    with sending("vcan0") as raw:  # the first one has seen the bus go down
        for i in range(100, 200):
            raw.send(counted(i))
    assert record.end(signal.SIGTERM) == 143
    assert numbers(recording) == list(range(200))


def test_error_frames_and_bus_off_are_logged_and_reported(
    tmp_path: Path, listening: Callable[..., Any], raw: socket.socket
) -> None:
    """Error counters are shown, bus-off stands in the journal, and nothing is restarted."""
    recording, reported = tmp_path / "heard.blf", tmp_path / "reported.json"
    record = listening("record", *BUS, "-o", recording, "--json", reported)
    raw.send(counted(0))
    raw.send(error_frame(0x204, bytes([0, 0x20, 0, 0, 0, 0, 128, 96])))  # error passive, with counters
    raw.send(error_frame(0x40, bytes(8)))  # bus-off
    raw.send(counted(1))
    record.wait_for("bus off")
    assert record.end(signal.SIGTERM) == 143
    frames = list(open_log(recording))
    assert [bool(frame.flags & Flag.ERROR) for frame in frames] == [False, True, True, False]
    bus = json.loads(reported.read_text().splitlines()[-1])["buses"][0]
    assert (bus["errors"], bus["controller"], bus["tec"], bus["rec"]) == (2, "bus_off", 128, 96)
    # a vcan has no clock of its own: asked for hardware stamps, it gives the kernel's
    assert bus["clock"] == "kernel"
    journal = (tmp_path / "heard.events.jsonl").read_text().splitlines()
    told_of = [json.loads(text)["what"] for text in journal]
    assert [what for what in told_of if what != "listen_only"] == ["error_passive", "bus_off"]


def test_what_the_kernel_dropped_stands_in_the_journal(
    tmp_path: Path, start: Callable[..., Any], raw: socket.socket
) -> None:
    """A recorder that was stopped: the event reports as many drops as the last line."""
    recording = tmp_path / "heard.blf"
    small = "from canid.io.buses.receivers import socketcan; socketcan.RECEIVE_BUFFER_BYTES = 100_000; "
    record = start(
        sys.executable, "-c", small + "from canid.ui.cli import main; main()", "record", *BUS, "-o", recording
    )
    record.wait_for("listen-only")
    record.process.send_signal(signal.SIGSTOP)
    for i in range(3000):
        raw.send(counted(i))
    record.process.send_signal(signal.SIGCONT)
    record.wait_for("frames were dropped")
    assert record.end(signal.SIGTERM) == 0
    events = [json.loads(text) for text in (tmp_path / "heard.events.jsonl").read_text().splitlines()]
    says = [event["says"] for event in events if event["what"] == "frames_dropped"]
    counted_ = int(re.search(r"\(([\d,]+) in all\)", says[-1])[1].replace(",", ""))  # type: ignore[index]
    assert len(numbers(recording)) + counted_ == 3000
