"""Buses by the names of interfaces: the same number whichever speaks first, and a name in place of a number."""

from __future__ import annotations

import argparse
import math
import random
from pathlib import Path

import pytest

from canid.analysis.drive.drive_reader import read_signals
from canid.io.buses import python_can
from canid.io.buses.send import onto
from canid.io.logs import open_log
from canid.signals.vehicle import on_buses, read_vehicle
from canid.ui.cli import main
from canid.values.bus_names import bus_numbers
from canid.values.types import Frame

DBC = 'VERSION ""\nBU_: A\nBO_ 256 M: 2 A\n SG_ S : 0|8@1+ (1,0) [0|0] "m/s" A\n SG_ P : 8|8@1+ (1,0) [0|0] "" A\n'
VEHICLE = """dbc = [{{ file = "a.dbc", bus = {bus} }}]
[driver]
task = "car_following"
output = "pedal"
[signals]
pedal = {{ signal = "M.P", unit = "%" }}
speed = "M.S"
gap = {{ signal = "M.S", unit = "m" }}
range_rate = "M.S"
"""


def log(path: Path, names: list[str], seed: int) -> Path:
    """20 frames of each interface, in any order; the value is the interface's place in the list."""
    lines = [(k, name) for name in names for k in range(20)]
    random.Random(seed).shuffle(lines)
    path.write_text(
        "".join(f"(17000000{k:02d}.000000) {name} 100#{names.index(name) + 1:02X}00\n" for k, name in lines)
    )
    return path


@pytest.mark.parametrize(
    "names",
    [
        ["can0", "can1"],
        ["can1"],
        ["vcan0", "vcan3"],
        ["can0", "can1", "vcan0"],
        ["body", "radar"],
        ["can1", "vcan1"],
    ],
)
def test_numbers_do_not_depend_on_who_speaks_first(tmp_path: Path, seed: int, names: list[str]) -> None:
    """Ten orders of the same frames: each interface has one number in all of them."""
    found = set()
    for k in range(10):
        read = open_log(log(tmp_path / "a.log", names, seed + k))
        found.add(tuple(sorted({(frame.data[0] - 1, frame.bus) for frame in read})))
        assert read.buses == bus_numbers(names)
    assert found == {tuple(sorted((names.index(name), bus) for name, bus in bus_numbers(names).items()))}


@pytest.mark.parametrize("bus", ['"can1"', "1"])
def test_a_name_stands_where_a_number_may(tmp_path: Path, seed: int, bus: str) -> None:
    """`bus = "can1"` takes the frames of can1, in a log that names it and in one that numbers it."""
    (tmp_path / "a.dbc").write_text(DBC)
    (tmp_path / "v.toml").write_text(VEHICLE.format(bus=bus))
    path = log(tmp_path / "a.log", ["can0", "can1"], seed)
    assert set(read_signals(path, tmp_path / "v.toml")["speed"].value) == {2.0}
    assert main(["recover", str(path), "-o", str(tmp_path / "a.blf")]) == 0
    assert set(read_signals(tmp_path / "a.blf", tmp_path / "v.toml")["speed"].value) == {2.0}


def test_a_log_of_one_bus_is_the_bus_that_a_vehicle_file_means(tmp_path: Path, seed: int) -> None:
    """A file with `bus = 0` reads a log of can1 alone, not one in which there is another bus."""
    (tmp_path / "a.dbc").write_text(DBC)
    (tmp_path / "v.toml").write_text(VEHICLE.format(bus=0))
    car = read_vehicle(tmp_path / "v.toml")
    assert {message.bus for message in on_buses(car, {"can1": 1}).messages} == {1}
    assert on_buses(car, {"can1": 1, "can2": 2}) is car
    assert set(read_signals(log(tmp_path / "a.log", ["can1"], seed), car)["speed"].value) == {1.0}


def test_look_and_check_say_which_interface_is_which_bus(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int
) -> None:
    """`can1 → bus 1`, and files and rows are chosen by name."""
    (tmp_path / "a.dbc").write_text(DBC)
    path = log(tmp_path / "a.log", ["can0", "can1"], seed)
    for words in (
        ["check", str(path)],
        ["look", str(path), "--dbc", f"{tmp_path / 'a.dbc'}@can1", "--bus", "can1"],
    ):
        assert main(words) == 0
        assert "can0 → bus 0, can1 → bus 1" in (shown := capsys.readouterr().out)
    assert "a.dbc: bus 1 (as given)" in shown


@pytest.mark.parametrize("channels", [("can1", "can2"), ("can2", "can1")])
def test_a_log_goes_onto_the_channels_that_have_its_numbers(channels: tuple[str, str]) -> None:
    """can1 takes bus 1, whichever channel is named first: the numbers of live and of logs; others are not sent."""
    can = python_can.load()
    names = {channel: f"onto_{channels[0]}_{channel}" for channel in channels}
    configs = argparse.Namespace(interface="virtual", channel=list(names.values()))
    frames = [Frame(0.0, bus, 0x100 + bus, b"x") for bus in (0, 1, 2, 3)]
    listeners = {channel: can.Bus(interface="virtual", channel=name) for channel, name in names.items()}
    try:
        assert onto(configs, frames, math.inf) == 2
        for channel, listener in listeners.items():
            message = listener.recv(1.0)
            assert message.arbitration_id == 0x100 + int(channel[-1])
            assert listener.recv(0.0) is None
    finally:
        for listener in listeners.values():
            listener.shutdown()
