"""A device's own count of frames that never reached a socket."""

from __future__ import annotations

from pathlib import Path

import pytest

from canid.io.buses.receivers import device_drops
from canid.io.buses.receivers.device_drops import DeviceDrops, of_device

HEAD = """Inter-|   Receive                                                |  Transmit
 face |bytes    packets errs drop fifo frame compressed multicast|bytes    packets errs drop fifo colls carrier compressed
"""


@pytest.fixture
def counters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "dev"
    monkeypatch.setattr(device_drops, "COUNTERS", path)
    return path


def write(path: Path, **drops: int) -> None:
    lines = [f"{name:>6}: 800 100 7 {n} 5 6 0 0 900 90 1 2 3 0 0 0\n" for name, n in drops.items()]
    path.write_text(HEAD + "".join(lines))


def test_the_growth_counts_and_no_other_devices(counters: Path) -> None:
    """What was dropped before counts nothing; a name that another begins with is another device."""
    write(counters, can1=50, can10=1, acan1=2)
    of = DeviceDrops("can1")
    assert of.count("can1") == 0
    write(counters, can1=53, can10=100, acan1=200)
    assert of.count("can1") == 3
    assert of.count("can1") == 3
    write(counters, renamed=60)
    assert of.count("renamed") == 10


def test_a_device_that_goes_and_comes_back_starts_from_zero(counters: Path) -> None:
    """A smaller count is a new beginning; nothing is taken back and nothing is counted twice."""
    write(counters, can0=5)
    of = DeviceDrops("can0")
    write(counters, can0=9)
    assert of.count("can0") == 4
    write(counters)
    assert of.count("can0") == 4
    assert of.count("") == 4
    write(counters, can0=2)
    assert of.count("can0") == 4
    write(counters, can0=3)
    assert of.count("can0") == 5


@pytest.mark.parametrize("text", ["", "can0", "can0:", "can0: 1 2 3", "can0: 1 2 3 x 5", "\xff\xfe can0"])
def test_what_cannot_be_read_counts_nothing(counters: Path, text: str) -> None:
    """No file, or one in another form."""
    assert of_device("can0") is None
    counters.write_text(text)
    assert of_device("can0") is None
    assert DeviceDrops("can0").count("can0") == 0
