"""Columns go through the very path of CAN readings."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.analysis.tables import column_map
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from canid.values.types import Trace
from tests.fixtures.measured_logs import MEASURED, needs_measured
from tests.tables.reading import read_table

REPLAY_LOGS = Path(__file__).parents[2] / "replay_logs"
EXACT = ("t", "output", "inputs", "learn", "segment", "bound")


def exported(log: Path, vehicle: str | Path, path: Path) -> Path:
    """The readings of a log as CSV: a row for each time stamp, an empty cell where nothing came, "nan" for no value."""
    signals = canid.read_signals(log, vehicle)
    times = np.unique(np.concatenate([of.t for of in signals.values()]))
    columns = []
    for of in signals.values():
        cells = [""] * len(times)
        for k, value in zip(np.searchsorted(times, of.t), of.value.tolist(), strict=True):
            cells[k] = repr(value)
        columns.append(cells)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time [s]", *signals])
        writer.writerows(zip(map(repr, times.tolist()), *columns, strict=True))
    return path


def by(vehicle: str | Path) -> column_map.ColumnMap:
    """What `--vehicle` says of a table."""
    return column_map.of_vehicle(read_vehicle(vehicle))


def same(a: Trace, b: Trace) -> None:
    for name in EXACT:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert a.gate == b.gate
    assert a.findings == b.findings
    assert a.output_filter == b.output_filter
    assert a.signals.keys() == b.signals.keys()
    for role, values in a.signals.items():
        np.testing.assert_array_equal(values, b.signals[role], err_msg=role)


@pytest.mark.slow("whole tables")
def test_an_exported_log_gives_the_same_trace_to_the_last_bit(tmp_path: Path) -> None:
    """All roles at their own rates, a lead that is lost, brake and cruise: CSV and .blf are the same."""
    log = REPLAY_LOGS / "following_lost_lead.blf"
    path = exported(log, "generic", tmp_path / "x.csv")
    same(canid.read_trace(log, "generic"), read_table(path, by("generic")))


@pytest.mark.slow("whole tables")
@needs_measured
@pytest.mark.parametrize(
    ("log", "vehicle"),
    [
        ("openlka/silverado_2024-03-12-19-11-16_1-0.blf", "openlka/openlka.toml"),
        ("openlka/g70_0000002e-dad0e12eac_1-4.blf", "openlka/openlka_lane.toml"),
        ("openacc/acc_long_h10_v5.blf", "openacc"),
    ],
)
def test_an_exported_measured_log_gives_the_same_trace_to_the_last_bit(
    tmp_path: Path, log: str, vehicle: str
) -> None:
    """Real logs: a radar that contradicts itself, lane keeping, a factory ACC."""
    car = MEASURED / vehicle if vehicle.endswith(".toml") else vehicle
    path = exported(MEASURED / log, car, tmp_path / "x.csv")
    same(canid.read_trace(MEASURED / log, car), read_table(path, by(car)))


@pytest.mark.slow("whole tables")
@needs_measured
def test_identify_of_the_csv_writes_the_json_of_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`canid identify drive.csv` needs no vehicle file, and every number is that of the .blf."""
    log = MEASURED / "asta/asta_p3_f2_Tesla_Model3.blf"
    path = exported(log, "openacc_asta", tmp_path / "drive.csv")
    part = ["--stop", "80"]
    assert main(["identify", str(path), "--json", str(tmp_path / "a.json"), *part]) == 0
    assert "speed = speed" in capsys.readouterr().err
    assert (
        main(["identify", str(log), "--vehicle", "openacc_asta", "--json", str(tmp_path / "b.json"), *part])
        == 0
    )
    a, b = (json.loads((tmp_path / name).read_text(encoding="utf-8")) for name in ("a.json", "b.json"))
    assert a["driver_time"] > 40
    different = {key for key in a if a[key] != b[key]}
    assert different <= {"log", "vehicle"}
