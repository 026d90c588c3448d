"""A drive behind a lead, at 100 Hz: pedal with floor, brake with hold, seven gears, engine and turbo lag, grade, cut-ins."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

H = 0.01  # s
NOISES = ("ar", "bursts", "scale", "steps", "drift", "white", "act_and_wait")


class World(NamedTuple):
    """Who drives what behind whom."""

    seed: int
    minutes: float
    noise: str
    road: str  # urban, mixed, motorway
    K1: float  # % per s
    K2: float  # % per m/s
    tau: tuple[float, float]  # s, of headway and range rate
    theta: tuple[float, float]  # s, the driver's own
    headway: float  # s
    standstill: float  # m, of the wanted gap standstill + headway v
    latency: float  # s, of the radar
    radar: float  # s between two reports
    change: tuple[float, float] = (math.inf, 1.0)  # s, and the factor of both gains from then on


class Driven(NamedTuple):
    """At 100 Hz, (n,) each."""

    gap: np.ndarray
    rate: np.ndarray
    speed: np.ndarray
    pedal: np.ndarray
    brake: np.ndarray
    noise: np.ndarray  # of the demand
    other_lead: np.ndarray  # counts the leads


def draw(seed: int, minutes: float, noise: str | None = None) -> World:
    """Draw a world; half of the drivers want a gap at standstill."""
    rng = np.random.default_rng([seed, 1])
    u = rng.uniform
    return World(
        seed,
        minutes,
        noise or NOISES[seed % (len(NOISES) - 1)],
        ("urban", "mixed", "motorway")[seed // 12 % 3],
        u(2.5, 9.0),
        u(3.0, 9.0),
        (u(0.2, 1.2), u(0.2, 1.2)),
        (u(0.2, 1.0), u(0.2, 1.0)),
        u(1.2, 2.2),
        u(2.0, 4.0) if seed // 6 % 2 else 0.0,
        u(0.05, 0.15),
        1.0 / u(14.0, 20.0),
    )


def _lead(world: World, n: int, rng: np.random.Generator) -> np.ndarray:
    low, high, hard = {"urban": (4.0, 15.0, 1.2), "mixed": (10.0, 26.0, 0.9), "motorway": (22.0, 34.0, 0.6)}[
        world.road
    ]
    speed, v, a, goal, until = np.empty(n), 0.5 * (low + high), 0.0, 0.5 * (low + high), 0
    wiggle = 0.0
    kicks = rng.normal(size=n)
    for k in range(n):
        if k >= until:
            goal, until = rng.uniform(low, high), k + int(rng.uniform(6.0, 30.0) / H)
        want = max(-hard, min(hard, 0.35 * (goal - v)))
        wiggle += H * (-wiggle / 2.0) + 0.25 * math.sqrt(H) * kicks[k]
        a += H * 2.0 * (want + wiggle - a)
        v = max(v + H * a, 1.0)
        speed[k] = v
    return speed


def _noise(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Of the demand in %, made at 10 Hz and held."""
    m = n // 10 + 2
    e = rng.standard_t(3, size=m) / 3**0.5 if kind == "bursts" else rng.normal(size=m)
    if kind == "scale":
        slow = np.convolve(rng.normal(size=m + 200), np.ones(200) / 200**0.5, "same")[:m]
        e = e * np.exp(0.6 * slow)
    keep, size = {"white": (0.0, 1.5), "steps": (0.9, 0.5)}.get(kind, (0.9, 0.9))
    x = np.empty(m)
    last = 0.0
    for k in range(m):
        last = keep * last + size * float(e[k])
        x[k] = last
    if kind == "steps":
        x += np.cumsum(np.where(rng.uniform(size=m) < 0.004, rng.normal(0.0, 2.5, size=m), 0.0))
        x -= np.convolve(x, np.ones(600) / 600, "same")
    if kind == "drift":
        level, rho = 0.0, math.exp(-0.1 / 25.0)
        for k, push in enumerate(rng.normal(size=m)):
            level = rho * level + 2.5 * math.sqrt(1.0 - rho * rho) * push
            x[k] += level
    return np.repeat(x, 10)[:n]


def drive(world: World) -> Driven:
    """Simulate."""
    rng = np.random.default_rng([world.seed, 2])
    n = round(world.minutes * 60.0 / H)
    ahead, noise = _lead(world, n, rng), _noise(world.noise, n, rng)
    slope = np.repeat(np.convolve(rng.normal(size=n // 100 + 61), np.hanning(40), "same"), 100)[:n]
    slope *= rng.uniform(0.003, 0.010) / slope.std()
    cuts = {int(k) for k in rng.integers(2000, n, size=rng.poisson(world.minutes * 0.3))}
    out = [np.empty(n) for _ in range(6)]
    gaps, rates, speeds, pedals, brakes, leads = out
    v, gear, shift, engine, turbo, brake, hold = float(ahead[0]), 4, 0, 20.0, 20.0, 0.0, 0
    gap, x1, x2, offset, count = world.standstill + world.headway * v, 0.0, 0.0, 0.0, 0
    acts, acting = 0, 0.0
    changes = world.change[0] / H
    errors = np.zeros(n)
    late1, late2 = (round(t / H) for t in world.theta)
    f1, f2 = (1.0 - math.exp(-H / t) for t in world.tau)
    ups = (0.0, 4.0, 8.0, 12.0, 17.0, 22.0, 27.0)
    pull = (0.075, 0.068, 0.062, 0.056, 0.050, 0.046, 0.042)
    rest = {"urban": 6.0, "mixed": 13.0, "motorway": 29.0}[world.road]
    for k in range(n):
        if k in cuts and gap > 12.0:
            gap, offset, count = max(gap * rng.uniform(0.5, 0.8), 6.0), rng.normal(0.0, 1.0), count + 1
        offset *= 1.0 - H / 8.0
        lead = max(float(ahead[k]) + offset, 0.5)
        rate = lead - v
        gaps[k], rates[k], speeds[k], leads[k] = gap, rate, v, count
        errors[k] = gap / max(v, 2.0) - world.headway - world.standstill / max(v, 2.0)
        if k >= late1:
            x1 += f1 * (errors[k - late1] - x1)
        if k >= late2:
            x2 += f2 * (rates[k - late2] - x2)
        more = world.change[1] if k >= changes else 1.0
        demand = rest + more * (world.K1 * x1 + world.K2 * x2) + float(noise[k])
        if world.noise == "act_and_wait":
            if k >= acts:
                acting, acts = demand, k + int(rng.uniform(0.5, 1.5) / H)
            demand = acting
        pedal = min(max(demand, 0.0), 100.0)
        if demand < -5.0:
            brake, hold = min(0.06 * (-5.0 - demand), 5.0), k + 60
        elif k > hold or demand > 2.0:
            brake = 0.0
        if brake > 0.0:
            pedal = 0.0
        pedals[k], brakes[k] = pedal, brake > 0.0
        if k >= shift:
            wanted = sum(v > up + (0.5 if gear <= i else -0.8) for i, up in enumerate(ups)) - 1
            if wanted != gear and k > shift + 80:
                gear, shift = max(wanted, 0), k + 25
        engine += H / 0.15 * (pedal - engine)
        turbo += H / 0.6 * (engine - turbo)
        torque = pull[gear] * (0.6 * engine + 0.4 * turbo) * (0.3 if k < shift else 1.0)
        drag = 0.12 + 0.012 * v + 0.0009 * v * v
        v = max(v + H * (torque - drag - brake - 9.81 * float(slope[k])), 0.0)
        gap = max(gap + H * (lead - v), 2.0)
    return Driven(gaps, rates, speeds, pedals, brakes, noise, leads)
