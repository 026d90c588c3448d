"""How strong an effect is where nobody says: drawn from what people, cars and sensors show.

Ranges are those of the literature that canid's catalogue rests on: looming thresholds of Hoffmann & Mortimer 1996,
speed thresholds of Wiedemann 1974 and Pariota & Bifulco 2015, glances of 1.5 to 6 s, gains that fall by up to a half.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from tests.plants.plant_one.car import Car
from tests.plants.plant_one.lead import ROADS
from tests.plants.planted_drive import FREEZES, Array


class Scene(NamedTuple):
    """What a plausible strength depends on."""

    rng: np.random.Generator
    profile: str
    duration: float  # s
    car: Car
    pedal: Callable[[], Array]  # (n,) % of the same drive without the effect

    def of(self, low: float, high: float) -> float:
        """Draw evenly; four figures, so that what is written down is what is planted."""
        return _short(self.rng.uniform(low, high))

    def either(self, low: float, high: float) -> float:
        """Draw the size evenly, and the sign by chance."""
        return self.of(low, high) * (1.0 if self.rng.uniform() < 0.5 else -1.0)


def _short(x: float) -> float:
    return float(f"{x:.4g}")


def _ceiling(s: Scene) -> dict[str, float]:
    return {"level": _short(float(np.quantile(s.pedal(), s.rng.uniform(0.80, 0.95))))}


def _comfort(s: Scene) -> dict[str, float]:
    road = ROADS[s.profile]
    return {"gain": s.of(0.6, 2.0), "speed": _short(road.low + (road.high - road.low) * s.of(0.4, 0.7))}


def _power(s: Scene) -> dict[str, float]:
    # W/kg; what the fastest leg needs at a steady speed, and somewhat more to speed up with
    fastest = ROADS[s.profile].high
    steady = s.car.power * s.car.hold(fastest) * fastest
    return {"power": _short(steady * s.of(1.15, 1.6))}


STRENGTHS: dict[str, Callable[[Scene], dict[str, float]]] = {
    # driver
    "headway_dead_zone": lambda s: {"width": s.of(0.15, 0.6)},
    "relative_speed_dead_zone": lambda s: {"width": s.of(0.2, 1.0)},
    "looming_threshold": lambda s: {"threshold": s.of(0.0006, 0.003)},
    "looming_gain": lambda s: {"exponent": s.of(0.3, 1.0)},
    "asymmetric_gain": lambda s: {"share": s.of(0.15, 0.5)},
    "gain_drift": lambda s: {"rate": s.either(0.3, 0.9)},
    "gain_change": lambda s: {"share": s.of(0.2, 0.5), "time": _short(s.duration * s.of(0.25, 0.75))},
    "headway_drift": lambda s: {"sd": s.of(0.1, 0.35)},
    "delay_drift": lambda s: {"rate": s.of(0.15, 0.4)},
    "attention_gap": lambda s: {"per_minute": s.of(0.3, 1.2), "duration": s.of(2.0, 5.0)},
    "act_and_wait": lambda s: {"interval": s.of(0.4, 1.6)},
    "standstill_gap": lambda s: {"distance": s.of(1.5, 8.0)},
    "speed_gain": lambda s: {"exponent": s.of(0.3, 1.0)},
    "comfort_speed": _comfort,
    "second_lag": lambda s: {"tau": s.of(0.1, 0.4)},
    "lead_acceleration": lambda s: {"gain": s.of(1.5, 6.0)},
    "pedal_ceiling": _ceiling,
    "backlash": lambda s: {"width": s.of(2.0, 7.0)},
    "periodic_task": lambda s: {"amplitude": s.of(1.0, 4.0), "frequency": s.of(0.05, 0.3)},
    # remnant; slopes of log sd per 0.3 m/s² of |acceleration|
    "heavy_tails": lambda s: {"freedom": s.of(2.5, 6.0)},
    "state_dependent_scale": lambda s: {"own": s.of(0.2, 0.5), "lead": s.of(0.0, 0.2)},
    "clustered_scale": lambda s: {"ratio": s.of(2.0, 4.0), "duration": s.of(4.0, 8.0)},
    # masks
    "cruise_control": lambda s: {"share": s.of(0.15, 0.6)},
    "gear_shift": lambda s: {"per_minute": s.of(0.5, 3.0)},
    "cut_in": lambda s: {"per_minute": s.of(0.1, 0.3), "share": s.of(0.5, 0.65)},
    "brake_overlap": lambda s: {"per_minute": s.of(0.3, 1.0)},
    "stale_signal": lambda s: {
        "per_minute": s.of(0.1, 0.5),
        "signal": float(s.rng.integers(len(FREEZES))),
    },
    # sensing
    "range_offset": lambda s: {"distance": s.either(0.5, 3.0)},
    "speed_scale": lambda s: {"share": s.either(0.01, 0.05)},
    "range_rate_scale": lambda s: {"share": s.either(0.05, 0.2)},
    "range_rate_sign": lambda s: {},
    "radar_latency": lambda s: {"delay": s.of(0.06, 0.25)},
    "clock_skew": lambda s: {"rate": s.of(0.08, 0.25)},
    # vehicle
    "road_grade": lambda s: {"sd": s.of(1.2, 2.5)},
    "headwind": lambda s: {"speed": s.of(4.0, 10.0)},
    "engine_braking": lambda s: {"strength": s.of(0.15, 0.5)},
    "power_limit": _power,
    "gear_ratio": lambda s: {"share": s.of(0.15, 0.4)},
    "turbo_lag": lambda s: {"tau": s.of(0.5, 1.2)},
    "pedal_map": lambda s: {"curvature": s.of(0.2, 0.6)},
    "actuator_lag": lambda s: {"tau": s.of(0.15, 0.4)},
    # outside the catalogue
    "saturating_speed": lambda s: {"limit": s.of(1.0, 2.0)},
    "quadratic_headway": lambda s: {"curvature": s.of(2.0, 4.0)},
    "speed_wander_bias": lambda s: {"depth": s.of(4.0, 9.0)},
    "preview_gap_rate": lambda s: {"preview": s.of(2.0, 6.0)},
    "headway_hysteresis": lambda s: {"width": s.of(0.3, 0.9)},
    "foot_rate": lambda s: {"rate": s.of(2.5, 6.0)},
    "lingering_error": lambda s: {"gain": s.of(0.04, 0.12), "time": s.of(15.0, 40.0)},
    "aroused_gain": lambda s: {"growth": s.of(0.3, 0.9), "time": s.of(15.0, 40.0)},
}


def check(effects: Mapping[str, Mapping[str, float]]) -> None:
    """Refuse names that this simulator does not know."""
    unknown = sorted(set(effects) - set(STRENGTHS))
    if unknown:
        raise ValueError(f"effects {', '.join(unknown)} are not known; known are {', '.join(STRENGTHS)}")


def settle(name: str, given: Mapping[str, float], scene: Scene) -> dict[str, float]:
    """Return an effect's parameters: those given, the rest drawn.

    Raises ValueError for a parameter that the effect does not have.
    """
    # the ceiling alone costs a drive to draw
    drawn = (
        {"level": float("nan")} if name == "pedal_ceiling" and "level" in given else STRENGTHS[name](scene)
    )
    unknown = sorted(set(given) - set(drawn))
    if unknown:
        raise ValueError(f"{name} has no {', '.join(unknown)}, but {', '.join(drawn) or 'no parameter'}")
    return {key: float(given.get(key, value)) for key, value in drawn.items()}
