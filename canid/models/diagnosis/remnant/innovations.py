"""Innovations of the final driver model, and the features that their scale may follow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification import innovation_law
from canid.models.diagnosis.driver.driver_data import DriverData, filled
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.fitting.likelihood import whitened
from canid.models.effects.effect import ScaleFeature
from canid.values.findings import Flags
from canid.values.types import Array, Trace

# standard deviations from the mean; beyond it a feature counts as so much: an exponential of one outlier is no law
MAX_FEATURE = 3.0
# samples after which a signal that is sent more slowly than the grid repeats its phase: its innovations are of another
# size at each of them, which is neither a tail nor a burst
PHASES = 4


class Innovations(NamedTuple):
    """What is left of a drive when mean, autocorrelation and present scale of the noise are taken out."""

    x: Array  # (n,) standard deviations of the present model, not divided by its relative scale
    rows: Flags  # (n,) samples that count and are free
    features: dict[ScaleFeature, Array]  # (n,), of the past alone
    # (k, n) in every law: what the present scale follows (size of the response, speed), and the phases of the sampling
    present: Array
    dt: float  # s
    size: Array  # (n,) by which they are divided where recent ones are compared: that of the state, without bursts


def innovations(trace: Trace, data: DriverData, solved: FittedDriver) -> Innovations:
    """Whiten the residual of the final driver model, and lay out the features.

    Args:
        trace: of the drive.
        data: the driver's columns, with what the search took out of them.
        solved: the final model.
    """
    rows = solved.rows & ~data.output.hidden
    x = np.where(rows, whitened(solved.noise, data.output.y - solved.fitted.model) * solved.noise.size, 0.0)
    # a law of the innovations has the bursts in its size
    size = np.ones(x.size) if np.isfinite(solved.noise.freedom) else solved.noise.size
    e = x / size
    accel = trace.signals.get("accel")
    own_accel = filled(accel) if accel is not None else np.diff(data.output.y, prepend=data.output.y[:1])
    recent = innovation_law.features(e, rows, np.zeros(e.size), 1.0 / data.output.dt)[0]
    phase = np.arange(e.size) % PHASES
    followed = solved.model.noise_features(data, solved.fitted.model)
    present = np.zeros((0, e.size)) if followed is None else followed.T
    return Innovations(
        x,
        rows,
        {
            # an innovation is known with its sample: what it is compared with is one sample old
            ScaleFeature.OWN_ACCELERATION: _standard(_before(np.abs(own_accel)), rows),
            ScaleFeature.LEAD_ACCELERATION: _standard(_before(np.abs(data.seen.lead_accel)), rows),
            ScaleFeature.PAST_INNOVATIONS: np.clip(recent, -MAX_FEATURE, MAX_FEATURE),
        },
        np.vstack([present, *((phase == k) - 1.0 / PHASES for k in range(1, PHASES))]),
        data.output.dt,
        size,
    )


def _before(x: Array) -> Array:
    """The value of one sample ago.

    >>> _before(np.array([1.0, 2.0, 3.0]))
    array([1., 1., 2.])
    """
    return np.concatenate([x[:1], x[:-1]])


def _standard(x: Array, rows: Flags) -> Array:
    """Mean 0 and standard deviation 1 over the rows; 0 where nothing varies.

    >>> _standard(np.array([1.0, 3.0, 9.0]), np.array([True, True, False]))
    array([-1.,  1.,  3.])
    """
    sd = float(np.std(x[rows])) if rows.any() else 0.0
    if sd < 1e-9:
        return np.zeros_like(x)
    return np.clip((x - np.mean(x[rows])) / sd, -MAX_FEATURE, MAX_FEATURE)
