"""The text formats: .asc, candump .log, .csv, .trc, gzipped ones, and .mf4."""

from __future__ import annotations

import gzip
import math
import random
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from canid.io.buses import messages, python_can
from canid.io.logs import open_log, write_log
from canid.io.logs.log import Log
from canid.values.errors import LogError
from canid.values.types import Flag, Frame
from tests.logs.samples import FRAMES, write_with_python_can

START = 1_600_000_000.25


def micro(frames: list[Frame]) -> list[Frame]:
    """The same frames, times rounded to whole µs."""
    return [frame._replace(t=round(frame.t * 1e6) / 1e6) for frame in frames]


def read(path: Path, text: str | bytes) -> Log:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return open_log(path)


@pytest.mark.parametrize("suffix", [".asc", ".log"])
def test_what_is_written_comes_back(suffix: str, tmp_path: Path) -> None:
    """Every kind of frame survives, with its bus, and the start in UTC whatever the time zone."""
    path = tmp_path / f"x{suffix}"
    write_log(path, FRAMES, START)
    log = open_log(path)
    assert micro(list(log)) == FRAMES
    assert log.damage is None
    assert log.start_utc == START
    assert log.progress == 1.0


@pytest.mark.parametrize(("suffix", "reader"), [(".asc", "ASCReader"), (".log", "CanutilsLogReader")])
def test_python_can_reads_what_is_written(suffix: str, reader: str, tmp_path: Path) -> None:
    """python-can finds the same data frames in our .asc and .log."""
    path = tmp_path / f"x{suffix}"
    frames = [frame for frame in FRAMES if not frame.flags & (Flag.REMOTE | Flag.ERROR) and frame.data]
    write_log(path, frames, START)
    with getattr(python_can.load(), reader)(str(path)) as theirs:
        got = [(m.arbitration_id, bytes(m.data), messages.flags_of(m)) for m in theirs]
    assert got == [(frame.id, frame.data, frame.flags) for frame in frames]


@pytest.mark.parametrize("suffix", [".asc", ".log", ".csv", ".trc"])
def test_python_cans_files_are_read(suffix: str, tmp_path: Path) -> None:
    """What python-can writes is read: ids, data, times to the format's resolution, start."""
    path = tmp_path / f"x{suffix}"
    frames = [frame for frame in FRAMES if not frame.flags & (Flag.REMOTE | Flag.ERROR | Flag.FD)]
    write_with_python_can(path, frames, START)
    log = open_log(path)
    got = list(log)
    assert log.damage is None
    assert [(f.id, f.data, f.flags & Flag.EXTENDED) for f in got] == [
        (f.id, f.data, f.flags & Flag.EXTENDED) for f in frames
    ]
    assert all(abs(mine.t - frame.t) < 1e-3 for mine, frame in zip(got, frames, strict=True))
    assert abs(log.start_utc - START) < 2e-3
    if suffix != ".csv":  # which has no channel
        first = frames[0].bus if suffix != ".trc" else got[0].bus
        assert [f.bus - got[0].bus for f in got] == [f.bus - first for f in frames] or suffix == ".trc"


ASC = """date Sam Mär 03 10:20:30.500 2018
base {base}  timestamps {times}
internal events logged
// version 8.0.0
Begin Triggerblock Sam Mär 03 10:20:30.500 2018
   0.000000 Start of measurement
   0.015991 CAN 1 Status:chip status error active
   0.100000 1  144             Rx   d 3 {a}  Length = 240000 BitCount = 124 ID = 324
   0.200000 2  18FEF100x       Tx   d 1 {b}
   1.000000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   1.100000 1  J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F A6 60 3B D1
   1.200000 1  ErrorFrame ECC: 10100010
   1.300000 1  7FF             TxRq d 1 {b}
   1.400000 1  7F              Rx   r 4
   1.500000 CANFD   1 Rx        300  EngineData          1 0 9 12 {fd} 102203 133 303000 e0006659
End TriggerBlock
"""


def asc(base: str = "hex", times: str = "absolute") -> str:
    if base == "hex":
        return ASC.format(
            base=base, times=times, a="01 FF 0a", b="0c", fd="01 02 03 04 05 06 07 08 09 0a 0b 0c"
        )
    text = ASC.format(base=base, times=times, a="1 255 10", b="12", fd="1 2 3 4 5 6 7 8 9 10 11 12")
    return (
        text.replace(" 144 ", " 324 ")
        .replace("18FEF100x", "419361024x")
        .replace(" 300 ", " 768 ")
        .replace("7F  ", "127 ")
    )


@pytest.mark.parametrize("base", ["hex", "dec"])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_vectors_asc_is_read(base: str, encoding: str, tmp_path: Path) -> None:
    """Hex and dec, events between frames, transmit requests, a German date: the five frames, right ones."""
    log = read(tmp_path / "x.asc", asc(base).encode(encoding))
    fd = int(Flag.FD | Flag.BRS)
    assert [frame._replace(t=round(frame.t, 9)) for frame in log] == [
        Frame(0.0, 0, 0x144, b"\x01\xff\x0a"),
        Frame(0.1, 1, 0x18FEF100, b"\x0c", int(Flag.EXTENDED | Flag.TX)),
        Frame(1.1, 0, 0, b"", int(Flag.ERROR)),
        Frame(1.3, 0, 0x7F, b"", int(Flag.REMOTE), 4),
        Frame(1.4, 0, 0x300, bytes(range(1, 13)), fd),
    ]
    assert log.damage is None
    local = time.mktime((2018, 3, 3, 10, 20, 30, 0, 0, -1)) + 0.6
    assert abs(log.start_utc - local) < 1e-6


def test_relative_times_are_summed(tmp_path: Path) -> None:
    """`timestamps relative`: each time counts from the line before, also from one without a frame."""
    text = (
        "base hex  timestamps relative\n 0.5 Start of measurement\n 0.5 1 1 Rx d 0\n 0.25 1 2 Rx d 0\n"
        " 1.0 log event\n 1.0 1 3 Rx d 0\n"
    )
    assert [frame.t for frame in read(tmp_path / "x.asc", text)] == [0.0, 0.25, 2.25]


def test_decimal_commas_and_unknown_dates_are_no_obstacle(tmp_path: Path) -> None:
    """A comma in the times is read; a date in an unknown language leaves only the start unknown."""
    text = (
        "date szombat 3 2018 marcius\nbase hex timestamps absolute\n 0,5 1 1 Rx d 1 AA\n 0,75 1 2 Rx d 1 BB\n"
    )
    log = read(tmp_path / "x.asc", text)
    assert [(frame.t, frame.data) for frame in log] == [(0.0, b"\xaa"), (0.25, b"\xbb")]
    assert math.isnan(log.start_utc)
    assert log.damage is None


CANDUMP = """(1436509052.249713) vcan1 044#2A366C2BBA
(1436509052.449847) vcan0 0F6#7ADFE07BD2
(1436509052.650004) vcan1 18FEF100#C3406B09F4C88036 R
(1436509052.850008) vcan1 0F1#R
(1436509053.050008) vcan1 0F1#R5 T
(1436509053.250000) vcan1 20000088#0000080000000000
(1436509053.350000) vcan0 123##5AABBCC
(1436509053.450000) vcan0 123#0102030405060708_B
"""


def test_candump_logs_are_read(tmp_path: Path) -> None:
    """Interfaces become buses by their names; remote, error, FD and raw-DLC frames are understood."""
    log = read(tmp_path / "x.log", CANDUMP)
    frames = list(log)
    assert [(f.bus, f.id, f.flags, f.length) for f in frames] == [
        (1, 0x44, 0, -1),
        (0, 0xF6, 0, -1),
        (1, 0x18FEF100, int(Flag.EXTENDED), -1),
        (1, 0xF1, int(Flag.REMOTE), 0),
        (1, 0xF1, int(Flag.REMOTE | Flag.TX), 5),
        (1, 0x88, int(Flag.ERROR), -1),
        (0, 0x123, int(Flag.FD | Flag.BRS), -1),
        (0, 0x123, 0, -1),
    ]
    assert frames[1].t == 200134000 * 1e-9
    assert log.start_utc == 1436509052.249713
    assert log.damage is None


@pytest.mark.slow("many logs, written and read")
@pytest.mark.parametrize("suffix", [".asc", ".log", ".csv"])
def test_a_cut_file_yields_no_wrong_frame(suffix: str, tmp_path: Path) -> None:
    """Cut at any byte, every frame that comes out is an original one, and one cut in two is reported."""
    path = tmp_path / f"x{suffix}"
    if suffix == ".csv":
        write_with_python_can(path, (frame._replace(bus=0) for frame in FRAMES), START)
    else:
        write_log(path, FRAMES, START)
    whole = path.read_bytes()
    expected = list(open_log(path))
    complete = 0  # frames in whole lines so far
    for size in range(1, len(whole)):
        try:
            log = read(path, whole[:size])
            got = list(log)
        except LogError:
            assert not complete
            continue
        assert got == expected[: len(got)], size
        if whole[:size].endswith(b"\n"):
            complete = len(got)
        assert complete <= len(got) <= complete + 1
        # from the first frame on every line is one (but for the last of an .asc, of two words)
        begun = whole[:size].rpartition(b"\n")[2].replace(b",", b" ").split()
        if complete and len(got) == complete and len(begun) > 2:
            assert log.damage is not None, size


def test_damaged_ids_are_no_names(tmp_path: Path, seed: int) -> None:
    """A short .asc of which a third of the ids has letters in its middle: the rest is read."""
    rng = random.Random(seed)
    ids = [f"{rng.randrange(0x100, 0x7FF):X}" for _ in range(30)]
    hit = rng.sample(range(30), 10)
    for k in hit:
        ids[k] = f"{rng.randrange(1, 9)}" + "".join(rng.choice("ghijkxyz") for _ in range(5)) + ids[k][1:]
    lines = [f"   {0.01 * k:.6f} 1  {each}  Rx   d 1 00" for k, each in enumerate(ids)]
    path = tmp_path / "x.asc"
    head = "date Tue Jan 6 07:00:00.000 am 2026\nbase hex  timestamps absolute\n"
    path.write_text(head + "\n".join(lines) + "\n")
    log = open_log(path)
    assert len(list(log)) == 20
    assert log.damage is not None


@pytest.mark.long("many or long logs")
@pytest.mark.parametrize("suffix", [".asc", ".log", ".csv", ".trc", ".asc.gz"])
def test_mutants_raise_nothing_but_log_error(suffix: str, tmp_path: Path) -> None:
    """200 mutants per format: no exception but LogError, whatever the bytes."""
    plain = tmp_path / "x.blf"
    write_log(plain, FRAMES * 5, START)
    source = tmp_path / f"y{suffix.removesuffix('.gz')}"
    with python_can.load().Logger(str(source)) as writer:
        for i, frame in enumerate(FRAMES * 5):
            if suffix != ".trc" or not frame.flags & (Flag.REMOTE | Flag.ERROR | Flag.FD):
                writer.on_message_received(messages.message_of(frame._replace(t=i * 0.01), START))
    # python-can writes the present date, from which other mutants would come each time
    data = re.sub(rb"^date .*", b"date Tue Jan 06 07:00:00.000 2026", source.read_bytes())
    if suffix.endswith(".gz"):
        data = gzip.compress(data, mtime=0)
    rng = random.Random(3)
    path = tmp_path / f"z{suffix}"
    for _ in range(200):
        mutant = bytearray(data)
        for _ in range(rng.randrange(1, 6)):
            at = rng.randrange(len(mutant))
            mutant[at : at + rng.choice((0, 1, 1, 30))] = rng.choice(
                (b"", b"\0", b"9", b"\xff\n", rng.randbytes(20))
            )
        path.write_bytes(mutant)
        try:
            log = open_log(path)
            for frame in log:
                assert len(frame.data) <= 64
        except LogError as error:
            assert "\n" not in str(error)  # noqa: PT017


def test_bad_lines_are_counted_and_named(tmp_path: Path) -> None:
    """Two bad lines among three good ones: five lines, three read, the first bad one named."""
    lines = CANDUMP.splitlines()
    log = read(
        tmp_path / "x.log", "\n".join([lines[0], "(12) x", lines[1], "(1.0) can0 123#1", lines[2], ""])
    )
    assert len(list(log)) == 3
    assert log.damage is not None
    assert (log.damage.read, log.damage.total) == (3, 5)
    assert log.damage.says.startswith(
        "read 3 of 5 frame lines, bytes 41–47 and 1 more place damaged: line 2: "
    )


@pytest.mark.parametrize("suffix", [".asc", ".log", ".csv", ".trc"])
def test_a_byte_order_mark_is_no_damage(suffix: str, tmp_path: Path) -> None:
    """At the beginning, and where a file was joined to another: no frame is lost by it."""
    plain = tmp_path / f"plain{suffix}"
    write_with_python_can(plain, micro(FRAMES), START)
    data = plain.read_bytes()
    log = read(tmp_path / f"marked{suffix}", b"\xef\xbb\xbf" + data)
    assert ([*log], log.damage) == ([*open_log(plain)], None)
    log = read(tmp_path / f"joined{suffix}", 2 * (b"\xef\xbb\xbf" + data))
    assert (sum(1 for _ in log), log.damage) == (2 * sum(1 for _ in open_log(plain)), None)


@pytest.mark.parametrize("suffix", [".asc", ".log", ".csv", ".trc"])
def test_a_gzipped_log_needs_no_suffix(suffix: str, tmp_path: Path) -> None:
    """As recorders rotate them: the first bytes say it."""
    plain = tmp_path / f"plain{suffix}"
    write_with_python_can(plain, micro(FRAMES), START)
    log = read(tmp_path / f"packed{suffix}", gzip.compress(plain.read_bytes()))
    assert ([*log], log.damage) == ([*open_log(plain)], None)


def test_a_gzip_stream_that_breaks_off_is_reported(tmp_path: Path) -> None:
    """Half a .log.gz gives its whole lines and says that the rest is missing."""
    data = gzip.compress("".join(f"({1533224087 + k}.5) can0 123#{k:08X}\n" for k in range(8000)).encode())
    log = read(tmp_path / "x.log.gz", data)
    assert sum(1 for _ in log) == 8000
    assert log.damage is None
    log = read(tmp_path / "x.log.gz", data[: len(data) // 2])
    assert 0 < sum(1 for _ in log) < 8000
    assert log.damage is not None
    assert "gzip" in log.damage.says


def test_a_trc_goes_on_after_a_bad_line(tmp_path: Path) -> None:
    """A line of a .trc that python-can's reader dies of costs that line."""
    path = tmp_path / "x.trc"
    with python_can.load().TRCWriter(str(path)) as writer:
        for i in range(10):
            writer.on_message_received(messages.message_of(Frame(i * 0.01, 0, i, bytes([i])), START))
    text = path.read_text()
    log = read(path, text.replace(" 0004 ", " 0XY4 "))
    assert [frame.id for frame in log] == [0, 1, 2, 3, 5, 6, 7, 8, 9]
    assert log.damage is not None
    assert (log.damage.read, log.damage.total) == (9, 10)


TRC = """\
;$FILEVERSION=2.1
;$STARTTIME=44548.9121
;$COLUMNS=N,O,T,B,I,d,R,L,D
     1        10.000 DT 1     0704 Rx -  8    00 01 02 03 04 05 06 07
     2        11.000 RR 1     0704 Rx -  4
     3        12.000 DT 1     0705 Rx -  8    08 09 0A 0B 0C 0D 0E 0F"""


def test_the_last_line_of_a_trc_needs_no_line_feed(tmp_path: Path) -> None:
    """PEAK's own tools end a file without one; a line that is really cut yields no frame, and is reported."""
    path = tmp_path / "x.trc"
    whole = list(read(path, TRC))
    assert [(frame.id, frame.length, frame.data[:1]) for frame in whole] == [
        (0x704, -1, b"\0"),
        (0x704, 4, b""),
        (0x705, -1, b"\x08"),
    ]
    lines = TRC.splitlines()
    for n in (4, 5, 6):
        log = read(path, "\n".join(lines[:n]))
        assert list(log) == whole[: n - 3]
        assert log.damage is None
        for cut in range(8, len(lines[n - 1].rstrip())):
            try:
                log = read(path, "\n".join([*lines[: n - 1], lines[n - 1][:cut]]))
                assert list(log) == whole[: n - 4], cut
            except LogError:
                assert n == 4
            else:
                assert log.damage is not None, cut


@pytest.mark.parametrize(
    "bad",
    [
        "     2        11.000 DT 1",
        "     2  11.000 DT 1 0704 Rx - 8 00 01 02",
        "     2  x DT 1 0704 Rx - 1 00",
    ],
)
def test_a_line_of_a_trc_that_python_can_passes_over_is_reported(bad: str, tmp_path: Path) -> None:
    """Its reader drops short lines in silence, and takes what data there are; status lines are no damage."""
    lines = TRC.splitlines()
    log = read(
        tmp_path / "x.trc", "\n".join([*lines[:4], "     2  11.000 ST 1 - Rx - 4 00 00 00 08", bad, lines[5]])
    )
    assert [frame.id for frame in log] == [0x704, 0x705]
    assert log.damage is not None
    assert (log.damage.read, log.damage.total) == (2, 3)
    assert "line 6" in log.damage.says


@pytest.mark.parametrize("suffix", [".asc", ".log", ".csv", ".trc"])
def test_what_is_not_the_format_is_one_line(suffix: str, tmp_path: Path) -> None:
    """Binary nonsense raises LogError when it is read, or yields nothing."""
    path = tmp_path / f"x{suffix}"
    path.write_bytes(random.Random(0).randbytes(100_000))
    try:
        assert list(open_log(path)) == []
    except LogError as error:
        assert str(path) in str(error)  # noqa: PT017


@pytest.mark.slow("many logs, written and read")
def test_mf4_is_read_in_a_child_process(tmp_path: Path) -> None:
    """An .mf4 written with asammdf gives python-can's frames; this process stays free of asammdf."""
    pytest.importorskip("asammdf", reason="asammdf is not installed: pip install canid[mf4]")
    path = tmp_path / "x.mf4"
    script = (
        "import sys, can\n"
        "with can.MF4Writer(sys.argv[1]) as writer:\n"
        "    for i in range(50):\n"
        "        writer.on_message_received(can.Message(timestamp=1.6e9 + i * 0.01, arbitration_id=i,\n"
        "            is_extended_id=False, data=bytes([i]), channel=i % 2))\n"
    )
    subprocess.run([sys.executable, "-W", "ignore", "-c", script, str(path)], check=True, timeout=600)
    log = open_log(path)
    frames = list(log)
    assert [(f.id, f.data, f.bus) for f in frames] == [(i, bytes([i]), i % 2) for i in range(50)]
    assert all(abs(f.t - i * 0.01) < 2e-6 for i, f in enumerate(frames))
    assert log.damage is None
    bad = tmp_path / "bad.mf4"
    bad.write_bytes(b"MDF     4.10    " + bytes(200))
    with pytest.raises(LogError, match=r"bad\.mf4"):
        list(open_log(bad))


@pytest.mark.skipif(shutil.which("asc2log") is None, reason="asc2log (can-utils) is not installed")
def test_asc2log_reads_our_asc(tmp_path: Path) -> None:
    """can-utils' asc2log finds every frame of our .asc, in candump form that we read back."""
    path = tmp_path / "x.asc"
    frames = [frame for frame in FRAMES if not frame.flags & Flag.FD]
    write_log(path, frames, START)
    done = subprocess.run(
        ["asc2log", "-I", str(path)], capture_output=True, text=True, check=True, timeout=600
    )
    log = read(tmp_path / "y.log", done.stdout)
    got = [(f.id, f.data) for f in log if not f.flags & Flag.ERROR]
    assert got == [(f.id, f.data) for f in frames if not f.flags & Flag.ERROR]


@pytest.mark.long("many or long logs")
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_our_blf(tmp_path: Path) -> None:
    """tshark, which shares no code with us, finds every data frame of our .blf with its id and data."""
    path = tmp_path / "x.blf"
    frames = [frame for frame in FRAMES if not frame.flags & (Flag.ERROR | Flag.REMOTE) and frame.data]
    write_log(path, frames, START)
    command = [
        "tshark",
        "-r",
        str(path),
        "-T",
        "fields",
        "-e",
        "frame.time_epoch",
        "-e",
        "can.id",
        "-e",
        "data.data",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=600)
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert [int(row[1], 0) & 0x1FFFFFFF for row in rows] == [frame.id for frame in frames]
    assert [row[2] for row in rows] == [frame.data.hex() for frame in frames]
    assert all(abs(float(row[0]) - START - frame.t) < 1e-6 for row, frame in zip(rows, frames, strict=True))


def test_trc_joined_without_a_version_goes_on_at_its_start(tmp_path: Path) -> None:
    """Version 1.0 has its start in words, or none: its numbers begin again behind the header."""
    header = ";##########\n;   C:\\x.trc\n{};---+--   ----+----\n"
    frames = "     1)      {}  0001  1  00\n     2)      {}  0001  1  01\n"
    starts = [f";   Start time: 13.11.2020 09:3{k}:00.500\n" for k in (1, 3)]
    dated = "".join(header.format(start) + frames.format(10, 30) for start in starts)
    log = read(tmp_path / "dated.trc", dated)
    assert [round(frame.t, 9) for frame in log] == [0.0, 0.02, 120.0, 120.02]
    assert (log.others, log.damaged) == (8, 0)
    assert "at line 7" in log.remarks[0]
    undated = "".join(header.format("") + frames.format(at, at + 20) for at in (10, 500))
    log = read(tmp_path / "undated.trc", undated)
    assert [round(frame.t, 9) for frame in log] == [0.0, 0.02, 0.52, 0.54]
    assert "at the end of the log before" in log.remarks[0]
    # a remark between frames begins none
    remark = header.format("") + frames.format(10, 30) + "; a remark\n     3)      40  0001  1  00\n"
    log = read(tmp_path / "remark.trc", remark)
    assert [round(frame.t, 9) for frame in log] == [0.0, 0.02, 0.03]
    assert not log.remarks


def test_an_id_of_kvaser_that_its_flag_contradicts_is_damage(tmp_path: Path) -> None:
    """An id of 11 bits cannot be 0x800: it is no id of 29 bits either."""
    head = "Time,Channel,ID,Flags,DLC,Data0,Counter,AbsTime\n"
    log = read(tmp_path / "x.csv", head + "0.1,0,291,2,1,5,1,x\n0.2,0,2048,2,1,5,2,x\n0.3,0,2048,4,1,5,3,x\n")
    assert [(frame.id, frame.flags) for frame in log] == [(291, 0), (2048, Flag.EXTENDED)]
    assert log.damaged == 1


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2", "1.3"])
@pytest.mark.parametrize("head", ["", "; cut from a longer trace\n"])
def test_a_trc_without_its_header_has_the_version_of_its_first_record(
    version: str, head: str, tmp_path: Path
) -> None:
    """As the pasted or cut part of a trace."""
    way = {"1.0": "", "1.1": "Tx", "1.2": "2 Tx", "1.3": "2 Tx"}[version]
    between = "-" if version == "1.3" else ""
    rows = [f"{k:6d}) {12.3 * k:11.1f} {way} 00{k}1 {between} 2 0{k} AB\n" for k in range(1, 8)]
    path = tmp_path / "x.trc"
    path.write_text(head + "".join(rows))
    log = open_log(path)
    found = list(log)
    assert [(frame.id, frame.data) for frame in found] == [
        (16 * k + 1, bytes([k, 0xAB])) for k in range(1, 8)
    ]
    assert {frame.bus for frame in found} == {int(version > "1.1")}
    assert {bool(frame.flags & Flag.TX) for frame in found} == {version > "1.0"}
    assert log.damaged == 0
    path.write_text(head + ";$FILEVERSION=1.0\n" + "".join(rows))
    if version > "1.0":
        with pytest.raises(LogError):
            list(open_log(path))
