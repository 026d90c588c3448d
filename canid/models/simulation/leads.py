"""How the vehicle ahead drives: random but plausible speed profiles."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.values.types import Array


class Profile(NamedTuple):
    """What a kind of road does to the lead's speed."""

    low: float  # m/s; the speeds that it wants lie between low and high
    high: float
    hold: tuple[float, float]  # s; for how long it wants one speed
    accel: float  # m/s²; how hard it accelerates (it brakes 1.3 times as hard)
    unrest: float  # m/s²; standard deviation of the acceleration by unrest of its pedal


# Speeds and holding times of roads outside towns, in towns (without standing: at rest a headway means
# nothing) and of dense motorway traffic. The unrest moves the speed by about 1 m/s: a lead that only cruises
# does not identify a driver's gains.
LEADS = {
    "mixed": Profile(10.0, 33.0, (12.0, 42.0), 1.0, 0.35),
    "urban": Profile(5.0, 14.0, (8.0, 25.0), 1.2, 0.35),
    "motorway": Profile(24.0, 33.0, (20.0, 60.0), 0.7, 0.30),
}
_WANTING = 0.35  # 1/s; about 3 s to take up a new speed, as measured leads do
_ENGINE = 0.6  # s; lag between pedal and acceleration
_UNREST_TIME = 2.0  # s; duration of one movement
_SLOWEST = 3.0  # m/s; never stands, see LEADS


def speed_profile(profile: Profile, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw a lead's speed.

    Args:
        profile: of what road.
        n: number of samples.
        dt: their distance, s.
        rng: source of random numbers.

    Returns:
        (n,) m/s.

    Example:
        >>> v = speed_profile(LEADS["urban"], 6000, 0.01, np.random.default_rng(1))
        >>> bool(v.min() >= 3.0 and v.max() < 18.0)
        True
    """
    shocks = (rng.standard_normal(n) * profile.unrest * math.sqrt(2 * dt / _UNREST_TIME)).tolist()
    speed = wanted = 0.5 * (profile.low + profile.high)
    accel = unrest = until = limit = 0.0
    out = np.empty(n)
    for k, shock in enumerate(shocks):
        if k * dt >= until:
            wanted = rng.uniform(profile.low, profile.high)
            until = k * dt + rng.uniform(*profile.hold)
            limit = profile.accel * rng.uniform(0.5, 1.5)
        unrest += -unrest * dt / _UNREST_TIME + shock
        aim = min(max(_WANTING * (wanted - speed), -1.3 * limit), limit)
        accel += (aim + unrest - accel) * dt / _ENGINE
        speed = max(speed + accel * dt, _SLOWEST)
        out[k] = speed
    return out
