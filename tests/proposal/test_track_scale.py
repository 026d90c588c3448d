"""Tracks without unit: the scale comes from objects that stand still or come towards, whatever it is; or stays open."""

from __future__ import annotations

import numpy as np
import pytest

from canid.analysis.drive.signal_columns import SignalColumn
from canid.analysis.proposal.log_columns import STEP_S, LogColumns
from canid.analysis.proposal.track_groups import track_groups
from canid.analysis.proposal.track_scale import scaled
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import Dbc
from tests.seeds import mostly

SECONDS, PERIOD_S = 240.0, 0.05
IDLE = 4095.0


def radar(angle: bool = True) -> Dbc:
    """Six numbered messages whose signals have neither unit nor scale."""
    names = ("DIST_OBJ", "RELV_OBJ", *(("ANG_OBJ",) if angle else ()))
    signals = tuple(
        Signal(n, 0, 12, True, n != "DIST_OBJ", False, 1.0, 0.0, None, None, "", {}, False, None, ())
        for n in names
    )
    return Dbc("radar.dbc", None, {f"T_{k}": Message(f"T_{k}", k, False, 8, 0.05, signals) for k in range(6)})


def drive(seed: int, scale: float, sign: int, objects: tuple[str, ...]) -> tuple[LogColumns, np.ndarray]:
    """What the tracks report in raw numbers of `scale` m, and the own speed on the raster."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, SECONDS, PERIOD_S)
    raster = np.arange(0.0, SECONDS, STEP_S)
    knots = np.arange(0.0, SECONDS + 15.0, 15.0)
    speed = np.interp(t, knots, rng.uniform(12.0, 30.0, len(knots)))
    columns = LogColumns({}, (0,), {}, (0,), raster, {})
    for k in range(6):
        kind = objects[k] if k < len(objects) else "none"
        distance, rate = np.full(len(t), np.nan), np.zeros(len(t))
        side = {"lead": 0.3, "oncoming": 3.5, "sign": -5.0}.get(kind, 0.0)
        if kind == "lead":
            rate = 2.0 * np.sin(t / 7.0)
            distance = 40.0 + np.cumsum(rate) * PERIOD_S
        elif kind in ("oncoming", "sign"):
            place, other = 150.0, 0.0
            for n in range(len(t)):
                if place < 5.0:  # every vehicle that comes towards has a speed of its own
                    place, other = rng.uniform(150.0, 300.0), rng.uniform(10.0, 30.0) * (kind == "oncoming")
                rate[n] = -(speed[n] + other)
                place += rate[n] * PERIOD_S
                distance[n] = place if place < 150.0 else np.nan
        there = np.isfinite(distance)
        noisy = distance + rng.normal(0.0, 0.12, len(t))
        raw = {
            "DIST_OBJ": np.where(there, np.round(noisy / scale), IDLE),
            "RELV_OBJ": np.where(there, np.round(sign * (rate + rng.normal(0, 0.08, len(t))) / scale), -16.0),
            "ANG_OBJ": np.where(there, np.round(np.degrees(np.arctan2(side, noisy)) / 0.02), 2046.0),
        }
        for name, value in raw.items():
            columns.kept[f"T_{k}", name, 0, False] = (SignalColumn(t, value, value), np.zeros(len(raster)))
    return columns, np.interp(raster, t, speed)


@pytest.mark.slow("a share of drives")
@pytest.mark.parametrize(
    "objects", [("lead", "sign"), ("lead", "oncoming", "oncoming"), ("lead", "oncoming", "sign")]
)
@mostly(0.95)
def test_the_scale_is_found(objects: tuple[str, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    scale, sign = float(rng.choice([0.1, 0.0625, 0.04, 0.05])), int(rng.choice([-1, 1]))
    columns, speed = drive(seed, scale, sign, objects)
    found = scaled(track_groups([radar()])[0], 0, columns, speed)
    assert not found.unknown
    assert found.parts["distance"].scale == scale
    assert found.parts["rate"].scale == pytest.approx(sign * scale, rel=0.03)
    assert found.parts["distance"].valid is not None
    assert found.parts["distance"].valid[1] < IDLE * scale
    # enough to distinguish the own lane from the next: the true one is 0.02
    assert 0.02 / 1.7 < found.parts["angle"].scale < 0.02 * 1.7


def test_a_lead_alone_leaves_it_open(seed: int) -> None:
    columns, speed = drive(seed, 0.0625, 1, ("lead",))
    assert scaled(track_groups([radar()])[0], 0, columns, speed).unknown == ("distance", "rate", "angle")
    assert scaled(track_groups([radar(angle=False)])[0], 0, columns, None).unknown == ("distance", "rate")
