"""Lines of an .asc that are read by the thousand are read as one by one."""

from __future__ import annotations

import gzip
import random
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.io.buses import python_can
from canid.io.logs import open_log, write_log
from canid.io.logs import text_lines as lines_module
from canid.io.logs.asc import asc_decimal_words, asc_fixed_columns
from canid.io.logs.line_columns import none_found
from canid.values.frame_columns import DLC_BYTES
from canid.values.types import Damage, Flag, Frame
from tests.logs.drawn_logs import START, drive, read, read_damaged
from tests.logs.samples import write_with_python_can

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


@pytest.mark.slow("whole logs")
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
        for fast in (asc_fixed_columns, asc_decimal_words):
            slow.setattr(fast, "read", lambda block, wanted=None: none_found(len(block.ends)))
        return read_damaged(path)


# what may stand in a line in place of another character, and mean something else there
ODD = "0123456789 .,xXrRdDtTaFgG_+-\t\r\x00\x0b\x1c\x1f\x7f\x80\x85\xa0²é"


@pytest.mark.slow("many logs, written and read")
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
    from canid.io.logs.reader_state import ReadState
    from canid.io.logs.text_lines import LineCount, blocks

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


def test_a_line_that_is_too_long_is_damaged_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No part of it is read by itself: a word that a cut goes through would be another one, 0.5 s instead of 10.5."""
    path = tmp_path / "x.asc"
    good, rest = "0.4 1 291 Rx d 1 07\n", "0.5 1 291 Rx d 1 07\n"
    path.write_text(HEAD.format(base="hex", kind="absolute") + 500 * good + " " * 8191 + "1" + rest + good)
    got = read_damaged(path)
    assert [round(f.t, 6) for f in got[0]] == 501 * [0.0]
    log = open_log(path)
    assert (sum(1 for _ in log), log.damaged) == (501, 1)
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
        "import re, sys\nfrom canid.io.logs import open_log\n"
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
