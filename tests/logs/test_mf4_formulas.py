"""A formula in an .mf4 is named and never evaluated; every other conversion gives the values of the standard."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.analysis.tables.sources.signals_source import read_signals_file
from canid.analysis.tables.table import open_table
from canid.io.logs import open_log
from canid.io.logs.mf4 import conversions as applied
from canid.ui.cli import main
from canid.values.errors import ConfigError, DamagedLogError
from canid.values.frame_columns import frames_of
from tests.formats_oracle import mf4_conversions
from tests.formats_oracle.mf4_conversions import SIGNALS, Conversion, formula

asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed: pip install canid[mf4]")

DBC = Path(__file__).parents[2] / "dbc" / "generic.dbc"
# where a formula may stand in bus logging, and what is left of the frames: none, or all
PLACES = {
    "ID": 0,
    "t": 0,
    "BusChannel": 0,
    "DataLength": 0,
    "DLC": 0,
    "IDE": 0,
    "DataBytes": 0,
    "Dir": 0,
    "EDL": 0,
    "CRC": 20,
}
# a module's arguments run below a hook that notes what is compiled; the descriptor is open before rights are given up
_WATCHED = """
import os, runpy, sys
notes = os.open(sys.argv[1], os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
def note(event, args):
    if event == "compile" and "canid_token" in str(args[0]):
        os.write(notes, b"compiled ")
    elif event in ("subprocess.Popen", "os.system", "socket.connect", "os.exec", "os.fork"):
        os.write(notes, event.encode())
sys.addaudithook(note)
sys.argv = sys.argv[2:]
runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
"""


def evil(marker: Path) -> Conversion:
    """A formula that makes a file, in numexpr (2.14: it passes its check) and in sympy."""
    return formula(f"(*(open('{marker}', 'w') for canid_token in (1,)),)")


def columns(n: int = 20) -> dict[str, list[float]]:
    return {"t": [0.1 * k for k in range(n)], **{name: [10.0 + k for k in range(n)] for name in SIGNALS}}


def watched(module: str, path: Path, notes: Path) -> str:
    """What a child of canid compiles and starts while it reads a file."""
    words = [sys.executable, "-W", "ignore", "-c", _WATCHED, str(notes), module, str(path)]
    subprocess.run(words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=True, timeout=600)
    return notes.read_text(encoding="ascii")


def marker_of(folder: Path) -> Path:
    # numexpr's check is of points and colons
    return folder / "marker"


def test_a_formula_of_a_log_is_named(tmp_path: Path) -> None:
    """On the time, which asammdf itself would evaluate: no file is made, and the message has the channel."""
    marker = marker_of(tmp_path)
    path = mf4_conversions.write(tmp_path / "x.mf4", mf4_conversions.bus_log({"t": evil(marker)}))
    says = (
        r"20 records cannot be read \(channel t has a formula as its conversion; canid does not evaluate it\)"
    )
    with pytest.raises(DamagedLogError, match=says):
        open_log(path)
    assert not marker.exists()


def test_a_formula_of_a_signal_costs_that_signal(tmp_path: Path) -> None:
    """The other signals are read, and the formula is named, also within a table of texts."""
    marker = marker_of(tmp_path)
    within = Conversion(7, (1.0,), ("one", evil(marker)))
    content = mf4_conversions.measurement(columns(), {"gap": evil(marker), "accel": within})
    source = read_signals_file(mf4_conversions.write(tmp_path / "x.mf4", content))
    assert [name for name in SIGNALS if name in source.headings] == ["speed", "range_rate"]
    says = "has a formula as its conversion; canid does not evaluate it"
    assert [note.count(says) for note in source.notes] == [2]
    assert not marker.exists()


@pytest.mark.slow("asammdf is started for each file")
@pytest.mark.parametrize("place", ["ID", "t", "gap", "accel"])
def test_a_formula_reaches_no_compiler(place: str, tmp_path: Path) -> None:
    """Of a log or a measurement: below a hook that notes what Python compiles and starts, nothing is noted."""
    marker = marker_of(tmp_path)
    of_log = place in PLACES
    made = mf4_conversions.bus_log if of_log else partial(mf4_conversions.measurement, columns())
    path = mf4_conversions.write(tmp_path / "x.mf4", made({place: evil(marker)}))
    module = "canid.io.logs.mf4.mf4_child" if of_log else "canid.analysis.tables.sources.signals_child"
    assert watched(module, path, tmp_path / "notes") == ""
    assert not marker.exists()
    says = f"channel {place} has a formula as its conversion; canid does not evaluate it"
    if place == "gap":
        with pytest.raises(ConfigError, match=f"gap is missing.*{says}"):
            open_table(path)
    elif place == "accel":
        # the columns that are left are enough
        assert says in " ".join(open_table(path).notes)


@pytest.mark.slow("each place is a file, read by every verb")
@pytest.mark.parametrize("place", PLACES)
def test_every_verb_and_every_place(place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Frames without what the formula stands for are none; a member that no frame needs costs nothing."""
    marker = marker_of(tmp_path)
    path = mf4_conversions.write(tmp_path / "x.mf4", mf4_conversions.bus_log({place: evil(marker)}))
    for words in (
        ["look"],
        ["check"],
        ["identify"],
        ["export", "--dbc", str(DBC), "-o", str(tmp_path / "x.csv")],
    ):
        code = main([words[0], str(path), *words[1:]])
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        if not PLACES[place]:
            assert code == 4
            assert "has a formula as its conversion; canid does not evaluate it" in said.err
            assert len(said.err.splitlines()) == 1
    if PLACES[place]:
        frames = [frame for chunk in open_log(path).columns() for frame in frames_of(chunk)]
        assert len(frames) == PLACES[place]
    assert not marker.exists()


@pytest.mark.slow("the child is started thrice")
def test_a_formula_of_the_time_costs_its_group(tmp_path: Path) -> None:
    """Of a measurement: the group is left out and named; where nothing is left, that is the message."""
    content = mf4_conversions.measurement(columns(), {"t": evil(marker_of(tmp_path))})
    path = mf4_conversions.write(tmp_path / "x.mf4", content)
    with pytest.raises(
        ConfigError, match=r"holds no signals .*channel t has a formula .* all of drive has its times from it"
    ):
        read_signals_file(path)
    assert not marker_of(tmp_path).exists()
    assert main(["identify", str(path)]) == 2


@pytest.mark.long("many or long logs")
def test_the_evaluators_cannot_be_imported(tmp_path: Path) -> None:
    """In a child that reads .mf4, numexpr and sympy are none, whoever asks for them; asammdf has what refuses."""
    code = (
        "from canid.io.logs.mf4 import raw_mdf\n"
        "asammdf = raw_mdf.load()\n"
        "import numexpr\n"
        "from asammdf.blocks import v2_v3_blocks, v4_blocks\n"
        "for function in (numexpr.evaluate, v4_blocks.evaluate, v2_v3_blocks.evaluate):\n"
        "    try:\n"
        "        function('1 + 1')\n"
        "    except ValueError as error:\n"
        "        print(error)\n"
        "print(v4_blocks.lambdify, v2_v3_blocks.lambdify)\n"
        "try:\n"
        "    import sympy\n"
        "except ImportError:\n"
        "    print('no sympy')\n"
    )
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines() == [*["canid evaluates no text of a file"] * 3, "None None", "no sympy"]


# conversions as blocks of a file, and raw numbers
_TABLE = (1.0, 10.0, 2.0, 20.0, 4.0, 80.0)
NUMERIC: dict[str, Conversion] = {
    "linear": Conversion(1, (3.0, 0.5)),
    "identity": Conversion(1, (0.0, 1.0)),
    "rational": Conversion(2, (1.0, 2.0, 3.0, 0.0, 1.0, 4.0)),
    "a factor": Conversion(2, (0.0, 2.0, 0.0, 0.0, 0.0, 4.0)),
    "interpolated": Conversion(4, _TABLE),
    "nearest": Conversion(5, _TABLE),
    "ranges": Conversion(6, (0.0, 1.0, 7.0, 1.0, 3.0, 8.0, 5.0, 6.0, 9.0, -1.0)),
    "values to texts": Conversion(7, (1.0, 2.0), ("one", "two", "many")),
    "values to texts or numbers": Conversion(7, (1.0, 2.0), ("one", "two", Conversion(1, (0.0, 0.1)))),
    "ranges to texts": Conversion(8, (0.0, 1.0, 1.0, 4.0), ("low", "high", "none")),
}
RAW = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 9.0]


def by_asammdf(paths: Mapping[str, Path]) -> dict[str, list[Any]]:
    """What asammdf makes of the signal x of files."""
    code = (
        "import asammdf, json, sys\n"
        "found = {}\n"
        "for name, path in json.loads(sys.argv[1]).items():\n"
        "    samples = asammdf.MDF(path).get('x').samples\n"
        "    found[name] = [s.decode() if isinstance(s, bytes) else float(s) for s in samples.tolist()]\n"
        "print(json.dumps(found))\n"
    )
    words = [
        sys.executable,
        "-W",
        "ignore",
        "-c",
        code,
        json.dumps({name: str(path) for name, path in paths.items()}),
    ]
    ran = subprocess.run(words, capture_output=True, text=True, check=True, timeout=600)
    found: dict[str, list[Any]] = json.loads(ran.stdout)
    return found


@pytest.mark.slow("each conversion is a file, read by two children")
def test_conversions_are_those_of_asammdf(tmp_path: Path) -> None:
    """Numbers, and texts, of every type of conversion in the list, within a few units of the last place."""
    text_cells = [b"one", b"two", b"three", b""]
    paths = {}
    for k, (name, conversion) in enumerate(NUMERIC.items()):
        content = mf4_conversions.measurement(
            {"t": [0.1 * j for j in range(len(RAW))], "x": RAW}, {"x": conversion}
        )
        paths[name] = mf4_conversions.write(tmp_path / f"{k}.mf4", content)
    for name, conversion in {
        "texts to values": Conversion(9, (1.0, 2.0, -1.0), ("one", "two")),
        "texts to texts": Conversion(10, (), ("one", "eins", "two", "zwei", "viele")),
    }.items():
        paths[name] = mf4_conversions.write(
            tmp_path / f"{name}.mf4", mf4_conversions.texts(text_cells, conversion)
        )
    theirs = by_asammdf(paths)
    for name, path in paths.items():
        source = read_signals_file(path)
        assert source.notes == ()
        (block,) = source.blocks([], [list(source.headings).index("x")])
        ours = block.texts[0]
        for mine, other in zip(ours, theirs[name], strict=True):
            if isinstance(other, str):
                assert mine == other, name
            else:
                assert np.isclose(float(mine or "nan"), other, rtol=1e-15, atol=0, equal_nan=True), (
                    name,
                    ours,
                    theirs[name],
                )


class Parameters:
    """A conversion as asammdf holds it."""

    def __init__(self, kind: int, **parameters: Any) -> None:
        self.conversion_type = kind
        self.referenced_blocks: dict[str, Any] = {}
        self.__dict__.update(parameters)


def table(kind: int, rows: list[tuple[float, ...]], names: tuple[str, ...], **more: Any) -> Parameters:
    values = {f"{name}_{k}": x for k, row in enumerate(rows) for name, x in zip(names, row, strict=True)}
    return Parameters(kind, **values, **more)


def test_values_of_each_conversion() -> None:
    """By hand: edges of ranges, the middle between two keys, beyond a table, unsorted keys, texts among numbers."""
    x = np.array([0.0, 1.0, 1.5, 2.0, 9.0])
    pairs = table(4, [(2.0, 20.0), (1.0, 10.0)], ("raw", "phys"), val_param_nr=4)
    assert applied.physical(x, pairs, "x").tolist() == [10.0, 10.0, 15.0, 20.0, 20.0]
    pairs.conversion_type = 5
    assert applied.physical(x, pairs, "x").tolist() == [10.0, 10.0, 10.0, 20.0, 20.0]
    ranges = table(
        6, [(0.0, 1.0, 7.0), (1.0, 2.0, 8.0)], ("lower", "upper", "phys"), val_param_nr=7, default=-1.0
    )
    assert applied.physical(x, ranges, "x").tolist() == [7.0, 8.0, 8.0, -1.0, -1.0]
    # of whole numbers the upper end is inside
    assert applied.physical(np.array([0, 1, 2, 3]), ranges, "x").tolist() == [7.0, 8.0, 8.0, -1.0]
    words = table(7, [(1.0,), (2.0,)], ("val",), val_param_nr=2)
    words.referenced_blocks = {"text_0": b"one\0", "text_1": b"two", "default_addr": None}
    assert applied.physical(np.array([2, 1, 7]), words, "x").tolist() == ["two", "one", ""]
    words.referenced_blocks["default_addr"] = Parameters(1, a=2.0, b=1.0)
    got = applied.physical(np.array([2, 1, 7]), words, "x")
    assert np.isnan(got[:2]).all()
    assert got[2] == 15.0
    assert applied.physical(np.array([], np.uint8), words, "x").tolist() == []
    with pytest.raises(ValueError, match="the table of its conversion is empty"):
        applied.physical(x, Parameters(4, val_param_nr=0), "x")
    with pytest.raises(ValueError, match="its values are none"):
        applied.physical(np.array([b"a"]), Parameters(1, a=2.0, b=1.0), "x")


def test_conversions_that_are_not_in_the_list_are_named() -> None:
    """Formulas anywhere, bit fields, types of later versions; and tables within tables without end."""
    for kind, says in (
        (3, "has a formula as its conversion; canid does not evaluate it"),
        (11, "has a table of bit fields as its conversion; canid does not apply it"),
        (12, "has type 12 as its conversion; canid does not apply it"),
        (255, "has type 255 as its conversion"),
    ):
        with pytest.raises(applied.ConversionError, match=f"channel x {says}"):
            applied.physical(np.array([1, 2]), Parameters(kind, formula="X1 * 2"), "x")
    within = table(8, [(0.0, 5.0)], ("lower", "upper"), val_param_nr=2)
    within.referenced_blocks = {"text_0": Parameters(3, formula="X1"), "default_addr": b""}
    with pytest.raises(applied.ConversionError, match="channel x has a formula"):
        applied.physical(np.array([1]), within, "x")
    within.referenced_blocks["text_0"] = within
    with pytest.raises(ValueError, match="nested too deeply"):
        applied.physical(np.array([1]), within, "x")


@pytest.mark.slow("asammdf is started twice")
def test_another_version_of_the_format_is_named(tmp_path: Path) -> None:
    """MDF 3, whose channels have formulas as well: one line that says so."""
    path = mf4_conversions.write(tmp_path / "x.mf4", b"MDF     3.30    oracle  " + bytes(400))
    with pytest.raises(DamagedLogError, match=r"cannot read .*x\.mf4: it is MDF 3\.30; canid reads MDF 4"):
        open_log(path)
    with pytest.raises(DamagedLogError, match=r"it is MDF 3\.30"):
        read_signals_file(path)
