"""The baseline of the driver: initial guesses, and whether the output answers anything at all."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from canid.models.diagnosis.driver import local_minima
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_model import (
    BASE,
    DESIRED,
    FREE_SPEED,
    K1,
    K2,
    OFFSET,
    OWN,
    TAU1,
    TAU2,
    THETA1,
    THETA2,
    DriverModel,
    with_effects,
)
from canid.models.diagnosis.fitting import fitted_model
from canid.models.diagnosis.fitting.fitted_model import (
    MIN_FIT_IMPROVEMENT,
    FittedModel,
    Start,
    polished,
    solve,
)
from canid.values.findings import Flags

FittedDriver = FittedModel[DriverModel]

# a driver as in the literature, the initial guess of every first fit (Grover 2021, Tables 1, 2; reaction times in following)
INITIAL = {K1: 5.0, K2: 5.0, FREE_SPEED: 50.0, TAU1: 0.4, TAU2: 0.4, THETA1: 0.4, THETA2: 0.4}
# gains of a driver whose output is an acceleration (m/s² per s, and per m/s)
ACCELERATION_GAINS = {K1: 0.3, K2: 0.4}
# s, further dead times from which the baseline's fit begins: the cost has a local minimum for each
INITIAL_THETA2 = (0.2, 0.6, 1.0)
# the noise model that pedals mostly have, and its standard deviation in parts of the output's
INITIAL_A, INITIAL_SD = (1.0, -0.9, 0.0), 0.4
# of the grid of delays, each from the noise model of the one before
MAX_ROUNDS = 2
# samples that count; with fewer the depth of a minimum is the driver's noise: on drives of five minutes (240 to 700) the
# lowest one was worse in closed loop on the other half (0.169 to 0.197, 0.195 to 0.214), on long ones as good
MIN_GRID_ROWS = 2000
# samples; with fewer no noise model of two seconds' memory can be estimated
MIN_SAMPLES = 200
# chance that an output that answers nothing is taken for one that does
ANSWER_CHANCE = 1e-4


def baseline(data: DriverData) -> FittedDriver | None:
    """Fit the driver without any effect; None: too few samples.

    A controller need not answer both inputs alike: where a gain comes out negative and the output is an acceleration, the
    delays of the two answers are left free of each other, if that is a driver who follows.
    """
    tied = _baseline(data, tied=True)
    if tied is None or data.pedal or _follows(tied):
        return tied
    apart = _baseline(data, tied=False)
    return apart if apart is not None and _follows(apart) else tied


def _follows(fitted: FittedDriver) -> bool:
    return bool(fitted.q[K1] > 0.0 and fitted.q[K2] > 0.0)


def _baseline(data: DriverData, *, tied: bool) -> FittedDriver | None:
    output = data.output
    free = output.usable & ~output.below
    if int(np.count_nonzero(free)) < MIN_SAMPLES:
        return None
    model = with_effects((), begins=data.begins, tied=tied)
    q = np.zeros(len(model.low))
    for k, value in (INITIAL if data.pedal else INITIAL | ACCELERATION_GAINS).items():
        q[k] = value
    q[DESIRED] = float(np.median(data.seen.headway[free]))
    q[OFFSET] = float(np.median(output.y[free]))
    guesses = []
    for theta in (q[THETA2], *INITIAL_THETA2):
        guesses.append(q.copy())
        guesses[-1][THETA2] = theta
    sd = max(float(np.std(output.y[free])) * INITIAL_SD, 1e-6)
    fitted = fitted_model.baseline(data, model, Start(guesses, np.array(INITIAL_A), sd, rounds=2, turns=1))
    if fitted is None or data.pedal or int(np.count_nonzero(fitted.rows)) < MIN_GRID_ROWS:
        return fitted
    return _lowest(data, fitted)


def _lowest(data: DriverData, fitted: FittedDriver) -> FittedDriver:
    """The lowest minimum of the likelihood that a grid of delays shows.

    Accelerations that are derived from speeds hold little above 1 Hz, and what they hold of a person is mostly noise: on 7
    of 12 long measured drives and halves the fit that begins with usual delays ended 1 to 103 (−2 log likelihood) above
    this, and K of range rate of two halves of one driver was 0.34 and 0.43 where it now is 0.31 and 0.31. Of 16 pedals one
    ended 6 above it.
    """
    for _ in range(MAX_ROUNDS):
        lower = min(
            local_minima.minima(fitted.model, data, fitted, fitted.q), key=lambda minimum: minimum.deviance
        )
        if lower.deviance > fitted.deviance - MIN_FIT_IMPROVEMENT:
            break
        fitted = polished(data, lower)
    return fitted


def answered(data: DriverData, fitted: FittedDriver) -> bool:
    """Does the output answer headway or relative speed at all, by more than chance?

    Without an answer there is nothing that a cause could change.
    """
    constants = {*OWN[fitted.model.form], *_offsets(data)}
    freed = len(fitted.fitted.free) - len(constants)
    without = silent(data, fitted, fitted.rows)
    return without.deviance - fitted.deviance > float(chi2.isf(ANSWER_CHANCE, freed))


def silent(data: DriverData, fitted: FittedDriver, rows: Flags) -> FittedDriver:
    """The driver who answers nothing: offsets and noise alone, fitted to some rows."""
    q = fitted.q.copy()
    q[[K1, K2]] = 0.0
    return solve(data, fitted.model.with_effects(()), q, fitted.noise, rows, free=_offsets(data))


def _offsets(data: DriverData) -> tuple[int, ...]:
    return (OFFSET, *range(len(BASE), len(BASE) + len(data.begins)))
