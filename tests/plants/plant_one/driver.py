"""The driver: two answers, each with its own lag and dead time, and effects on the inputs and the desired headway.

    demand = offset + L1[K1·(headway − headway_desired)] + L2[K2·range_rate],  L = e^(−θs)/(1+τs)

Hard forms throughout: thresholds are corners, dead zones give nothing inside and the excess outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from tests.plants.planted_drive import Array

VEHICLE_WIDTH_M = 1.8  # m, of a vehicle that looms
G0, V0 = 30.0, 20.0  # m, m/s: where looming_gain and speed_gain change nothing
MIN_SPEED_M_S = 2.0  # m/s; below it a headway means nothing: the gap is judged as if driving at it
HYSTERESIS_RATE_M_S = 0.3  # m/s of range rate that switches the hysteresis over
CALM_RATE_M_S = 0.8  # m/s; mean size of the relative speed at which aroused gains are what they were


class Driver(NamedTuple):
    """Parameters of the undisturbed driver."""

    K1: float  # %/s
    K2: float  # %/(m/s)
    tau1: float  # s
    tau2: float
    dead_time1: float  # s
    dead_time2: float
    headway_desired: float  # s
    offset: float  # %
    noise_sd: float  # %


def draw(rng: np.random.Generator) -> Driver:
    """Draw a plausible driver; the offset is set later."""
    return Driver(
        K1=rng.uniform(4.0, 9.0),
        K2=rng.uniform(4.0, 8.0),
        tau1=rng.uniform(0.2, 0.8),
        tau2=rng.uniform(0.2, 0.8),
        dead_time1=rng.uniform(0.2, 0.6),
        dead_time2=rng.uniform(0.2, 0.6),
        headway_desired=rng.uniform(1.3, 2.3),
        offset=math.nan,
        noise_sd=rng.uniform(1.5, 3.0),
    )


class World(NamedTuple):
    """What there is to be seen, sample by sample; the loop appends to all but the last two."""

    headway: list[float]  # s
    range_rate: list[float]  # m/s
    gap: list[float]  # m
    speed: list[float]  # m/s
    lead_accel: list[float]  # (n,) m/s²
    hidden: list[float]  # (n,) unit: what nobody measures, as the road's curves


def random_walk(n: int, dt: float, sd: float, rng: np.random.Generator) -> Array:
    """Draw (n,) s: a random walk held together over some minutes, of exactly this sd about 0 along the drive.

    >>> round(float(random_walk(5000, 0.1, 0.3, np.random.default_rng(1)).std()), 3)
    0.3
    """
    step = dt / rng.uniform(60.0, 180.0)
    x, out = 0.0, np.empty(n)
    for k, e in enumerate((rng.standard_normal(n) * math.sqrt(2.0 * step)).tolist()):
        x += e - step * x
        out[k] = x
    out -= out.mean()
    return out * (sd / max(float(out.std()), 1e-12))


def curves(n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw (n,) of 0 to some 1.5: bends of the road, each 4 to 12 s long, of different sharpness.

    >>> x = curves(5000, 0.1, np.random.default_rng(1))
    >>> bool(x.min() == 0.0 and 0.5 < x.max() < 2.0)
    True
    """
    out, t = np.zeros(n), np.arange(n) * dt
    at = 0.0
    while True:
        at += rng.uniform(8.0, 30.0)
        long, sharp = rng.uniform(4.0, 12.0), rng.uniform(0.4, 1.5)
        if at >= n * dt:
            return out
        inside = (t >= at) & (t < at + long)
        out[inside] = sharp * np.sin(math.pi * (t[inside] - at) / long) ** 2
        at += long


def dead_zone(x: float, width: float) -> float:
    """Nothing inside ±width, the excess outside.

    >>> dead_zone(0.5, 0.25), dead_zone(-0.5, 0.25), dead_zone(0.1, 0.25)
    (0.25, -0.25, 0.0)
    """
    return x - width if x > width else x + width if x < -width else 0.0


def answerer(
    driver: Driver,
    effects: Mapping[str, Mapping[str, float]],
    world: World,
    wanted: list[float],
    dt: float,
    n: int,
) -> Callable[[int], float]:
    """Make `answer(k) -> demand %` of sample k, to be called for k = 0, 1, ... after `world` holds sample k.

    `wanted` (n,) s is the desired headway at each sample.
    """
    error_answer = _error_answer(driver, effects, dt)
    move = _move(driver, effects)
    factor = _factor(effects, dt, n)
    arouse = _arousal(effects, dt)
    drift = effects.get("delay_drift", {}).get("rate", 0.0) / n
    calm = effects.get("comfort_speed", {"gain": 0.0, "speed": 0.0})
    slope, above = calm["gain"], calm["speed"]
    ahead = effects.get("lead_acceleration", {}).get("gain", 0.0)
    bias = effects.get("speed_wander_bias", {}).get("depth", 0.0)
    back1, back2 = driver.dead_time1 / dt, driver.dead_time2 / dt
    keep1, keep2 = math.exp(-dt / driver.tau1), math.exp(-dt / driver.tau2)
    headway, rate, gap, speed, accel, hidden = world
    lag1 = lag2 = last1 = last2 = 0.0

    def answer(k: int) -> float:
        nonlocal lag1, lag2, last1, last2
        later = drift * k / dt if drift else 0.0
        i, f = _place(k - back1 - later)
        j, g = _place(k - back2 - later)
        e, w = headway[i] - wanted[i], rate[j]
        if f:
            e += f * (headway[i + 1] - headway[i])
        if g:
            w += g * (rate[j + 1] - rate[j])
        x1, x2 = error_answer(e, speed[i], rate[i]), move(w, gap[j])
        if factor is not None:
            both = factor(k)
            x1, x2 = x1 * both, x2 * both
        if arouse is not None:
            both = arouse(w)
            x1, x2 = x1 * both, x2 * both
        if slope and speed[i] > above:
            x1 -= slope * (speed[i] - above)
        x2 += ahead * accel[j]
        if k == 0:
            lag1, lag2 = x1, x2
        else:
            # the mean of both ends: a lag that does not come half a step late
            lag1 = keep1 * lag1 + (1.0 - keep1) * 0.5 * (last1 + x1)
            lag2 = keep2 * lag2 + (1.0 - keep2) * 0.5 * (last2 + x2)
        last1, last2 = x1, x2
        return driver.offset + lag1 + lag2 - bias * hidden[i]

    return answer


def _place(at: float) -> tuple[int, float]:
    """Sample before an instant, and the fraction of a step behind it; before sample 0 all was as in it."""
    if at <= 0.0:
        return 0, 0.0
    i = int(at)
    return i, at - i


ErrorAnswer = Callable[[float, float, float], float]


def _error_answer(driver: Driver, effects: Mapping[str, Mapping[str, float]], dt: float) -> ErrorAnswer:
    """Answer to the headway error, %: of e (s), own speed (m/s) and range rate as they were a dead time ago."""
    standstill = effects.get("standstill_gap", {}).get("distance", 0.0)
    preview = effects.get("preview_gap_rate", {}).get("preview", 0.0)
    swing = effects.get("headway_hysteresis", {}).get("width", 0.0)
    square = effects.get("quadratic_headway", {}).get("curvature", 0.0)
    width = effects.get("headway_dead_zone", {}).get("width", 0.0)
    exponent = effects.get("speed_gain", {}).get("exponent", 0.0)
    lingers = effects.get("lingering_error", {"gain": 0.0, "time": 1.0})
    hold, time = lingers["gain"], lingers["time"]
    side, memory = 0.0, 0.0

    def error_answer(e: float, v: float, w: float) -> float:
        nonlocal side, memory
        slow = v if v > MIN_SPEED_M_S else MIN_SPEED_M_S
        if standstill:
            e -= standstill / slow
        if preview:
            e += preview * w / slow
        if swing:
            if abs(w) > HYSTERESIS_RATE_M_S:
                side = 0.5 if w < 0.0 else -0.5
            e -= swing * side
        if square:
            e += square * e * abs(e)
        if width:
            e = dead_zone(e, width)
        if hold:
            memory += dt * (e - memory / time)
            e += hold * memory
        x = driver.K1 * e
        if exponent:
            x *= (slow / V0) ** exponent
        return x

    return error_answer


def _move(driver: Driver, effects: Mapping[str, Mapping[str, float]]) -> Callable[[float, float], float]:
    """Answer to the relative speed, %: of range rate (m/s) and gap (m) as they were a dead time ago."""
    width = effects.get("relative_speed_dead_zone", {}).get("width", 0.0)
    looming = effects.get("looming_threshold", {}).get("threshold", 0.0)
    limit = effects.get("saturating_speed", {}).get("limit", 0.0)
    exponent = effects.get("looming_gain", {}).get("exponent", 0.0)
    share = effects.get("asymmetric_gain", {}).get("share", 0.0)

    def move(w: float, gap: float) -> float:
        near = gap if gap > 1.0 else 1.0
        if width:
            w = dead_zone(w, width)
        if looming:
            w = dead_zone(w * VEHICLE_WIDTH_M / (near * near), looming) * near * near / VEHICLE_WIDTH_M
        if limit:
            w = limit * math.tanh(w / limit)
        x = driver.K2 * w
        if exponent:
            x *= (G0 / near) ** exponent
        if share:
            x *= 1.0 + share if w < 0.0 else 1.0 - share
        return x

    return move


def _factor(effects: Mapping[str, Mapping[str, float]], dt: float, n: int) -> Callable[[int], float] | None:
    """Factor of both gains along the drive."""
    if not {"gain_drift", "gain_change"} & set(effects):
        return None
    rate = effects.get("gain_drift", {}).get("rate", 0.0)
    change = effects.get("gain_change", {"share": 0.0, "time": math.inf})
    share, time = change["share"], change["time"]

    def factor(k: int) -> float:
        return (1.0 + rate * (k / n - 0.5)) * (1.0 - share if k * dt > time else 1.0)

    return factor


def _arousal(effects: Mapping[str, Mapping[str, float]], dt: float) -> Callable[[float], float] | None:
    """Factor of both gains that follows recent turmoil; within half and double."""
    if "aroused_gain" not in effects:
        return None
    growth, time = effects["aroused_gain"]["growth"], effects["aroused_gain"]["time"]
    level = CALM_RATE_M_S

    def arouse(w: float) -> float:
        nonlocal level
        level += dt / time * (abs(w) - level)
        return min(max(1.0 + growth * (level / CALM_RATE_M_S - 1.0), 0.5), 2.0)

    return arouse
