import numpy as np
import pytest

from canid.models.simulation import DriverTruth, Steering, frames, simulate
from canid.signals.vehicle import decoder, read_vehicle
from canid.values.frame_columns import columns_of


def left_over(drive):
    """A(q) angle − B(q) offset at each 0.1 s, with the stated truth."""
    model = drive.truth["armax"]
    y = drive.columns["steering_angle"][::10]
    u = drive.columns["lateral_offset"][::10]
    answered = y[2:] + model["A"][1] * y[1:-1] + model["A"][2] * y[:-2]
    return answered - model["B"]["lateral_offset"][0] * u[1:-1] - model["B"]["lateral_offset"][1] * u[:-2]


def test_without_noise_the_armax_equation_is_exact():
    """A driver without noise turns the wheel as the stated A and B say, to rounding, while the wind blows."""
    drive = simulate(2, 3, "lane", driver=Steering(noise_sd=0.0))
    np.testing.assert_allclose(left_over(drive), 0, atol=1e-12)
    assert drive.columns["steering_angle"].std() > 0.3


def test_what_the_equation_leaves_is_the_stated_noise():
    """With noise, what A and B leave is C(q) e with the stated standard deviation and spectrum."""
    drive = simulate(20, 3, "lane")
    model, left = drive.truth["armax"], left_over(drive)
    c, sd = model["C"][1], drive.truth["noise"]["sd"]
    n = len(left)
    assert left.std() == pytest.approx(sd * np.hypot(1, c), rel=4 / np.sqrt(2 * n))
    correlation = [np.corrcoef(left[:-lag], left[lag:])[0, 1] for lag in (1, 2, 3)]
    np.testing.assert_allclose(correlation, [c / (1 + c * c), 0, 0], atol=4 / np.sqrt(n))


def test_the_car_stays_in_its_lane():
    """The loop is stable: the offset stays within a lane for many seeds, and moves enough to identify."""
    for seed in range(6):
        columns = simulate(5, seed, "lane").columns
        assert np.abs(columns["lateral_offset"]).max() < 2.0
        assert columns["lateral_offset"].std() > 0.2
        assert np.abs(columns["steering_angle"]).max() < 15.0


def test_its_log_decodes_to_offset_and_angle():
    """On the bus, offset and angle are there at the DBC's resolution, and the radar sees nobody."""
    vehicle, drive = read_vehicle("generic_lane"), simulate(0.5, 1, "lane")
    assert (vehicle.driver.task, vehicle.driver.output) == ("lane_keeping", "steering_angle")
    init, step = decoder(vehicle)
    worst = {"lateral_offset": 0.0, "steering_angle": 0.0}
    chunk = columns_of(frames(drive, vehicle))
    _, decoded = step(init(), chunk)
    for role, row, value in decoded.roles:
        if role in worst:
            true = np.interp(chunk.t[row], drive.columns["t"], drive.columns[role])
            worst[role] = float(np.abs(value - true).max())
        elif role in ("gap", "range_rate"):
            assert np.isnan(value).all()
    assert 0 < worst["lateral_offset"] < 0.0026
    assert 0 < worst["steering_angle"] < 0.051


def test_drivers_of_another_task_are_refused():
    """A driver that follows cannot keep the lane, and the other way round."""
    with pytest.raises(ValueError, match="type Steering"):
        simulate(0.1, 1, "lane", driver=DriverTruth(5, 0.5, 0.3, 5, 0.5, 0.3))
    with pytest.raises(ValueError, match="type DriverTruth"):
        simulate(0.1, 1, "mixed", driver=Steering())
