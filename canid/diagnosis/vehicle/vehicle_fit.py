"""The baseline of the car: its initial guess, and the standard deviations of its parameters."""

from __future__ import annotations

import numpy as np

from canid.diagnosis.fitting import fitted_model
from canid.diagnosis.fitting.fitted_model import FittedModel, Start
from canid.diagnosis.fitting.robust_covariance import sandwich
from canid.diagnosis.vehicle.vehicle_data import VehicleData
from canid.diagnosis.vehicle.vehicle_model import VehicleModel, with_effects
from canid.types import Array

FittedVehicle = FittedModel[VehicleModel]

# a middle-class car: strength m/s² per %, lag s, rolling m/s², drag 1/m
INITIAL = (0.04, 0.35, 0.2, 3e-4)
# the noise model that accelerations mostly have, and its standard deviation in parts of the output's
INITIAL_A, INITIAL_SD = (1.0, -0.9), 0.3
# samples: 40 s at 10 Hz
MIN_SAMPLES = 400


def baseline(data: VehicleData) -> FittedVehicle | None:
    """Fit the car without any effect; None: too few samples."""
    y, usable = data.output.y, data.output.usable
    if int(np.count_nonzero(usable)) < MIN_SAMPLES:
        return None
    sd = max(float(np.std(y[usable])) * INITIAL_SD, 1e-6)
    start = Start([np.array(INITIAL)], np.array(INITIAL_A), sd, rounds=1, turns=2, min_rows=MIN_SAMPLES)
    return fitted_model.baseline(data, with_effects(()), start)


def standard_errors(solved: FittedVehicle, dt: float) -> Array:
    """Standard deviations of the parameters (k,): the sandwich, nowhere narrower than the likelihood's."""
    out: Array = np.sqrt(np.diag(sandwich(solved.fitted, dt).C))
    return out
