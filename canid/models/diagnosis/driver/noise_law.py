"""The law of a person's innovations, where one is found: the search and its confirmation use it instead of a Gaussian.

Innovations of people have heavy tails and come in bursts. A Gaussian likelihood counts each by the same standard deviation:
a few bursts then decide which cause it finds, and much of the evidence for a true one is lost. Of 8 halves of measured
drives with an asymmetric gain of 0.36 planted (`python -m benchmarks planted`) the Gaussian evidence is 9 to 66, in the
median 15, that of the law 5 to 71, in the median 24; where nothing was planted one had a delay that drifts, with an evidence
of 18 of 13 needed: by the law it is 5.

The scale follows what the noise model's does (speed, size of the response) and the innovations of the last seconds; the
tails are Student's t. It is fitted to what one model leaves and held while others are compared with that one; with a cause
in the model it is fitted anew. Of a pedal the innovations are about as large as a step of its sensor, which has no such law.
"""

from __future__ import annotations

import math

import numpy as np

from canid.mathematics.identification import innovation_law
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.fitting import likelihood
from canid.models.diagnosis.fitting.fitted_model import polished, rescaled, solve
from canid.models.diagnosis.fitting.likelihood import Noise
from canid.models.diagnosis.fitting.uncertainty import needed
from canid.models.diagnosis.remnant import law_search
from canid.models.diagnosis.remnant.law_search import MAX_LOG_SCALE
from canid.values.findings import Flags
from canid.values.types import Array

# causes that may be searched for, all of which the threshold counts
CANDIDATES = 20
# samples; a law of some six numbers is fitted to them
MIN_ROWS = 400
# degrees of freedom, at least: below, the smallest innovations decide
MIN_FREEDOM = 3.0
# standard deviations from the mean; beyond it recent innovations count as so many
MAX_FEATURE = 3.0


def with_law(data: DriverData, solved: FittedDriver) -> FittedDriver:
    """The model with the law of its innovations, fitted again; the same where a Gaussian will do.

    Args:
        data: the driver's columns.
        solved: the model, with Gaussian innovations or with a law.
    """
    noise = of_innovations(data, solved)
    if noise is None:
        return solved
    return polished(data, solve(data, solved.model, solved.q, noise, solved.rows))


def stated(solved: FittedDriver) -> tuple[str, ...]:
    """Sentence on the law that the search uses; (): a Gaussian."""
    freedom = solved.noise.freedom
    if not math.isfinite(freedom):
        return ()
    return (
        f"innovations come in bursts, Student's t with {freedom:.2g} degrees of freedom: searched by this law",
    )


def again(data: DriverData, solved: FittedDriver) -> FittedDriver:
    """Fit the noise's scale anew, and its law where there was one, now that a model has changed; then the model."""
    noise = of_innovations(data, solved) if math.isfinite(solved.noise.freedom) else None
    if noise is None:
        return rescaled(data, solved)
    return solve(data, solved.model, solved.q, noise, solved.rows)


def of_innovations(data: DriverData, solved: FittedDriver) -> Noise | None:
    """Noise with the law of a model's innovations; None: a Gaussian will do.

    Args:
        data: the driver's columns.
        solved: the model.
    """
    rows = solved.rows & ~data.output.hidden
    present = solved.model.noise_features(data, solved.fitted.model)
    if data.pedal or present is None or int(rows.sum()) < MIN_ROWS:
        return None
    left = data.output.y - solved.fitted.model
    plain = solved.noise._replace(size=np.ones(rows.size), sd=1.0, freedom=math.inf)
    x = likelihood.whitened(plain, left)
    features = np.vstack([present.T, recent(x, rows, data.output.dt)])
    best = law_search.fit(x[rows], features[:, rows], heavy=True)
    gaussian = law_search.fit(x[rows], features[:-1, rows], heavy=False)
    if 2.0 * (best.log_likelihood - gaussian.log_likelihood) < needed(2, CANDIDATES):
        return None
    log = np.clip(best.law.slopes @ features, -MAX_LOG_SCALE, MAX_LOG_SCALE)
    size = np.exp(log - 0.5 * np.log(np.mean(np.exp(2.0 * log[rows]))))
    p, freedom = solved.noise.A.size - 1, max(best.law.freedom, MIN_FREEDOM)
    return likelihood.fit_noise(data.output, left, p, size, freedom)


def recent(x: Array, rows: Flags, dt: float) -> Array:
    """Log size of the innovations (n,) of the last seconds, of the past alone; mean 0 and variance 1 over the rows."""
    out: Array = innovation_law.features(x, rows, np.zeros(x.size), 1.0 / dt)[0]
    return np.clip(out, -MAX_FEATURE, MAX_FEATURE)
