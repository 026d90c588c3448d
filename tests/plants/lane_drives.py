"""Lane drives of both planting simulators, as canid gets them: a drive is a function of simulator, effect and seed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.models.simulation import Steering, simulate
from canid.values.types import Trace
from tests.plants import lane_two
from tests.plants.lane_measurement import trace

SIMULATORS = ("one", "two")
EFFECTS = tuple(lane_two.STRENGTHS)
CLEAN = ""
# 1/m, standard deviation of the road's curvature on every other drive; the others are straight
CURVES = 3e-4


class LaneDrive(NamedTuple):
    """One drive."""

    simulator: str  # "one": canid's own, "two": tests/plants/lane_two.py
    effect: str  # "": clean
    seed: int
    minutes: float = 10.0


class Made(NamedTuple):
    """A drive, and what was planted in it."""

    trace: Trace
    parameters: Mapping[str, float]
    gain: float  # ° per m, of the driver: negative


def make(drive: LaneDrive) -> Made:
    """Simulate a drive and sample it.

    Example:
        >>> made = make(LaneDrive("one", EFFECTS[0], 3, 1.0))
        >>> sorted(made.parameters), made.trace.t.size > 580
        (['width'], True)
    """
    rng = np.random.default_rng([drive.seed, 77])
    curves = CURVES if rng.uniform() < 0.5 else 0.0
    noise = lane_two.NOISES[int(rng.integers(len(lane_two.NOISES)))]
    if drive.simulator == "two":
        hidden: dict[str, dict[str, float]] = {drive.effect: {}} if drive.effect else {}
        lane = lane_two.plant(hidden, seed=drive.seed, minutes=drive.minutes, noise=noise, curves=curves)
        values = lane.truth["effects"].get(drive.effect, {})
        return Made(trace(lane.columns, lane.dt), values, -lane.truth["driver"]["K"])
    steering = person(rng)
    values = strength(drive.effect, rng)
    hide = {drive.effect: tuple(values.values())} if drive.effect else None
    own = simulate(drive.minutes, drive.seed, "lane", driver=steering, hide=hide, curvature_sd=curves)
    gain = sum(steering.b) / (1 + sum(steering.a))
    return Made(trace(own.columns, own.dt), values, gain)


def strength(effect: str, rng: np.random.Generator) -> dict[str, float]:
    """Draw what simulator two would draw of an effect; {}: none."""
    sign = rng.choice((-1.0, 1.0)) if effect in lane_two.SIGNED else 1.0
    spans = lane_two.STRENGTHS.get(effect, {})
    return {name: float(sign * rng.uniform(*span)) for name, span in spans.items()}


def person(rng: np.random.Generator) -> Steering:
    """Draw a driver about the means of Chen & Ulsoy 2001, table 1: two lags, a gain, and how much of the rate is in it."""
    slow, fast = rng.uniform(0.76, 0.83), rng.uniform(0.35, 0.5)
    poles = (1 - slow) * (1 - fast)
    gain, rate = rng.uniform(0.75, 1.1), rng.uniform(3.2, 4.2)
    # ° per m and ° per m/s, at steps of 0.1 s
    before = rate * 10.0 * poles
    return Steering(
        a=(-(slow + fast), slow * fast),
        b=(-gain * poles - before, before),
        c=rng.uniform(0.0, 0.5),
        noise_sd=rng.uniform(0.2, 0.3),
    )
