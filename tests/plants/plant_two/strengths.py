"""How strong an effect is that nobody gave a strength: drawn over what reference/diagnosis.md, section 2, calls usual."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tests.plants.plant_two.car import Car
from tests.plants.plant_two.road import Traffic
from tests.plants.planted_drive import FREEZES


class Situation(NamedTuple):
    """What a plausible strength depends on."""

    traffic: Traffic
    car: Car
    seconds: float


Range = tuple[float, float]

# effect -> parameter -> range; both ends have one sign, and the logarithm is uniform between them
USUAL: dict[str, dict[str, Range]] = {
    "headway_dead_zone": {"width": (0.15, 0.6)},  # s
    "relative_speed_dead_zone": {"width": (0.3, 1.2)},  # m/s
    "looming_threshold": {"threshold": (0.001, 0.004)},  # rad/s
    "looming_gain": {"exponent": (0.25, 0.8)},
    "asymmetric_gain": {"share": (0.15, 0.5)},
    "gain_drift": {"rate": (0.3, 1.0)},
    "gain_change": {"share": (0.2, 0.55)},
    "headway_drift": {"sd": (0.15, 0.5)},  # s
    "delay_drift": {"rate": (0.15, 0.4)},  # s over the drive
    "attention_gap": {"per_minute": (0.4, 1.5), "duration": (2.0, 5.0)},
    "act_and_wait": {"interval": (0.5, 2.0)},  # s
    "standstill_gap": {"distance": (2.0, 8.0)},  # m
    "speed_gain": {"exponent": (0.4, 1.2)},
    "comfort_speed": {"gain": (0.6, 2.5)},  # % per m/s
    "second_lag": {"tau": (0.15, 0.6)},  # s
    "lead_acceleration": {"gain": (1.5, 6.0)},  # % per m/s²
    "pedal_ceiling": {},
    "backlash": {"width": (2.0, 7.0)},  # %
    "periodic_task": {"amplitude": (1.0, 3.0), "frequency": (0.06, 0.3)},  # %, Hz
    "heavy_tails": {"freedom": (2.5, 6.0)},
    "state_dependent_scale": {"own": (0.2, 0.5), "lead": (0.05, 0.2)},  # of log sd per 0.3 m/s²
    "clustered_scale": {"sd": (0.4, 0.8)},  # of log sd
    "felt_acceleration": {"gain": (2.0, 7.0)},  # % per m/s²
    "brake_light_startle": {"drop": (5.0, 14.0), "threshold": (0.5, 1.2)},  # %, m/s²
    "speed_keeping": {"gain": (0.4, 1.2), "memory": (15.0, 60.0)},  # % per m/s, s
    "pulse_and_glide": {"swing": (2.0, 5.0), "band": (0.3, 0.8)},  # %, m/s
    "pedal_steps": {"step": (5.0, 12.0)},  # %
    "uneven_lag": {"tau": (0.4, 1.2)},  # s
    "cruise_control": {"duration": (60.0, 150.0)},  # s
    "gear_shift": {"per_minute": (0.6, 2.5), "duration": (0.4, 1.0)},  # s
    "cut_in": {"share": (0.5, 0.65)},  # of the gap that is left
    "brake_overlap": {"per_minute": (0.3, 1.0), "duration": (1.0, 3.0)},  # s
    "stale_signal": {"per_minute": (0.2, 0.6), "duration": (2.0, 8.0)},  # s
    "range_offset": {"distance": (0.8, 4.0)},  # m
    "speed_scale": {"share": (0.01, 0.05)},
    "range_rate_scale": {"share": (0.04, 0.15)},
    "range_rate_sign": {},
    "radar_latency": {"delay": (0.05, 0.3)},  # s
    "clock_skew": {"rate": (0.1, 0.4)},  # s over the drive
    "road_grade": {"sd": (0.7, 2.5)},  # %
    "headwind": {"speed": (4.0, 12.0)},  # m/s
    "engine_braking": {"strength": (0.3, 0.8)},  # m/s²
    "power_limit": {},
    "gear_ratio": {"share": (0.06, 0.2)},  # from gear to gear
    "turbo_lag": {"tau": (0.4, 1.2)},  # s
    "pedal_map": {"curvature": (0.2, 0.6)},
    "actuator_lag": {"tau": (0.15, 0.5)},  # s
}
# drawn with either sign
EITHER = {"gain_drift", "range_offset", "speed_scale", "range_rate_scale", "clock_skew"}
# of a drive, within which something happens that happens once
MIDDLE = (0.25, 0.75)


def parameters(
    effect: str, given: Mapping[str, float], situation: Situation, rng: np.random.Generator
) -> dict[str, float]:
    """Complete an effect's parameters: what is given stands, what is not is drawn.

    Raises:
        ValueError: a parameter that the effect does not have.
    """
    drawn = {name: _between(span, rng) for name, span in USUAL[effect].items()}
    if effect in EITHER and rng.uniform() < 0.5:
        drawn = {name: -value for name, value in drawn.items()}
    traffic, car, seconds = situation
    if effect in ("gain_change", "cut_in"):
        drawn["time"] = seconds * rng.uniform(*MIDDLE)
    if effect == "cruise_control":
        drawn["duration"] = min(drawn["duration"], 0.25 * seconds)
        drawn["start"] = rng.uniform(0.15, 0.6) * seconds
    if effect == "stale_signal":
        drawn["signal"] = float(rng.integers(len(FREEZES)))
    if effect == "comfort_speed":
        # felt in the upper half of the speeds that the lead drives
        drawn["speed"] = traffic.slowest + rng.uniform(0.5, 0.75) * (traffic.fastest - traffic.slowest)
    if effect == "pedal_ceiling":
        # enough to hold the highest speed, for a car that cannot follow shows no answers, and more where the lead is brisk
        drawn["level"] = car.hold(traffic.fastest) + traffic.firm * rng.uniform(3.5, 12.0)
    if effect == "power_limit":
        # W/kg; so too for the engine
        top = traffic.fastest
        drawn["power"] = top * (car.rolling + car.drag * top * top) * rng.uniform(1.3, 2.0)
    unknown = set(given) - set(drawn)
    if unknown:
        raise ValueError(
            f"{effect} has {', '.join(drawn) or 'no parameter'}, not {', '.join(sorted(unknown))}"
        )
    return {**drawn, **{name: float(value) for name, value in given.items()}}


def _between(span: Range, rng: np.random.Generator) -> float:
    return float(math.exp(rng.uniform(math.log(span[0]), math.log(span[1]))))
