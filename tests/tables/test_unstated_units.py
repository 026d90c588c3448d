"""Columns that state no unit: what cannot be in m/s or in s is refused, drives in m/s and s never are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from canid.analysis.tables import unstated_units
from canid.analysis.tables.table import open_table
from canid.models.simulation import simulate
from canid.values.errors import ConfigError
from tests.fixtures.measured_logs import MEASURED, needs_measured

UNITS = {"mph": 1 / 0.44704, "kn": 3.6 / 1.852}
# of the simulation: rows of 0.1 s
EVERY = 10


def _drive(seed: int, profile: str) -> dict[str, np.ndarray]:
    columns = simulate(minutes=6.0, seed=seed, profile=profile).columns
    rng = np.random.default_rng(seed)
    out = {name: columns[name][::EVERY] for name in ("t", "speed", "gap", "range_rate", "pedal")}
    out["speed"] = out["speed"] + rng.choice([0.0, 0.02, 0.08]) * rng.normal(size=len(out["t"]))
    out["range_rate"] = out["range_rate"] + rng.choice([0.02, 0.1, 0.2]) * rng.normal(size=len(out["t"]))
    return out


def _written(path: Path, of: dict[str, np.ndarray], header: str, form: str = "{:.4f}") -> Path:
    rows = [",".join(form.format(x) for x in row) for row in zip(*of.values(), strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("profile", ["mixed", "motorway", "urban"])
def test_speeds_in_m_per_s_raise_no_objection(seed: int, profile: str) -> None:
    """Drives of drawn drivers, cars and sensors: neither of the speed nor of the times."""
    for k in range(3):
        of = _drive(seed + k, profile)
        assert unstated_units.of_speed(of["t"], of["speed"], of["range_rate"]) == ""
        assert unstated_units.of_times(of["t"], of["gap"], of["range_rate"]) == ""


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("profile", ["mixed", "motorway"])
def test_speeds_in_another_unit_are_refused_where_nothing_else_was_recorded(
    tmp_path: Path, seed: int, profile: str, unit: str
) -> None:
    """No acceleration, no satellites, no wheels; with the unit in the heading it is the drive."""
    of = _drive(seed, profile)
    speed = of["speed"]
    of["speed"] = speed * UNITS[unit]
    with pytest.raises(
        ConfigError, match=r"speed: no unit is stated, and .*; state it, such as speed \[mph\]"
    ):
        open_table(_written(tmp_path / "x.csv", of, "time,speed,gap,range_rate,pedal"))
    open_table(_written(tmp_path / "y.csv", of, f"time,speed [{unit}],gap,range_rate,pedal"))


@pytest.mark.parametrize(
    ("factor", "step", "says"),
    [(1 / 0.44704, 1.0, "whole numbers"), (3.6, 1.0, "whole numbers"), (3.6, 0.0, "multiples of 0.6214")],
)
def test_steps_show_the_unit_of_a_slow_drive(
    tmp_path: Path, seed: int, factor: float, step: float, says: str
) -> None:
    """As OBD reports it, whole km/h, and as phones convert it; levels and changes may be those of m/s."""
    of = _drive(seed, "urban")
    whole = np.rint(of["speed"] * factor * 0.9)
    of["speed"] = whole if step else np.round(whole / 1.609344, 1)
    with pytest.raises(ConfigError, match=says):
        open_table(_written(tmp_path / "x.csv", of, "time,speed,gap,range_rate,pedal"))


def _stops(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, speed, and range rate to leads that stand at some traffic lights, and drive slowly elsewhere."""
    speeds, leads = [], []
    for _ in range(8):
        n = int(rng.integers(60, 120))
        begin = rng.uniform(6.0, 9.0)
        own = np.concatenate([np.full(150, begin), np.linspace(begin, 0.3, n), np.linspace(0.3, begin, 240)])
        lead = np.concatenate([np.linspace(begin, 0.0, 140), np.zeros(10 + n), np.linspace(0.0, begin, 240)])
        speeds.append(own)
        leads.append(lead)
    own, lead = np.concatenate(speeds), np.concatenate(leads)
    rate = lead - own + 0.05 * rng.normal(size=len(own))
    return 0.1 * np.arange(len(own)), own, rate


@pytest.mark.parametrize("unit", UNITS)
def test_a_lead_that_stands_shows_the_unit(seed: int, unit: str) -> None:
    """While the own vehicle rolls towards it the closing rate is the speed."""
    t, speed, rate = _stops(np.random.default_rng(seed))
    assert unstated_units.of_speed(t, speed, rate) == ""
    assert f"as in {unit}" in unstated_units.of_speed(t, speed * UNITS[unit], rate)


@pytest.mark.parametrize("tick", [60.0, 3600.0, 1e-5, 0.01, 0.1])
def test_times_without_a_unit_are_those_that_the_gap_shows(tmp_path: Path, seed: int, tick: float) -> None:
    """Minutes, hours, ticks, and rows: with a unit, or a rate, the drive is read."""
    of = _drive(seed, "mixed")
    t = of["t"]
    of["t"] = t / tick
    with pytest.raises(ConfigError, match="times the integral of the range rate: state the units"):
        open_table(_written(tmp_path / "x.csv", of, "time,speed [m/s],gap,range_rate,pedal", "{:.9g}"))
    of["t"] = t * 1000.0
    open_table(_written(tmp_path / "x.csv", of, "time,speed [m/s],gap,range_rate,pedal"))


@pytest.mark.long("many or long tables")
@needs_measured
@pytest.mark.parametrize("log", ["human_h22_v3", "human_h22_v5", "acc_long_h10_v5"])
def test_measured_drives(log: str) -> None:
    """As they are nothing is objected to; in mph the speed is, where it is faster than in a town."""
    import canid

    trace = canid.read_trace(MEASURED / "openacc" / f"{log}.blf", "openacc")
    speed, rate = trace.signals["speed"], trace.signals["range_rate"]
    assert unstated_units.of_speed(trace.t, speed, rate) == ""
    assert unstated_units.of_times(trace.t, trace.signals["gap"], rate) == ""
    assert unstated_units.of_speed(trace.t, speed / 0.44704, rate)
