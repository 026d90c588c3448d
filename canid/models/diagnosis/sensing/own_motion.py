"""Own motion in the range rate: it enters with factor −1, whatever the gap says (prediction errors; Ljung 1999, ch. 13.4).

    range_rate(t) = κ · (lead speed(t) − own speed(t)) + noise

Gap and range rate alone give the ratio of their scales only. With κ = 1 the range rate is right and the gap is not; with κ
equal to that ratio it is the other way round. With the right κ, range_rate + κ · own speed holds nothing of the own motion,
so its innovations do not depend on it.

As for the age of the reports (`radar_report_age`) there are two estimates: by prediction errors κ comes out too small, as
the driver sees the lead better than the radar's reports show it; by the own unrest as an instrument it comes out too
large. The interval contains both. It held 1 on each of 20 clean drives of 8 min, with a median half width of
0.5: a scale error of 0.1 is mostly not decided, one of a unit mostly is (docs/evidence/diagnosis.md).
"""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter

from canid.mathematics.identification.autoregression import whole
from canid.models.diagnosis.causal_smoothing import roughness
from canid.models.diagnosis.sensing.radar_report_age import (
    ORDER,
    RESPONSE_S,
    SMOOTHING_S,
    Estimated,
    Filtered,
    Rows,
    Score,
    by_unrest,
    filtered,
    sandwich,
)
from canid.values.findings import Flags
from canid.values.types import Array, Interval

# samples: of a shorter drive 40 coefficients of the lead's speed are not known
MIN_ROWS = 1000
ITERATIONS, CONVERGED = 30, 1e-3
# largest step of an iteration, in parts of the coefficient it begins with
MAX_STEP = 0.3


def coefficient(
    rate: Array, speed: Array, accel: Array, usable: Flags, dt: float, begin: float, sigmas: float
) -> Interval | None:
    """Estimate κ; None: the own motion does not show in the range rate.

    Args:
        rate: (n,) m/s, as reported.
        speed: (n,) m/s, own.
        accel: (n,) m/s², own, measured apart from the speed: the slope of a smoothed speed knows what comes next.
        usable: (n,) both are there; a new stretch of True starts after each False.
        dt: s.
        begin: where the search begins, above 0.
        sigmas: standard deviations to each side of both estimates.
    """
    rows = np.flatnonzero(whole(usable, round(RESPONSE_S / dt) + ORDER)).astype(np.int64)
    if rows.size < MIN_ROWS or float(np.std(speed[rows])) < 1e-6:
        return None
    speed = savgol_filter(speed, 2 * round(SMOOTHING_S / dt / 2) + 1, 2)
    own_speed = speed - speed[rows].mean()
    rate = np.where(np.isfinite(rate), rate, 0.0)

    def at(kappa: float) -> Filtered:
        return filtered(rate + kappa * own_speed, own_speed, rows)

    by_errors = _by_errors(at, rows, begin, dt)
    noise = roughness(np.where(usable, rate, np.nan), 2) ** 2
    unrest = by_unrest(at, accel, rows, noise, dt, begin, MAX_STEP * begin, CONVERGED * begin)
    if by_errors is None or unrest is None:
        return None
    both = by_errors, unrest
    return Interval(
        0.5 * (by_errors.value + unrest.value),
        min(estimate.value - sigmas * estimate.sd for estimate in both),
        max(estimate.value + sigmas * estimate.sd for estimate in both),
    )


def _by_errors(at: Score, rows: Rows, begin: float, dt: float) -> Estimated | None:
    kappa = begin
    for _ in range(ITERATIONS):
        here = at(kappa)
        motion, left = here.motion[rows], here.innovation[rows]
        strength = float(motion @ motion)
        if strength <= 0.0:
            return None
        move = -float(motion @ left) / strength
        kappa += float(np.clip(move, -MAX_STEP * begin, MAX_STEP * begin))
        if abs(move) < CONVERGED * begin:
            meat, _ = sandwich((motion * left)[:, None], rows, dt)
            return Estimated(kappa, float(np.sqrt(meat[0, 0])) / strength)
    return None
