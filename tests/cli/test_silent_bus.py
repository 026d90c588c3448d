"""A bus on which nothing came is not a pass: exit code 3, and a line that says so, however short the session was."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest

from canid.io.logs import write_log
from canid.values.errors import DONE, NO_BUS
from canid.values.shipped_files import shipped
from canid.values.types import Flag, Frame

Canid = Callable[..., Any]
SAYS = "no frames received: check bit rate, termination, and that another node is on\n"
WAYS: dict[str, tuple[str, ...]] = {
    "record": ("record", "-o", "x.blf"),
    "record as text": ("record", "-o", "x.log"),
    "with its page": ("record", "-o", "x.blf", "--web"),
    "rotation": ("record", "-o", "x.blf", "--file-time", "1s"),
    "trigger": ("record", "-o", "x.blf", "--trigger", "speed > 5", "--vehicle", "generic"),
    "JSON": ("record", "-o", "x.blf", "--json", "-"),
    "live": ("live", "--vehicle", "generic"),
    "live and record": ("live", "--vehicle", "generic", "--record", "x.blf"),
    "check": ("check",),
    "check a vehicle": ("check", "--vehicle", "generic"),
}


def named(channels: list[str]) -> list[str]:
    return [word for channel in channels for word in ("-c", channel)]


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("way", WAYS)
def test_a_silent_bus_ends_with_3(
    way: str, canid: Canid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """For as short as half a second, on one bus or two; one line on standard error says it."""
    monkeypatch.chdir(tmp_path)
    rng = random.Random(seed)
    duration = rng.choice((0.5, 1, 2))
    buses = rng.choice((1, 2))
    if way.startswith("check"):
        buses = 1
    channels = [str(tmp_path / str(k)) for k in range(buses)]
    ran = canid(*WAYS[way], "--duration", duration, "-i", "virtual", *named(channels))
    assert ran.code == NO_BUS
    assert ran.err.count("no frames received") == 1
    assert ran.err.count("check bit rate") == 1
    assert "no frames received" not in ran.out


@pytest.mark.parametrize("error_frames", [False, True])
def test_one_of_two_buses_is_silent(error_frames: bool, canid: Canid, tmp_path: Path) -> None:
    """The silent one is named, also where it has given error frames alone, and the exit code is that of the other."""
    channels = [str(tmp_path / name) for name in ("talks", "silent")]
    ended = threading.Event()

    def talk() -> None:
        with can.Bus(channels[0], "virtual") as talks, can.Bus(channels[1], "virtual") as silent:
            while not ended.wait(0.02):
                talks.send(can.Message(arbitration_id=1, data=b"12", is_extended_id=False))
                if error_frames:
                    silent.send(can.Message(is_error_frame=True))

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        ran = canid("record", "-o", tmp_path / "x.blf", "--duration", 1, "-i", "virtual", *named(channels))
    finally:
        ended.set()
        thread.join()
    assert ran.code == DONE
    assert ran.err.count("no frames received") == 1
    assert f"virtual {channels[1]}: no frames received" in ran.err
    assert ("error frames" in ran.err) == error_frames


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_the_first_frame(number: int, tmp_path: Path) -> None:
    """The exit code stays that of the signal, and the line is there."""
    words = ["record", "-i", "virtual", "-c", str(tmp_path), "-o", str(tmp_path / "x.blf")]
    command = [sys.executable, "-m", "canid", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "x.events.jsonl").exists():
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert err.endswith(f"canid: {SAYS}")


@pytest.mark.parametrize(
    "words",
    [
        ("record", "-o", "x.blf"),
        ("check",),
        ("check", "--vehicle", "generic"),
        ("decode", "--dbc", "generic.dbc"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_error_frames_alone_are_no_bus(
    words: tuple[str, ...], canid: Canid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit 3, how many there were, and what to check; with one frame of data among them it is a bus."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "generic.dbc").write_bytes((shipped() / "generic.dbc").read_bytes())
    for data in (False, True):
        ended, channel = threading.Event(), str(tmp_path / f"bus {data}")

        def talk(data: bool = data, ended: threading.Event = ended, channel: str = channel) -> None:
            with can.Bus(channel, "virtual") as bus:
                while not ended.wait(0.02):
                    bus.send(can.Message(is_error_frame=True))
                    if data:
                        bus.send(can.Message(arbitration_id=1, data=b"12", is_extended_id=False))

        thread = threading.Thread(target=talk)
        thread.start()
        try:
            (tmp_path / "x.blf").unlink(missing_ok=True)
            ran = canid(*words, "--duration", 0.7, "-i", "virtual", "-c", channel)
        finally:
            ended.set()
            thread.join()
        assert (ran.code == NO_BUS) is not data, ran.err
        said = [line for line in ran.err.splitlines() if "no frames received" in line]
        assert len(said) == (not data)
        assert all("error frames: check bit rate, termination" in line for line in said)


LOG_VERBS = {
    "look": ("look",),
    "look with a database": ("look", "--dbc", "generic.dbc"),
    "check": ("check",),
    "check a vehicle": ("check", "--vehicle", "generic"),
    "decode": ("decode", "--dbc", "generic.dbc"),
    "identify": ("identify", "--vehicle", "generic"),
    "replay": ("replay", "--vehicle", "generic", "--speed", "max"),
}


@pytest.mark.parametrize("verb", LOG_VERBS)
@pytest.mark.parametrize("suffix", [".blf", ".log"])
def test_a_log_of_error_frames_alone(
    verb: str, suffix: str, canid: Canid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit rate and termination are named; not another vehicle, nor another id."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "generic.dbc").write_bytes((shipped() / "generic.dbc").read_bytes())
    errors = [Frame(0.01 * k, 0, 0x88, bytes(8), int(Flag.ERROR)) for k in range(200)]
    write_log(tmp_path / f"x{suffix}", errors, start_utc=1.7e9)
    name, *others = LOG_VERBS[verb]
    ran = canid(name, f"x{suffix}", *others)
    assert "all of its 200 frames are error frames: wrong bit rate, no termination" in ran.err
    assert "this vehicle's log" not in ran.err
    write_log(tmp_path / f"y{suffix}", [*errors, Frame(2.0, 0, 0x88, bytes(8))], start_utc=1.7e9)
    assert "error frames" not in canid(name, f"y{suffix}", *others).err
