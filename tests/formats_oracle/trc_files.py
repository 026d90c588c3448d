"""Random .trc files, written from docs/formats/trc.md alone."""

from __future__ import annotations

import datetime
import gzip
import random
from decimal import Decimal

from tests.formats_oracle import asc_dates
from tests.formats_oracle.asc_files import FD_LENGTHS, ZONES
from tests.formats_oracle.written import Counts, Written, WrittenFrame

_VERSIONS = ("", "1.0", "1.1", "1.2", "1.3", "2.0", "2.1")
_DAY_0 = datetime.datetime(1899, 12, 30)
_FD_TYPES = {"FD": (), "FB": ("brs",), "FE": ("esi",), "BI": ("brs", "esi")}
# orders of columns, and what stands for a DLC (L) or a length (l)
_COLUMNS = {
    "2.0": ("N,O,T,I,d,l,D", "O,T,I,d,l,D", "N,O,T,I,d,L,D", "N,O,T,B,I,d,l,D"),
    "2.1": ("N,O,T,B,I,d,R,L,D", "N,O,T,B,I,d,R,l,D", "O,T,B,I,d,L,D", "N,O,T,I,d,R,L,D"),
}


class _Log:
    """One log of a file."""

    def __init__(self, rng: random.Random, version: str):
        self.rng, self.version = rng, version
        self.lines: list[str] = []
        self.frames: list[WrittenFrame] = []  # times since its zero
        self.others = 0
        self.now = 0  # ns
        self.columns = ""
        # the versions' resolutions: ms; tenths; microseconds; PCAN-View writes more than it has
        self.digits = {"": 0, "1.0": 0, "1.1": 1, "1.2": 1, "1.3": 1}.get(version, rng.choice((3, 6)))
        self.digits = rng.choice((self.digits, 3))
        self.comma = rng.random() < 0.1
        self.id_digits = rng.choice((4, 4, 1, 3)) if version >= "2" else 4

    def other(self, line: str) -> None:
        """A line of no interest."""
        self.lines.append(line)
        self.others += 1

    def time(self) -> str:
        """The next time, ms."""
        unit = 10 ** (6 - self.digits)
        self.now += self.rng.choice((0, 1, 7, 100, 5_000)) * unit
        text = f"{self.now // 10**6}"
        text += f".{self.now % 10**6 // unit:0{self.digits}}" if self.digits else ""
        return text.replace(".", ",") if self.comma else text

    def id(self) -> tuple[int, bool, str]:
        """An id: at most four digits have 11 bits, eight have 29."""
        extended = self.rng.random() < 0.4
        number = self.rng.choice(
            (self.rng.randrange(0x800), self.rng.randrange(1 << 29) if extended else 0x12)
        )
        return number, extended, f"{number:08X}" if extended else f"{number:0{self.id_digits}X}"


def draw(rng: random.Random) -> Written:
    """A random file: one log or two joined, whole or with damage."""
    zone = rng.choice(ZONES)
    at = asc_dates.local(rng)
    logs, starts, properties = [], [], []
    for number in range(2 if rng.random() < 0.25 else 1):
        at += datetime.timedelta(seconds=number * rng.randrange(60, 3_000))
        version = rng.choice(_VERSIONS)
        log, start, said = _log(rng, at, zone, version)
        logs.append(log)
        starts.append(start)
        properties += said
    frames, lines = list(logs[0].frames), list(logs[0].lines)
    if len(logs) > 1:
        known = None not in starts
        properties.append("joined, dates stated" if known else "joined, a date is not stated")
        shift = (starts[1] or 0) - (starts[0] or 0) if known else logs[0].now
        frames += [frame._replace(ns=frame.ns + shift) for frame in logs[1].frames]
        lines += logs[1].lines
    damaged = 0
    if rng.random() < 0.15:
        properties.append("damaged lines")
        damaged = rng.randrange(1, 4)
        for _ in range(damaged):
            lines.insert(rng.randrange(len(logs[0].lines) // 2, len(lines)), "~~ damage ~~")
    end = rng.choice(("\r\n", "\n"))
    content = (end.join(lines) + end).encode(rng.choice(("utf-8", "cp1252")))
    suffix = ".trc"
    if rng.random() < 0.1:
        properties.append("gzipped")
        suffix, content = ".trc.gz", gzip.compress(content)
    first = frames[0].ns
    start = None if starts[0] is None else starts[0] + first
    frames = [frame._replace(ns=frame.ns - first) for frame in frames]
    counts = Counts(0, sum(log.others for log in logs), damaged)
    return Written(content, suffix, tuple(frames), counts, tuple(properties), start, zone)


def _log(
    rng: random.Random, at: datetime.datetime, zone: str, version: str
) -> tuple[_Log, int | None, list[str]]:
    log = _Log(rng, version)
    said = [f"version {version or 'not stated'}", f"ids of {log.id_digits} digits"] + [
        "decimal comma"
    ] * log.comma
    start = None
    if version:
        log.other(f";$FILEVERSION={version}")
        how = rng.randrange(5)
        if how == 0:
            log.other(";$STARTTIME=0")
            said.append("start: day 0")
        elif how > 1:
            # a point in local time: days since 30 December 1899
            since = at - _DAY_0
            micros = since // datetime.timedelta(microseconds=1)
            days = Decimal(micros) / Decimal(86_400_000_000)
            text = f"{days:.14f}"
            log.other(";$STARTTIME=" + (text.replace(".", ",") if log.comma else text))
            start = asc_dates.epoch_ns(at, zone)
            said.append("start stated")
    if rng.random() < (0.1 if start else 0.4):
        # the start in words, which is all that version 1.0 has
        style = rng.choice(("%d.%m.%Y %H:%M:%S.{}", "%d.%m.%Y %H:%M:%S.{}.0", "%Y-%m-%d %H:%M:%S.{}.0"))
        log.other(f";   Start time: {at.strftime(style).format(f'{at.microsecond // 1000:03}')}")
        start = asc_dates.epoch_ns(at, zone)
        said.append("start in words")
    if version >= "2":
        choices = _COLUMNS[version]
        log.columns = choices[0]
        if rng.random() < 0.8:
            log.columns = rng.choice(choices)
            log.other(f";$COLUMNS={log.columns}")
    log.other(";")
    log.other(";   C:\\trace Größe.trc")
    log.other(";---+-- ----+----  --+--  ----+---  +  -+ -- --")
    for number in range(rng.randrange(2, 40)):
        if number and rng.random() < 0.2:
            _other(rng, log, number)
        if version >= "2":
            _second(rng, log, number)
        else:
            _first(rng, log, number)
    return log, start, said


def _first(rng: random.Random, log: _Log, number: int) -> None:
    """A frame of versions 1.0 to 1.3."""
    time = log.time()
    id_, extended, name = log.id()
    bus = rng.randrange(4) if log.version in ("1.2", "1.3") else 0
    way = rng.choice(("Rx", "Tx")) if log.version > "1.0" else ""
    remote = rng.random() < 0.15
    data = b"" if remote else rng.randbytes(rng.randrange(9))
    asked = rng.randrange(9) if remote else -1
    words = [f"{number + 1:>6})", f"{time:>11}"]
    words += [f"{bus + 1}"] if log.version in ("1.2", "1.3") else []
    words += [way] * bool(way) + [f"{name:>8}"] + ["-"] * (log.version == "1.3")
    words += [f"{asked if remote else len(data)}", "RTR" if remote else data.hex(" ").upper()]
    log.lines.append("  ".join(words))
    marks = frozenset({"remote"} if remote else ())
    log.frames.append(WrittenFrame(log.now, bus, id_, extended, data, marks, way == "Tx", asked))


def _second(rng: random.Random, log: _Log, number: int) -> None:
    """A frame of versions 2.0 and 2.1."""
    time = log.time()
    id_, extended, name = log.id()
    columns = log.columns.split(",")
    bus = rng.randrange(4) if "B" in columns else 0
    way = rng.choice(("Rx", "Tx"))
    kind = rng.choice(("DT", "DT", "RR", *_FD_TYPES))
    fd = kind in _FD_TYPES
    length = rng.choice(FD_LENGTHS) if fd else rng.randrange(9)
    data = b"" if kind == "RR" else rng.randbytes(length)
    cells = {
        "N": f"{number + 1:>7}", "O": f"{time:>13}", "T": kind, "B": f"{bus + 1}", "I": f"{name:>8}", "d": way, "R": "-",
        "L": f"{FD_LENGTHS.index(length):<4}", "l": f"{length:<4}", "D": data.hex(" ").upper(),
    }  # fmt: skip
    log.lines.append(" ".join(cells[column] for column in columns))
    marks = {"remote"} if kind == "RR" else {"fd", *_FD_TYPES[kind]} if fd else set()
    asked = length if kind == "RR" else -1
    log.frames.append(WrittenFrame(log.now, bus, id_, extended, data, frozenset(marks), way == "Tx", asked))


def _other(rng: random.Random, log: _Log, number: int) -> None:
    """A record that holds no frame, or a comment."""
    if rng.random() < 0.3:
        log.other("; a remark")
        return
    time = log.time()
    if log.version in ("", "1.0"):
        log.other(rng.choice((f"{number + 1:>6}) {time:>11}  FFFFFFFF  4  00 00 00 04  ------BUSLIGHT",
                              f"{number + 1:>6}) {time:>11}  0008  4  ERROR  00 19 08 08")))  # fmt: skip
        return
    if log.version < "2":
        bus = "  1" if log.version in ("1.2", "1.3") else ""
        reserved = "  -" if log.version == "1.3" else ""
        log.other(f"{number + 1:>6}) {time:>11}{bus}  Warng  FFFFFFFF{reserved}  4  00 00 00 08  BUSHEAVY")
        return
    columns = log.columns.split(",")
    kind = rng.choice(("ST", "EC", "ER"))
    data = {"ST": "00 00 00 08", "EC": "02 02", "ER": "04 00 02 00 00"}[kind]
    cells = {"N": f"{number + 1:>7}", "O": f"{time:>13}", "T": kind, "B": "1", "I": "       -", "d": "Rx", "R": "-",
             "L": f"{len(data.split())}", "l": f"{len(data.split())}", "D": data}  # fmt: skip
    log.other(" ".join(cells[column] for column in columns))
