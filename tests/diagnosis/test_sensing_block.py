"""What two signals say of one thing is held against each other; right sensors are left alone, wrong ones are named."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from canid.models.diagnosis import corrections
from canid.models.diagnosis.diagnose import diagnose
from canid.models.diagnosis.sensing import sensing_block
from canid.models.diagnosis.sensing.kinematics import averages
from canid.models.effects import CATALOGUE
from canid.values.findings import Verdict
from canid.values.types import NAN, Trace
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}


@cache
def clean(seed: int) -> Trace:
    return drive("one", {}, seed)


def drive(simulator: str, effects: dict[str, dict[str, float]], seed: int, profile: str = "mixed") -> Trace:
    return trace(PLANTS[simulator](effects, seed=seed, minutes=6, noise="ar1", profile=profile))


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
@pytest.mark.parametrize(("profile", "seed"), [("mixed", 11), ("urban", 12), ("motorway", 13)])
def test_right_sensors_are_not_blamed(simulator: str, profile: str, seed: int) -> None:
    report = sensing_block.diagnose_sensing(drive(simulator, {}, seed, profile))
    assert not report.findings
    assert report.block.state == "adequate"
    assert all(check.passed is not False for check in report.checks)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("simulator", "effect", "parameters", "seed"),
    [
        ("one", "range_rate_scale", {"share": 0.07}, 21),
        ("two", "range_rate_scale", {"share": -0.12}, 22),
        ("two", "speed_scale", {"share": 0.02}, 23),
        ("one", "speed_scale", {"share": -0.04}, 24),
        ("one", "range_rate_sign", {}, 25),
        ("two", "range_rate_sign", {}, 26),
    ],
)
def test_a_wrong_scale_or_sign_is_named_with_its_size(
    simulator: str, effect: str, parameters: dict[str, float], seed: int
) -> None:
    report = sensing_block.diagnose_sensing(drive(simulator, {effect: parameters}, seed, "urban"))
    assert [finding.effect for finding in report.findings] == [effect]
    (finding,) = report.findings
    assert finding.evidence > finding.needed
    assert finding.gain.low > 0.5
    for name, value in parameters.items():
        iv = finding.parameters[name]
        assert iv.low < iv.value < iv.high
        assert iv.value == pytest.approx(value, abs=0.006)


def scaled(seen: Trace, **factors: float) -> Trace:
    """A drive of which gap or range rate, reports included, have another scale."""
    role = {f"{name}{suffix}": x for name, x in factors.items() for suffix in ("", "_reported")}
    signals = {name: x * role.get(name, 1.0) for name, x in seen.signals.items()}
    return seen._replace(signals=signals)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("factor", [1.08, 0.94])
def test_a_sound_range_rate_is_not_corrected_for_a_wrong_gap(factor: float) -> None:
    """A small error of the gap is one of two causes; what is not known is not corrected."""
    for simulator, seed in (("one", 32), ("two", 34)):
        seen = scaled(drive(simulator, {}, seed, "urban"), gap=factor)
        found = sensing_block.diagnose_sensing(seen).findings
        assert {name for one in found for name in (one.effect, *one.rivals)} >= {"range_scale"}
        # either of the two has its size
        either = [one for one in found if {"range_scale", "range_rate_scale"} == {one.effect, *one.rivals}]
        assert all(set(one.rival_causes[0].parameters) == {"share"} for one in either)
        right, _ = corrections.corrected(seen, found, CATALOGUE)
        np.testing.assert_array_equal(right.signals["range_rate"], seen.signals["range_rate"])


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("factors", "effect"),
    [({"gap": 1 / 0.3048}, "range_scale"), ({"range_rate": 3.6}, "range_rate_scale")],
)
def test_own_motion_decides_which_of_gap_and_range_rate_has_a_wrong_unit(
    factors: dict[str, float], effect: str
) -> None:
    """On one of two drives at least; on the other it may not know, and the sound signal of neither is changed."""
    names = []
    for simulator, seed in (("one", 36), ("two", 31)):
        clean = drive(simulator, {}, seed, "urban")
        seen = scaled(clean, **factors)
        found = sensing_block.diagnose_sensing(seen).findings
        names += [(one.effect, *one.rivals) for one in found]
        right, _ = corrections.corrected(seen, found, CATALOGUE)
        for role in {"gap", "range_rate"} - set(factors):
            # corrected or not, smoothed or as reported, its scale is the same
            sizes = [float(np.nanstd(of.signals[role])) for of in (right, clean)]
            assert sizes[0] == pytest.approx(sizes[1], rel=0.02)
    print(names)
    assert (effect,) in names
    assert all(effect in one for one in names)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(("simulator", "seed"), [("one", 2014), ("two", 2009)])
def test_an_old_radar_report_is_named_where_the_own_motion_shows_it(simulator: str, seed: int) -> None:
    late = PLANTS[simulator](
        {"radar_latency": {"delay": 0.28}}, seed=seed, minutes=15, noise="ar1", profile="urban"
    )
    report = sensing_block.diagnose_sensing(trace(late))
    assert [finding.effect for finding in report.findings] == ["radar_latency"], report.block.says
    assert set(report.findings[0].rivals) <= {"clock_skew"}
    iv = report.findings[0].parameters["delay"]
    assert iv.low < 0.28 < iv.high


def test_what_cannot_be_told_is_said_with_what_would_tell_it() -> None:
    seen = drive("one", {"range_offset": {"distance": 3.0}, "radar_latency": {"delay": 0.1}}, 31, "motorway")
    without = seen._replace(
        signals={k: v for k, v in seen.signals.items() if k not in ("gnss_speed", "accel")}
    )
    report = sensing_block.diagnose_sensing(without)
    assert not report.findings
    why = {effect: one.why for one in report.not_testable for effect in one.effects}
    assert {"range_offset", "standstill_gap", "speed_scale", "radar_latency", "clock_skew"} <= set(why)
    assert "gnss_speed" in why["speed_scale"]
    assert "accel" in why["radar_latency"]


@pytest.mark.slow("diagnoses planted drives")
def test_two_sensors_that_disagree_in_no_known_way_are_unexplained_and_shake_every_name() -> None:
    """A range rate with an error of its own: no scale, no sign."""
    seen = drive("one", {"looming_gain": {"exponent": 0.9}}, 33, "urban")
    drift = 0.6 * np.sin(seen.t / 3.0)
    signals = {role: x + drift if "range_rate" in role else x for role, x in seen.signals.items()}
    report = sensing_block.diagnose_sensing(seen._replace(signals=signals))
    assert report.block.state == "unexplained"
    assert not report.findings
    report = diagnose(seen._replace(signals=signals))
    assert report.verdict in (Verdict.UNEXPLAINED, Verdict.NOT_ENOUGH_DATA)
    assert all(finding.surrogate for finding in report.findings if finding.where == "driver")


@pytest.mark.slow("diagnoses planted drives")
def test_a_named_sensor_is_put_right_before_the_driver_is_looked_at() -> None:
    """The driver's gain comes out as on the same drive with a right sensor, and the report shows what the wrong one did."""
    clean = diagnose(drive("one", {}, 31, "urban"))
    # of a drive whose own motion shows which of gap and range rate is wrong
    wrong = diagnose(drive("one", {"range_rate_scale": {"share": 0.4}}, 31, "urban"))
    assert wrong.verdict is Verdict.NAMED
    assert wrong.says.startswith("CAUSE: In the sensing: ")
    assert [finding.where for finding in wrong.findings] == ["sensing"]
    K = clean.extended.channels["range_rate"].K
    before, after = wrong.shifts["range_rate K"]
    assert after.value == pytest.approx(K.value, rel=0.05)
    assert before.value < 0.85 * K.value


@pytest.mark.slow("diagnoses planted drives")
def test_a_cause_that_is_not_in_the_catalogue_is_not_named_but_unexplained() -> None:
    catalogue = tuple(effect for effect in CATALOGUE if effect.id != "speed_scale")
    report = corrections.diagnose_context(
        drive("two", {"speed_scale": {"share": 0.04}}, 37), catalogue
    ).sensing
    assert not report.findings
    assert report.block.state == "unexplained"


def test_a_gap_with_a_rate_of_its_own_is_averaged_without_being_differentiated() -> None:
    """Noise of 0.3 m leaves less than 0.1 m/s on the change of the gap over one window, and no bias."""
    rng, t = np.random.default_rng(5), 0.1 * np.arange(6000)
    of = averages(
        30 + 5 * np.sin(t / 9) + rng.normal(0, 0.3, t.size), 5 / 9 * np.cos(t / 9), np.ones(t.size, bool), 0.1
    )
    error = of.rate - of.change
    assert np.std(error) < 0.1
    assert abs(error.mean()) < 4 * np.std(error) / np.sqrt(error.size / 2)
    assert of.noise == pytest.approx(float(np.std(error)), rel=0.35)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("n", [0, 1, 50])
@pytest.mark.parametrize("role", ["gap", "range_rate", "speed", "accel", ""])
def test_weak_data_are_no_error(n: int, role: str) -> None:
    seen = clean(11)
    part = slice(0, n)
    signals = {k: np.full(n, NAN) if k == role else x[part] for k, x in seen.signals.items()}
    short = seen._replace(
        t=seen.t[part], output=seen.output[part], inputs=seen.inputs[part], gate=seen.gate[part],
        learn=seen.learn[part], segment=seen.segment[part], signals=signals,
    )  # fmt: skip
    report = corrections.diagnose_context(short, CATALOGUE)
    assert not report.sensing.findings
    assert not report.vehicle.findings
