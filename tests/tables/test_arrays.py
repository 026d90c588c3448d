"""Arrays, data frames and Parquet give what the CSV file gives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pytest

import canid
from canid.analysis.tables.arrays import from_arrays, from_frame
from canid.analysis.tables.table import open_table
from canid.values.errors import LogError
from tests.tables import platoon
from tests.tables.reading import read_table
from tests.tables.test_same_path import same
from tests.tables.test_tables import columns


@pytest.fixture(scope="module")
def drive() -> dict[str, np.ndarray]:
    short = {name: x[:900] for name, x in columns(platoon.platoon(3)).items()}
    short["gap"][300:320] = np.nan
    return short


@pytest.fixture(scope="module")
def of_file(drive: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    path = tmp_path_factory.mktemp("tables") / "x.csv"
    pd.DataFrame(drive).to_csv(path, index=False)
    return path, read_table(path)


@pytest.mark.slow("whole tables")
def test_arrays_and_frames_give_the_trace_of_the_file(
    drive: dict[str, np.ndarray], of_file: tuple[Path, Any]
) -> None:
    """Columns of numpy, pandas, polars and lists, with NaN, NA and null: the same to the last bit."""
    expected = of_file[1]
    same(expected, from_arrays(**drive))
    same(expected, from_arrays(**{name: x.tolist() for name, x in drive.items()}))
    frame = pd.DataFrame(drive)
    same(expected, from_frame(frame))
    same(expected, from_frame(frame.convert_dtypes()))
    same(expected, from_frame(pl.from_pandas(frame)))
    same(expected, from_frame(dict(drive)))
    renamed = frame.rename(columns={"speed": "v1", "gap": "d [cm]"}).assign(d=0.0)
    renamed["d [cm]"] *= 100
    named = {"time": "time", "speed": "v1", "gap": "d [cm]", "range_rate": "range_rate", "accel": "accel"}
    got = from_frame(renamed, named)
    np.testing.assert_allclose(got.inputs, expected.inputs, atol=1e-9, equal_nan=True)


@pytest.mark.slow("whole tables")
def test_dated_frames_and_parquet_keep_times_and_nulls(
    drive: dict[str, np.ndarray], of_file: tuple[Path, Any], tmp_path: Path
) -> None:
    """Time stamps of nanoseconds since 1970 in a frame, in Parquet with and without a zone, nulls between."""
    stamps = (np.round(drive["time"] * 1e9).astype(np.int64) + 1_772_357_400_250_000_000).astype(
        "datetime64[ns]"
    )
    frame = pd.DataFrame({**drive, "time": stamps}).replace({np.nan: None})
    same(of_file[1], from_frame(frame))
    same(of_file[1], from_frame(frame.set_index("time").rename_axis(None)))
    same(of_file[1], from_frame(pd.DataFrame(drive).set_index("time")))
    same(of_file[1], from_arrays(**{**drive, "time": stamps}))
    for kind in ("TIMESTAMP_NS", "TIMESTAMPTZ"):
        path = tmp_path / f"it's [1] {kind}.parquet"
        plain = pd.DataFrame({**drive, "time": stamps})
        with duckdb.connect() as db:
            db.register("f", plain)
            target = str(path).replace("'", "''")
            db.execute(
                f"COPY (SELECT time::{kind} AS time, speed, CASE WHEN isnan(gap) THEN NULL ELSE gap END "
                f"AS gap, range_rate, accel, 'x' AS note FROM f) TO '{target}' (FORMAT parquet)"
            )
        table = open_table(path)
        assert table.log.start_utc == pytest.approx(1_772_357_400.25, abs=1e-6)
        got = read_table(path)
        np.testing.assert_allclose(got.inputs, of_file[1].inputs, atol=1e-5, equal_nan=True)
        np.testing.assert_array_equal(got.learn, of_file[1].learn)


def test_a_damaged_parquet_file_gives_one_line(tmp_path: Path) -> None:
    """Cut, or no Parquet at all."""
    path = tmp_path / "x.parquet"
    with duckdb.connect() as db:
        db.execute(f"COPY (SELECT range AS time, 1.0 AS speed FROM range(1000)) TO '{path}' (FORMAT parquet)")
    whole = path.read_bytes()
    for content in (
        whole[: len(whole) // 2],
        b"PAR1" * 50,
        whole[:4] + b"\xff" * (len(whole) - 12) + whole[-8:],
    ):
        path.write_bytes(content)
        with pytest.raises(LogError, match=r"x\.parquet"):
            read_table(path)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "an unknown column": ({"sped": np.ones(900)}, "unknown column 'sped' (did you mean \"speed\"?)"),
    "another length": ({"pedal": np.ones(7)}, "different lengths"),
    "two dimensions": ({"pedal": np.ones((900, 2))}, "pedal: has 2 dimensions"),
    "an output without a column": ({"output": "pedal"}, "pedal is missing"),
    "an unknown output": ({"output": "brakes"}, "output='brakes' is not one of"),
    "an unknown task": ({"task": "parking"}, "task='parking' is not one of"),
    "a wrong unit": ({"units": {"gap": "s"}}, '"s" is no unit of it'),
    "a unit of nothing": ({"units": {"gpa": "m"}}, "there is no column 'gpa' (did you mean \"gap\"?)"),
    "no headway": ({"headway_desired": -1.0}, "headway_desired=-1.0"),
    "no step": ({"dt": 0.0}, "dt=0.0"),
    "texts": ({"speed": ["fast"] * 900}, "speed"),
    "no lead": ({"gap": None}, "gap"),
}


@pytest.mark.slow("whole tables")
@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_call_is_a_value_error_that_names_the_argument(
    drive: dict[str, np.ndarray], what: str
) -> None:
    """ValueError, the argument, and what it may be."""
    given, says = WRONG[what]
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the text is compared below)
        from_arrays(**{**drive, **given})
    assert says in str(caught.value)


@pytest.mark.slow("whole tables")
def test_settings_of_the_driver_reach_the_trace(drive: dict[str, np.ndarray]) -> None:
    """headway_desired, task, output and dt."""
    trace = from_arrays(**drive, headway_desired=1.2, dt=0.05)
    assert trace.dt == 0.05
    np.testing.assert_allclose(trace.inputs[:, 0], trace.signals["headway"] - 1.2, equal_nan=True)
    t = drive["time"]
    lane = from_arrays(time=t, lateral_offset=np.sin(t), steering_angle=-np.sin(t))
    assert lane.input_names == ("lateral_offset",)
    assert canid.from_arrays is from_arrays
    assert canid.from_frame is from_frame
