"""Lists of CAN frames as loggers and programs write them: each dialect with drawn frames, and what is refused."""

from __future__ import annotations

import datetime
import random
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from canid.analysis.tables.kinds import is_table
from canid.io.logs import open_log
from canid.values.errors import ConfigError, LogError
from canid.values.types import Flag


class Sent(NamedTuple):
    """A frame that is written."""

    us: int
    bus: int
    id: int
    extended: bool
    data: bytes
    tx: bool = False
    remote: bool = False


START = datetime.datetime(2024, 2, 28, 23, 59, 58, 250_000, tzinfo=datetime.UTC)
EPOCH_US = int(START.timestamp() * 1000) * 1000


def drawn(
    rng: random.Random, *, wide: bool = True, buses: int = 1, remote: bool = False, pause_s: int = 0
) -> list[Sent]:
    """Periodic ids, of 11 and 29 bits, some s long; times are whole ms."""
    ids = [(rng.choice((0x7DF, 0x0AB, rng.randrange(0x800))), False), (rng.randrange(0x1000, 0x7FF0), False)][
        :1
    ]
    ids += [(rng.randrange(0x800), False) for _ in range(3)]
    ids += [(0x18FEF100 | rng.randrange(256), True)] * wide
    frames = []
    for n, (id_, extended) in enumerate(ids):
        period = rng.choice((10, 20, 50)) if n == 0 else rng.choice((20, 50, 100))
        bus = 0 if n < 2 else rng.randrange(buses)
        for k in range(4000 // period):
            size = 0 if n == 1 and k % 7 == 3 else rng.randrange(1, 9)
            asks = remote and k % 9 == 4
            frames.append(
                Sent(
                    (k * period + n) * 1000,
                    bus,
                    id_,
                    extended,
                    b"" if asks else rng.randbytes(size),
                    k % 5 == 2,
                    asks,
                )
            )
    frames.sort()
    half = frames[len(frames) // 2].us
    shifted = [one._replace(us=one.us + pause_s * 10**6 * (one.us >= half)) for one in frames]
    return [one._replace(us=one.us - shifted[0].us) for one in shifted]


def stamp(us: int) -> datetime.datetime:
    return START + datetime.timedelta(microseconds=us)


def canedge(rng: random.Random) -> tuple[str, list[Sent]]:
    """mdf2csv of CSS Electronics."""
    frames = drawn(rng, buses=2, remote=True)
    rows = ["TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;ESI;RTR;DataBytes"]
    for one in frames:
        at, id_ = EPOCH_US + one.us, f"{one.id:08X}" if one.extended else f"{one.id:03X}"
        size = len(one.data)
        rows.append(
            f"{at // 10**6}.{at % 10**6:06d};{one.bus + 1};{id_};{one.extended:d};{size};{size};{one.tx:d};0;0;0;"
            f"{one.remote:d};{one.data.hex().upper()}"
        )
    return "\n".join(rows) + "\n", frames


def clx(rng: random.Random) -> tuple[str, list[Sent]]:
    """A CL1000 or CL2000, in each of its time formats, with separators; over midnight and the end of the month."""
    form = rng.choice((1, 2, 3, 4, 5, 6))
    frames = drawn(rng, pause_s=rng.choice((0, {1: 20, 2: 600, 3: 7200}.get(form, 4 * 86_400))))
    mark, clock, milli, date, between = (
        rng.choice((";", "\t", "|")),
        *rng.choice((("", "", "", "T"), (":", ".", "-", " "))),
    )
    more = rng.random() < 0.3
    rows = [
        "# Logger type: CL2000", "# HW rev: 6.xx", f"# Time: {START:%Y%m%dT%H%M%S}", f'# Value separator: "{mark}"',
        f"# Time format: {form}", f'# Time separator: "{clock}"', "# Silent mode: false",
        mark.join(["Timestamp", *["Lost"] * more, "Type", "ID", *["Length"] * more, "Data"]),
    ]  # fmt: skip
    for one in frames:
        at = stamp(one.us)
        parts = (
            [f"{at:%Y}{date}"] * (form > 5)
            + [f"{at:%m}{date}"] * (form > 4)
            + [f"{at:%d}{between}"] * (form > 3)
        )
        parts += [f"{at:%H}{clock}"] * (form > 2) + [f"{at:%M}{clock}"] * (form > 1)
        parts += [f"{at:%S}{milli}{at.microsecond // 1000:03d}"]
        kind = str(one.extended + 8 * one.tx)
        cells = [
            "".join(parts),
            *["0"] * more,
            kind,
            f"{one.id:x}",
            *[str(len(one.data))] * more,
            one.data.hex(),
        ]
        rows.append(mark.join(cells))
    return "\n".join(rows) + "\n", frames


def zlg(rng: random.Random) -> tuple[str, list[Sent]]:
    """CANTest and ZCANPRO: a counter of 0.1 ms next to the computer's clock, or decimal seconds."""
    frames = drawn(rng)
    counter = rng.random() < 0.5
    way = ["传输方向"] * counter
    rows = [
        ",".join(
            ["序号", "系统时间", "时间标识", "CAN通道", *way, "ID号", "帧类型", "帧格式", "长度", "数据"]
        )
    ]
    for k, one in enumerate(frames):
        at = stamp(one.us + rng.randrange(0, 900))
        tick = (
            f"0x{5_810_000 + one.us // 100:X}" if counter else f"{385 + one.us // 10**6}.{one.us % 10**6:06d}"
        )
        clock = f'="{at:%H:%M:%S}.{at.microsecond // 1000:03d}"' if counter else f'="{at:%H:%M:%S.%f}'
        id_ = f"0x{one.id:08X}" if counter else f"0x{one.id:X}"
        direction = ["发送" if one.tx else "接收"] * counter
        wide = "扩展帧" if one.extended else "标准帧"
        size = f"0x{len(one.data):02X}" if counter else f"{len(one.data)}"
        data = "x| " + one.data.hex(" ") + " " * counter
        rows.append(",".join([f"{k:05d}", clock, tick, "ch1", *direction, id_, "数据帧", wide, size, data]))
    return "\r\n".join(rows) + "\r\n", frames if counter else [one._replace(tx=False) for one in frames]


def ixxat(rng: random.Random) -> tuple[str, list[Sent]]:
    """IXXAT's miniLog, over midnight."""
    frames = drawn(rng)
    rows = ["ASCII Trace IXXAT", "Date: 28:2:2024", '"Time","Identifier (hex)","Format","Flags","Data (hex)"']
    for one in frames:
        at = stamp(one.us)
        clock = f"{at.hour}:{at.minute}:{at.second}.{at.microsecond // 1000:03d}"
        rows.append(
            f'"{clock}","{one.id:X}","{"Ext" if one.extended else "Std"}","","{one.data.hex(" ").upper()}"'
        )
    return "\n".join(rows) + "\n", [one._replace(tx=False) for one in frames]


def asammdf(rng: random.Random) -> tuple[str, list[Sent]]:
    """asammdf's export of bus logging: decimal ids and bytes."""
    frames = drawn(rng)
    head = ("BusChannel", "ID", "IDE", "DLC", "DataLength", "DataBytes")
    rows = [",".join(["timestamps", *(f"CAN_DataFrame.CAN_DataFrame.{name}" for name in head)])]
    for one in frames:
        data = "[" + " ".join(f"{octet:3d}" for octet in one.data) + "]"
        rows.append(f"{one.us / 1e6:.6f},1,{one.id},{one.extended:d},{len(one.data)},{len(one.data)},{data}")
    return "\n".join(rows) + "\n", [one._replace(tx=False) for one in frames]


def pp2can(rng: random.Random) -> tuple[str, list[Sent]]:
    """Bytes in the cells behind the last column; ms."""
    frames = [one._replace(tx=False) for one in drawn(rng)]
    rows = ["Time/ms;Arb. ID ;Ex;Rt;Data"]
    for one in frames:
        octets = ";".join(f"{octet:02X}" for octet in one.data)
        rows.append(f"{one.us // 1000};{one.id:X};{'x' if one.extended else ' '}; ;{octets}")
    return "\n".join(rows) + "\n", frames


def micropecker(rng: random.Random) -> tuple[str, list[Sent]]:
    """One column a byte, types in words, a channel from 1 on, other networks between them."""
    frames = drawn(rng, remote=True)
    rows = ["FileName,a.csv", "DateTime,2024/02/28_23:59:58"]
    rows += ["Time,Ch,Protocol,Dir,Label,State,Type,Format,ID,DL," + ",".join(f"D{k + 1}" for k in range(8))]
    for k, one in enumerate(frames):
        cells = [f"{octet:02X}" for octet in one.data] + [""] * (8 - len(one.data))
        kind, wide = "Remote Frm." if one.remote else "Data Frm.", "Ext" if one.extended else "Std"
        at = f"{one.us // 10**6}.{one.us % 10**6:06d}"
        way = "T" if one.tx else "R"
        rows.append(f"{at},1,CAN,{way},,OK,{kind},{wide},{one.id:X},{len(one.data)},{','.join(cells)}")
        if k % 40 == 7:
            rows.append(f"{at},1,LIN,R,,OK,Data Frm.,Std,3C,2,01,02,,,,,,")
    return "\n".join(rows) + "\n", frames


def pandas_frame(rng: random.Random) -> tuple[str, list[Sent]]:
    """A table of somebody's script: units in names, decimal or hexadecimal as the header states, epoch or not."""
    frames = [one._replace(tx=False) for one in drawn(rng, wide=rng.random() < 0.5)]
    unit, name = rng.choice(((1, "timestamp_us"), (1000, "time [ms]"), (1, "t_us"), (10**6, "Time (s)")))
    zero, decimal = rng.choice((0, EPOCH_US)), rng.random() < 0.5
    base = "id_dec" if decimal else "id (hex)"
    rows = [f"{name},{base},len,data"]
    for one in frames:
        at = one.us + zero
        time = f"{at // unit}" if unit < 10**6 else f"{at // 10**6}.{at % 10**6:06d}"
        data = one.data.hex(",")
        rows.append(f'{time},{one.id if decimal else f"{one.id:x}"},{len(one.data)},"{data}"')
    return "\n".join(rows) + "\n", frames


def clocked(rng: random.Random) -> tuple[str, list[Sent]]:
    """Date and time of day, a direction, a named channel; ids of three and eight digits."""
    frames = drawn(rng)
    rows = ["Timestamp|Channel|Direction|Msg ID|DLC|Payload"]
    for one in frames:
        at = stamp(one.us)
        id_ = f"{one.id:08X}" if one.extended else f"{one.id:03X}"
        way = "Transmit" if one.tx else "Receive"
        rows.append(
            f"{at:%Y-%m-%d %H:%M:%S}.{at.microsecond // 1000:03d}|can0|{way}|{id_}|{len(one.data)}|{one.data.hex('-')}"
        )
    return "\n".join(rows) + "\n", frames


def canking(rng: random.Random) -> tuple[str, list[Sent]]:
    """Kvaser's window: hexadecimal with padded ids, or decimal where a line says so."""
    frames, decimal = drawn(rng, remote=True), rng.random() < 0.4
    rows = ["Format of id field: DEC", "Format of data field: DEC"] * decimal
    rows += ["Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir"]
    for k, one in enumerate(frames):
        id_ = f"{one.id}" if decimal else f"{one.id:08X}"
        data = "".join(f"{octet:3d} " if decimal else f"{octet:02X}  " for octet in one.data)
        marks = "X" * one.extended + " " + "R" * one.remote
        at = f"{one.us // 10**6 + 100:6d}.{one.us % 10**6:06d}"
        rows.append(f" 0  {id_:>10s} {marks:4s}    {len(one.data)}  {data:32s} {at} {'T' if one.tx else 'R'}")
        if k % 90 == 5:
            rows.append(f" 0    00000000            ErrorFrame                     {at} R")
    return "\n".join([*rows, "Logging stopped."]) + "\n", frames


def memorator(rng: random.Random) -> tuple[str, list[Sent]]:
    """What the Memorator's converter writes as plain text."""
    frames = drawn(rng, buses=2)
    rows = ["          Kvaser Memorator Log", "          ====================", "Settings:"]
    rows += [
        "   Format of data field: HEX",
        "   Format of id field:   HEX",
        "   CAN channel:          1 2",
        "",
    ]
    rows += [
        "        Time Chan   Identifier Flags        DLC  Data                           Counter",
        "=" * 80,
    ]
    rows += ["    0.000  Trigger (type=0x1, active=0x00, pre-trigger=0, post-trigger=-1)"]
    for k, one in enumerate(frames):
        at = f"{one.us // 10**6 + 1:4d}.{one.us % 10**6:06d}"
        marks = ("Tx" if one.tx else "Rx") + " x" * one.extended
        rows.append(
            f"{at}  {one.bus + 1:2d}  {one.id:8X}  {marks:5s} {len(one.data):2d}  {one.data.hex(' ').upper():24s} {k + 1:8d}"
        )
    return "\n".join(rows) + "\n", frames


def crtd(rng: random.Random) -> tuple[str, list[Sent]]:
    """OVMS: buses as prefixes or without, comments, events and statistics between the frames."""
    buses = rng.choice((1, 2))
    frames = drawn(rng, buses=buses)
    rows = [f"{EPOCH_US // 10**6}.250000 CXX OVMS CRTD", f"{EPOCH_US // 10**6}.250000 1CEV Open info"]
    for k, one in enumerate(frames):
        at = EPOCH_US + one.us
        time = f"{at // 10**6}.{at % 10**6:06d}"
        kind = f"{one.bus + 1 if buses > 1 else ''}{'T' if one.tx else 'R'}{29 if one.extended else 11}"
        id_ = f"{one.id:08X}" if one.extended else f"{one.id:03X}"
        rows.append(f"{time} {kind} {id_} {one.data.hex(' ').upper()}")
        if k % 60 == 9:
            rows += [f"{time} 1CST intr=5 rxpkt=7", f"{time} CER Error intr=0 rxerr=1"]
    return "\n".join(rows) + "\n", frames


def without_header(rng: random.Random) -> tuple[str, list[Sent]]:
    """HCRL's sets: time, id, length, bytes, a mark that is no direction."""
    frames = [one._replace(tx=False) for one in drawn(rng, wide=False)]
    mark, last = rng.choice(",;\t"), rng.choice((("R", "T"), ("",), ("normal",)))
    rows = []
    for one in frames:
        at = EPOCH_US + one.us
        cells = [
            f"{at // 10**6}.{at % 10**6:06d}",
            f"{one.id:04x}",
            str(len(one.data)),
            *one.data.hex(",").split(","),
        ]
        rows.append(mark.join(filter(None, [*cells, rng.choice(last)])))
    return "\n".join(rows) + "\n", frames


def microchip(rng: random.Random) -> tuple[str, list[Sent]]:
    """Microchip's CAN Bus Analyzer: ms, a direction, ids and bytes with 0x, lines of text above."""
    frames = drawn(rng, wide=False)
    rows = ["Microchip Technology Inc.", "CAN BUS Analyzer", "//----", "Bit rate: 500", "//----"]
    for one in frames:
        octets = "".join(f"0x{octet:02X};" for octet in one.data)
        rows.append(f"{one.us // 1000};{'TX' if one.tx else 'RX'};0x{one.id:X};{len(one.data)};{octets}")
    return "\n".join(rows) + "\n", frames


def named_fields(rng: random.Random) -> tuple[str, list[Sent]]:
    """What python-can prints, of two versions, and HCRL's text."""
    form = rng.choice(("screen", "older", "hcrl"))
    frames = drawn(rng, wide=form != "hcrl", remote=form == "screen")
    rows = []
    for one in frames:
        at = EPOCH_US + one.us
        time = f"Timestamp: {at // 10**6}.{at % 10**6:06d}"
        id_ = (
            f"{one.id:08x}"
            if one.extended
            else f"{one.id:04x}"
            if form != "screen"
            else f"{one.id:03x}".rjust(8)
        )
        kind = "X" if one.extended else "S"
        if form == "screen":
            marks = f"{kind} {'Tx' if one.tx else 'Rx'}   {'R' if one.remote else ' '}          "
            size = 0 if one.remote else len(one.data)
            rows.append(
                f"{time}    ID: {id_}    {marks}    DL: {size:2d}    {one.data.hex(' '):24s}    Channel: can0"
            )
        elif form == "older":
            rows.append(f"{time}    ID: {id_}    {kind}        DLC:  {len(one.data)}    {one.data.hex(' ')}")
        else:
            rows.append(f"{time}        ID: {id_}    000    DLC: {len(one.data)}    {one.data.hex(' ')}")
    kept = frames if form == "screen" else [one._replace(tx=False) for one in frames]
    return "\n".join(rows) + "\n", kept


def fields_with_paths(rng: random.Random) -> tuple[str, list[Sent]]:
    """Columns named as fields of messages: of tshark, of ROS with whole seconds and ns, of rostopic in ns."""
    frames = [one._replace(tx=False) for one in drawn(rng)]
    form = rng.choice(("tshark", "ros", "ros2", "rostopic", "rest"))
    octets = ",".join(f"field.data{k}" for k in range(8))
    rows = {
        "tshark": ["frame.time_epoch,can.id,can.flags.xtd,can.len,data.data"],
        "ros": ["header.seq,header.stamp.secs,header.stamp.nsecs,id,is_extended,dlc,data"],
        "ros2": ["header.stamp.sec,header.stamp.nanosec,header.frame_id,id,is_extended,dlc,data"],
        "rest": ["timestamp,ms,id (dec),is_extended,dlc,data"],
        "rostopic": [
            f"%time,field.header.stamp,field.header.frame_id,field.id,field.is_extended,field.dlc,{octets}"
        ],
    }[form]
    for k, one in enumerate(frames):
        ns = (EPOCH_US + one.us) * 1000
        second, rest = divmod(ns, 10**9)
        size, cells = len(one.data), [*one.data, *[0] * (8 - len(one.data))]
        rows.append(
            {
                "tshark": f"{second}.{rest:09d},0x{one.id:08x},{one.extended:d},{size},{one.data.hex()}",
                "ros": f'{k},{second},{rest},{one.id},{one.extended},{size},"{[*one.data]}"',
                "ros2": f'{second},{rest},can0,{one.id},{one.extended},{size},"{[*one.data]}"',
                "rest": f'{second},{rest // 10**6},{one.id},{one.extended},{size},"{[*one.data]}"',
                "rostopic": f"{ns},{ns},,{one.id},{one.extended:d},{size},{','.join(map(str, cells))}",
            }[form]
        )
    return "\n".join(rows) + "\n", frames


def broken_names(rng: random.Random) -> tuple[str, list[Sent]]:
    """A date next to the time of day, and names in quotes that hold line feeds."""
    frames = [one._replace(tx=False) for one in drawn(rng)]
    rows = ['"Date","Time\nof day","CAN ID\n(hex)",DLC,"Data\n(hex)"']
    for one in frames:
        at = stamp(one.us)
        rows.append(f"{at:%Y-%m-%d},{at:%H:%M:%S.%f},{one.id:X},{len(one.data)},{one.data.hex(' ')}")
    return "\n".join(rows) + "\n", frames


DIALECTS: tuple[Callable[[random.Random], tuple[str, list[Sent]]], ...] = (
    canedge, clx, zlg, ixxat, asammdf, pp2can, micropecker, pandas_frame, clocked, canking, memorator, crtd,
    without_header, microchip, named_fields, fields_with_paths, broken_names,
)  # fmt: skip


@pytest.mark.long("many or long logs")
@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_dialect_is_read_as_it_was_written(
    dialect: Callable[[random.Random], tuple[str, list[Sent]]], tmp_path: Path, seed: int
) -> None:
    """Times to the ms, ids, widths, bytes, directions, remote frames; whatever the suffix and the encoding."""
    rng = random.Random(seed)
    for k in range(5):
        text, frames = dialect(rng)
        path = tmp_path / f"{k}{rng.choice(('.csv', '.txt', '.TXT'))}"
        encoding = rng.choice(("utf-8", "gbk", "utf-16", "utf-8-sig"))
        path.write_bytes(text.encode(encoding))
        log = open_log(path, time_zone="UTC")
        read = list(log)
        assert log.damage is None, text[:500]
        assert len(read) == len(frames)
        for got, one in zip(read, frames, strict=True):
            marks = (Flag.EXTENDED * one.extended) | (Flag.TX * one.tx) | (Flag.REMOTE * one.remote)
            assert (got.bus, got.id, got.data, Flag(got.flags)) == (
                max(log.buses.values(), default=one.bus), one.id, one.data, marks,
            )  # fmt: skip
            assert got.t == pytest.approx(one.us * 1e-6, abs=1e-6)


def test_a_logger_states_its_start(tmp_path: Path) -> None:
    """Local time, completed by the header; a CL1000 has no clock and begins in the year 2000."""
    rows = "# Logger type: CL1000\n# Time: {}\n# Time format: 4\nTimestamp;Type;ID;Data\n01T000000683;8;7df;02010d\n"
    path = tmp_path / "0000001.TXT"
    path.write_text(rows.format("20170131T235959"))
    at = datetime.datetime(2017, 2, 1, tzinfo=datetime.UTC).timestamp() + 0.683
    assert open_log(path, time_zone="UTC").start_utc == pytest.approx(at)
    path.write_text(rows.format("20000101T000000"))
    assert open_log(path, time_zone="UTC").start_ns is None


REFUSED = (
    ("Time (s),ID,Data\n0.1,123,01 0A\n0.2,456,02 0B\n", "may be hexadecimal or decimal"),
    ("Time (s),ID (hex),Data\n0.1,123,1 2 34\n0.2,456,2 3 99\n", "its bytes may be hexadecimal or decimal"),
    ("Time,ID (hex),Data\n" + "".join(f"{2000 * k},123,01 0A\n" for k in range(9)), "the unit of the times"),
    ("Time (s),ID (hex),Data\n" + "".join(f"{(k * 7) % 5}.0,123,01 0A\n" for k in range(99)), "do not go on"),
    ("Time (s),ID,Msg ID,Data\n0.1,0x123,0x4,01 0A\n", "may be its ids"),
    ("Time (s),Type,ID (hex),Data\n0.1,3,123,01 0A\n", "what the numbers in its column 'Type' mean"),
    ("When,ID (hex),Data\n0.1,123,01 0A\n", "named as one of times"),
    ("Time,ID (hex),Data\n3/4/2025 10:00:00,123,01 0A\n", "day or month may be first in its times, such as '3/4/"),
    ("# Logger type: CL2000\n# Time format: 0\nTimestamp;Type;ID;Data\n683;0;7df;02010d\n", "ms within a second"),
    ("Chn Identifier Flg   DLC  D0...1  Time     Dir\n 0    123   2  01  22    0.1 R\n", "Kvaser's plain text, and its"),
    ("0.1,0316,1,8,05,21,68,09,21,21,00,6f\n" * 9, "no line names the columns"),  # a channel, or a length
    ('"No.","Time","Source","Destination","Protocol","Length","Info"\n"1","0.1","","","CAN","16","STD: 0x123"\n', ".pcapng"),
)  # fmt: skip


@pytest.mark.parametrize(("text", "says"), REFUSED)
def test_a_list_that_may_be_read_in_two_ways_is_refused_with_what_was_found(
    text: str, says: str, tmp_path: Path
) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        open_log(path)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("dialect", [crtd, without_header, named_fields, broken_names])
def test_a_list_that_states_1970_or_a_date_states_its_start(
    dialect: Callable[[random.Random], tuple[str, list[Sent]]], tmp_path: Path, seed: int
) -> None:
    path = tmp_path / "x.csv"
    path.write_text(dialect(random.Random(seed))[0])
    assert open_log(path, time_zone="UTC").start_utc == pytest.approx(EPOCH_US / 1e6)


def test_times_of_whole_seconds_are_said(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text(
        "timestamp,id (hex),data\n" + "".join(f"{1711111111 + k // 50},123,01 {k:02X}\n" for k in range(200))
    )
    assert "times are whole seconds" in " ".join(open_log(path).remarks)


def test_what_is_not_read_of_a_list_without_a_header_is_said(tmp_path: Path) -> None:
    """The mark T of an injected frame is no direction."""
    path = tmp_path / "x.csv"
    path.write_text("".join(f"{k / 10},0{k % 7 + 0x316:x},2,05,2{k},{'RT'[k % 2]}\n" for k in range(10)))
    log = open_log(path)
    assert not any(frame.flags for frame in log)
    assert "what stands behind the data, as 'R', is not read" in log.remarks[0]


@pytest.mark.long("many or long logs")
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_damaged_list_is_damage_or_refused(
    dialect: Callable[[random.Random], tuple[str, list[Sent]]], tmp_path: Path, seed: int
) -> None:
    """Bytes, cells and lines that are others, missing or twice there: never an exception of another kind."""
    rng = random.Random(seed)
    text, _ = dialect(rng)
    lines = text.splitlines()[:120]
    wild = (
        "",
        "0x",
        "-",
        '"',
        "1e999",
        "nan",
        "99999999999999999999",
        "0xZZ",
        "\r",
        "\0",
        "é",
        "²",
        "2024-13-45 99:99:99",
    )
    path = tmp_path / "x.csv"
    for _ in range(60):
        rows = lines.copy()
        for _ in range(rng.randrange(1, 6)):
            k = rng.randrange(len(rows)) if rng.random() < 0.6 else rng.randrange(min(12, len(rows)))
            mark = next((each for each in ";,|\t" if each in rows[k]), " ")
            cells = rows[k].split(mark)
            cells[rng.randrange(len(cells))] = rng.choice((*wild, rng.choice(cells)))
            rows[k] = rng.choice(
                (mark.join(cells), rows[k][: rng.randrange(len(rows[k]) + 1)], mark.join(cells[1:]))
            )
        path.write_bytes("\n".join(rows).encode(rng.choice(("utf-8", "gbk", "utf-16")), errors="replace"))
        try:
            log = open_log(path, time_zone="UTC")
            read = list(log)
        except (ConfigError, LogError) as error:
            assert "\n" not in str(error)  # noqa: PT017
            continue
        assert all(0 <= frame.id <= 0x1FFFFFFF and len(frame.data) <= 64 for frame in read)


def test_a_table_of_signals_in_whole_numbers_lists_no_frames(tmp_path: Path, seed: int) -> None:
    """With a header or without: a speed of an engine is no id, a switch no length."""
    rng = random.Random(seed)
    rows = [
        f"{k / 10:.1f},{rng.randrange(700, 6000)},{rng.randrange(2)},{rng.randrange(10, 60)}"
        for k in range(99)
    ]
    path = tmp_path / "x.csv"
    for head in (
        "time,rpm,brake,speed", "time,rpm,n,count", "%time,lead.id,speed.data,gap.data",
        "%time,field.header.frame_id,field.data0,field.data1",
    ):  # fmt: skip
        path.write_text("\n".join([head, *rows]))
        assert is_table(path)
        with pytest.raises(ConfigError, match="table of named columns"):
            open_log(path)
    path.write_text("\n".join(rows))
    assert is_table(path)
