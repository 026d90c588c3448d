"""Files of `canid export`: complete or absent, never over a file of another kind, harmless for any names in a DBC."""

from __future__ import annotations

import csv
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

from canid.analysis.drive.signal_columns import MessageFrames, MessageKey
from canid.analysis.export import csv_table, mcap_file, names, signal_tables
from canid.analysis.export.table import Field, Origin, of_columns
from canid.io.logs import write_log
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import Dbc
from canid.values.errors import DAMAGED, DONE, NOT_WRITTEN, USAGE
from canid.values.shipped_files import shipped
from canid.values.types import Frame

ROOT = Path(__file__).parents[2]
# name of the file -> format
SINGLE = {
    "x.mat": "mat",
    "x.mf4": "mf4",
    "x.mcap": "mcap",
    "x.vbo": "vbo",
    "x.plotjuggler.xml": "plotjuggler",
}
TABLES = {"x.samples.csv": "csv", "x.signals.EGO_SPEED.csv": "csv", "x.samples.parquet": "parquet"}


def words(log: Path, to: str, folder: Path) -> list[object]:
    signals = ("--signals", "EGO_SPEED") if to in ("csv", "parquet") else ()
    part = ("--stop", 6, "--estimates", "none")
    return ["export", log, "--vehicle", "generic", "--to", to, "-o", folder / "x", *part, *signals]


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize(("name", "to"), (SINGLE | TABLES).items())
def test_only_a_file_of_the_same_kind_is_replaced(
    canid: Callable[..., Any], log: Path, tmp_path: Path, name: str, to: str
) -> None:
    """What lies under the name: text and a recording stay with --force too; an earlier export is replaced with it alone."""
    path = tmp_path / name
    for foreign in (b"my notes\n", log.read_bytes()[:5000]):
        path.write_bytes(foreign)
        for force in ((), ("--force",)):
            ran = canid(*words(log, to, tmp_path), *force)
            assert ran.code == NOT_WRITTEN, ran.err
            assert name in ran.err
            assert path.read_bytes() == foreign
            assert [p.name for p in tmp_path.iterdir()] == [name]
    path.unlink()
    assert canid(*words(log, to, tmp_path)).code == DONE
    before = path.read_bytes()
    assert canid(*words(log, to, tmp_path)).code == NOT_WRITTEN
    assert path.read_bytes() == before
    path.chmod(0o640)
    assert canid(*words(log, to, tmp_path), "--force").code == DONE
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("to", ["csv", "parquet", "mat", "mf4", "mcap"])
def test_a_full_disk_leaves_no_file(log: Path, tmp_path: Path, to: str) -> None:
    """Files may not grow beyond 20 kB, as on a full disk: exit 5, a line that says it, nothing is left."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    full = ["export", log, "--vehicle", "generic", "--to", to, "-o", tmp_path / "x", "--estimates", "none"]
    # signals repeat their numbers: they fit even into 20 kB of Parquet
    full += ["--dt", 0.001] if to == "parquet" else ["--signals"]
    ran = subprocess.run(
        [sys.executable, "-m", "canid", *map(str, full)],
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "TMPDIR": "/dev/shm"},
        cwd=tmp_path,
        preexec_fn=limit,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == NOT_WRITTEN, ran.stderr
    assert "cannot be written" in ran.stderr
    assert "Traceback" not in ran.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow("whole commands, one after the other")
def test_an_interrupted_export_leaves_no_file(log: Path, tmp_path: Path) -> None:
    """SIGTERM while the files are written: exit 143, and not one of them is there."""
    script = (
        "import os, signal, sys, time\n"
        "from canid.analysis.export import mcap_file\n"
        "whole = mcap_file.messages\n"
        "def slow(*of):\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "    return whole(*of)\n"
        "mcap_file.messages = slow\n"
        "from canid.ui.cli import main\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script, *map(str, words(log, "mcap", tmp_path))],
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 143, ran.stderr
    assert list(tmp_path.iterdir()) == []


EVIL = ("=HYPERLINK(1)", "../../up", "a\x1b[2J\nb", "end", "A", "a", "τ", "@x", 'q"uo,te', "")


def hostile() -> tuple[Dbc, dict[MessageKey, MessageFrames]]:
    """A message for each evil name, with signals of all these names, units and texts."""
    signals = tuple(
        Signal(name, k, 1, False, False, False, 1.0, 0.0, None, None, name, {1: name or "x"}, False, None, ())
        for k, name in enumerate(EVIL[:8])
    )
    messages = {name: Message(name, k, False, 8, 0.1, signals) for k, name in enumerate(EVIL)}
    frames = MessageFrames(np.array([0.0, 0.1]), np.full(2, 8, np.uint8), np.full((2, 8), 255, np.uint8))
    return Dbc("evil.dbc", None, messages), {MessageKey(0, k, False): frames for k in range(len(EVIL))}


def test_hostile_names_are_harmless(tmp_path: Path) -> None:
    """No path, no formula, no control character, no two files or variables of one name; all values are there."""
    database, frames = hostile()
    tables = signal_tables.signal_tables(signal_tables.received(frames, [database]))
    assert len(tables) == len(EVIL)
    parts = names.unique([table.title for table in tables], names.file_part)
    assert len({part.lower() for part in parts}) == len(parts)
    for part in parts:
        assert part.isascii()
        assert not set(part) & set('/\\\x1b\n:*?"<>| ')
        assert ".." not in part
    for table in tables:
        rows = list(
            csv.reader(b"".join(csv_table.lines(table, Origin("x", None))).decode().split("\r\n")[:-1])
        )
        assert len(rows) == 3
        assert len({len(row) for row in rows}) == 1
        assert len(set(rows[0])) == len(rows[0])
        for cell in rows[0] + rows[1]:
            assert not cell.startswith(("=", "+", "-", "@", "\t", "\r"))
        assert all(cell.isprintable() for cell in rows[0])
        message = json.loads(mcap_file.messages(table, slice(None))[0])
        assert message["=HYPERLINK(1)"] == 1.0
    from canid.analysis.export import mat_file

    path = tmp_path / "x.mat"
    with path.open("w+b") as file:
        mat_file.write(file, tables, Origin("x", None, "car"))
    found = {name: value for name, value in loadmat(path, simplify_cells=True).items() if name[0] != "_"}
    assert len(found) == len(EVIL) + 1
    for name in found:
        assert name.isidentifier()
        assert name.isascii()
    struct = found["x_HYPERLINK_1_"]
    assert set(struct["names"].values()) == set(EVIL[:8])


def test_several_buses_and_an_id_that_is_defined_twice() -> None:
    """The same message on two buses makes two tables that name the bus; a file that is bound to a bus counts there."""
    signal = Signal("Speed", 0, 8, False, False, False, 1.0, 0.0, None, None, "m/s", {}, False, None, ())
    plain, bound = (
        Message("SPEED", 5, False, 1, 0.1, (signal,)),
        Message("OTHER", 5, False, 1, 0.1, (signal,)),
    )
    files = [Dbc("a.dbc", None, {"SPEED": plain}), Dbc("b.dbc", 2, {"OTHER": bound})]
    frames = {
        MessageKey(bus, 5, False): MessageFrames(
            np.array([0.2, 0.1]),
            np.ones(2, np.uint8),
            np.array([[bus] + [0] * 7, [bus + 10] + [0] * 7], np.uint8),
        )
        for bus in (0, 1, 2)
    }
    tables = {t.name: t for t in signal_tables.signal_tables(signal_tables.received(frames, files))}
    assert list(tables) == ["SPEED.bus0", "SPEED.bus1", "OTHER"]
    # rows in the order of time, whatever their order in the log
    assert tables["SPEED.bus1"].t.tolist() == [0.1, 0.2]
    assert tables["SPEED.bus1"].values(slice(None))[0].tolist() == [11.0, 1.0]


def test_a_log_without_a_date_has_no_absolute_time(canid: Callable[..., Any], tmp_path: Path) -> None:
    """--time utc: one line that says so, exit 2; the other formats begin at zero, and say it."""
    log = tmp_path / "undated.log"
    write_log(log, [Frame(k * 0.01, 0, 0x120, bytes(6)) for k in range(100)])
    dbc = ("--dbc", shipped() / "generic.dbc")
    ran = canid("export", log, *dbc, "--time", "utc", "-o", tmp_path / "x")
    assert (ran.code, "states no date" in ran.line, "--time log" in ran.line) == (USAGE, True, True)
    ran = canid("export", log, *dbc, "--to", "mat", "-o", tmp_path / "x.mat")
    assert ran.code == DONE
    assert "states no date" in ran.err
    assert len(loadmat(tmp_path / "x.mat", simplify_cells=True)["info"]["start_utc"]) == 0
    ran = canid("export", log, *dbc, "--signals", "EGO_SPED*", "-o", tmp_path / "y")
    assert ran.code == USAGE
    assert "did you mean" in ran.line
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith("y")] == []


def test_damage_is_said_and_the_rest_exported(canid: Callable[..., Any], log: Path, tmp_path: Path) -> None:
    """Half a log: exit 4, and the signals up to there."""
    half = tmp_path / "half.blf"
    half.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    ran = canid("export", half, "--dbc", shipped() / "generic.dbc", "--to", "mat", "-o", tmp_path / "x")
    assert ran.code == DAMAGED, ran.err
    assert len(loadmat(tmp_path / "x.mat", simplify_cells=True)["EGO_SPEED"]["t"]) > 100


def test_csv_of_odd_numbers(seed: int) -> None:
    """Any double comes back to the last bit; infinities are text that float() reads; NaN is empty."""
    random = np.random.default_rng(seed)
    values = random.integers(0, 2**64, 20_000, dtype=np.uint64).view(np.float64)
    values[:4] = [np.inf, -np.inf, np.nan, -0.0]
    for column in (values, np.where(np.isfinite(values), values, np.nan)):
        table = of_columns("samples", "", np.arange(20_000) * 0.001, [(Field("x"), column)])
        cells = [
            row.split(b",")[1]
            for row in b"".join(csv_table.lines(table, Origin("x", None))).split(b"\r\n")[1:-1]
        ]
        read = np.array([float(cell) if cell else np.nan for cell in cells])
        np.testing.assert_array_equal(read, column)
        assert np.signbit(read[3])
