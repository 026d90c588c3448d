"""Which causes the diagnosis must find in drives of the two planting simulators, at which strengths, and how often it did.

The names are written down here, not taken from the catalogue: a cause that is taken out of it is missed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tests.plants import plant_one, plant_two
from tests.plants.planted_drive import Planted

PLANTS: dict[str, Callable[..., Planted]] = {"one": plant_one.plant, "two": plant_two.plant}
# the remnant's own effects are at the rate of the samples: behind a resonance they are below a step of the sensor
NOISES = ("white", "ar1", "ar4", "mix")
Ranges = dict[str, tuple[float, float]]


class Required(NamedTuple):
    """A cause, the strengths between which it is drawn, and how often it was named."""

    block: str  # "driver", "remnant", "mask", "sensing", "vehicle"
    between: Ranges  # parameter -> lowest and highest; the others are drawn by the simulator
    minutes: float = 8.0
    plants: tuple[str, ...] = ("one", "two")  # that can show it
    profiles: tuple[str, ...] = ("mixed", "urban", "motorway")
    noises: tuple[str, ...] = NOISES
    either_sign: bool = False
    # named, of how many drives drawn like this; those that were drawn before a range was narrowed are not counted
    rate: tuple[int, int] = (0, 0)


class Drawn(NamedTuple):
    """One drive as drawn."""

    plant: str
    effects: dict[str, dict[str, float]]
    seed: int
    minutes: float
    noise: str
    profile: str

    def drive(self) -> Planted:
        """Simulate it."""
        return PLANTS[self.plant](
            self.effects,
            seed=self.seed,
            minutes=self.minutes,
            noise=self.noise,
            profile=self.profile,
        )


def draw(cause: str, seed: int) -> Drawn:
    """Draw simulator, strength, noise and road of one drive.

    Args:
        cause: its name in `REQUIRED`.
        seed: the same seed gives the same drive.
    """
    of, rng = REQUIRED[cause], np.random.default_rng(seed)
    sign = float(rng.choice([-1.0, 1.0])) if of.either_sign else 1.0
    strength = {name: round(sign * rng.uniform(*ends), 4) for name, ends in of.between.items()}
    if cause == "stale_signal":
        strength["signal"] = float(rng.integers(1, 3))  # a pedal that hangs looks like one that is held
    return Drawn(
        str(rng.choice(of.plants)), {cause: strength}, seed, of.minutes, str(rng.choice(of.noises)),
        str(rng.choice(of.profiles)),
    )  # fmt: skip


# What no drive on a road shows, and what hardly one of some minutes does; the report lists the first ones as not testable,
# but for backlash, which has no form of its own.
NOT_SHOWN = {
    "second_lag": "below 0.5 Hz a second lag is the same as a dead time",
    "backlash": "the driver's own noise fills the play; what is left is a dead time",
    "range_offset": "a driver who keeps that distance gives the same drive",
    "headwind": "rolling resistance and drag take it up",
    "clock_skew": "named on 1 of 12 drives of 15 min in town, at 0.7 to 1 s over the drive: a drive of an hour is needed",
}

# Required in every run by test_found_and_silent.py, on drives of canid's own simulator: of two lags in series the shorter
# is named, and only where no car has as much; the planted cars' own lags are short.
OWN_SIMULATOR = ("actuator_lag",)

REQUIRED: dict[str, Required] = {
    "headway_dead_zone": Required(
        "driver",
        {"width": (0.7, 0.9)},
        12.0,
        profiles=("mixed", "urban"),
        noises=("white", "mix"),
        rate=(11, 12),
    ),
    "relative_speed_dead_zone": Required("driver", {"width": (0.7, 1.2)}, rate=(9, 9)),
    "looming_threshold": Required("driver", {"threshold": (0.002, 0.004)}, rate=(9, 9)),
    "looming_gain": Required("driver", {"exponent": (0.7, 1.1)}, rate=(7, 9)),
    "asymmetric_gain": Required("driver", {"share": (0.35, 0.5)}, rate=(22, 22)),
    "gain_drift": Required("driver", {"rate": (0.6, 0.9)}, either_sign=True, rate=(8, 8)),
    "gain_change": Required("driver", {"share": (0.4, 0.55)}, rate=(8, 8)),
    "headway_drift": Required(
        "driver",
        {"sd": (0.5, 0.7)},
        15.0,
        plants=("two",),
        profiles=("mixed", "motorway"),
        noises=("white",),
        rate=(12, 16),
    ),
    "delay_drift": Required("driver", {"rate": (0.7, 1.0)}, rate=(7, 8)),
    "attention_gap": Required("driver", {"per_minute": (1.0, 1.5), "duration": (3.0, 5.0)}, rate=(8, 8)),
    "act_and_wait": Required("driver", {"interval": (0.9, 1.8)}, rate=(6, 8)),
    "standstill_gap": Required("driver", {"distance": (5.0, 8.0)}, profiles=("urban",), rate=(17, 19)),
    "speed_gain": Required(
        "driver", {"exponent": (1.2, 1.6)}, 12.0, profiles=("mixed",), noises=("white", "mix"), rate=(15, 16)
    ),
    "comfort_speed": Required("driver", {"gain": (1.5, 2.5)}, rate=(6, 8)),
    "lead_acceleration": Required("driver", {"gain": (6.0, 9.0)}, profiles=("mixed", "urban"), rate=(18, 22)),
    "pedal_ceiling": Required("driver", {}, rate=(8, 8)),
    "periodic_task": Required("driver", {"amplitude": (2.0, 3.5), "frequency": (0.08, 0.28)}, rate=(8, 8)),
    "heavy_tails": Required("remnant", {"freedom": (2.5, 4.0)}, rate=(8, 8)),
    "state_dependent_scale": Required("remnant", {"own": (0.35, 0.5)}, rate=(8, 8)),
    "clustered_scale": Required("remnant", {}, rate=(8, 8)),
    "cruise_control": Required("mask", {}, 6.0, rate=(8, 8)),
    "gear_shift": Required("mask", {}, 6.0, rate=(8, 8)),
    "cut_in": Required("mask", {"share": (0.4, 0.5)}, 6.0, rate=(12, 12)),
    "brake_overlap": Required("mask", {}, 6.0, rate=(8, 8)),
    "stale_signal": Required("mask", {}, 6.0, rate=(7, 8)),
    "speed_scale": Required("sensing", {"share": (0.03, 0.05)}, 6.0, either_sign=True, rate=(8, 8)),
    "range_rate_scale": Required("sensing", {"share": (0.1, 0.2)}, 6.0, either_sign=True, rate=(8, 8)),
    "range_rate_sign": Required("sensing", {}, 6.0, rate=(8, 8)),
    "radar_latency": Required("sensing", {"delay": (0.3, 0.45)}, 15.0, profiles=("urban",), rate=(8, 8)),
    "road_grade": Required("vehicle", {"sd": (3.2, 4.5)}, rate=(8, 8)),
    "engine_braking": Required("vehicle", {"strength": (0.7, 1.0)}, profiles=("mixed", "urban"), rate=(9, 9)),
    "power_limit": Required("vehicle", {}, profiles=("mixed", "urban"), rate=(8, 8)),
    "gear_ratio": Required("vehicle", {"share": (0.18, 0.35)}, profiles=("mixed", "urban"), rate=(8, 8)),
    "turbo_lag": Required(
        "vehicle", {"tau": (0.9, 1.4)}, plants=("two",), profiles=("mixed", "urban"), rate=(8, 8)
    ),
    "pedal_map": Required("vehicle", {"curvature": (0.6, 0.8)}, profiles=("mixed", "urban"), rate=(12, 12)),
}
