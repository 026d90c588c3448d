"""Files of candump, written from docs/formats/candump.md: `-L`/`-l` logs, and the output for the screen with times."""

from __future__ import annotations

import datetime
import random

from tests.formats_oracle.drawn_frames import drawn, encoded
from tests.formats_oracle.written import Counts, Written, WrittenFrame

# interface -> bus, as the page says
NAMES = (
    {"can0": 0},
    {"can1": 1},
    {"can0": 0, "can1": 1},
    {"vcan0": 0, "vcan3": 3},
    {"can0": 0, "can2": 2, "can10": 10},
    {"can0": 0, "can1": 1, "vcan0": 2},
    {"body": 0, "powertrain": 1},
    {"can1": 1, "slcan": 2},
)
START_S = 1_700_000_000


def draw(rng: random.Random) -> Written:
    """One file of either form."""
    return _log(rng) if rng.random() < 0.5 else _screen(rng)


def _log(rng: random.Random) -> Written:
    names = rng.choice(NAMES)
    by_bus = {bus: name for name, bus in names.items()}
    frames = _all_buses(rng, drawn(rng, tuple(by_bus), fd=True, remote=True, error=True, sent=True), by_bus)
    with_way, dots = rng.random() < 0.5, rng.random() < 0.2
    if not with_way:
        frames = [one._replace(sent=False) for one in frames]
    start = START_S * 10**9 + rng.randint(0, 10**6) * 1000
    lines, others = [], 0
    for one in frames:
        if rng.random() < 0.05:
            lines.append("# a remark")
            others += 1
        us = (start + one.ns) // 1000
        way = (" T" if one.sent else " R") if with_way else ""
        stamp = f"({us // 10**6:010d}.{us % 10**6:06d})"
        lines.append(f"{stamp} {by_bus[one.bus]} {_log_frame(one, dots)}{way}")
    content, kind = encoded(rng, lines)
    first = start // 1000 * 1000 + frames[0].ns
    return Written(content, ".log", tuple(frames), Counts(0, others), ("log", kind, *names), first)


def _log_frame(one: WrittenFrame, dots: bool) -> str:
    if "error" in one.marks:
        return f"{0x20000000 | one.id:08X}#{one.data.hex().upper()}"
    id_ = f"{one.id:08X}" if one.extended else f"{one.id:03X}"
    if "remote" in one.marks:
        return f"{id_}#R{one.asked or ''}"
    octets = ("." if dots else "").join(f"{octet:02X}" for octet in one.data)
    if "fd" in one.marks:
        flags = ("brs" in one.marks) + 2 * ("esi" in one.marks)
        return f"{id_}##{flags:X}{octets}"
    return f"{id_}#{octets}"


def _screen(rng: random.Random) -> Written:
    names = rng.choice(NAMES)
    by_bus = {bus: name for name, bus in names.items()}
    option = rng.choice(("a", "A", "z", "d"))
    frames = drawn(rng, tuple(by_bus), fd=True, remote=True, error=True, ordered=option in "zd")
    # the screen shows neither bit-rate switch nor error state
    frames = _all_buses(rng, [one._replace(marks=one.marks - {"brs", "esi"}) for one in frames], by_bus)
    if option == "d":
        # steps between which candump's own time cannot be taken for one since the first frame
        steps = [0, *(rng.choice((900, 100)) * 10**6 + (k % 2) * 10**9 for k in range(len(frames) - 1))]
        frames = [one._replace(ns=sum(steps[: k + 1])) for k, one in enumerate(frames)]
        if len(frames) < 8:
            option = "a"
    elif option == "z":
        frames = [one._replace(ns=k * 10**6 + one.ns) for k, one in enumerate(frames)]
    direction, letters = rng.random() < 0.3, rng.random() < 0.3
    color, octets = rng.choice((0, 0, 1, 2, 3)), rng.choice(("", "", "-S", "-i", "-i -S"))
    explained = rng.random() < 0.3
    others = 0
    start = START_S * 10**9
    lines, before = [], frames[0].ns
    for one in frames:
        ns = {"a": start + one.ns, "A": start + one.ns, "z": one.ns, "d": one.ns - before}[option]
        before = one.ns
        stamp = f"{ns // 10**9:03d}.{ns % 10**9 // 1000:06d}"
        if option == "A":
            at = datetime.datetime.fromtimestamp(ns // 10**9, datetime.UTC)
            stamp = f"{at:%Y-%m-%d %H:%M:%S}.{ns % 10**9 // 1000:06d}"
        way = ("TX - -  " if one.sent else "RX - -  ") if direction else ""
        on, off = "\x1b[31m" * (color > 0), "\x1b[0m" * (color > 0)
        name = f"{on * (color < 3)}{by_bus[one.bus]:>5}{off * (color == 1)}"
        frame = _screen_frame(one, letters, octets)
        lines.append(f" {on * (color == 3)}({stamp})  {name}  {way}{frame}{off * (color > 1)}")
        if explained and "error" in one.marks:
            lines += ["\tprotocol-violation{{tx-recessive-bit-error}{acknowledge-slot}}", "\tbus-error"]
            others += 2
    content, kind = encoded(rng, lines)
    first = start + frames[0].ns if option in "aA" else None
    words = ("screen", f"-t {option}", kind, *["-c"] * (color > 0), *octets.split(), *["-e"] * (others > 0))
    return Written(content, ".log", tuple(frames), Counts(0, others), words, first)


def _screen_frame(one: WrittenFrame, letters: bool, how: str) -> str:
    """`how`: -i shows bits, -S the last byte first, with a grave accent between bytes and around their characters."""
    order = bytes(reversed(one.data)) if "-S" in how else one.data
    cells = [f"{octet:08b}" if "-i" in how else f"{octet:02X}" for octet in order]
    octets = ("`" if "-S" in how else " ").join(cells)
    if "error" in one.marks:
        return f"{0x20000000 | one.id:08X}   [8]  {octets}   ERRORFRAME"
    id_ = f"{one.id:08X}" if one.extended else f"{one.id:03X}"
    if "remote" in one.marks:
        return f"{id_}   [{one.asked}]  remote request"
    length = f"[{len(one.data):02d}]" if "fd" in one.marks else f"[{len(one.data)}]"
    octets = f"{id_}  {length:>4}  {octets}"
    shown = "".join(chr(octet) if 32 <= octet < 127 else "." for octet in order)
    mark = "`" if "-S" in how else "'"
    return f"{octets}   {mark}{shown}{mark}" if letters and one.data else octets.rstrip()


def _all_buses(rng: random.Random, frames: list[WrittenFrame], by_bus: dict[int, str]) -> list[WrittenFrame]:
    """Every interface speaks: the number of a bus follows from the names that a log has."""
    buses = [*by_bus, *(rng.choice([*by_bus]) for _ in frames[len(by_bus) :])]
    while len(frames) < len(by_bus):
        frames.append(frames[-1])
    rng.shuffle(buses)
    return [one._replace(bus=bus) for one, bus in zip(frames, buses, strict=True)]
