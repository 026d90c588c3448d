"""Dual unscented Kalman filter of a constant time-headway policy (Ampountolas, arXiv 2306.03458; IEEE T-IV 2023).

Two filters in turn, by filterpy: speed and gap with the parameters held, then the parameters as a random walk with
speed and gap held. The same model as in cth_rv.py, and the same things are not estimated.
"""

from __future__ import annotations

import numpy as np

from benchmarks.identification.peers.cth_rv import GAP_SD, HIGH, LOW, SPEED_SD, WALK, Steps, in_units
from benchmarks.identification.peers.rows import EVERY, FEWEST, Rows


def steps(rows: Rows) -> Steps:
    """Yield K1 and K2 once a second."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    dt, lead = rows.dt, rows.speed + rows.inputs[:, 1]

    def move(x: np.ndarray, theta: np.ndarray, u: float) -> np.ndarray:
        s, v = x
        return np.array([s + dt * (u - v), v + dt * (theta[0] * (s - theta[2] * v) + theta[1] * (u - v))])

    sensors = np.diag([GAP_SD**2, SPEED_SD**2])
    remnant = np.diag([1e-6, (dt * rows.remnant) ** 2])  # the gap has no noise of its own but rounding
    state = UnscentedKalmanFilter(
        2, 2, dt, hx=lambda x: x, fx=move, points=MerweScaledSigmaPoints(2, 1e-1, 2.0, 1.0)
    )
    state.x, state.P = np.array([rows.gap[0], rows.speed[0]]), sensors.copy()
    state.Q, state.R = remnant, sensors
    # parameters in shares of their range: sigma points of one size in all directions
    wide = HIGH - LOW
    parameters = UnscentedKalmanFilter(
        3, 2, dt, hx=move, fx=lambda w, dt: w, points=MerweScaledSigmaPoints(3, 1e-1, 2.0, 0.0)
    )
    parameters.x, parameters.P = np.full(3, 0.5), np.eye(3) / 12.0
    parameters.Q, parameters.R = WALK**2 * np.eye(3), sensors + remnant
    for k in range(1, len(rows.output)):
        u, seen = float(lead[k - 1]), np.array([rows.gap[k], rows.speed[k]])
        if not rows.usable[k]:  # nothing is learnt; speed and gap are known all the same
            state.x, state.P = seen, sensors.copy()
            continue
        before = state.x.copy()

        def expected(w: np.ndarray, before: np.ndarray = before, u: float = u) -> np.ndarray:
            return move(before, LOW + wide * w, u)

        parameters.predict()
        parameters.update(seen, hx=expected)
        theta = LOW + wide * parameters.x
        state.predict(fx=lambda x, dt, theta=theta, u=u: move(x, theta, u))
        state.update(seen)
        if (k + 1) % EVERY == 0 and k > FEWEST:
            yield k, in_units(rows, theta, wide * np.sqrt(np.maximum(np.diag(parameters.P), 0.0)))
