"""Many messages at once are what they are one by one: frames, stamps, filters, what is left out."""

from __future__ import annotations

import contextlib
import random
import socket
import struct
import time
from argparse import Namespace
from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import msgpack
import numpy as np
import pytest

from canid.io.buses.bus import Opened, ReceiveOnlyBus
from canid.io.buses.clock_watch import ClockWatch
from canid.io.buses.draining import Stop
from canid.io.buses.frame_check import ImpossibleFrameError, why_impossible
from canid.io.buses.listen_only import ListenOnly, Mode
from canid.io.buses.receivers import many_messages, socketcan
from canid.io.buses.receivers.datagram_layouts import MAX_LAYOUTS, DatagramReader
from canid.io.buses.receivers.many_messages import GATHER_S, ManyMessages, Pace, stamps
from canid.io.buses.receivers.received_columns import Many, columns_of, frames_of, select
from canid.io.buses.receivers.received_frame import Received
from canid.io.buses.receivers.socketcan import SocketcanReceiver
from canid.io.buses.receivers.socketcan_columns import SocketcanColumnsReceiver, parse_many
from canid.io.buses.receivers.udp_multicast import parse as parse_datagram
from canid.io.buses.timestamp_source import TimestampSource
from canid.values.types import Flag
from tests.buses.test_draining import is_before

SECOND = 1_000_000_000
KERNEL = 1_700_000_000 * SECOND
pytestmark = pytest.mark.skipif(not many_messages.available(), reason="this system has no recvmmsg")


# --- SocketCAN ---


def message(rng: random.Random) -> bytes:
    """A message of a CAN socket, of any kind; some that no controller makes."""
    word = rng.getrandbits(32) if rng.random() < 0.5 else rng.randrange(0x800)
    size = rng.choice((8, 8, 64))
    length = rng.choice((rng.randrange(9), size, rng.randrange(size + 1), rng.randrange(256)))
    return struct.pack("=IBB2x", word, length, rng.getrandbits(8)) + rng.randbytes(size)


def control(kind: int, value: bytes) -> bytes:
    """A control message as the kernel lays it out."""
    head = struct.pack("@Nii", struct.calcsize("@Nii") + len(value), socket.SOL_SOCKET, kind)
    return (head + value).ljust(socket.CMSG_SPACE(len(value)), b"\0")


def timespec(ns: int) -> bytes:
    return struct.pack("=qq", *divmod(ns, SECOND))


def test_messages_are_parsed_as_one_by_one(seed: int) -> None:
    """20,000 messages of all kinds, with the kernel's mark of what was sent here."""
    rng = random.Random(seed)
    messages = [message(rng) for _ in range(20_000)]
    flags = [rng.choice((0, socket.MSG_DONTROUTE, socket.MSG_TRUNC)) for _ in messages]
    octets = np.zeros((len(messages), 72), np.uint8)
    for row, each in enumerate(messages):
        octets[row] = np.frombuffer(rng.randbytes(72), np.uint8)  # left from earlier messages
        octets[row, : len(each)] = np.frombuffer(each, np.uint8)
    lengths = np.array([len(each) for each in messages], np.uint32)
    ns = np.arange(len(messages)) + KERNEL
    found = list(frames_of(parse_many(octets, lengths, np.array(flags, np.int32), ns)))
    for each, flag, stamp, got in zip(messages, flags, ns.tolist(), found, strict=True):
        expected = socketcan.parse(each, [(socket.SOL_SOCKET, 35, timespec(stamp))], flag).frame
        if expected.flags & Flag.REMOTE:
            expected = expected._replace(length=max(expected.length, 0))
        assert got == expected


class Scripted:
    """The control messages and frames of a device with stamps of its own, for either receiver."""

    def __init__(self, rng: random.Random):
        n = rng.choice((1, 5, 40))
        self.rows = [
            (
                rng.random() < 0.3,
                KERNEL + k * 1000,
                rng.choice((0, 5 * SECOND + k * 1001)),
                rng.random() < 0.7,
            )
            for k in range(n)
        ]

    def message(self, row: int) -> tuple[bytes, list[tuple[int, int, bytes]]]:
        error, kernel, hardware, stated = self.rows[row]
        data = struct.pack("=IB3x8s", 0x2000_0004 if error else 0x123, 8, bytes(8))
        reported = [(socket.SOL_SOCKET, 35, timespec(kernel))]
        if stated:
            value = timespec(kernel) + timespec(0) + timespec(hardware)
            reported.append((socket.SOL_SOCKET, 37, value))
        return data, reported


@pytest.mark.parametrize("trial", range(40))
def test_the_clock_is_chosen_as_one_by_one(trial: int, seed: int) -> None:
    """Error frames first, frames with and without hardware stamps, in calls of any size: the same times and clock."""
    rng = random.Random(f"{seed} {trial}")
    script = Scripted(rng)
    wanted = rng.random() < 0.8

    def receiver(kind: Any) -> Any:
        inner = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        return kind(SimpleNamespace(shutdown=inner.close, socket=inner, channel="can0"), hardware=wanted)

    one, many = receiver(SocketcanReceiver), receiver(SocketcanColumnsReceiver)
    expected = []
    for row in range(len(script.rows)):
        parsed = socketcan.parse(*script.message(row), 0)
        plain = one.clock is TimestampSource.KERNEL
        expected.append(parsed.frame.ns if plain else one._stamped(parsed).ns)
    got: list[int] = []
    row = 0
    while row < len(script.rows):
        end = min(row + rng.choice((1, 2, 40)), len(script.rows))
        parts = [script.message(k) for k in range(row, end)]
        ancillary = [b"".join(control(kind, value) for _, kind, value in reported) for _, reported in parts]
        arrays = many._messages
        for k, (data, _) in enumerate(parts):
            arrays.octets[k, : len(data)] = np.frombuffer(data, np.uint8)
            arrays.ancillary[k, : len(ancillary[k])] = np.frombuffer(ancillary[k], np.uint8)
            arrays.lengths[k], arrays.ancillary_lengths[k] = len(data), len(ancillary[k])
        got += many._frames(end - row).ns.tolist()
        row = end
    assert got == expected
    assert many.clock is one.clock
    for each in (one, many):
        each.close()


def test_frames_drops_and_silence_of_a_real_socket() -> None:
    """More frames than one call takes, into a socket that drops some: received and counted are what was sent."""
    inner = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    inner.bind(("127.0.0.1", 0))
    inner.setsockopt(socket.SOL_SOCKET, socketcan.SO_TIMESTAMPNS, 1)
    receiver = SocketcanColumnsReceiver(Namespace(socket=inner, channel="can0", shutdown=inner.close))
    assert receiver.recv_many(0.0, GATHER_S) is None
    assert receiver.recv_many(0.05, GATHER_S) is None
    inner.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1_000_000)
    total = 6000
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for k in range(total):
            sender.sendto(struct.pack("=IB3x8s", k % 2048, 8, struct.pack(">Q", k)), inner.getsockname())
            if k == 10:
                sender.sendto(b"no frame", inner.getsockname())
    seen: list[Received] = []
    while (many := receiver.recv_many(0.0, GATHER_S)) is not None:
        seen += frames_of(many.frames)
    assert len(seen) + receiver.drops in (total, total + 1)  # what is no frame may be among the dropped ones
    assert receiver.drops > 0
    assert [frame.id for frame in seen] == [int.from_bytes(frame.data, "big") % 2048 for frame in seen]
    assert [frame.ns for frame in seen] == sorted(frame.ns for frame in seen)
    assert seen[0].ns > 1.7e18
    assert receiver.clock is TimestampSource.KERNEL
    receiver.close()


def test_control_messages_of_any_kind_and_order(seed: int) -> None:
    """Stamps of 64 and 32 bits, counts of drops, foreign messages, cut ones: each row has what it holds."""
    rng = random.Random(seed)
    rows, expected = [], []
    for k in range(300):
        parts = [(35, timespec(KERNEL + k)), (64, timespec(KERNEL + k)), (29, struct.pack("=ll", 5, k))]
        kinds = rng.sample(parts, 1) if rng.random() < 0.9 else []
        has = [control(kind, value) for kind, value in kinds]
        if rng.random() < 0.5:
            has.append(control(socketcan.SO_RXQ_OVFL, struct.pack("=I", 7 + k // 100)))
        if rng.random() < 0.3:
            has.append(control(37, timespec(1) + timespec(0) + timespec(k)))
        rng.shuffle(has)
        rows.append(b"".join(has))
        expected.append(KERNEL + k if kinds and kinds[0][0] != 29 else 0)
    width = 160
    ancillary = np.zeros((len(rows), width), np.uint8)
    for k, row in enumerate(rows):
        ancillary[k] = np.frombuffer(row.ljust(width, b"\xff"), np.uint8)
    found = stamps(ancillary, np.array([len(row) for row in rows], np.uint64))
    assert found.ns.tolist() == expected
    assert found.drops == 9


# --- udp_multicast ---


def datagram(rng: random.Random, k: int) -> bytes:
    """A datagram of python-can, of another program, or damaged."""
    flags = rng.choice(({}, {}, {}, {"is_fd": True}, {"is_remote_frame": True}, {"is_error_frame": True}))
    extended = rng.random() < 0.2
    size = rng.choice((8, 8, 8, rng.randrange(9), rng.choice((12, 64))))
    fields: dict[str, Any] = {
        "timestamp": rng.choice((0.0, rng.random() * 1e9)),
        "arbitration_id": rng.choice((k % 2048, rng.randrange(200), rng.randrange(1 << 30))),
        "is_extended_id": extended,
        "is_remote_frame": False,
        "is_error_frame": False,
        "channel": None,
        "dlc": size,
        "data": b"" if "is_remote_frame" in flags else rng.randbytes(size),
        "is_fd": False,
        "bitrate_switch": False,
        "error_state_indicator": False,
    }
    fields |= flags
    if rng.random() < 0.1:
        fields[rng.choice(list(fields))] = rng.choice((None, -1, 2**40, "text", b"x", [], 1.5, True, 7))
    packed = bytearray(msgpack.packb(fields))
    if rng.random() < 0.1:
        packed[rng.randrange(len(packed))] = rng.getrandbits(8)
    if rng.random() < 0.02:
        packed += rng.randbytes(300)
    return bytes(packed)


def one_by_one(each: bytes, ns: int) -> Received | str:
    try:
        fields = msgpack.unpackb(each)
    except Exception:
        return "a datagram that is no frame"
    try:
        frame = parse_datagram(fields, ns)
    except ImpossibleFrameError as error:
        return str(error)
    return why_impossible(frame) or frame


@pytest.mark.slow("many messages through real sockets")
@pytest.mark.parametrize("trial", range(10))
def test_datagrams_are_read_as_one_by_one(trial: int, seed: int) -> None:
    """Datagrams of python-can, strange and damaged ones, in calls of any size: the same frames, the same left out."""
    rng = random.Random(f"{seed} {trial}")
    reader = DatagramReader(msgpack.unpackb, 512)
    k = 0
    # a sender of one kind of frame, then anything
    for calls in range(60):
        if calls < 20:
            base = msgpack.unpackb(datagram(random.Random(trial), 1)) if trial % 2 else None
        datagrams = []
        for _ in range(rng.choice((1, 3, 40, 512))):
            k += 1
            if calls < 20 and isinstance(base, dict):
                datagrams.append(
                    msgpack.packb(base | {"timestamp": rng.random(), "arbitration_id": k % 2048})
                )
            else:
                datagrams.append(datagram(rng, k))
        width = 256
        octets = np.frombuffer(rng.randbytes(width * len(datagrams)), np.uint8).reshape(-1, width).copy()
        for row, each in enumerate(datagrams):
            near = each[:width]
            octets[row, : len(near)] = np.frombuffer(near, np.uint8)
        lengths = np.array([len(each) for each in datagrams], np.uint32)
        ns = KERNEL + np.arange(len(datagrams))
        read = [reader.read(octets, lengths, ns, datagrams.__getitem__)]
        bus = bus_of(read.pop)
        found = bus.recv_many(0.0)
        expected = [one_by_one(each, int(stamp)) for each, stamp in zip(datagrams, ns, strict=True)]
        good = [each for each in expected if isinstance(each, Received)]
        assert ([] if found is None else list(frames_of(found))) == good
        assert bus.impossible == len(expected) - len(good)
    assert sum(len(each) for each in reader._layouts.values()) <= MAX_LAYOUTS


# --- the bus ---


def bus_of(receive: Callable[[], Many | None], **options: Any) -> ReceiveOnlyBus:
    """A bus whose receiver takes many, as a script says."""
    receiver = SimpleNamespace(
        recv_many=lambda timeout, gather: receive(), clock=TimestampSource.KERNEL, drops=0, close=lambda: None
    )
    return ReceiveOnlyBus(
        lambda: Opened(receiver, ListenOnly(True, "listen-only", Mode.VERIFIED)),  # type: ignore[arg-type]
        interface="test",
        channel="x",
        **options,
    )


def single_bus_of(frames: list[Received], **options: Any) -> ReceiveOnlyBus:
    """The same, one by one."""
    waiting = deque(frames)
    receiver = SimpleNamespace(
        recv=lambda timeout: waiting.popleft() if waiting else None,
        clock=TimestampSource.KERNEL,
        drops=0,
        close=lambda: None,
    )
    return ReceiveOnlyBus(
        lambda: Opened(receiver, ListenOnly(True, "listen-only", Mode.VERIFIED)),  # type: ignore[arg-type]
        interface="test",
        channel="x",
        **options,
    )


def test_frames_of_a_slow_interface_are_not_kept_until_there_are_many() -> None:
    """An interface that takes 5 ms for each frame and never has none: what was gathered in 20 ms is handed on.

    No frame is later than one that the interface itself delays, whatever the interface takes for it.
    """
    bus = single_bus_of([Received(k, k, b"", 0) for k in range(1000)])
    receive = bus._receiver.recv  # type: ignore[union-attr]

    def slow(timeout: float) -> Received | None:
        time.sleep(0.005)
        return receive(timeout)

    bus._receiver.recv = slow  # type: ignore[union-attr,method-assign]
    for timeout in (0.1, 0.0):
        got = bus.recv_many(timeout)
        assert got is not None
        assert 1 <= len(got.ns) <= 5


def any_received(rng: random.Random, zero: int) -> Received:
    flags = rng.choice((0, 0, int(Flag.EXTENDED), int(Flag.FD), int(Flag.ERROR), rng.randrange(256)))
    ns = zero + rng.randrange(-5, 10**9)
    id_ = rng.choice((rng.randrange(2048), rng.getrandbits(32)))
    if flags & Flag.REMOTE:
        return Received(max(ns, 0), id_, b"", flags, rng.randrange(10))
    return Received(max(ns, 0), id_, rng.randbytes(rng.choice((0, 8, 9, 12, 64))), flags)


@pytest.mark.parametrize("trial", range(30))
def test_the_bus_checks_filters_and_dates_as_one_by_one(trial: int, seed: int) -> None:
    """Impossible frames, filters, a clock with a zero of its own: the same frames, counts and last stamp left out."""
    rng = random.Random(f"{seed} {trial}")
    zero = rng.choice((0, 1, KERNEL))
    frames = [any_received(rng, zero) for _ in range(300)]
    options: dict[str, Any] = {"hide_fd": rng.random() < 0.3}
    if rng.random() < 0.5:
        options["filters"] = [
            {"can_id": 0x100, "can_mask": 0x700},
            {"can_id": 0x12345, "can_mask": 0xFFFF, "extended": rng.random() < 0.5},
        ]
    parts = deque[Many]()
    row = 0
    while row < len(frames):
        end = row + rng.choice((1, 7, 300))
        parts.append(Many(columns_of(frames[row:end])))
        row = end
    one = single_bus_of(frames, **options)
    many = bus_of(lambda: parts.popleft() if parts else None, **options)
    expected = [got for _ in frames if (got := one.recv(0.0)) is not None]
    found = []
    while parts:
        got = many.recv_many(0.0)
        found += [] if got is None else list(frames_of(got))
    if one._offset and expected:  # the host's clock was read twice
        between = found[0].ns - expected[0].ns
        assert 0 <= between < 100 * SECOND
        expected = [each._replace(ns=each.ns + between) for each in expected]
    assert found == expected
    assert (many.impossible, many.hidden) == (one.impossible, one.hidden)


# --- clocks ---


@pytest.mark.parametrize("trial", range(30))
def test_steps_of_a_clock_are_found_as_one_by_one(trial: int, seed: int) -> None:
    """Steps forward and back, pauses, delays: the same steps, the same lead."""
    rng = random.Random(f"{seed} {trial}")
    one, many = ClockWatch(), ClockWatch()
    ns, at = KERNEL, 5.0
    for _ in range(200):
        at += rng.random() * 0.1
        ns += int(rng.random() * 0.1e9) + rng.choice((0,) * 30 + (2 * SECOND, -2 * SECOND, SECOND // 2))
        together = ns - np.cumsum([rng.randrange(10**7) for _ in range(rng.choice((1, 5, 50)))])[::-1]
        if rng.random() < 0.05:
            together[len(together) // 2 :] += rng.choice((3 * SECOND, -3 * SECOND))
        steps = [step for each in together.tolist() if (step := one.update(each, at))]
        assert many.update_many(together, at) == steps
        assert many.lead_ns == one.lead_ns


def test_the_first_frame_after_the_stop_is_that_of_one_by_one(seed: int) -> None:
    """Stamps of the host's and of a device's clock, none, and ones that no clock can have made."""
    rng = random.Random(seed)
    for interface, clock, lead in (
        ("socketcan", TimestampSource.KERNEL, None),
        ("kvaser", TimestampSource.DRIVER, 3.0e9),
        ("virtual", TimestampSource.SENDER, None),
    ):
        bus: Any = SimpleNamespace(interface=interface, clock=clock)
        stop = Stop(bus, lead)
        zero = stop.at_ns if lead is None else int(stop.at * 1e9 + lead)
        for _ in range(300):
            # far from the margins, which move with the time that passes
            away = rng.choice((-1, -1, -1, -10_000, 3600)) * SECOND if rng.random() < 0.7 else 0
            ns = np.array([zero + away - rng.randrange(1000) for _ in range(rng.choice((1, 4)))])
            if rng.random() < 0.2:
                ns[0] = 0
            answers = [is_before(stop, each) for each in ns.tolist()]
            first, unknown = stop.first_after(ns)
            assert first == (answers.index(False) if False in answers else len(ns))
            assert unknown == (first > 0 and answers[first - 1] is None)


def test_rows_are_selected_without_losing_any() -> None:
    columns = columns_of([Received(k, k, bytes([k]), 0) for k in range(9)])
    odd = select(columns, columns.ns % 2 == 1)
    assert [frame.data for frame in frames_of(odd)] == [bytes([k]) for k in (1, 3, 5, 7)]


def test_the_arrays_are_filled_by_the_system_call() -> None:
    """Long messages go on in the second array; the next call overwrites the first ones."""
    inner, outer = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    arrays = ManyMessages(inner, most=3, octets=8, more=16, ancillary=32)
    for text in (b"ab", b"0123456789", b"", b"last"):
        outer.send(text)
    assert arrays.receive() == 3
    assert arrays.lengths.tolist() == [2, 10, 0]
    assert arrays.octets[1].tobytes() + arrays.more[1, :2].tobytes() == b"0123456789"
    assert arrays.stamps(3).ns.tolist() == [0, 0, 0]
    assert arrays.receive() == 1
    assert arrays.octets[0, :4].tobytes() == b"last"
    with pytest.raises(BlockingIOError):
        arrays.receive()
    inner.close()
    with pytest.raises(OSError, match="Bad file"):
        arrays.receive()
    outer.close()


# --- how long is gathered ---


@pytest.mark.parametrize("octets", [120, 250])
def test_a_buffer_holds_four_times_what_comes_while_it_is_gathered(octets: int) -> None:
    """A real socket that nobody reads keeps what 20,000 frames/s give in four times the longest wait."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inner,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outer,
    ):
        # twice this is what the kernel takes of it, and what anybody may ask for
        inner.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 200_000)
        inner.bind(("127.0.0.1", 0))
        outer.connect(inner.getsockname())
        for k in range(20_000):
            outer.send(k.to_bytes(4, "big") + bytes(octets - 4))
        receiver, kept = ManyMessages(inner, most=1024, octets=256, ancillary=32), 0
        with contextlib.suppress(BlockingIOError):
            while True:
                kept += receiver.receive()
        small = Pace(inner)
        assert small.longest == GATHER_S
        size = inner.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        assert kept < 20_000  # it did overflow
        large = SimpleNamespace(getsockopt=lambda *of: 40 * size)
        assert GATHER_S < Pace(large).longest <= 40 * kept / 4 / many_messages.MOST_PER_S  # type: ignore[arg-type]
