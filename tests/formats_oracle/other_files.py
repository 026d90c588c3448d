"""Logs of BusMaster and CanHacker, written from docs/formats/others.md."""

from __future__ import annotations

import datetime
import random

from tests.formats_oracle.drawn_frames import drawn, encoded
from tests.formats_oracle.written import Counts, Written, WrittenFrame

HEAD = ("***BUSMASTER Ver 3.2.2***", "***PROTOCOL CAN***", "***NOTE: PLEASE DO NOT EDIT THIS DOCUMENT***")
# from a session's start to its first frame: none is earlier than the start
LEAD_NS = 60 * 10**9
COLUMNS = "***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***"


def draw(rng: random.Random) -> Written:
    """One file of either program."""
    return busmaster(rng) if rng.random() < 0.6 else canhacker(rng)


def busmaster(rng: random.Random) -> Written:
    """One or two sessions, hexadecimal or decimal, with times of one of three kinds."""
    mode, decimal = rng.choice(("SYSTEM", "ABSOLUTE", "RELATIVE")), rng.random() < 0.5
    begin = datetime.datetime(2025, 3, 3, rng.choice((10, 23)), 59, 50, tzinfo=datetime.UTC)
    lines: list[str] = []
    frames: list[WrittenFrame] = []
    others, offset = 0, 0
    for _ in range(rng.choice((1, 1, 2))):
        part = drawn(rng, (0, 1), remote=True, sent=True, tick_ns=100_000, ordered=mode != "ABSOLUTE")
        start = begin + datetime.timedelta(seconds=offset)
        session = _session(rng, part, start, mode, decimal)
        lines += session
        others += len(session) - len(part)
        frames += [one._replace(ns=one.ns + offset * 10**9) for one in part]
        offset += 400
    content, kind = encoded(rng, lines)
    epoch = int(begin.timestamp()) * 10**9 + LEAD_NS
    words = ("BusMaster", mode, "DEC" if decimal else "HEX", kind)
    return Written(content, ".log", tuple(frames), Counts(0, others), words, epoch)


def _session(
    rng: random.Random, frames: list[WrittenFrame], start: datetime.datetime, mode: str, decimal: bool
) -> list[str]:
    date = f"{start.day}:{start.month}:{start.year} {start.hour}:{start.minute}:{start.second}:000"
    lines = [*HEAD, "***[START LOGGING SESSION]***", f"***START DATE AND TIME {date}***"]
    lines += [f"***{'DEC' if decimal else 'HEX'}***", f"***{mode} MODE***", COLUMNS]
    midnight = start.replace(hour=0, minute=0, second=0)
    before = -LEAD_NS
    for one in frames:
        if rng.random() < 0.05:
            lines.append("***a remark***")
        ns = LEAD_NS + one.ns
        if mode == "SYSTEM":
            ns = (ns + int((start - midnight).total_seconds()) * 10**9) % (86_400 * 10**9)
        elif mode == "RELATIVE":
            ns, before = one.ns - before, one.ns
        seconds, rest = divmod(ns, 10**9)
        stamp = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}:{rest // 100_000:04d}"
        remote = "remote" in one.marks
        kind = ("x" if one.extended else "s") + ("r" if remote else "")
        octets = " ".join(str(octet) if decimal else f"{octet:02X}" for octet in one.data)
        id_ = str(one.id) if decimal else f"0x{one.id:03X}"
        length = one.asked if remote else len(one.data)
        way = "Tx" if one.sent else "Rx"
        lines.append(f"{stamp} {way} {one.bus + 1} {id_} {kind} {length} {octets}".rstrip())
    return [*lines, f"***END DATE AND TIME {date}***", "***[STOP LOGGING SESSION]***"]


def canhacker(rng: random.Random) -> Written:
    """Seconds up to 60, with a comma or a point; a comment may follow."""
    frames = drawn(rng, (0,), tick_ns=10**6, ordered=True)
    sign = rng.choice(",.")
    lines = ["Time     ID        DLC       Data                    Comment"]
    # no pause as long as half a minute: a minute that begins again would be the same
    ns, found = 0, []
    for one in frames:
        found.append(one._replace(ns=ns, sent=False))
        milli = (11_000 + ns // 10**6) % 60_000
        id_ = f"{one.id:08X}" if one.extended else f"{one.id:03X}"
        remark = rng.choice(("", "", "a remark", "AB")) if one.data else ""
        lines.append(
            f"{milli // 1000:02d}{sign}{milli % 1000:03d}   {id_}   {len(one.data)}   {one.data.hex(' ').upper()} {remark}"
        )
        ns += rng.choice((0, 1, 10, 20_000)) * 10**6
    content, kind = encoded(rng, lines)
    return Written(content, ".trc", tuple(found), Counts(0, 1), ("CanHacker", kind))
