"""An offset that drifts takes nothing of a gain; a steady one is not given any drift."""

from __future__ import annotations

import numpy as np

from canid.identification.first_order import scan
from canid.identification.fopdt.fopdt_fit import ProcessFit, fit_process


def closed_loop(seed: int, drift: float) -> ProcessFit:
    """Fit five minutes behind a headway whose wanted value drifts by `drift` s; K1 is 4 % per s, unit gain of a car."""
    rng = np.random.default_rng([seed, 3])
    n = 3000
    wanted = np.cumsum(rng.normal(size=n))
    wanted *= drift / wanted.std()
    noise = scan(0.25 * rng.normal(size=n), np.array([0.9])) if seed % 2 else 0.6 * rng.normal(size=n)
    lead = scan(0.05 * rng.normal(size=n), np.array([0.985]))
    headway, y, u = np.zeros(n), np.zeros(n), 0.0
    x = 0.0
    for k in range(1, n):
        u = headway[k - 3] - wanted[k - 3] if k >= 3 else 0.0
        x += 0.2 * (u - x)
        y[k] = 20.0 + 4.0 * x + noise[k]
        headway[k] = headway[k - 1] + 0.1 * (lead[k] - 0.05 * (y[k] - 20.0))
    return fit_process(y, headway[:, None], np.full(n, True), 0.1)


def test_a_steady_driver_has_no_drift() -> None:
    """At most one of 20."""
    assert sum(closed_loop(seed, 0.0).drift > 0 for seed in range(20)) <= 1


def test_a_drifting_headway_does_not_take_the_gain() -> None:
    """K within its interval on at least 9 of 12 drives, where a fit without drift loses half of the gain."""
    fits = [closed_loop(seed, 0.15) for seed in range(12)]
    assert sum(fit.drift > 0 for fit in fits) >= 9
    inside = [fit.channels[0].K.low <= 4.0 <= fit.channels[0].K.high for fit in fits]
    assert sum(inside) >= 9, [fit.channels[0].K for fit in fits]
