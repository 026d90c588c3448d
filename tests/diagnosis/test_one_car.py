"""Several drives of one car with several drivers: sensors and car on all drives together, each driver by himself."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from canid.models.diagnosis.diagnose import diagnose, diagnose_car
from canid.models.diagnosis.several_drives.joined_drives import join
from canid.models.diagnosis.vehicle.vehicle_data import graded
from canid.models.simulation import simulate
from canid.ui.cli import main
from canid.values.types import Trace
from tests.diagnosis.test_several_drives import SHORT, drawn
from tests.hidden_effects.planted_by_canid import by_columns
from tests.seeds import mostly

DRIVERS = 4


def drives(rng: np.random.Generator, minutes: float, **hide: tuple[float, ...]) -> list[Trace]:
    """Drives of one car, each with a driver of its own."""
    return [
        by_columns(simulate(minutes, int(rng.integers(1_000_000)), "mixed", driver=drawn(rng), hide=hide))
        for _ in range(DRIVERS)
    ]


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_evidence_of_a_late_turbocharger_adds_up_over_drivers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    traces = drives(rng, SHORT, turbo_lag=(0.8,))
    alone = [
        finding.evidence
        for trace in traces[:2]
        for finding in diagnose(trace).findings
        if finding.effect == "turbo_lag"
    ]
    reports = diagnose_car(traces, [f"drive {k}" for k in range(DRIVERS)])
    for trace, report in zip(traces, reports, strict=True):
        named = {finding.effect: finding for finding in report.findings if finding.where == "vehicle"}
        assert "turbo_lag" in named, report.says
        assert named["turbo_lag"].evidence > max(alone, default=0.0)
        # each drive keeps its clock and its driver
        assert np.array_equal(report.t, trace.t)
        assert np.array_equal(report.measured, trace.output, equal_nan=True)
        gains = [one.gains["turbo_lag"].value for one in report.drives]
        assert sum(gain > 0 for gain in gains) >= DRIVERS - 1, gains
    K = [report.baseline.channels["range_rate"].K.value for report in reports]
    assert len(set(K)) == DRIVERS


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_a_clean_car_stays_clean_whoever_drives(seed: int) -> None:
    reports = diagnose_car(drives(np.random.default_rng(seed), SHORT), "abcd")
    for report in reports:
        assert not [one for one in report.findings if one.where in ("vehicle", "sensing")], report.says


def test_altitudes_of_two_drives_make_no_hill_between_them(seed: int) -> None:
    a, b = drives(np.random.default_rng(seed), 1.0)[:2]
    flat = [
        one._replace(
            signals={
                **{role: x for role, x in one.signals.items() if role != "grade"},
                "altitude": np.full(one.t.size, level),
            }
        )
        for one, level in ((a, 100.0), (b, 900.0))
    ]
    trace = join(flat).trace
    speed = np.nan_to_num(trace.signals["speed"])
    assert np.abs(graded(trace, speed)).max() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow("diagnoses planted drives")
def test_one_report_per_log(tmp_path: Path) -> None:
    logs = ["replay_logs/following_urban.blf", "replay_logs/following_mixed.blf"]
    out = tmp_path / "car.json"
    assert main(["diagnose", *logs, "--vehicle", "generic", "--same", "car", "--json", str(out)]) == 0
    reports = json.loads(out.read_text())
    assert [one["log"] for one in reports] == logs
    assert all("--same car" in one["provenance"]["command"] for one in reports)
    sensing = [[block for block in one["blocks"] if block["where"] == "vehicle"] for one in reports]
    assert sensing[0] == sensing[1]
