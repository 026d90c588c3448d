"""Conditional means of the driver's inputs given the log: what an observer of the log can know of them.

A radar's reports are noisy, and nothing after an answer may be used to know what was answered. The best that is left is
the conditional mean of gap, range rate and the lead's acceleration, dead time by dead time, as canid's filter gives it.
The answer to the rest acts as further noise of the driver. A lead's acceleration is known to a fraction only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from canid.models.diagnosis.driver.driver_data import prepare
from canid.values.types import Trace
from tests.plants.planted_drive import Array, Planted

GRID_S = 0.1  # s: canid's own
MIN_SPEED_M_S = 1.0  # m/s; below, a headway says nothing


class Known(NamedTuple):
    """Columns (n, lags) on the times asked for: what is known at t of x(t − k·GRID_S)."""

    headway: Array  # s
    range_rate: Array  # m/s
    lead_accel: Array  # m/s²

    def answers(self, p: Array) -> tuple[Array, Array]:
        """Both inputs (n,) through lag and dead time, for p = (tau1, dead_time1, tau2, dead_time2) s."""
        return answer(self.headway, p[0], p[1]), answer(self.range_rate, p[2], p[3])


def known(planted: Planted, trace: Trace, t: Array) -> Known:
    """Conditional means of the inputs, from a log.

    Args:
        planted: the drive as it was; it fills in where the log is silent.
        trace: as its log has it.
        t: (n,) s, of the drive, `GRID_S` apart.
    """
    data = prepare(trace, np.ones(trace.t.size, dtype=bool))
    fine = data.output.usable
    c, lags = planted.columns, data.known.gap.shape[1]

    def from_log(columns: Array, true: Array) -> Array:
        """Take the log's columns where they are fine, and the truth elsewhere."""
        out = np.empty((t.size, lags))
        there = np.interp(t, trace.t, fine.astype(float)) > 0.5
        for k in range(lags):
            late = np.interp(t - k * GRID_S, c["t"], true)
            out[:, k] = np.where(there, np.interp(t, trace.t, columns[:, k]), late)
        return out

    speed = np.maximum(c["speed"], MIN_SPEED_M_S)
    gap = from_log(data.known.gap, c["gap"])
    own = np.stack([np.interp(t - k * GRID_S, c["t"], speed) for k in range(lags)], axis=1)
    accel = np.gradient(c["range_rate"] + c["speed"], planted.dt)
    rate, lead = from_log(data.known.range_rate, c["range_rate"]), from_log(data.known.lead_accel, accel)
    return Known(gap / own, rate, lead)


def answer(lags: Array, tau: float, dead_time: float) -> Array:
    """1 / (1 + tau s) of what is known of a dead time ago, (n,); beyond the last lag it is delayed further."""
    last = lags.shape[1] - 1
    steps = min(dead_time / GRID_S, last - 1e-6)
    whole = int(steps)
    x = (1 - steps + whole) * lags[:, whole] + (steps - whole) * lags[:, whole + 1]
    beyond = max(dead_time / GRID_S - last, 0.0)
    if beyond > 0.0:
        x = np.interp(np.arange(x.size) - beyond, np.arange(x.size), x)
    # exact for an input that is straight between samples
    keep = np.exp(-GRID_S / tau)
    ramp = tau / GRID_S * (1 - keep)
    now, before = 1 - ramp, ramp - keep
    out: Array = lfilter([now, before], [1.0, -keep], x, zi=np.array([(1 - now) * x[0]]))[0]
    return out
