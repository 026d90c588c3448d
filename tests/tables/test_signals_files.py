"""Decoded signals in .mf4 and MCAP are tables: the readings that the same columns give as CSV."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables import kinds
from canid.analysis.tables.table import Table, open_table
from canid.signals.vehicle import decoder
from canid.ui.cli import main
from canid.values.errors import ConfigError, LogError
from tests.exact import exact

_START_S = 1_700_000_000
# an .mf4 of two groups of other rates, as a measurement system writes it; asammdf stays out of this process
_WRITE_MF4 = """
import sys, numpy as np, asammdf
from datetime import UTC, datetime
file = asammdf.MDF(version="4.10")
file.header.start_time = datetime.fromtimestamp(1_700_000_000, UTC)
k = np.arange(200)
own, lead = k * 0.05, k * 0.1 + 0.02
made = asammdf.Signal
file.append([made(20.0 + k % 7, own, name="speed", unit="m/s"), made(0.1 * (k % 5), own, name="accel", unit="m/s2"),
             made(np.array([b"off", b"on"])[k // 100], own, name="cruise_active", encoding="utf-8")], acq_name="own")
file.append([made(30.0 + k % 9, lead, name="gap", unit="m"), made(0.5 * (k % 3), lead, name="range_rate", unit="m/s")],
            acq_name="radar")
file.save(sys.argv[1], overwrite=True)
"""


def _csv(path: Path) -> Path:
    rows = [
        (0.05 * k, f"{0.05 * k:.3f},{20.0 + k % 7},{0.1 * (k % 5)!r},{'on' if k >= 100 else 'off'},,")
        for k in range(200)
    ]
    rows += [(0.1 * k + 0.02, f"{0.1 * k + 0.02:.3f},,,,{30.0 + k % 9},{0.5 * (k % 3)}") for k in range(200)]
    head = "time,speed [m/s],accel [m/s2],cruise_active,gap [m],range_rate [m/s]"
    path.write_text("\n".join([head, *(text for _, text in sorted(rows))]) + "\n", encoding="utf-8")
    return path


def _mf4(path: Path) -> Path:
    pytest.importorskip("asammdf", reason="asammdf is not installed: pip install canid[mf4]")
    subprocess.run([sys.executable, "-W", "ignore", "-c", _WRITE_MF4, str(path)], check=True, timeout=600)
    return path


def _mcap(path: Path, encoding: str = "json") -> Path:
    writer_of = pytest.importorskip("mcap.writer", reason="mcap is not installed: pip install canid[export]")
    with path.open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        own, radar = (writer.register_channel(name, encoding, schema) for name in ("/own", "/radar"))
        for k in range(200):
            row = {
                "speed": 20.0 + k % 7,
                "accel": 0.1 * (k % 5),
                "cruise_active": "on" if k >= 100 else "off",
            }
            ns = _START_S * 10**9 + k * 50_000_000
            writer.add_message(own, ns, json.dumps(row).encode(), ns)
            ns = _START_S * 10**9 + k * 100_000_000 + 20_000_000
            writer.add_message(
                radar, ns, json.dumps({"gap": 30.0 + k % 9, "range_rate": 0.5 * (k % 3)}).encode(), ns
            )
        writer.finish()
    return path


def _readings(table: Table) -> dict[str, tuple[list[float], list[float]]]:
    init, step = decoder(table.vehicle)
    state = init()
    found: dict[str, tuple[list[float], list[float]]] = {}
    for chunk in table.log.columns():
        state, decoded = step(state, chunk)
        for one in decoded.roles:
            t, values = found.setdefault(one.role, ([], []))
            t += np.round(chunk.t[one.row], 6).tolist()
            values += one.value.tolist()
    return dict(sorted(found.items()))


@pytest.mark.slow("whole drives through the pipeline")
@pytest.mark.parametrize("write", [_mf4, _mcap])
def test_signals_by_name_are_the_columns_of_a_csv(write: object, tmp_path: Path) -> None:
    """Values and times of two rates, texts included, and the start in UTC."""
    assert callable(write)
    path = write(tmp_path / f"x{'.mf4' if write is _mf4 else '.mcap'}")
    assert kinds.is_table(path)
    table, csv = open_table(path), open_table(_csv(tmp_path / "x.csv"))
    assert exact(_readings(table)) == exact(_readings(csv))
    assert table.log.start_utc == pytest.approx(_START_S)
    assert not any("not in the order" in note for note in table.notes)


@pytest.mark.slow("whole drives through the pipeline")
def test_a_verb_that_needs_frames_says_what_the_file_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`look` of a measurement of signals: exit code 2, what it holds and what reads it."""
    path = _mf4(tmp_path / "x.mf4")
    assert main(["look", str(path)]) == 2
    said = capsys.readouterr().err
    assert "is a measurement of decoded signals (speed, accel, cruise_active, gap, range_rate)" in said
    assert "identify and diagnose read it as a table" in said


def test_other_encodings_and_broken_files_are_refused(tmp_path: Path) -> None:
    """MCAP of protobuf and a file that is none: one line that says so."""
    with pytest.raises(LogError, match=r"its messages are protobuf, and not json"):
        open_table(_mcap(tmp_path / "x.mcap", "protobuf"))
    broken = tmp_path / "y.mcap"
    broken.write_bytes(b"no mcap" * 100)
    with pytest.raises((LogError, ConfigError), match=r"y\.mcap"):
        open_table(broken)


def test_one_name_in_two_topics_is_told_apart(tmp_path: Path) -> None:
    """A name of two topics has the topic before it, and a column map names it."""
    writer_of = pytest.importorskip("mcap.writer", reason="mcap is not installed: pip install canid[export]")
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        for name, v in (("/own", 20.0), ("/other", 30.0)):
            channel = writer.register_channel(name, "json", schema)
            for k in range(20):
                writer.add_message(channel, k * 10**8, json.dumps({"state": {"v": v}}).encode(), k * 10**8)
        writer.finish()
    with pytest.raises(ConfigError, match=r"it has time, /own\.state\.v, /other\.state\.v"):
        open_table(path)
