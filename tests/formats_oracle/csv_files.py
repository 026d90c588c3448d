"""Lists of CAN frames in columns, each as the page docs/formats/csv.md has its program."""

from __future__ import annotations

import base64
import datetime
import random

from tests.formats_oracle.drawn_frames import drawn, encoded
from tests.formats_oracle.written import Counts, Written, WrittenFrame

START_US = 1_700_000_000_000_000


def draw(rng: random.Random) -> Written:
    """One file of one of the programs."""
    return rng.choice((python_can, savvycan, cabana, panda, kvaser, vehicle_spy))(rng)


def python_can(rng: random.Random) -> Written:
    """`timestamp,arbitration_id,extended,remote,error,dlc,data` with base64; sent frames may have the time 0."""
    frames = drawn(rng, (0,), fd=True, remote=True)
    # the format has no mark of CAN FD: only more than eight bytes show it
    frames = [_marked_by_length(one) for one in frames]
    lines, header = [], rng.random() < 0.8
    unstamped = rng.random() < 0.3
    latest, found = 0, []
    for k, one in enumerate(frames):
        us = START_US + one.ns // 1000
        stamp = f"{us // 10**6}.{us % 10**6:06d}"
        if unstamped and k and rng.random() < 0.3:
            stamp, one = "0.0", one._replace(ns=latest)
        latest = one.ns
        found.append(one)
        remote = "remote" in one.marks
        length = one.asked if remote else len(one.data)
        packed = base64.b64encode(one.data).decode()
        lines.append(f"{stamp},{one.id:#x},{one.extended:d},{remote:d},0,{length},{packed}")
    if header:
        lines.insert(0, "timestamp,arbitration_id,extended,remote,error,dlc,data")
    content, kind = encoded(rng, lines)
    return Written(
        content, ".csv", tuple(found), Counts(0, int(header)), ("python-can", kind), START_US * 1000
    )


def savvycan(rng: random.Random) -> Written:
    """`Time Stamp,ID,Extended,Dir,Bus,LEN,D1,...`: µs, hexadecimal, a comma behind the last byte."""
    epoch, seconds = rng.random() < 0.5, rng.random() < 0.2
    frames = [_marked_by_length(one) for one in drawn(rng, (0, 1), fd=True, sent=True, ordered=not epoch)]
    columns = 64 if any(len(one.data) > 8 for one in frames) else 8
    lines = ["Time Stamp,ID,Extended,Dir,Bus,LEN," + ",".join(f"D{k + 1}" for k in range(columns))]
    for one in frames:
        us = (START_US if epoch else 5_000_000) + one.ns // 1000
        octets = "".join(f"{octet:02X}," for octet in one.data)
        way = "Tx" if one.sent else "Rx"
        # without zeros at the end, as programs print numbers: "5" among "5.25"
        stamp = f"{us // 10**6}.{us % 10**6:06d}".rstrip("0").rstrip(".") if seconds else f"{us}"
        lines.append(
            f"{stamp},{one.id:08X},{str(one.extended).lower()},{way},{one.bus},{len(one.data)},{octets}"
        )
    content, kind = encoded(rng, lines)
    if seconds and not any("." in line.split(",")[0] for line in lines):
        return savvycan(rng)  # nothing shows the unit
    start = START_US * 1000 if epoch else None
    return Written(content, ".csv", tuple(frames), Counts(0, 1), ("SavvyCAN", kind), start)


def cabana(rng: random.Random) -> Written:
    """`time,addr,bus,data`: s, addresses with 0x or decimal, buses from 128 on are sent, from 192 on refused."""
    frames = [_plain(one) for one in drawn(rng, (0, 1, 2), fd=True, sent=True, tick_ns=10**6)]
    return _of_openpilot(rng, frames, "cabana", ("time", "addr", "bus", "data"))


def panda(rng: random.Random) -> Written:
    """`Bus,MessageID,Message,MessageLength,Time`."""
    frames = [_plain(one) for one in drawn(rng, (0, 1, 2), sent=True, tick_ns=10**6)]
    return _of_openpilot(rng, frames, "panda", ("Bus", "MessageID", "Message", "MessageLength", "Time"))


def _of_openpilot(
    rng: random.Random, frames: list[WrittenFrame], program: str, header: tuple[str, ...]
) -> Written:
    base, refused = rng.choice(("{:#x}", "{}", "{:x}")), rng.random() < 0.3
    if base == "{:x}":
        # one of the first ids shows it by a letter
        frames[0] = frames[0]._replace(id=0x1A0, extended=False)
    prefix = rng.choice(("0x", ""))
    lines, others = [",".join(header)], 1
    for one in frames:
        cells = {
            "time": f"{(10**10 + one.ns) / 1e9:.3f}",
            "addr": base.format(one.id),
            "bus": str(one.bus + 128 * one.sent),
            "data": prefix + one.data.hex().upper(),
            "messagelength": str(len(one.data)),
        }
        cells |= {"messageid": cells["addr"], "message": cells["data"]}
        lines.append(",".join(cells[name.lower()] for name in header))
        if refused and rng.random() < 0.1:
            cells["bus"] = "192"
            lines.append(",".join(cells[name.lower()] for name in header))
            others += 1
    content, kind = encoded(rng, lines)
    return Written(content, ".csv", tuple(frames), Counts(0, others), (program, kind))


def kvaser(rng: random.Random) -> Written:
    """Two lines before the header; flags of canlib; ids and bytes decimal or hexadecimal."""
    frames = drawn(rng, (0, 1), remote=True, sent=True)
    hexadecimal = rng.random() < 0.5
    lines = (
        ['"Kvaser Memorator Log"', "Logging started at: 2025-03-03 10:00:00"] if rng.random() < 0.7 else []
    )
    dated = bool(lines)
    lines.append("Time,Channel,ID,Flags,DLC," + ",".join(f"Data{k}" for k in range(8)) + ",Counter,AbsTime")
    others = len(lines)
    # one that shows the base: a byte with a leading zero, or above 99 without a letter
    frames[0] = frames[0]._replace(
        data=b"\x05\xc8" if not hexadecimal else b"\x05\xab", marks=frozenset(), asked=-1
    )
    for k, one in enumerate(frames):
        flags = (4 if one.extended else 2) | ("remote" in one.marks) | 64 * one.sent
        cells = [f"{octet:02X}" if hexadecimal else str(octet) for octet in one.data]
        cells += [""] * (8 - len(cells))
        id_ = f"{one.id:08X}" if hexadecimal else str(one.id)
        length = one.asked if "remote" in one.marks else len(one.data)
        seconds = 10 * 10**6 + one.ns // 1000
        stamp = f"{seconds // 10**6}.{seconds % 10**6:06d}"
        lines.append(
            f"{stamp},{one.bus},{id_},{flags},{length},{','.join(cells)},{k + 1},2025-03-03 10:00:10"
        )
    content, kind = encoded(rng, lines)
    begin = datetime.datetime(2025, 3, 3, 10, 0, 10, tzinfo=datetime.UTC)
    start = int(begin.timestamp()) * 10**9 if dated else None
    return Written(content, ".csv", tuple(frames), Counts(0, others), ("Kvaser", kind), start)


def vehicle_spy(rng: random.Random) -> Written:
    """A header of several lines, networks by name in the order of the names, Arb ID in hexadecimal."""
    frames = drawn(rng, (0, 1), remote=True, sent=True, tick_ns=1000)
    # a remote frame's length is not written
    frames = [one._replace(asked=0) if "remote" in one.marks else one for one in frames]
    frames[0], frames[1] = frames[0]._replace(bus=0), frames[1]._replace(bus=1)
    names = ("HS CAN", "MS CAN")
    form = "Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,Node,{},B1,B2,B3,B4,B5,B6,B7,B8,Value,"
    form += "Trigger,Signals"
    lines = ["Vehicle Spy 3 Bus Traffic File", "Start Date,3/3/2025", "System Time,160000000"]
    lines += [form.format("PT,Trgt,Src"), form.format("Arb ID,Remote,Xtd"), form.format("PT,Trgt,Src")]
    if rng.random() < 0.5:
        lines[3:] = [form.format("Arb ID,Remote,Xtd")]
    others = len(lines)
    for k, one in enumerate(frames):
        seconds = 2550 * 10**6 + one.ns // 1000
        cells = [f"{octet:02X}" for octet in one.data] + [""] * (8 - len(one.data))
        marks = [str(yes)[0] for yes in ("remote" in one.marks, one.extended)]
        name = names[one.bus]
        stamp = f"{seconds // 10**6}.{seconds % 10**6:06d}"
        lines.append(
            f"{k + 1},{stamp},0.001,67371008,F,{str(one.sent)[0]},{name} ${one.id:X},{name},,"
            f"{one.id:X},{','.join(marks)},{','.join(cells)},,,"
        )
    content, kind = encoded(rng, lines)
    return Written(content, ".csv", tuple(frames), Counts(0, others), ("Vehicle Spy", kind))


def _marked_by_length(one: WrittenFrame) -> WrittenFrame:
    marks = (one.marks & {"remote"}) | ({"fd"} if len(one.data) > 8 else set())
    return one._replace(marks=frozenset(marks))


def _plain(one: WrittenFrame) -> WrittenFrame:
    """Neither the width of the id nor CAN FD has a mark: the numbers show them."""
    return _marked_by_length(one)._replace(extended=one.id > 0x7FF)
