"""Effects in what the driver perceives and wants: everything before the lag."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from tests.plants.plant_two.driver import MIN_SPEED_M_S, Touch
from tests.plants.plant_two.road import random_walk
from tests.plants.plant_two.shapes import above, dead_zone, hyperbolic_dead_zone, switch


class Scene(NamedTuple):
    """What an effect may know of the drive it is hidden in."""

    dt: float  # s
    n: int
    episodes: list[list[float]]  # of the effect at hand, s
    rng: np.random.Generator  # of the effect at hand


Values = Mapping[str, float]
Make = Callable[[Values, Scene], Touch]

VEHICLE_WIDTH_M = 1.8  # m, of the vehicle ahead
# share of a dead zone's width that its corner takes
CORNER = 0.2


def headway_dead_zone(p: Values, scene: Scene) -> Touch:
    width = p["width"]
    return lambda x, k, gap, v, w, la, a: dead_zone(x, width, CORNER * width)


def relative_speed_dead_zone(p: Values, scene: Scene) -> Touch:
    width = p["width"]
    return lambda x, k, gap, v, w, la, a: dead_zone(x, width, CORNER * width)


def looming_threshold(p: Values, scene: Scene) -> Touch:
    threshold = p["threshold"]

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        width = threshold * gap * gap / VEHICLE_WIDTH_M
        return hyperbolic_dead_zone(x, width, CORNER * width)

    return touch


def looming_gain(p: Values, scene: Scene) -> Touch:
    exponent = p["exponent"]
    # 2 m: the gain stays finite bumper to bumper
    return lambda x, k, gap, v, w, la, a: x * (30.0 / math.hypot(gap, 2.0)) ** exponent


def asymmetric_gain(p: Values, scene: Scene) -> Touch:
    share = p["share"]
    return lambda x, k, gap, v, w, la, a: x * (1.0 - share * math.tanh(w / 0.25))


def gain_drift(p: Values, scene: Scene) -> Touch:
    rate, n = p["rate"], scene.n
    return lambda x, k, gap, v, w, la, a: x * (1.0 + rate * (k / n - 0.5))


def gain_change(p: Values, scene: Scene) -> Touch:
    share, middle, dt = p["share"], p["time"], scene.dt
    # a logistic curve goes from 5 to 95 % in six of its widths
    soft = scene.rng.uniform(5.0, 20.0) / 6.0
    return lambda x, k, gap, v, w, la, a: x * (1.0 - share * switch(k * dt - middle, soft))


def headway_drift(p: Values, scene: Scene) -> Touch:
    slow = random_walk(scene.rng.uniform(30.0, 90.0), p["sd"], scene.n, scene.dt, scene.rng).tolist()
    return lambda x, k, gap, v, w, la, a: x + slow[k]


def delay_drift(p: Values, scene: Scene) -> Touch:
    rate, n = p["rate"], scene.n
    return lambda x, k, gap, v, w, la, a: x + rate * (k / n - 0.5)


def standstill_gap(p: Values, scene: Scene) -> Touch:
    distance = p["distance"]
    return lambda x, k, gap, v, w, la, a: x + distance / (v if v > MIN_SPEED_M_S else MIN_SPEED_M_S)


def speed_gain(p: Values, scene: Scene) -> Touch:
    exponent = p["exponent"]
    return lambda x, k, gap, v, w, la, a: x * (math.hypot(v, 0.5) / 20.0) ** exponent


def comfort_speed(p: Values, scene: Scene) -> Touch:
    gain, speed = p["gain"], p["speed"]
    return lambda x, k, gap, v, w, la, a: x - gain * above(v, speed, 0.4)


def lead_acceleration(p: Values, scene: Scene) -> Touch:
    gain = p["gain"]
    return lambda x, k, gap, v, w, la, a: x + gain * la


# --- in nobody's catalogue ---------------------------------------------------------------------------


def felt_acceleration(p: Values, scene: Scene) -> Touch:
    """The body's own sense: less gas while the car accelerates."""
    gain = p["gain"]
    return lambda x, k, gap, v, w, la, a: x - gain * a


def brake_light_startle(p: Values, scene: Scene) -> Touch:
    """A fright of one size when the lead brakes harder than a threshold; it fades within 1.5 s."""
    drop, threshold, dt = p["drop"], p["threshold"], scene.dt
    fright = 0.0

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        nonlocal fright
        fright += dt * (switch(-la - threshold, 0.1) * (1.0 - fright) / 0.2 - fright / 1.5)
        return x - drop * fright

    return touch


def speed_keeping(p: Values, scene: Scene) -> Touch:
    """Who has driven one speed for a while lets go of it unwillingly."""
    gain, memory, dt = p["gain"], p["memory"], scene.dt
    habit = math.nan

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        nonlocal habit
        habit = v if math.isnan(habit) else habit + (v - habit) * dt / memory
        return x - gain * (v - habit)

    return touch


PERCEPTION_EFFECTS: dict[str, tuple[tuple[str, Make], ...]] = {
    "headway_dead_zone": (("error", headway_dead_zone),),
    "relative_speed_dead_zone": (("rate", relative_speed_dead_zone),),
    "looming_threshold": (("rate", looming_threshold),),
    "looming_gain": (("gain2", looming_gain),),
    "asymmetric_gain": (("gain2", asymmetric_gain),),
    "gain_drift": (("gain1", gain_drift), ("gain2", gain_drift)),
    "gain_change": (("gain1", gain_change), ("gain2", gain_change)),
    "headway_drift": (("wanted", headway_drift),),
    "delay_drift": (("delay", delay_drift),),
    "standstill_gap": (("wanted", standstill_gap),),
    "speed_gain": (("gain1", speed_gain),),
    "comfort_speed": (("beside1", comfort_speed),),
    "lead_acceleration": (("beside2", lead_acceleration),),
    "felt_acceleration": (("beside2", felt_acceleration),),
    "brake_light_startle": (("beside2", brake_light_startle),),
    "speed_keeping": (("beside1", speed_keeping),),
}
