"""Constant time headway, relative velocity: dv/dt = alpha (s - tau_h v) + beta dv, identified online.

Wang, Gunter, Nice, Delle Monache & Work (arXiv 1911.06454; IEEE T-IV 6, 2021): recursive least squares of the Euler
step, and a particle filter of speed, gap and parameters. In canid's units K1 = alpha times the mean speed and
K2 = beta. Neither has a lag, a dead time or a noise model.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.identification.peers.gls import Answer
from benchmarks.identification.peers.rows import EVERY, FEWEST, Rows

Steps = Iterator[tuple[int, Answer]]

# variance of a parameter before any data, in its unit squared: nothing is known
UNKNOWN = 1e6

# ten times the usual 500, all but a few of which die in the first second: then it does not find even its own model
PARTICLES = 5000
# ranges of alpha 1/s², beta 1/s and tau_h s from which the particles are drawn: driver and ACC of the two papers
LOW, HIGH = np.array([0.002, 0.05, 0.5]), np.array([0.15, 1.5, 3.0])
# random walk of a parameter per sample, in shares of its range: without it the particles die out
WALK = 1e-3
# m/s and m: the sensors of these drives
SPEED_SD, GAP_SD = 0.03, 0.25


def in_units(rows: Rows, theta: np.ndarray, sd: np.ndarray) -> Answer:
    """K1 and K2 in the output's unit, from alpha and beta; the delays are not estimated."""
    scale = np.array([float(rows.speed[rows.usable].mean()), 1.0]) / rows.gain
    return Answer(np.append(theta[:2] * scale, np.nan), np.append(sd[:2] * scale, np.nan))


def _recursion(
    X: np.ndarray, y: np.ndarray, usable: np.ndarray
) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Recursive least squares; yields k, estimates and their sd by the residual's variance."""
    p = X.shape[1]
    theta, P = np.zeros(p), UNKNOWN * np.eye(p)
    square, count = 0.0, 0
    for k, (row, value) in enumerate(zip(X, y, strict=True)):
        if usable[k]:
            gain = P @ row / (1.0 + row @ P @ row)
            error = value - row @ theta
            theta = theta + gain * error
            P = P - np.outer(gain, row @ P)
            square, count = square + error * (value - row @ theta), count + 1
        if (k + 1) % EVERY == 0 and count > FEWEST:
            yield k, theta, np.sqrt(np.maximum(np.diag(P), 0.0) * square / (count - p))


def speed_steps(rows: Rows) -> Steps:
    """As published: the next speed from speed, gap and lead speed."""
    v, s, lead = rows.speed, rows.gap, rows.speed + rows.inputs[:, 1]
    X = np.column_stack([s, lead - v, -v])[:-1]
    usable = rows.usable[1:] & rows.usable[:-1]
    for k, theta, sd in _recursion(X, np.diff(v) / rows.dt, usable):
        yield k, in_units(rows, theta, sd)


def output_steps(rows: Rows) -> Steps:
    """The same with the driver's own output in the place of the acceleration, headway for gap, and an offset."""
    X = np.column_stack([rows.inputs, np.ones(len(rows.output))])
    for k, theta, sd in _recursion(X, rows.output, rows.usable):
        yield k, Answer(np.append(theta[:2], np.nan), np.append(sd[:2], np.nan))


def particle_steps(rows: Rows) -> Steps:
    """Bootstrap particle filter, systematic resampling where half of the particles are lost."""
    rng = np.random.default_rng(0)
    n, dt = PARTICLES, rows.dt
    theta = rng.uniform(LOW, HIGH, (n, 3))
    v = rows.speed[0] + SPEED_SD * rng.standard_normal(n)
    s = rows.gap[0] + GAP_SD * rng.standard_normal(n)
    log = np.zeros(n)
    lead = rows.speed + rows.inputs[:, 1]
    for k in range(1, len(rows.output)):
        a = theta[:, 0] * (s - theta[:, 2] * v) + theta[:, 1] * (lead[k - 1] - v)
        s = s + dt * (lead[k - 1] - v)
        v = v + dt * (a + rows.remnant * rng.standard_normal(n))
        if rows.usable[k]:
            theta = np.clip(theta + WALK * (HIGH - LOW) * rng.standard_normal((n, 3)), LOW, HIGH)
            log -= 0.5 * (((rows.speed[k] - v) / SPEED_SD) ** 2 + ((rows.gap[k] - s) / GAP_SD) ** 2)
        else:  # nothing is learnt; speed and gap are known all the same
            v, s = np.full(n, rows.speed[k]), np.full(n, rows.gap[k])
        weight = np.exp(log - log.max())
        weight /= weight.sum()
        if (k + 1) % EVERY == 0 and k > FEWEST:
            mean = weight @ theta
            yield k, in_units(rows, mean, np.sqrt(weight @ (theta - mean) ** 2))
        if 1.0 / float(weight @ weight) < 0.5 * n:
            kept = np.searchsorted(np.cumsum(weight), (np.arange(n) + rng.uniform()) / n).clip(max=n - 1)
            theta, v, s, log = theta[kept], v[kept], s[kept], np.zeros(n)
