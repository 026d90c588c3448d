"""Bus-off, error-passive and recovery on a real controller state machine: the kernel's slcan driver on a pty."""

from __future__ import annotations

import json
import os
import random
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from canid.io.buses import devices
from canid.io.logs import open_log
from canid.values.types import Flag
from tests.bus.network import error_frame, events, ip, numbers, says, sending, shown
from tests.bus.slcan_adapter import Adapter

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(600)]
STATES = {"a": "error_active", "w": "error_warning", "p": "error_passive", "b": "bus_off"}


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    """An adapter of its own for each test."""
    try:
        made = Adapter()
    except OSError as error:
        if os.environ.get("CANID_VM"):
            raise
        pytest.skip(f"no slcan here: {error}")
    yield made
    made.close()


def counters(letter: str, rng: random.Random) -> tuple[int, int]:
    """TEC and REC of a state (ISO 11898-1, fault confinement)."""
    low, high = {"a": (0, 95), "w": (96, 127), "p": (128, 255), "b": (256, 256)}[letter]
    return (high if letter == "b" else rng.randint(low, high)), rng.randint(0, min(high, 127))


@pytest.mark.parametrize("verb", ["record", "live"])
def test_the_controllers_states_are_reported_and_nothing_is_restarted(
    verb: str, tmp_path: Path, adapter: Adapter, canid: Callable[..., Any], seed: int
) -> None:
    """Every state of a real controller stands in talk, journal, log and JSON; all frames and error frames are kept."""
    rng = random.Random(seed)
    recording, reported = tmp_path / "heard.blf", tmp_path / "reported.json"
    into = ("-o", recording) if verb == "record" else ("--vehicle", "generic", "--record", recording)
    program = canid(verb, "-i", "socketcan", "-c", adapter.name, *into, "--json", reported)
    program.wait_for(f"listen-only: yes (read back from {adapter.name})")
    assert adapter.commands.split(b"\r") == [b"C", b"S6", b"L", b""]
    # bus-off and back, then a walk
    walk = ["w", "p", "b", "a"]
    while len(walk) < 16:
        walk.append(rng.choice([letter for letter in "awpb" if letter != walk[-1]]))
    sent = 0
    for letter in walk:
        adapter.state(letter, *counters(letter, rng))
        some = rng.randint(0, 60)
        adapter.frames(range(sent, sent + some))
        sent += some
    adapter.state("p" if walk[-1] != "p" else "a", 0, 0)
    walk.append("p" if walk[-1] != "p" else "a")
    adapter.state("w", 100, 17)
    adapter.overflow()
    walk.append("w")
    adapter.frames(range(sent, sent + 50))
    sent += 50
    program.wait_for("overflowed")
    # the driver was sent nothing but `ip`: no frame, no restart
    assert adapter.commands.split(b"\r") == [b"C", b"S6", b"L", b""]
    assert program.end(signal.SIGTERM) == 143, program.says()
    assert numbers(recording) == list(range(sent))
    frames = list(open_log(recording))
    assert sum(bool(frame.flags & Flag.ERROR) for frame in frames) == len(walk) + 1
    assert events(recording, *STATES.values()) == [STATES[letter] for letter in walk]
    assert events(recording, "rx_overflow") == ["rx_overflow"]
    assert "controller bus off" in program.says() or "reports bus off" in program.says()
    assert "it stays off until it is restarted" in says(recording, "bus_off")[0]
    last = [line for line in program.printed().splitlines() if f"{adapter.name}: open" in line][-1]
    assert f"{len(walk) + 1} error frames" in last
    assert "controller error warning" in last
    assert "TEC 100, REC 17" in last
    if verb == "record":
        bus = json.loads(reported.read_text())["buses"][0]
        assert (bus["controller"], bus["tec"], bus["rec"]) == ("error_warning", 100, 17)
        assert bus["errors"] == len(walk) + 1


def test_what_the_device_is_when_it_comes_back_is_reported(
    tmp_path: Path, adapter: Adapter, patient: Callable[..., Any], until: Callable[..., Any]
) -> None:
    """Bus-off at the start, down, renamed, active, at another bit rate: each is reported, `ip` says the same."""
    recording = tmp_path / "heard.blf"
    adapter.state("b", 256, 0)
    program = patient("record", "-i", "socketcan", "-c", adapter.name, "-o", recording)
    program.wait_for("reports bus off")  # no error frame has said so: the device was asked
    adapter.frames(range(100))
    old = adapter.name
    assert devices.link(old) == read(old)
    ip("set", old, "down")
    program.wait_for("is lost")
    ip("set", old, "name", "body9")
    adapter.name = "body9"
    ip("set", "body9", "type", "can", "bitrate", "250000", "listen-only", "off")
    assert devices.link("body9") == read("body9")
    assert devices.link(old) is None
    ip("set", "body9", "up")
    adapter.frames(range(100, 200))
    program.wait_for("is back")
    until(lambda: b"S5\rO\r" in adapter.commands)
    found = devices.link("body9")
    assert found == read("body9")
    assert found is not None
    assert not found.listen_only
    assert program.end(signal.SIGTERM) == 143, program.says()
    assert numbers(recording) == list(range(200))
    wanted = ["bus_off", "bus_lost", "bus_renamed", "bitrate_changed", "listen_only_changed", "error_active"]
    # one `ip link set` announces mode and bit rate together
    assert sorted(events(recording, *wanted)) == sorted(wanted)
    assert events(recording, "bus_lost", "bus_renamed", "bus_back") == ["bus_lost", "bus_renamed", "bus_back"]
    assert f"{old} is now body9" in says(recording, "bus_renamed")[0]
    assert "250,000 bit/s, before 500,000 bit/s" in says(recording, "bitrate_changed")[0]
    assert "body9 acknowledges" in says(recording, "listen_only_changed")[0]
    assert "socketcan body9 is back" in says(recording, "bus_back")[0]


def test_an_adapter_that_is_unplugged_and_plugged_in_again(
    tmp_path: Path, patient: Callable[..., Any]
) -> None:
    """The kernel removes the device and makes another one of that name: it is recorded, and reported to be another one."""
    try:
        first = Adapter()
    except OSError as error:
        if os.environ.get("CANID_VM"):
            raise
        pytest.skip(f"no slcan here: {error}")
    recording = tmp_path / "heard.blf"
    program = patient("record", "-i", "socketcan", "-c", first.name, "-o", recording)
    program.wait_for("listen-only: yes")
    first.frames(range(50))
    first.close()
    program.wait_for("is lost")
    second = Adapter(mode="listen-only off")
    try:
        assert second.name == first.name
        program.wait_for("is back")
        second.frames(range(50, 100))
        assert shown(second.name)["flags"]
    finally:
        code = program.end(signal.SIGTERM)
        second.close()
    assert code == 143, program.says()
    assert numbers(recording) == list(range(100))
    wanted = ["bus_lost", "device_changed", "listen_only_changed", "bus_back"]
    assert events(recording, *wanted) == wanted
    assert "another network device than before" in says(recording, "device_changed")[0]


def read(name: str) -> devices.Device:
    """The same device in the words of `ip`, parsed here a second time."""
    reported = shown(name)
    info = reported["linkinfo"]
    data = info["info_data"]
    return devices.Device(
        kind=info["info_kind"],
        up="UP" in reported["flags"],
        listen_only="LISTEN-ONLY" in data.get("ctrlmode", ()),
        # slcan has a list of bit rates instead of bit timing, which `ip` names otherwise
        bitrate=float(data.get("bittiming_bitrate") or data["bittiming"]["bitrate"]),
        state=data["state"],
        ifindex=reported["ifindex"],
        name=reported["ifname"],
    )


def test_a_restart_is_reported(tmp_path: Path, listening: Callable[..., Any]) -> None:
    """CAN_ERR_RESTARTED, put onto a vcan by a raw socket since slcan cannot be restarted: active again, reported."""
    recording = tmp_path / "heard.blf"
    record = listening("record", "-i", "socketcan", "-c", "vcan0", "-o", recording)
    sock: socket.socket
    with sending("vcan0") as sock:
        sock.send(error_frame(0x40))
        sock.send(error_frame(0x100))
        sock.send(error_frame(0x204, bytes([0, 0x14, 0, 0, 0, 0, 97, 130])))  # two bits in one frame
    record.wait_for("error passive")
    assert record.end(signal.SIGTERM) == 143
    assert events(recording, *STATES.values()) == ["bus_off", "error_active", "error_passive"]
    assert len(list(open_log(recording))) == 3


def test_bus_off_is_reported_though_its_error_frame_was_dropped(
    tmp_path: Path, adapter: Adapter, start: Callable[..., Any], until: Callable[..., Any]
) -> None:
    """The kernel drops the error frame since the buffer is full: the state comes from the device's announcement."""
    recording = tmp_path / "heard.blf"
    small = "from canid.io.buses.receivers import socketcan; socketcan.RECEIVE_BUFFER_BYTES = 8192; "
    words = ("record", "-i", "socketcan", "-c", adapter.name, "-o", recording)
    program = start(
        sys.executable, "-c", small + "from canid.ui.cli import main; import sys; sys.exit(main())", *words
    )
    program.wait_for("listen-only")
    program.process.send_signal(signal.SIGSTOP)
    adapter.frames(range(2000))
    until(lambda: shown(adapter.name)["stats64"]["rx"]["packets"] == 2000)
    adapter.state("b", 256, 0)
    program.process.send_signal(signal.SIGCONT)
    program.wait_for("reports bus off")
    adapter.frames(range(2000, 2010))
    assert program.end(signal.SIGTERM) == 143, program.says()
    frames = list(open_log(recording))
    assert not any(frame.flags & Flag.ERROR for frame in frames)
    assert numbers(recording)[-10:] == list(range(2000, 2010))
    assert events(recording, *STATES.values()) == ["bus_off"]
