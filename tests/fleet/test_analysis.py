"""The rows of a log hold the numbers of `canid.identify`, `canid.diagnose` and the live monitor, to the last bit."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.analysis.drive import identification_json
from canid.analysis.drive.drive_reader import run
from canid.analysis.fleet.job import Failure, Job, Outcome, Settings, Source, Status
from canid.analysis.fleet.one_log.analysis import analyse
from canid.analysis.fleet.one_log.joint_estimate import joint_estimate
from canid.analysis.fleet.one_log.monitor_misfits import misfits, monitor_reports
from canid.analysis.fleet.storage.columns import CHANNELS, PARAMETERS, POOLED, TABLES
from canid.io.logs import open_log
from canid.signals.vehicle import read_vehicle
from canid.values.types import Interval, MonitorReport
from tests.exact import exact
from tests.fleet import short_logs
from tests.fleet.fleet_jobs import GENERIC, QUICK, SHIPPED, URBAN, job

ALL = Settings(traffic=False)


@pytest.fixture(scope="module")
def urban() -> Outcome:
    return analyse(job(URBAN, ALL), GENERIC)


def known(x: float) -> float | None:
    return x if math.isfinite(x) else None


def check(row: dict[str, object], name: str, of: Interval) -> None:
    assert (row[name], row[f"{name}_low"], row[f"{name}_high"]) == tuple(map(known, of)), name


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_rows_hold_what_identify_finds(urban: Outcome) -> None:
    """Every number of every channel, whole drive and windows, is that of the Python interface."""
    found = canid.identify(URBAN, "generic")
    assert (urban.status, urban.failure, urban.reason) == (Status.OK, Failure.NONE, "")
    row = dict(urban.tables["drives"][0])
    windows = urban.tables["windows"]
    assert len(windows) == len(found.windows) > 10
    for got, channels in [
        (row, found.channels),
        *((w, e.channels) for w, e in zip(windows, found.windows, strict=True)),
    ]:
        for channel in CHANNELS:
            if channel not in channels:
                assert got[f"{channel}_status"] is None
                continue
            assert got[f"{channel}_status"] == channels[channel].status.value
            for parameter, _ in PARAMETERS:
                check(dict(got), f"{channel}_{parameter}", getattr(channels[channel], parameter))
    assert [(w["t"], w["estimator"], w["headline"]) for w in windows] == [
        (e.t, e.estimator, e.headline) for e in found.windows
    ]
    assert (row["usable"], row["driving"], row["behind_lead"]) == (
        found.time.usable,
        found.time.driving,
        found.time.behind_lead,
    )
    assert row["fit_percent"] == found.fit_percent
    check(row, "noise_sd", found.drive_summary.noise_sd)
    for role in ("speed", "headway", "gap"):
        check(row, role, found.drive_summary.driven[role])
    stored = json.loads(str(row["identify_json"]))
    whole = json.loads(json.dumps(identification_json.to_json(found, "", found.vehicle)))
    assert stored.pop("schema") == "canid/identify/1"
    whole["windows"], whole["summary"]["draws"] = [], None
    assert stored == whole


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_rows_hold_what_diagnose_finds(urban: Outcome) -> None:
    """Verdict, causes, gains and power are those of the Python interface; a second log has findings as well."""
    for path, outcome in ((URBAN, urban), (SHIPPED / "openacc_simulated.blf", None)):
        vehicle = "generic" if outcome is not None else "openacc"
        source = Source(read_vehicle(vehicle), None, vehicle)
        outcome = outcome or analyse(job(path, ALL._replace(windows=False)), source)
        report = canid.diagnose(path, source.vehicle)
        row = dict(outcome.tables["drives"][0])
        assert (row["verdict"], row["says"]) == (report.verdict.value, report.says)
        assert row["causes"] == [f.effect for f in report.findings if not f.surrogate]
        check(row, "gain", report.gain)
        check(row, "unexplained", report.unexplained)
        assert row["extended_fit"] == known(report.extended.fit_percent)
        rows = outcome.tables["findings"]
        assert [f["effect"] for f in rows] == [f.effect for f in report.findings]
        for got, f in zip(rows, report.findings, strict=True):
            check(dict(got), "gain", f.gain)
            assert {name: of["value"] for name, of in json.loads(got["parameters"]).items()} == {
                name: known(of.value) for name, of in f.parameters.items()
            }
        assert [(p["effect"], p["strength"]) for p in outcome.tables["power"]] == [
            (v.effect, known(v.strength)) for v in report.visible
        ]


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_every_row_has_the_columns_of_the_contract(urban: Outcome) -> None:
    """No column is missing, none is unknown, no number is NaN, and all rows have the outcome's key."""
    for name, columns in TABLES.items():
        for row in urban.tables[name]:
            assert set(row) == {column.name for column in columns}, name
            assert row["key"] == urban.key
            values = [x for value in row.values() for x in (value if isinstance(value, list) else [value])]
            assert all(isinstance(x, str | int | float | bool | None) for x in values)
            assert all(math.isfinite(x) for x in values if isinstance(x, float))
            assert not any(isinstance(x, np.generic) for x in values)


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize("name", ["following_lost_lead.blf", "lane_keeping.blf"])
def test_the_monitor_reports_what_it_reports_live(name: str) -> None:
    """Every report along the stored samples is that of the frames, chunk by chunk."""
    vehicle = read_vehicle("generic_lane" if name.startswith("lane") else "generic")
    live = [
        item
        for step in run(open_log(SHIPPED / name), vehicle)
        for item in step.out
        if isinstance(item, MonitorReport)
    ]
    trace = canid.read_trace(SHIPPED / name, vehicle)
    reports = list(monitor_reports(trace))
    assert len(reports) > 5
    assert [exact(r) for r in reports] == [exact(r) for r in live]
    # a stretch begins with the first report of it, and each has ended before the next one begins
    found = misfits(reports)
    assert sum(one.until is None for one in found) <= 1
    assert bool(found) == any(not r.fits for r in reports)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_joint_estimate_is_that_of_the_draws(urban: Outcome) -> None:
    """Mean and covariance are those of the draws in JSON; its gains are those of the channels within the error of 200."""
    found = canid.identify(URBAN, "generic", select_orders=False, sliding=False)
    row = urban.tables["drives"][0]
    draws = found.drive_summary.draws
    assert draws is not None
    assert row["names"] == list(POOLED)
    columns = [*draws.K.T, *np.log(draws.tau).T, *draws.dead_time.T, *np.log(draws.tau + draws.dead_time).T]
    np.testing.assert_allclose(row["estimate"], [np.mean(x) for x in columns], rtol=1e-12)
    np.testing.assert_allclose(np.reshape(row["covariance"], (8, 8)), np.cov(columns), rtol=1e-9, atol=1e-12)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_no_joint_estimate_where_the_gains_changed_or_a_lane_is_kept() -> None:
    """A drive without one set of gains, or of one input, has no joint estimate; a lag of 0 has a finite logarithm."""
    found = canid.identify(URBAN, "generic", select_orders=False, sliding=False)
    whole = found.whole["fopdt"]
    assert whole is not None
    assert (
        joint_estimate(found._replace(whole={"fopdt": whole._replace(details={"changes": ("one",)})})) is None
    )
    draws = found.drive_summary.draws
    assert draws is not None
    at_zero = found.drive_summary._replace(draws=draws._replace(tau=np.zeros_like(draws.tau)))
    joint = joint_estimate(found._replace(drive_summary=at_zero))
    assert joint is not None
    assert np.isfinite(joint.covariance).all()
    lane = Source(read_vehicle("generic_lane"), None, "lane")
    outcome = analyse(job(SHIPPED / "lane_keeping.blf"), lane)
    row = outcome.tables["drives"][0]
    assert (row["names"], row["estimate"], row["covariance"]) == (None, None, None)
    alone = canid.identify(SHIPPED / "lane_keeping.blf", "generic_lane", select_orders=False, sliding=False)
    assert row["lateral_offset_status"] == alone.channels["lateral_offset"].status.value
    assert row["range_rate_K"] is None


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_table_of_named_columns_is_analysed_with_and_without_a_vehicle(tmp_path: Path) -> None:
    """A drive exported to CSV gives the same drive; without a column map its headings are enough."""
    trace = canid.read_trace(URBAN, "generic")
    path = tmp_path / "drive.csv"
    names = ("pedal", "speed", "gap", "range_rate")
    rows = [",".join(("time", *names))]
    rows += [
        ",".join(map(str, row))
        for row in zip(trace.t.tolist(), *(trace.signals[name].tolist() for name in names), strict=True)
    ]
    path.write_text("\n".join(rows).replace("nan", "") + "\n")
    expected = canid.identify(path, select_orders=False, sliding=False)
    for source in (Source(None, None, "headings"), GENERIC):
        outcome = analyse(job(path), source)
        assert outcome.status is Status.OK, outcome.reason
        row = dict(outcome.tables["drives"][0])
        check(row, "range_rate_K", expected.channels["range_rate"].K)
        assert row["output"] == "pedal"


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_key_follows_bytes_source_and_settings_alone(tmp_path: Path) -> None:
    """A copy under another name has the same key; other bytes, another source or other results another one."""
    path, copy = tmp_path / "a.log", tmp_path / "another name.log"
    path.write_bytes(short_logs.log(1, 20.0))
    shutil.copy(path, copy)
    first = analyse(job(path), GENERIC)
    assert first.failure is Failure.NONE
    assert analyse(job(copy), GENERIC).key == first.key
    assert analyse(job(copy, QUICK._replace(timeout_s=1e6)), GENERIC).key == first.key
    assert analyse(job(copy), GENERIC._replace(fingerprint="another")).key != first.key
    assert analyse(job(copy, QUICK._replace(windows=True)), GENERIC).key != first.key
    with copy.open("ab") as file:
        file.write(b"\n")
    assert analyse(job(copy), GENERIC).key not in (first.key, "")


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_damaged_log_has_results_and_a_reason(tmp_path: Path) -> None:
    """Of a log that ends in the middle the first part is analysed: `damaged`, with the reader's sentence."""
    path = tmp_path / "cut.blf"
    path.write_bytes(URBAN.read_bytes()[:300_000])
    outcome = analyse(Job(str(path), 300_000, 0, "generic", QUICK), GENERIC)
    assert (outcome.status, outcome.failure) == (Status.DAMAGED, Failure.NONE)
    damage = canid.read_drive(path, "generic", estimating=False).health.damage
    assert damage is not None
    assert outcome.reason == damage.says
    assert outcome.tables["drives"][0]["duration"] > 60.0
    assert [row["says"] for row in outcome.tables["events"] if row["kind"] == "damage"] == [damage.says]
