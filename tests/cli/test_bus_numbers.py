"""A bus has the number of its interface, live as in a log: whatever the order of `-c`, and for a vehicle file's names."""

from __future__ import annotations

import json
import random
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import can
import pytest

from canid.io.logs import open_log
from canid.values.bus_names import bus_numbers

Canid = Callable[..., Any]
DBC = 'VERSION ""\nBU_: A\nBO_ 256 M: 2 A\n SG_ S : 0|8@1+ (1,0) [0|250] "m/s" A\n'
VEHICLE = """dbc = ["a.dbc"]
[driver]
task = "car_following"
output = "accel"
[signals]
accel = {{signal = "M.S", unit = "m/s2", bus = "{bus}"}}
speed = {{signal = "M.S", unit = "m/s", bus = "{bus}"}}
gap = {{signal = "M.S", unit = "m", bus = "{bus}"}}
range_rate = {{signal = "M.S", unit = "m/s", bus = "{bus}"}}
"""
NAMES = [["car0", "car1"], ["car1", "car2"], ["car3"], ["body", "radar"], ["239.0.0.9", "car1"]]


@contextmanager
def talking(names: list[str]) -> Iterator[None]:
    """Virtual buses on which each frame's first byte is the interface's place among the names, and 1."""
    ended = threading.Event()

    def talk() -> None:
        with ExitStack() as stack:
            buses = [stack.enter_context(can.Bus(name, "virtual")) for name in names]
            while not ended.wait(0.02):
                for k, bus in enumerate(buses):
                    bus.send(can.Message(arbitration_id=0x100, data=[k + 1, 0], is_extended_id=False))

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def shuffled(names: list[str], seed: int) -> list[str]:
    channels = random.Random(seed).sample(names, len(names))
    return [word for channel in channels for word in ("-c", channel)]


@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_a_recording_has_the_interfaces_numbers(
    names: list[str], suffix: str, canid: Canid, tmp_path: Path, seed: int
) -> None:
    """The numbers that canid gives to a candump log of the same interfaces."""
    with talking(names):
        ran = canid(
            "record",
            "-o",
            tmp_path / f"x{suffix}",
            "--duration",
            0.5,
            "-i",
            "virtual",
            *shuffled(names, seed),
        )
    assert ran.code == 0
    found = {(names[frame.data[0] - 1], frame.bus) for frame in open_log(tmp_path / f"x{suffix}")}
    assert found == set(bus_numbers(names).items())


@pytest.mark.parametrize("names", NAMES)
def test_a_vehicle_file_names_the_bus(names: list[str], canid: Canid, tmp_path: Path, seed: int) -> None:
    """`check` and `record --trigger` take the values of the interface that the vehicle file names."""
    (tmp_path / "a.dbc").write_text(DBC)
    wanted = random.Random(seed).choice([name for name in names if "." not in name])
    (tmp_path / "v.toml").write_text(VEHICLE.format(bus=wanted))
    by, channels = ("--vehicle", tmp_path / "v.toml"), ("-i", "virtual", *shuffled(names, seed))
    with talking(names):
        ran = canid("check", *by, "--duration", 0.5, *channels, "--json", tmp_path / "j.json")
        assert f"{wanted} → bus {bus_numbers(names)[wanted]}" in ran.out
        speed = json.loads((tmp_path / "j.json").read_text())["roles"]["speed"]
        value = float(names.index(wanted) + 1)
        assert (speed["low"], speed["high"]) == (value, value)
        condition = f"speed > {value - 0.5}"
        recorded = tmp_path / "t.log"
        ran = canid("record", "-o", recorded, *by, "--trigger", condition, "--duration", 3, *channels)
    assert ran.code == 0
    assert len(list(open_log(recorded)))
