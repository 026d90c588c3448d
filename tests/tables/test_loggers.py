"""Exports of loggers' programs are read as they are: every row, in SI, and a line that is cut is counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables.sources.vbo import read_vbo
from canid.analysis.tables.table import open_table, trace_of
from canid.models.pipeline import pipeline
from tests.fixtures.measured_logs import MEASURED, needs_measured
from tests.tables import loggers, platoon
from tests.tables.loggers import EXPORTS, Columns


@pytest.fixture(scope="module")
def drive() -> Columns:
    return loggers.columns(platoon.platoon(11, minutes=0.25))


@pytest.mark.parametrize("program", EXPORTS)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_an_export_is_the_drive(tmp_path: Path, drive: Columns, program: str, end: str) -> None:
    """All rows, none damaged, and the columns of the drive in SI."""
    suffix, write = EXPORTS[program]
    path = tmp_path / f"x{suffix}"
    path.write_bytes(write(drive).replace("\n", end).encode())
    table = open_table(path)
    assert (table.damaged, table.log.count.read) == (0, len(drive.t))
    trace = trace_of(table, pipeline.DT)
    inside = slice(5, -15)
    for role, x in {"speed": drive.speed, "gap": drive.gap, "range_rate": drive.rate}.items():
        # times from the first row on; RaceCapture's first is at 0.402 s
        t = trace.t - (0.402 if program == "RaceCapture" else 0.0)
        got = trace.signals[role][inside]
        np.testing.assert_allclose(got, np.interp(t[inside], drive.t, x), atol=0.05, err_msg=role)
    assert table.vehicle.driver.output == "pedal"


@pytest.mark.parametrize("program", EXPORTS)
def test_a_cut_last_row_is_damaged_and_no_other(tmp_path: Path, drive: Columns, program: str) -> None:
    """The file ends within its last row, in front of a delimiter."""
    suffix, write = EXPORTS[program]
    path = tmp_path / f"x{suffix}"
    text = write(drive).rstrip("\n")
    # in front of the last delimiter, and of the quote before it
    cut = max(text.rfind(delimiter) for delimiter in (",", "\t"))
    path.write_text(text[:cut].rstrip('"').rstrip('",0123456789'), encoding="utf-8")
    table = open_table(path)
    assert (table.damaged, table.log.count.read) == (1, len(drive.t) - 1)


def _vbo(of: Columns, lat: str, lon: str, comma: bool) -> str:
    head = "File created on 04/07/2026 at 08:58:54\n\n[header]\nsatellites\ntime\nlatitude\nlongitude\nvelocity kmh\n"
    head += "Pedal\nGap\nRangeRate\n\n[channel units]\n%\nm\nm/s\n\n[column names]\n"
    head += "sats time lat long velocity Pedal Gap RangeRate\n\n[data]\n"
    rows = []
    for t, v, pedal, gap, rate in zip(*of, strict=True):
        stamp = f"0859{t:05.2f}"
        rows.append(f"009 {stamp} {lat} {lon} {v * 3.6:.5f} {pedal:.4f} {gap:.5f} {rate:.5f}")
    body = "\n".join(rows) + "\n"
    return head + (body.replace(".", ",") if comma else body)


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize(
    ("lat", "lon", "place"),
    [
        ("+3120.000000", "-00090.000000", (52.0, 1.5)),  # Racelogic: minutes, positive to the west
        ("+52.0000000", "+001.5000000", (52.0, 1.5)),  # degrees, positive to the east
        ("-02028.2000", "-09072.6000", (-33.8033, 151.21)),
        ("-33.8033333", "+151.2100000", (-33.8033, 151.21)),
        ("+0077.40000", "-06231.0000", (1.29, 103.85)),  # near the equator: the longitude shows it
        ("+0.0000000", "+0.0000000", (0.0, 0.0)),  # no position
        ("+9999.00000", "+99999.0000", None),  # neither
    ],
)
def test_positions_of_a_vbo_are_in_degrees_in_either_form(
    tmp_path: Path, drive: Columns, lat: str, lon: str, place: tuple[float, float] | None, comma: bool
) -> None:
    """Minutes and degrees, north and east positive; what is neither is left out, and said."""
    path = tmp_path / "x.vbo"
    path.write_text(_vbo(drive, lat, lon, comma), encoding="utf-8")
    read = read_vbo(path)
    assert len(read.t) == len(drive.t)
    np.testing.assert_allclose(read.columns["speed"].value, drive.speed * 3.6, atol=1e-4)
    if place is None:
        assert not {"lat", "lon"} & read.columns.keys()
        assert "neither in minutes nor in degrees" in read.notes[0]
        return
    found = read.columns["lat"].value[0], read.columns["lon"].value[0]
    np.testing.assert_allclose(found, place, atol=1e-3)
    note = any("in degrees" in text for text in open_table(path).notes)
    assert note == ("." in lat and abs(float(lat)) < 60 and place != (0.0, 0.0) and place[1] != 103.85)


@pytest.mark.long("many or long tables")
@needs_measured
@pytest.mark.parametrize("name", ["aim.csv", "motec.csv", "rc_1.csv"])
def test_measured_exports_have_all_rows(name: str) -> None:
    """3,000 rows at 21.7 to 28.3 m/s."""
    folder = MEASURED / "reports" / "51-track-loggers"
    table = open_table(folder / name)
    trace = trace_of(table, pipeline.DT)
    assert (table.damaged, table.log.count.read) == (0, 3000)
    speed = trace.signals["gnss_speed" if name == "aim.csv" else "speed"]
    assert (round(float(np.nanmin(speed)), 1), round(float(np.nanmax(speed)), 1)) == (21.7, 28.3)


@needs_measured
@pytest.mark.parametrize(("name", "rows"), [("comma", 3000), ("cut", 2999), ("degrees", 3000)])
def test_measured_vbo_files_are_where_they_were_driven(name: str, rows: int) -> None:
    """52.0 N, 1.5 E at the first row."""
    path = MEASURED / "reports" / "49-vbo" / f"{name}.vbo"
    read = read_vbo(path)
    assert (len(read.t), read.lines.bad) == (rows, 3000 - rows)
    assert read.columns["lat"].value[0] == pytest.approx(52.0, abs=1e-6)
    assert read.columns["lon"].value[0] == pytest.approx(1.5, abs=1e-4)
    assert open_table(path).damaged == 3000 - rows


@pytest.mark.parametrize("gap", ["ft", "m"])
def test_units_above_the_names(tmp_path: Path, drive: Columns, gap: str) -> None:
    """As below them: without them a slow drive in km/h would be one in m/s."""
    factor = {"ft": 0.3048, "m": 1.0}[gap]
    lines = [f"s,km/h,%,{gap},m/s", "Time,Speed,Pedal,Gap,RangeRate"]
    for t, v, pedal, distance, rate in zip(*drive, strict=True):
        lines.append(f"{t:.1f},{v * 3.6:.6f},{pedal:.6f},{distance / factor:.6f},{rate:.6f}")
    path = tmp_path / "x.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    signals = trace_of(open_table(path), pipeline.DT).signals
    inside = slice(25, -25)
    t = 0.1 * np.arange(len(signals["speed"]))[inside]
    np.testing.assert_allclose(signals["speed"][inside], np.interp(t, drive.t, drive.speed), atol=0.05)
    np.testing.assert_allclose(signals["gap"][inside], np.interp(t, drive.t, drive.gap), atol=0.05)
