"""The lane-keeping loop agrees with the simulator and with the published driver's crossover, recomputed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canid.models.simulation import Car, Steering, simulate
from canid.models.simulation.lane import keep_lane
from canid_study.chen_ulsoy.one_track_car import OneTrackCar, matrices
from tests.systems import steering_loop
from tests.systems.steering_loop import LateralCar, SteeringLoop, yawing_car

TABLE_1 = Steering()


def of_simulator(gain: float = 1.0) -> SteeringLoop:
    b = (gain * TABLE_1.b[0], gain * TABLE_1.b[1])
    return SteeringLoop(TABLE_1.a, b, yawing_car(), even=True)


def one_track(speed: float, sign: float = -1.0) -> SteeringLoop:
    """Chen & Ulsoy's driver with the assumed one-track car; b in degrees per m."""
    A, B = matrices(OneTrackCar(), speed)
    car = LateralCar(A, B * math.radians(1.0), np.array([0.0, 0.0, 0.0, 1.0]))
    return SteeringLoop((-1.2623, 0.3697), (sign * 4.134, -sign * 4.0337), car)


@pytest.mark.parametrize(
    ("speed", "crossover", "phase", "gain"),
    [(20.0, 0.4919, 39.739, 5.829), (25.0, 0.6200, 37.531, 3.992), (30.0, 0.7307, 34.601, 3.099)],
)
def test_the_printed_driver_crosses_over_as_recomputed_apart(
    speed: float, crossover: float, phase: float, gain: float
) -> None:
    """Numbers made by another program from the printed means (Fig. 10): 0.49 to 0.80 rad/s, 29 to 40 degrees."""
    found = steering_loop.margins(one_track(speed))
    assert found.crossover == pytest.approx(crossover, abs=2e-4)
    assert found.phase_margin_deg == pytest.approx(phase, abs=0.01)
    assert found.gain_margin == pytest.approx(gain, abs=0.002)
    assert steering_loop.stable(one_track(speed))


def test_steering_the_wrong_way_is_unstable() -> None:
    assert not steering_loop.stable(one_track(25.0, sign=1.0))


@pytest.mark.parametrize(("share", "kept"), [(0.93, True), (1.07, False)])
def test_the_gain_margin_is_where_the_simulated_driver_loses_the_lane(share: float, kept: bool) -> None:
    gain = share * steering_loop.margins(of_simulator()).gain_margin
    loop = of_simulator(gain)
    assert steering_loop.stable(loop) is kept
    steering = TABLE_1._replace(b=loop.b, noise_sd=0.05)
    offset = keep_lane(4.0, 1, steering, Car(), {}, ()).columns["lateral_offset"]
    minute = len(offset) // 4
    growth = np.std(offset[-minute:]) / np.std(offset[minute : 2 * minute])
    assert bool(growth < 3.0) is kept


def test_the_outermost_pole_is_the_simulated_growth() -> None:
    """An unstable driver's offset grows as the outermost pole; the simulator's Euler steps of 10 ms lead by half a step."""
    loop = of_simulator(1.5 * steering_loop.margins(of_simulator()).gain_margin)
    fastest = np.abs(steering_loop.closed_loop_poles(loop)).max()
    drive = simulate(2.0, 3, "lane", driver=TABLE_1._replace(b=loop.b))
    late = np.abs(drive.columns["lateral_offset"].reshape(-1, 1000)).max(axis=1)  # each 10 s
    rate = float(np.polyfit(np.arange(6), np.log(late[-6:]), 1)[0]) / 10.0
    assert rate == pytest.approx(math.log(fastest) / loop.dt, rel=0.08)


def test_the_response_is_that_of_the_sampled_states() -> None:
    """Even wheel: the response at low frequency is the continuous car's, V g / s^2."""
    loop = of_simulator()
    w = np.array([0.02])
    driver = (loop.b[0] + loop.b[1]) / (1.0 + sum(loop.a))
    yaw = math.radians(25.0 / (15.0 * 2.7))
    assert abs(steering_loop.loop_response(loop, w)[0]) == pytest.approx(
        abs(driver) * 25.0 * yaw / 0.02**2, rel=0.01
    )
