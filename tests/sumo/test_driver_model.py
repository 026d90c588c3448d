"""A driver fitted to SUMO's models: planted parameters and noise come back, weak drives give a reason."""

from __future__ import annotations

import json

import numpy as np
import pytest

from canid import from_arrays
from canid.analysis.sumo.driver_model import DriverModel, NoModel, fit, from_json, to_json
from canid.analysis.sumo.following import PERCENT, following, in_stretches
from canid.values.types import LearnGate, Trace
from tests.seeds import mostly
from tests.sumo.idm_drive import Driven, Planted, drawn, driven


def fitted(trace: Trace) -> DriverModel:
    found = fit(trace, "accel")
    assert isinstance(found, DriverModel), found
    return found


@pytest.mark.slow("fits traffic models")
@mostly(0.95)
def test_parameters_of_an_idm_come_back(seed: int) -> None:
    """Without noise of the driver: within 10 % of the truth, and IDM drives the gap to 3 %."""
    truth = drawn(seed)
    found = fitted(driven(truth, seed).trace)
    idm = next(one for one in found.candidates if one.model == "IDM")
    assert idm.error.gap < 0.03
    for name in ("T", "s0", "a", "b"):
        assert idm.parameters[name].value == pytest.approx(getattr(truth, name), rel=0.1), name
    # the model that drove is no worse than any other
    assert idm.error.gap <= 1.1 * min(one.error.gap for one in found.candidates)


@pytest.mark.slow("fits traffic models")
@mostly(0.95)
def test_noise_of_the_driver_comes_back(seed: int) -> None:
    """Size within a third, T of a noisy driver within a fifth; the correlation time is known to its order alone."""
    truth = drawn(seed, sd=0.3, time=2.0)
    found = fitted(driven(truth, seed, minutes=12.0).trace)
    idm = next(one for one in found.candidates if one.model == "IDM")
    assert idm.parameters["T"].value == pytest.approx(truth.T, rel=0.2)
    assert idm.noise.sd.value == pytest.approx(truth.sd, rel=0.35)
    assert truth.time / 8 < idm.noise.time.value < truth.time * 4
    assert idm.noise.sd.low < idm.noise.sd.value < idm.noise.sd.high


@pytest.fixture(scope="module")
def drive() -> Driven:
    return driven(Planted(sd=0.2), 5, minutes=4.0)


@pytest.fixture(scope="module")
def found(drive: Driven) -> DriverModel:
    return fitted(drive.trace)


@pytest.mark.slow("fits traffic models")
def test_quantiles_are_those_of_what_was_driven(drive: Driven, found: DriverModel) -> None:
    """Of the speed without sensor noise, at the stated percentages."""
    expected = np.percentile(drive.speed, PERCENT)
    np.testing.assert_allclose(found.quantiles["speed"], expected, atol=0.3)
    assert all(len(x) == len(PERCENT) and sorted(x) == list(x) for x in found.quantiles.values())


@pytest.mark.slow("fits traffic models")
def test_json_holds_the_model(found: DriverModel) -> None:
    """There and back, by strict JSON, infinite variances included."""
    text = json.dumps(to_json(found), allow_nan=False)
    back = from_json(json.loads(text))
    assert json.dumps(to_json(back), allow_nan=False) == text
    assert repr(back) == repr(found)
    none = NoModel("drive longer")
    assert from_json(json.loads(json.dumps(to_json(none)))) == none


@pytest.mark.parametrize(
    "made",
    [{}, {"version": 99}, {"version": 1, "status": "ok"}, {"version": 1, "status": "ok", "candidates": 3}],
)
def test_other_json_is_refused(made: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="driver model"):
        from_json(made)


@pytest.mark.slow("fits traffic models")
def test_braking_and_standstill_count(drive: Driven, found: DriverModel) -> None:
    """Other than for canid's own model: SUMO's drivers brake as well; what cruise control drives does not count."""
    gate = list(drive.trace.gate)
    gate[500:1300] = [LearnGate.BRAKE] * 400 + [LearnGate.STANDSTILL] * 400
    columns = following(drive.trace._replace(gate=tuple(gate)))
    assert columns is not None
    assert columns.shown.sum() * columns.dt == pytest.approx(found.seconds)
    gate[500:1300] = [LearnGate.CRUISE] * 800
    assert fitted(drive.trace._replace(gate=tuple(gate))).seconds < found.seconds - 70.0


@pytest.mark.slow("fits traffic models")
def test_weak_drives_give_a_reason(drive: Driven) -> None:
    """Too short, without a lead, steered, empty, all missing, standing: no exception."""
    t = drive.trace
    short = driven(Planted(), 3, minutes=1.0).trace
    alone = t._replace(signals={name: x for name, x in t.signals.items() if name != "gap"})
    missing = t._replace(signals=t.signals | {"gap": np.full(t.t.size, np.nan)})
    empty = t._replace(
        t=t.t[:0], output=t.output[:0], inputs=t.inputs[:0], gate=(), learn=t.learn[:0], segment=t.segment[:0],
        signals={name: x[:0] for name, x in t.signals.items()},
    )  # fmt: skip
    for trace in (short, alone, missing, empty):
        found = fit(trace, "accel")
        assert isinstance(found, NoModel), trace
        assert found.reason
    assert isinstance(fit(t, "steering_angle"), NoModel)
    n = 6000
    zero = np.zeros(n)
    still = from_arrays(time=0.1 * np.arange(n), accel=zero, speed=zero, gap=zero + 3.0, range_rate=zero)
    cruising = from_arrays(
        time=0.1 * np.arange(n), accel=zero, speed=zero + 20, gap=zero + 30, range_rate=zero
    )
    for trace in (still, cruising):
        found = fit(trace, "accel")
        assert isinstance(found, NoModel)
        assert "hardly changes" in found.reason


def test_another_lead_ends_a_stretch(drive: Driven) -> None:
    """A gap that jumps where the lead changes is no motion: no stretch crosses it."""
    t = drive.trace
    segment = t.segment.copy()
    segment[1500:] += 1
    columns = following(t._replace(segment=segment))
    assert columns is not None
    where = in_stretches(columns)
    assert len(where) >= 6
    assert all(np.unique(segment[one.start : one.stop]).size == 1 for one in where)
