"""A driver whose own noise comes back through the loop; shares no code with canid nor with the planting simulators.

An answer to headway and relative speed, or the optimal-velocity form with relative velocity (Milanés & Shladover 2014),
autoregressive noise, acceleration as output.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from canid.values.types import LearnGate, Trace

# Hz of the simulation and of the log
FINE, GRID = 50, 10
# s, memory of a noise scale with bursts
BURST_S = 3.0


def follower(
    seed: int,
    lead_gain: float,
    minutes: float = 9.0,
    asymmetry: float = 0.0,
    slow_noise: tuple[float, float] | None = None,
    bursts: float = 0.0,
) -> Trace:
    """Simulate a driver behind a lead; form, gains, delays and noise drawn.

    Args:
        seed: of all that is drawn.
        lead_gain: of the lead's acceleration.
        minutes: of the drive.
        asymmetry: share by which K2 is larger where the gap closes, and smaller where it opens.
        slow_noise: m/s² and s, standard deviation and memory of the slow part; None: drawn.
        bursts: standard deviation of the log of the noise's scale, which changes within seconds; 0: Gaussian.
    """
    rng = np.random.default_rng(seed)
    n, dt = int(minutes * 60 * FINE), 1.0 / FINE
    # the lead: accelerations that die away within seconds, around a speed that it comes back to
    drive, pull, memory = rng.uniform(0.5, 0.8), rng.uniform(0.03, 0.06), rng.uniform(0.8, 1.6)
    mean, push = rng.uniform(17.0, 24.0), rng.standard_normal(n)
    lead, lead_accel, a = np.empty(n), np.empty(n), 0.0
    v = mean
    for k in range(n):
        a += dt / memory * (pull * (mean - v) * 4.0 - a) + drive * math.sqrt(2 * dt / memory) * push[k]
        v = max(v + dt * a, 3.0)
        lead[k], lead_accel[k] = v, a
    # noise: slow and quick parts
    slow, quick = math.exp(-dt / rng.uniform(3.0, 8.0)), math.exp(-dt / 0.3)
    parts = (rng.uniform(0.15, 0.25), slow), (rng.uniform(0.04, 0.08), quick)
    if slow_noise is not None:
        parts = (slow_noise[0], math.exp(-dt / slow_noise[1])), parts[1]
    scale = np.ones(n)
    if bursts:
        stay = math.exp(-dt / BURST_S)
        scale = np.exp(bursts * math.sqrt(1 - stay**2) * lfilter([1.0], [1.0, -stay], rng.standard_normal(n)))
        scale /= math.sqrt(float(np.mean(scale**2)))
    noise = sum(
        size * math.sqrt(1 - keep * keep) * lfilter([1.0], [1.0, -keep], scale * rng.standard_normal(n))
        for size, keep in parts
    )
    headway, k1, k2 = rng.uniform(1.4, 2.0), rng.uniform(0.5, 0.9), rng.uniform(0.3, 0.5)
    constant_time_gap = rng.random() < 0.5
    delay, lag = round(rng.uniform(0.3, 0.7) * FINE), rng.uniform(0.2, 0.5)
    gap, speed, wanted = np.empty(n), np.empty(n), 0.0
    x, v = headway * mean, mean
    out = np.empty(n)
    for k in range(n):
        gap[k], speed[k] = x, v
        j = max(k - delay, 0)
        error = (gap[j] - headway * speed[j]) / (mean if constant_time_gap else speed[j])
        rate = lead[j] - speed[j]
        answer = k2 * (1.0 + math.copysign(asymmetry, -rate)) * rate
        target = k1 * error + answer + lead_gain * lead_accel[j]
        wanted += dt / lag * (target - wanted)
        out[k] = wanted + noise[k]
        v = max(v + dt * out[k], 0.5)
        x += dt * (lead[k] - speed[k])
    at = slice(None, None, FINE // GRID)
    gap_seen = gap[at] + rng.normal(0.0, 0.03, gap[at].size)
    rate_seen = (lead - speed)[at] + rng.normal(0.0, 0.01, gap[at].size)
    columns = {"accel": out[at], "speed": speed[at], "gap": gap_seen, "range_rate": rate_seen}
    m = gap_seen.size
    inputs = np.stack([gap_seen / columns["speed"] - 2.0, rate_seen], axis=1)
    return Trace(
        1.0 / GRID, np.arange(m) / GRID, columns["accel"], inputs, ("headway_error", "range_rate"),
        (LearnGate.OPEN,) * m, np.ones(m, bool), np.zeros(m, np.int64), columns,
    )  # fmt: skip
