"""Frame validation: what no bus can carry is counted and left out, for every interface and writer."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.io.buses import python_can
from canid.io.buses.bus import ReceiveOnlyBus
from canid.io.buses.bus_opener import open_bus
from canid.io.buses.bus_reader import BusReader
from canid.io.buses.frame_check import FD_LENGTHS, MAX_STAMP_NS, why_impossible
from canid.io.buses.receivers.received_frame import Received
from canid.io.logs import open_log
from canid.io.logs.log_writer import open_writer
from canid.io.recording.recorder import Recorder
from canid.values.types import Flag, Frame
from tests.fixtures.back_end import registered

NOW = 1_790_000_000 * 10**9
EXT, REMOTE, ERROR, FD, BRS, ESI, TX = (int(flag) for flag in list(Flag))
SUFFIXES = (".blf", ".asc", ".log")

# --- the rules ---


@pytest.mark.parametrize(
    "frame",
    [
        Received(NOW, 0x7FF, bytes(8), 0),
        Received(NOW, 0x1FFFFFFF, b"", EXT),
        Received(NOW, 0x12, bytes(64), FD | BRS | ESI | TX),
        Received(NOW, 0x7FF, b"", REMOTE, 8),
        Received(NOW, 0x1FFFFFFF, bytes(8), ERROR),
        Received(0, 0, b"", 0),
        Received(MAX_STAMP_NS, 0, b"", 0),
        *(Received(NOW, 1, bytes(n), FD) for n in FD_LENGTHS),
    ],
)
def test_what_a_bus_can_carry_passes(frame: Received) -> None:
    """Every kind of frame, at the ends of every range."""
    assert why_impossible(frame) == ""


@pytest.mark.parametrize(
    "frame",
    [
        Received(NOW, 0x800, b"", 0),
        Received(NOW, -1, b"", EXT),
        Received(NOW, 0x20000000, b"", EXT),
        Received(NOW, 10**5000, b"", EXT),
        Received(NOW, True, b"", 0),
        Received(NOW, 1.0, b"", 0),  # type: ignore[arg-type]
        Received(NOW, 1, bytes(9), 0),
        Received(NOW, 1, bytes(65), FD),
        Received(NOW, 1, bytearray(1), 0),  # type: ignore[arg-type]
        Received(NOW, 1, "a", 0),  # type: ignore[arg-type]
        Received(NOW, 1, b"a", REMOTE, 1),
        Received(NOW, 1, b"", REMOTE, 9),
        Received(NOW, 1, b"", REMOTE),
        Received(NOW, 1, b"", REMOTE, math.inf),  # type: ignore[arg-type]
        Received(NOW, 1, b"", REMOTE | FD, 0),
        Received(NOW, 1, b"", REMOTE | ERROR, 0),
        Received(NOW, 1, b"", BRS),
        Received(NOW, 1, b"", ESI | EXT),
        Received(NOW, 1, b"", 128),
        Received(NOW, 1, b"", -1),
        Received(NOW, 1, b"", 0, 0),
        Received(-1, 1, b"", 0),
        Received(MAX_STAMP_NS + 1, 1, b"", 0),
        Received(math.nan, 1, b"", 0),  # type: ignore[arg-type]
        *(Received(NOW, 1, bytes(n), FD) for n in range(66) if n not in FD_LENGTHS),
    ],
)
def test_what_no_bus_can_carry_does_not_pass(frame: Received) -> None:
    """Ids, lengths, flags, stamps and types out of range; the reason is one short line without their digits."""
    why = why_impossible(frame)
    assert why
    assert len(why) < 100
    assert why.isascii()


FLAGS = [f for f in range(128) if not why_impossible(Received(NOW, 1, b"", f, 0 if f & REMOTE else -1))]


@st.composite
def possible(draw: st.DrawFn) -> Received:
    flags = draw(st.sampled_from(FLAGS))
    lengths = {0} if flags & REMOTE else FD_LENGTHS if flags & FD else set(range(9))
    size = draw(st.sampled_from(sorted(lengths)))
    frame = Received(
        draw(st.integers(0, MAX_STAMP_NS)),
        draw(st.integers(0, 0x1FFFFFFF if flags & (EXT | ERROR) else 0x7FF)),
        draw(st.binary(min_size=size, max_size=size)),
        flags,
        draw(st.integers(0, 8)) if flags & REMOTE else -1,
    )
    assert not why_impossible(frame)
    return frame


@pytest.mark.slow("many messages through real sockets")
@settings(max_examples=40, deadline=None)
@given(frames=st.lists(possible(), min_size=1, max_size=30))
def test_every_writer_takes_what_passes(
    tmp_path_factory: pytest.TempPathFactory, frames: list[Received]
) -> None:
    """No frame that passes the check makes a writer fail, at whatever times, and all are read back."""
    folder = tmp_path_factory.mktemp("passes")
    first = min(frame.ns for frame in frames)
    frames = sorted(frames)
    for suffix in SUFFIXES:
        writer = open_writer(folder / f"x{suffix}", first)
        for ns, id_, data, flags, length in frames:
            writer.append(Frame((ns - first) * 1e-9, 0, id_, data, flags, length))
        writer.close()
        log = open_log(folder / f"x{suffix}")
        assert len(list(log)) == len(frames)
        assert log.damage is None


# --- a python-can interface that hands over anything ---


@pytest.fixture(scope="module")
def anything() -> Iterator[Any]:
    """An interface named `anything`, in this process: `.items` holds messages and exceptions to come."""
    can = python_can.load()

    class AnythingBus(can.BusABC):  # type: ignore[misc, name-defined]
        items: list[Any] = []  # noqa: RUF012

        def __init__(self, channel: str = "", **more: Any):
            self.channel_info = "anything"
            super().__init__(channel, **more)

        def _recv_internal(self, timeout: float | None) -> tuple[Any, bool]:
            if not self.items:
                time.sleep(min(timeout or 0.0, 0.01))
                return None, False
            item = self.items.pop(0)
            if isinstance(item, Exception):
                raise item
            return item, True

        def send(self, msg: Any, timeout: float | None = None) -> None:
            raise AssertionError("sent")

    with registered("anything", AnythingBus):
        yield AnythingBus


def open_anything() -> ReceiveOnlyBus:
    return open_bus({"interface": "anything", "channel": "x"})


nonsense = (
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.just(10**5000)
    | st.floats()
    | st.text(max_size=5)
    | st.binary(max_size=80)
    | st.lists(st.integers(), max_size=3)
)
fields = st.fixed_dictionaries(
    {},
    optional=dict.fromkeys(
        (
            *(
                "timestamp",
                "arbitration_id",
                "is_extended_id",
                "is_remote_frame",
                "is_error_frame",
                "dlc",
                "data",
            ),
            *("is_fd", "bitrate_switch", "error_state_indicator", "is_rx"),
        ),
        nonsense,
    ),
)


@pytest.mark.slow("many messages through real sockets")
@settings(max_examples=12, deadline=None)
@given(strange=st.lists(fields, min_size=20, max_size=60))
def test_nonsense_from_a_back_end_costs_no_other_frame(
    anything: Any, tmp_path_factory: pytest.TempPathFactory, strange: list[dict[str, Any]]
) -> None:
    """Messages with any value in any field between good ones: every good one is in .blf, .asc and .log."""
    can = python_can.load()
    folder = tmp_path_factory.mktemp("nonsense")
    for suffix in SUFFIXES:
        items: list[Any] = []
        for i, each in enumerate(strange):
            items.append(can.Message(1_790_000_000 + i * 1e-3, 0x100 + i, False, data=i.to_bytes(8, "big")))
            bad = can.Message(timestamp=1_790_000_000 + i * 1e-3)
            for name, value in each.items():
                setattr(bad, name, value)
            items.append(bad)
        anything.items = items
        total = len(items)
        recorder = Recorder([open_anything()], folder / f"x{suffix}").start()
        wait_until(lambda: not anything.items)
        stats = recorder.stop()
        events = recorder.events()
        assert not [event for event in events if event.what in ("bus_lost", "not_understood")]
        assert stats.buses[0].impossible + stats.frames == total
        assert stats.written == stats.frames
        read = [frame for frame in open_log(folder / f"x{suffix}") if frame.flags == 0]
        assert [f for f in read if len(f.data) == 8 and f.id == 0x100 + int.from_bytes(f.data, "big")] == [
            f for f in read if f.data in {i.to_bytes(8, "big") for i in range(len(strange))} and f.id >= 0x100
        ]
        ids = [f.id for f in read if len(f.data) == 8 and f.id == 0x100 + int.from_bytes(f.data, "big")]
        assert ids == [0x100 + i for i in range(len(strange))]


def wait_until(done: Any, patience: float = 60.0) -> None:
    end = time.monotonic() + patience
    while not done():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_an_error_about_one_message_loses_no_bus(anything: Any) -> None:
    """A parser's error, and one that python-can has wrapped: counted. A driver's error: the bus is lost."""
    can = python_can.load()
    good = can.Message(1_790_000_000.0, 1, False, data=b"a")
    wrapped = can.CanOperationError("could not unpack received message")
    wrapped.__cause__ = KeyError("x")
    anything.items = [ValueError("x"), good, wrapped, good, IndexError(), AssertionError(), good]
    bus = open_anything()
    got = [bus.recv(1.0) for _ in range(3)]
    assert [g.id for g in got if g] == [1, 1, 1]
    assert bus.impossible == 4
    for error in (can.CanOperationError("unplugged"), OSError("gone"), RuntimeError("closed")):
        anything.items = [error]
        with pytest.raises(Exception, match="is lost"):
            bus.recv(1.0)
    bus.shutdown()


def test_a_back_end_that_only_raises_is_lost_in_the_end(anything: Any) -> None:
    """Nothing but parser's errors for seconds: to open it again may help."""

    class Endless(list):  # type: ignore[type-arg]
        def pop(self, index: Any = 0) -> Any:
            return ValueError("again")

    bus = open_anything()
    anything.items = Endless([1])
    end = time.monotonic() + 60.0

    def until_lost() -> None:
        while time.monotonic() < end:
            bus.recv(0.1)

    with pytest.raises(Exception, match="is lost"):
        until_lost()
    bus.shutdown()


def test_a_flood_of_nonsense_is_reported_in_few_words(anything: Any) -> None:
    """100,000 impossible messages: the first, then tenfold counts, then the sum; no thousands of events."""
    can = python_can.load()
    bad = can.Message(1_790_000_000.0, 1, False, data=bytes(9))
    anything.items = [bad] * 20_000
    bus = open_anything()
    events: list[tuple[str, str]] = []
    stopping = threading.Event()
    reader = BusReader(bus, 0, lambda _: None, stopping, lambda what, says: events.append((what, says)))
    thread = threading.Thread(target=reader.run)
    thread.start()
    wait_until(lambda: not anything.items)
    stopping.set()
    thread.join(300.0)
    reported = [says for what, says in events if what == "impossible_frames"]
    assert 1 <= len(reported) <= 8
    assert "20,000 messages left out" in reported[-1]
    assert "9 data bytes in a classic frame" in reported[-1]
    assert bus.impossible == 20_000
    bus.shutdown()


def test_own_zeros_and_strange_first_stamps(anything: Any) -> None:
    """A first message without a usable stamp does not set the zero; a jump by decades is kept, beyond 2096 it is not."""
    can = python_can.load()

    def at(stamp: float) -> Any:
        return can.Message(stamp, 1, False, data=b"a")

    anything.items = [
        at(math.nan),
        at(-math.inf),
        at(-1.0),
        at(5.0),
        at(6.0),
        at(1e9),
        at(1e300),
        at(math.inf),
        at(7.0),
    ]
    bus = open_anything()
    got = [frame for _ in range(9) if (frame := bus.recv(0.0)) is not None]
    assert len(got) == 4
    assert [(g.ns - got[0].ns) * 1e-9 for g in got] == [0.0, 1.0, pytest.approx(1e9 - 5), 2.0]
    assert bus.impossible == 5
    bus.shutdown()


def test_filters_are_applied_behind_the_door(request: pytest.FixtureRequest) -> None:
    """On virtual canid filters itself, by python-can's definition, and still knows what was taken."""
    can = python_can.load()
    filters = [
        {"can_id": 0x100, "can_mask": 0x700},
        {"can_id": 0x12345, "can_mask": 0x1FFFFFFF, "extended": True},
    ]
    config = {"interface": "virtual", "channel": request.node.name, "can_filters": filters}
    bus = open_bus(config)
    sender, theirs = can.Bus(request.node.name, interface="virtual"), can.Bus(**config)
    frames = [(i * 0x35, False) for i in range(38)] + [(0x12345, True), (0x12346, True), (0x123, True)]
    for id_, extended in frames:
        sender.send(can.Message(arbitration_id=id_, is_extended_id=extended))
    expected = [m.arbitration_id for _ in frames if (m := theirs.recv(0.0)) is not None]
    ours = [m.id for _ in frames if (m := bus.recv(0.0)) is not None]
    assert ours == expected
    assert bus.hidden == len(frames) - len(expected)
    for each in (bus, sender, theirs):
        each.shutdown()
