"""What a driver who never changes shows in one-minute fits: the printed mean driver with a car, simulated for two hours.

A small version of `canid study chen-ulsoy --reproduce`: 119 minutes in closed loop, ARMAX(2, 2, 1) fitted to each. The
driver is constant, so that the scatter of the fits is that of sampling alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter, ss2tf

from benchmarks.papers.prints import reverse_arrangements
from benchmarks.papers.prints.steering_tables import roots
from benchmarks.papers.prints.uncertainty_bound import printed_bound
from canid.mathematics.identification.armax.armax_batch import Orders, fit_armax
from canid.values.types import Array
from canid_study.chen_ulsoy.one_track_car import OneTrackCar, matrices
from canid_study.printed_numbers import (
    SEGMENT_SAMPLES,
    SEGMENTS,
    STEERING_INTERVAL_S,
    SteeringTable,
)

SPEED = 25.0  # m/s
# of C = 1 + c1 q^-1, which is not printed and decides how much the fits scatter
C1_VALUES = (-0.3, 0.0, 0.3)
# degrees of the wheel, and m/s: noise of the driver and what the road's unevenness moves the car by; neither is printed
NOISE_SD, ROAD_SD = 0.25, 0.1
# at which the estimated |Delta| of a driver who has none is stated: below the band of steering, and its upper end
NULL_HZ = np.array([0.05, 0.5])
_ROAD_S = 0.5  # s, for how long a push of the road lasts


class ConstantDriver(NamedTuple):
    """Two hours of a driver at the printed means."""

    table: SteeringTable
    c1: float
    seed: int
    mean: Array  # (4,) of the fits
    sd: Array  # (4,)
    corr_b: float
    passing_steering: float  # share of segments that pass the reverse arrangements test
    passing_offset: float
    null: Array  # (119 or fewer, 2) |Delta| over eq. 5 of each segment, at NULL_HZ
    rejected: int  # segments without a fit, or with unstable or negative poles


def constant_driver(table: SteeringTable, c1: float, seed: int) -> ConstantDriver:
    """Simulate 119 minutes and fit each.

    Args:
        table: its means are the driver, with b in degrees per meter.
        c1: of its noise.
        seed: of driver and road.

    Example:
        >>> from canid_study.printed_numbers import STEERING_TABLES
        >>> found = constant_driver(STEERING_TABLES[0], 0.0, 1)
        >>> bool(found.corr_b < -0.99), 0.8 < found.passing_steering <= 1.0
        (True, True)
    """
    steering, offset = drive(table, c1, SEGMENTS * SEGMENT_SAMPLES, seed)
    u, y = steering.reshape(SEGMENTS, -1), offset.reshape(SEGMENTS, -1)
    usable = np.full(SEGMENT_SAMPLES, True)
    fits = [fit_armax(one, other[:, None], usable, Orders()) for one, other in zip(u, y, strict=True)]
    found = np.array([fit.theta[:4] for fit in fits if fit is not None])
    poles = roots(found[:, 0], found[:, 1])
    negative = (poles.imag == 0.0).all(axis=1) & (poles.real.min(axis=1) < 0.0)
    good = (np.abs(poles).max(axis=1) < 1.0) & ~negative
    kept = found[good]
    fitted = [k for k, fit in enumerate(fits) if fit is not None]
    null = np.array([_delta(kept[i], u[k], y[k]) for i, k in enumerate(np.array(fitted)[good])])
    return ConstantDriver(
        table,
        c1,
        seed,
        kept.mean(axis=0),
        kept.std(axis=0, ddof=1),
        float(np.corrcoef(kept[:, 2], kept[:, 3])[0, 1]),
        float(reverse_arrangements.passes(u - u.mean(axis=1, keepdims=True)).mean()),
        float(reverse_arrangements.passes(y - y.mean(axis=1, keepdims=True)).mean()),
        null / printed_bound(2.0 * np.pi * NULL_HZ),
        SEGMENTS - len(kept),
    )


def drive(table: SteeringTable, c1: float, samples: int, seed: int) -> tuple[Array, Array]:
    """Wheel angle (°) and lateral error (m) of the closed loop, every 0.1 s.

    Args:
        table: the driver.
        c1: of its noise.
        samples: how many.
        seed: of driver and road.

    Returns:
        (samples,) each.
    """
    a1, a2, b1, b2 = table.mean
    A, B = np.array([1.0, a1, a2]), np.array([0.0, b1, b2])
    N, D = _car_polynomials(OneTrackCar(), SPEED)
    rng = np.random.default_rng(seed)
    e = lfilter([1.0, c1], [1.0], NOISE_SD * rng.standard_normal(samples))
    decay = np.exp(-STEERING_INTERVAL_S / _ROAD_S)
    push: Array = lfilter([ROAD_SD * np.sqrt(1.0 - decay**2)], [1.0, -decay], rng.standard_normal(samples))
    # D has the car's two integrators; the road's displacement is one sum of its velocity, so that one of them cancels
    road = lfilter(np.polydiv(D, [1.0, -1.0])[0] * STEERING_INTERVAL_S, [1.0], push)
    closed = np.polyadd(np.polymul(A, D), np.polymul(B, N))
    # position p = N/D angle + road, error y = -p, A angle = B y + C e
    steering: Array = lfilter(D, closed, e) - lfilter(B, closed, road)
    offset: Array = -(lfilter(N, closed, e) + lfilter(A, closed, road))
    return steering, offset


def _delta(model: Array, u: Array, y: Array) -> Array:
    """|Delta| at `NULL_HZ` as the paper estimates it: ARX of order 2 from y to u - (B/A) y (sec. 3)."""
    a1, a2, b1, b2 = model
    y = y - y.mean()
    n = u - u.mean() - lfilter([0.0, b1, b2], [1.0, a1, a2], y)
    rows = np.stack([-n[1:-1], -n[:-2], y[1:-1], y[:-2]], axis=1)
    d1, d2, c1, c2 = np.linalg.lstsq(rows, n[2:], rcond=None)[0]
    q = np.exp(-2j * np.pi * NULL_HZ * STEERING_INTERVAL_S)
    out: Array = np.abs((c1 + c2 * q) * q / (1.0 + d1 * q + d2 * q * q))
    return out


def closed_loop_stable(table: SteeringTable) -> bool:
    """Whether the driver of the means keeps the car at `SPEED`.

    >>> from canid_study.printed_numbers import STEERING_TABLES
    >>> closed_loop_stable(STEERING_TABLES[0])
    True
    """
    a1, a2, b1, b2 = table.mean
    N, D = _car_polynomials(OneTrackCar(), SPEED)
    closed = np.polyadd(np.polymul([1.0, a1, a2], D), np.polymul([0.0, b1, b2], N))
    return bool(np.abs(np.roots(closed)).max() < 1.0)


def _car_polynomials(car: OneTrackCar, speed: float) -> tuple[Array, Array]:
    """Numerator and denominator in q^-1 from the wheel angle in degrees to the lateral position in m."""
    A, B = matrices(car, speed)
    block = np.zeros((5, 5))
    block[:4, :4], block[:4, 4] = A, B * np.pi / 180.0
    sampled = expm(block * STEERING_INTERVAL_S)
    num, den = ss2tf(sampled[:4, :4], sampled[:4, 4:], np.array([[0.0, 0.0, 0.0, 1.0]]), np.zeros((1, 1)))
    return np.asarray(num[0]), np.asarray(den)
