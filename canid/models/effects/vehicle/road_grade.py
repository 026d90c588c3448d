"""Slope of the road: the weight acts along it."""

from __future__ import annotations

from canid.models.effects.effect import (
    GRAVITY,
    DriveFeatures,
    Effect,
    Kind,
    Parameter,
    Params,
    Screening,
    Unavailable,
    Value,
    VehicleHooks,
    VehicleState,
    more_than,
)
from canid.models.effects.vehicle.slope import unmeasured_slope
from canid.values.types import Interval


def push(p: Params, state: VehicleState) -> Value:
    """Return the acceleration by the slope, m/s².

    Example:
        >>> round(push((2.0,), VehicleState(0.0, 10.0, 20.0, 1.0, 4.0, 10.0, 0.04)), 4)
        -0.1962
    """
    return -GRAVITY / 100 * p[0] * state.slope


# a measured slope confirms itself where the weight along it is what it must be, within so much of itself
CONFIRMED_WITHIN = 0.4
# %; roads in rolling country have slopes of 1 to 1.5 % rms, of which ten minutes may show 1.8
ROLLING_COUNTRY = 2.0


def without_slope(drive: DriveFeatures) -> Unavailable | None:
    """Nothing measures the slope, or there is none."""
    if drive.level:
        return Unavailable("the road is level", ruled_out=True)
    return unmeasured_slope(drive)


def measured(drive: DriveFeatures) -> tuple[float, ...]:
    """The measured slope's own standard deviation, %."""
    return (drive.slope_sd,)


def hilly(estimate: Interval, drive: DriveFeatures) -> bool:
    """Is the slope confirmed by the weight along it, and surely more than that of rolling country?"""
    confirmed = abs(estimate.value / drive.slope_sd - 1) <= CONFIRMED_WITHIN
    return confirmed and more_than(ROLLING_COUNTRY)(estimate, drive)


EFFECT = Effect(
    id="road_grade",
    says="The road rises and falls: its slope has a standard deviation of {sd} %.",
    where="vehicle",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("sd", "%", 0.0, 15.0, measured, 1.0),),
    needs=("grade",),
    source="weight along the slope, 0.098 m/s² per %",
    absorbed="a constant slope is part of the rolling resistance",
    decides="map grade or altitude",
    vehicle=VehicleHooks(push=push),
    unavailable=without_slope,
    # a slope is as slow as the noise that stands in for it while it is not in the model: whitening hides it
    screening=Screening.NONE,
    unusual=hilly,
    slope_sd=lambda p: float(p[0]),
    found_at=((4.5,), (5.0,)),
    silent_at=((0.5,),),
)
