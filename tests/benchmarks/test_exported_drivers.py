"""Exported drivers in SUMO: driven there as by the formulas that were calibrated, and compared as distributions."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.sumo import exported_drivers
from benchmarks.sumo.exported_table import page, table
from benchmarks.sumo.two_samples import distances, effective_number
from benchmarks.sumo.vehicle_type_drive import Run, network, routes
from canid.analysis.sumo import krauss
from canid.analysis.sumo.sumo_models import BY_NAME
from canid.analysis.sumo.vehicle_types import additional
from tests.sumo.idm_drive import Planted, driven
from tests.sumo.planted_models import driver


@pytest.mark.skipif(sys.platform == "win32", reason="libsumo's wheel is tried on Linux")
@pytest.mark.parametrize("model", list(BY_NAME))
def test_sumo_loads_the_file_and_drives_by_canids_formula(model: str, tmp_path: Path) -> None:
    """SUMO's own car-following function at states drawn at random, against the formula that was calibrated."""
    libsumo = pytest.importorskip("libsumo", reason="pip install 'canid[bench]'")
    step = krauss.STEP_S if model == "Krauss" else 0.1
    one_driver = driver(model)
    file, net, cars = tmp_path / "drivers.add.xml", tmp_path / "n.net.xml", tmp_path / "r.rou.xml"
    file.write_text(additional([one_driver], "x", "canid"), encoding="utf-8")
    net.write_text(network(1), encoding="utf-8")
    run = Run(np.array([60.0]), np.array([20.0]), np.array([20.0]))
    cars.write_text(routes("", "driver_a", 1, run), encoding="utf-8")
    words = ["sumo", "-n", str(net), "-a", str(file), "-r", str(cars), "--step-length", str(step)]
    libsumo.start([*words, "--no-step-log", "--no-warnings"])
    try:
        libsumo.simulationStep()
        of_sumo = libsumo.vehicle
        rest = of_sumo.getMinGap("own0")
        q = np.array([x.value for x in one_driver.parameters.values()])
        rng = np.random.default_rng(1)
        for _ in range(30):
            speed = float(rng.uniform(3.0, 0.9 * (q[0] if model != "ACC" else 30.0)))
            gap, lead = (
                rest + 1.0 + speed * float(rng.uniform(0.7, 2.5)),
                speed + float(rng.uniform(-2.0, 2.0)),
            )
            formula = float(BY_NAME[model].rival.acceleration(q, *(np.array(x) for x in (gap, speed, lead))))
            wanted = of_sumo.getFollowSpeed("own0", speed, gap - rest, max(lead, 0.0), 4.5, "lead0")
            if model == "Krauss":
                # SUMO counts whole steps of braking: within one of them
                assert wanted == pytest.approx(speed + formula * step, abs=q[4] * step), (gap, speed, lead)
            elif formula > -4.0:  # what brakes harder is bounded by SUMO
                # the driver's error is there from the first step on, and is small: sd 0.3 m/s²
                assert (wanted - speed) / step == pytest.approx(formula, abs=0.35 + 0.1 * abs(formula))
    finally:
        libsumo.close()


def test_a_drive_is_compared_in_sumo(seed: int) -> None:
    """A textbook IDM, not SUMO's: its vehicle type has its distributions, SUMO's default type has not."""
    pytest.importorskip("libsumo", reason="pip install 'canid[bench]'")
    case = exported_drivers.Case("idm <b>", driven(Planted(T=2.0), seed, 4.0).trace, "accel", {})
    row = exported_drivers.row(case, seed)
    assert row["exported"]["time_gap"]["simulated"]["ks"] < 0.2
    assert row["exported"]["gap"]["simulated"]["ks"] < row["default"]["gap"]["simulated"]["ks"]
    assert row["collisions"] == 0
    json.dumps(row, allow_nan=False)
    assert "idm <b>" in table([row], seed)
    assert "idm &lt;b&gt;" in page([row], seed)


def test_distances_of_samples(seed: int) -> None:
    """0 of a sample with itself; a shift is its Wasserstein distance; an autoregression has few independent values."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(3000)
    assert distances(x, x) == (0.0, 0.0, 0.0)
    assert distances(x, x + 2.0).wasserstein == pytest.approx(2.0)
    y = np.zeros(20_000)
    for k in range(1, y.size):
        y[k] = 0.9 * y[k - 1] + rng.standard_normal()
    # (1 - 0.9) / (1 + 0.9) of them
    assert effective_number(y) == pytest.approx(20_000 / 19, rel=0.4)


def test_without_libsumo_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(exported_drivers, "find_spec", lambda name: None)
    assert exported_drivers.main([]) == 2
    assert "pip install 'canid[bench]'" in capsys.readouterr().err
