"""Causes are pooled over the drives of a car: what is planted comes back, and single names stay within chance."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.analysis.fleet.answers import causes
from canid.analysis.fleet.storage.columns import JOINT_FINDINGS
from canid.analysis.fleet.storage.database import opened
from tests.fixtures.fleet_folder import Planted, made, table, write
from tests.seeds import mostly


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Planted:
    return made(tmp_path_factory.mktemp("fleet") / "fleet", seed=2, drivers=6, drives=8)


def finding(key: str, effect: str, value: float, *, surrogate: bool = False) -> dict[str, Any]:
    strength = {"value": value, "low": value - 0.1, "high": value + 0.1, "unit": "s"}
    return {
        "key": key, "effect": effect, "where": "driver", "rivals": [], "surrogate": surrogate,
        "parameters": json.dumps({"width": strength}), "gain": 0.2, "gain_low": 0.1, "gain_high": 0.3,
        "log_score_gain": 3.0, "log_score_gain_low": 2.0, "log_score_gain_high": 4.0,
    }  # fmt: skip


@mostly(0.95)
def test_a_planted_cause_of_one_car_comes_back(planted: Planted, tmp_path: Path, seed: int) -> None:
    """In most drives of car A, with its strength and share; two chance names in car B are no cause beyond chance."""
    rng = np.random.default_rng(seed)
    good = [row for row in planted.rows if row.get("key")]
    a, b = ([row for row in good if row["car"] == car] for car in ("car A", "car B"))
    findings, power = [], []
    # 20 of 24, evenly over the drivers: a drawn number is not in the interval of its own share once in twenty runs, and
    # where the drives without the name are one driver's, the interval is rightly wide
    names = np.arange(len(a)) % 5 != 4
    for row, name in zip(a, names, strict=True):
        if name:
            findings.append(finding(row["key"], "headway_dead_zone", float(rng.normal(0.5, 0.05))))
        else:
            power.append(
                {"key": row["key"], "effect": "headway_dead_zone", "parameter": "width", "strength": 0.3}
            )
    findings += [finding(row["key"], "backlash", 0.5) for row in b[:1]]
    findings += [finding(row["key"], "pedal_quantum", 0.5, surrogate=True) for row in a]
    findings.append(finding("of no drive of the plan", "headway_dead_zone", 0.5))
    folder = tmp_path / "fleet"
    write(folder, planted.rows, findings=findings, power=power)
    with opened(folder) as db:
        found, why = causes.found(db)
    assert why == ""
    by = {(one.car, one.effect): one for one in found}
    assert set(by) == {("car A", "headway_dead_zone"), ("car B", "backlash")}
    real, chance = by["car A", "headway_dead_zone"], by["car B", "backlash"]
    named = sum(one["effect"] == "headway_dead_zone" for one in findings) - 1
    assert (real.drives, real.diagnosed, real.drivers) == (named, 24, 3)
    assert real.share.value == pytest.approx(named / 24)
    assert real.share.low < 20 / 24 < real.share.high < 1.0
    assert real.share.high - real.share.low < 0.5
    assert real.q < 1e-6
    assert real.gain.value == pytest.approx(0.2)
    # the mean of some twenty strengths with a standard deviation of 0.05, which its interval holds 19 times of 20
    strength = re.search(r"width ([0-9.]+) \[", real.says)
    assert strength is not None
    assert float(strength[1]) == pytest.approx(0.5, abs=0.05)
    assert chance.q > 0.05


@pytest.mark.long("runs of a fleet in processes of their own")
def test_why_there_is_none_is_said(planted: Planted, tmp_path: Path) -> None:
    for number, (verdict, said) in enumerate(
        [
            (None, "no drive was diagnosed"),
            ("not_enough_data", "48 of 48 drives"),
            ("adequate", "names a cause"),
        ]
    ):
        folder = tmp_path / str(number)
        write(folder, [{**row, "verdict": verdict} for row in planted.rows])
        with opened(folder) as db:
            found, why = causes.found(db)
        assert found == ()
        assert said in why


@pytest.mark.long("runs of a fleet in processes of their own")
def test_what_several_drives_together_name_is_shown_also_where_no_drive_names_it(
    planted: Planted, tmp_path: Path
) -> None:
    """Next to what drives name, and alone; drivers of another car are not counted."""
    joint = [
        {
            "key": f"j{k}",
            "subject": "driver",
            "driver": f"driver {k}",
            "car": car,
            "effect": effect,
            "where": "driver",
        }
        for k, (car, effect) in enumerate([("car A", "backlash"), ("car A", None), ("car B", None)])
    ]
    folder = tmp_path / "fleet"
    key = planted.rows[0]["key"]
    for findings, count in (([], 1), ([finding(key, "backlash", 0.5)], 1), ([finding(key, "delay", 0.5)], 2)):
        write(folder, planted.rows, findings=findings)
        table(folder / "joint_findings.parquet", JOINT_FINDINGS, joint)
        with opened(folder) as db:
            found, why = causes.found(db)
        assert why == ""
        assert len(found) == count
        assert [one.joint for one in found if one.effect == "backlash"] == ["named for 1 of 2 drivers"]
