"""Listen-only mode: what every interface was really given, under every source of configuration."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from canid.io.buses import listen_only, python_can
from canid.io.buses.bus import ReceiveOnlyBus
from canid.io.buses.bus_opener import open_bus
from canid.io.buses.bus_reader import BusReader
from canid.io.buses.devices import Device
from canid.io.buses.listen_only import Mode
from canid.values.errors import BusError, CanidError, ConfigError

pytest.importorskip("serial")


class Adapter:
    """An slcan adapter on a pseudo terminal: keeps every byte that it is sent."""

    def __init__(self, answers: dict[bytes, bytes] | None = None, delay: float = 0.0):
        """`answers`: to a command's first letter; b"" for any other, each `delay` s after the one before."""
        self.delay = delay
        self.received = b""
        self.answers = {b"": b"\r"} if answers is None else answers
        self.is_open = False
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.channel = os.ttyname(slave)
        self._slave = slave
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with contextlib.suppress(OSError):  # closed
            self._answer()

    def _answer(self) -> None:
        begun = b""
        while True:
            got = os.read(self._master, 1024)
            self.received += got
            *commands, begun = (begun + got).split(b"\r")
            for command in commands:
                self.is_open = command[:1] in (b"L", b"O") or (self.is_open and command[:1] != b"C")
                time.sleep(self.delay)
                os.write(self._master, self.answers.get(command[:1], self.answers.get(b"", b"")))

    def says(self, text: bytes) -> None:
        os.write(self._master, text)

    @property
    def commands(self) -> list[bytes]:
        # what was written may still be on its way to the thread, on a busy machine for a while
        quiet = 0
        while quiet < 10:
            before = len(self.received)
            time.sleep(0.03)
            quiet = quiet + 1 if len(self.received) == before else 0
        return self.received.split(b"\r")[:-1]

    def close(self) -> None:
        os.close(self._slave)
        self._thread.join(300.0)  # its read ends when the other side is closed
        os.close(self._master)


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    adapter = Adapter()
    yield adapter
    adapter.close()


def slcan(adapter: Adapter, **more: Any) -> ReceiveOnlyBus:
    return open_bus({"interface": "slcan", "channel": adapter.channel, "sleep_after_open": 0.0, **more})


def never_active(commands: list[bytes]) -> bool:
    """Only C, S, s, Y, L and the empty command; every L follows a C."""
    return all(command[:1] in (b"C", b"S", b"s", b"Y", b"L", b"") for command in commands) and all(
        commands[i - 1] == b"C" for i, command in enumerate(commands) if command == b"L"
    )


# --- slcan on a pseudo terminal ---


@pytest.mark.filterwarnings("ignore:The 'btr' argument")
@pytest.mark.parametrize("more", [{}, {"bitrate": 500000}, {"btr": "031C"}, {"listen_only": True}])
def test_slcan_is_opened_with_L_and_never_with_O(adapter: Adapter, more: dict[str, Any]) -> None:
    """Every byte that the adapter is sent, from opening to closing: C, bit rate, L."""
    bus = slcan(adapter, **more)
    assert adapter.commands[-1] == b"L"
    assert adapter.is_open
    assert bus.listen_only.mode is Mode.VERIFIED
    assert "opened with L, never with O, and confirmed it" in bus.listen_only.says
    adapter.says(b"t1232abcd\r")
    got = bus.recv(2.0)
    assert got is not None
    assert (got.id, got.data) == (0x123, b"\xab\xcd")
    bus.reopen()
    bus.shutdown()
    assert never_active(adapter.commands), adapter.commands
    assert adapter.commands.count(b"L") >= 2
    assert not adapter.is_open


@pytest.mark.parametrize("source", ["~/.canrc", "~/can.conf", "~/.can", "CAN_CONFIG", "can.rc"])
def test_no_configuration_makes_slcan_active(
    adapter: Adapter, source: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """listen_only=False in each file, in CAN_CONFIG and in can.rc: overruled, reported, and only L is sent."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    if source == "CAN_CONFIG":
        monkeypatch.setenv("CAN_CONFIG", json.dumps({"listen_only": False, "bitrate": 500000}))
    elif source == "can.rc":
        can = python_can.load()
        monkeypatch.setitem(can.rc, "listen_only", False)
    else:
        (tmp_path / source.removeprefix("~/")).write_text(
            "[default]\nlisten_only = False\nbitrate = 500000\n"
        )
    bus = slcan(adapter)
    assert bus.listen_only.mode is Mode.VERIFIED
    assert any("listen_only=False: overruled" in line for line in bus.configured_by)
    assert any(source.removeprefix("~") in line and "listen_only" in line for line in bus.configured_by)
    bus.shutdown()
    assert never_active(adapter.commands)


@pytest.mark.parametrize("value", [False, 0, "no", None])
def test_a_command_line_that_asks_for_an_active_slcan_is_refused(adapter: Adapter, value: object) -> None:
    """--bus-kwargs listen_only=False: one line, and the adapter is sent nothing. None means: not said."""
    if value is None:
        slcan(adapter, listen_only=value).shutdown()
        assert never_active(adapter.commands)
        return
    with pytest.raises(ConfigError, match="canid listens only") as caught:
        slcan(adapter, listen_only=value)
    assert "\n" not in str(caught.value)
    assert adapter.commands == []


@pytest.mark.filterwarnings("ignore:The 'btr' argument")
@pytest.mark.parametrize("btr", ["0\rO\rt1230", "031C\rO", "O", "031C031C\r", "zz"])
def test_a_bit_rate_cannot_smuggle_a_command(adapter: Adapter, btr: str) -> None:
    """A btr that holds O or a frame is refused before it is written."""
    with pytest.raises(CanidError):
        slcan(adapter, btr=btr)
    assert never_active(adapter.commands)


def test_an_adapter_that_another_program_left_active_is_closed_first(adapter: Adapter) -> None:
    """Without a bit rate python-can would send L alone, which an open channel refuses."""
    adapter.is_open = True
    slcan(adapter).shutdown()
    assert adapter.commands[:2] == [b"C", b"L"]


def test_an_adapter_that_refuses_L_is_not_called_verified() -> None:
    """BELL for an answer: the statement says so."""
    for answers, mode, words in (
        ({b"L": b"\a", b"": b"\r"}, Mode.UNVERIFIED, "could not be verified"),
        ({}, Mode.VERIFIED, "gave no answer"),
    ):
        adapter = Adapter(answers)
        bus = slcan(adapter, bitrate=500000)
        assert (bus.listen_only.mode, bus.listen_only.warns) == (mode, mode is Mode.UNVERIFIED)
        assert words in bus.listen_only.says
        bus.shutdown()
        adapter.close()


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("delay", [0.0, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("config", [{}, {"bitrate": 500000}])
def test_a_late_answer_to_another_command_is_not_taken_for_that_to_l(
    delay: float, config: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An adapter that is slow, or waits for a busy machine: C is confirmed, L refused, and that is what is reported."""
    # on a busy machine the test's own adapter is slow
    monkeypatch.setattr("canid.io.buses.slcan._ANSWER_S", 2.0)
    monkeypatch.setattr("canid.io.buses.slcan._MAX_SETTLE_S", 2.0)
    for answer, mode in ((b"\a", Mode.UNVERIFIED), (b"\r", Mode.VERIFIED)):
        adapter = Adapter({b"L": answer, b"": b"\r"}, delay)
        bus = slcan(adapter, **config)
        assert bus.listen_only.mode is mode
        assert ("confirmed it" in bus.listen_only.says) is (mode is Mode.VERIFIED)
        bus.shutdown()
        adapter.close()


def test_slcan_writes_nothing_else_whoever_asks(adapter: Adapter) -> None:
    """The class below: send, and every command that is not for configuring, raise."""
    bus = python_can.bus_class("slcan")
    from canid.io.buses.slcan import listening_class

    assert issubclass(listening_class(), bus)
    inner = listening_class()(adapter.channel, sleep_after_open=0.0)
    before = len(adapter.commands)
    can = python_can.load()
    for act in (
        lambda: inner.send(can.Message(arbitration_id=1)),
        lambda: inner._write("O"),
        lambda: inner._write("L\rO"),
        lambda: inner._write("S6\n"),
        lambda: inner.get_version(0.0),
    ):
        with pytest.raises(BusError, match="listens only"):
            act()
    assert len(adapter.commands) == before
    inner.shutdown()


def test_a_line_that_is_no_text_costs_itself_only(adapter: Adapter) -> None:
    """Noise on the serial line: counted, and the next frame is read."""
    bus = slcan(adapter)
    adapter.says(b"t1\xff\xfe2\rtxyz0\rt4565\rT0000012300\rt0073aabbcc\r")
    got = []
    end = time.monotonic() + 5.0
    while len(got) < 1 or got[-1].id != 7:
        frame = bus.recv(0.1)
        if frame is not None:
            got.append(frame)
        assert time.monotonic() < end
    assert [(f.id, f.data) for f in got] == [(0x123, b""), (7, bytes([0xAA, 0xBB, 0xCC]))]
    assert bus.impossible == 3  # no text, no number, fewer bytes than stated
    bus.shutdown()


@pytest.mark.slow("many messages through real sockets")
@pytest.mark.parametrize("verb", ["record", "live", "check"])
@pytest.mark.parametrize("source", ["environment", "file", "command line"])
def test_no_verb_opens_slcan_actively(adapter: Adapter, verb: str, source: str, tmp_path: Path) -> None:
    """The whole command in a process of its own."""
    env = {**os.environ, "HOME": str(tmp_path)}
    words = ["-i", "slcan", "-c", adapter.channel, "--duration", "0.5"]
    if source == "environment":
        env["CAN_CONFIG"] = json.dumps({"listen_only": False, "sleep_after_open": 0})
    elif source == "file":
        text = "[default]\nlisten_only = no\nsleep_after_open = 0\nbitrate = 500000\n"
        (tmp_path / ".canrc").write_text(text)
        (tmp_path / "can.conf").write_text(text)
    else:
        words += ["--bus-kwargs", "listen_only=False", "sleep_after_open=0"]
    words += ["--vehicle", "generic"] if verb == "live" else []
    done = subprocess.run(
        [sys.executable, "-m", "canid", verb, *words],
        cwd=tmp_path,
        env=env,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert never_active(adapter.commands), adapter.commands
    if source == "command line":
        assert done.returncode == 2, done.stderr
        assert adapter.commands == []
    else:
        assert b"L" in adapter.commands, done.stderr


# --- the other interfaces: what is read back, from objects with python-can's own attributes ---


class _Driver:
    def __init__(self, code: int, value: int):
        self._answer = (code, value)

    def GetValue(self, handle: object, parameter: int) -> tuple[int, int]:
        assert parameter == 8
        return self._answer


@pytest.mark.parametrize(
    ("interface", "bus", "mode"),
    [
        ("vector", SimpleNamespace(_listen_only=True, mask=3, permission_mask=3), Mode.VERIFIED),
        ("vector", SimpleNamespace(_listen_only=True, mask=3, permission_mask=1), Mode.UNVERIFIED),
        ("vector", SimpleNamespace(), Mode.UNVERIFIED),
        ("nixnet", SimpleNamespace(_interface=SimpleNamespace(can_lstn_only=True)), Mode.VERIFIED),
        ("nixnet", SimpleNamespace(_interface=SimpleNamespace(can_lstn_only=False)), Mode.ACTIVE),
        ("pcan", SimpleNamespace(m_objPCANBasic=_Driver(0, 1), m_PcanHandle=0), Mode.VERIFIED),
        ("pcan", SimpleNamespace(m_objPCANBasic=_Driver(0, 0), m_PcanHandle=0), Mode.ACTIVE),
        ("pcan", SimpleNamespace(m_objPCANBasic=_Driver(4, 1), m_PcanHandle=0), Mode.UNVERIFIED),
        ("systec", SimpleNamespace(_params={"mode": 1}), Mode.VERIFIED),
        ("systec", SimpleNamespace(_params={"mode": 2}), Mode.ACTIVE),
        ("seeedstudio", SimpleNamespace(op_mode="silent"), Mode.VERIFIED),
        ("seeedstudio", SimpleNamespace(op_mode="normal"), Mode.ACTIVE),
        ("kvaser", SimpleNamespace(), Mode.UNVERIFIED),
        ("cantact", SimpleNamespace(), Mode.UNVERIFIED),
        ("socketcand", SimpleNamespace(), Mode.UNVERIFIED),
        ("gs_usb", SimpleNamespace(), Mode.ACTIVE),
        ("virtual", SimpleNamespace(), Mode.NOT_NEEDED),
        ("no_such_plugin", SimpleNamespace(), Mode.UNVERIFIED),
    ],
)
def test_the_statement_comes_from_the_open_bus(interface: str, bus: object, mode: Mode) -> None:
    """Attributes and driver answers as in python-can 4.6; what is missing or contrary is never called listen-only."""
    reported = listen_only.read_back(interface, "0", bus)
    assert reported.mode is mode
    assert reported.warns is (mode in (Mode.ACTIVE, Mode.UNVERIFIED))
    assert (reported.on is True) is (mode in (Mode.VERIFIED, Mode.NOT_NEEDED))
    assert "\n" not in reported.says


def test_every_wish_is_a_parameter_that_python_can_reads() -> None:
    """Each keyword of the table stands in its interface's source: a renamed one would be ignored without a word."""
    can = python_can.load()
    folder = Path(can.__file__).parent / "interfaces"
    for interface in sorted(can.VALID_INTERFACES):
        parameters = listen_only.arguments(interface)
        module = can.interfaces.BACKENDS[interface][0].removeprefix("can.interfaces.").replace(".", "/")
        place = folder / module
        sources = list(place.glob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
        text = "".join(path.read_text() for path in sources)
        for name in parameters:
            assert f'"{name}"' in text or f"{name}=" in text or f"{name}:" in text, (interface, name)


@pytest.mark.parametrize(
    ("interface", "contrary"),
    [
        ("slcan", {"listen_only": False}),
        ("vector", {"listen_only": False}),
        ("nixnet", {"listen_only": 0}),
        ("pcan", {"state": "ACTIVE"}),
        ("systec", {"state": "ACTIVE"}),
        ("kvaser", {"driver_mode": True}),
        ("kvaser", {"no_init_access": True}),
        ("seeedstudio", {"operation_mode": "normal"}),
        ("seeedstudio", {"operation_mode": "loopback"}),
        ("cantact", {"monitor": False}),
    ],
)
def test_the_contrary_is_refused_or_overruled(interface: str, contrary: dict[str, object]) -> None:
    """On the command line: ConfigError, one line. From a file: canid's parameters replace it, and that is reported."""
    can = python_can.load()
    contrary = {k: can.BusState[str(v)] if k == "state" else v for k, v in contrary.items()}
    with pytest.raises(ConfigError, match="canid listens only"):
        listen_only.impose(interface, contrary, frozenset(contrary))
    out, says = listen_only.impose(interface, contrary, frozenset())
    assert {key: out[key] for key in contrary} == {
        key: listen_only.arguments(interface)[key] for key in contrary
    }
    assert "overruled" in says


def test_devices_say_what_holds() -> None:
    """Each kind of network device has a mode, and vcan needs none."""
    modes = {
        Mode.VERIFIED: Device("can", True, True),
        Mode.ACTIVE: Device("can", True, False),
        Mode.NOT_NEEDED: Device("vcan"),
        Mode.UNVERIFIED: Device("vxcan"),
    }
    for mode, device in modes.items():
        assert listen_only.of_device("can0", device).mode is mode
    assert listen_only.of_device("can0", None).mode is Mode.UNVERIFIED
    assert listen_only.of_device("", Device("vcan")).mode is Mode.UNVERIFIED


def test_the_statement_is_made_again_when_a_bus_comes_back(adapter: Adapter) -> None:
    """An adapter that refuses L after it was unplugged: an event says so, once."""
    bus = slcan(adapter)
    assert bus.news() == []
    adapter.answers = {b"L": b"\a", b"": b"\r"}
    bus.reopen()
    assert bus.listen_only.mode is Mode.UNVERIFIED
    assert bus.news() == [("listen_only_changed", bus.listen_only.says)]
    assert bus.news() == []
    bus.shutdown()


def test_a_bus_that_is_not_known_to_listen_only_stands_in_the_journal() -> None:
    """The reader reports it before the first frame."""
    adapter = Adapter({b"L": b"\a", b"": b"\r"})
    bus = slcan(adapter)
    events: list[tuple[str, str]] = []
    stopping = threading.Event()
    stopping.set()
    BusReader(bus, 0, lambda _: None, stopping, lambda what, says: events.append((what, says))).run()
    assert ("listen_only", bus.listen_only.says) in events
    bus.shutdown()
    adapter.close()
