"""A whole drive in each dialect that is read: the numbers of `identify` and the signals of `export` are those of the .blf.

The writers are from the pages of docs/formats alone, and share no code with canid.
"""

from __future__ import annotations

import base64
import csv
import gzip
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive.drive_parameters import identify
from canid.analysis.drive.drive_reader import read_trace
from canid.io.logs import open_log, write_log
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from canid.values.types import Frame
from tests.logs.samples import write_with_python_can

ROOT = Path(__file__).parents[2]
# s since 1970; a whole minute, at which CanHacker's seconds begin
START = 1_700_000_040
SECONDS = 90.0


class One:
    """A frame in whole milliseconds, which every dialect can hold."""

    def __init__(self, frame: Frame) -> None:
        self.ms = round(frame.t * 1000.0)
        self.id, self.data = frame.id, frame.data
        self.hex = " ".join(f"{octet:02X}" for octet in frame.data)
        self.epoch = f"{START + self.ms // 1000}.{self.ms % 1000:03d}000"
        self.own = f"{self.ms // 1000}.{self.ms % 1000:03d}000"


@cache
def drive() -> tuple[One, ...]:
    """The first 90 s of a shipped drive, from its first frame."""
    frames = [One(frame) for frame in open_log(ROOT / "replay_logs/following_urban.blf") if frame.t < SECONDS]
    assert frames[0].ms == 0
    return tuple(frames)


def lines(*head: str, each: Callable[[One], str], end: str = "\n") -> bytes:
    return end.join([*head, *map(each, drive()), ""]).encode()


def asc(base: str, kind: str = "absolute", form: str = "{t} 1 {id} Rx d {n} {data}") -> bytes:
    number, octet = ("{:X}", "{:02X}") if base == "hex" else ("{}", "{}")
    before = [0, *(one.ms for one in drive())]
    rows = []
    for one, last in zip(drive(), before, strict=False):
        ms = one.ms - (last if kind == "relative" else 0)
        data = " ".join(octet.format(x) for x in one.data)
        t, n = f"{ms // 1000:4d}.{ms % 1000:03d}000", len(one.data)
        rows.append(
            form.format(t=t, id=number.format(one.id), n=n, data=data, hex=one.hex, hexid=f"{one.id:x}")
        )
    head = [
        "date Tue Nov 14 10:14:00.000 pm 2023",
        f"base {base}  timestamps {kind}",
        "internal events logged",
    ]
    return "\r\n".join([*head, *rows, ""]).encode()


def trc(version: str, columns: str, form: str) -> bytes:
    days = 25569 + START / 86400
    head = [
        f";$FILEVERSION={version}",
        f";$STARTTIME={days:.10f}",
        *([f";$COLUMNS={columns}"] if columns else []),
    ]
    tail = "000" if version >= "2" else "0"
    rows = [
        form.format(k=k + 1, t=f"{one.ms}.{tail}", id=one.id, n=len(one.data), data=one.hex)
        for k, one in enumerate(drive())
    ]
    return "\r\n".join([*head, *rows, ""]).encode()


def busmaster(mode: str, base: str) -> bytes:
    # the day's time of START, 22:14:00
    day = (22 * 3600 + 14 * 60) * 1000
    rows, before = [], 0
    for one in drive():
        ms = {"SYSTEM": day + one.ms, "ABSOLUTE": one.ms, "RELATIVE": one.ms - before}[mode]
        before = one.ms
        stamp = f"{ms // 3_600_000:02d}:{ms // 60_000 % 60:02d}:{ms // 1000 % 60:02d}:{ms % 1000:03d}0"
        octets = one.hex if base == "HEX" else " ".join(map(str, one.data))
        id_ = f"0x{one.id:03X}" if base == "HEX" else str(one.id)
        rows.append(f"{stamp} Rx 1 {id_} s {len(one.data)} {octets}")
    head = ["***BUSMASTER Ver 3.2.2***", "***PROTOCOL CAN***", "***[START LOGGING SESSION]***"]
    head += ["***START DATE AND TIME 14:11:2023 22:14:0:000***", f"***{base}***", f"***{mode} MODE***"]
    return "\r\n".join([*head, *rows, "***[STOP LOGGING SESSION]***", ""]).encode()


def screen(option: str) -> bytes:
    rows, before = [], 0
    for one in drive():
        ms = {"a": START * 1000 + one.ms, "z": one.ms, "d": one.ms - before}[option]
        before = one.ms
        rows.append(
            f" ({ms // 1000:03d}.{ms % 1000:03d}000)  can0  {one.id:03X}   [{len(one.data)}]  {one.hex}"
        )
    return "\n".join([*rows, ""]).encode()


def kvaser(decimal: bool) -> bytes:
    head = "Time,Channel,ID,Flags,DLC," + ",".join(f"Data{k}" for k in range(8)) + ",Counter,AbsTime"

    def row(one: One) -> str:
        cells = [str(x) if decimal else f"{x:02X}" for x in one.data] + [""] * (8 - len(one.data))
        id_ = str(one.id) if decimal else f"{one.id:08X}"
        return f"{one.own},0,{id_},2,{len(one.data)},{','.join(cells)},1,2023-11-14 22:14:00"

    return lines('"Kvaser Memorator Log"', "Logging started at: 2023-11-14 22:14:00", head, each=row)


def spy() -> bytes:
    head = "Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,Node,Arb ID,Remote,Xtd,"
    head += "B1,B2,B3,B4,B5,B6,B7,B8,Value,Trigger,Signals"

    def row(one: One) -> str:
        cells = [f"{x:02X}" for x in one.data] + [""] * (8 - len(one.data))
        return f"1,{one.own},0.001,67371008,F,F,HS CAN,HS CAN,,{one.id:X},F,F,{','.join(cells)},,,"

    return lines("Vehicle Spy 3 Bus Traffic File", "Start Date,14/11/2023", head, each=row)


def gvret(stamp: str) -> bytes:
    octets = ",".join(f"D{k + 1}" for k in range(8))
    return lines(
        f"Time Stamp,ID,Extended,Dir,Bus,LEN,{octets}",
        each=lambda one: (
            f"{START * 10**6 + one.ms * 1000 if stamp == 'epoch' else 5_000_000 + one.ms * 1000},"
            f"{one.id:08X},false,Rx,0,{len(one.data)},{''.join(f'{x:02X},' for x in one.data)}"
        ),
    )


def canhacker(sign: str) -> bytes:
    return lines(
        "Time     ID        DLC       Data                    Comment",
        each=lambda one: (
            f"{one.ms // 1000 % 60:02d}{sign}{one.ms % 1000:03d}   {one.id:03X}   {len(one.data)}   {one.hex}"
        ),
    )


def candump() -> bytes:
    return lines(each=lambda one: f"({one.epoch}) can0 {one.id:03X}#{one.data.hex().upper()}")


# name -> suffix, and the file
DIALECTS: dict[str, tuple[str, Callable[[], bytes]]] = {
    "candump": (".log", candump),
    "candump, directions, zipped": (
        ".log.gz",
        lambda: gzip.compress(candump().replace(b"\n", b" R\n")),
    ),
    "candump in UTF-16": (".log", lambda: b"\xff\xfe" + candump().decode().encode("utf-16-le")),
    "screen -t a": (".log", lambda: screen("a")),
    "screen -t z": (".log", lambda: screen("z")),
    "screen -t d": (".log", lambda: screen("d")),
    ".asc hex": (".asc", lambda: asc("hex")),
    ".asc dec": (".asc", lambda: asc("dec")),
    ".asc relative": (".asc", lambda: asc("hex", "relative")),
    ".asc CANFD dec": (
        ".asc",
        lambda: asc("dec", form="{t} CANFD   1 Rx {hexid} 0 0 {n:x} {n:2d} {hex} 0 0 0 0 0 0 0 0"),
    ),
    ".trc 1.1": (".trc", lambda: trc("1.1", "", "{k:>6})  {t:>11}  Rx  {id:04X}  {n}  {data}")),
    ".trc 1.3": (".trc", lambda: trc("1.3", "", "{k:>6})  {t:>11}  1  Rx  {id:04X}  -  {n}  {data}")),
    ".trc 2.0": (".trc", lambda: trc("2.0", "N,O,T,I,d,l,D", "{k:>7} {t:>13} DT {id:04X} Rx {n}  {data}")),
    ".trc 2.1": (
        ".trc",
        lambda: trc("2.1", "N,O,T,B,I,d,R,L,D", "{k:>7} {t:>13} DT 1 {id:04X} Rx - {n}  {data}"),
    ),
    "python-can .csv": (
        ".csv",
        lambda: lines(
            "timestamp,arbitration_id,extended,remote,error,dlc,data",
            each=lambda one: (
                f"{one.epoch},{one.id:#x},0,0,0,{len(one.data)},{base64.b64encode(one.data).decode()}"
            ),
        ),
    ),
    "SavvyCAN, since 1970": (".csv", lambda: gvret("epoch")),
    "SavvyCAN, since its start": (".csv", lambda: gvret("own")),
    "cabana": (
        ".csv",
        lambda: lines("time,addr,bus,data", each=lambda one: f"{one.own},{one.id:#x},0,0x{one.data.hex()}"),
    ),
    "panda": (
        ".csv",
        lambda: lines(
            "Bus,MessageID,Message,MessageLength,Time",
            each=lambda one: f"0,{one.id:#x},0x{one.data.hex()},{len(one.data)},{one.own}",
        ),
    ),
    "Kvaser": (".csv", lambda: kvaser(False)),
    "Kvaser, decimal": (".csv", lambda: kvaser(True)),
    "Vehicle Spy": (".csv", spy),
    "a list": (
        ".csv",
        lambda: lines(
            "Time,ID,DLC,Data", each=lambda one: f"{one.own},{one.id:#x},{len(one.data)},{one.hex}"
        ),
    ),
    **{
        f"BusMaster {mode} {base}": (".log", lambda mode=mode, base=base: busmaster(mode, base))  # type: ignore[misc]
        for mode in ("SYSTEM", "ABSOLUTE", "RELATIVE")
        for base in ("HEX", "DEC")
    },
    "CanHacker": (".trc", lambda: canhacker(",")),
    "CanHacker, point": (".trc", lambda: canhacker(".")),
}


def frames() -> list[Frame]:
    return [Frame(one.ms * 1e-3, 0, one.id, one.data) for one in drive()]


def written(name: str, folder: Path) -> Path:
    """The drive in a dialect."""
    if name in (".mf4", ".blf"):
        path = folder / f"drive{name}"
        if name == ".blf":
            write_log(path, frames(), float(START))
        else:
            pytest.importorskip("asammdf", reason="asammdf is not installed (pip install canid[mf4])")
            write_with_python_can(path, frames(), float(START))
        return path
    suffix, made = DIALECTS[name]
    path = folder / f"drive{suffix}"
    path.write_bytes(made())
    return path


def signals(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """What `canid export --signals` writes of the pedal's message, without the lines on the log's name and start."""
    monkeypatch.chdir(folder)
    words = [
        "--dbc",
        str(ROOT / "dbc/generic.dbc"),
        "--signals",
        "ENGINE_DATA.*",
        "--to",
        "csv",
        "-o",
        "table",
    ]
    assert main(["export", str(path), *words, "--force"]) == 0
    (table,) = folder.glob("table*ENGINE_DATA*.csv")
    return [row for row in csv.reader(table.read_text().splitlines()) if not row[0].startswith("#")]


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, str, list[list[str]]]:
    """Trace, numbers of `identify`, and signals of the .blf."""
    folder = tmp_path_factory.mktemp("blf")
    path = written(".blf", folder)
    with pytest.MonkeyPatch.context() as patch:
        trace = read_trace(path, read_vehicle("generic"))
        return trace, numbers(path), signals(path, folder, patch)


def numbers(path: Path) -> str:
    """What `identify` says of the driver."""
    found = identify(read_trace(path, read_vehicle("generic")), select_orders=False, sliding=False)
    return repr((found.channels, found.duration, found.driver_time))


@pytest.mark.slow("a drive of 90 s, written, identified and exported in each dialect")
@pytest.mark.parametrize("name", [*DIALECTS, ".mf4"])
def test_a_drive_in_any_dialect_is_the_drive(
    name: str,
    tmp_path: Path,
    reference: tuple[object, str, list[list[str]]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Samples bit for bit, the same numbers with their intervals, the same table of signals; and no line is damage."""
    monkeypatch.setenv("CANID_TIME_ZONE", "UTC")
    path = written(name, tmp_path)
    log = open_log(path)
    assert sum(len(chunk.t) for chunk in log.columns()) == len(drive())
    assert log.damage is None
    expected, said, rows = reference
    trace = read_trace(path, read_vehicle("generic"))
    exact = name != ".mf4"
    for field in ("t", "output", "inputs", "learn", "segment"):
        found, given = getattr(trace, field), getattr(expected, field)
        # python-can's writer of .mf4 takes times from the present as doubles: they are 0.2 µs off in the file
        assert np.allclose(found, given, rtol=0.0, atol=0.0 if exact else 1e-3, equal_nan=True), field
    if exact:
        assert numbers(path) == said
        assert signals(path, tmp_path, monkeypatch) == rows
    assert "damage" not in capsys.readouterr().err
