"""A damaged log becomes a clean copy: all that was whole is in it, and others read the same there as canid does."""

from __future__ import annotations

import json
import random
import re
import shutil
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canid.io.buses import messages, python_can
from canid.io.logs import open_log, write_log
from canid.io.logs.blf.blf_writer import BlfWriter
from canid.io.logs.log_writer import open_writer
from canid.io.logs.reader_state import Note
from canid.io.logs.recovery import recover, recovered_path
from canid.ui.cli import main
from canid.values.errors import DAMAGED, DONE, NOT_WRITTEN, USAGE, ConfigError, LogError, OutputError
from canid.values.types import Event, Flag, Frame
from tests.damaged_logs.bases import drive
from tests.fixtures import readers
from tests.fixtures.frame_by_frame import blf_object
from tests.fixtures.readers import by_python_can

START_NS = 1_600_000_000_123_456_789
KINDS = (0, Flag.FD, Flag.FD | Flag.BRS | Flag.ESI, Flag.EXTENDED, Flag.TX, Flag.REMOTE, Flag.ERROR)
# every how many frames a checkpoint is made, which ends a container
EACH = 100


def recorded(path: Path, frames: list[Frame], events: list[tuple[int, Event]] = []) -> None:  # noqa: B006
    """As canid records: containers of some frames, and events before the frames whose numbers they have."""
    writer = open_writer(path, START_NS // 1000 * 1000 if path.suffix == ".asc" else START_NS)
    for k, frame in enumerate(frames):
        for row, event in events:
            if row == k:
                writer.note(event)
        writer.append(frame)
        if k % EACH == EACH - 1:
            writer.checkpoint(sync=False)
    writer.close()


def damage_middle(path: Path) -> None:
    data = bytearray(path.read_bytes())
    for k in range(len(data) // 2, len(data) // 2 + 30):
        data[k] ^= 0x5A
    path.write_bytes(data)


def reported(path: Path) -> list[tuple[int, str, str]]:
    """Events of a log: row, what, says."""
    notes: list[Note] = []
    for _ in open_log(path).columns(notes=notes):
        pass
    return [(note.row, note.event.what, note.event.says) for note in notes]


@pytest.mark.parametrize("seed", range(3))
def test_the_copy_of_a_blf_has_all_that_was_whole(seed: int, tmp_path: Path) -> None:
    """Times to the nanosecond, buses, directions, kinds; every frame outside the bad container, in order."""
    frames = drive(random.Random(seed), 1_000, KINDS, 3)
    path = tmp_path / "x.blf"
    recorded(path, frames)
    whole = list(open_log(path))
    damage_middle(path)
    found = recover(path)
    assert found.damage is not None
    assert found.path == tmp_path / "x.recovered.blf"
    log = open_log(found.path)
    copy = list(log)
    assert log.start_ns == START_NS
    assert log.damage is None
    assert len(copy) == found.frames == found.damage.read
    assert found.damage.total == len(whole) == len(copy) + EACH
    lost = next(k for k, frame in enumerate(whole) if copy[k] != frame)
    assert copy == whole[:lost] + whole[lost + EACH :]


@pytest.mark.slow("whole logs")
@pytest.mark.parametrize("suffix", [".blf", ".asc", ".log", ".csv", ".trc"])
def test_others_read_the_copy_as_we_do(suffix: str, tmp_path: Path) -> None:
    """python-can, and tshark where the copy is a .blf: the same frames at the same times, and the same number."""
    kinds = KINDS if suffix == ".blf" else (0, Flag.EXTENDED) if suffix == ".trc" else KINDS[:5]
    frames = drive(random.Random(4), 600, kinds, 1 if suffix in (".csv", ".trc") else 2)
    path = tmp_path / f"x{suffix}"
    if suffix in (".csv", ".trc"):
        with python_can.load().Logger(str(path)) as writer:
            for frame in frames:
                writer.on_message_received(messages.message_of(frame, START_NS / 1e9))
    else:
        recorded(path, frames)
    damage_middle(path)
    found = recover(path)
    assert found.damage is not None
    assert found.path.suffix == (".blf" if suffix in (".csv", ".trc") else suffix)
    assert 0 < found.frames < len(frames)
    assert readers.disagreement(found.path) == ""
    ours, theirs = readers.by_canid(found.path), readers.by_python_can(found.path)
    errors = sum(bool(frame.flags & Flag.ERROR) for frame in open_log(found.path))
    assert len(theirs.frames) + errors == len(ours.frames) + errors == found.frames
    if found.path.suffix == ".blf" and shutil.which("tshark"):
        by_tshark = readers.by_tshark(found.path)
        assert by_tshark is not None
        assert len(by_tshark.frames) == len(ours.frames)


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
def test_the_recorders_events_are_kept_where_they_stood(suffix: str, tmp_path: Path) -> None:
    """Before the first frame, between frames and behind the last; from .blf to .asc and back, too."""
    frames = drive(random.Random(5), 350, (0, Flag.EXTENDED), 2)
    events = [(row, Event(frames[row].t, "remark", f"before {row}")) for row in (0, 1, 120, 121, 349)]
    path = tmp_path / f"x{suffix}"
    recorded(path, frames, [*events, (0, Event(0.0, "clock", "hardware"))])
    with path.open("ab") as file:
        file.write(b"LOBJ\x00 and nothing\n")
    expected = [(row, event.what, event.says) for row, event in events]
    expected.insert(1, (0, "clock", "hardware"))
    assert reported(path) == expected
    for output in ("a.blf", "b.asc"):
        found = recover(path, tmp_path / output)
        assert found.damage is not None
        assert found.events == len(expected)
        assert reported(found.path) == expected
    again = recover(tmp_path / "b.asc", tmp_path / "c.blf")
    assert again.damage is None
    assert reported(again.path) == expected
    times: list[Note] = []
    list(open_log(again.path).columns(notes=times))
    # an .asc has microseconds
    assert [note.event.t for note in times[2:]] == pytest.approx([e.t for _, e in events[1:]], abs=1e-6)


def test_markers_do_not_hide_how_many_frames_there_were(tmp_path: Path) -> None:
    """The header counts frames; so does "read N of M" of a damaged log with the recorder's markers."""
    frames = drive(random.Random(6), 500, (0,), 1)
    path = tmp_path / "x.blf"
    recorded(path, frames, [(k, Event(frames[k].t, "remark", "a")) for k in range(0, 500, 7)])
    damage_middle(path)
    log = open_log(path)
    n = len(list(log))
    assert log.damage is not None
    assert (log.damage.read, log.damage.total) == (n, 500)


def test_objects_that_are_no_frames_are_counted(tmp_path: Path) -> None:
    """What the copy cannot have is reported."""
    text = struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 44, 65, 2, 0, 0, 0) + b"some text..."
    frames = [struct.pack("<4sHHLLLHHQHBBL8s", b"LOBJ", 32, 1, 48, 1, 2, 0, 0, k, 1, 0, 8, k, b"12345678") for k in range(9)]  # fmt: skip  # noqa: E501
    row = zlib.compress(b"".join([*frames, text, text]))
    head = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(row), 10, 2, 9 * 48 + 2 * 44)
    path = tmp_path / "x.blf"
    path.write_bytes(struct.pack("<4sL", b"LOGG", 144).ljust(144, b"\0") + head + row)
    found = recover(path)
    assert (found.frames, found.others, found.damage) == (9, 2, None)


def test_frames_before_the_first_keep_their_times(tmp_path: Path) -> None:
    """canid 0.2.0 wrote times before the file's zero as negative ones: the copy has them, for every reader."""
    frames = [Frame(t, 0, k, b"") for k, t in enumerate((0.0, -2.5, 1.0))]
    path = tmp_path / "x.blf"
    BlfWriter(path, START_NS).close()
    rest = START_NS % 1_000_000
    row = b"".join(blf_object(frame, round(frame.t * 1e9) + rest) for frame in frames)
    packed = zlib.compress(row)
    head = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(packed), 10, 2, len(row))
    path.write_bytes(path.read_bytes() + head + packed)
    for output in ("a.blf", "a.asc", "a.log"):
        found = recover(path, tmp_path / output)
        log = open_log(found.path)
        assert [f.t for f in log] == pytest.approx([0.0, -2.5, 1.0], abs=1e-6)
        assert log.start_utc == pytest.approx(START_NS / 1e9, abs=1e-6)
        stamps = by_python_can(found.path).times
        assert stamps == pytest.approx([START_NS / 1e9 + t for t in (0.0, -2.5, 1.0)], abs=2e-6)


def test_an_empty_recording_has_an_empty_copy(tmp_path: Path) -> None:
    """A bus on which nothing happened is no damage."""
    write_log(tmp_path / "x.blf", [], 1.6e9)
    assert recover(tmp_path / "x.blf").frames == 0
    assert list(open_log(tmp_path / "x.recovered.blf")) == []


@pytest.mark.parametrize(
    ("name", "content", "error"),
    [
        ("x.blf", b"no log at all" * 1000, LogError),
        ("x.asc", b"no log at all\n" * 1000, LogError),
        ("x.log", b"\xff\xfe" * 1000, LogError),
        ("x.xyz", b"abc", ConfigError),
        ("y.blf", None, ConfigError),
    ],
)
def test_what_is_no_log_has_no_copy(
    name: str, content: bytes | None, error: type[Exception], tmp_path: Path
) -> None:
    """One line that names the file, and nothing is written."""
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    before = set(tmp_path.iterdir())
    with pytest.raises(error) as caught:
        recover(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert set(tmp_path.iterdir()) == before


def test_nothing_is_ever_written_over(tmp_path: Path) -> None:
    """Not the log itself, and no copy that is there already."""
    path = tmp_path / "x.blf"
    write_log(path, [Frame(0.0, 0, 1, b"a")], 1.6e9)
    bytes_before = path.read_bytes()
    recovered_path(path).write_bytes(b"mine")
    for output in (None, path, recovered_path(path)):
        with pytest.raises(OutputError, match="exists already"):
            recover(path, output)
    assert path.read_bytes() == bytes_before
    assert recovered_path(path).read_bytes() == b"mine"


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit 0 with nothing damaged, 4 with damage, its bytes and counts; JSON has the same numbers."""
    path = tmp_path / "x.blf"
    recorded(path, drive(random.Random(7), 400, KINDS, 2))
    assert main(["recover", str(path), "-o", str(tmp_path / "a.asc")]) == DONE
    assert "read 400 frames, nothing damaged" in capsys.readouterr().err
    damage_middle(path)
    assert main(["recover", str(path), "--json", "-"]) == DAMAGED
    ran = capsys.readouterr()
    said = re.search(r"read (\d+) of (\d+) objects, bytes (\d+)–(\d+) damaged", ran.err)
    assert said is not None, ran.err
    result: dict[str, Any] = json.loads(ran.out)
    assert [int(word) for word in said.groups()] == [result["read"], result["total"], *result["damaged"][0]]
    assert result["frames"] == result["read"] == 300
    assert result["path"] == str(tmp_path / "x.recovered.blf")
    assert f"{tmp_path / 'x.recovered.blf'}: 300 frames" in ran.err
    # a second copy is refused, and so is a format that is not written
    assert main(["recover", str(path)]) == NOT_WRITTEN
    assert main(["recover", str(path), "-o", str(tmp_path / "x.mf4")]) == USAGE
    (tmp_path / "nothing.blf").write_bytes(bytes(1000))
    assert main(["recover", str(tmp_path / "nothing.blf")]) == USAGE
    assert capsys.readouterr().err.count("\n") == 3


def bomb(body: bytes, times: int) -> bytes:
    head = struct.pack("<4sL", b"LOGG", 144).ljust(144, b"\0")
    packed = zlib.compress(body, 9)
    container = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(packed), 10, 2, len(body)) + packed
    return head + (container + bytes(len(container) % 4)) * times


MARKER = struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 88, 96, 2, 0, 0, 5) + struct.pack(
    "<LLL3xBLLL12x", 0, 0, 0, 0, 5, 5, 6
) + b"canid" + b"event" + b"saying"  # fmt: skip
FRAME = struct.pack("<4sHHLLLHHQHBBL8s", b"LOBJ", 32, 1, 48, 1, 2, 0, 0, 7, 1, 0, 8, 9, b"12345678")
MIB = 1 << 20


def endless() -> dict[str, Callable[[], bytes]]:
    """Small files that hold many million bytes of something."""
    import gzip

    header = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16, 7)
    nested = struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 40, 65, 2, 0, 0, 0) + b"LOBJLOBJ"
    return {
        "headers.blf": lambda: bomb(header * (MIB - 1), 10),
        "signatures.blf": lambda: bomb(FRAME + b"LOBJ" * (4 * MIB - 100), 1),
        "nested.blf": lambda: bomb(nested * (16 * MIB // 40 - 1), 10),
        "markers.blf": lambda: bomb(FRAME + MARKER * (16 * MIB // 88 - 1), 1),
        "early markers.blf": lambda: bomb(MARKER * (16 * MIB // 88 - 1), 1),
        "bomb.blf": lambda: bomb(bytes(200 * MIB), 16),
        "one object.blf": lambda: bomb(header[:8] + struct.pack("<LL", 15 * MIB, 65) + bytes(15 * MIB), 10),
        "date.asc.gz": lambda: gzip.compress(b"base hex\n" * (MIB // 2)),
        "lines.asc.gz": lambda: gzip.compress(b"\n" * MIB),
        "zeros.log.gz": lambda: gzip.compress(bytes(160 * MIB)),
        "comments.trc.gz": lambda: gzip.compress(b"".join(b";%d\n" % k for k in range(MIB // 8))),
        "zeros.csv.gz": lambda: gzip.compress(bytes(160 * MIB)),
    }


# a guard against hangs, not a promise of speed
@pytest.mark.slow("many logs, written and read")
@pytest.mark.parametrize("name", endless())
def test_endless_things_need_little_memory(name: str, tmp_path: Path) -> None:
    """Whoever reads and recovers them ends, below 512 MB."""
    path = tmp_path / name
    path.write_bytes(endless()[name]())
    code = (
        "import re, sys\n"
        "from canid.values.errors import LogError\n"
        "from canid.io.logs import open_log\n"
        "from canid.io.logs.recovery import recover\n"
        "try:\n"
        "    print(sum(len(c.t) for c in open_log(sys.argv[1]).columns()), recover(sys.argv[1]).frames)\n"
        "except LogError as error:\n"
        "    print(error)\n"
        # ru_maxrss begins with what the process that started this one had
        "high = int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1]) >> 10\n"
        "assert high < 512, f'{high} MB'\n"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, timeout=600)
