"""A planted drive with its truth, and the names of the effects: what both simulators share.

The simulators import nothing of canid's simulation or effects: the engine must never meet its own formulas.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

NOISES = ("white", "ar1", "ar4", "resonant", "state", "mix")
PROFILES = ("mixed", "urban", "motorway")

# where it sits -> the public names of canid's catalogue
EFFECTS: dict[str, tuple[str, ...]] = {
    "driver": (
        "headway_dead_zone",
        "relative_speed_dead_zone",
        "looming_threshold",
        "looming_gain",
        "asymmetric_gain",
        "gain_drift",
        "gain_change",
        "headway_drift",
        "delay_drift",
        "attention_gap",
        "act_and_wait",
        "standstill_gap",
        "speed_gain",
        "comfort_speed",
        "second_lag",
        "lead_acceleration",
        "pedal_ceiling",
        "backlash",
        "periodic_task",
    ),
    "remnant": ("heavy_tails", "state_dependent_scale", "clustered_scale"),
    "mask": ("cruise_control", "gear_shift", "cut_in", "brake_overlap", "stale_signal"),
    "sensing": (
        "range_offset",
        "speed_scale",
        "range_rate_scale",
        "range_rate_sign",
        "radar_latency",
        "clock_skew",
    ),
    "vehicle": (
        "road_grade",
        "headwind",
        "engine_braking",
        "power_limit",
        "gear_ratio",
        "turbo_lag",
        "pedal_map",
        "actuator_lag",
    ),
}

# What a real driver might show and canid's catalogue does not hold: it must come out "unexplained". A simulator
# need not know all of them; one that it does not know is refused with ValueError, as any other name is.
OUTSIDE: tuple[str, ...] = (
    "saturating_speed",  # tanh of relative speed
    "quadratic_headway",  # e + c e|e|
    "speed_wander_bias",  # a pedal bias that follows a signal nobody measures, as the road's curvature
    "preview_gap_rate",  # answers the headway error as it will be
    "headway_hysteresis",  # wants another headway after closing than after opening
    "foot_rate",  # a pedal of limited speed
    "lingering_error",  # an integral of the headway error that leaks away
    "aroused_gain",  # gains that grow after turmoil and calm down slowly
    "pulse_and_glide",  # two pedal levels that change at thresholds of relative speed (action points)
    "brake_light_startle",  # one size of fright whenever the lead brakes hard, however hard
    "felt_acceleration",  # damps what the own car is felt to do
    "pedal_steps",  # the driver prefers some pedal positions: a staircase
    "uneven_lag",  # lifts faster than it presses
    "speed_keeping",  # holds on to the speed of the last minute
)

# what freezes in `stale_signal`, by the number that its parameter `signal` holds: signals of one sender
FREEZES: tuple[tuple[str, ...], ...] = (("pedal",), ("speed",), ("gap", "range_rate"))


class Planted(NamedTuple):
    """One drive as it was, without any sensor between."""

    dt: float  # s, the step of the columns
    # "t" (s) and role -> (n,) in the role's unit; pedal after every effect and limit
    columns: dict[str, Array]
    demand: Array  # (n,) %: the driver with all effects along this very trajectory, without remnant, before the limits
    remnant: Array  # (n,) %: the driver's own noise that was added
    truth: dict[str, Any]  # JSON-able: see `Plant`
    # driver's effect -> (n,) %: `demand` along this very trajectory with that one switched off; empty: not known
    without: dict[str, Array] = {}  # noqa: RUF012 - nobody writes to it


class Plant(Protocol):
    """A planting simulator.

    `effects`: id -> {parameter: value}; {} draws a plausible strength by the seed; no effect at all is a clean drive.
    What is measured wrongly (`sensing`, `stale_signal`) stands in `truth` alone and is applied by `sensors`:
    columns stay true. Columns: pedal, speed, gap, range_rate (lead - own, positive = opening), accel, brake, lead_valid,
    cruise_active, clutch, grade, altitude, gnss_speed, gear, engine_speed. The remnant is inside the loop.
    `truth` holds simulator, seed, profile, noise, minutes, driver {K1, K2, tau1, tau2, dead_time1, dead_time2,
    headway_desired, offset, noise_sd}, car {...}, effects {id: {parameter: value}}, and for events
    episodes {id: [[start, stop], ...]} in s.
    """

    def __call__(
        self,
        effects: Mapping[str, Mapping[str, float]],
        *,
        seed: int,
        minutes: float,
        noise: str,
        profile: str,
        **changes: Any,
    ) -> Planted:
        """Plant; ValueError for a name that it does not know."""
        ...
