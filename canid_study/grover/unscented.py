"""Unscented Kalman filter of gap, range rate and the gains: a second opinion by filterpy that shares nothing with the fits.

The state is gap, range rate, K1, K2, the offset and the driver's noise; gap, range rate and output are measured. After the
dual unscented filter of a constant time-headway policy (Ampountolas, arXiv 2306.03458), in one filter; like it, without
lag and dead time, so that its gains are those of a driver who answers at once. The only file here that imports filterpy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import NAN, Array, Interval, Trace
from canid_study.grover.episodes import Episode

Rows = npt.NDArray[np.int64]

# s from one update to the next: half of the least total delay of a driver, which this filter does not know
STEP_S = 0.5
# m and m/s: what a production radar's smoothed reports are good for
GAP_SD, RATE_SD = 0.25, 0.1
# m/s²: how much a lead's acceleration changes speed between two updates
LEAD_SD = 0.5
# sd of a gain before any data, in multiples of the output's sd over the input's: nothing is known
WIDE = 10.0
# of the sigma points: with these all weights are positive, which keeps the covariance positive definite; at alpha 0.1 it
# was lost in the first seconds
ALPHA, BETA, KAPPA = 1.0, 2.0, 0.0
# updates below which nothing is said
MIN_UPDATES = 40


class SecondOpinion(NamedTuple):
    """Gains at the end of the episodes, 95 % intervals by the filter's own covariance."""

    gains: tuple[Interval, Interval]  # K1, K2
    says: str = ""  # why there is none


def of_drive(trace: Trace, episodes: Sequence[Episode]) -> SecondOpinion:
    """Run the filter through the episodes of a drive, one after the other; the gains are kept between them.

    Args:
        trace: of the drive, with gap, range rate and speed.
        episodes: of it.
    """
    nothing = (Interval(), Interval())
    signals = [trace.signals.get(role) for role in ("gap", "range_rate", "speed")]
    if any(column is None for column in signals):
        return SecondOpinion(nothing, "gap, range rate or speed is not recorded")
    gap, rate, speed = (np.asarray(column) for column in signals)
    every = max(round(STEP_S / trace.dt), 1)
    rows = [np.arange(e.first, e.stop, every, dtype=np.int64) for e in episodes]
    at = np.concatenate(rows) if rows else np.zeros(0, np.int64)
    known = np.isfinite(gap[at] + rate[at] + speed[at])
    if known.sum() < MIN_UPDATES:
        return SecondOpinion(nothing, "too few samples with gap, range rate and speed")
    wanted = float(np.median((gap[at] / speed[at] - trace.inputs[at, 0])[known]))
    static = _static(trace, at[known], every * trace.dt)
    try:
        x, P, updates = _filtered(trace, (gap, rate, speed), rows, wanted, static)
    except (np.linalg.LinAlgError, ValueError):
        return SecondOpinion(nothing, "its covariance lost positive definiteness")
    sd = np.sqrt(np.maximum(np.diag(P), 0.0))
    gains = [
        Interval(float(v), float(v - h), float(v + h)) for v, h in zip(x, NORMAL_QUANTILE * sd, strict=True)
    ]
    if not np.isfinite(x).all() or updates < MIN_UPDATES:
        return SecondOpinion(nothing, "it diverged")
    return SecondOpinion((gains[2], gains[3]))


class _Static(NamedTuple):
    """What a regression without lag gives: where the filter begins, and its noise."""

    gains: Array  # (2,)
    offset: float
    sd: float  # of the noise, output unit
    correlation: float  # of the noise from one update to the next
    wide: Array  # (2,) sd of the gains before any data


def _static(trace: Trace, at: Rows, step: float) -> _Static:
    columns = np.column_stack([trace.inputs[at], np.ones(len(at))])
    weights = np.linalg.lstsq(columns, trace.output[at], rcond=None)[0]
    residual = trace.output[at] - columns @ weights
    follows = np.diff(trace.t[at]) < 1.5 * step
    before, after = residual[:-1][follows], residual[1:][follows]
    power = float(before @ before)
    correlation = float(np.clip(before @ after / power if power > 0.0 else 0.0, 0.0, 0.99))
    sd = max(float(residual.std()), 1e-9)
    spread = np.maximum(np.asarray(columns[:, :2].std(axis=0), np.float64), 1e-9)
    gains = np.asarray(weights[:2], np.float64)
    wide = np.asarray(WIDE * float(trace.output[at].std()) / spread, np.float64)
    return _Static(gains, float(weights[2]), sd, correlation, wide)


def _filtered(
    trace: Trace, signals: tuple[Array, Array, Array], rows: Sequence[Rows], wanted: float, static: _Static
) -> tuple[Array, Array, int]:
    """Run through all episodes; the state of six, its covariance, and the number of updates."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    gap, rate, speed = signals
    n = 6
    points = MerweScaledSigmaPoints(n, ALPHA, BETA, KAPPA)

    def move(x: Array, dt: float, slower: float = 0.0) -> Array:
        moved = x.copy()
        moved[0] = x[0] + dt * (x[1] + 0.5 * slower)
        moved[1] = x[1] + slower
        moved[5] = static.correlation * x[5]
        return moved

    def sensors(x: Array, own_speed: float = 1.0) -> Array:
        output = x[4] + x[2] * (x[0] / own_speed - wanted) + x[3] * x[1] + x[5]
        return np.array([x[0], x[1], output])

    lead = LEAD_SD * STEP_S
    shock = static.sd * math.sqrt(1.0 - static.correlation**2)
    ukf = UnscentedKalmanFilter(n, 3, STEP_S, hx=sensors, fx=move, points=points)
    # gains and offset stand still; what is added keeps the square root of the covariance in double precision
    still = np.concatenate([1e-6 * static.wide, [1e-6 * static.sd]]) ** 2
    ukf.Q = np.diag([(0.5 * lead * STEP_S) ** 2 + 1e-6, lead**2, *still, shock**2])
    # the output is known to a hundredth of its noise
    ukf.R = np.diag([GAP_SD**2, RATE_SD**2, (0.01 * static.sd) ** 2 + (0.1 * shock) ** 2])
    ukf.x = np.array([0.0, 0.0, *static.gains, static.offset, 0.0])
    ukf.P = np.diag([1.0, 1.0, *static.wide**2, (WIDE * static.sd) ** 2, static.sd**2])
    updates = 0
    for episode in rows:
        before = NAN
        for k in episode.tolist():
            seen = np.array([gap[k], rate[k], trace.output[k]])
            if not (np.isfinite(seen).all() and math.isfinite(speed[k]) and speed[k] > 0.0):
                before = NAN
                continue
            if math.isnan(before):
                # gap, range rate and noise begin anew; what was learnt of the gains stays
                kept = np.zeros((n, n))
                kept[2:5, 2:5] = ukf.P[2:5, 2:5]
                kept[0, 0], kept[1, 1], kept[5, 5] = GAP_SD**2, RATE_SD**2, static.sd**2
                ukf.x = np.array([seen[0], seen[1], *ukf.x[2:5], 0.0])
                ukf.P = kept
            # its update takes the sigma points of the last prediction: one is needed at the beginning too
            ukf.predict(slower=0.0 if math.isnan(before) else before - speed[k])
            ukf.update(seen, own_speed=speed[k])
            # rounding leaves it a little asymmetric
            ukf.P = 0.5 * (ukf.P + ukf.P.T)
            before = float(speed[k])
            updates += 1
    return np.asarray(ukf.x, float), np.asarray(ukf.P, float), updates
