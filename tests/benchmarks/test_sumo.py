"""Drives in SUMO: the lead does what it shall, the model's derivatives are those of its formula, frames hold the drive."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.other_drive import BASELINE, CHOSEN
from benchmarks.sumo import outcomes, table
from benchmarks.sumo.lead_speeds import lead_speeds
from benchmarks.sumo.sumo_drive import drive
from benchmarks.sumo.sumo_drivers import MODELS, STEP_S, driver
from canid.models.diagnosis.rivals.rival_models import MODELS as RIVALS
from canid.signals.vehicle import read_vehicle
from canid.values.types import NAN
from tests.seeds import mostly

NOWHERE = Path("/nowhere")


def seed_of(model: str, seed: int) -> int:
    """The next seed whose driver is of this model."""
    return seed + (tuple(MODELS).index(model) - seed) % len(MODELS)


def test_an_idm_in_sumo_has_the_derivatives_of_its_formula(seed: int) -> None:
    pytest.importorskip("libsumo", reason="pip install 'canid[bench]'")
    of = driver(seed_of("IDM", seed))
    lead = lead_speeds(seed, 3.0, NOWHERE)[1]
    driven = drive(of, lead)
    s, v, u = (driven.simulation.columns[role] for role in ("gap", "speed", "lead_speed"))
    np.testing.assert_allclose(u, lead, atol=1e-6)
    p = of.settings
    slope = v / (2 * math.sqrt(p["accel"] * p["decel"]))
    wanted = p["minGap"] + v * p["tau"] + slope * (v - u)
    expected = np.median(2 * p["accel"] * wanted**2 / s**3), np.median(2 * p["accel"] * wanted / s**2 * slope)
    # SUMO's gain is that of a step of finite length
    np.testing.assert_allclose(driven.derivatives, expected, rtol=0.05)
    # gap and speeds belong together
    np.testing.assert_allclose(np.diff(s), STEP_S * (u - v)[1:], atol=0.02)


@mostly(0.95)
def test_a_recorded_drive_is_the_simulated_one_with_noise(seed: int) -> None:
    pytest.importorskip("libsumo", reason="pip install 'canid[bench]'")
    of = driver(seed)
    driven = drive(of, lead_speeds(seed, 1.0, NOWHERE)[1])
    trace = outcomes.recorded(driven, read_vehicle(outcomes.VEHICLE))
    for role, off in (("gap", 0.5), ("speed", 0.1), ("range_rate", 0.5)):
        true = np.interp(trace.t, driven.simulation.columns["t"], driven.simulation.columns[role])
        left = (trace.signals[role] - true)[50:-50]
        assert 0 < float(np.sqrt(np.nanmean(left**2))) < off, role


def test_models_take_turns_and_a_seed_is_a_drive(seed: int) -> None:
    drivers = [driver(seed + k) for k in range(len(MODELS))]
    assert {one.model for one in drivers} == set(MODELS)
    assert driver(seed) == driver(seed)
    name, first, second = lead_speeds(seed, 1.0, NOWHERE)
    assert name == lead_speeds(seed, 1.0, NOWHERE)[0]
    assert first.size == second.size == round(60 / STEP_S)
    np.testing.assert_array_equal(first, lead_speeds(seed, 1.0, NOWHERE)[1])


def outcome(seed: int) -> outcomes.Outcome:
    errors = {name: [0.1, 0.02] for name in (BASELINE, CHOSEN, *(one.name for one in RIVALS))}
    return outcomes.Outcome(
        seed, "IDM", 0.05, "mixed, urban", [0.5, 0.4, 0.6], 0.55, [1.0, 0.8, 1.2], 3.0, "named", ["gain_change"], [],
        [0.2, 0.1, 0.3], NAN, 61.0, errors, 1.0, 2.0,
    )  # fmt: skip


def test_the_table_counts(tmp_path: Path) -> None:
    file = tmp_path / "rows.jsonl"
    file.write_text("".join(outcomes.line(outcome(k)) + "\n" for k in range(3)))
    rows = outcomes.stored(file)
    assert rows[0]._replace(achieved_gain=0.0) == outcome(0)._replace(achieved_gain=0.0)
    text = "\n".join(table.table(rows))
    assert "K of range rate holds the model's own derivative | 3/3; median of the ratio 0.91" in text
    assert "K of headway holds the model's own derivative | 0/3; median of the ratio 0.33" in text
    assert "of drivers that are constant | 3/3" in text
    assert f"| {CHOSEN} | 0.100 | 0.100 | 0.020 | 0.020 | 100 % (3) |" in text
