"""J1939 messages in packets: whole or none, whoever sends at once, whatever is lost, however the frames are cut."""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from canid.io.logs import open_log, write_log
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle import database, decoder, read_vehicle, transport_protocol
from canid.values.frame_columns import columns_of, frames_of, rows
from canid.values.types import Columns, Flag, Frame
from tests.fixtures.measured_logs import MEASURED, files

GROUPS = {0xFEE3, 0xFECA, 0xEF00}
ALL = 0xFF


class Sent(NamedTuple):
    """A message, and the way that it goes."""

    group: int
    source: int
    destination: int
    data: bytes


def drawn(rng: random.Random, n: int, nodes: Sequence[int] = (0, 3, 33)) -> list[Sent]:
    out = []
    for _ in range(n):
        source = rng.choice(nodes)
        destination = rng.choice([ALL, *(node for node in nodes if node != source)])
        group = rng.choice([0xFEE3, 0xFECA] if destination == ALL else [0xFEE3, 0xEF00])
        out.append(
            Sent(group, source, destination, rng.randbytes(rng.choice((9, 14, 39, 64, 65, 200, 1785))))
        )
    return out


def packets(rng: random.Random, one: Sent, *, again: bool) -> Iterator[Frame]:
    """The frames of both sides, without their times; `again`: the receiver asks for some packets twice."""
    count = -(-len(one.data) // 7)

    def management(data: list[int], *, back: bool = False) -> Frame:
        to, by = (one.source, one.destination) if back else (one.destination, one.source)
        octets = bytes(data) + one.group.to_bytes(3, "little")
        return Frame(0.0, 0, 0x1CEC0000 | to << 8 | by, octets, int(Flag.EXTENDED))

    def packet(k: int) -> Frame:
        body = one.data[7 * k - 7 : 7 * k].ljust(7, b"\xff")
        return Frame(
            0.0, 0, 0x1CEB0000 | one.destination << 8 | one.source, bytes([k]) + body, int(Flag.EXTENDED)
        )

    size = [len(one.data) & 0xFF, len(one.data) >> 8, count]
    if one.destination == ALL:
        yield management([32, *size, 255])
        for k in range(1, count + 1):
            yield packet(k)
        return
    yield management([16, *size, 255])
    k = 1
    while k <= count:
        if rng.random() < 0.2:  # wait
            yield management([17, 0, 255, 255, 255], back=True)
        number = min(rng.randint(1, 8), count - k + 1)
        yield management([17, number, k, 255, 255], back=True)
        for each in range(k, k + number):
            yield packet(each)
        if not (again and k + number <= count and rng.random() < 0.3):
            k += number
    yield management([19, *size, 255], back=True)


def traffic(rng: random.Random, sent: Sequence[Sent], *, again: bool = False) -> list[Frame]:
    """The messages of different ways at once, those of one way in turn; other frames between."""
    ways: dict[tuple[int, int], list[Iterator[Frame]]] = {}
    for one in sent:
        # one transfer between two nodes at a time, whoever began
        way = (one.source, ALL) if one.destination == ALL else tuple(sorted((one.source, one.destination)))
        ways.setdefault(way, []).append(packets(rng, one, again=again))  # type: ignore[arg-type]
    frames: list[Frame] = []
    t = 0.0
    while ways:
        t += 0.01
        if rng.random() < 0.2:
            frames.append(Frame(t, 0, 0x0CF00400, rng.randbytes(8), int(Flag.EXTENDED)))
            continue
        way = rng.choice(list(ways))
        frame = next(ways[way][0], None)
        if frame is not None:
            frames.append(frame._replace(t=t))
            continue
        ways[way].pop(0)
        if not ways[way]:
            del ways[way]
    return frames


def read(chunk: Columns, cuts: Sequence[int] = ()) -> tuple[list[Sent], int, int]:
    """The messages, how many were incomplete, and the most transfers at once."""
    transfers: transport_protocol.Transfers = {}
    out, incomplete, most = [], 0, 0
    edges = [0, *sorted(cuts), len(chunk.t)]
    for begin, end in pairwise(edges):
        transfers, made = transport_protocol.step(transfers, rows(chunk, begin, end), GROUPS)
        most = max(most, len(transfers))
        for frame in frames_of(made.frames) if made is not None else ():
            low = frame.id >> 8 & 0xFF
            to_one = frame.id >> 16 & 0xFF < 240
            group = frame.id >> 8 & 0x3FFFF if not to_one else frame.id >> 8 & 0x3FF00
            out.append(Sent(group, frame.id & 0xFF, low if to_one else -1, frame.data))
        incomplete += made.incomplete.total() if made is not None else 0
    return out, incomplete, most


def short(one: Sent) -> Sent:
    """As a listener gives it: 64 bytes, and a destination where the id has one."""
    return one._replace(data=one.data[:64], destination=one.destination if one.group == 0xEF00 else -1)


@pytest.mark.parametrize("again", [False, True])
def test_every_message_is_whole(seed: int, again: bool) -> None:
    """Broadcasts and transfers of three nodes at once, with packets that the receiver asks for twice."""
    rng = random.Random(f"{seed} {again}")
    sent = drawn(rng, 60)
    made, incomplete, _ = read(columns_of(traffic(rng, sent, again=again)))
    assert sorted(made) == sorted(map(short, sent))
    assert incomplete == 0


def test_how_frames_are_cut_changes_nothing(seed: int) -> None:
    rng = random.Random(seed)
    frames = [frame for frame in traffic(rng, drawn(rng, 40), again=True) if rng.random() > 0.02]
    chunk = columns_of(frames)
    whole = read(chunk)
    for _ in range(10):
        assert read(chunk, rng.sample(range(len(frames)), 30))[:2] == whole[:2]


def test_what_is_lost_gives_no_message(seed: int) -> None:
    """Frames of any kind are lost, come twice or change places: no message but those that were sent, and few of them."""
    rng = random.Random(seed)
    total = 0
    for _ in range(10):
        sent = drawn(rng, 40)
        frames = []
        for frame in traffic(rng, sent, again=True):
            chance = rng.random()
            if chance < 0.05:
                continue
            frames += [frame] * (2 if chance > 0.97 else 1)
            if chance > 0.95 and len(frames) > 1:
                frames[-1], frames[-2] = (
                    frames[-2]._replace(t=frames[-1].t),
                    frames[-1]._replace(t=frames[-2].t),
                )
        made, incomplete, _ = read(columns_of(frames))
        assert set(made) <= set(map(short, sent))
        assert len(made) < len(sent)
        assert incomplete > 0
        total += len(made)
    assert total > 20


def test_a_pause_ends_a_transfer() -> None:
    """T1 and T2 of J1939-21: packets of another message may have been lost in it."""
    rng = random.Random(1)
    for destination, pause in ((ALL, 0.8), (3, 1.3)):
        one = Sent(0xFEE3, 0, destination, bytes(range(39)))
        frames = [f._replace(t=0.01 * k) for k, f in enumerate(packets(rng, one, again=False))]
        late = next(k for k, f in enumerate(frames) if f.id >> 16 & 0xFF == 0xEB and f.data[0] == 4)
        shifted = [f._replace(t=f.t + (pause if k >= late else 0.0)) for k, f in enumerate(frames)]
        assert len(read(columns_of(frames))[0]) == 1
        assert read(columns_of(shifted))[0] == []


def test_a_sender_that_begins_anew(seed: int) -> None:
    """Its first message is lost, its second one is whole, and no byte of the first is in it."""
    rng = random.Random(seed)
    first, second = Sent(0xFEE3, 0, ALL, b"a" * 39), Sent(0xFEE3, 0, ALL, b"b" * 30)
    for k in range(1, 6):
        frames = [*list(packets(rng, first, again=False))[:k], *packets(rng, second, again=False)]
        made, incomplete, _ = read(columns_of([f._replace(t=0.05 * n) for n, f in enumerate(frames)]))
        assert made == [short(second)]
        assert incomplete == 1


def test_anything_on_the_ids_of_the_protocol_takes_little_memory(seed: int) -> None:
    """Beginnings of transfers between all nodes on many buses, and noise: so many are kept, and nothing raises."""
    rng = np.random.default_rng(seed)
    n = 20_000
    data = rng.integers(0, 256, (n, 8), dtype=np.uint8)
    data[:, 0] = rng.choice([16, 17, 19, 32, 255, 1, 2, 3], n)
    size = rng.integers(9, 1786, n)
    good = rng.random(n) < 0.7
    data[good, 1], data[good, 2] = (size & 0xFF)[good], (size >> 8)[good]
    data[good, 3], data[good, 5:] = (-(-size // 7))[good], (0xE3, 0xFE, 0)
    ids = 0x1CEB0000 + (rng.integers(0, 2, n) << 16) + rng.integers(0, 65536, n)
    chunk = Columns(
        np.sort(rng.random(n)), rng.integers(0, 2000, n).astype("u2"), ids.astype("u4"),
        np.full(n, int(Flag.EXTENDED), "u1"), rng.integers(0, 9, n).astype("u1"), data,
    )  # fmt: skip
    chunk = chunk._replace(length=np.where(good, 8, chunk.length).astype("u1"))
    _, _, most = read(chunk, range(100, n, 100))
    assert 500 < most <= 1024


TRUCK = """VERSION ""
NS_ :
BS_:
BU_: X
BO_ 2364540158 EEC1: 8 X
 SG_ EngSpeed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" X
BO_ 2566844158 EC1: 39 X
 SG_ EngSpeedAtIdle : 0|16@1+ (0.125,0) [0|8031.875] "rpm" X
 SG_ EngReferenceTorque : 152|16@1+ (1,0) [0|64255] "Nm" X
 SG_ EngSpeedAtPoint : 168|16@1+ (0.125,0) [0|8031.875] "rpm" X
BO_ 2566844926 CCVS: 8 X
 SG_ WheelSpeed : 8|16@1+ (0.00390625,0) [0|250.996] "km/h" X
 SG_ Pedal : 24|8@1+ (0.4,0) [0|100] "%" X
 SG_ Gap : 32|16@1+ (0.01,0) [0|600] "m" X
 SG_ Rate : 48|16@1- (0.01,0) [-300|300] "m/s" X
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
BA_ "VFrameFormat" BO_ 2364540158 3;
BA_ "VFrameFormat" BO_ 2566844158 3;
BA_ "VFrameFormat" BO_ 2566844926 3;
"""


def truck_log(path: Path, rng: random.Random) -> None:
    """EC1 every 2 s, by broadcast and on request; EEC1 between."""
    frames = []
    for k in range(40):
        data = bytearray(b"\xff" * 39)
        data[0:2], data[19:21], data[21:23] = (
            (4800).to_bytes(2, "little"),
            (2300).to_bytes(2, "little"),
            b"\x08\x20",
        )
        to = ALL if k % 2 else 3
        message = packets(rng, Sent(0xFEEE, 0, to, bytes(data)), again=False)
        frames += [f._replace(t=2.0 * k + 0.02 * n) for n, f in enumerate(message)]
        engine = b"\xff\xff\xff" + (8 * 1000 + k).to_bytes(2, "little") + b"\xff\xff\xff"
        frames += [
            Frame(2.0 * k + 0.1 * n + 0.011, 0, 0x0CF00400, engine, int(Flag.EXTENDED)) for n in range(20)
        ]
    write_log(path, sorted(frames, key=lambda frame: frame.t), start_utc=1.7e9)


@pytest.mark.long("verbs on whole logs")
@pytest.mark.parametrize(
    "dbc", [None, *files("reports/53-others/truck.dbc")], ids=["own", "reported"][: 1 + MEASURED.is_dir()]
)
def test_the_verbs_decode_it(dbc: Path | None, tmp_path: Path, seed: int) -> None:
    """look, decode and export give idle speed and reference torque; EC1 of 39 bytes is one of the messages."""
    truck_log(tmp_path / "x.blf", random.Random(seed))
    if dbc is None:
        dbc = tmp_path / "truck.dbc"
        dbc.write_text(TRUCK)

    def canid(*words: object) -> str:
        command = [sys.executable, "-m", "canid", *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path).stdout

    shown = canid("look", "x.blf", "--dbc", dbc, "--all")
    assert "EC1" in shown
    (torque,) = (line.split() for line in shown.splitlines() if line.startswith("EC1.EngReferenceTorque"))
    assert torque[1:5] == ["Nm", "2300", "2300", "2300"]
    lines = [
        line for line in canid("decode", "x.blf", "--dbc", dbc).splitlines() if "EngReferenceTorque" in line
    ]
    assert len(lines) == 40
    assert all("2300 Nm" in line and "600 rpm" in line for line in lines)
    canid("export", "x.blf", "--dbc", dbc, "--signals", "EC1.*", "-o", "out")
    (table,) = tmp_path.glob("out*.csv")
    head, *cells = table.read_text().splitlines()
    values = [dict(zip(head.split(","), map(float, row.split(",")), strict=True)) for row in cells]
    assert len(values) == 40
    assert all(each["EngSpeedAtIdle [rpm]"] == 600.0 for each in values)
    assert all(each["EngReferenceTorque [Nm]"] == 2300.0 for each in values)


def test_signals_behind_the_64th_byte_are_named(tmp_path: Path) -> None:
    """They are not decoded; those in front of it are."""
    far = TRUCK.replace("EC1: 39 X", "EC1: 100 X").replace("168|16", "640|16")
    (tmp_path / "truck.dbc").write_text(far)
    with Parser() as parser:
        _, warnings, _ = database.load(tmp_path / "truck.dbc", None, parser)
    assert warnings == [
        "truck.dbc: EC1.EngSpeedAtPoint: not read, of a message in packets the first 64 bytes are"
    ]


def test_roles_are_read_from_messages_in_packets(tmp_path: Path, seed: int) -> None:
    """A role in a message of 39 bytes comes with its last packet, and a missing packet is counted."""
    rng = random.Random(seed)
    (tmp_path / "car.dbc").write_text(TRUCK)
    (tmp_path / "car.toml").write_text(
        'dbc = ["car.dbc"]\n[signals]\npedal = "CCVS.Pedal"\nspeed = "CCVS.WheelSpeed"\ngap = "CCVS.Gap"\n'
        'range_rate = "CCVS.Rate"\nengine_speed = "EC1.EngSpeedAtIdle"\n'
    )
    truck_log(tmp_path / "x.blf", rng)
    chunks = list(open_log(tmp_path / "x.blf").columns())
    init, step = decoder(read_vehicle(tmp_path / "car.toml"))
    frames = [frame for chunk in chunks for frame in frames_of(chunk)]
    lost = next(k for k, f in enumerate(frames) if f.id == 0x1CEBFF00 and f.data[0] == 3)
    del frames[lost]
    chunk = columns_of(frames)
    last = [k for k, f in enumerate(frames) if f.id >> 16 & 0xFF == 0xEB and f.data[0] == 6]
    for size in (len(frames), 7):
        state, values, at = init(), [], []
        for begin in range(0, len(frames), size):
            state, decoded = step(state, rows(chunk, begin, begin + size))
            for role in decoded.roles:
                values += role.value.tolist()
                at += (begin + role.row).tolist()
        assert values == [600.0] * 39
        assert at == [k for k in last if frames[k].t // 2.0 != frames[lost].t // 2.0]
        assert state.counters["EC1: packets are missing"] == 1
