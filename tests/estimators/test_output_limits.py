"""A pedal at 100 % and an acceleration at its maximum: intervals hold the truth, the limit is stated, no cause is named."""

from __future__ import annotations

import numpy as np
import pytest

import canid
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.identification_json import document
from canid.ui.views.identification_text import summary
from canid.values.types import QUOTED, LearnGate, Trace
from tests.fixtures.measured_logs import files, needs_measured
from tests.plants.outside_drives import HELLY, Drive, accel_drive, helly_drive
from tests.plants.quoted_intervals import trace


def identify(drive: Trace, sliding: bool = False) -> Identified:
    return canid.identify(drive, select_orders=False, sliding=sliding)


def identified(drive: Drive, sliding: bool = False) -> Identified:
    return identify(trace(drive), sliding)


def at_100_percent(seed: int, seconds: float = 600.0) -> Drive:
    return helly_drive(np.random.default_rng([seed, 41]), seconds=seconds, level=95.0)


@pytest.mark.slow("identifies a drive of ten minutes")
def test_both_estimators_hold_the_truth_of_a_pedal_that_is_often_pressed_down(seed: int) -> None:
    """On three of four drives each, whole drive; the chance that intervals of 95 % do less is 1.4 %."""
    held = {"fopdt": 0, "armax": 0}
    for k in range(4):
        drive = at_100_percent(seed + k)
        assert np.mean(drive.columns["pedal"] == 100.0) > 0.1
        for name, whole in identified(drive).whole.items():
            assert whole is not None
            K = whole.channels["range_rate"].K
            held[name] += bool(K.low <= HELLY.k_range_rate <= K.high)
    assert min(held.values()) >= 3


@pytest.mark.long("identifies whole drives")
def test_a_limit_is_stated_in_text_and_json() -> None:
    result = identified(at_100_percent(3, 150.0))
    (end,) = document(result, "drive.csv", "car").output_limits
    assert (end.side, end.value) == ("upper", 100.0)
    assert f"limit: {end.says[:40]}" in " ".join(summary(result, "drive.csv", "car"))
    assert result.time.usable < result.time.driving - end.seconds


@pytest.mark.long("identifies whole drives")
def test_a_drive_far_from_both_ends_states_none_and_uses_every_sample() -> None:
    drive = helly_drive(np.random.default_rng(2), seconds=120.0, level=50.0)
    result = identified(drive)
    assert result.output_limits == ()
    assert LearnGate.OUTPUT_LIMIT not in trace(drive).gate


@pytest.mark.long("identifies whole drives")
def test_live_windows_say_that_the_output_is_at_its_limit() -> None:
    drive = at_100_percent(4, 150.0)
    # from here on the lead is too fast for this car
    columns = dict(drive.columns)
    columns["pedal"] = np.where(drive.t > 110.0, 100.0, columns["pedal"])
    last = identified(drive._replace(columns=columns), sliding=True).windows[-1]
    assert last.says == LearnGate.OUTPUT_LIMIT.value


@pytest.mark.long("identifies whole drives")
def test_of_a_wheel_at_its_lock_no_gain_is_quoted() -> None:
    drive = canid.read_trace("replay_logs/lane_keeping.blf", "generic_lane")
    assert QUOTED[identify(drive).channels["lateral_offset"].status]
    wheel = np.clip(drive.output, *np.nanquantile(drive.output, [0.05, 0.95]))
    result = identify(drive._replace(output=wheel, signals={**drive.signals, "steering_angle": wheel}))
    assert [end.side for end in result.output_limits] == ["lower", "upper"]
    assert not QUOTED[result.channels["lateral_offset"].status]
    assert "at its limit" in result.whole["armax"].details["says"]


@pytest.mark.slow("diagnoses a drive")
@pytest.mark.parametrize("kind", ["pedal", "accel"])
def test_no_cause_is_named_because_of_a_limit(kind: str) -> None:
    rng = np.random.default_rng([8, 41])
    drive = (
        helly_drive(rng, seconds=420.0, level=94.0)
        if kind == "pedal"
        else accel_drive(rng, seconds=420.0, limits=(-np.inf, 0.35))
    )
    report = canid.diagnose(trace(drive), arbitrated=False)
    assert [finding.effect for finding in report.findings] == []
    assert "is at its upper limit" in report.steps[0]


@pytest.mark.slow("identifies whole measured drives")
@needs_measured
@pytest.mark.parametrize(
    "name", files("reports/41-full-pedal/full_11.csv", "reports/41-full-pedal/s5_truck97.csv")
)
def test_public_drives_at_an_end_of_the_pedal(name: str) -> None:
    """Their README: K 6 %/(m/s), intervals hold it."""
    result = canid.identify(name, select_orders=False, sliding=False)
    for whole in result.whole.values():
        assert whole is not None
        K = whole.channels["range_rate"].K
        assert K.low < 6.0 < K.high
    assert [end.side for end in result.output_limits] == ["upper"]
