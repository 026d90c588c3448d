"""The baseline of lane keeping: initial guesses, and whether the wheel answers the lateral offset at all."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from canid.diagnosis.driver.driver_fit import ANSWER_CHANCE, INITIAL_A, INITIAL_SD, MIN_SAMPLES
from canid.diagnosis.fitting import fitted_model
from canid.diagnosis.fitting.fitted_model import FittedModel, Start, solve
from canid.diagnosis.lane.lane_data import LaneData
from canid.diagnosis.lane.lane_model import KD, OFFSET, PRODUCT, TAU, THETA, K, LaneModel, with_effects

FittedLane = FittedModel[LaneModel]

# the means of Chen & Ulsoy 2001, table 1: the initial guess of every first fit
INITIAL = {K: -0.9, KD: -3.8, TAU: 0.5, PRODUCT: 0.03}
# s, dead times from which it begins: the cost has a local minimum for each
INITIAL_THETA = (0.1, 0.35, 0.7)


def baseline(data: LaneData) -> FittedLane | None:
    """Fit the driver without any effect; None: too few samples."""
    output = data.output
    if int(np.count_nonzero(output.usable)) < MIN_SAMPLES:
        return None
    model = with_effects(())
    guesses = []
    for theta in INITIAL_THETA:
        q = np.zeros(len(model.low))
        for k, value in INITIAL.items():
            q[k] = value
        q[THETA], q[OFFSET] = theta, float(np.median(output.y[output.usable]))
        guesses.append(q)
    sd = max(float(np.std(output.y[output.usable])) * INITIAL_SD, 1e-6)
    return fitted_model.baseline(data, model, Start(guesses, np.array(INITIAL_A), sd, rounds=2, turns=1))


def answered(data: LaneData, fitted: FittedLane) -> bool:
    """Does the wheel answer the offset, by more than chance? If not, no cause could change anything."""
    q = fitted.q.copy()
    q[[K, KD]] = 0.0
    silent = solve(data, fitted.model.with_effects(()), q, fitted.noise, fitted.rows, free=(OFFSET,))
    freed = len(fitted.fitted.free) - 1
    return silent.deviance - fitted.deviance > float(chi2.isf(ANSWER_CHANCE, freed))
