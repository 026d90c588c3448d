"""The driver that is simulated: two answers, each first order plus dead time (Grover eq. 2.1, 2.6–2.9)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np


class DriverTruth(NamedTuple):
    """Parameters of u = offset + K1·L1[headway − headway_desired] + K2·L2[range_rate] + noise."""

    K1: float  # % per s of headway error
    tau1: float  # s
    dead_time1: float  # s
    K2: float  # % per m/s
    tau2: float  # s
    dead_time2: float  # s
    headway_desired: float = 2.0  # s
    offset: float = math.nan  # %; NaN: what holds the profile's mean speed on a level road
    noise_sd: float = 1.5  # %


def draw_driver(rng: np.random.Generator, noise_sd: float = 1.5) -> DriverTruth:
    """Draw a plausible driver.

    Gains lie within those of Grover's one driver (2021, Tables 1 and 2: K1 4.15 to 11.4, K2 4.34 to 6.65); the table's
    delays, 0.026 to 0.734 s, are here lags and dead times of human reactions in car following. The headway is what people
    keep on European roads.

    Example:
        >>> driver = draw_driver(np.random.default_rng(1))
        >>> 4.5 <= driver.K1 <= 7.5
        True
    """
    return DriverTruth(
        K1=rng.uniform(4.5, 7.5),
        tau1=rng.uniform(0.4, 0.9),
        dead_time1=rng.uniform(0.25, 0.6),
        K2=rng.uniform(4.5, 7.5),
        tau2=rng.uniform(0.3, 0.7),
        dead_time2=rng.uniform(0.2, 0.5),
        headway_desired=rng.uniform(1.6, 2.2),
        noise_sd=noise_sd,
    )


def driver_of_seed(seed: int) -> DriverTruth:
    """The driver that `simulate` draws by default.

    Example:
        >>> from canid.models.simulation import simulate
        >>> simulate(minutes=0.1, seed=3).truth["channels"]["headway_error"]["K"] == driver_of_seed(3).K1
        True
    """
    return draw_driver(np.random.default_rng([seed, 0]))


class Lag(NamedTuple):
    """A first-order lag over `h` seconds in which its input goes straight from x0 to x1: exact.

    With s = (x1 − x0)/h the solution of τ y' = x − y is y1 = x1 − sτ + e^(−h/τ) (y0 − x0 + sτ).
    """

    decay: float
    before: float
    after: float

    def step(self, y: float, x0: float, x1: float) -> float:
        """Return y at the end."""
        return self.decay * y + self.before * x0 + self.after * x1


def lag(tau: float, h: float) -> Lag:
    """Prepare a lag.

    Example:
        >>> lag(0.0, 0.01).step(5.0, 1.0, 2.0)
        2.0
    """
    if tau <= 0 or h <= 0:
        return Lag(0.0, 0.0, 1.0) if h > 0 else Lag(1.0, 0.0, 0.0)
    decay = math.exp(-h / tau)
    ramp = tau / h * (1 - decay)
    return Lag(decay, ramp - decay, 1 - ramp)


class Answer(NamedTuple):
    """K e^(−θs)/(1+τs) on a grid, exact for an input that is straight between grid points.

    The delayed input has its knots not on the grid but a fraction later: each step is made in two parts.
    """

    gain: float
    whole: int  # grid steps of dead time, complete ones
    part: float  # what is left, as a fraction of a step
    first: Lag  # up to the knot
    second: Lag  # from the knot on

    def step(self, y: float, x: list[float], k: int) -> float:
        """Return the lag's state at sample k from that at k − 1; before sample 0 the input stood still."""
        end = k - self.whole
        x0, x1, x2 = x[max(end, 0)], x[max(end - 1, 0)], x[max(end - 2, 0)]
        knot = x1
        start = x1 + self.part * (x2 - x1)
        stop = x0 + self.part * (x1 - x0)
        return self.second.step(self.first.step(y, start, knot), knot, stop)


def answer(gain: float, tau: float, dead_time: float, dt: float) -> Answer:
    """Prepare one channel's answer on a grid of `dt` seconds.

    Raises:
        ValueError: negative lag or dead time.
    """
    if tau < 0 or dead_time < 0:
        raise ValueError(f"tau {tau} and dead_time {dead_time} must not be negative")
    # A dead time of 0.3 s is 30 steps of 0.01 s, not 29.999999999999996.
    steps = round(dead_time / dt, 9)
    whole = math.floor(steps)
    part = steps - whole
    return Answer(gain, whole, part, lag(tau, part * dt), lag(tau, (1 - part) * dt))
