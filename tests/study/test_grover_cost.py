"""What one fit per input costs: the bias of the omitted variable; the filter; the printed drivers found again."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.models.simulation import DriverTruth, simulate
from canid.values.types import Array, LearnGate, Trace
from canid_study.artifact import ClaimVerdict
from canid_study.grover import input_correlation, printed_drivers, reproduction, unscented
from canid_study.grover.drive_analysis import drive_of
from canid_study.grover.episodes import detrended, episodes_of
from canid_study.grover.input_correlation import (
    joint_gain,
    omitted_variable,
    per_input_gain,
    with_correlation,
)
from canid_study.grover.joint import Joint, one_input
from canid_study.grover.reduction import FirstOrder, response
from canid_study.grover.settings import GroverSettings
from canid_study.printed_numbers import GROVER_DRIVERS
from tests.seeds import mostly
from tests.study.test_grover_episodes import drive

DT = 0.1
TRUTH = FirstOrder(5.0, 0.5, 0.3, 0.0), FirstOrder(6.0, 0.4, 0.2, 0.0)
QUICK = GroverSettings(max_order=3, max_fitted=4, draws=10)


def inputs_of(seed: int, n: int = 3000) -> Array:
    """Two independent inputs with the spectra of headway error and range rate."""
    rng = np.random.default_rng(seed)
    shocks = rng.standard_normal((n, 2)) * np.array([0.05, 0.3])
    return np.asarray(lfilter([1.0], [1.0, -0.95], shocks, axis=0))


def outputs_of(inputs: Array, seed: int, noise: float, draws: int = 200) -> Array:
    rng = np.random.default_rng(seed + 1)
    clean = sum(
        one.K * response(u, one.tau, one.dead_time, DT) for u, one in zip(inputs.T, TRUTH, strict=True)
    )
    made = lfilter([noise], [1.0, -0.9], rng.standard_normal((len(inputs), draws)), axis=0)
    return detrended(np.asarray(clean)[:, None] + made)


@pytest.mark.parametrize("correlation", [-0.8, -0.3, 0.0, 0.5, 0.9])
def test_the_bias_is_that_of_the_omitted_variable(correlation: float, seed: int) -> None:
    """At the true lag the mean of K1 per input over the noise is K1 + K2 <x1, x2> / <x1, x1> (Theil 1957)."""
    u = with_correlation(inputs_of(seed), correlation)
    y = outputs_of(u, seed, 0.3)
    found = per_input_gain([y], [u[:, 0]], DT, [TRUTH[0].tau], TRUTH[0].dead_time)
    expected = omitted_variable([u], TRUTH, DT)
    assert float(found.mean()) == pytest.approx(
        expected, abs=5.0 * float(found.std()) / np.sqrt(len(found)) + 1e-6
    )
    # with equal lags and no dead time it is the textbook's K1 + K2 rho sd2 / sd1
    plain = tuple(one._replace(tau=0.0, dead_time=0.0) for one in TRUTH)
    textbook = TRUTH[0].K + TRUTH[1].K * correlation * float(u[:, 1].std() / u[:, 0].std())
    assert omitted_variable([u], plain, DT) == pytest.approx(textbook, rel=1e-6)


def test_the_joint_fit_has_no_such_bias(seed: int) -> None:
    """With both inputs the mean of K1 over the noise is the truth, at any correlation of the inputs."""
    for correlation in (-0.6, 0.6):
        u = with_correlation(inputs_of(seed), correlation)
        y = outputs_of(u, seed, 0.3)
        found = joint_gain(
            [y], [u], DT, [TRUTH[0].tau, TRUTH[1].tau], [one.dead_time for one in TRUTH], np.array([0.9])
        )
        assert float(found.mean()) == pytest.approx(TRUTH[0].K, abs=0.15)
        assert float(found.std()) < 1.0


def test_the_correlation_is_as_wanted_and_the_powers_stay(seed: int) -> None:
    """Turning the range rate changes neither standard deviation."""
    u = inputs_of(seed, 600)
    for wanted in (-0.9, 0.0, 0.7):
        x = with_correlation(u, wanted)
        assert float(np.corrcoef(x.T)[0, 1]) == pytest.approx(wanted, abs=1e-9)
        again = with_correlation(u, 0.0)
        np.testing.assert_allclose(x.std(axis=0), again.std(axis=0))


def test_the_cost_belongs_to_the_inputs_of_the_drive(seed: int) -> None:
    """On a drive's inputs the case without noise is the bias, the joint range holds the truth, and seeds repeat."""
    trace = drive(seed, 3.0, noise=1.0)
    found = episodes_of(trace).episodes
    joint = Joint({}, TRUTH, 0.0)
    cost = input_correlation.of_drive(trace, found, joint, 90.0, QUICK)
    assert cost is not None
    assert cost.recorded.loop
    assert [round(c.correlation, 6) for c in cost.cases[1:]] == [
        round(c, 6) for c in input_correlation.CORRELATIONS
    ]
    rising = [c.expected for c in cost.cases[1:]]
    assert rising == sorted(rising)
    assert input_correlation.of_drive(trace, found, joint, 90.0, QUICK) == cost
    assert input_correlation.of_drive(trace, (), joint, 90.0, QUICK) is None
    assert input_correlation.of_drive(trace, found, Joint({}, (), 0.0), 90.0, QUICK) is None


@mostly(0.95)
def test_the_filter_finds_a_driver_without_lag(seed: int) -> None:
    """A driver as the filter assumes, with noise that it knows: the gains are near, with intervals."""
    driver = DriverTruth(5.0, 0.0, 0.0, 6.0, 0.0, 0.0, noise_sd=0.5)
    trace = as_trace(simulate(5.0, seed, driver=driver).columns)
    found = unscented.of_drive(trace, episodes_of(trace).episodes)
    assert found.says == ""
    for gain, K in zip(found.gains, (5.0, 6.0), strict=True):
        assert gain.value == pytest.approx(K, rel=0.12)
        assert 0.0 < gain.high - gain.low < 2.0


def test_the_filter_says_why_it_has_nothing() -> None:
    """No gap, too few samples, no episode: a reason, no number."""
    trace = drive(1, 1.0)
    every = episodes_of(trace).episodes
    signals = {role: column for role, column in trace.signals.items() if role != "gap"}
    for of, which in ((trace._replace(signals=signals), every), (trace, ()), (trace, every[:0])):
        found = unscented.of_drive(of, which)
        assert found.says
        assert np.isnan(found.gains[0].value)


# --- reproduction --------------------------------------------------------------------------------------------


def as_trace(columns: dict[str, Array]) -> Trace:
    """A simulated drive on the grid, as if its sensors were exact."""
    t, step = columns["t"], round(DT / 0.01)
    at = slice(0, len(t), step)
    got = {
        role: columns[role][at]
        for role in ("pedal", "speed", "gap", "range_rate", "headway", "east", "north")
    }
    released = (got["pedal"] <= 0.5) | (columns["brake"][at] > 0)
    gate = tuple(LearnGate.PEDAL_FLOOR if r else LearnGate.OPEN for r in released)
    return Trace(
        DT,
        t[at],
        got["pedal"],
        np.column_stack([got["headway"] - 2.0, got["range_rate"]]),
        ("headway_error", "range_rate"),
        gate,
        ~released,
        np.zeros(len(gate), dtype=np.int64),
        got,
        bound=np.where(released, 0.0, np.nan),
    )


def test_the_printed_drivers_are_those_of_the_tables() -> None:
    """Four drivers, the same leads for each, as many drives as asked for, the printed lag as a lag."""
    made = list(printed_drivers.drives(3, (0.2,), seeds=2))
    assert len(made) == 8
    assert len({name for name, _ in made}) == 8
    for k, (name, one) in enumerate(made):
        printed = GROVER_DRIVERS[k // 2]
        assert name.startswith(printed.name)
        channels = one.truth["channels"]
        assert channels["headway_error"] == {"K": printed.K1, "tau": printed.tau1, "dead_time": 0.0}
        assert channels["range_rate"] == {"K": printed.K2, "tau": printed.tau2, "dead_time": 0.0}
    np.testing.assert_array_equal(made[0][1].columns["lead_speed"], made[2][1].columns["lead_speed"])
    assert not np.array_equal(made[0][1].columns["lead_speed"], made[1][1].columns["lead_speed"])


@mostly(0.95)
def test_the_joint_model_predicts_the_next_episode_better(seed: int) -> None:
    """Of a driver in closed loop: on the next episode the joint model fits better than the transfer functions per input."""
    driver = printed_drivers.truth_of(GROVER_DRIVERS[0])
    trace = as_trace(simulate(8.0, seed, profile="motorway", driver=driver).columns)
    found = drive_of("x", trace, QUICK._replace(max_order=8))
    held = [a.held for a in found.analyses if a.held is not None]
    assert len(held) >= 3
    assert np.median([h.joint for h in held]) > np.median([h.high for h in held])
    assert found.cost is not None
    assert found.cost.gate_rejects > 50.0


@mostly(0.95)
def test_a_small_reproduction_finds_the_truth_jointly_only(seed: int) -> None:
    """Two drivers of 6 min: the joint intervals mostly hold, K1 per input is off by more than half, the gate rejects."""
    drives = {}
    for driver in GROVER_DRIVERS[::3]:
        one = simulate(6.0, seed, driver=printed_drivers.truth_of(driver))
        drives[driver.name] = (as_trace(one.columns), {**one.truth, "printed_driver": driver.name})
    study = reproduction.study(drives, QUICK)
    table = next(t for t in study.tables if t.name == "reproduction")
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    assert len(rows) == 2
    for row in rows:
        assert abs(float(str(row["joint K1 error"]))) < 0.25
        assert abs(float(str(row["joint K2 error"]))) < 0.15
        assert abs(float(str(row["his K1 error"]))) > 0.5
    gate = next(a for a in study.artifacts if a.name == "claim G13")
    assert gate.verdict is ClaimVerdict.FAILS
    assert all(len(row) == len(t.columns) for t in study.tables for row in t.rows)


def test_missed_figures_are_reported_with_their_number() -> None:
    """A truth that is not the driver's is a missed figure, as a sentence; a log without truth is skipped."""
    trace = drive(1, 2.0)
    wrong = {
        "channels": {
            "headway_error": {"K": 50.0, "tau": 0.0, "dead_time": 0.0},
            "range_rate": {"K": 60.0, "tau": 0.0, "dead_time": 0.0},
        },
        "minutes": 2.0,
        "printed_driver": "x",
    }
    study = reproduction.study({"a": (trace, wrong), "b": (trace, {})}, QUICK)
    assert any("0 of 2" in sentence for sentence in study.failed)
    (error,) = re.findall(r"median error (-?[\d.]+)%", " ".join(study.failed))
    assert float(error) == pytest.approx(-90.0, abs=1.0)
    assert {s.log for s in study.skipped} == {"b"}
    gains = {"headway_error": {"K": 5.0}, "range_rate": {"K": 6.0}}
    right = {**wrong, "channels": gains}
    assert not [s for s in reproduction.study({"a": (trace, right)}, QUICK).failed if "coverage" in s]
    assert reproduction.study({"b": (trace, {})}, QUICK).artifacts == ()


def test_one_input_alone_takes_the_place_of_the_other() -> None:
    """FOPDT of the headway error alone on inputs that are one: its gain is the sum of both in units of the first."""
    trace = drive(2, 4.0, noise=0.5)
    inputs = np.column_stack([trace.inputs[:, 0], 3.0 * trace.inputs[:, 0]])
    # with a lag: an answer without any is outside the model, and prewhitening then makes much of the last 20 ms
    late = response(inputs[:, 0], 0.5, 0.3, DT)
    output = 12.0 + (5.0 + 18.0) * late + 0.1 * (trace.output - trace.output.mean())
    alone = one_input(trace._replace(inputs=inputs, output=output), 0)
    # K1 + 3 K2, and a tenth of the recorded output's own K1
    assert pytest.approx(5.0 + 18.0 + 0.5, rel=0.1) == alone.models[0].K
