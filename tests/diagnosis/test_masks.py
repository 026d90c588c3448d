"""Stretches that say nothing of a person are recognised with their times, and a clean drive keeps all of its time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import canid
from canid.models.diagnosis import masks
from canid.values.types import Trace
from tests.fixtures.measured_logs import MEASURED, needs_measured
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}
VEHICLE = Path(__file__).parents[2] / "dbc" / "toyota_rav4_2017.toml"


def planted(
    simulator: str, effects: dict[str, dict[str, float]], seed: int, profile: str
) -> tuple[Trace, list[list[float]]]:
    drive = PLANTS[simulator](effects, seed=seed, minutes=6, noise="ar1", profile=profile)
    (times,) = drive.truth["episodes"].values() if effects else ([],)
    return trace(drive), times


def inside(t: np.ndarray, stretches: list[list[float]] | list[tuple[float, float]]) -> np.ndarray:
    out = np.zeros(t.size, dtype=bool)
    for start, stop in stretches:
        out |= (t >= start) & (t < stop)
    return out


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
@pytest.mark.parametrize(("profile", "seed"), [("mixed", 31), ("urban", 32)])
def test_a_clean_drive_loses_nothing_to_a_mask(simulator: str, profile: str, seed: int) -> None:
    drive, _ = planted(simulator, {}, seed, profile)
    usable, masked = masks.recognise(drive)
    assert not masked
    assert usable.all()


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
@pytest.mark.parametrize(
    ("effect", "parameters", "seed"),
    [
        ("cruise_control", {}, 41),
        ("gear_shift", {}, 42),
        ("stale_signal", {"signal": 1.0}, 44),  # the own speed hangs
        ("stale_signal", {"signal": 2.0}, 49),  # the radar hangs
    ],
)
def test_planted_episodes_are_masked_when_they_happen(
    simulator: str, effect: str, parameters: dict[str, float], seed: int
) -> None:
    """Nearly all of their time is taken, and hardly any time of others is called by their name."""
    drive, times = planted(simulator, {effect: parameters}, seed, "mixed")
    usable, masked = masks.recognise(drive)
    there, named = inside(drive.t, times), [(m.start, m.stop) for m in masked if m.effect == effect]
    assert times
    assert named
    found = inside(drive.t, named)
    # clutch and frozen value show themselves up to half a second late
    edges = inside(drive.t, [[start - 1.0, stop + 1.0] for start, stop in times])
    assert (found & there).sum() >= 0.7 * there.sum()
    assert not (found & ~edges).any()
    assert not (usable & found).any()


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
def test_a_pedal_that_stands_still_is_a_foots_matter_and_not_masked(simulator: str) -> None:
    """A hung pedal and a held one are indistinguishable: the search of episodes in the pedal decides, no mask."""
    drive, times = planted(simulator, {"stale_signal": {"signal": 0.0}}, 52, "mixed")
    assert times
    assert not masks.recognise(drive)[1]


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
def test_another_vehicle_ahead_masks_the_seconds_after_it(simulator: str) -> None:
    drive, times = planted(simulator, {"cut_in": {}}, 44, "mixed")
    usable, masked = masks.recognise(drive)
    starts = [m.start for m in masked if m.effect == "cut_in"]
    assert starts
    for at, _ in times:
        assert min(abs(start - at) for start in starts) < 1.0
        assert not usable[(drive.t > at + 0.5) & (drive.t < at + 2.0)].any()


@needs_measured
def test_cruise_control_takes_most_of_the_rav4s_minute() -> None:
    report = canid.diagnose(canid.read_trace(MEASURED / "rav4/rav4_highway.blf", VEHICLE))
    cruising = sum(m.stop - m.start for m in report.masked if m.effect == "cruise_control")
    assert report.verdict.value == "not_enough_data"
    assert cruising == pytest.approx(49.2, abs=1.0)
    assert "cruise_control" in report.says or "lasts" in report.says
