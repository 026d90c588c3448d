"""A gain that a hidden cause moves out of its interval is an average over the cause, and `identify` does not quote it."""

from __future__ import annotations

import pytest

from canid.analysis.drive.drive_parameters import identify
from canid.mathematics.identification.identifiability import quotable
from canid.models.diagnosis import causes_not_excluded
from canid.signals.samples.trace_assembly import part
from canid.values.types import Trace
from tests import seeds
from tests.plants import plant_one, plant_two
from tests.plants.lane_drives import SIMULATORS, LaneDrive, make
from tests.plants.measurement import trace


def drive(seed: int, effects: dict[str, dict[str, float]], plant: int) -> tuple[Trace, dict[str, float]]:
    """A planted drive of ten minutes, and its driver."""
    made = (plant_one, plant_two)[plant].plant(effects, seed=seed, minutes=10.0, noise="ar1", profile="mixed")
    return trace(made), made.truth["driver"]


# gains on relative speed are a third too small with such a dead zone, and clean drives keep theirs: see
# `python -m benchmarks.hidden_effects.averaged_gains`
@pytest.mark.long("searches drives for causes")
@seeds.mostly(0.9)
def test_an_average_over_a_dead_zone_is_not_quoted(seed: int) -> None:
    given, driver = drive(seed, {"relative_speed_dead_zone": {"width": 1.2}}, seed % 2)
    result = identify(given, select_orders=False, sliding=False).whole["fopdt"]
    assert result is not None
    channel = result.channels["range_rate"]
    assert channel.K.high < driver["K2"]
    assert not quotable(channel, "K")
    assert any("range rate" in line and "`canid diagnose`" in line for line in result.lines)


@pytest.mark.slow("a drive of ten minutes identified: 4 CPU-s")
@seeds.mostly(0.9)
def test_a_clean_drive_keeps_its_gains(seed: int) -> None:
    given, driver = drive(seed, {}, seed % 2)
    result = identify(given, select_orders=False, sliding=False).whole["fopdt"]
    assert result is not None
    gain = result.channels["range_rate"]
    assert quotable(gain, "K")
    assert gain.K.low <= driver["K2"] <= gain.K.high


@pytest.mark.long("searches drives for causes")
def test_too_short_a_drive_shows_no_cause() -> None:
    given, _ = drive(5, {"looming_gain": {"exponent": 1.0}}, 0)
    assert causes_not_excluded.shown(part(given, slice(0, round(60.0 / given.dt)))) == ()


@pytest.mark.long("searches drives for causes")
@seeds.mostly(0.8)
def test_in_the_lane_as_well(seed: int) -> None:
    """A driver who lets the car move within a zone steers the less the wider it is."""
    made = make(LaneDrive(SIMULATORS[seed % 2], "lateral_dead_zone", seed))
    result = identify(made.trace, select_orders=False, sliding=False).whole["armax"]
    assert result is not None
    channel = result.channels["lateral_offset"]
    assert abs(channel.K.low) < abs(made.gain)
    assert not quotable(channel, "K")
