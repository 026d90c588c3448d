"""Each format of `canid export`, read back by its own library: the numbers of canid, with units and absolute time."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import cantools
import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pytest
from mcap.reader import make_reader
from scipy.io import loadmat

from canid import read_trace
from canid.analysis.tables.sources.vbo import read_vbo
from canid.io.logs import open_log, write_log
from canid.ui.cli import main
from canid.values.shipped_files import shipped
from canid.values.types import Frame, Trace

ROOT = Path(__file__).parents[2]
# s since 1970: an instant that no simulated drive has
START = 1_533_224_087.25
START_NS = 1_533_224_087_250_000_000
SECONDS = 50.0


class Drive(NamedTuple):
    log: Path
    trace: Trace
    folder: Path
    # "MESSAGE.SIGNAL" -> times and values by cantools, frame by frame
    signals: dict[str, tuple[np.ndarray, np.ndarray]]
    texts: dict[str, list[str | None]]  # of value tables


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    """A part of a drive whose radar loses its target; exported once in every format."""
    folder = tmp_path_factory.mktemp("export")
    log = folder / "lost.blf"
    source = open_log(ROOT / "replay_logs/following_lost_lead.blf")
    write_log(log, (f for f in source if f.t < SECONDS), START)
    database = cantools.database.load_file(shipped() / "generic.dbc", strict=False)
    assert isinstance(database, cantools.database.Database)
    rows: dict[str, list[tuple[float, float, str | None]]] = {}
    for frame in open_log(log):
        message = database.get_message_by_frame_id(frame.id)
        numbers = message.decode(frame.data, decode_choices=False)
        named = message.decode(frame.data)
        for name, value in numbers.items():
            text = (
                str(named[name])
                if isinstance(named[name], cantools.database.namedsignalvalue.NamedSignalValue)
                else None
            )
            rows.setdefault(f"{message.name}.{name}", []).append((frame.t, float(value), text))
    signals = {
        name: (np.array([r[0] for r in of]), np.array([r[1] for r in of])) for name, of in rows.items()
    }
    texts = {name: [r[2] for r in of] for name, of in rows.items()}
    for to in ("csv", "parquet", "mat", "mf4", "mcap"):
        time = ("--time", "utc") if to in ("csv", "parquet") else ()
        words = ("export", log, "--vehicle", "generic", "--to", to, "-o", folder / "x", "--signals", *time)
        assert main([str(word) for word in words]) == 0
    for to in ("vbo", "plotjuggler"):
        assert main(["export", str(log), "--vehicle", "generic", "--to", to, "-o", str(folder / "x")]) == 0
    return Drive(log, read_trace(log, "generic"), folder, signals, texts)


def equal(got: Any, wanted: Any, what: str = "") -> None:
    """To the last bit of a double, or two: cantools multiplies in another order."""
    np.testing.assert_allclose(np.asarray(got, dtype=float), wanted, rtol=1e-14, atol=1e-14, err_msg=what)


def utc(t: np.ndarray) -> np.ndarray:
    stamps: np.ndarray = np.array(START_NS + np.rint(t * 1e9).astype(np.int64), dtype="datetime64[ns]")
    return stamps


@pytest.mark.slow("whole commands, one after the other")
def test_csv_by_pandas(drive: Drive) -> None:
    """Samples are those of `read_trace`, signals those of cantools; header with units, NaN empty, UTC in ns."""
    table = pd.read_csv(drive.folder / "x.samples.csv", parse_dates=["utc"])
    trace = drive.trace
    assert np.isnan(trace.signals["gap"]).any()
    for role, values in trace.signals.items():
        column = next(name for name in table if re.fullmatch(rf"{role}( \[.*\])?", name))
        equal(table[column], values, role)
    assert {"t [s]", "gap [m]", "pedal [%]", "yaw_rate [rad/s]", "headway [s]", "gate", "learn"} <= set(table)
    equal(table["output [%]"], trace.output)
    assert table["gate"].tolist() == [gate.name.lower() for gate in trace.gate]
    np.testing.assert_array_equal(table["utc"].dt.tz_convert(None).to_numpy("datetime64[ns]"), utc(trace.t))
    radar = pd.read_csv(drive.folder / "x.signals.RADAR_LEAD.csv")
    t, distance = drive.signals["RADAR_LEAD.LeadDistance"]
    equal(radar["t [s]"], np.round(t, 9))
    equal(radar["LeadDistance [m]"], distance)
    texts = [None if text != text else text for text in radar["LeadDistance text"]]
    assert texts == drive.texts["RADAR_LEAD.LeadDistance"]
    assert "no target" in texts
    # of a multiplexed message: empty in the frames of other pages
    gnss = pd.read_csv(drive.folder / "x.signals.GNSS_DATA.csv")
    here = gnss["Latitude [deg]"].notna()
    assert 0 < here.sum() < len(gnss)
    equal(gnss["Latitude [deg]"][here], drive.signals["GNSS_DATA.Latitude"][1])
    raw = (drive.folder / "x.samples.csv").read_bytes()
    assert raw.count(b"\r\n") == raw.count(b"\n") == len(trace.t) + 1


@pytest.mark.slow("whole commands, one after the other")
def test_parquet_by_polars_and_duckdb(drive: Drive) -> None:
    """Plain column names, NULL for what was not measured; units and the UTC start in the file's metadata."""
    table = pl.read_parquet(drive.folder / "x.samples.parquet")
    for role, values in drive.trace.signals.items():
        np.testing.assert_array_equal(table[role].to_numpy(), values, err_msg=role)
        assert table[role].is_nan().sum() == 0  # NULL, not NaN
    np.testing.assert_array_equal(table["utc"].to_numpy(), utc(drive.trace.t))
    signals = pl.read_parquet(drive.folder / "x.signals.EGO_SPEED.parquet")
    equal(signals["VehicleSpeed"], drive.signals["EGO_SPEED.VehicleSpeed"][1])
    with duckdb.connect() as db:
        path = drive.folder / "x.signals.EGO_SPEED.parquet"
        rows = db.execute(f"SELECT key, value FROM parquet_kv_metadata('{path}')").fetchall()
    metadata = {key.decode(): value.decode() for key, value in rows}
    assert json.loads(metadata["units"])["VehicleSpeed"] == "km/h"
    assert (metadata["start_utc"], metadata["start_ns"]) == ("2018-08-02T15:34:47.250000000Z", str(START_NS))


@pytest.mark.slow("whole commands, one after the other")
def test_mat_by_scipy(drive: Drive) -> None:
    """A struct for each table with units, texts of value tables, and the start in `info`."""
    found = loadmat(drive.folder / "x.mat", simplify_cells=True)
    samples = found["samples"]
    for role, values in drive.trace.signals.items():
        np.testing.assert_array_equal(samples[role], values, err_msg=role)
    assert (samples["units"]["gap"], samples["units"]["t"]) == ("m", "s")
    equal(found["CHASSIS_DATA"]["YawRate"], drive.signals["CHASSIS_DATA.YawRate"][1])
    assert found["ENGINE_DATA"]["texts"]["Gear"]["text"][1] == "1st"
    assert found["ENGINE_DATA"]["texts"]["Gear"]["value"][1] == 1
    assert (found["info"]["start_utc"], found["info"]["start_epoch"]) == (
        "2018-08-02T15:34:47.250000000Z",
        START,
    )
    assert {"armax", "fopdt"} == set(found["estimates"]["estimator"])


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.filterwarnings("ignore")  # of asammdf
def test_mf4_by_asammdf(drive: Drive) -> None:
    """A group for each table; every channel with unit and comment, the start to the nanosecond."""
    import asammdf

    with asammdf.MDF(drive.folder / "x.mf4") as file:
        assert file.header.abs_time == START_NS
        assert file.header.start_time.astimezone(UTC) == datetime.fromtimestamp(START, UTC)
        groups = {group.channel_group.acq_name: k for k, group in enumerate(file.groups)}
        for role, values in drive.trace.signals.items():
            signal = file.get(role, group=groups["samples"])
            np.testing.assert_array_equal(signal.samples, values, err_msg=role)
        gap = file.get("gap", group=groups["samples"])
        assert (gap.unit, gap.comment) == ("m", "distance to the vehicle ahead, bumper to bumper")
        np.testing.assert_array_equal(gap.timestamps, np.round(drive.trace.t, 9))
        speed = file.get("VehicleSpeed", group=groups["signals.EGO_SPEED"])
        equal(speed.samples, drive.signals["EGO_SPEED.VehicleSpeed"][1])
        equal(speed.timestamps, drive.signals["EGO_SPEED.VehicleSpeed"][0])
        text = file.get("LeadDistance text", group=groups["signals.RADAR_LEAD"]).samples
        assert [t.decode() or None for t in text] == drive.texts["RADAR_LEAD.LeadDistance"]
        assert "estimates.fopdt.range_rate" in groups


@pytest.mark.slow("whole commands, one after the other")
def test_mcap_by_its_reader(drive: Drive) -> None:
    """JSON messages that fit their schemas, in the order of time, with log times in ns UTC; nothing where NaN."""
    import jsonschema

    rows: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    schemas, last = {}, 0
    with (drive.folder / "x.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            schemas[channel.topic] = json.loads(schema.data)
            rows.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
            assert message.log_time >= last
            last = message.log_time
    for topic, schema in schemas.items():
        for _, row in rows[topic][:50]:
            jsonschema.validate(row, schema)
            assert set(row) <= set(schema["properties"])
    samples = rows["/samples"]
    for role, values in drive.trace.signals.items():
        np.testing.assert_array_equal([row.get(role, np.nan) for _, row in samples], values, err_msg=role)
    np.testing.assert_array_equal([ns for ns, _ in samples], utc(drive.trace.t).astype(np.int64))
    equal(
        [row["VehicleSpeed"] for _, row in rows["/signals/EGO_SPEED"]],
        drive.signals["EGO_SPEED.VehicleSpeed"][1],
    )
    assert "unit: km/h" in schemas["/signals/EGO_SPEED"]["properties"]["VehicleSpeed"]["description"]
    assert any({"K", "K_low", "K_high"} <= set(row) for _, row in rows["/estimates/fopdt/range_rate"])


def strict_vbo(raw: bytes) -> tuple[list[str], list[str], list[str], np.ndarray]:
    """Titles, units, names and rows of a .vbo, by the letter of Racelogic's description."""
    assert re.match(rb"File created on \d\d/\d\d/\d{4} at \d\d:\d\d:\d\d\r\n\r\n\[header\]\r\n", raw)
    assert raw.count(b"\n") == raw.count(b"\r\n")
    text = raw.decode()
    parts = re.split(r"^\[(header|channel units|comments|column names|data)\]\r\n", text, flags=re.M)
    assert parts[1::2] == ["header", "channel units", "comments", "column names", "data"]
    assert all(part.endswith("\r\n\r\n") for part in parts[:-1:2])  # a blank line between sections
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    titles, names = sections["header"].split("\r\n")[:-2], sections["column names"].split()
    units = sections["channel units"].removesuffix("\r\n").split("\r\n")[:-1]
    row = re.compile(
        r"\d{3} \d{6}\.\d{3} [+-]\d{5}\.\d+ [+-]\d{5}\.\d+ \d{3,}\.\d+ \d{3}\.\d\d [+-]\d+\.\d\d"
        r"( ([+-]\d\.\d+E[+-]\d\d|NaN))*"
    )
    lines = sections["data"].removesuffix("\r\n").split("\r\n")
    assert all(row.fullmatch(line) for line in lines)
    return titles, units, names, np.array([[float(cell) for cell in line.split(" ")] for line in lines])


@pytest.mark.slow("whole commands, one after the other")
def test_vbo_by_a_strict_reader_and_by_canid(drive: Drive) -> None:
    """Minutes, west positive, UTC since midnight, km/h; a unit for each other channel; read again as it was."""
    path = drive.folder / "x.vbo"
    titles, units, names, rows = strict_vbo(path.read_bytes())
    assert titles[:7] == ["satellites", "time", "latitude", "longitude", "velocity kmh", "heading", "height"]
    assert names[:7] == ["sats", "time", "lat", "long", "velocity", "heading", "height"]
    assert len(titles) == len(names) == rows.shape[1]
    assert len(units) == len(names) - 7
    assert units[names.index("gap") - 7] == "m"
    signals = drive.trace.signals
    here = np.isfinite(signals["lat"]) & np.isfinite(signals["lon"])
    np.testing.assert_allclose(rows[:, 2], 60.0 * signals["lat"][here], atol=1e-7)
    np.testing.assert_allclose(rows[:, 3], -60.0 * signals["lon"][here], atol=1e-7)
    np.testing.assert_allclose(rows[:, 4], 3.6 * signals["speed"][here], atol=1e-3)
    t = drive.trace.t[here]
    assert f"{rows[0, 1]:010.3f}" == f"{datetime.fromtimestamp(START + t[0], UTC):%H%M%S.%f}"[:10]
    found = read_vbo(path)
    np.testing.assert_allclose(found.t, t - t[0], atol=1e-3)
    np.testing.assert_allclose(found.start_utc, START + t[0], atol=1e-3)
    for name, factor in (("lat", 1.0), ("lon", 1.0), ("gap", 1.0), ("speed", 3.6)):
        np.testing.assert_allclose(
            found.columns[name].value, factor * signals[name][here], atol=1e-3, err_msg=name
        )
    assert (found.columns["speed"].unit, found.columns["gap"].unit) == ("km/h", "m")
    assert np.isnan(found.columns["gap"].value).any()


def test_a_vehicle_without_positions_has_no_vbo(
    canid: Callable[..., Any], drive: Drive, tmp_path: Path
) -> None:
    """One line that says what to map; exit 2; no file."""
    text = (shipped() / "generic.toml").read_text()
    (tmp_path / "car.toml").write_text(
        "".join(x for x in text.splitlines(True) if not x.startswith(("lat ", "lon ")))
    )
    (tmp_path / "generic.dbc").write_bytes((shipped() / "generic.dbc").read_bytes())
    ran = canid("export", drive.log, "--vehicle", tmp_path / "car.toml", "--to", "vbo", "-o", tmp_path / "x")
    assert ran.code == 2
    assert "map lat and lon (deg)" in ran.line
    assert not list(tmp_path.glob("*.vbo"))


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("data", ["csv", "parquet", "mcap"])
def test_the_plotjuggler_layout_names_curves_of_its_data(
    drive: Drive, tmp_path: Path, data: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Well-formed; every curve is a column of the file that it opens, the time axis too; K and τ+θ have both ends."""
    name = tmp_path / "x"
    assert (
        main(
            [
                "export",
                str(drive.log),
                "--vehicle",
                "generic",
                "--to",
                "plotjuggler",
                "--data",
                data,
                "-o",
                str(name),
            ]
        )
        == 0
    )
    assert "plotjuggler.xml: how they are shown" in capsys.readouterr().err
    layout = ElementTree.parse(tmp_path / "x.plotjuggler.xml").getroot()
    file = layout.find("previouslyLoaded_Datafiles/fileInfo")
    assert file is not None
    path = tmp_path / file.attrib["filename"]
    if data == "csv":
        with path.open(newline="") as opened:
            columns = set(next(csv.reader(opened)))
        parameters = file.find("plugin/parameters")
        assert parameters is not None
        assert parameters.attrib["time_axis"] in columns
    elif data == "parquet":
        columns = set(pl.read_parquet_schema(path))
        time = file.find("plugin/time_column")
        assert time is not None
        assert time.attrib["name"] in columns
    else:
        with path.open("rb") as opened_binary:
            messages = list(make_reader(opened_binary).iter_messages())
        columns = {f"{channel.topic}/{key}" for _, channel, m in messages for key in json.loads(m.data)}
    curves = [curve.attrib["name"] for curve in layout.iter("curve")]
    assert set(curves) <= columns
    tabs = [tab.attrib["tab_name"] for tab in layout.iter("Tab")]
    assert {"K", "tau + dead time", "output and prediction", "gap and range rate"} <= set(tabs)
    for curve in (
        "fopdt/range_rate/K",
        "fopdt/range_rate/tau_plus_dead_time",
        "prediction",
        "gap",
        "range_rate",
    ):
        assert any(curve in shown for shown in curves), curve
    assert sum("fopdt/range_rate/K_" in shown for shown in curves) == 2


def test_a_raster_holds_the_last_value(canid: Callable[..., Any], drive: Drive, tmp_path: Path) -> None:
    """One table; at each instant the last value that had come, NaN before the first, texts with them."""
    words = ("export", drive.log, "--vehicle", "generic", "--estimates", "none", "-o", tmp_path / "x")
    ran = canid(*words, "--signals", "RADAR_*", "gnss_data.lat*", "--raster", 0.05, "--json", "-")
    assert ran.code == 0, ran.err
    assert [Path(file["path"]).name for file in json.loads(ran.out)] == ["x.samples.csv", "x.signals.csv"]
    table = pd.read_csv(tmp_path / "x.signals.csv")
    grid = table["t [s]"].to_numpy()
    np.testing.assert_allclose(np.diff(grid), 0.05)
    for name, column in (
        ("RADAR_LEAD.LeadDistance", "RADAR_LEAD.LeadDistance [m]"),
        ("GNSS_DATA.Latitude", "GNSS_DATA.Latitude [deg]"),
    ):
        t, values = drive.signals[name]
        held = [values[t <= at][-1] if (t <= at).any() else np.nan for at in grid]
        equal(table[column], held, name)
    assert np.isnan(table["GNSS_DATA.Latitude [deg]"].to_numpy()[0])
    assert not any("EGO_SPEED" in name for name in table)
    radar = table[table["RADAR_LEAD.LeadDistance text"] == "no target"]
    assert len(radar) > 10


def test_a_raster_holds_no_value_for_more_than_5_s(canid: Callable[..., Any], tmp_path: Path) -> None:
    """A sender that falls silent leaves empty fields 5 s later, a slow one has none; the metadata say it."""
    frames = [Frame(0.1 * k, 0, 0x120, bytes(8)) for k in range(300) if not 60 <= k < 200]
    frames += [Frame(0.02 + 4.9 * k, 0, 0x110, bytes(8)) for k in range(6)]
    log = tmp_path / "x.blf"
    write_log(log, sorted(frames, key=lambda frame: frame.t), start_utc=1.7e9)
    words = ("export", log, "--dbc", shipped() / "generic.dbc", "--signals", "--raster", 0.05)
    assert canid(*words, "-o", tmp_path / "x").code == 0
    table = pd.read_csv(tmp_path / "x.signals.csv")
    t = table["t [s]"].to_numpy()
    columns = {each.partition(".")[0]: table[each].to_numpy() for each in table.columns if each.endswith("]")}
    silent, slow = columns["EGO_SPEED"], columns["ENGINE_DATA"]
    np.testing.assert_array_equal(np.isnan(silent), (t > 10.9 + 1e-6) & (t < 20.0 - 1e-6))
    np.testing.assert_array_equal(np.isnan(slow), (t < 0.02) | (t > 0.02 + 4.9 * 5 + 5.0))
    assert canid(*words, "--to", "mat", "-o", tmp_path / "x").code == 0
    comments = loadmat(tmp_path / "x.mat", simplify_cells=True)["signals"]["comments"]
    assert set(comments.values()) >= {"last value, held for 5 s at most"}
