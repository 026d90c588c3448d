"""What is drawn before a drive begins: driver, car, lead, effects with their strengths, when events happen."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from tests.plants.plant_two.burst_remnant import BURSTY, BurstRemnant
from tests.plants.plant_two.car import Car, draw_car
from tests.plants.plant_two.driver import Driver, Placed, changed_driver, draw_driver
from tests.plants.plant_two.episodes import EVENTS, episodes
from tests.plants.plant_two.pedal_effects import PEDAL_EFFECTS
from tests.plants.plant_two.perception import PERCEPTION_EFFECTS, Scene
from tests.plants.plant_two.remnant import DAMPING, unit_remnant
from tests.plants.plant_two.road import TRAFFIC, lead
from tests.plants.plant_two.strengths import USUAL, Situation, parameters
from tests.plants.planted_drive import PROFILES, Array

STEP_S = 0.01  # s
IN_DRIVER = {**PERCEPTION_EFFECTS, **PEDAL_EFFECTS}
# vehicle's effect -> the car's number that it sets, and whether it adds to what the car has of it anyway
IN_CAR = {
    "road_grade": ("grade", "sd", False),
    "headwind": ("headwind", "speed", False),
    "engine_braking": ("engine_braking", "strength", False),
    "power_limit": ("power_limit", "power", False),
    "gear_ratio": ("gear_ratio", "share", False),
    "turbo_lag": ("turbo_lag", "tau", False),
    "pedal_map": ("curvature", "curvature", False),
    "actuator_lag": ("second_lag", "tau", True),
}
# m/s by which who cuts in from a slower lane is slower than the lead, and s within which that is over
SLOWER, CATCHES_UP = 1.5, 6.0


class Plan(NamedTuple):
    """A drive before it is driven."""

    seed: int
    n: int
    noise: str
    profile: str
    driver: Driver
    car: Car
    effects: dict[str, dict[str, float]]
    episodes: dict[str, list[list[float]]]  # s
    lead_speed: Array  # (n,) m/s
    lead_accel: Array  # (n,) m/s²
    damping: float  # of resonant noise

    @property
    def pedal_effects(self) -> list[str]:
        """Effects that act on the pedal with its noise."""
        return [e for e in self.effects if e in IN_DRIVER and IN_DRIVER[e][0][0] == "pedal"]

    def stretches(self, effect: str) -> list[list[float]]:
        """[[start, stop], ...] s of an event, [] where it is not planted."""
        return self.episodes.get(effect, [])


def planned(
    effects: Mapping[str, Mapping[str, float]],
    seed: int,
    minutes: float,
    noise: str,
    profile: str,
    changes: Mapping[str, Any],
) -> Plan:
    """Draw a drive; see `plant`."""
    for effect in effects:
        if effect not in USUAL:
            raise ValueError(f"simulator two does not know {effect!r}; it knows {', '.join(sorted(USUAL))}")
    if profile not in PROFILES:
        raise ValueError(f"profile {profile!r} is not one of {', '.join(PROFILES)}")
    strange = set(changes) - {*Driver._fields, *Car._fields, "tau1", "tau2"}
    if strange:
        raise ValueError(f"neither the driver nor the car has {', '.join(sorted(strange))}")
    n = round(minutes * 60.0 / STEP_S)
    traffic = TRAFFIC[profile]
    car = draw_car(chance(seed, "car"))
    car = car._replace(**{name: float(changes[name]) for name in Car._fields if name in changes})
    situation = Situation(traffic, car, n * STEP_S)
    values = {e: parameters(e, p, situation, chance(seed, e, "strength")) for e, p in effects.items()}
    for effect, (field, name, adds) in IN_CAR.items():
        if effect in values:
            car = car._replace(**{field: values[effect][name] + (getattr(car, field) if adds else 0.0)})
    speed, accel = lead(traffic, n, STEP_S, chance(seed, "lead"))
    if "cut_in" in values:
        after = np.arange(n) * STEP_S - values["cut_in"]["time"]
        late = np.where(after >= 0.0, np.exp(-np.maximum(after, 0.0) / CATCHES_UP), 0.0)
        speed, accel = speed - SLOWER * late, accel + SLOWER / CATCHES_UP * late
    driver = draw_driver(car.hold(float(speed.mean())), chance(seed, "driver"))
    return Plan(
        seed,
        n,
        noise,
        profile,
        changed_driver(driver, changes),
        car,
        values,
        {e: episodes(e, values[e], n * STEP_S, chance(seed, e, "episodes")) for e in values if e in EVENTS},
        speed,
        accel,
        float(chance(seed, "damping").uniform(*DAMPING)),
    )


def chance(seed: int, *purpose: str) -> np.random.Generator:
    """One source of chance for each purpose: another effect changes neither the road nor the noise."""
    return np.random.default_rng([seed, 2, zlib.crc32(" ".join(purpose).encode())])


def hung(plan: Plan, without: str = "") -> list[Placed]:
    """Start the driver's effects, all but one; the same plan gives the same effects each time."""
    out = []
    for effect, places in IN_DRIVER.items():
        if effect in plan.effects and effect != without:
            for place, make in places:
                rng = chance(plan.seed, effect, "course")
                scene = Scene(STEP_S, plan.n, plan.stretches(effect), rng)
                out.append(Placed(effect, place, make(plan.effects[effect], scene)))
    return out


def remnant_of(plan: Plan, purpose: str) -> Array:
    """Draw (n,) noise of the plan's kind and unit variance; not yet grown with the answer."""
    return unit_remnant(plan.noise, plan.n, STEP_S, plan.damping, chance(plan.seed, "remnant", purpose))


def bursts_of(plan: Plan) -> BurstRemnant | None:
    """Draw the noise where an effect makes it uneven; None: it is what `remnant_of` draws."""
    values = {effect: how for effect, how in plan.effects.items() if effect in BURSTY}
    if not values:
        return None
    return BurstRemnant(plan.noise, plan.n, STEP_S, plan.damping, values, chance(plan.seed, "bursts"))


def cut_in_at(plan: Plan) -> tuple[int, float]:
    """Sample at which another vehicle cuts in, and the share of the gap that is left; no sample: -1."""
    values = plan.effects.get("cut_in")
    return (-1, 1.0) if values is None else (math.ceil(values["time"] / STEP_S), values["share"])
