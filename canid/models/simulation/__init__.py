"""Drives with known truth: a lead, a driver whose parameters are known, and a car, in closed loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from canid.models.effects import CATALOGUE, LANE_CATALOGUE
from canid.models.effects.effect import Effect
from canid.models.simulation.bus_frames import START_UTC, frames, truth_text
from canid.models.simulation.car import Car
from canid.models.simulation.driver import DriverTruth, draw_driver
from canid.models.simulation.following import Simulation, follow
from canid.models.simulation.lane import Steering, keep_lane
from canid.models.simulation.leads import LEADS
from canid.models.simulation.noise import NOISES
from canid.models.simulation.planted_effects import Shares, Strength

__all__ = [
    "LEADS",
    "MAX_MINUTES",
    "MIN_MINUTES",
    "NOISES",
    "PROFILES",
    "START_UTC",
    "Car",
    "DriverTruth",
    "Shares",
    "Simulation",
    "Steering",
    "draw_driver",
    "frames",
    "simulate",
    "truth_text",
]

# What `profile` may be: behind a lead on three kinds of road, or alone, keeping the lane.
PROFILES = (*LEADS, "lane")
# of a drive: its motion needs some samples, and a day of 100 Hz is 2 GB of columns
MIN_MINUTES, MAX_MINUTES = 0.01, 1440.0


def simulate(
    minutes: float = 3.0,
    seed: int = 1,
    profile: str = "mixed",
    noise: str = "ar1",
    *,
    driver: DriverTruth | Steering | None = None,
    lost: Sequence[tuple[float, float]] = (),
    cut_in: float | None = None,
    grade_sd: float = 0.8,
    car: Car | None = None,
    hide: Mapping[str, Strength] | None = None,
    catalogue: tuple[Effect, ...] | None = None,
    curvature_sd: float = 0.0,
) -> Simulation:
    """Simulate a drive in closed loop at 100 Hz: behind another vehicle, or keeping the lane.

    Driver: u = offset + K1·L1[headway − headway_desired] + K2·L2[range_rate] + noise with
    L = e^(−θs)/(1+τs) (Grover eq. 2.1, 2.6–2.9); the pedal is u between 0 and 100 %, below 0 the brake works.

    Args:
        minutes: duration.
        seed: the same seed gives the same drive.
        profile: "mixed", "urban" or "motorway": how the lead drives; "lane": no lead, the driver of Chen &
            Ulsoy 2001 keeps the lane, and only `driver`, `car`, `hide`, `catalogue` and `curvature_sd` of the
            following apply.
        noise: kind of the driver's noise, one of `NOISES`.
        driver: the driver; None draws a plausible one by the seed (of "lane": takes the paper's).
        lost: (start, stop) in s: the radar loses the lead, the driver does not.
        cut_in: s; another vehicle cuts in between the two.
        grade_sd: standard deviation of the road's slope, %.
        car: the car that is driven.
        hide: effects that driver, car or sensors have: id -> parameters; None or (): a strength that shows.
        catalogue: effects that `hide` may name; None: those of the task.
        curvature_sd: standard deviation of the road's curvature, 1/m, of "lane"; 0: a straight road, or curves where a
            hidden effect needs them.

    Returns:
        Columns of what truly happened, and the truth.

    Raises:
        ValueError: unknown profile or noise, or too short.

    Example:
        >>> drive = simulate(minutes=1, seed=3)
        >>> drive.columns["pedal"].shape, sorted(drive.truth["channels"])
        ((6000,), ['headway_error', 'range_rate'])
    """
    if profile not in PROFILES:
        raise ValueError(f"profile {profile!r} is not one of {', '.join(PROFILES)}")
    if noise not in NOISES:
        raise ValueError(f"noise {noise!r} is not one of {', '.join(NOISES)}")
    if not MIN_MINUTES <= minutes <= MAX_MINUTES:
        raise ValueError(
            f"minutes must be {MIN_MINUTES:g} at least and {MAX_MINUTES:g} at most, not {minutes}"
        )
    if profile == "lane":
        if isinstance(driver, DriverTruth):
            raise ValueError("profile 'lane' takes a driver of type Steering")
        lane = LANE_CATALOGUE if catalogue is None else catalogue
        return keep_lane(minutes, seed, driver or Steering(), car or Car(), hide or {}, lane, curvature_sd)
    if isinstance(driver, Steering):
        raise ValueError(f"profile {profile!r} takes a driver of type DriverTruth")
    behind = CATALOGUE if catalogue is None else catalogue
    return follow(
        minutes, seed, profile, noise, driver, lost, cut_in, grade_sd, car or Car(), hide or {}, behind
    )
