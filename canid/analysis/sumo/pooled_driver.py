"""One driver from several drives: the mean of the parameters on the unit cube, weighted by inverse covariance.

Drives of one driver differ by more than their sampling errors; the variance between them is DerSimonian & Laird's (1986) of
each parameter, and is added to the covariances before the mean is taken.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.sumo.driver_model import Candidate, DriverModel
from canid.analysis.sumo.driver_noise import DriverNoise
from canid.analysis.sumo.sumo_models import BY_NAME, MODELS
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.models.diagnosis.rivals.recommendation import MARGIN
from canid.values.findings import ClosedLoopError
from canid.values.types import NAN, Array, Interval

# variance of a parameter on the unit cube from which on a drive does not show it: that of the cube itself
KNOWN_VARIANCE = 1.0 / 12.0
# and what it then counts as: next to a drive that shows it, nothing
UNKNOWN_VARIANCE = 1e3
# least variance on the unit cube: a step of 0.001 of the range
LEAST_VARIANCE = 1e-6


class Drive(NamedTuple):
    """A drive with its model."""

    name: str  # of the log
    model: DriverModel


class PooledDriver(NamedTuple):
    """A driver, as one model of SUMO."""

    name: str
    drives: tuple[Drive, ...]
    model: str
    why: str
    parameters: Mapping[str, Interval]  # of the mean over drives
    units: Mapping[str, str]
    spread: Mapping[str, float]  # standard deviation between drives, on the unit cube; empty: one drive
    noise: DriverNoise
    error: ClosedLoopError  # on held-out data, mean over drives weighted by time
    accel: tuple[float, float]  # m/s², 0.5 and 99.5 % points
    top_speed: float  # m/s
    seconds: float  # of following


def pooled(name: str, drives: Sequence[Drive]) -> PooledDriver:
    """Pool the drives of one driver.

    Args:
        name: of the driver.
        drives: one at least.

    Raises:
        ValueError: no drive.
    """
    if not drives:
        raise ValueError(f"driver {name}: no drive to pool")
    seconds = np.array([drive.model.seconds for drive in drives])
    share = seconds / seconds.sum()
    errors = {sumo_model.name: _error(sumo_model.name, drives, share) for sumo_model in MODELS}
    model, why = (drives[0].model.model, drives[0].model.why) if len(drives) == 1 else _chosen(errors, drives)
    candidates = [candidate(drive.model, model) for drive in drives]
    mean, covariance, between = _mean(candidates)
    rival = BY_NAME[model].rival
    wide = NORMAL_QUANTILE * np.sqrt(np.diagonal(covariance))
    value, low, high = (
        rival.physical(np.clip(x, 0.0, 1.0)[:, None])[:, 0] for x in (mean, mean - wide, mean + wide)
    )
    names = [parameter.name for parameter in rival.parameters]
    parameters = {n: Interval(*(float(x[k]) for x in (value, low, high))) for k, n in enumerate(names)}
    tails = [drive.model.quantiles["accel"] for drive in drives if drive.model.quantiles.get("accel")]
    return PooledDriver(
        name,
        tuple(drives),
        model,
        why,
        candidates[0].parameters if len(drives) == 1 else parameters,
        candidates[0].units,
        {} if len(drives) == 1 else dict(zip(names, np.sqrt(between).tolist(), strict=True)),
        _noise([calibrated.noise for calibrated in candidates], share),
        errors[model],
        (min(x[0] for x in tails), max(x[-1] for x in tails)) if tails else (NAN, NAN),
        max(drive.model.top_speed for drive in drives),
        float(seconds.sum()),
    )


def candidate(driver: DriverModel, model: str) -> Candidate:
    """A drive's calibration of one model."""
    return next(calibrated for calibrated in driver.candidates if calibrated.model == model)


def _error(model: str, drives: Sequence[Drive], share: Array) -> ClosedLoopError:
    errors = np.array([candidate(drive.model, model).error for drive in drives])
    return ClosedLoopError(*(share @ errors).tolist())


def _chosen(errors: Mapping[str, ClosedLoopError], drives: Sequence[Drive]) -> tuple[str, str]:
    known = {name: error.gap for name, error in errors.items() if math.isfinite(error.gap)}
    collides = {name for name in known if any(candidate(drive.model, name).collides for drive in drives)}
    safe = [name for name in known if name not in collides] or list(known)
    least = min(safe, key=lambda name: known[name])
    first = next(name for name in safe if known[name] * (1.0 - MARGIN) <= known[least])
    says = ", ".join(
        f"{name} {x:.3f}{' (collides)' if name in collides else ''}" for name, x in known.items()
    )
    return first, f"held-out error of the gap, mean over the drives: {says}"


def _mean(candidates: Sequence[Candidate]) -> tuple[Array, Array, Array]:
    """Mean, its covariance and the variances between drives, on the unit cube."""
    x = np.array([calibrated.x for calibrated in candidates])  # (drives, k)
    covariances = [np.array(calibrated.covariance) for calibrated in candidates]
    for covariance in covariances:
        known = np.diagonal(covariance) <= KNOWN_VARIANCE
        # the covariances of what is not known go with it
        covariance[~known], covariance[:, ~known] = 0.0, 0.0
        np.fill_diagonal(
            covariance, np.where(known, np.maximum(np.diagonal(covariance), LEAST_VARIANCE), UNKNOWN_VARIANCE)
        )
    variances = np.array([np.diagonal(covariance) for covariance in covariances])
    between = _between(x, variances)
    weights = [np.linalg.inv(_positive(covariance) + np.diag(between)) for covariance in covariances]
    total = np.linalg.inv(np.sum(weights, axis=0))
    mean = total @ np.sum([w @ point for w, point in zip(weights, x, strict=True)], axis=0)
    return mean, total, between


def _positive(C: Array) -> Array:
    """The nearest positive definite matrix: a jackknife over few stretches has no full rank."""
    values, vectors = np.linalg.eigh(C)
    out: Array = (vectors * np.maximum(values, LEAST_VARIANCE)) @ vectors.T
    return out


def _between(x: Array, variances: Array) -> Array:
    """Variance between drives of each parameter (DerSimonian & Laird 1986, eq. 8)."""
    known = variances <= KNOWN_VARIANCE
    n = known.sum(axis=0)
    w = known / variances
    total = np.where(n > 0, w.sum(axis=0), 1.0)
    q = (w * (x - (w * x).sum(axis=0) / total) ** 2).sum(axis=0)
    size = total - (w**2).sum(axis=0) / total
    return np.where(n > 1, np.maximum((q - (n - 1)) / np.where(n > 1, size, 1.0), 0.0), 0.0)


def _noise(noises: Sequence[DriverNoise], share: Array) -> DriverNoise:
    if len(noises) == 1:
        return noises[0]
    sensitivity = np.array([noise.sensitivity for noise in noises])
    known = np.isfinite(sensitivity)
    return DriverNoise(
        _geometric([noise.sd for noise in noises], share),
        _geometric([noise.time for noise in noises], share),
        float(np.average(sensitivity[known], weights=share[known])) if known.any() else NAN,
    )


def _geometric(intervals: Sequence[Interval], share: Array) -> Interval:
    """Geometric mean over drives, with the interval of independent errors."""
    known = [k for k, interval in enumerate(intervals) if interval.value > 0.0]
    if not known:
        return Interval(0.0, 0.0, NAN) if any(interval.value == 0.0 for interval in intervals) else Interval()
    weight = share[known] / share[known].sum()
    log = np.log([intervals[k] for k in known])
    value = float(weight @ log[:, 0])
    half = float(np.sqrt(np.sum((weight * 0.5 * (log[:, 2] - log[:, 1])) ** 2)))
    return Interval(*(math.exp(value + k * half) for k in (0.0, -1.0, 1.0)))
