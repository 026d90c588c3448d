"""A driver with slow noise of heavy tails behind a lead whose speed drifts, simulated at 100 Hz and sampled at 10 Hz."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.values.types import Array


class Hidden(NamedTuple):
    """What the fit must not know."""

    K: tuple[float, float] = (0.8, 0.2)
    tau: float = 0.3  # s
    dead_time: float = 0.4  # s
    headway: float = 1.5  # s
    remembers: float = 0.995  # of the noise, from one sample to the next
    noise: float = 0.02  # scale of its innovations, m/s²
    freedom: float = 2.75  # of their Student's t


def drive(seed: int, seconds: float, hidden: Hidden) -> tuple[Array, Array]:
    """Acceleration (n,), and headway error and range rate (n, 2), at 10 Hz."""
    rng, h = np.random.default_rng([seed, 34]), 0.01
    n = round(seconds * 10)
    e = hidden.noise * rng.standard_t(hidden.freedom, size=n)
    push = 0.5 * h**0.5 * rng.normal(size=10 * n)
    late, follow = round(hidden.dead_time / h), 1.0 - np.exp(-h / hidden.tau)
    errors, rates = [0.0] * (10 * n), [0.0] * (10 * n)
    a, lead, v = 0.0, 20.0, 20.0
    gap, one, two, noise = hidden.headway * v, 0.0, 0.0, 0.0
    output, inputs = np.zeros(n), np.zeros((n, 2))
    for k in range(10 * n):
        a += h * (-a / 4.0) + push[k]
        lead += h * (a - 0.02 * (lead - 20.0))
        errors[k], rates[k] = gap / max(v, 3.0) - hidden.headway, lead - v
        if k >= late:
            one += follow * (errors[k - late] - one)
            two += follow * (rates[k - late] - two)
        if k % 10 == 0:
            noise = hidden.remembers * noise + e[k // 10]
        y = hidden.K[0] * one + hidden.K[1] * two + noise
        if k % 10 == 0:
            output[k // 10], inputs[k // 10] = y, (errors[k], rates[k])
        v = max(v + h * y, 0.0)
        gap = max(gap + h * (lead - v), 2.0)
    return output, inputs
