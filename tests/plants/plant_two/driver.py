"""The driver: two answers with dead times of their own, one lag after their sum, and effects hung into named places."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

# (x, k, gap m, speed m/s, range rate m/s, lead's acceleration m/s², own acceleration m/s²) -> x, changed by an effect
Touch = Callable[[float, int, float, float, float, float, float], float]
# (k, gap, speed, range rate, lead's acceleration, own acceleration) -> % without remnant
Answer = Callable[[int, float, float, float, float, float], float]

# The places where an effect can touch the driver, in the order in which a sample passes them.
PLACES = (
    "wanted",  # the desired headway, s
    "error",  # the headway error as felt, s
    "gain1",  # % per s
    "rate",  # the relative speed as felt, m/s
    "gain2",  # % per m/s
    "beside1",  # what the headway channel says, %
    "beside2",  # what the relative-speed channel says, %
    "delay",  # s added to both dead times
    "answer",  # after the lag, %, without the offset
    "pedal",  # the pedal with remnant, %, before its limits
)

# m/s; a headway at walking pace says nothing
MIN_SPEED_M_S = 1.0


class Driver(NamedTuple):
    """Truth of the answers: offset + (K1 e(t - dead_time1) + K2 w(t - dead_time2)) / (1 + lag s)."""

    K1: float  # % per s
    K2: float  # % per m/s
    lag: float  # s, common
    dead_time1: float  # s
    dead_time2: float  # s
    headway_desired: float  # s
    offset: float  # %
    noise_sd: float  # %

    def truth(self) -> dict[str, float]:
        """Return the driver in the words of `Planted.truth`."""
        facts = self._asdict()
        lag = facts.pop("lag")
        return {**facts, "tau1": lag, "tau2": lag}


def draw_driver(offset: float, rng: np.random.Generator) -> Driver:
    """Draw a driver: gains and times within those of Grover's driver (2021, Tables 1, 2) and reaction times in traffic."""
    return Driver(
        K1=rng.uniform(4.5, 8.5),
        K2=rng.uniform(4.5, 8.0),
        lag=rng.uniform(0.25, 0.6),
        dead_time1=rng.uniform(0.3, 0.7),
        dead_time2=rng.uniform(0.2, 0.5),
        headway_desired=rng.uniform(1.4, 2.2),
        offset=offset,
        noise_sd=rng.uniform(1.5, 3.0),
    )


class Placed(NamedTuple):
    """One effect's touch at one place."""

    effect: str
    place: str
    touch: Touch


def answering(driver: Driver, placed: Iterable[Placed], dt: float) -> Answer:
    """Start a driver; each call is one sample, in order from k = 0. Before it, everything had stood still."""
    at: dict[str, list[Touch]] = {place: [] for place in PLACES}
    for one in placed:
        at[one.place].append(one.touch)
    wanted_by, error_by, gain1_by, rate_by, gain2_by = (at[p] for p in PLACES[:5])
    beside1_by, beside2_by, delay_by, answer_by = (at[p] for p in PLACES[5:9])
    said1: list[float] = []
    said2: list[float] = []
    steps1, steps2 = driver.dead_time1 / dt, driver.dead_time2 / dt
    # the trapezoidal rule for lag y' = x - y
    ahead = dt / (2.0 * driver.lag + dt)
    y = before = 0.0
    K1, K2, THW = driver.K1, driver.K2, driver.headway_desired

    def step(k: int, gap: float, v: float, w: float, lead_a: float, own_a: float) -> float:
        nonlocal y, before
        wanted, rate, gain1, gain2 = THW, w, K1, K2
        for f in wanted_by:
            wanted = f(wanted, k, gap, v, w, lead_a, own_a)
        error = gap / (v if v > MIN_SPEED_M_S else MIN_SPEED_M_S) - wanted
        for f in error_by:
            error = f(error, k, gap, v, w, lead_a, own_a)
        for f in gain1_by:
            gain1 = f(gain1, k, gap, v, w, lead_a, own_a)
        for f in rate_by:
            rate = f(rate, k, gap, v, w, lead_a, own_a)
        for f in gain2_by:
            gain2 = f(gain2, k, gap, v, w, lead_a, own_a)
        one, two = gain1 * error, gain2 * rate
        for f in beside1_by:
            one = f(one, k, gap, v, w, lead_a, own_a)
        for f in beside2_by:
            two = f(two, k, gap, v, w, lead_a, own_a)
        said1.append(one)
        said2.append(two)
        later = 0.0
        for f in delay_by:
            later = f(later, k, gap, v, w, lead_a, own_a)
        x = _earlier(said1, k - steps1 - later / dt) + _earlier(said2, k - steps2 - later / dt)
        y = x if k == 0 else y + ahead * (x + before - 2.0 * y)
        before = x
        out = y
        for f in answer_by:
            out = f(out, k, gap, v, w, lead_a, own_a)
        return driver.offset + out

    return step


def _earlier(said: list[float], at: float) -> float:
    """Value at a fractional index, by a line between its neighbours."""
    if at <= 0.0:
        return said[0]
    i = int(at)
    if i >= len(said) - 1:
        return said[-1]
    return said[i] + (at - i) * (said[i + 1] - said[i])


def changed_driver(driver: Driver, changes: Mapping[str, Any]) -> Driver:
    """Replace what `changes` names; it may give the common lag as lag, tau1 or tau2.

    Raises:
        ValueError: two different lags.
    """
    lags = {float(changes[name]) for name in ("lag", "tau1", "tau2") if name in changes}
    if len(lags) > 1:
        raise ValueError("this simulator's driver has one common lag: give tau1 = tau2, or one of them")
    own = {name: float(changes[name]) for name in Driver._fields if name in changes}
    return driver._replace(**{**own, **({"lag": lags.pop()} if lags else {})})
