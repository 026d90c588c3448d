"""A planted drive becomes a log that canid reads, and the short cut past the log gives the same numbers."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

import canid
from canid.signals.vehicle import Vehicle, decoder, encoder, read_vehicle
from canid.values.frame_columns import columns_of
from canid.values.types import LearnGate, Trace
from tests.plants import measurement, quantisation, sensors
from tests.plants.plant_one import plant
from tests.plants.planted_drive import Planted


def drive(
    effects: dict[str, dict[str, float]], seed: int = 5, minutes: float = 1.0, **changes: float
) -> Planted:
    return plant(effects, seed=seed, minutes=minutes, noise="mix", profile="mixed", **changes)


def same(one: Trace, two: Trace) -> None:
    np.testing.assert_array_equal(one.t, two.t)
    assert one.gate == two.gate
    np.testing.assert_array_equal(one.learn, two.learn)
    np.testing.assert_array_equal(one.segment, two.segment)
    assert set(one.signals) == set(two.signals)
    for role, values in one.signals.items():
        # the filter's sums run in another order: some last digits
        np.testing.assert_allclose(two.signals[role], values, rtol=1e-9, atol=1e-9, err_msg=role)
    np.testing.assert_allclose(one.inputs, two.inputs, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(one.output, two.output)


# what takes another way through the short cut: nothing, a jump, a frozen radar, a mask
WAYS = ({}, {"cut_in": {}}, {"stale_signal": {"signal": 2.0}}, {"cruise_control": {}, "radar_latency": {}})


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("effects", WAYS, ids=lambda x: "+".join(x) or "clean")
@pytest.mark.parametrize("vehicle", ["lean", "generic"])
def test_the_trace_is_that_of_the_log(
    effects: dict[str, dict[str, float]], vehicle: str, tmp_path: Path
) -> None:
    """Writing a log and reading it gives the numbers of the short cut, to the last but few digits."""
    car = measurement.lean() if vehicle == "lean" else read_vehicle("generic")
    p = drive(effects)
    truth_file = measurement.write(p, tmp_path / "drive.blf", car)
    read = canid.read_trace(tmp_path / "drive.blf", car)
    same(read, measurement.trace(p, car))
    assert len(read.t) > 580
    assert read.learn.mean() > 0.2
    truth = json.loads(truth_file.read_text())
    assert truth["effects"] == p.truth["effects"]
    assert truth["vehicle"] == car.name
    assert truth_file.name == "drive.truth.json"


def test_lost_targets_take_the_same_way(tmp_path: Path) -> None:
    """A radar without target for some seconds."""
    p = drive({})
    valid = np.where((p.columns["t"] > 20.0) & (p.columns["t"] < 24.0), 0.0, 1.0)
    p = p._replace(columns={**p.columns, "lead_valid": valid})
    measurement.write(p, tmp_path / "drive.blf")
    read = canid.read_trace(tmp_path / "drive.blf", measurement.lean())
    assert LearnGate.NO_LEAD in read.gate
    same(read, measurement.trace(p))


@pytest.mark.slow("diagnoses planted drives")
def test_radar_tracks_take_the_long_way(tmp_path: Path) -> None:
    car = read_vehicle("toyota_rav4_2017")
    p = drive({})
    measurement.write(p, tmp_path / "drive.blf", car)
    same(canid.read_trace(tmp_path / "drive.blf", car), measurement.trace(p, car))


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    files = [tmp_path / f"{k}.blf" for k in range(3)]
    for file, seed in zip(files, (5, 5, 6), strict=True):
        measurement.write(drive({"attention_gap": {}}, seed=seed), file)
    assert files[0].read_bytes() == files[1].read_bytes() != files[2].read_bytes()
    texts = [file.with_suffix(".truth.json").read_text() for file in files]
    assert texts[0] == texts[1] != texts[2]
    p = drive({})
    assert measurement.frames(p, measurement.lean(), 1) != measurement.frames(p, measurement.lean(), 2)


def test_the_log_holds_the_mapped_messages_at_their_rates() -> None:
    frames = measurement.frames(drive({}), measurement.lean())
    assert frames[0].t == 0.0
    assert all(one.t <= two.t for one, two in itertools.pairwise(frames))
    counts = {
        message.name: sum(f.id == message.id for f in frames) for message in measurement.lean().messages
    }
    assert set(counts) == {"ENGINE_DATA", "EGO_SPEED", "RADAR_LEAD", "DRIVER_STATE", "GNSS_DATA"}
    for message in measurement.lean().messages:
        assert counts[message.name] == pytest.approx(60.0 / message.period, rel=0.02)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("role", sorted(read_vehicle("generic").roles))
def test_a_column_through_the_dbc_is_each_value_through_it(role: str) -> None:
    """`quantisation.through` against canid's own encoder and decoder, with values beyond every limit."""
    car = read_vehicle("generic")
    how = car.roles[role].how
    low, high = (float(np.clip(x, -1e6, 1e6)) for x in (how.low, how.high))
    rng = np.random.default_rng(8)
    span = max(high - low, 1.0)
    values = np.concatenate([rng.uniform(low - 0.1 * span, high + 0.1 * span, 200), [low, high, 0.0, np.nan]])
    encode, (init, step) = encoder(car), decoder(car)
    came, state = [], init()
    pages = max(
        len({tuple(r.how.when) for r in car.roles.values() if r.message == car.roles[role].message}), 1
    )
    for value in values.tolist():
        for page in range(pages):
            frame = encode(0.0, {role: value}, {car.roles[role].message: page})[0]
            _, decoded = step(state, columns_of([frame]))
            came += [value for of, _, values in decoded.roles if of == role for value in values.tolist()]
    np.testing.assert_array_equal(quantisation.through(how, values), came)


# --- what is measured wrongly ----------------------------------------------------------------------


def measured(
    effects: dict[str, dict[str, float]],
) -> tuple[dict[str, tuple[np.ndarray, np.ndarray]], Planted]:
    """Role -> (t, value) before the DBC, with the noise of one seed."""
    p = drive(effects)
    said = sensors.sense(p, measurement.lean(), 5)
    return {role: (m.t, x) for m in said for role, x in m.values.items()}, p


def test_sensing_effects_change_what_is_measured_and_not_what_is() -> None:
    """Each by its formula, with the same noise on both drives."""
    clean, plain = measured({})
    forms = {
        "range_offset": ("gap", {"distance": 1.5}, lambda x: x + 1.5),
        "speed_scale": ("speed", {"share": 0.03}, None),
        "range_rate_scale": ("range_rate", {"share": -0.1}, None),
        "range_rate_sign": ("range_rate", {}, None),
    }
    scales = {"speed_scale": 1.03, "range_rate_scale": 0.9, "range_rate_sign": -1.0}
    for name, (role, how, form) in forms.items():
        wrong, p = measured({name: how})
        for other in plain.columns:
            np.testing.assert_array_equal(p.columns[other], plain.columns[other])
        for other in clean:
            if other != role:
                np.testing.assert_array_equal(wrong[other][1], clean[other][1])
        t, x = clean[role]
        if form is not None:
            np.testing.assert_allclose(wrong[role][1], form(x), atol=1e-12)
        else:  # the noise is the sensor's own and is not scaled
            was = np.interp(t, plain.columns["t"], plain.columns[role])
            np.testing.assert_allclose(wrong[role][1] - x, (scales[name] - 1.0) * was, atol=1e-9)


def test_old_reports() -> None:
    """radar_latency: older all along; clock_skew: older and older."""
    for effects, age in (
        ({"radar_latency": {"delay": 0.2}}, lambda t: 0.2 + 0.0 * t),
        ({"clock_skew": {"rate": 0.3}}, lambda t: 0.3 * t / 59.98),
        ({"clock_skew": {"rate": -0.3}}, lambda t: 0.3 * (1.0 - t / 59.98)),
    ):
        (wrong, p), (clean, _) = measured(effects), measured({})
        for role in ("gap", "range_rate"):
            t, x = clean[role]
            was, is_ = (np.interp(at, p.columns["t"], p.columns[role]) for at in (t - age(t), t))
            np.testing.assert_allclose(wrong[role][1] - x, was - is_, atol=1e-9)
        np.testing.assert_array_equal(wrong["speed"][1], clean["speed"][1])


@pytest.mark.parametrize(
    ("signal", "roles"), [(0.0, ["pedal"]), (1.0, ["speed"]), (2.0, ["gap", "range_rate"])]
)
def test_a_signal_freezes(signal: float, roles: list[str]) -> None:
    """It repeats to the bit through its episode, and nothing else does."""
    said, p = measured({"stale_signal": {"signal": signal}})
    clean, _ = measured({})
    ((start, stop),) = p.truth["episodes"]["stale_signal"]
    for role, (t, x) in said.items():
        stale = (t >= start) & (t < stop)
        if role in roles:
            assert np.ptp(x[stale]) == 0.0
            assert x[stale][0] == x[~stale & (t < start)][-1]
            np.testing.assert_array_equal(x[~stale], clean[role][1][~stale])
        else:
            np.testing.assert_array_equal(x, clean[role][1])


def test_the_radar_is_as_noisy_as_it_is_said_to_be() -> None:
    said, p = measured({})
    sd = sensors.noise(5)
    for role, expected in (("gap", sd.gap), ("range_rate", sd.range_rate), ("speed", sd.speed)):
        t, x = said[role]
        assert (x - np.interp(t, p.columns["t"], p.columns[role])).std() == pytest.approx(expected, rel=0.1)
    all_sd = np.array([sensors.noise(seed)[:2] for seed in range(100)])
    assert (all_sd >= [0.1, 0.05]).all()
    assert (all_sd <= [0.3, 0.12]).all()


def test_the_lean_vehicle_maps_what_a_diagnosis_can_use() -> None:
    car: Vehicle = measurement.lean()
    assert set(car.roles) == {
        "pedal", "speed", "gap", "range_rate", "lead_valid", "brake", "cruise_active", "clutch", "accel", "grade",
        "altitude", "gnss_speed", "gear", "engine_speed",
    }  # fmt: skip
    assert not car.warnings
