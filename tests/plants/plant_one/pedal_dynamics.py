"""Pedal dynamics: effects that act on the demand in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from tests.plants.planted_drive import Array

# (sample, demand %, remnant %) -> %
PedalDynamics = Callable[[int, float, float], float]


def pedal_dynamics(
    effects: Mapping[str, Mapping[str, float]], held: Array, dt: float, phase: float
) -> PedalDynamics:
    """Make the pedal dynamics, to be called for samples 0, 1, ...

    In this order: second_lag(tau s), periodic_task(amplitude %, frequency Hz) at a `phase` of 0..1, the remnant,
    act_and_wait(interval s), backlash(width %, of the whole play), foot_rate(rate %/s), attention_gap where
    `held` (n,) bool, pedal_ceiling(level %).
    """
    second = "second_lag" in effects
    keep = math.exp(-dt / effects["second_lag"]["tau"]) if second else 0.0
    task = effects.get("periodic_task", {"amplitude": 0.0, "frequency": 0.0})
    size, turn = task["amplitude"], 2.0 * math.pi * task["frequency"] * dt
    every = max(effects["act_and_wait"]["interval"] / dt, 1.0) if "act_and_wait" in effects else 0.0
    play = 0.5 * effects.get("backlash", {}).get("width", 0.0)
    most = effects.get("foot_rate", {}).get("rate", math.inf) * dt
    level = effects.get("pedal_ceiling", {}).get("level", math.inf)
    gone = held.tolist()
    lag = acted = touched = moved = kept = last = due = 0.0

    def pedal(k: int, demand: float, remnant: float) -> float:
        nonlocal lag, acted, touched, moved, kept, last, due
        u = demand
        if second:
            # as of the driver's own lags: the mean of both ends of the step
            lag = keep * lag + (1.0 - keep) * 0.5 * (last + u) if k else u
            last, u = u, lag
        if size:
            u += size * math.sin(turn * k + 2.0 * math.pi * phase)
        u += remnant
        if every:
            # a rhythm that is no whole number of steps keeps its own pace
            if k >= due:
                acted, due = u, due + every
            u = acted
        if play:
            touched = min(max(touched, u - play), u + play) if k else u
            u = touched
        if most < math.inf:
            # the accelerator alone: who brakes is quick
            at = moved if moved > 0.0 else 0.0
            moved = min(max(u, at - most), at + most) if k and u > 0.0 else u
            u = moved
        if gone[k]:
            # no driver is inattentive while braking: both pedals are released then
            u = kept if kept > 0.0 else 0.0
        kept = u
        return u if u < level else level

    return pedal
