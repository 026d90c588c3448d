"""A radar whose tracks have a limited range rate or gap: of the track that is followed it is found as of a signal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import canid
from canid.signals.signal_checks.drive_time import fitted_trace
from canid.values.types import LearnGate
from tests.vehicle.test_object_lists import HEAD, LAYOUTS, frame

TIMES = 0.05 * np.arange(2400)
FAR = 99.0


def trace(folder: Path, seed: int, highest_gap: float, limit: float) -> canid.Trace:
    """Two minutes behind a lead that is one of two tracks; each end is the same in both."""
    (folder / "car.dbc").write_text(HEAD + LAYOUTS["numbered"][0])
    (folder / "car.toml").write_text(
        'name = "car"\ndbc = ["car.dbc"]\n[signals]\npedal = "Engine.Pedal"\nspeed = "Brake.Speed"\n'
        f"[lead]\n{LAYOUTS['numbered'][1]}\n"
    )
    rng = np.random.default_rng(seed)
    waves = [(3.0 * rng.uniform(0.8, 1.2), 0.6 * rng.uniform(0.8, 1.2), rng.uniform(0.0, 6.0)) for _ in "12"]
    gap = 40.0 + sum(a * np.sin(w * TIMES + p) for a, w, p in waves) + 0.05 * rng.normal(size=len(TIMES))
    rate = sum(a * w * np.cos(w * TIMES + p) for a, w, p in waves) + 0.05 * rng.normal(size=len(TIMES))
    lines = []
    for t, distance, change in zip(TIMES.tolist(), gap.tolist(), rate.tolist(), strict=True):
        pedal, speed = round(2000 + 500 * np.sin(t)), round(7200 + 300 * np.cos(0.1 * t))
        for id_, raw in (("100", pedal), ("101", speed)):
            lines.append(f"({1.75e9 + t:.6f}) can0 {id_}#{raw.to_bytes(8, 'little').hex().upper()}\n")
        change = min(max(change, -limit), limit)
        lines.append(frame("numbered", 0, t + 0.001, {0: (min(distance, highest_gap), change, 0.2)}))
        lines.append(frame("numbered", 1, t + 0.002, {1: (min(distance + 9.0, highest_gap), change, 5.0)}))
    (folder / "drive.log").write_text("".join(lines))
    return canid.read_trace(folder / "drive.log", folder / "car.toml")


@pytest.mark.parametrize(
    ("gap", "rate", "says"),
    [(FAR, 0.8, "range_rate is limited at ±0.8 m/s"), (42.0, FAR, "gap is limited at 42 m")],
)
def test_a_limit_of_the_followed_track_is_found(
    gap: float, rate: float, says: str, tmp_path: Path, seed: int
) -> None:
    """Its samples at the limit are not learned from, and the vehicle is still there."""
    found = trace(tmp_path, seed, gap, rate)
    last = next(finding for finding in found.findings if finding.says == says)
    assert last.withholds
    limited = np.array([gate is LearnGate.LIMITED for gate in found.gate])
    assert limited[found.t > last.raised + 3.0].any()
    assert (found.signals["lead_valid"] == 1.0).mean() > 0.95
    at = np.isin(found.signals[f"{last.roles[0]}_reported"], (gap, rate, -rate))
    learn = fitted_trace(found).learn
    assert at.any()
    assert not (learn & at).any()


def test_a_radar_without_limits_has_none(tmp_path: Path, seed: int) -> None:
    found = trace(tmp_path, seed, FAR, FAR)
    assert found.findings == ()
    assert LearnGate.LIMITED not in found.gate
