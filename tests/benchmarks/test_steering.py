"""Steering from frames: the intervals hold Chen & Ulsoy's driver whatever the driver's clock."""

from __future__ import annotations

import numpy as np

from benchmarks.identification.tables import steering
from canid.mathematics.estimators import armax_whole_drive
from canid.mathematics.identification.armax.armax_batch import Orders
from canid.models.simulation.car import Car
from canid.models.simulation.lane import Steering, keep_lane
from canid.signals.vehicle import read_vehicle
from tests.seeds import mostly


@mostly(0.95)
def test_five_minutes_hold_the_truth(seed: int) -> None:
    """No parameter is off by more than four standard errors, at two of the driver's clocks."""
    for k in (1, 2):
        run = steering.one(4 * (seed % 10_000) + k, 5.0)
        assert run is not None
        assert (np.abs(run.error) < 4.0).all(), (k, run)


def test_a_later_log_shows_the_same_driver() -> None:
    """The driver's clock is not in the numbers: logs that begin 48 ms apart agree to a standard error."""
    car, fits = read_vehicle("generic_lane"), []
    drive = keep_lane(4.0, 5, Steering(), Car(), {}, ())
    for late in (0.0, 0.048):
        found = armax_whole_drive.identify(steering.seen(steering._later(drive, late), car), Orders())
        assert found is not None
        fits.append(found.model)
    sd = fits[0].standard_errors
    assert (np.abs(fits[1].A - fits[0].A)[1:] < sd.A[1:]).all()
    assert (np.abs(fits[1].B - fits[0].B) < sd.B).all()
