"""udp_multicast with anything on it: every good frame is recorded, the rest is counted, the bus is never lost."""

from __future__ import annotations

import os
import socket
import struct
import time
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from canid.io.buses import python_can
from canid.io.buses.bus_opener import open_bus
from canid.io.buses.frame_check import FD_LENGTHS
from canid.io.logs import open_log
from canid.io.recording.recorder import Recorder
from canid.values.types import Flag

pytestmark = pytest.mark.netns
# of this process: its tests may run while those of another worker do
GROUP, PORT = f"239.77.{os.getpid() // 254 % 254 + 1}.{os.getpid() % 254 + 1}", 43113
SUFFIXES = (".blf", ".asc", ".log")

value = st.deferred(
    lambda: (
        st.none()
        | st.booleans()
        | st.integers(-(2**63), 2**64 - 1)
        | st.sampled_from(
            [float("inf"), float("-inf"), float("nan"), 0, 1, 2, 8, 9, 64, 65, 0x7FF, 0x800, 2**29]
        )
        | st.floats()
        | st.text(max_size=10)
        | st.binary(max_size=100)
        | st.lists(value, max_size=4)
        | st.dictionaries(st.text(max_size=3) | st.integers(0, 5), value, max_size=3)
    )
)
NAMES = (
    *(
        "timestamp",
        "arbitration_id",
        "is_extended_id",
        "is_remote_frame",
        "is_error_frame",
        "channel",
        "dlc",
        "data",
    ),
    *("is_fd", "bitrate_switch", "error_state_indicator"),
)
# a good frame with some fields replaced, dropped or added; any value at all; bytes that are no msgpack
changed = st.tuples(
    st.dictionaries(st.sampled_from((*NAMES, "extra")), value, max_size=4),
    st.sets(st.sampled_from(NAMES), max_size=2),
)
datagram = st.one_of(
    changed.map(lambda it: packed({**good(0), **it[0]}, it[1])),
    value.map(lambda it: packed(it, ())),
    st.binary(max_size=200),
    st.tuples(changed, st.integers(0, 100)).map(
        lambda it: packed({**good(0), **it[0][0]}, it[0][1])[: it[1]]
    ),
    st.just(b"\xc4\xff" * 2500),
)


def good(number: int) -> dict[str, Any]:
    """The fields of can.Message, as python-can packs them."""
    return {
        "timestamp": 0.0,
        "arbitration_id": 0x100 + number % 0x500,
        "is_extended_id": False,
        "is_remote_frame": False,
        "is_error_frame": False,
        "channel": None,
        "dlc": 8,
        "data": struct.pack("<Q", number + 2**40),
        "is_fd": False,
        "bitrate_switch": False,
        "error_state_indicator": False,
    }


def packed(what: Any, without: Any) -> bytes:
    if isinstance(what, dict):
        what = {key: each for key, each in what.items() if key not in without}
    return bytes(msgpack.packb(what))


def sender() -> socket.socket:
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    return out


@pytest.mark.slow("many messages through real sockets")
@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)
@given(strange=st.lists(datagram, min_size=10, max_size=60))
def test_random_msgpack_costs_no_good_frame(
    tmp_path_factory: pytest.TempPathFactory, strange: list[bytes]
) -> None:
    """Random objects between good frames, recorded to .blf, .asc and .log at once."""
    folder = tmp_path_factory.mktemp("random")
    config = {"interface": "udp_multicast", "channel": GROUP, "hop_limit": 0}
    recorders = [Recorder([open_bus(config)], folder / f"x{suffix}").start() for suffix in SUFFIXES]
    with sender() as out:
        for number, each in enumerate(strange):
            out.sendto(packed(good(number), ()), (GROUP, PORT))
            out.sendto(each, (GROUP, PORT))
        out.sendto(packed(good(len(strange)), ()), (GROUP, PORT))
    end = time.monotonic() + 60.0
    total = 2 * len(strange) + 1
    while any(r.stats().frames + r.stats().buses[0].impossible < total for r in recorders):
        assert time.monotonic() < end, [r.stats() for r in recorders]
        time.sleep(0.01)
    wanted = [struct.pack("<Q", number + 2**40) for number in range(len(strange) + 1)]
    for recorder, suffix in zip(recorders, SUFFIXES, strict=True):
        stats = recorder.stop()
        assert not [e for e in recorder.events() if e.what in ("bus_lost", "not_understood")]
        assert stats.frames + stats.buses[0].impossible == total
        assert stats.written == stats.frames
        frames = list(open_log(folder / f"x{suffix}"))
        assert len(frames) == stats.frames
        numbered = [f for f in frames if f.data in wanted and f.flags == 0]
        found = [f.data for f in numbered if f.id == 0x100 + (wanted.index(f.data)) % 0x500]
        # a strange one may be good by chance, with number 0
        assert [data for i, data in enumerate(found) if data != wanted[0] or i == 0] == wanted
        for f in frames:
            sizes = FD_LENGTHS if f.flags & Flag.FD else range(9)
            assert len(f.data) in sizes
            assert f.id < (0x20000000 if f.flags & (Flag.EXTENDED | Flag.ERROR) else 0x800)


@pytest.mark.slow("sessions on a bus in real time")
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "change",
    [
        {"data": bytes(80), "dlc": 80, "is_fd": True},
        {"dlc": float("inf")},
        {"dlc": float("inf"), "is_remote_frame": True, "data": b""},
        {"data": bytes(9), "dlc": 9, "is_fd": True},
        {"arbitration_id": 2**63},
    ],
    ids=["80 bytes", "dlc=inf", "remote dlc=inf", "9 bytes FD", "id"],
)
def test_the_frames_that_ended_a_recording(tmp_path: Path, suffix: str, change: dict[str, Any]) -> None:
    """8,000 good frames with an impossible one among each hundred: 8,000 are kept, 80 counted, one bus, never lost."""
    config = {"interface": "udp_multicast", "channel": GROUP, "hop_limit": 0}
    recorder = Recorder([open_bus(config)], tmp_path / f"x{suffix}").start()
    with sender() as out:
        for number in range(8000):
            out.sendto(packed(good(number), ()), (GROUP, PORT))
            if number % 100 == 50:
                out.sendto(packed({**good(number), **change}, ()), (GROUP, PORT))
    end = time.monotonic() + 60.0
    while recorder.stats().frames < 8000 and time.monotonic() < end:
        time.sleep(0.05)
    stats = recorder.stop()
    events = recorder.events()
    assert (stats.frames, stats.written, stats.buses[0].impossible, stats.drops_bus) == (8000, 8000, 80, 0)
    assert len([e for e in events if e.what == "impossible_frames"]) in (1, 2, 3)
    assert not [e for e in events if e.what == "bus_lost"]
    frames = list(open_log(tmp_path / f"x{suffix}"))
    assert [f.data for f in frames] == [struct.pack("<Q", number + 2**40) for number in range(8000)]


def test_what_python_can_sends_is_understood() -> None:
    """Every kind of frame from python-can's own sender arrives as python-can's own receiver gives it."""
    can = python_can.load()
    # python-can's receiver hears every group that a program of this machine has joined: a port of its own
    port = 20_000 + os.getpid() % 10_000
    config = {"interface": "udp_multicast", "channel": GROUP, "hop_limit": 0, "port": port}
    ours, theirs, out = open_bus(config), can.Bus(**config), can.Bus(**config)
    messages = [
        can.Message(arbitration_id=0x7FF, is_extended_id=False, data=b"abc"),
        can.Message(arbitration_id=0x1FFFFFFF, data=b""),
        can.Message(arbitration_id=5, is_extended_id=False, is_remote_frame=True, dlc=4),
        can.Message(arbitration_id=6, is_fd=True, bitrate_switch=True, data=bytes(64)),
        can.Message(arbitration_id=7, is_error_frame=True, data=bytes(8)),
        can.Message(arbitration_id=8, is_fd=True, error_state_indicator=True, data=bytes(12)),
    ]
    from canid.io.buses.messages import flags_of

    for message in messages:
        out.send(message)
    for _ in messages:
        one, other = ours.recv(5.0), theirs.recv(5.0)
        assert one is not None
        length = other.dlc if other.is_remote_frame else -1
        assert one[1:] == (other.arbitration_id, bytes(other.data), flags_of(other), length)
        assert abs(one.ns * 1e-9 - other.timestamp) < 0.5
    assert ours.impossible == 0
    for bus in (ours, theirs, out):
        bus.shutdown()
