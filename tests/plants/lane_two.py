"""Planting simulator two of lane keeping: 100 Hz, a driver in continuous time, smooth forms of every effect.

Written apart from canid and from its own simulator: of the two only the physics and the names are common. The driver sees
offset and lateral speed late by a dead time, turns the wheel through an arm of second order, and sits in a car with slip, on
a road with clothoids, in gusts; canid's own decides ten times a second on a one-track car.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import lfilter

from tests.plants.planted_drive import Array

STEP_S = 0.01
NOISES = ("white", "slow", "resonant", "mix")
# id -> parameter -> range that a seed draws from
STRENGTHS: dict[str, dict[str, tuple[float, float]]] = {
    "lateral_dead_zone": {"width": (0.2, 0.4)},
    "gain_drift": {"rate": (0.6, 1.0)},
    "attention_gap": {"per_minute": (1.0, 2.0), "duration": (1.8, 2.6)},
    "delay_drift": {"rate": (0.25, 0.4)},
    "second_lag": {"tau": (0.15, 0.3)},
    "curvature_preview": {"gain": (1.2, 2.2), "ahead": (0.5, 1.5)},
}
# either sign
SIGNED = {"gain_drift"}
# m/s², s: gusts, and Hz of the road's unevenness that pushes the car sideways
GUST, GUST_S, ROUGH, ROUGH_S = 0.25, 1.5, 0.2, 0.25
# 1/s: how fast slip and yaw settle
SLIP_RATE, YAW_RATE = 5.0, 9.0
# s, over which a driver previews a curve, on either side
GLANCE_S = 0.2


class Lane(NamedTuple):
    """A planted drive."""

    dt: float  # s
    columns: dict[str, Array]
    truth: dict[str, Any]


class Person(NamedTuple):
    """Truth of the answer; angles are those of the steering wheel, °."""

    K: float  # ° per m
    Kd: float  # ° per m/s
    dead_time: float  # s
    lag: float  # s
    arm: float  # rad/s, natural frequency of the arm; damping 0.8
    wanted: float  # m
    offset: float  # °, of the sensor
    noise_sd: float  # °


def plant(
    effects: Mapping[str, Mapping[str, float]],
    *,
    seed: int,
    minutes: float,
    noise: str,
    curves: float = 0.0,
    faster: float = 1.0,
    lock: tuple[float, float] = (-math.inf, math.inf),
) -> Lane:
    """Plant a drive.

    Args:
        effects: id -> {parameter: value}; {} draws a strength by the seed; no effect at all is a clean drive.
        seed: the same seed gives the same drive.
        minutes: duration.
        noise: kind of the driver's noise.
        curves: standard deviation of the road's curvature, 1/m; a preview has one of 4e-4 at least.
        faster: factor on the speed from the middle of the drive on; the driver, whose car then answers more, turns the wheel
            less, as much as keeps the loop the same.
        lock: °, least and largest angle that the output takes, its offset included.

    Raises:
        ValueError: an unknown effect or noise.

    Example:
        >>> clean = plant({}, seed=3, minutes=1, noise="slow")
        >>> bool(np.abs(clean.columns["lateral_offset"]).max() < 1.9)
        True
    """
    unknown = set(effects) - set(STRENGTHS)
    if unknown or noise not in NOISES:
        raise ValueError(f"{sorted(unknown) or noise}: choose from {sorted(STRENGTHS)} and {NOISES}")
    rng = {
        name: np.random.default_rng([seed, 7, k])
        for k, name in enumerate(("who", "how", "noise", "road", "air", "when"))
    }
    values = {name: _drawn(name, of, rng["how"]) for name, of in effects.items()}
    n = round(minutes * 60 / STEP_S)
    slow = rng["who"].uniform(21.0, 32.0)
    half = (np.arange(n) * STEP_S - 0.5 * n * STEP_S) / 20.0
    speed = slow * (1.0 + (faster - 1.0) / (1.0 + np.exp(-np.clip(half, -50.0, 50.0))))
    per_degree = (
        slow**2 * math.radians(1.0) / (rng["who"].uniform(14.0, 17.0) * rng["who"].uniform(2.55, 2.9))
    )
    who = _person(per_degree, rng["who"])
    sd = max(curves, 4e-4) if "curvature_preview" in effects else curves
    road = _clothoids(n, slow, sd, rng["road"])
    remnant = who.noise_sd * _remnant(noise, n, rng["noise"])
    away = _away(values.get("attention_gap"), n * STEP_S, rng["when"])
    columns = _driven(n, speed, per_degree, who, road, remnant, _air(n, rng["air"]), values, away, lock)
    truth = {
        "seed": seed, "noise": noise, "minutes": minutes, "driver": who._asdict(), "effects": values, "episodes": away,
    }  # fmt: skip
    return Lane(STEP_S, columns, truth)


def _drawn(name: str, of: Mapping[str, float], rng: np.random.Generator) -> dict[str, float]:
    sign = rng.choice((-1.0, 1.0)) if name in SIGNED else 1.0
    drawn = {key: float(sign * rng.uniform(*span)) for key, span in STRENGTHS[name].items()}
    return {**drawn, **of}


def _person(per_degree: float, rng: np.random.Generator) -> Person:
    """Draw a driver by the crossover frequency of the loop (McRuer & Jex 1967), 0.8 to 1.2 rad/s."""
    Kd = rng.uniform(0.8, 1.2) / per_degree
    return Person(
        K=Kd * rng.uniform(0.18, 0.32),
        Kd=Kd,
        dead_time=rng.uniform(0.12, 0.25),
        lag=rng.uniform(0.1, 0.25),
        arm=rng.uniform(9.0, 14.0),
        wanted=rng.uniform(-0.25, 0.25),
        offset=rng.uniform(-1.0, 1.0),
        noise_sd=rng.uniform(0.5, 0.9),
    )


def _clothoids(n: int, speed: float, sd: float, rng: np.random.Generator) -> Array:
    """Curvature (n,) 1/m: straight lines between points every 60 to 200 m."""
    if not sd:
        return np.zeros(n)
    at = np.cumsum(rng.uniform(60.0, 200.0, 4 + int(n * STEP_S * speed / 60.0)))
    bends = np.interp(np.arange(n) * STEP_S * speed, at, rng.standard_normal(at.size))
    return np.asarray(sd * (bends - bends.mean()) / bends.std())


def _air(n: int, rng: np.random.Generator) -> Array:
    """Lateral pushes (n,) m/s²."""
    out = np.zeros(n)
    for size, memory in ((GUST, GUST_S), (ROUGH, ROUGH_S)):
        keep = math.exp(-STEP_S / memory)
        out += size * lfilter([math.sqrt(1 - keep * keep)], [1.0, -keep], rng.standard_normal(n))
    return out


def _remnant(kind: str, n: int, rng: np.random.Generator) -> Array:
    """Noise (n,) of variance about one, before the arm."""

    def low_pass(memory: float) -> Array:
        keep = math.exp(-STEP_S / memory)
        return np.asarray(lfilter([math.sqrt(1 - keep * keep)], [1.0, -keep], rng.standard_normal(n)))

    if kind == "white":
        return low_pass(0.06)
    if kind == "slow":
        return low_pass(0.6)
    if kind == "mix":
        return np.asarray(0.8 * low_pass(0.8) + 0.6 * low_pass(0.06))
    w = 2 * math.pi * 0.4
    r = math.exp(-0.4 * w * STEP_S)
    x = lfilter([1.0], [1.0, -2 * r * math.cos(w * STEP_S), r * r], rng.standard_normal(n))
    return np.asarray(x / np.std(x))


def _away(gaps: Mapping[str, float] | None, seconds: float, rng: np.random.Generator) -> list[list[float]]:
    """Stretches [start, stop] s in which attention is elsewhere."""
    out: list[list[float]] = []
    t = 15.0
    while gaps is not None:
        lasts = gaps["duration"] * rng.uniform(0.75, 1.25)
        t += 3.0 + rng.gamma(3.0, max(60.0 / gaps["per_minute"] - lasts - 3.0, 1.0) / 3.0)
        if t + lasts > seconds:
            break
        out.append([round(t, 2), round(t + lasts, 2)])
        t += lasts
    return out


def _zone(y: float, width: float) -> tuple[float, float]:
    """Offset beyond a zone with soft edges, and its slope.

    >>> abs(_zone(0.0, 0.3)[0]) < 1e-9, round(_zone(1.0, 0.3)[0], 2), round(_zone(1.0, 0.3)[1], 2)
    (True, 0.7, 1.0)
    """
    soft = width / 8.0
    up, down = (y - width) / soft, (-y - width) / soft

    def ramp(x: float) -> float:
        return soft * (x if x > 30.0 else math.log1p(math.exp(x)))

    def step(x: float) -> float:
        return 1.0 / (1.0 + math.exp(-min(max(x, -50.0), 50.0)))

    return ramp(up) - ramp(down), step(up) + step(down)


def _driven(
    n: int,
    speeds: Array,
    per_degree: float,
    who: Person,
    road: Array,
    remnant: Array,
    air: Array,
    values: Mapping[str, Mapping[str, float]],
    away: list[list[float]],
    lock: tuple[float, float],
) -> dict[str, Array]:
    """Close the loop, in plain floats."""
    width = values.get("lateral_dead_zone", {}).get("width", 0.0)
    drift = values.get("gain_drift", {}).get("rate", 0.0)
    slower = values.get("delay_drift", {}).get("rate", 0.0)
    extra_lag = values.get("second_lag", {}).get("tau", 0.0)
    ahead = _glanced(road, values.get("curvature_preview"))
    bends, pushes, own = road.tolist(), air.tolist(), remnant.tolist()
    feeding = ahead.tolist()
    slow = float(speeds[0])
    fast = (speeds / slow).tolist()
    y, heading, slip, yaw = 0.0, 0.0, 0.0, 0.0
    calm = arm = arm_rate = wheel = last = 0.0
    seen: list[tuple[float, float]] = []
    angle, offsets = np.empty(n), np.empty(n)
    coming, held = 0, math.nan
    for k in range(n):
        t, part, times = k * STEP_S, k / n, fast[k]
        speed = slow * times
        rate = speed * heading + slip
        seen.append((y, rate))
        late = (who.dead_time + slower * part * part * (3.0 - 2.0 * part)) / STEP_S
        position, moving = _earlier(seen, k - late)
        position -= who.wanted
        if width:
            position, slope = _zone(position, width)
            moving *= slope
        gain = math.exp(drift * (part - 0.5)) / (times * times)
        aimed = -gain * (who.K * position + who.Kd * moving) + feeding[k] + own[k]
        calm += (aimed - calm) * STEP_S / who.lag
        # the arm, semi-implicit
        arm_rate += (who.arm**2 * (calm - arm) - 1.6 * who.arm * arm_rate) * STEP_S
        arm += arm_rate * STEP_S
        wheel = arm if not extra_lag else wheel + (arm - wheel) * STEP_S / extra_lag
        if coming < len(away) and t >= away[coming][1]:
            coming, held = coming + 1, math.nan
        if coming < len(away) and t >= away[coming][0]:
            held = last if math.isnan(held) else held
            turned = held
        else:
            # after an attention gap the wheel comes back within some tenths of a second
            turned = last + (wheel - last) * min(1.0, STEP_S / 0.02)
        turned = min(max(turned, lock[0] - who.offset), lock[1] - who.offset)
        last = turned
        angle[k], offsets[k] = turned + who.offset, y
        yaw += (per_degree / slow * times * turned - yaw) * YAW_RATE * STEP_S
        heading += (yaw - speed * bends[k]) * STEP_S
        slip += (pushes[k] - SLIP_RATE * slip) * STEP_S
        # mean of the slopes at both ends (Heun)
        y += 0.5 * (rate + speed * heading + slip) * STEP_S
    return {
        "t": np.arange(n) * STEP_S, "steering_angle": angle, "lateral_offset": offsets, "speed": speeds,
        "curvature": road,
    }  # fmt: skip


def _glanced(road: Array, preview: Mapping[str, float] | None) -> Array:
    """Angle (n,) ° by the mean curvature about a point ahead."""
    if preview is None:
        return np.zeros(road.size)
    total = np.cumsum(np.r_[0.0, road])
    first, stop = (
        np.clip(np.arange(road.size) + round((preview["ahead"] + s) / STEP_S), 0, road.size)
        for s in (-GLANCE_S, GLANCE_S)
    )
    mean = (total[stop] - total[first]) / np.maximum(stop - first, 1)
    return np.asarray(1e3 * preview["gain"] * mean)


def _earlier(seen: list[tuple[float, float]], at: float) -> tuple[float, float]:
    if at <= 0.0:
        return seen[0]
    k = int(at)
    if k >= len(seen) - 1:
        return seen[-1]
    w = at - k
    return (
        (1 - w) * seen[k][0] + w * seen[k + 1][0],
        (1 - w) * seen[k][1] + w * seen[k + 1][1],
    )
