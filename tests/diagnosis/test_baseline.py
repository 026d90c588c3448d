"""A baseline that does not describe the drive names nothing; its form is the driver's; the operating point is not time."""

from __future__ import annotations

import numpy as np
import pytest

from canid.mathematics.estimators.speed_difference import thinned
from canid.models.diagnosis import masks
from canid.models.diagnosis.diagnose import diagnose
from canid.models.diagnosis.driver import baseline_form
from canid.models.diagnosis.driver.driver_model import lagged
from canid.models.diagnosis.fitting.likelihood import Output, fit_noise
from canid.models.diagnosis.prepared_drive import ready
from canid.models.effects import CATALOGUE
from canid.models.effects.wanted_gap import Form
from canid.values.findings import Report, Verdict, extends
from canid.values.types import Trace
from tests import seeds
from tests.plants import loop_noise, plant_one, plant_two
from tests.plants.measurement import trace
from tests.plants.time_invariant import Follower, drawn, drive, lead_speed
from tests.seeds import mostly

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}
DRIVERS = tuple(effect for effect in CATALOGUE if effect.where == "driver")
# effects that say that the driver is another one later on
OF_TIME = {effect.id for effect in CATALOGUE if effect.timeless}


def follow(law: str, seed: int, minutes: float = 10.0, **changes: float) -> tuple[Follower, Trace]:
    rng = np.random.default_rng([seed, len(law)])
    follower = drawn(law, rng)._replace(**changes)
    return follower, drive(follower, lead_speed(minutes, rng), rng)


def outputs(y: np.ndarray) -> Output:
    none = np.zeros(y.size, dtype=bool)
    return Output(y, ~none, none, -np.inf, none, np.inf, 0.1)


def test_an_offset_in_the_residual_is_no_memory_of_the_noise() -> None:
    """White noise with a mean is white: a root at 1 instead would leave the offset unidentified."""
    rng = np.random.default_rng(seeds.seed("offset"))
    residual = 20.0 + rng.normal(size=4000)
    noise = fit_noise(outputs(residual), residual, 4, np.ones(4000))
    assert np.abs(noise.A[1:]).max() < 0.15
    assert noise.sd == pytest.approx(1.0, abs=0.1)


def test_the_noise_model_is_stationary_whatever_the_residual() -> None:
    """A residual that grows, as where a pedal is held while the demand moves away, gives no growing noise."""
    rng = np.random.default_rng(seeds.seed("growing"))
    residual = np.tile(np.exp(0.12 * np.arange(40)), 100) + rng.normal(size=4000)
    for p in (2, 9, 25):
        noise = fit_noise(outputs(residual), residual, p, np.ones(4000))
        assert np.abs(np.roots(noise.A)).max() < 1.0


def test_a_lag_at_its_bound_of_0_is_seen_to_matter() -> None:
    """A fit takes differences of a few hundred thousandths of a second: without one there it never leaves the bound."""
    x, step = np.sin(0.05 * np.arange(200.0)), 3e-5
    slope = (lagged(x, step, 0.1) - lagged(x, 0.0, 0.1)) / step
    assert slope[1:] == pytest.approx(-np.diff(x) / 0.1, rel=1e-6)


@pytest.mark.slow("fits planted drives")
def test_an_acceleration_that_is_the_difference_of_the_recorded_speed_is_taken_at_every_second_sample(
    seed: int,
) -> None:
    """Its noise is the speed's, which is in headway and range rate as well; an acceleration of its own is taken whole."""
    own = loop_noise.follower(seed, 0.0, minutes=3.0, bursts=0.5)
    noise = np.random.default_rng(seed).normal(0.0, 0.003, own.t.size)
    speed = np.round(own.signals["speed"] + noise, 3)
    rate = own.signals["range_rate"] + own.signals["speed"] - speed
    output = np.gradient(speed, own.dt)
    signals = {**own.signals, "speed": speed, "range_rate": rate, "accel": output}
    derived = own._replace(output=output, signals=signals)
    for drive_, dt in ((own, 0.1), (derived, 0.2)):
        usable, _ = masks.recognise(drive_, CATALOGUE)
        prepared = ready(drive_, usable)
        assert prepared is not None
        assert prepared.trace.dt == pytest.approx(dt)


def test_every_second_sample_is_of_every_column(seed: int) -> None:
    own = loop_noise.follower(seed, 0.0, minutes=1.0)
    n = own.t.size
    whole = own._replace(bound=np.zeros(n), variance=np.ones((n, 3)))
    halved = thinned(whole)
    for name, column in whole._asdict().items():
        if isinstance(column, np.ndarray) and column.shape[:1] == (n,):
            assert getattr(halved, name)[:2].tolist() == column[:4:2].tolist(), name


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
def test_attention_gaps_in_white_noise_leave_a_baseline_that_describes_the_drive(simulator: str) -> None:
    """Ten attention gaps: a stationary noise, and a simulation far better than the mean.

    One of three may miss: the gaps' long errors can pass for a slow noise that hides an offset (2 of 75 urban drives
    of simulator two), so that two misses are chance once in 500 runs; such a drive is refused, not named.
    """
    missed = []
    for k in range(3):
        seed = seeds.seed(f"attention {simulator} {k}")
        seen = trace(
            PLANTS[simulator](
                {"attention_gap": {"per_minute": 1.0, "duration": 4.0}},
                seed=seed, minutes=10, noise="white", profile=("mixed", "urban", "motorway")[k],
            )
        )  # fmt: skip
        prepared = ready(seen, np.ones(seen.t.size, dtype=bool))
        assert prepared is not None
        data, fitted = prepared.data, prepared.fitted
        assert np.abs(np.roots(fitted.noise.A)).max() < 1.0, seed
        free = data.output.usable & ~data.output.hidden
        left = (data.output.y - fitted.fitted.model)[free]
        if np.mean(left**2) > 0.9 * np.var(data.output.y[free]):
            missed.append(seed)
    assert len(missed) < 2, missed


def assert_refused(report: Report, reason: str) -> None:
    assert report.verdict is Verdict.UNEXPLAINED, report.says
    assert reason in report.says
    assert "What would help" in report.says or "canid check" in report.says
    assert not report.findings
    assert np.isnan(report.gain.value)
    assert np.isnan(report.unexplained.value)
    assert np.array_equal(report.baseline.simulated, report.extended.simulated, equal_nan=True)


def planted(K1: float, K2: float, delay: int, seed: int) -> Trace:
    """A drive whose inputs are a stable follower's, and whose output answers them with other gains, `delay` samples late."""
    follower, seen = follow("ovrv", seed)
    rng = np.random.default_rng(seed)
    speed, gap, rate = (seen.signals[role] for role in ("speed", "gap", "range_rate"))
    demand = K1 * (gap / np.maximum(speed, 2.0) - follower.T) + K2 * rate
    accel = np.roll(demand, delay) + 0.05 * rng.normal(size=gap.size)
    return seen._replace(output=accel, signals=seen.signals | {"accel_command": accel})


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("K1", "K2", "delay", "reason"),
    [(0.5, -0.6, 3, "negative"), (0.3, 4.0, 10, "unstable")],
)
def test_a_driver_that_cannot_follow_is_refused(K1: float, K2: float, delay: int, reason: str) -> None:
    report = diagnose(planted(K1, K2, delay, seeds.seed(reason)))
    assert_refused(report, reason)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("law", seeds.in_turn(["idm", "ovrv"], 2, "constant"))
def test_a_driver_whose_law_never_changes_has_not_changed(law: str) -> None:
    """On the first drive or on the second: of some 30 drives one has such a name."""
    instead = []
    for k in range(2):
        seed = seeds.seed(f"constant {law} {k}")
        _, seen = follow(law, seed)
        report = diagnose(seen)
        named = {name for f in report.findings for name in (f.effect, *f.rivals)}
        if not named & OF_TIME:
            return
        instead.append((seed, report.says))
    pytest.fail(f"named: {instead}")


# The form is found in 117 of 120 drives (IDM, OVRV): a miss among the first two and three among five are chance less than
# once in 10,000 runs
FIRST_DRAWS, DRAWS, FOUND = 2, 5, 3


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("law", "form"), seeds.in_turn([("ovrv", Form.GAP), ("idm", Form.FREE_SPEED)], 2, "form")
)
def test_the_form_of_the_baseline_is_the_drivers(law: str, form: Form) -> None:
    """Where the speed changes between town and motorway, the form is found and its parameters are near the truth."""
    follower = Follower(law, T=1.3, s0=4.0, v0=30.0, a=1.2, b=1.8, k1=0.05, k2=0.4)
    misses, found = [], 0
    for k in range(DRAWS):
        rng = np.random.default_rng(seeds.seed(f"form {law} {k}"))
        lead = lead_speed(20.0, rng, levels=(8.0, 25.0, 12.0, 27.0, 18.0, 9.0, 26.0, 14.0))
        seen = drive(follower, lead, rng, 0.06)
        usable, _ = masks.recognise(seen, CATALOGUE)
        prepared = ready(seen, usable)
        assert prepared is not None
        choice = baseline_form.choose(prepared.trace, prepared.data, prepared.fitted, DRIVERS)
        if choice.fitted.model.form is not form:
            misses.append(choice.why)
            continue
        found += 1
        stated = baseline_form.stated(prepared.data, choice.fitted, choice.why).parameters
        v0 = stated["v0"].value if form is Form.FREE_SPEED else np.inf
        truth = follower.v0 if form is Form.FREE_SPEED else np.inf
        # T and s0 trade off; the wanted gap at the speeds that were driven does not (largest of 78 drives: 14 %)
        for v in (10.0, 18.0, 26.0):
            wanted = (stated["s0"].value + stated["T"].value * v) / np.sqrt(1 - (v / v0) ** 4)
            true = (follower.s0 + follower.T * v) / np.sqrt(1 - (v / truth) ** 4)
            assert wanted == pytest.approx(true, rel=0.2)
        if found == FIRST_DRAWS and not misses:
            return
    assert found >= FOUND, misses


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", seeds.in_turn([*PLANTS, "acceleration"], 2, "time headway"))
@mostly(0.95)
def test_a_time_headway_driver_keeps_the_form(simulator: str, seed: int) -> None:
    """And where nothing is found, both models are the same one."""
    if simulator == "acceleration":
        _, seen = follow("headway", seed)
    else:
        seen = trace(PLANTS[simulator]({}, seed=seed, minutes=8, noise="ar1", profile="mixed"))
    report = diagnose(seen)
    assert report.baseline.form is not None
    assert report.baseline.form.name == "time_headway", (seed, report.baseline.form.says)
    if not extends(report):
        assert report.extended.fit_percent == report.baseline.fit_percent
        assert report.extended.channels == report.baseline.channels


@pytest.mark.slow("diagnoses planted drives")
def test_an_acceleration_has_no_unit_of_a_pedal() -> None:
    _, seen = follow("idm", seeds.seed("units"))
    report = diagnose(seen)
    for finding in report.findings:
        assert "%" not in finding.says
        assert not any("%" in unit for unit in finding.units.values())
        assert not any(effect.id in finding.rivals for effect in CATALOGUE if effect.where == "vehicle")
    assert not any(
        " %" in one.why for one in report.not_testable if one.effects[0] in {e.id for e in DRIVERS}
    )
    named = {finding.effect for finding in report.findings}
    assert not any(named & set(one.effects) for one in report.not_testable)
