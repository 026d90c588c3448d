"""Drives of the fitted driver on the recorded road, in closed loop with his own noise resampled.

The lateral offset answers the wheel as an autoregression with exogenous input that is fitted to the drive itself; what it
leaves (wind, the road, curves) is kept as it was recorded, as the lead vehicle is in car following. So with the recorded
angles the recorded offsets come out, and with the noise of a replicate another drive on the same road.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis.fitting import likelihood
from canid.diagnosis.fitting.fitted_model import scaled_by_state, solve
from canid.diagnosis.lane import lane_candidates, lane_held_out
from canid.diagnosis.lane.lane_data import LaneData
from canid.diagnosis.lane.lane_fit import FittedLane
from canid.diagnosis.lane.lane_model import KD, OFFSET, PRODUCT, TAU, THETA, WANTED, K, polynomial
from canid.diagnosis.null.names import Statistics
from canid.diagnosis.null.noise_source import BLOCK_S, resampled
from canid.effects.effect import Effect
from canid.findings import Flags
from canid.types import Array

# s of past offsets and angles that the next offset depends on: a car's yaw and slip, and the smoothing of a camera
CAR_MEMORY_S = 1.0
# m; a replicate that leaves the lane by so much more than the drive did is another driver
MAX_FACTOR = 3.0
# samples of past that a car is fitted to, at least, per coefficient
MIN_ROWS_PER_COEFFICIENT = 20


class Road(NamedTuple):
    """How the offset answers the wheel, and what else moves the car."""

    of_offset: Array  # (p,) of the last offsets, latest first
    of_angle: Array  # (p,) of the last angles
    rest: Array  # (n,) m, all that these do not explain


def road(data: LaneData) -> Road | None:
    """Fit the car by least squares; None: too little was measured."""
    p, y, u = round(CAR_MEMORY_S / data.output.dt), data.offset, data.output.y
    past = np.stack(
        [np.r_[np.full(k, x[0]), x[:-k]] for x in (y, u) for k in range(1, p + 1)] + [np.ones(y.size)], axis=1
    )
    rows = data.output.usable & np.r_[np.zeros(p, dtype=bool), np.ones(y.size - p, dtype=bool)]
    if int(rows.sum()) < MIN_ROWS_PER_COEFFICIENT * past.shape[1]:
        return None
    found = np.linalg.lstsq(past[rows], y[rows], rcond=None)[0]
    found[-1] = 0.0
    return Road(found[:p], found[p : 2 * p], y - past @ found)


def simulated(data: LaneData, driver: FittedLane, on: Road, count: int, seed: list[int]) -> list[LaneData]:
    """Drive again, several times side by side: the baseline with its noise.

    Args:
        data: the recorded drive.
        driver: a baseline without effects.
        on: the car and the road.
        count: of replicates.
        seed: of the draws.

    Returns:
        those in which the driver keeps the lane.
    """
    n, dt, q, noise = data.t.size, data.output.dt, driver.q, driver.noise
    rng = np.random.default_rng(seed)
    pool = driver.fitted.scored.e[driver.rows]
    innovations = resampled(pool - pool.mean(), (n, count), max(round(BLOCK_S / dt), 1), rng)
    innovations *= noise.sd * noise.size[:, None]
    p, order = on.of_offset.size, noise.A.size - 1
    *a, gain = polynomial(float(q[TAU]), float(q[PRODUCT]), dt).tolist()
    back = float(q[THETA]) / dt
    whole, part = int(back), back - int(back)
    first = max(p, order, whole + 3)
    y, u = np.tile(data.offset[:, None], (1, count)), np.tile(data.output.y[:, None], (1, count))
    clean = np.tile(driver.fitted.model[:, None], (1, count))  # the answer without noise
    left = u - clean
    turn = np.stack([on.of_offset[::-1], on.of_angle[::-1]])
    A = noise.A[:0:-1]
    for k in range(first, n):
        y[k] = turn[0] @ y[k - p : k] + turn[1] @ u[k - p : k] + on.rest[k]
        # position and rate at the dead time, between two samples
        near, far, last = y[k - whole], y[k - whole - 1], y[k - whole - 2]
        position = (1 - part) * near + part * far - q[WANTED]
        rate = ((1 - part) * (near - far) + part * (far - last)) / dt
        demand = q[K] * position + q[KD] * rate
        aimed = clean[k - 1] - q[OFFSET], clean[k - 2] - q[OFFSET]
        clean[k] = q[OFFSET] + gain * demand - a[1] * aimed[0] - a[2] * aimed[1]
        left[k] = innovations[k] - A @ left[k - order : k]
        u[k] = clean[k] + left[k]
    limit = MAX_FACTOR * float(np.abs(data.offset).max())
    return [
        data._replace(offset=y[:, m], output=data.output._replace(y=u[:, m]))
        for m in range(count)
        if np.isfinite(u[:, m]).all() and float(np.abs(y[:, m]).max()) < limit
    ]


def statistics(replicate: LaneData, null: FittedLane, effects: list[Effect]) -> Statistics | None:
    """Fit null and effects to a replicate, one after the other; None: too few samples."""
    rows: Flags = likelihood.counted(replicate.output, null.noise.A.size - 1)
    if not rows.any():
        return None
    first = solve(replicate, null.model, null.q, null.noise, rows, turns=1)
    noise = scaled_by_state(replicate, null.model, first.fitted, null.noise, rows)
    base = solve(replicate, null.model, first.q, noise, rows, turns=2)
    evidence, extended = {}, base
    for effect in effects:
        found = lane_candidates.tried(effect, replicate, extended)
        evidence[effect.id] = found.evidence if found is not None else 0.0
        extended = found.solved if found is not None else extended
    won = lane_held_out.gain(replicate, base, replicate, extended).value if extended is not base else 0.0
    return Statistics(evidence, won)
