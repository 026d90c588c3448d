"""The columns of a log are its frames: against python-can, against can-utils and asammdf, and against themselves."""

from __future__ import annotations

import gzip
import pickle
import random
import shutil
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.buses import messages, python_can
from canid.errors import LogError
from canid.frame_columns import columns_of, frames_of, gather
from canid.logs import open_log, write_log
from canid.logs import text_lines as lines_module
from canid.logs.asc import asc_fixed_columns
from canid.logs.asc.asc_block import none_found
from canid.logs.blf.blf_layout import DLC_BYTES
from canid.types import Columns, Damage, Flag, Frame
from tests.logs.samples import write_with_python_can

DATA = Path(__file__).parents[2] / "../shared/data"
START = 1_600_000_000.0
SIZES = (0, 1, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def frame(rng: random.Random, k: int, kinds: tuple[str, ...]) -> Frame:
    """Any kind of frame, on any of three buses."""
    t, bus, kind = (
        (k * 700 + rng.randrange(600)) * 1000 * 1e-9 if k else 0.0,
        rng.randrange(3),
        rng.choice(kinds),
    )
    extended = rng.random() < 0.3
    id_ = rng.randrange(1 << 29) if extended else rng.randrange(1 << 11)
    flags = int(Flag.EXTENDED) * extended | int(Flag.TX) * (rng.random() < 0.2)
    if kind == "fd":
        flags |= int(Flag.FD) | rng.choice((0, int(Flag.BRS), int(Flag.ESI), int(Flag.BRS | Flag.ESI)))
        return Frame(t, bus, id_, rng.randbytes(rng.choice(SIZES)), flags)
    if kind == "remote":
        return Frame(t, bus, id_, b"", flags | int(Flag.REMOTE), rng.randrange(9))
    if kind == "error":
        return Frame(t, bus, 0, b"", int(Flag.ERROR))
    return Frame(t, bus, id_, rng.randbytes(rng.choice((8, 8, 8, 0, 1, 5))), flags)


ALL = ("classic", "classic", "classic", "fd", "remote", "error")


def drive(seed: int, n: int, kinds: tuple[str, ...] = ALL) -> list[Frame]:
    rng = random.Random(seed)
    return [frame(rng, k, kinds) for k in range(n)]


def read(path: Path) -> list[Frame]:
    """The frames of the columns; and what every chunk promises."""
    out, damage = read_damaged(path)
    assert damage is None
    return out


def read_damaged(path: Path) -> tuple[list[Frame], Damage | None]:
    """The same of a log that is not whole."""
    out: list[Frame] = []
    log = open_log(path)
    for chunk in log.columns():
        check_chunk(chunk)
        out += frames_of(chunk)
    return out, log.damage


def check_chunk(chunk: Columns) -> None:
    n = len(chunk.t)
    assert n > 0
    assert [column.dtype.str[1:] for column in chunk] == ["f8", "u2", "u4", "u1", "u1", "u1"]
    assert [len(column) for column in chunk] == [n] * 6
    assert chunk.data.shape[1] in (8, 64)
    held = np.where(chunk.flags & int(Flag.REMOTE), 0, chunk.length)
    assert not chunk.data[np.arange(chunk.data.shape[1]) >= held[:, np.newaxis]].any()


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    n=st.integers(1, 60),
    kinds=st.lists(st.sampled_from(ALL), min_size=1, max_size=3),
    suffix=st.sampled_from((".blf", ".asc", ".log")),
)
def test_what_is_written_comes_back(
    seed: int, n: int, kinds: list[str], suffix: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Any mix of frames: columns give them back, and one by one they are the same."""
    path = tmp_path_factory.mktemp("columns") / f"x{suffix}"
    frames = drive(seed, n, tuple(kinds))
    write_log(path, frames, START)
    got = read(path)
    assert got == list(open_log(path))
    key = (lambda f: f._replace(t=round(f.t * 1e6))) if suffix != ".blf" else (lambda f: f)
    if suffix == ".log":  # buses are numbered as they come
        buses = list(dict.fromkeys(f.bus for f in frames))
        frames = [f._replace(bus=buses.index(f.bus)) for f in frames]
    assert [key(f) for f in got] == [key(f) for f in frames]


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
@pytest.mark.parametrize("kinds", [("classic",), ALL], ids=["classic", "mixed"])
def test_python_can_says_the_same_of_its_own_files(
    suffix: str, kinds: tuple[str, ...], tmp_path: Path
) -> None:
    """Logs by python-can's writers, several containers and blocks: each message that its reader finds, in order."""
    path = tmp_path / f"x{suffix}"
    can = python_can.load()
    with can.Logger(str(path)) as writer:
        for one in drive(5, 9_000, kinds):
            writer.on_message_received(messages.message_of(one, START))
    with getattr(can, {".blf": "BLFReader", ".asc": "ASCReader"}[suffix])(str(path)) as reader:
        theirs = list(reader)
    got = read(path)
    assert len(got) == len(theirs) == 9_000
    zero = theirs[0].timestamp
    for ours, message in zip(got, theirs, strict=True):
        expected = messages.frame_of(message, message.channel)
        if message.is_fd and suffix == ".asc" and not message.data:
            # for its .asc reader every CAN FD frame without data is a remote one, which CAN FD does not have
            expected = expected._replace(flags=expected.flags & ~int(Flag.REMOTE))
        # python-can keeps no direction of error frames
        if message.is_error_frame:
            assert ours.flags & Flag.ERROR
        else:
            assert (ours.id, ours.data, ours.flags) == (expected.id, expected.data, expected.flags)
            assert ours.bus == message.channel
        assert abs(ours.t - (message.timestamp - zero)) < 1e-6


@pytest.mark.parametrize("log", ["rav4/rav4_highway.blf", "openacc/human_h22_v3.blf"])
def test_measured_logs_are_what_python_can_reads(log: str) -> None:
    """Every frame of a real log: id, bus, data, direction, time."""
    path = DATA / log
    if not path.exists():
        pytest.skip(f"measured logs are not there: {path}")
    got = read(path)
    with python_can.load().BLFReader(str(path)) as reader:
        zero = None
        for ours, message in zip(got, reader, strict=True):
            zero = message.timestamp if zero is None else zero
            assert (ours.id, ours.bus, ours.data) == (
                message.arbitration_id,
                message.channel,
                bytes(message.data),
            )
            assert bool(ours.flags & Flag.TX) != message.is_rx
            assert abs(ours.t - (message.timestamp - zero)) < 1e-6


@pytest.mark.parametrize("level", [-1, 0, 9])
def test_any_compression(level: int, tmp_path: Path) -> None:
    """Containers that are stored, or packed at any level."""
    path = tmp_path / "x.blf"
    frames = drive(6, 4_000)
    with python_can.load().BLFWriter(str(path), compression_level=level) as writer:
        for one in frames:
            writer.on_message_received(messages.message_of(one, START))
    got = read(path)
    assert [(f.id, f.data) for f in got] == [(f.id, f.data) for f in frames]


def head(kind: int, body: bytes, ns: int, version: int = 1) -> bytes:
    size = 32 + 8 * (version == 2)
    stamp = struct.pack("<LHHQ", 2, 0, 0, ns) + bytes(8 * (version == 2))
    return struct.pack("<4sHHLL", b"LOBJ", size, version, size + len(body), kind) + stamp + body


def blf(objects: list[bytes], per_container: int, cut: int) -> bytes:
    """A file of these objects, padded as the format does, in containers that end `cut` bytes off an object's end."""
    row = b"".join(one + bytes(len(one) % 4) for one in objects)
    out = struct.pack("<4sL", b"LOGG", 144).ljust(144, b"\0")
    edges = [*range(per_container + cut, len(row), per_container), len(row)]
    begin = 0
    for end in edges:
        packed = zlib.compress(row[begin:end])
        size = 32 + len(packed)
        out += (
            struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, size, 10, 2, end - begin) + packed + bytes(size % 4)
        )
        begin = end
    return out


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), n=st.integers(1, 80), per=st.integers(60, 3000), cut=st.integers(-30, 30))
def test_objects_of_all_kinds_and_sizes(
    seed: int, n: int, per: int, cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Objects of odd sizes, of other types, with longer headers, with signatures in their data, across containers."""
    rng = random.Random(seed)
    objects: list[bytes] = []
    expected: list[tuple[int, bytes, int]] = []
    for k in range(n):
        data = rng.choice((rng.randbytes(8), b"LOBJ\x20\0\1\0", b"xxLOBJxx"))
        version = rng.choice((1, 1, 2))
        kind = rng.choice((1, 86, 100, 101, 65, 73))
        if kind in (1, 86):
            objects.append(head(kind, struct.pack("<HBBL8s", 1, 0, 8, k, data), k, version))
            expected.append((k, data, 0))
        elif kind == 100:
            body = struct.pack("<HBBLLBBB5x64s", 2, 1, 10, k, 0, 0, 3, 16, data * 2)
            objects.append(head(kind, body, k, version))
            expected.append((k, data * 2, int(Flag.FD | Flag.BRS | Flag.TX)))
        elif kind == 101:
            logged = rng.randrange(17)  # CANoe leaves zeros at the end out
            payload = (data * 2)[:logged]
            body = (
                struct.pack("<BBBBLLLLLLLHBBL", 1, 10, 16, 0, k, 0, 0x1000, 0, 0, 0, 0, 0, 0, 0, 0) + payload
            )
            objects.append(head(kind, body, k, version))
            expected.append((k, payload.ljust(16, b"\0"), int(Flag.FD)))
        elif kind == 65:  # something else, of any length, that may have the form of objects
            objects.append(head(kind, (b"LOBJ" * 30)[: rng.randrange(90)], k))
        else:
            body = struct.pack("<HHLBBBxLLH2x8s", 1, 0, 0, 0, 0, 2, 0, k, 0, b"ab")
            objects.append(head(kind, body, k, version))
            expected.append((k, b"ab", int(Flag.ERROR)))
    path = tmp_path_factory.mktemp("objects") / "x.blf"
    path.write_bytes(blf(objects, per, cut))
    assert [(f.id, f.data, f.flags) for f in read(path)] == expected


def test_damage_costs_the_same_read_together_or_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Containers are walked many at a time; what is bad in one is found, lost and reported as if each stood alone."""
    from canid.logs.blf import blf_reader

    path = tmp_path / "x.blf"
    write_log(path, drive(7, 20_000), START)
    whole = path.read_bytes()
    rng = random.Random(8)
    for k in range(40):
        data = bytearray(whole)
        at = rng.randrange(144, len(data))
        data[at : at + rng.choice((1, 30, 5000))] = rng.randbytes(rng.choice((1, 30, 5000)))
        path.write_bytes(data)
        found = []
        for batch in (1, 1 << 30):
            monkeypatch.setattr(blf_reader, "BATCH_BYTES", batch)
            log = open_log(path)
            found.append(
                (
                    [list(column) for chunk in log.columns() for column in zip(*chunk[:5], strict=True)],
                    log.damage,
                )
            )
        assert found[0] == found[1], k


def test_wanted_ids_are_all_there(tmp_path: Path) -> None:
    """Asked for some ids, a log gives each frame of theirs, at the same time; and few others."""
    frames = drive(9, 30_000)
    for suffix in (".blf", ".asc", ".log"):
        path = tmp_path / f"x{suffix}"
        write_log(path, frames, START)
        every = read(path)
        for ids in ({5}, {f.id for f in frames[:40]}):
            got = [f for chunk in open_log(path).columns(ids) for f in frames_of(chunk)]
            assert [f for f in got if f.id in ids] == [f for f in every if f.id in ids]
            assert len(got) < len(every) or suffix == ".log"


# --- .asc ------------------------------------------------------------------------------------------


HEAD = "date Thu Sep 13 12:26:40.000 2020\nbase {base}  timestamps {kind}\ninternal events logged\n"


def asc_line(rng: random.Random, base: str) -> str:
    """A line as some tool writes it, and now and then one that is wrong, or about something else."""
    t = f"{rng.randrange(10)}.{rng.randrange(10**6):06d}"
    number = (lambda x: f"{x:02X}") if base == "hex" else str
    id_ = f"{rng.randrange(0x800):X}" if base == "hex" else str(rng.randrange(0x800))
    if rng.random() < 0.3:
        id_ = (f"{rng.randrange(1 << 29):X}" if base == "hex" else str(rng.randrange(1 << 29))) + "x"
    n = rng.choice((8, 8, 8, 0, 3))
    data = " ".join(number(rng.randrange(256)) for _ in range(n))
    way = rng.choice(("Rx", "Rx", "Tx", "TxRq"))
    kind = rng.randrange(12)
    if kind < 6:
        return f"   {t} {rng.randrange(1, 4)}  {id_:15s} {way}   d {n} {data}" + rng.choice(
            ("", f"  Length = {rng.randrange(10**6)} BitCount = 120 ID = {rng.randrange(999)}")
        )
    if kind == 6:
        return f"   {t} 1  {id_:15s} {way}   r {rng.choice(('', '8', '4'))}"
    if kind == 7:
        size = rng.choice((0, 8, 12, 64))
        body = " ".join(number(rng.randrange(256)) for _ in range(size))
        dlc = {0: "0", 8: "8", 12: "9", 64: "f"}[size]
        name = rng.choice(("", "", "Symbol ", "1 ", "Two\x85words ", "Sym\0bol "))
        flags = rng.choice(("1000", "3000", "303000", "0", "1010"))
        bits = " ".join(rng.choices(("0", "1", "01"), (5, 5, 1), k=2))
        return f"   {t} CANFD   1 {way} {id_}  {name}{bits} {dlc} {size} {body} 0 0 {flags} 0 0 0 0 0"
    if kind == 8:
        return rng.choice(
            (
                f"   {t} 1  ErrorFrame",
                f"   {t} 1  Statistic: D 0 R 1 XD 0",
                "// a comment",
                "",
                "Begin Triggerblock",
            )
        )
    if kind == 9:
        return f"   {t},{rng.choice(('1', 'x'))} 1 {id_} {way} d {n} {data}"
    line = f"   {t} 1  {id_:15s} {way}   d {n} {data}"
    at = rng.randrange(len(line))
    return line[:at] + rng.choice(("g", " ", "", "F", "\x85", "é", "9")) + line[at + 1 :]


@pytest.mark.parametrize("kind", ["absolute", "relative"])
def test_lines_read_by_the_thousand_are_read_as_one_by_one(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Usual lines and all that can be wrong with them: the same frames, times and complaints as line by line."""
    for seed in range(7):
        rng = random.Random(seed)
        base = "dec" if seed == 6 else "hex"
        lines = [asc_line(rng, base) for _ in range(3_000)]
        if seed >= 5:  # the numbers change their base in the middle
            lines[1500] = f"base {'dec' if base == 'hex' else 'hex'}  timestamps absolute"
        ends = rng.choice(("\n", "\r\n"))
        path = tmp_path / f"{seed}.asc"
        text = HEAD.format(base=base, kind=kind) + ends.join(lines) + rng.choice(("", ends))
        path.write_bytes(text.encode("latin-1"))
        fast, damage = read_damaged(path)
        assert one_by_one(path, monkeypatch) == (fast, damage)
        assert len(fast) > 500
        assert damage is not None


def one_by_one(path: Path, patch: pytest.MonkeyPatch) -> tuple[list[Frame], Damage | None]:
    """What `asc_line` alone says of a log."""
    with patch.context() as slow:
        slow.setattr(asc_fixed_columns, "read", lambda block: none_found(len(block.ends)))
        return read_damaged(path)


# what may stand in a line in place of another character, and mean something else there
ODD = "0123456789 .,xXrRdDtTaFgG_+-\t\r\x00\x0b\x1c\x1f\x7f\x80\x85\xa0²é"


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_a_few_lines_with_anything_wrong(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Any few lines, characters inserted and deleted: the same as one by one, wherever a piece ends."""
    rng = random.Random(data.draw(st.integers(0, 2**32)))
    lines = [asc_line(rng, "hex") for _ in range(data.draw(st.integers(1, 60)))]
    for _ in range(data.draw(st.integers(0, 12))):
        k = data.draw(st.integers(0, len(lines) - 1))
        at = data.draw(st.integers(0, len(lines[k])))
        taken = data.draw(st.integers(0, 2))
        lines[k] = lines[k][:at] + data.draw(st.sampled_from(["", *ODD])) + lines[k][at + taken :]
    kind = data.draw(st.sampled_from(("absolute", "relative")))
    ends = data.draw(st.sampled_from(("\n", "\r\n")))
    # a good line on each side: without any frame a log is an error
    good = f"0.5 1 291 Rx d 1 07{ends}"
    text = (
        HEAD.format(base="hex", kind=kind) + good + ends.join(lines) + data.draw(st.sampled_from(("", ends)))
    )
    path = tmp_path_factory.mktemp("hex") / "x.asc"
    path.write_bytes(text.encode("latin-1"))
    with pytest.MonkeyPatch.context() as patch:
        # the head is read line by line, what follows it by the thousand, of which these are few
        patch.setattr(
            lines_module, "FIRST_BLOCK_BYTES", len(HEAD.format(base="hex", kind=kind)) + len(good) + 2
        )
        # a line that is longer is cut into pieces of this size
        patch.setattr(lines_module, "MAX_LINE_BYTES", data.draw(st.sampled_from((8192, 30))))
        assert read_damaged(path) == one_by_one(path, patch)


def test_usual_lines_are_not_read_one_by_one(tmp_path: Path) -> None:
    """In logs by python-can and by us hardly a line is unusual: else reading them would be slow."""
    from canid.logs.reader_state import ReadState
    from canid.logs.text_lines import LineCount, blocks

    frames = drive(10, 12_000, ("classic", "classic", "classic", "fd"))
    own, theirs = tmp_path / "own.asc", tmp_path / "theirs.asc"
    write_log(own, frames, START)
    write_with_python_can(theirs, frames, START)
    for path in (own, theirs):
        found = np.concatenate(
            [asc_fixed_columns.read(b).found for b in blocks(path, ReadState(), LineCount())]
        )
        assert found.mean() > 0.97


def write_decimal(path: Path, frames: list[Frame]) -> None:
    """Data frames with decimal numbers, as Vector's tools write them."""
    with open(path, "w") as file:
        file.write(HEAD.format(base="dec", kind="absolute"))
        for t, bus, id_, data, flags, _ in frames:
            id_text = f"{id_}{'x' if flags & Flag.EXTENDED else ''}"
            way, held = "Tx" if flags & Flag.TX else "Rx", " ".join(map(str, data))
            if flags & Flag.FD:
                brs, esi = int(bool(flags & Flag.BRS)), int(bool(flags & Flag.ESI))
                dlc = DLC_BYTES.index(len(data))
                file.write(
                    f"{t:9.6f} CANFD {bus + 1:3} {way} {id_text:>8} {brs} {esi} {dlc:x} {len(data):2} {held} "
                )
                file.write(f"{100000:8} {130:4} {0x1000 | brs << 13 | esi << 14:8X} 0 0 0 0 0\n")
            else:
                file.write(f"{t:9.6f} {bus + 1}  {id_text:15} {way}   d {len(data)} {held}\n")


@pytest.mark.parametrize("kinds", [("classic",), ("classic", "fd")], ids=["classic", "fd"])
def test_decimal_numbers_are_the_frames(kinds: tuple[str, ...], tmp_path: Path) -> None:
    """Each frame of a log with decimal numbers comes back, and python-can reads the classic ones alike."""
    frames = drive(15, 4_000, kinds)
    path = tmp_path / "x.asc"
    write_decimal(path, frames)
    assert read(path) == frames
    if kinds == ("classic",):
        with python_can.load().ASCReader(str(path)) as reader:
            theirs = [(m.channel, m.arbitration_id, bytes(m.data), m.is_rx) for m in reader]
        assert theirs == [(f.bus, f.id, f.data, not f.flags & Flag.TX) for f in frames]


def test_a_word_that_a_cut_goes_through_is_two(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands behind the cut in a line that is too long is read by itself: 0.5 s here, not 10.5."""
    path = tmp_path / "x.asc"
    good, rest = "0.4 1 291 Rx d 1 07\n", "0.5 1 291 Rx d 1 07\n"
    path.write_text(HEAD.format(base="hex", kind="absolute") + 500 * good + " " * 8191 + "1" + rest)
    got = read_damaged(path)
    assert [round(f.t, 6) for f in got[0]] == 500 * [0.0] + [0.1]
    assert one_by_one(path, monkeypatch) == got


@pytest.mark.parametrize(("suffix", "frames"), [(".asc", 2), (".asc.gz", 1)])
def test_lines_without_end_need_no_memory(suffix: str, frames: int, tmp_path: Path) -> None:
    """One line of 100 MB among good ones: reported, and never held; in a gzip bomb it ends the log."""
    line = b" 0.5 1  123             Rx   d 1 AA\n"
    path = tmp_path / f"x{suffix}"
    with gzip.open(path, "wb", compresslevel=1) if suffix.endswith(".gz") else path.open("wb") as file:
        file.write(HEAD.format(base="hex", kind="absolute").encode() + line)
        for _ in range(100):
            file.write(b"7" * 1_000_000)
        file.write(b"\n" + line)
    code = (
        "import re, sys\nfrom canid.logs import open_log\n"
        "log = open_log(sys.argv[1])\n"
        "assert sum(len(c.t) for c in log.columns()) == int(sys.argv[2]) and log.damage\n"
        "assert int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1]) < 120 * 1024\n"
    )
    subprocess.run([sys.executable, "-c", code, str(path), str(frames)], check=True, timeout=600)
    path.unlink()


# --- others ----------------------------------------------------------------------------------------


@pytest.mark.skipif(shutil.which("log2asc") is None, reason="log2asc (can-utils) is not installed")
def test_log2asc_and_back(tmp_path: Path) -> None:
    """can-utils makes an .asc of our candump log: its columns are the candump log's."""
    frames = [f for f in drive(11, 400, ("classic", "fd")) if f.bus == 0 and not f.flags & Flag.TX]
    log, asc = tmp_path / "x.log", tmp_path / "x.asc"
    write_log(log, frames, START)
    interface = log.read_text().split()[1]
    # candump itself writes no direction
    log.write_text("".join(" ".join(row.split()[:3]) + "\n" for row in log.read_text().splitlines()))
    subprocess.run(["log2asc", "-I", str(log), "-O", str(asc), interface], check=True, timeout=600)
    got, expected = read(asc), read(log)
    assert len(got) == len(frames)
    assert [(f.id, f.data) for f in got] == [(f.id, f.data) for f in expected]
    assert np.allclose([f.t for f in got], [f.t for f in expected], atol=2e-4)


def test_mf4_columns_are_asammdfs(tmp_path: Path) -> None:
    """An .mf4 by asammdf's writer: ids, data and times as asammdf itself returns them."""
    pytest.importorskip("asammdf", reason="asammdf is not installed: pip install canid[mf4]")
    path = tmp_path / "x.mf4"
    frames = drive(12, 60, ("classic",))
    code = (
        "import sys, pickle, asammdf, warnings\nwarnings.simplefilter('ignore')\n"
        "import can\nfrom canid.buses.messages import message_of\n"
        "frames = pickle.load(sys.stdin.buffer)\n"
        "with can.Logger(sys.argv[1]) as writer:\n"
        "    for frame in frames: writer.on_message_received(message_of(frame, 1.6e9))\n"
        "with asammdf.MDF(sys.argv[1]) as log:\n"
        "    ids = log.get('CAN_DataFrame.ID', raw=True) if 'CAN_DataFrame.ID' in log else log.get('ID')\n"
        "    data = log.get('CAN_DataFrame.DataBytes', raw=True)\n"
        "    pickle.dump((ids.samples.tolist(), data.samples.tolist(), ids.timestamps.tolist()), sys.stdout.buffer)\n"
    )

    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, str(path)],
        input=pickle.dumps(frames),
        capture_output=True,
        check=True,
        timeout=600,
    )
    ids, data, t = pickle.loads(done.stdout)
    got = read(path)
    assert [f.id for f in got] == [id_ & 0x1FFFFFFF for id_ in ids]
    assert [f.data for f in got] == [bytes(row)[: len(f.data)] for row, f in zip(data, got, strict=True)]
    assert [f.data for f in got] == [f.data for f in frames]
    assert np.allclose([f.t for f in got], np.array(t) - t[0], atol=2e-6)


@pytest.mark.parametrize("suffix", [".log", ".csv", ".trc"])
def test_other_formats_come_as_columns_too(suffix: str, tmp_path: Path) -> None:
    """Formats that are read frame by frame give the same columns."""
    path = tmp_path / f"x{suffix}"
    write_with_python_can(path, (one._replace(bus=0) for one in drive(13, 300, ("classic",))), START)
    assert read(path) == list(open_log(path))


def test_absurd_numbers_are_damage(tmp_path: Path) -> None:
    """Numbers that no frame can have, in any text format: the line is bad, and columns come all the same."""
    texts = {
        ".asc": b"base hex\n0.1 1 123 Rx d 0\n0.2 99999999999 123 Rx d 0\n99999999999999999999.5 1 123 Rx d 0\n",
        ".csv": b"1.0,0x1,0,0,0,0,\n1.1,0xFFFFFFFFFFFF,0,0,0,0,\n1.2,0x1,0,1,0,99999,\n",
        ".log": b"(1.0) can0 123#11\n(1.1) can0 123#R99999999\n",
    }
    for suffix, text in texts.items():
        path = tmp_path / f"x{suffix}"
        path.write_bytes(text)
        log = open_log(path)
        assert sum(len(chunk.t) for chunk in log.columns()) == 1, suffix
        assert log.damage is not None
    path = tmp_path / "y.asc"
    path.write_bytes(texts[".asc"].splitlines()[2])
    with pytest.raises(LogError):
        open_log(path)


def test_columns_and_frames_are_each_other() -> None:
    """There and back, in chunks of any size."""
    frames = drive(14, 500)
    for size in (1, 33, 500):
        parts = [columns_of(frames[k : k + size]) for k in range(0, 500, size)]
        assert [f for chunk in gather(parts, 100) for f in frames_of(chunk)] == frames


def test_damage_among_objects_without_containers_costs_one(tmp_path: Path) -> None:
    """Objects that stand in the file itself are read many at a time; a bad one is lost alone, and reported."""
    objects = [head(1, struct.pack("<HBBL8s", 1, 0, 8, k, bytes(8)), 1000 * k) for k in range(5_000)]
    body = struct.pack("<HBBLLBBB5x64s", 1, 0, 15, 7, 0, 0, 1, 99, bytes(64))  # claims 99 bytes
    objects[2_500] = head(100, body, 0)
    path = tmp_path / "x.blf"
    path.write_bytes(struct.pack("<4sL", b"LOGG", 144).ljust(144, b"\0") + b"".join(objects))
    log = open_log(path)
    assert [f.id for f in log] == [k for k in range(5_000) if k != 2_500]
    assert log.damage is not None
    assert "99 bytes" in log.damage.says
