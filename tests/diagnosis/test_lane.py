"""Lane keeping: the model is the simulated driver, planted causes are named, clean drives stay clean, weak data say so.

Drives are of two simulators, canid's own and tests/plants/lane_two.py; drivers, roads, noise and strengths are drawn anew in
each run. Bounds on counts fail by chance at most once in 10,000 runs, at rates that the benchmark measured (docs/lane.md).
"""

from __future__ import annotations

import numpy as np
import pytest

import canid
from canid.models.diagnosis.lane import lane_fit, lane_null
from canid.models.diagnosis.lane.lane_fit import FittedLane
from canid.models.diagnosis.lane.lane_model import LaneData, polynomial, prepare, steered, with_effects
from canid.models.effects import LANE_CATALOGUE
from canid.models.simulation import Steering, simulate
from canid.signals.samples.learning_gate import with_limits
from canid.values.findings import Report, Verdict
from canid.values.types import QUOTED, Array, LearnGate, Trace
from tests.plants import lane_two
from tests.plants.lane_drives import CLEAN, EFFECTS, LaneDrive, make
from tests.plants.lane_measurement import rounded
from tests.seeds import mostly

BY_ID = {effect.id: effect for effect in LANE_CATALOGUE}
# Table 1 of Chen & Ulsoy 2001 in the model's parameters: offset, K, Kd, τ, π, θ, wanted position
PAPER = Steering()


def in_model(steering: Steering) -> Array:
    """Parameters of the model that is this ARMAX."""
    a1, a2 = steering.a
    gain = 1 + a1 + a2
    product = a2 / gain * 0.01
    tau = (-a1 / gain - 2 * product / 0.01) * 0.1
    return np.array([0.0, sum(steering.b) / gain, -steering.b[1] / gain * 0.1, tau, product, 0.1, 0.0])


def exact(columns: dict[str, Array]) -> LaneData:
    """What the driver saw at each decision, without any sensor."""
    every = {role: x[::10] for role, x in columns.items()}
    n = every["t"].size
    drive = Trace(
        0.1, every["t"], every["steering_angle"], every["lateral_offset"][:, None], ("lateral_offset",),
        (LearnGate.OPEN,) * n, np.ones(n, dtype=bool), np.zeros(n, dtype=np.int64), every,
    )  # fmt: skip
    return prepare(drive, np.ones(n, dtype=bool))


def fitted(data: LaneData) -> FittedLane:
    found = lane_fit.baseline(data)
    assert found is not None
    return found


def standing(report: Report) -> set[str]:
    """Names that the report stands by, and those that explain it as well."""
    return {name for f in report.findings if not f.surrogate for name in (f.effect, *f.rivals)}


# --- the model ---------------------------------------------------------------------------------------------


def test_the_model_holds_the_armax_of_the_paper() -> None:
    """Poles and gain of Table 1, in and out."""
    q = in_model(PAPER)
    np.testing.assert_allclose(polynomial(q[3], q[4], 0.1)[:3], [1.0, *PAPER.a], atol=1e-12)


@pytest.mark.parametrize("effect", ["", *(e.id for e in LANE_CATALOGUE if e.lane or e.gain or e.dead_time)])
def test_without_noise_the_model_is_the_simulated_driver(effect: str) -> None:
    """One definition for simulation and fit: along the same offsets both give the same angles."""
    strength = BY_ID[effect].found_at[0] if effect else ()
    drive = simulate(
        2,
        3,
        "lane",
        driver=Steering(noise_sd=0.0),
        hide={effect: strength} if effect else None,
        curvature_sd=3e-4,
    )
    data = exact(drive.columns)
    model = with_effects([BY_ID[effect]] if effect else [])
    angle = steered(model, data, np.r_[in_model(PAPER), strength])
    # a drive ends one decision earlier for the grid; the rate of a drifting dead time is taken between two grid points by
    # the one, between two decisions by the other; simulated curves are read to 10 ms
    atol = 1e-9 if effect in ("", "lateral_dead_zone") else 0.03 * float(np.std(angle))
    np.testing.assert_allclose(angle[30:-20], data.output.y[30:-20], atol=atol)
    if effect:
        plain = steered(with_effects([]), data, in_model(PAPER))
        assert np.std(plain - data.output.y) > 4 * np.std((angle - data.output.y)[30:-20])


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_the_fit_finds_the_driver(seed: int) -> None:
    """On 10 min the simulated driver is within what the likelihood allows: at most 6 standard deviations of any."""
    made = make(LaneDrive("one", CLEAN, seed))
    report = canid.diagnose(made.trace)
    channel = report.baseline.channels["lateral_offset"]
    half = 0.5 * (channel.K.high - channel.K.low)
    assert abs(channel.K.value - made.gain) < 3 * half
    assert channel.tau_plus_dead_time.value == pytest.approx(0.6, abs=0.5)
    # of a driver with three lags the sum alone is theirs
    assert not {"tau", "dead_time"} & set(QUOTED[channel.status])


# --- the null ----------------------------------------------------------------------------------------------


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_a_replicate_is_the_same_driver_on_the_same_road(seed: int) -> None:
    """The recorded angles give the recorded offsets; with noise drawn again, the fit finds the driver again."""
    drive = make(LaneDrive("two", CLEAN, seed, 6.0)).trace
    data = prepare(drive, np.ones(drive.t.size, dtype=bool))
    driver, on = fitted(data), lane_null.road(data)
    assert on is not None
    p, y, u = on.of_offset.size, data.offset, data.output.y
    for k in range(p, y.size, 97):
        again = on.of_offset @ y[k - p : k][::-1] + on.of_angle @ u[k - p : k][::-1] + on.rest[k]
        assert again == pytest.approx(y[k], abs=1e-9)
    replicates = lane_null.simulated(data, driver, on, 3, [seed])
    assert len(replicates) >= 2
    for one in replicates:
        assert np.std(one.output.y - u) > 0.3 * np.std(u)
        q = fitted(one).q
        assert q[2] == pytest.approx(driver.q[2], rel=0.5)
        assert q[3] + q[5] == pytest.approx(driver.q[3] + driver.q[5], abs=0.4)


# --- what is named -----------------------------------------------------------------------------------------

CLEAN_DRIVES = [LaneDrive(simulator, CLEAN, k) for simulator in ("one", "two") for k in range(4)]
# `second_lag` is not testable on a road: see test_a_second_lag_is_not_testable
NAMEABLE = tuple(name for name in EFFECTS if BY_ID[name].identifiable)


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_clean_drives_stay_clean(seed: int) -> None:
    """At most 2 of 8 get a name, and at most 4 are unexplained.

    At 0.5 % of false names (that is what the threshold promises), 3 of 8 have a chance of 7e-6.
    """
    reports = [canid.diagnose(make(one._replace(seed=seed + 31 * one.seed)).trace) for one in CLEAN_DRIVES]
    assert sum(bool(standing(one)) for one in reports) <= 2, [one.says for one in reports if standing(one)]
    unexplained = [one.says for one in reports if one.verdict is Verdict.UNEXPLAINED]
    assert len(unexplained) <= 4, unexplained


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(("share", "lock"), [(0.05, (-3.0, 1.9)), (0.25, (-2.1, 1.1))])
def test_a_wheel_at_its_lock_is_no_attention_gap(share: float, lock: tuple[float, float]) -> None:
    """Sampled at 20 Hz in steps of 0.1°: both locks are found, no cause is named, and no gain is quoted."""
    drive = lane_two.plant({}, seed=1, minutes=10.0, noise="slow", curves=3e-4, lock=lock)
    columns = {name: x[::5] for name, x in drive.columns.items()}
    columns["steering_angle"] = rounded(columns["steering_angle"], 0.1)
    trace = canid.from_arrays(time=columns.pop("t"), task="lane_keeping", **columns)
    at = np.array([gate is LearnGate.OUTPUT_LIMIT for gate in with_limits(trace).gate])
    assert at.mean() > 0.8 * share
    assert {round(y, 9) for y in trace.output[at].tolist()} == set(lock)
    report = canid.diagnose(trace)
    assert [finding.effect for finding in report.findings] == []
    assert not QUOTED[report.extended.channels["lateral_offset"].status]
    assert "at its lock" in " ".join(block.says for block in report.blocks)


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_planted_causes_are_named(seed: int) -> None:
    """Of each cause on a drive of either simulator, most are named, and hardly one is taken for another."""
    found, wrong = {}, {}
    for k, effect in enumerate(NAMEABLE):
        for simulator in ("one", "two"):
            drive = LaneDrive(simulator, effect, seed + 57 * k)
            report = canid.diagnose(make(drive).trace)
            # nobody is followed here
            assert "another lead" not in report.says
            names = standing(report)
            found[drive] = effect in names
            if names and effect not in names:
                wrong[drive] = names
    missed = [drive for drive, right in found.items() if not right]
    print(f"missed: {missed}")
    assert len(missed) <= MOST_MISSED, missed
    assert len(wrong) <= 2, wrong


# of 10
MOST_MISSED = 7
