import json
from pathlib import Path

import numpy as np
import pytest

from canid.models.simulation import frames, simulate
from canid.signals.vehicle import decoder, read_vehicle
from canid.values.frame_columns import columns_of

LOGS = Path(__file__).parents[2] / "replay_logs"


def decoded(vehicle, log):
    init, step = decoder(vehicle)
    chunk = columns_of(list(log))
    state, made = step(init(), chunk)
    return state, {role: np.column_stack([chunk.t[row], value]) for role, row, value in made.roles}


def test_the_bus_carries_what_happened():
    """Every role decodes to the true column at its time, within its resolution; the radar with its noise."""
    vehicle, drive = read_vehicle("generic"), simulate(3, 8)
    state, roles = decoded(vehicle, frames(drive, vehicle))
    assert set(roles) == set(vehicle.roles)
    assert dict(state.counters) == {}
    truth = drive.columns
    for role, pairs in roles.items():
        t, value = pairs.T
        true = np.interp(t, truth["t"], truth[role])
        lsb = abs(vehicle.roles[role].how.factor)
        if role in ("gap", "range_rate"):
            continue
        if vehicle.roles[role].switch:
            assert (value == true).mean() > 0.97, role  # held, where the comparison interpolates
        else:
            assert np.abs(value - true).max() < 0.501 * lsb + 1e-9, role


@pytest.mark.slow("drives in closed loop")
@pytest.mark.parametrize(("role", "sd", "lsb"), [("gap", 0.25, 0.05), ("range_rate", 0.12, 0.02)])
def test_the_radar_is_as_noisy_as_stated(role, sd, lsb):
    """Radar errors are white with the stated standard deviation, and quantised."""
    vehicle, drive = read_vehicle("generic"), simulate(5, 9)
    t, value = decoded(vehicle, frames(drive, vehicle))[1][role].T
    error = value - np.interp(t, drive.columns["t"], drive.columns[role])
    n = len(error)
    assert n == pytest.approx(5 * 60 * 20, rel=0.01)
    assert error.std() == pytest.approx(np.hypot(sd, lsb / np.sqrt(12)), rel=4 / np.sqrt(2 * n))
    assert abs(error.mean()) < 4 * sd / np.sqrt(n)
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 4 / np.sqrt(n)
    np.testing.assert_allclose(value / lsb, np.round(value / lsb), atol=1e-6)


def test_messages_come_when_the_dbc_says():
    """Each message keeps its cycle time but for a little jitter; times are whole ns, in order, from 0 on."""
    vehicle = read_vehicle("generic")
    log = frames(simulate(1, 3), vehicle)
    times = np.array([frame.t for frame in log])
    assert times[0] == 0.0
    assert (np.diff(times) >= 0).all()
    assert all(round(t * 1e9) * 1e-9 == t for t in times)
    for message in vehicle.messages:
        own = np.array([frame.t for frame in log if frame.id == message.id])
        late = np.diff(own) - message.period
        assert len(own) == pytest.approx(60 / message.period, rel=0.01)
        assert 0 < np.abs(late).max() < 0.011 * message.period


def test_the_same_drive_is_the_same_frames():
    """Frames depend on the simulation and the vehicle alone."""
    vehicle = read_vehicle("generic")
    assert frames(simulate(0.2, 3), vehicle) == frames(simulate(0.2, 3), vehicle)
    assert frames(simulate(0.2, 3), vehicle) != frames(simulate(0.2, 4), vehicle)


def test_a_lost_lead_is_no_target():
    """While the radar has lost the lead it says "no target"; the driver goes on following."""
    vehicle, drive = read_vehicle("generic"), simulate(1, 3, lost=[(20.0, 30.0)])
    state, roles = decoded(vehicle, frames(drive, vehicle))
    for role in ("gap", "range_rate"):
        t, value = roles[role].T
        np.testing.assert_array_equal(np.isnan(value), (t >= 20.0) & (t < 30.0))
    assert state.counters['gap: "no target"'] == pytest.approx(200, abs=1)
    assert np.isfinite(drive.columns["gap"]).all()


def test_a_drive_on_a_car_with_radar_tracks():
    """A drive can be written as a car with radar tracks would, on its buses."""
    vehicle = read_vehicle("toyota_rav4_2017")
    log = frames(simulate(0.2, 3), vehicle)
    assert {frame.bus for frame in log} == {0, 1}
    assert len({frame.id for frame in log if frame.bus == 1}) == 16


@pytest.mark.slow("drives in closed loop")
def test_replay_logs_are_what_make_py_makes(tmp_path):
    """The logs in replay_logs/ come out of make.py byte for byte, are small, and have their truth."""
    scope = {"__name__": "make", "__file__": str(LOGS / "make.py")}
    exec(compile((LOGS / "make.py").read_text(encoding="utf-8"), "make.py", "exec"), scope)
    scope["main"](tmp_path)
    made = sorted(path.name for path in tmp_path.iterdir())
    kept = sorted(path.name for path in LOGS.iterdir() if path.suffix in (".blf", ".asc", ".json"))
    assert made == kept
    for name in made:
        assert (tmp_path / name).read_bytes() == (LOGS / name).read_bytes(), name
    assert sum((LOGS / name).stat().st_size for name in made) < 3_000_000
    for path in LOGS.glob("*.truth.json"):
        truth = json.loads(path.read_text(encoding="utf-8"))
        assert {"vehicle", "task", "noise", "profile", "seed", "hidden"} <= set(truth)
        if truth["task"] == "car_following":
            assert {"headway_desired", "offset"} <= set(truth)
            assert all(set(channel) == {"K", "tau", "dead_time"} for channel in truth["channels"].values())
