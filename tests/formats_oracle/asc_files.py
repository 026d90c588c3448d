"""Random .asc files, written from docs/formats/asc.md alone."""

from __future__ import annotations

import datetime
import gzip
import random
from collections.abc import Callable
from typing import NamedTuple

from tests.formats_oracle import asc_dates
from tests.formats_oracle.written import Counts, Written, WrittenFrame

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
ZONES = ("UTC", "Asia/Shanghai", "Europe/Berlin", "America/New_York")
_EDL, _BRS, _ESI, _RTR = 0x1000, 0x2000, 0x4000, 0x10
_NAMES = ("", "", "Brake_X", "EngineData", "Msg_Rx", "é1")


class Form(NamedTuple):
    """How a log is written: what its header says, and what its program does besides."""

    base: int  # of classic lines
    fd_base: int  # of CAN FD lines
    error_base: int  # of error frames' fields
    relative: bool
    digits: int  # of a time's fraction
    comma: bool  # decimal comma
    padded: bool  # decimal numbers stand in columns
    blank: str  # between words


class _Log:
    """One log of a file, line by line."""

    def __init__(self, rng: random.Random, form: Form, canid: bool):
        self.rng, self.form, self.canid = rng, form, canid
        self.lines: list[bytes] = []
        self.frames: list[WrittenFrame] = []  # times since this log's zero
        self.events = self.others = 0
        self.now = self.before = 0  # ns: of this line, and of the one before

    def stamp(self) -> str:
        """The time of the next line."""
        unit = 10 ** (9 - self.form.digits)
        self.now += self.rng.choice((0, 1, 7, 100, 10_000, 1_000_000)) * unit
        shown = self.now - self.before if self.form.relative else self.now
        self.before = self.now
        text = f"{shown // 10**9}.{shown % 10**9 // unit:0{self.form.digits}}"
        return text.replace(".", ",") if self.form.comma else text

    def add(self, words: str, frame: WrittenFrame | None = None) -> None:
        """A line with a time; of no interest where it is no frame."""
        line = f"{self.rng.choice(('', '   '))}{self.stamp()}{self.form.blank}{words}"
        self.lines.append(line.encode("utf-8"))
        if frame is None:
            self.others += 1
        else:
            self.frames.append(frame._replace(ns=self.now))

    def other(self, line: str) -> None:
        """A line without a time."""
        self.lines.append(line.encode("utf-8"))
        self.others += 1


def draw(rng: random.Random) -> Written:
    """A random file: one log or two joined, whole or with damage."""
    zone = rng.choice(ZONES)
    properties: list[str] = []
    at = asc_dates.local(rng)
    logs, starts = [], []
    for number in range(2 if rng.random() < 0.25 else 1):
        at += datetime.timedelta(seconds=number * rng.randrange(60, 3_000))
        log, start, said = _log(rng, at, zone, number)
        logs.append(log)
        starts.append(start)
        properties += said
    if len(logs) > 1:
        properties.append("joined, dates stated" if None not in starts else "joined, a date is not stated")
    frames, lines = list(logs[0].frames), list(logs[0].lines)
    for log in logs[1:]:
        # by the dates, or else from the last time of the log before
        known = starts[0] is not None and starts[1] is not None
        shift = starts[1] - starts[0] if known else logs[0].now
        frames += [frame._replace(ns=frame.ns + shift) for frame in log.frames]
        lines += log.lines
    damaged = 0
    if rng.random() < 0.15:
        properties.append("damaged lines")
        for _ in range(rng.randrange(1, 4)):
            lines.insert(rng.randrange(len(logs[0].lines) // 2, len(lines)), b"\x00\x81 ~~ damage ~~")
            damaged += 1
    end = rng.choice((b"\r\n", b"\n"))
    content = end.join(lines) + end
    if rng.random() < 0.15:
        properties.append("cut")
        content += b"   99.000000 1  123             Rx   d 8 11"
        damaged += 1
    if rng.random() < 0.1:
        properties.append("byte order mark")
        content = b"\xef\xbb\xbf" + content
    suffix = ".asc"
    if rng.random() < 0.1:
        properties.append("gzipped")
        suffix, content = ".asc.gz", gzip.compress(content)
    counts = Counts(sum(log.events for log in logs), sum(log.others for log in logs), damaged)
    first = frames[0].ns
    start = None if starts[0] is None else starts[0] + first
    frames = [frame._replace(ns=frame.ns - first) for frame in frames]
    return Written(content, suffix, tuple(frames), counts, tuple(properties), start, zone)


def _log(
    rng: random.Random, at: datetime.datetime, zone: str, number: int
) -> tuple[_Log, int | None, list[str]]:
    """A log of one program: its lines and frames, epoch ns of its zero, and how it is written."""
    base = rng.choice((16, 10))
    form = Form(
        base,
        fd_base=rng.choice((16, 16, 10)) if base == 10 else 16,
        error_base=rng.choice((base, 16)),
        relative=rng.random() < 0.3,
        digits=rng.choice((6, 6, 4, 5, 9)),
        comma=rng.random() < 0.1,
        padded=rng.random() < 0.5,
        blank=rng.choice((" ", " ", "\t", "   ")),
    )
    log = _Log(rng, form, canid=False)
    date = asc_dates.draw(rng, at, zone)
    log.lines.append(b"date " + date.text)
    log.others += 1
    words = _base_line(rng, log, form)
    start = date.ns
    if rng.random() < 0.5:
        log.other(rng.choice(("// version 11.0.0", "// Measurement UUID: 1f3c", "; a remark")))
    if rng.random() < 0.5:
        log.lines.append(b"Begin Triggerblock " + date.text)
        log.others += 1
    if rng.random() < 0.5:
        log.add(rng.choice(("Start of measurement", "CANFD   Start of measurement")))
    if form.fd_base == 10:
        # one digit shows that bytes are decimal
        log.add(*_fd(rng, form, b"\x05\x00"))
    log.add(*_classic(rng, form))
    for _ in range(rng.randrange(1, 40)):
        make = rng.choice(_FRAMES)
        if rng.random() < 0.25:
            _other(rng, log)
        log.add(*make(rng, form))
    if rng.random() < 0.5:
        log.other("End TriggerBlock")
    said = [date.style, f"base {'hex' if base == 16 else 'dec'}", words]
    if base == 10:
        said.append("base dec, FD lines hexadecimal" if form.fd_base == 16 else "base dec, FD lines decimal")
    said += ["relative times"] * form.relative + ["decimal comma"] * form.comma
    return log, start, said


def _base_line(rng: random.Random, log: _Log, form: Form) -> str:
    """The base line, in usual and unusual words; returns which."""
    base = rng.choice(("hex", "hex", "HEX", "Hex") if form.base == 16 else ("dec", "dec", "DEC", "Dec"))
    times = "relative" if form.relative else "absolute"
    events = rng.choice(("internal events logged", "no internal events logged"))
    how = rng.randrange(7)
    if how == 0:
        log.other(f"base {base}  timestamps {times}")
        log.other(events)
        return "base line: usual"
    if how == 1 and not form.relative:
        log.other(f"base {base}")
        return "base line: base alone"
    if how == 2 and not form.relative:
        log.other(f"base {base}  {events}")
        return "base line: events in the same line"
    if how == 3:
        log.other(f"  base = {base}, timestamps = {times}")
        return "base line: with ="
    if how == 4:
        log.other(f"timestamps {times} base {base}\t{events}")
        return "base line: another order"
    if how == 5:
        log.other(f"BASE\t{base}    TIMESTAMPS\t\t{times.upper()}  {events.upper()}")
        return "base line: tabs and capitals"
    log.other(f"base {base} timestamps {times} {events}")
    return "base line: events in the same line"


_Made = tuple[str, WrittenFrame]


def _id(rng: random.Random, base: int) -> tuple[int, bool, str]:
    extended = rng.random() < 0.4
    number = rng.choice((rng.randrange(0x800), 0x102, rng.randrange(1 << 29) if extended else 0x7FF))
    return number, extended, (f"{number:x}" if base == 16 else f"{number}") + "x" * extended


def _bytes(rng: random.Random, n: int) -> bytes:
    kind = rng.randrange(3)
    if kind == 0:
        return bytes(rng.choice((0x10, 0x20, 0x35, 0x99)) for _ in range(n))  # digits in both bases
    return rng.randbytes(n) if kind == 1 else bytes(n)


def _shown(form: Form, base: int, data: bytes) -> str:
    if base == 16:
        return form.blank.join(f"{octet:02x}" for octet in data)
    return form.blank.join(f"{octet:>3}" if form.padded else f"{octet}" for octet in data)


def _classic(rng: random.Random, form: Form) -> _Made:
    number, extended, name = _id(rng, form.base)
    bus, sent = rng.randrange(4), rng.random() < 0.3
    data = _bytes(rng, rng.randrange(9))
    dlc = len(data) if len(data) < 8 or rng.random() < 0.8 else rng.randrange(9, 16)
    shown = f"{dlc:x}" if form.base == 16 else f"{dlc}"
    words = [f"{bus + 1}", f"{name:<15}", "Tx" if sent else "Rx", "d", shown]
    words += [_shown(form, form.base, data)] if data else []
    if rng.random() < 0.3:
        words.append(f" Length = 225972 BitCount = 117 ID = {number}{'x' * extended}")
    return form.blank.join(words), WrittenFrame(0, bus, number, extended, data, sent=sent)


def _remote(rng: random.Random, form: Form) -> _Made:
    number, extended, name = _id(rng, form.base)
    bus, sent, dlc = rng.randrange(4), rng.random() < 0.3, rng.choice((*range(9), 12, 15))
    asked = min(8, dlc)
    words = [f"{bus + 1}", f"{name:<15}", "Tx" if sent else "Rx", "r"]
    if rng.random() < 0.8:
        words.append(f"{dlc:x}" if form.base == 16 else f"{dlc}")
        words += [f"Length = 0 BitCount = 64 ID = {number}{'x' * extended}"] * (rng.random() < 0.3)
    else:
        asked = 0
    marks = frozenset({"remote"})
    return form.blank.join(words), WrittenFrame(0, bus, number, extended, b"", marks, sent, asked)


def _fd_line(rng: random.Random, form: Form, frame: WrittenFrame, flags: int, dlc: int, length: int) -> str:
    base = form.fd_base
    name = (f"{frame.id:x}" if base == 16 else f"{frame.id}") + "x" * frame.extended
    brs, esi = int("brs" in frame.marks), int("esi" in frame.marks)
    symbol = rng.choice(_NAMES)
    words = [
        "CANFD",
        f"{frame.bus + 1:>3}",
        "Tx" if frame.sent else "Rx",
        f"{name:>8}",
        f"{symbol:<32}",
        f"{brs} {esi}",
    ]
    words += [f"{dlc:x}" if base == 16 else f"{dlc}", f"{length:>2}"]
    words += [_shown(form, base, frame.data)] if frame.data else []
    if flags:
        shown = f"{flags:x}" if base == 16 or rng.random() < 0.5 else f"{flags}"
        words.append(f"{rng.choice((0, 148531)):>8} {rng.choice((0, 160)):>4} {shown:>8}")
        words.append(" ".join(f"{rng.randrange(1 << 32):x}" for _ in range(rng.choice((1, 5)))))
    return form.blank.join(word for word in words if word.strip())


def _fd(rng: random.Random, form: Form, data: bytes | None = None) -> _Made:
    number, extended, _ = _id(rng, form.fd_base)
    data = _bytes(rng, rng.choice(FD_LENGTHS)) if data is None else data
    brs, esi = rng.random() < 0.5, rng.random() < 0.2
    marks = frozenset({"fd", *(["brs"] * brs), *(["esi"] * esi)})
    frame = WrittenFrame(0, rng.randrange(4), number, extended, data, marks, rng.random() < 0.3)
    flags = (_EDL | _BRS * brs | _ESI * esi | rng.choice((0, 0x300000))) if rng.random() < 0.9 else 0
    dlc = FD_LENGTHS.index(len(data))
    return _fd_line(rng, form, frame, flags, dlc, len(data)), frame


def _classic_on_fd(rng: random.Random, form: Form) -> _Made:
    """A classic frame on a CAN FD channel: flags without EDL."""
    number, extended, _ = _id(rng, form.fd_base)
    data = _bytes(rng, rng.randrange(1, 9))
    frame = WrittenFrame(0, rng.randrange(4), number, extended, data, sent=rng.random() < 0.3)
    return _fd_line(rng, form, frame, 0x300000, len(data), len(data)), frame


def _remote_on_fd(rng: random.Random, form: Form) -> _Made:
    number, extended, _ = _id(rng, form.fd_base)
    asked = rng.randrange(1, 9)
    frame = WrittenFrame(0, rng.randrange(4), number, extended, b"", frozenset({"remote"}), asked=asked)
    return _fd_line(rng, form, frame, 0x300000 | _RTR, asked, 0), frame


def _old_fd(rng: random.Random, form: Form) -> _Made:
    """The form up to version 8.0 of Vector's tools."""
    number, extended, name = _id(rng, form.fd_base)
    data = _bytes(rng, rng.choice(FD_LENGTHS))
    brs, esi = rng.random() < 0.5, rng.random() < 0.2
    marks = frozenset({"fd", *(["brs"] * brs), *(["esi"] * esi)})
    bus, sent, dlc = rng.randrange(4), rng.random() < 0.3, FD_LENGTHS.index(len(data))
    shown = f"{dlc:x}" if form.fd_base == 16 else f"{dlc}"
    words = [
        "CANFD",
        f"{bus + 1}",
        name,
        "Tx" if sent else "Rx",
        f"{int(brs)} {int(esi)}",
        "d",
        shown,
        f"{len(data)}",
    ]
    words += [_shown(form, form.fd_base, data)] if data else []
    return form.blank.join(words), WrittenFrame(0, bus, number, extended, data, marks, sent)


def _error(rng: random.Random, form: Form) -> _Made:
    bus, base = rng.randrange(4), form.error_base
    marks = frozenset({"error"})
    how = rng.randrange(3)
    if how == 0:
        tail = rng.choice(("", "ECC: 10100010"))
        return f"{bus + 1}{form.blank}ErrorFrame{form.blank}{tail}", WrittenFrame(
            0, bus, 0, False, b"", marks
        )
    number, extended, name = _id(rng, base)
    codes = {"Flags": 0xFFFE, "CodeExt": 0x2072, "Code": 0x81}
    fields = [f"{key} = {value:#x}" if base == 16 else f"{key} = {value}" for key, value in codes.items()]
    fields = rng.sample(fields, rng.randrange(1, 4))
    fields += [f"ID = {name}", f"DLC = {rng.randrange(9)}"]
    fields += rng.sample(["Position = 106", "Length = 230125"], rng.randrange(3))
    data = b""
    if how == 2:
        data = rng.randbytes(rng.randrange(1, 9))
        fields.append("Data = " + _shown(form, base, data))
    words = rng.choice(("\t", " ", "  ")).join(["ErrorFrame", *fields])
    return f"{bus + 1}{form.blank}{words}", WrittenFrame(0, bus, number, extended, data, marks)


def _fd_error(rng: random.Random, form: Form) -> _Made:
    bus, sent = rng.randrange(4), rng.random() < 0.3
    tail = "fffe 82     20aa Data 104       f6  1 0 9 12 19 85 fd df ff f2 5e ff 03 00 00 00    81328       1b 98000000"
    text = rng.choice(("", f"Stuff Error {tail}", f"Bit Error {tail}"))
    words = f"CANFD   {bus + 1} {'Tx' if sent else 'Rx'}   ErrorFrame {text}"
    return words, WrittenFrame(0, bus, 0, False, b"", frozenset({"error"}), sent)


_FRAMES: tuple[Callable[[random.Random, Form], _Made], ...] = (
    _classic, _classic, _classic, _remote, _fd, _fd, _classic_on_fd, _remote_on_fd, _old_fd, _error, _fd_error,
)  # fmt: skip
_TIMED = (
    "1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.00%",
    "CAN 1 Status:chip status error active",
    "1  123             TxRq d 2 01 02",
    "CANFD   1 TxRq      200     0 0 8  8 00 00 00 00 00 00 00 00        0    0     1000        0",
    "log trigger event Info: 5",
    "Li 33 Rx 2 11 22 checksum = 66 header time = 40, full time = 80",
    "SV: 2 0 1 ::Namespace::Variable = 3",
    "1  J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F",
    "1 OverloadFrame",
)


def _other(rng: random.Random, log: _Log) -> None:
    if rng.random() < 0.1:
        log.other("// a remark")
        return
    if rng.random() < 0.05:
        octets = "ab" * rng.randrange(4_000, 9_000)
        log.add(f"ETH 1 Rx {len(octets) // 2:x}:{octets}")
        return
    log.add(rng.choice(_TIMED))
