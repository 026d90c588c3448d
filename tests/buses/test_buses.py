"""Opening buses, listening only, SocketCAN's structures, and the one place that sends."""

from __future__ import annotations

import argparse
import ast
import errno
import math
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, ClassVar

import pytest

from canid.io.buses import devices, listen_only, python_can
from canid.io.buses.bus_opener import open_bus, open_buses
from canid.io.buses.command_line import add_bus_arguments, configs_of, listen
from canid.io.buses.receivers import socketcan
from canid.io.buses.send import allowed, onto
from canid.io.recording import bus_load
from canid.values.errors import BusError, ConfigError
from canid.values.frame_columns import columns_of
from canid.values.types import Flag, Frame

BUSES = Path(__file__).parents[2] / "canid/io/buses"
# s; bounds what hangs
PATIENCE_S = 300.0


def parse(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_bus_arguments(parser)
    return parser.parse_args(words)


# --- receive only ---


def test_a_bus_has_no_way_to_send(request: pytest.FixtureRequest) -> None:
    """Nothing that a bus offers, down to its private parts, is called send or is a python-can bus."""
    can = python_can.load()
    bus = open_bus({"interface": "virtual", "channel": request.node.name})
    public = {name for name in dir(bus) if not name.startswith("_")}
    assert not {name for name in public if "send" in name}
    assert not [v for v in vars(bus).values() if isinstance(v, can.BusABC)]
    assert not [v for v in vars(bus._receiver).values() if isinstance(v, can.BusABC)]
    bus.shutdown()
    assert bus.state == "closed"
    with pytest.raises(BusError, match="closed"):
        bus.recv(0.0)


def test_only_one_module_calls_send() -> None:
    """In the source of this folder `.send` appears in send.py alone; devices.py asks the kernel over rtnetlink."""
    found = {
        path.name
        for path in BUSES.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr in ("send", "send_periodic", "sendmsg", "sendto")
    }
    assert found - {"devices.py"} == {"send.py"}
    devices_source = (BUSES / "devices.py").read_text()
    assert devices_source.count(".send") == devices_source.count("netlink.sendto(")


def test_only_one_module_imports_python_can() -> None:
    """`import can` stands in python_can.py alone."""
    found = {
        path.name
        for path in BUSES.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if (isinstance(node, ast.Import) and any(name.name.split(".")[0] == "can" for name in node.names))
        or (isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "can")
    }
    assert found == {"python_can.py"}


def test_reading_a_blf_imports_neither_python_can_nor_asammdf(tmp_path: Path) -> None:
    """A .blf is written and read without python-can; python-can comes without asammdf."""
    code = (
        "import sys\n"
        "from canid.io.logs import open_log, write_log\n"
        "from canid.values.types import Frame\n"
        f"write_log({str(tmp_path / 'x.blf')!r}, [Frame(0.0, 0, 1, b'')])\n"
        f"assert len(list(open_log({str(tmp_path / 'x.blf')!r}))) == 1\n"
        "assert 'can' not in sys.modules and 'cantools' not in sys.modules\n"
        "from canid.io.buses import python_can\n"
        "python_can.load().BLFReader\n"
        "assert 'asammdf' not in sys.modules and 'pandas' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=600)


def test_frames_arrive_with_whole_nanoseconds(request: pytest.FixtureRequest) -> None:
    """Stamps with a zero of their own are set against the host's clock, differences stay exact."""
    can = python_can.load()
    bus = open_bus({"interface": "virtual", "channel": request.node.name})
    sender = can.Bus(request.node.name, interface="virtual", preserve_timestamps=True)
    for stamp in (5.0, 5.000000001, 6.5):
        sender.send(can.Message(timestamp=stamp, arbitration_id=1, data=b"a", is_extended_id=True))
    got = [bus.recv(1.0) for _ in range(3)]
    assert [g.ns - got[0].ns for g in got if g and got[0]] == [0, 1, 1_500_000_000]
    assert got[0] is not None
    assert got[0].ns > 1.7e18
    assert got[0].flags == Flag.EXTENDED
    sender.shutdown()
    bus.shutdown()


@pytest.mark.parametrize(
    ("config", "says"),
    [
        ({"interface": "socketcan", "channel": "nocan9"}, "cannot open socketcan nocan9"),
        ({"interface": "pcan", "channel": "PCAN_USBBUS1"}, "cannot open pcan PCAN_USBBUS1"),
        ({"interface": "vector", "channel": 0, "app_name": "x"}, "cannot open vector 0"),
        ({"interface": "nonsense", "channel": "x"}, "nonsense"),
        ({"interface": "gs_usb", "channel": 0}, "cannot open gs_usb 0: .* the package or driver"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_one_line(config: dict[str, object], says: str) -> None:
    """No driver, no device, no such interface: BusError, one line that names it and what to try."""
    with pytest.raises(BusError, match=says) as caught:
        open_bus(config)
    assert "\n" not in str(caught.value)
    assert ";" in str(caught.value)


def test_if_one_bus_fails_the_others_are_closed(request: pytest.FixtureRequest) -> None:
    """open_buses leaves nothing open behind its error."""
    can = python_can.load()
    channel = request.node.name
    with pytest.raises(BusError):
        open_buses([{"interface": "virtual", "channel": channel}, {"interface": "nonsense"}])
    assert channel not in can.interfaces.virtual.channels


# --- arguments ---


def test_the_arguments_are_python_cans() -> None:
    """python-can's own parser and ours give the same names and values for what they share."""
    import can.cli

    words = ["-i", "socketcan", "-b", "500000", "--fd", "--data-bitrate", "2000000"]
    words += ["--bus-kwargs", "a=1", "b=xy", "c=True"]
    theirs = argparse.ArgumentParser()
    can.cli.add_bus_arguments(theirs)
    expected = vars(theirs.parse_args([*words, "-c", "can0"]))
    kwargs = expected.pop("bus_kwargs")
    assert configs_of(parse(*words, "-c", "can0")) == [expected | kwargs]
    assert [c["channel"] for c in configs_of(parse(*words, "-c", "can0", "-c", "can1"))] == ["can0", "can1"]
    timing = ["f_clock=8000000", "brp=1", "tseg1=5", "tseg2=2", "sjw=1"]
    assert configs_of(parse("--timing", *timing))[0]["timing"].bitrate == 1_000_000
    assert configs_of(parse()) == [{}]


def test_filters_are_hex() -> None:
    """100:7FC and 100~7FC become python-can's filter dicts."""
    assert configs_of(parse("--filter", "100:7FC", "200~7F0"))[0]["can_filters"] == [
        {"can_id": 0x100, "can_mask": 0x7FC},
        {"can_id": 0x20000200, "can_mask": 0x7F0},
    ]
    with pytest.raises(SystemExit):
        parse("--filter", "100")


# --- listen-only ---


@pytest.mark.parametrize(
    ("interface", "asked"),
    [
        ("vector", {"listen_only": True}),
        ("slcan", {"listen_only": True}),
        ("nixnet", {"listen_only": True}),
        ("kvaser", {"driver_mode": False, "no_init_access": False}),
        ("seeedstudio", {"operation_mode": "silent"}),
        ("cantact", {"monitor": True}),
        ("socketcan", {}),
        ("gs_usb", {}),
    ],
)
def test_listen_only_is_asked_for_in_each_interfaces_own_words(
    interface: str, asked: dict[str, object]
) -> None:
    """The table of parameters; an interface without any is reported so."""
    assert listen_only.arguments(interface) == asked
    if interface == "gs_usb":
        reported = listen_only.read_back(interface, "0", None)
        assert "not supported by gs_usb" in reported.says
        assert reported.warns


@pytest.mark.parametrize("interface", ["pcan", "systec"])
def test_passive_state_is_python_cans(interface: str) -> None:
    """pcan and systec get can.BusState.PASSIVE."""
    assert listen_only.arguments(interface) == {"state": python_can.load().BusState.PASSIVE}


def attribute(kind: int, *values: bytes) -> bytes:
    """One attribute of rtnetlink: length, type, value, padded to 4 bytes."""
    value = b"".join(values)
    return struct.pack("=HH", 4 + len(value), kind) + value + bytes(-len(value) % 4)


# linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h: a message about can0, up, listen-only, with CAN FD
CAN0_BODY = struct.pack("=BBHiII", 0, 0, 280, 4, 0x1_0081, 0) + b"".join(
    [
        attribute(3, b"can0\0"),
        attribute(
            18 | 0x8000,
            attribute(1, b"can\0"),
            attribute(
                2,
                attribute(1, struct.pack("=8I", 500_000, 875, 25, 0, 69, 10, 1, 2)),
                attribute(4, struct.pack("=I", 0)),
                attribute(5, struct.pack("=II", 0, 0x22)),
            ),
        ),
    ]
)
CAN0 = struct.pack("=IHHII", 16 + len(CAN0_BODY), 16, 0, 1, 0) + CAN0_BODY


def test_socketcan_is_read_back() -> None:
    """rtnetlink reports kind, mode and bit rate; each case has its own sentence."""
    [notice] = devices.notices(CAN0)
    device = notice.device
    assert device == devices.Device("can", True, True, 500_000.0, "ERROR-ACTIVE", 4, "can0")
    assert listen_only.of_device("can0", device).on is True
    loud = listen_only.of_device("can0", device._replace(listen_only=False))
    assert loud.on is False
    assert "listen-only on" in loud.says
    assert listen_only.of_device("vcan0", devices.Device("vcan")).on is True
    assert listen_only.of_device("can9", None).on is None
    for cut in range(len(CAN0)):  # torn: nothing is raised
        assert [each.device for each in devices.notices(CAN0[:cut])] in ([], [device])


def test_the_system_is_asked() -> None:
    """The kernel answers for the loopback device, and for one that does not exist."""
    found = devices.link("lo")
    assert found is not None
    assert (found.kind, found.name, found.ifindex) == ("", "lo", socket.if_nametoindex("lo"))
    assert devices.link_of_index(found.ifindex) == found
    assert devices.link("nocan9") is None


# --- SocketCAN ---


def stamp(seconds: int, ns: int) -> tuple[int, int, bytes]:
    return (socket.SOL_SOCKET, socketcan.SO_TIMESTAMPNS, struct.pack("=qq", seconds, ns))


@pytest.mark.parametrize(
    ("data", "flags", "expected"),
    [
        (struct.pack("=IB3x8s", 0x123, 3, b"abc"), 0, (0x123, b"abc", 0, -1)),
        (struct.pack("=IB3x8s", 0x80012345, 8, b"12345678"), 0, (0x12345, b"12345678", Flag.EXTENDED, -1)),
        (struct.pack("=IB3x8s", 0x40000123, 4, b""), 0, (0x123, b"", Flag.REMOTE, 4)),
        (struct.pack("=IB3x8s", 0xC0012345, 0, b""), 0, (0x12345, b"", Flag.REMOTE | Flag.EXTENDED, 0)),
        (struct.pack("=IB3x8s", 0x20000040, 8, bytes(8)), 0, (0x40, bytes(8), Flag.ERROR, -1)),
        (struct.pack("=IB3x8s", 1, 0, b""), socket.MSG_DONTROUTE, (1, b"", Flag.TX, -1)),
        (struct.pack("=IBB2x64s", 2, 12, 1, b"x" * 12), 0, (2, b"x" * 12, Flag.FD | Flag.BRS, -1)),
        (struct.pack("=IBB2x64s", 2, 64, 6, b"x" * 64), 0, (2, b"x" * 64, Flag.FD | Flag.ESI, -1)),
    ],
)
def test_socketcan_frames_are_parsed(data: bytes, flags: int, expected: tuple[object, ...]) -> None:
    """Bytes arranged as in linux/can.h give id, data, flags and length."""
    parsed = socketcan.parse(data, [stamp(1_600_000_000, 123_456_789)], flags)
    assert parsed.frame.ns == 1_600_000_000_123_456_789
    assert parsed.frame[1:] == expected
    assert parsed.drops is None


def test_the_kernels_drop_count_is_read() -> None:
    """SO_RXQ_OVFL next to the time stamp, in either order, with old and new time structures."""
    data = struct.pack("=IB3x8s", 1, 0, b"")
    drops = (socket.SOL_SOCKET, socketcan.SO_RXQ_OVFL, struct.pack("=I", 77))
    new = (socket.SOL_SOCKET, socketcan.SO_TIMESTAMPNS_NEW, struct.pack("=qq", 5, 6))
    for ancillary in ([drops, stamp(5, 6)], [stamp(5, 6), drops], [new, drops]):
        parsed = socketcan.parse(data, ancillary, 0)
        assert (parsed.drops, parsed.frame.ns) == (77, 5_000_000_006)
    with pytest.raises(ValueError, match="no CAN frame"):
        socketcan.parse(b"abc", [], 0)


def test_a_real_socket_gives_stamps_and_drops() -> None:
    """The same options on a datagram socket of this kernel: time stamps and drop count are understood."""
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with receiver, sender:
        receiver.bind(("127.0.0.1", 0))
        receiver.setsockopt(socket.SOL_SOCKET, socketcan.SO_TIMESTAMPNS, 1)
        socketcan.configure(receiver)
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        frame = struct.pack("=IB3x8s", 0x123, 2, b"ab")
        total = 2000
        for _ in range(total):
            sender.sendto(frame, receiver.getsockname())
        got = 0
        drops = 0
        receiver.setblocking(False)
        try:
            while True:
                parsed = socketcan.parse(*receiver.recvmsg(72, socketcan.ANCILLARY_BYTES)[:3])
                got += 1
                drops = max(drops, parsed.drops or 0)
                assert parsed.frame.ns > 1.7e18
        except BlockingIOError:
            pass
        # the count comes with the next frame for which there is space
        sender.sendto(frame, receiver.getsockname())
        receiver.setblocking(True)
        receiver.settimeout(5)
        drops = socketcan.parse(*receiver.recvmsg(72, socketcan.ANCILLARY_BYTES)[:3]).drops or 0
        assert got < total
        assert got + drops == total


def test_the_socketcan_loop_waits_counts_and_tells() -> None:
    """The receive loop on a real datagram socket: frames, silence, foreign sizes, a closed socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        inner = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        inner.bind(("127.0.0.1", 0))
        inner.setsockopt(socket.SOL_SOCKET, socketcan.SO_TIMESTAMPNS, 1)
        bus = argparse.Namespace(socket=inner, channel="can0", shutdown=inner.close)
        receiver = socketcan.SocketcanReceiver(bus)
        began = time.monotonic()
        assert receiver.recv(0.1) is None
        assert 0.09 < time.monotonic() - began < PATIENCE_S
        assert receiver.recv(0.0) is None
        sender.sendto(b"no frame", inner.getsockname())
        for i in range(100):
            sender.sendto(struct.pack("=IB3x8s", i, 1, bytes([i])), inner.getsockname())
        got = [receiver.recv(1.0) for _ in range(100)]
        assert [(g.id, g.data) for g in got if g] == [(i, bytes([i])) for i in range(100)]
        assert [g.ns for g in got if g] == sorted(g.ns for g in got if g)
        assert receiver.drops == 0
        receiver.close()
        with pytest.raises(BusError, match="socketcan can0 is lost"):
            receiver.recv(0.1)


class Reporting(socket.socket):
    """A datagram socket that reports errors before some of what it holds, as that of a device which is removed."""

    script: ClassVar[list[int]] = []  # errno of each call in turn; 0: as it is

    def recvmsg(self, *arguments: Any) -> Any:
        code = self.script.pop(0) if self.script else 0
        if code:
            raise OSError(code, os.strerror(code))
        return super().recvmsg(*arguments)


@pytest.mark.parametrize(
    "script",
    [
        [errno.ENODEV],
        [errno.ENETDOWN, errno.ENODEV],
        [errno.ENETDOWN, 0, errno.ENODEV],
        [0, 0, errno.ENETDOWN, 0, errno.ENODEV, errno.ENODEV],
    ],
)
def test_what_a_removed_device_has_received_is_read_first(
    script: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel reports down and gone, in any order with the reading: every frame comes, then the loss, once."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        inner = Reporting(socket.AF_INET, socket.SOCK_DGRAM)
        inner.bind(("127.0.0.1", 0))
        bus = argparse.Namespace(socket=inner, channel="can0", shutdown=inner.close)
        receiver = socketcan.SocketcanReceiver(bus)
        for i in range(10):
            sender.sendto(struct.pack("=IB3x8s", i, 1, bytes([i])), inner.getsockname())
        monkeypatch.setattr(Reporting, "script", list(script))
        got = [receiver.recv(1.0) for _ in range(10)]
        assert [frame.id for frame in got if frame] == list(range(10))
        with pytest.raises(BusError, match="socketcan can0 is lost"):
            receiver.recv(0.1)
        assert receiver.recv(0.0) is None
        receiver.close()


def test_an_inverted_filter_is_refused_where_it_would_do_nothing() -> None:
    """ID~MASK on another interface than socketcan is a ConfigError, not a filter that silently fails."""
    with pytest.raises(ConfigError, match="socketcan only"):
        open_bus(
            {"interface": "virtual", "channel": "x", "can_filters": [{"can_id": 0x20000001, "can_mask": 1}]}
        )


def test_error_frames_tell_the_controllers_state() -> None:
    """linux/can/error.h: bus-off, passive, overflow, restart; a mere stuff error says nothing."""
    assert socketcan.meaning(0x40, bytes(8)) == "bus_off"
    assert socketcan.meaning(0x04, bytes([0, 0x10])) == "error_passive"
    assert socketcan.meaning(0x04, bytes([0, 0x01])) is None  # an overflow is no state
    assert socketcan.overflowed(0x04, bytes([0, 0x01]))
    assert socketcan.meaning(0x04, bytes([0, 0x21])) == "error_passive"  # both in one frame
    assert socketcan.overflowed(0x04, bytes([0, 0x21]))
    assert (
        socketcan.meaning(0x04, bytes([0, 0x14])) == "error_passive"
    )  # receiver warning, transmitter passive
    assert socketcan.meaning(0x04, bytes([0, 0x08])) == "error_warning"
    assert socketcan.meaning(0x100, bytes(8)) == "error_active"
    assert socketcan.meaning(0x08, bytes(8)) is None
    assert socketcan.meaning(0x04, b"") is None


# --- bus load ---


def seconds_of(frame: Frame, *bitrates: float) -> float:
    return bus_load.seconds(columns_of([frame]), *bitrates)


def test_bus_load_counts_bits() -> None:
    """A classic 8-byte frame has 111 bits unstuffed, an extended one 131; a rate switch shortens FD."""
    assert math.isclose(seconds_of(Frame(0, 0, 1, bytes(8)), 1e6), 111e-6)
    assert math.isclose(seconds_of(Frame(0, 0, 1, bytes(8), int(Flag.EXTENDED)), 1e6), 131e-6)
    slow = seconds_of(Frame(0, 0, 1, bytes(64), int(Flag.FD)), 5e5, 2e6)
    fast = seconds_of(Frame(0, 0, 1, bytes(64), int(Flag.FD | Flag.BRS)), 5e5, 2e6)
    assert 2 < slow / fast < 4
    assert math.isnan(seconds_of(Frame(0, 0, 1, b""), math.nan))


# --- sending ---


def test_a_physical_bus_must_be_armed() -> None:
    """Only buses without a wire may be sent to; a physical one needs its own name, no other helps."""
    physical = devices.Device(kind="can")
    allowed("virtual", "x", None, None)
    allowed("udp_multicast", "239.0.0.1", None, None)
    allowed("socketcan", "vcan0", None, devices.Device(kind="vcan"))
    allowed("socketcan", "can0", "can0", physical)
    for interface, channel, arm, device in (
        ("socketcan", "can0", None, physical),
        ("socketcan", "can0", "can1", physical),
        ("socketcan", "vcan0", None, None),  # the name proves nothing
        ("socketcan", "", "", None),
        ("pcan", "PCAN_USBBUS1", None, None),
        ("kvaser", "0", "1", None),
    ):
        with pytest.raises(ConfigError, match="will not send"):
            allowed(interface, channel, arm, device)


def test_onto_refuses_before_it_opens_anything() -> None:
    """A physical interface that is not even there: the refusal comes first."""
    with pytest.raises(ConfigError, match="will not send to socketcan can0"):
        onto({"interface": "socketcan", "channel": "can0"}, [])


def test_a_log_sent_onto_virtual_keeps_its_times(request: pytest.FixtureRequest) -> None:
    """Times arrive exact to the ns whatever the speed; error frames are left out, the rest comes in order."""
    channel = request.node.name
    bus = open_bus({"interface": "virtual", "channel": channel})
    frames = [Frame(ns * 1e-9, 0, i, bytes([i])) for i, ns in enumerate((0, 1, 333_333_333, 7_000_000_001))]
    frames.insert(1, Frame(0.0, 0, 0, b"", int(Flag.ERROR)))
    frames.append(Frame(8.0, 0, 0x55, bytes(64), int(Flag.FD | Flag.BRS)))
    sent = onto(parse("-i", "virtual", "-c", channel), frames, speed=math.inf)
    assert sent == 5
    got = [bus.recv(1.0) for _ in range(5)]
    assert [g.ns - got[0].ns for g in got if g and got[0]] == [
        0,
        1,
        333_333_333,
        7_000_000_001,
        8_000_000_000,
    ]
    assert got[-1] is not None
    assert (got[-1].data, got[-1].flags) == (bytes(64), Flag.FD | Flag.BRS)
    bus.shutdown()


def test_sending_is_paced(request: pytest.FixtureRequest) -> None:
    """0.4 s of log at double speed takes 0.2 s."""
    began = time.monotonic()
    onto(
        {"interface": "virtual", "channel": request.node.name},
        [Frame(i * 0.1, 0, i, b"") for i in range(5)],
        2.0,
    )
    assert 0.19 <= time.monotonic() - began < PATIENCE_S


def test_listen_gives_frames_for_its_time(request: pytest.FixtureRequest) -> None:
    """listen() ends after its duration and counts time from the first frame."""
    can = python_can.load()
    channel = request.node.name
    said: list[str] = []
    frames = listen(open_buses(configs_of(parse("-i", "virtual", "-c", channel))), 0.3, said.append)

    def send() -> None:
        sender = can.Bus(channel, interface="virtual")
        for i in range(3):
            sender.send(can.Message(arbitration_id=i))
        sender.shutdown()

    timer = threading.Timer(0.1, send)
    timer.start()
    got = list(frames)
    timer.join()
    assert [frame.id for frame in got] == [0, 1, 2]
    assert got[0].t == 0.0
    assert said == [f"virtual {channel}: listen-only: not needed, virtual is no physical bus"]


def test_drops_are_exact_after_the_last_frame_and_past_32_bits() -> None:
    """SO_MEMINFO of a real socket: what was dropped is known before and after reading, and does not wrap."""
    inner = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    inner.bind(("127.0.0.1", 0))
    inner.setsockopt(socket.SOL_SOCKET, socketcan.SO_TIMESTAMPNS, 1)
    bus = argparse.Namespace(socket=inner, channel="can0", shutdown=inner.close)
    receiver = socketcan.SocketcanReceiver(bus)
    inner.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    total = 500
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(total):
            sender.sendto(struct.pack("=IB3x8s", 0x123, 2, b"ab"), inner.getsockname())
        dropped = receiver.drops
        assert 0 < dropped < total
        got = 0
        while receiver.recv(0.0):
            got += 1
        assert got + dropped == total
        assert receiver.drops == dropped
        receiver._drops_seen = 0xFFFF_FFFF  # as if the kernel's counter had been at its end at the last query
        assert receiver.drops == 2 * dropped + 1
    receiver.close()
    assert receiver.drops == 2 * dropped + 1  # closed: the last query counts
