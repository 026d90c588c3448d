"""A log format is one file and one line: what the table of formats holds is read, counted, listed and explained."""

from __future__ import annotations

import gzip
import itertools
import random
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from canid.analysis.tables.kinds import is_table
from canid.io.logs import formats, open_log
from canid.io.logs.formats import Format
from canid.io.logs.frame_lines import Row, read
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Bad, Line, hex_bytes
from canid.values.errors import ConfigError, LogError
from canid.values.frame_columns import WantedIds, frames_of
from canid.values.types import Columns, Frame

ROOT = Path(__file__).parents[2]


def read_trivial(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Read lines `ID DATA` of frames that are 10 ms apart; `*` begins a comment."""
    numbers = itertools.count()

    def take(text: str, line: Line) -> Row | str:
        if text.startswith("*"):
            return "comments"
        id_text, _, data = text.partition(" ")
        try:
            id_, octets = int(id_text, 16), hex_bytes(data, len(data) // 2)
        except ValueError as error:
            raise error if isinstance(error, Bad) else Bad("it is not ID DATA") from None
        return Row(next(numbers) * 10_000_000, 0, id_, octets, 0)

    return read(path, state, take, wanted, dated=lambda: False)


@pytest.fixture
def trivial(monkeypatch: pytest.MonkeyPatch) -> None:
    """The trivial format, registered as `canid.io.logs.formats` registers all others."""
    module = ModuleType("trivial_reader")
    module.read_trivial = read_trivial  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "trivial_reader", module)
    monkeypatch.setitem(formats.FORMATS, ".hex", Format("trivial_reader", "read_trivial", "trivial .hex"))


@pytest.mark.usefixtures("trivial")
def test_a_registered_format_is_read_counted_and_listed(tmp_path: Path) -> None:
    """One entry in the table: frames, columns, gzip, progress, counts, damage, help and messages come with it."""
    text = b"* a comment\n123 0102\n7 \nnonsense\n124 ff\n"
    path, packed, empty = tmp_path / "x.HEX", tmp_path / "x.hex.gz", tmp_path / "empty.hex"
    path.write_bytes(text)
    packed.write_bytes(gzip.compress(text))
    empty.write_bytes(b"nonsense\n")
    unknown = tmp_path / "x.xyz"
    unknown.touch()
    expected = [Frame(0.0, 0, 0x123, b"\1\2"), Frame(0.01, 0, 7, b""), Frame(0.02, 0, 0x124, b"\xff")]
    for each in (path, packed):
        log = open_log(each)
        assert list(log) == expected
        assert [frame for chunk in log.columns() for frame in frames_of(chunk)] == expected
        assert (log.frames_read, log.other_kinds, log.damaged, log.progress) == (3, {"comments": 1}, 1, 1.0)
        assert log.damage is not None
        assert log.damage.says.endswith("line 4: it is not ID DATA")
        assert log.others_says == "1 line of no interest: 1 comments"
    assert formats.described().endswith(" or trivial .hex")
    with pytest.raises(ConfigError, match=r"unknown log format '.xyz'; known are .*\.hex, .*\.hex\.gz"):
        open_log(unknown)
    with pytest.raises(LogError, match="holds no frame that can be read"):
        open_log(empty)


def test_the_table_is_what_help_and_readme_say() -> None:
    """Every suffix in the table stands in the help of the verbs that read logs and in the README."""
    shown = subprocess.run(
        [sys.executable, "-m", "canid", "identify", "--help"], capture_output=True, text=True, check=True
    ).stdout
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for suffix in formats.FORMATS:
        assert suffix in shown
        assert suffix in readme


def test_the_table_imports_no_reader() -> None:
    """Listing the formats costs no import of a reader, of numpy or of python-can."""
    code = (
        "import sys, canid.io.logs.formats\n"
        "assert not {'numpy', 'can', 'canid.io.logs.log', 'canid.io.logs.csv_reader'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


SAVVYCAN = """\
Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8
166064000,0000021A,false,Rx,0,8,FE,36,12,FE,69,05,07,AD,
"""


def test_a_csv_of_another_program_is_known_by_its_header(tmp_path: Path) -> None:
    """SavvyCAN's is read; one that canid does not know is refused with what to do, and not called damaged."""
    path = tmp_path / "savvycan.csv"
    path.write_text(SAVVYCAN)
    log = open_log(path)
    assert list(log)
    assert log.damage is None
    path.write_text("When,CAN ID,Payload\n0,291,AA BB\n")
    with pytest.raises(
        ConfigError,
        match=r"lists CAN frames in a form that canid does not know: its ids, .*; save it there as",
    ):
        open_log(path)


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".tsv", ".txt"])
def test_a_table_is_said_to_be_one_wherever_its_header_stands(tmp_path: Path, suffix: str, seed: int) -> None:
    """Behind lines about the measurement, with units below the names, quoted or not: never "damaged"."""
    rng = random.Random(seed)
    for k in range(20):
        mark = rng.choice(",;\t")
        before = [
            mark.join(rng.choice((["Date", "26", "9"], ["Driver", "A"], ["Cars", "2"]))) for _ in range(k % 7)
        ]
        names = rng.sample(["Time", "Speed1", "IVS1", "Gap [m]", "v_ego", "pedal"], 4)
        units = [mark.join(rng.sample(["s", "m/s", "m", "%"], 4))] if rng.random() < 0.5 else []
        rows = [mark.join(f"{rng.uniform(-9, 99):.3f}" for _ in names) for _ in range(5)]
        quoted = mark.join(f'"{name}"' for name in names) if rng.random() < 0.5 else mark.join(names)
        text = "\r\n".join([*before, quoted, *units, *rows]).encode()
        path = tmp_path / f"table{k}{suffix}"
        path.write_bytes(gzip.compress(text) if suffix.endswith(".gz") else text)
        with pytest.raises(ConfigError, match="is a table of named columns and lists no CAN frames"):
            open_log(path)


HEADERS = (
    ("gbk", ["序号", "时间标识", "帧ID", "数据长度", "数据"]), ("utf-8", ["Nr", "Zeit", "Kennung", "Länge", "Daten"]),
    ("cp1251", ["№", "Время", "Идентификатор", "Длина", "Данные"]), ("cp932", ["番号", "時刻", "識別子", "長さ", "データ"]),
    ("utf-8", ["n", "Time", "Identifier (hex)", "Length", "Data (hex)"]),
)  # fmt: skip


@pytest.mark.parametrize(("encoding", "names"), HEADERS, ids=[names[2] for _, names in HEADERS])
def test_a_list_of_frames_in_any_language_is_neither_damaged_nor_a_table(
    encoding: str, names: list[str], tmp_path: Path, seed: int
) -> None:
    rng = random.Random(seed)
    for k, suffix in enumerate((".csv", ".txt", ".tsv")):
        mark, between = rng.choice(",;\t"), rng.choice((" ", "-", " 0x"))
        before = ["ASCII trace", "Date: 25.11.2026"] if rng.random() < 0.5 else []
        rows, written = [], []
        for row in range(rng.randrange(3, 40)):
            written.append((rng.randrange(0x800), rng.randbytes(rng.randrange(4, 9))))
            (id_, data) = written[-1]
            octets = between.join(f"{byte:02X}" for byte in data)
            rows.append(mark.join([str(row), f"{0.01 * row:.3f}", f"0x{id_:X}", str(len(data)), octets]))
        path = tmp_path / f"list{k}{suffix}"
        path.write_bytes("\r\n".join([*before, mark.join(names), *rows]).encode(encoding, errors="replace"))
        assert not is_table(path)
        if encoding in ("utf-8", "gbk"):  # languages whose names are known
            log = open_log(path)
            assert [(frame.id, frame.data) for frame in log] == written
            assert log.damage is None
            continue
        with pytest.raises(
            ConfigError, match="lists CAN frames in a form that canid does not know: no line names"
        ):
            open_log(path)


@pytest.mark.parametrize(
    ("suffix", "says"),
    [
        (".xlsx", "save the sheet as CSV"),
        (".mat", "canid.from_arrays"),
        (".xyz", ".vbo"),
    ],
)
def test_a_file_that_may_be_a_table_is_told_how_it_becomes_one(
    tmp_path: Path, suffix: str, says: str
) -> None:
    path = tmp_path / f"drive{suffix}"
    path.write_bytes(b"\x89\0\1")
    with pytest.raises(ConfigError, match=f"tables are read as .*{re.escape(says)}"):
        open_log(path)


def test_a_text_that_is_no_table_is_an_unknown_format(tmp_path: Path) -> None:
    path = tmp_path / "note.txt"
    path.write_text("Dear reader, here is\nwhat we drove, and where\non 3 days, 2 cars\n")
    with pytest.raises(ConfigError, match="unknown log format"):
        open_log(path)
