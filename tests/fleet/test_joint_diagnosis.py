"""Several drives of a driver are diagnosed together by the real command: the hidden cause is named, and kept."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from canid.analysis.fleet.answers import joint_diagnosis
from canid.analysis.fleet.answers.recent_traces import RecentTraces
from canid.analysis.fleet.job import Failure, Job, Settings, Status
from canid.analysis.fleet.planning.sources import read_source
from canid.analysis.fleet.storage.database import opened, rows
from canid.ui.cli import main
from canid.ui.cli.commands import fleet_causes
from tests.fixtures.fleet_folder import Planted, made, write

EFFECT = "relative_speed_dead_zone"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fleet of one driver, whose two drives have the same hidden cause."""
    root = tmp_path_factory.mktemp("fleet")
    (root / "logs/dora").mkdir(parents=True)
    for seed in ("21", "22"):
        words = ["--seed", seed, "--minutes", "3", "--profile", "urban", "--hide", EFFECT]
        words += ["--driver", "K1=3,K2=6,tau1=0.4,tau2=0.4,theta1=0.5,theta2=0.5"]
        assert main(["simulate", str(root / f"logs/dora/{seed}.blf"), *words]) == 0
    out = str(root / "out")
    quick = ["--no-diagnosis", "--no-traffic", "--no-windows", "--workers", "1"]
    assert main(["fleet", str(root / "logs"), "--vehicle", "generic", "-o", out, *quick]) == 0
    return root / "out"


def found(folder: Path) -> list[dict[str, object]]:
    with opened(folder) as db:
        return rows(db, "SELECT * FROM joint_findings")


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_hidden_cause_is_named_and_kept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fleet", "causes", str(folder), "--workers", "1"]) == 0
    assert "1 diagnosed now" in capsys.readouterr().out
    first = found(folder)
    (row,) = [one for one in first if one["effect"] == EFFECT]
    assert (row["driver"], row["logs"], row["surrogate"]) == ("dora", 2, False)
    assert row["holds_on"] == 2
    # a second run reads no log: there is none any more
    for log in (folder.parent / "logs/dora").glob("*.blf"):
        log.rename(log.with_suffix(".gone"))
    assert main(["fleet", "causes", str(folder), "--workers", "1"]) == 0
    assert "0 diagnosed now" in capsys.readouterr().out
    assert found(folder) == first


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_log_that_is_gone_or_has_changed_is_named(folder: Path) -> None:
    """No exception: the driver has no joint result, and the reason names the log."""
    log = str(next((folder.parent / "logs/dora").glob("21.*")))
    source = read_source("generic")
    for one, failure in ((Job("no.blf", -1, 0, ""), Failure.MISSING), (Job(log, 5, 0, ""), Failure.CHANGED)):
        outcome = joint_diagnosis.diagnose_together(
            Job("k", -1, 0, "", Settings(), (one, one)), source, RecentTraces()
        )
        assert (outcome.status, outcome.failure) == (Status.FAILED, failure)
        assert one.log in outcome.reason


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_folder_without_its_vehicle_file_says_how_to_name_it(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("logs", "drives"):
        (tmp_path / f"{name}.parquet").write_bytes((folder / f"{name}.parquet").read_bytes())
    assert main(["fleet", "causes", str(tmp_path)]) == 2
    assert "--vehicle" in capsys.readouterr().err
    (tmp_path / "fleet.json").write_text(
        json.dumps({"command": "canid fleet logs -o out --vehicle no/such.toml"})
    )
    assert main(["fleet", "causes", str(tmp_path)]) == 2
    assert "no/such.toml" in capsys.readouterr().err


def test_the_drives_with_the_most_usable_time_are_chosen(tmp_path: Path, seed: int) -> None:
    """Per driver, car and vehicle file, up to the limit; no copy, no failed log, none without a minute of usable driving."""
    planted: Planted = made(tmp_path / "fleet", seed, drivers=2, drives=5)
    for k, row in enumerate(planted.rows):
        if row.get("key"):
            row |= {"source": "f", "usable": 100.0 * (1 + k % 5), "behind_lead": 600.0}
    planted.rows[0]["usable"] = 59.0
    planted.rows[9]["source"] = "another vehicle file"
    write(planted.folder, planted.rows)
    with opened(planted.folder) as db:
        jobs = joint_diagnosis.jobs(db, Settings(), max_s=1000.0)
    chosen = {columns["driver"]: [one.log for one in job.together] for job, columns in jobs if not job.of_car}
    first, second = ([row["log"] for row in planted.rows[k : k + 5]] for k in (0, 5))
    # 500 + 400 + 300 > 1000, then 200 > 100 left, and 59 s are too short
    assert chosen == {
        "driver 000": [first[4], first[3]],
        "driver 001": [second[3], second[2], second[1], second[0]],
    }
    with opened(planted.folder) as db:
        assert [job for job, _ in joint_diagnosis.jobs(db, Settings(), max_s=450.0) if not job.of_car] == []


def test_a_car_is_diagnosed_with_all_its_drivers_by_turns(tmp_path: Path, seed: int) -> None:
    """Each driver's longest drive comes before anybody's second; a car of one driver has no job of its own."""
    planted: Planted = made(tmp_path / "fleet", seed, drivers=3, drives=3)
    cars = ["shared", "shared", "own"]
    for k, row in enumerate(planted.rows):
        if row.get("key"):
            seconds = 100.0 * (1 + k % 3) + 10.0 * (k // 3)
            row |= {"source": "f", "car": cars[k // 3], "usable": 0.0, "behind_lead": seconds}
    write(planted.folder, planted.rows)
    with opened(planted.folder) as db:
        jobs = joint_diagnosis.jobs(db, Settings(), max_s=850.0)
    (of,) = [(job, columns) for job, columns in jobs if job.of_car]
    logs = [row["log"] for row in planted.rows]
    # 310 + 300 + 210 < 850, and 30 s are left
    assert [one.log for one in of[0].together] == [logs[5], logs[2], logs[4]]
    assert (of[1]["subject"], of[1]["driver"], of[1]["car"]) == ("car", "", "shared")
    assert of[0].log not in {job.log for job, _ in jobs if not job.of_car}


def test_what_is_unexplained_is_said_with_the_cause_that_is_nearest() -> None:
    """A driver whose cause leaves a remainder is not one without a cause."""
    clean = {"subject": "driver", "driver": "anna", "car": "van", "verdict": "adequate", "effect": None}
    rows = [clean]
    for k in range(7):
        found = {"verdict": "unexplained", "effect": "asymmetric_gain", "surrogate": True}
        rows.append(clean | found | {"driver": f"driver {k}"})
    rows[1] |= {"effect": None}
    said = fleet_causes._lines(rows[:3], 3, 3)
    assert said[1:] == [
        "  no cause is named",
        "  unexplained: driver 0, driver 1 (nearest: asymmetric_gain)",
    ]
    assert fleet_causes._lines(rows, 8, 8)[-1].endswith("driver 4 (nearest: asymmetric_gain) and 2 more")
    assert fleet_causes._lines([clean], 1, 1)[1:] == ["  no cause is named"]
